"""The capillary problem: a surface under tension, its enclosed volume, and the wires that hold it."""

from __future__ import annotations

from copy import copy
from typing import Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from ..core.arguments import choice, instance, number
from ..core.check import as_array, as_indices, as_mask, as_mesh, as_numbers, which
from ..core.vocabulary import BoolArray, FloatArray, IntArray
from ..errors import MeshInputError, OptionError
from ..mesh.edges import components, count_edges, halfedge_ends, used_vertices
from .energies import areas, volumes
from .forces import Forces, body_volumes_at, energy_at, forces_at, hessian_at

__all__ = ["VOLUMES", "CapillaryProblem", "as_problem", "check_held", "is_held", "with_surface"]

VOLUMES = ("shared", "per_component")


class CapillaryProblem:
    """A capillary surface: the energy to be minimised, the volume to be kept, and the wires.

    The energy is ``tension * area + energy of the fluid in gravity + energy_offset``. The fluid fills
    the inside of the surface; its energy is the integral of ``-density * gravity . x`` over the inside,
    computed as a surface integral that is exact on flat triangles. For a surface that is not closed,
    area, volume and energy are those of its faces, as seen from the origin. The missing part (flat caps
    that do not move, say) contributes constants, which the offsets add.

    Parameters
    ----------
    V : (n, 3) float
        Vertices, in any unit of length.
    F : (m, 3) int
        Faces, consistently oriented; the volume is positive if they run counterclockwise from outside.
    fixed : (k,) int or (n,) bool, optional
        Vertices that never move, besides the ends of fixed edges.
    fixed_edges : (k, 2) int, optional
        Wires: edges that are never moved, split or collapsed. By default, the boundary.
    tension : float
        Energy per area.
    volume : float, optional
        The volume to enclose, offset included; by default none is prescribed.
    volume_offset, energy_offset : float
        Added to the volume and the energy of the faces.
    density : float
        Mass per volume of the fluid minus that of its surroundings.
    gravity : (3,) float
        Acceleration.
    bodies : {"shared", "per_component"}
        "shared": the volume is that of all components together; they have one pressure, as if a pipe
        connected them. "per_component": each component keeps its own volume.

    Attributes
    ----------
    V, F, fixed, fixed_edges, tension, volume, ...
        As given; ``fixed`` is a mask (n,).
    body : (m,) int64
        The body of every face.
    targets : (g,) float64
        Prescribed volume of every body, without the offset; empty if none is prescribed.

    Raises
    ------
    MeshInputError
        V and F are not a mesh; or a volume or a density is given, but two faces run along an edge in the
        same direction, so that there is no inside.
    OptionError
        An index is out of range, or a number is not finite or not positive where it must be; or a closed
        surface is asked to enclose a volume of the other sign.
    """

    def __init__(
        self,
        V: ArrayLike,
        F: ArrayLike,
        fixed: ArrayLike | None = None,
        fixed_edges: ArrayLike | None = None,
        *,
        tension: float = 1.0,
        volume: float | None = None,
        volume_offset: float = 0.0,
        energy_offset: float = 0.0,
        density: float = 0.0,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        bodies: Literal["shared", "per_component"] = "shared",
    ) -> None:
        vertices, faces = as_mesh(V, F)
        self.V, self.F = vertices.copy(), faces.copy()
        self.fixed, self.fixed_edges = _wires(len(self.V), self.F, fixed, fixed_edges)
        self.tension = number(tension, "tension", above=0.0, unit="energy per area")
        self.volume = None if volume is None else number(volume, "volume")
        self.volume_offset = number(volume_offset, "volume_offset")
        self.energy_offset = number(energy_offset, "energy_offset")
        self.density = number(density, "density")
        self.gravity = as_numbers(gravity, "gravity", (3,))
        is_apart = choice(bodies, "bodies", VOLUMES) == "per_component"
        if self.volume is not None or self.density:
            _check_winding(self.F)
        self.body = np.zeros(len(self.F), np.int64)
        self.targets = np.empty(0)
        if self.volume is not None:
            self.targets = np.array([self.volume - self.volume_offset])
            _check_sign(self)
        if is_apart:
            self.body, self.targets = _apart(self)

    @property
    def potential(self) -> FloatArray:
        """Gradient of the fluid's energy density, ``-density * gravity``."""
        return -self.density * self.gravity

    @property
    def free(self) -> BoolArray:
        """Vertices that move."""
        return ~self.fixed

    def area(self, V: ArrayLike | None = None) -> float:
        """Area of the faces, with vertices V (by default its own)."""
        return float(areas(self._at(V)[self.F]).sum())

    def energy(self, V: ArrayLike | None = None) -> float:
        """Energy, offset included."""
        return energy_at(self, self._at(V))

    def total_volume(self, V: ArrayLike | None = None) -> float:
        """Volume of all bodies together, offset included."""
        return float(volumes(self._at(V)[self.F]).sum()) + self.volume_offset

    def body_volumes(self, V: ArrayLike | None = None) -> FloatArray:
        """Volume (g,) of the faces of every body with a prescribed one."""
        return body_volumes_at(self, self._at(V))

    def forces(self, V: ArrayLike | None = None) -> Forces:
        """Gradients of energy and volumes."""
        return forces_at(self, self._at(V))

    def hessian(
        self, directions: ArrayLike, pressure: ArrayLike, V: ArrayLike | None = None
    ) -> sp.csr_array:
        """Second derivatives of ``energy - pressure . volumes`` along directions (n, d, 3)."""
        along = as_numbers(directions, "directions", (len(self.V), "d", 3))
        p = as_numbers(pressure, "pressure", (len(self.targets),))
        return hessian_at(self, self._at(V), along, p)

    def with_mesh(
        self,
        V: ArrayLike,
        F: ArrayLike | None = None,
        *,
        fixed: ArrayLike | None = None,
        fixed_edges: ArrayLike | None = None,
        body: ArrayLike | None = None,
    ) -> CapillaryProblem:
        """Return the problem with other vertices, and perhaps other faces.

        Arguments that are left out stay as they are.

        Raises
        ------
        MeshInputError
            V and F are not a mesh.
        OptionError
            The number of vertices changes without ``fixed`` and ``fixed_edges``, or that of faces without
            ``body``; or an index is out of range.
        """
        vertices, faces = as_mesh(V, self.F if F is None else F)
        n, m = len(vertices), len(faces)
        if n != len(self.V) and (fixed is None or fixed_edges is None):
            raise OptionError(f"V has {n} vertices, not {len(self.V)}: give fixed and fixed_edges")
        if m != len(self.F) and body is None:
            raise OptionError(f"F has {m} faces, not {len(self.F)}: give body")
        return with_surface(
            self,
            vertices.copy(),
            faces.copy(),
            fixed=None if fixed is None else as_mask(fixed, n, "fixed", "vertex"),
            fixed_edges=None if fixed_edges is None else _as_edges(fixed_edges, n),
            body=None if body is None else _as_bodies(body, m, len(self.targets)),
        )

    def components(self) -> tuple[int, IntArray]:
        """Count the components, and number them for every face."""
        _, label = components(len(self.V), *halfedge_ends(self.F))
        names, body = np.unique(label[self.F[:, 0]], return_inverse=True)
        return len(names), body

    def taken_apart(self) -> CapillaryProblem:
        """Return the problem with one body per component, each of which keeps its share of the volume."""
        body, targets = _apart(self)
        return with_surface(self, self.V, body=body, targets=targets)

    def _at(self, V: ArrayLike | None) -> FloatArray:
        return self.V if V is None else as_numbers(V, "V", self.V.shape)


def as_problem(value: object) -> CapillaryProblem:
    """Check that a value is a problem."""
    problem: CapillaryProblem = instance(value, "problem", CapillaryProblem, "a CapillaryProblem")
    return problem


def is_held(problem: CapillaryProblem) -> bool:
    """Tell whether a wire or a volume holds the surface, which otherwise shrinks to a point."""
    return not len(problem.F) or bool(problem.fixed.any()) or len(problem.targets) > 0


def check_held(problem: CapillaryProblem) -> None:
    """Refuse a film that nothing holds."""
    if not is_held(problem):
        raise OptionError(
            "nothing holds the surface, which would shrink to a point: give volume=, fixed= or "
            "fixed_edges="
        )


def with_surface(
    problem: CapillaryProblem,
    V: FloatArray,
    F: IntArray | None = None,
    *,
    fixed: BoolArray | None = None,
    fixed_edges: IntArray | None = None,
    body: IntArray | None = None,
    targets: FloatArray | None = None,
) -> CapillaryProblem:
    """Return the problem with another surface, unchecked; arguments that are left out stay the same."""
    other = copy(problem)
    other.V = V
    other.F = problem.F if F is None else F
    other.fixed = problem.fixed if fixed is None else fixed
    other.fixed_edges = problem.fixed_edges if fixed_edges is None else fixed_edges
    other.body = problem.body if body is None else body
    other.targets = problem.targets if targets is None else targets
    return other


def _apart(problem: CapillaryProblem) -> tuple[IntArray, FloatArray]:
    """Body of every face and targets, with one body per component where a volume is prescribed."""
    if not len(problem.targets):
        return problem.body, problem.targets
    count, body = problem.components()
    T = problem.V[problem.F]
    now = np.bincount(body, volumes(T), count)
    # The difference between prescribed and current volume is distributed by area.
    missing = problem.targets.sum() - now.sum()
    share = np.bincount(body, areas(T), count)
    return body, now + missing * share / share.sum()


def _wires(
    n: int, F: IntArray, fixed: ArrayLike | None, fixed_edges: ArrayLike | None
) -> tuple[BoolArray, IntArray]:
    """Return a mask of fixed vertices, including those that no face uses, and the fixed edges."""
    if fixed_edges is None:
        edges, uses = count_edges(F)
        edges = edges[uses == 1]
    else:
        edges = _as_edges(fixed_edges, n)
    mask = np.zeros(n, np.bool_) if fixed is None else as_mask(fixed, n, "fixed", "vertex")
    mask[edges] = True
    mask |= ~used_vertices(F, n)
    return mask, edges


def _check_winding(F: IntArray) -> None:
    """Refuse faces that run along an edge in the same direction, because then there is no inside."""
    start, end = halfedge_ends(F)
    key = start * (F.max() + 1) + end
    _, index, count = np.unique(key, return_index=True, return_counts=True)
    bad = np.unique(index[count > 1] // 3)
    if len(bad):
        raise MeshInputError(
            f"{which(bad, 'face')} of F run along an edge the same way as another, so that no volume is "
            "enclosed; remesh turns them where the surface is a manifold"
        )


def _check_sign(problem: CapillaryProblem) -> None:
    """Refuse to turn a closed surface inside out."""
    _, uses = count_edges(problem.F)
    target = float(problem.targets[0])
    if len(uses) and (uses == 2).all():
        now = float(volumes(problem.V[problem.F]).sum())
        if now * target < 0.0:
            raise OptionError(
                f"volume must have the sign of what the faces enclose, {now:.6g}; got "
                f"{problem.volume:g}. "
                "Turn the faces, or the sign"
            )


def _as_edges(value: ArrayLike, n: int) -> IntArray:
    array = as_array(value, "fixed_edges")
    if array.size == 0:
        return np.empty((0, 2), np.int64)
    if array.ndim != 2 or array.shape[1] != 2:
        raise OptionError(f"fixed_edges must have shape (k, 2); got {array.shape}")
    ends = [as_indices(array[:, i], n, f"fixed_edges[:, {i}]", "vertex") for i in (0, 1)]
    return np.stack(ends, axis=1)


def _as_bodies(value: ArrayLike, m: int, count: int) -> IntArray:
    body = as_indices(value, max(1, count), "body", "body")
    if len(body) != m:
        raise OptionError(f"body must have shape ({m},), one number per face; got {body.shape}")
    return body
