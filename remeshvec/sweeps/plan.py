"""The plan of a call: what every sweep does, decided before the first one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, radians

from ..core.vocabulary import LARGEST_MESH, FloatArray
from ..input.recipe import Recipe
from ..operations.collapse import CollapseLimits
from ..operations.flip import FlipLimits

__all__ = ["Adaptation", "Count", "Plan", "Sweep", "make_schedule"]

# Sweeps, counted from the last one as 1, after which lengths are compared with what they led to.
_COMPARISONS = (7, 5, 3)

# Lengths from the curvature are for vertices that lie where it is: more stiffness takes a fifth off the
# Hausdorff distance (medians over five meshes), at the same number of faces.
_ADAPTIVE_HOLD = 10.0 / 3.0


@dataclass(frozen=True)
class Sweep:
    """What one sweep does; lengths are factors of the target length."""

    split: float  # edges above are split
    collapse: CollapseLimits  # edges below are collapsed, where the guards agree
    flip: FlipLimits
    flip_passes: int
    relaxations: int
    stiffness: float  # hold of curved ridges on their vertices while relaxing
    projects: bool  # whether vertices go back to the input
    unfolds: bool  # whether moves that fold an edge are taken back: folds of earlier sweeps mostly vanish
    compares_lengths: bool  # whether adaptive lengths are corrected afterwards


@dataclass(frozen=True)
class Adaptation:
    """How lengths from the curvature are corrected by the faces that they led to."""

    tolerance: float  # largest distance of a face from the input, in the frame of the mesh
    shortest: float  # target length, likewise
    limit: Callable[[FloatArray], FloatArray]  # bounds the growth of lengths on the input


@dataclass(frozen=True)
class Count:
    """A number of faces or vertices to be met."""

    noun: str  # "faces" or "vertices"
    wanted: int

    @property
    def per_edge(self) -> int:
        """How many a split of an inner edge makes."""
        return 2 if self.noun == "faces" else 1


@dataclass(frozen=True)
class Plan:
    """All that the sweeps of one mesh need to know besides the mesh."""

    recipe: Recipe
    scale: float = 1.0  # of the frame that the mesh comes in
    gradation: float = float("inf")  # largest ratio of the lengths at the ends of an edge
    adaptation: Adaptation | None = None  # None where lengths do not follow from the curvature
    count: Count | None = None
    max_faces: int = LARGEST_MESH  # that the caller allows in a result
    most_faces: int = LARGEST_MESH  # on the way to it

    @property
    def max_deviation(self) -> float | None:
        """Largest distance from the input, in the frame of the mesh."""
        bound = self.recipe.max_deviation
        return None if bound is None else bound * self.scale


def make_schedule(recipe: Recipe, adapts: bool = False) -> list[Sweep]:
    """List the sweeps of a recipe, first to last; ``adapts`` where lengths follow from the curvature."""
    # Where sweeps are judged by where vertices end, all of them project.
    always = recipe.tol is not None or recipe.max_deviation is not None
    flip = FlipLimits(cos(radians(recipe.flip_normal)), recipe.delaunay_ties, recipe.sliver_check)
    schedule = []
    for i in range(recipe.iterations):
        left = recipe.iterations - i
        schedule.append(
            Sweep(
                split=recipe.split[i],
                collapse=CollapseLimits(
                    recipe.collapse[i],
                    recipe.split[i],
                    recipe.foldover_cosine,
                    recipe.quadric_reach,
                    recipe.sliver_check,
                ),
                flip=flip,
                flip_passes=recipe.flip_passes,
                relaxations=recipe.last_relaxations if left == 1 else 1,
                stiffness=recipe.stiffness * (_ADAPTIVE_HOLD if adapts else 1.0),
                projects=recipe.project and (always or left <= recipe.projected_sweeps),
                unfolds=left == 1,
                compares_lengths=left in _COMPARISONS,
            )
        )
    return schedule
