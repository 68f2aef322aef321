"""The mesh on its way through the sweeps, and what is known of it."""

from __future__ import annotations

from copy import copy

import numpy as np

from ..core.vocabulary import DEAD, FloatArray, Mesh
from ..mesh.blocks import make_blocks
from ..operations.classify import EdgeFlags
from ..operations.split import compact
from ..reference.build import FeaturedReference
from .monitor import Monitor
from .plan import Plan

__all__ = ["Work", "is_large"]

# Below this, handing pieces to threads costs more than it saves when another process holds a core.
_PARALLEL_FACES = 50_000


def is_large(n_faces: int) -> bool:
    """Tell whether a mesh of so many faces is worth more than one thread."""
    return n_faces >= _PARALLEL_FACES


class Work:
    """A mesh that phases change, in place or by putting another one here.

    Attributes
    ----------
    mesh : Mesh
    blocks : Blocks
    featured : FeaturedReference
        The input, as the phases look back at it.
    plan : Plan
    monitor : Monitor
    flags : EdgeFlags or None
        Which edges are long or short, as the splits left them; None where nothing is known.
    step : float
        Root mean square of the moves of the last sweep, in target lengths; infinite where they were not
        measured. Their maximum never comes down: wherever a single edge is flipped, vertices move.
    before : (n, 4) float64 or None
        Vertices before the last moves, where somebody will ask for them.
    keeps_numbers : bool
        Whether elements must keep their numbers, because something else refers to them.
    is_calm : bool
        Whether all that is left to split and collapse is the same few edges, again and again.
    was_guarded : bool
        Whether parts of the mesh were held in some sweep, and may lie off the input.
    varies : bool
        Whether target lengths vary.
    """

    def __init__(
        self,
        mesh: Mesh,
        featured: FeaturedReference,
        plan: Plan,
        monitor: Monitor,
        may_run_parallel: bool,
    ) -> None:
        self.put(mesh)
        self.featured = featured
        self.plan = plan
        self.monitor = monitor
        self.may_run_parallel = may_run_parallel
        self.step = np.inf
        self.before: FloatArray | None = None
        self.keeps_numbers = False
        self.is_calm = False
        self.was_guarded = False
        self.varies = bool(np.ptp(mesh.X[:, 3]) > 0.0) or featured.long_rims is not None

    def put(self, mesh: Mesh) -> None:
        """Go on with another mesh, of which no edge flags are known."""
        self.mesh, self.blocks = mesh, make_blocks(mesh)
        self.flags: EdgeFlags | None = None

    def compact(self, spare: float = 0.0) -> None:
        """Close the holes that removed elements left, with spare room for a share of the faces."""
        self.put(compact(self.mesh, self.blocks, self.is_parallel, spare))

    def trial(self) -> Work:
        """Copy the work: what happens to the copy does not touch this one."""
        trial = copy(self)
        trial.mesh, trial.keeps_numbers = self.mesh.copy(), True
        return trial

    def adopt(self, trial: Work) -> None:
        """Go on with what became of a trial."""
        keeps_numbers = self.keeps_numbers
        self.__dict__.update(trial.__dict__)
        self.keeps_numbers = keeps_numbers

    @property
    def measures_steps(self) -> bool:
        """Whether the moves of a sweep decide on the next one."""
        return self.plan.recipe.tol is not None

    @property
    def n_faces(self) -> int:
        """Number of faces, dead ones and spare room included."""
        return self.mesh.origin.size // 3

    @property
    def is_parallel(self) -> bool:
        """Whether the mesh is worth more than one thread."""
        return self.may_run_parallel and is_large(self.n_faces)

    def count_edges(self) -> float:
        """Count the edges, as three halves of the faces."""
        return 1.5 * float(np.count_nonzero(self.mesh.origin[::3] != DEAD))
