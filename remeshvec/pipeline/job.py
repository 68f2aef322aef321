"""One prepared mesh on its way through the sweeps: with one length, or several until a count is met."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf, sqrt

import numpy as np
from numpy.typing import ArrayLike

from ..core.vocabulary import EQUILATERAL_AREA, LARGEST_MESH, NONE, FloatArray, Mesh
from ..errors import OptionError
from ..features.creases import Creases, judge_edges
from ..input.constraints import ConstraintMasks, Constraints
from ..input.prepare import Prepared
from ..input.recipe import Recipe
from ..mesh.walk import ends_of
from ..reference.build import FeaturedReference, build_reference
from ..reference.clearance import find_gaps
from ..sizing.adaptive import Adaptive, expected_faces
from ..sizing.target_lengths import adaptive_limits, limited_lengths, mesh_size, set_lengths
from ..sweeps.care import Sweeper
from ..sweeps.counts import count_elements
from ..sweeps.finish import deviation_of, has_finish
from ..sweeps.loop import Stop
from ..sweeps.monitor import Monitor
from ..sweeps.plan import Adaptation, Count, Plan
from ..sweeps.swept import Start, Swept, start_of
from ..sweeps.work import is_large
from .clearing import clear, clearance_in_words, near_flaws

__all__ = ["Job", "Lengths", "Remeshed", "Sizing", "meet_count"]

# Tries to meet a number of faces or vertices, and how near is near enough.
_TRIES = 8
_CLOSE_ENOUGH = 0.02

# Keys of `Remeshed.deviation`, in words.
_WAYS = {"to_input": "from the result to the input", "from_input": "from the input to the result"}

# On the way a mesh may have so many times the faces that are allowed in the end, or that it had: first
# splits also cut edges that are collapsed afterwards, on parts of few long faces into 14 times as many
# (102 calls on real meshes). Beyond 10 million faces, about 1 GB, that is too much memory to lend.
_ON_THE_WAY = 32
_LENT = 10_000_000
_ON_THE_WAY_LARGE = 1.25

Lengths = float | ArrayLike | Callable[[FloatArray], ArrayLike] | Adaptive


@dataclass(frozen=True)
class Sizing:
    """What the caller says about sizes, checked as far as it can be without the mesh."""

    L: Lengths | None
    gradation: float
    max_faces: int


@dataclass(frozen=True)
class Remeshed:
    """A remeshed surface in the frame of `Prepared`, and what happened on the way."""

    mesh: Mesh
    is_compact: bool
    is_on_input: bool  # whether all vertices were projected last
    featured: FeaturedReference
    length: float  # of the mean new edge, in the units of the input
    counts: list[dict[str, int]]  # of every sweep
    stop: str  # why the sweeps ended, in words
    deviation: dict[str, float]  # from the input, in its units
    missed: str = ""  # which bound does not hold, in words
    clearance: dict[str, float] = field(default_factory=dict)  # see `Report`

    def count(self, noun: str) -> int:
        """Count faces or vertices."""
        return count_elements(self.mesh, noun)

    def count_held(self) -> int:
        """Count faces that had to stay."""
        return 0 if self.featured.held is None else int(self.featured.held.sum())


class Job:
    """One prepared mesh, to be remeshed with one length or several."""

    def __init__(
        self,
        prepared: Prepared,
        constraints: Constraints,
        V: FloatArray,
        sizing: Sizing,
        recipe: Recipe,
        monitor: Monitor,
        may_run_parallel: bool,
    ) -> None:
        self.prepared = prepared
        self.constraints = constraints
        self.V = V
        self.sizing = sizing
        self.recipe = recipe
        self.monitor = monitor
        self.may_run_parallel = may_run_parallel
        self.parallel = may_run_parallel and is_large(len(prepared.mesh.origin) // 3)
        with monitor.watch.time("reference"):
            self.size = mesh_size(prepared, self.parallel)
        n_faces = len(prepared.mesh.origin) // 3
        self.plan = Plan(
            recipe,
            prepared.scale,
            sizing.gradation,
            _adaptation(prepared, sizing),
            max_faces=sizing.max_faces,
            most_faces=_most_faces(max(sizing.max_faces, n_faces)),
        )

    def run_once(self) -> Remeshed:
        """Remesh, and let go of the prepared mesh; lengths from the curvature need it again."""
        if isinstance(self.sizing.L, Adaptive):
            return self.run(None)
        meshes = [self.prepared.mesh]
        nothing = Mesh(*(array[:0].copy() for array in meshes[0]))  # type: ignore[arg-type]
        self.prepared = self.prepared._replace(mesh=nothing)
        return self._sweep(meshes, self.sizing.L)

    def run(self, L: Lengths | None) -> Remeshed:
        """Remesh a copy of the mesh."""
        return self._sweep([self.prepared.mesh.copy()], self.sizing.L if L is None else L)

    def first_length(self, noun: str, wanted: int) -> float:
        """Return the length that gives so many faces or vertices if all faces are equilateral.

        But no more edges than that on the boundary: along needles nearly all would lie there.
        """
        faces = wanted if noun == "faces" else 2 * wanted
        length = sqrt(self.size.area / faces / EQUILATERAL_AREA)
        return max(length, _boundary_length(self.prepared.mesh) / wanted) / self.prepared.scale

    def find_creases(self, L: Lengths | None) -> Creases:
        """Find the features of the mesh, which gets its lengths."""
        mesh = self.prepared.mesh
        marks, _ = self._set_lengths(mesh, self.sizing.L if L is None else L)
        surface = mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge
        angle, mean_edge = self.constraints.feature_angle, self.size.mean_edge
        return judge_edges(surface, marks.hard, angle, mean_edge, parallel=self.parallel)

    def _sweep(self, meshes: list[Mesh], L: Lengths | None) -> Remeshed:
        """Remesh the mesh in a list, which is emptied, so that nothing holds it once it is replaced."""
        monitor = self.monitor
        with monitor.watch.time("reference"):
            marks, length = self._set_lengths(meshes[0], L)
            featured = self._build_reference(meshes[0], marks)
            gap = self._gaps(meshes[0], featured)
        start = start_of(meshes[0], featured, marks, gap)
        sweeper = Sweeper(
            self.plan, monitor, self.may_run_parallel, self.parallel, clear=self._clear
        )
        swept = sweeper.sweep(meshes, start)
        work, stop = swept.work, swept.stop
        is_compact = has_finish(work)
        deviation = deviation_of(work)
        missed = _missed(deviation, self.recipe.max_deviation, self.sizing.L)
        return Remeshed(
            work.mesh,
            is_compact,
            not (work.was_guarded or self.recipe.fit_rounds),
            work.featured,
            length / self.prepared.scale,
            monitor.counts,
            "; ".join(filter(None, (_in_words(stop, self.recipe.tol, swept), missed))),
            deviation,
            missed,
            swept.start.clearance or {},
        )

    def _gaps(self, mesh: Mesh, featured: FeaturedReference) -> FloatArray | None:
        """Distances to the next sheet on either side of every face of the input; None if not asked for.

        A number of faces or vertices to be met is a stronger wish than lengths. Without projection there
        is no tree to look in.
        """
        if self.recipe.clearance is None or self.plan.count or not self.recipe.project:
            return None
        with self.monitor.watch.time("clearance"):
            return find_gaps(featured.reference.tree, mesh, self.parallel)

    def _clear(self, best: Swept) -> Start | None:
        """Shorten lengths where sheets are near, if that is asked for and does anything."""
        share = self.recipe.clearance
        if share is None or best.start.gap is None:
            return None
        finds_creases = best.has_lost and self.constraints.feature_angle == "auto"
        near = None if best.has_lost else near_flaws(best, self.parallel)
        cleared = clear(
            best.start, share, near, finds_creases, self._limited, self._build_reference
        )
        if cleared is None:
            return None
        X, origin = cleared.mesh.X, cleared.mesh.origin
        return cleared if expected_faces(X, origin, X[:, 3].copy()) <= self.plan.max_faces else None

    def _limited(self, mesh: Mesh, lengths: FloatArray) -> FloatArray:
        """Bound the growth of lengths over a mesh."""
        return limited_lengths(self.prepared._replace(mesh=mesh), lengths, self.sizing.gradation)

    def build_reference(self, mesh: Mesh, L: Lengths | None) -> tuple[FeaturedReference, float]:
        """Set the lengths of a mesh, mark its features, build the reference."""
        marks, length = self._set_lengths(mesh, L)
        return self._build_reference(mesh, marks), length

    def _build_reference(self, mesh: Mesh, marks: ConstraintMasks) -> FeaturedReference:
        """Mark the features of a mesh that has its lengths, build the reference."""
        return build_reference(
            mesh,
            self.prepared.vertex_source,
            self.constraints.feature_angle,
            marks,
            self.size.mean_edge,
            self.parallel,
            self.constraints.corner_angle,
        )

    def _set_lengths(self, mesh: Mesh, L: Lengths | None) -> tuple[ConstraintMasks, float]:
        """Set the lengths of a mesh; returns what must stay, and the length of the mean new edge."""
        prepared, constraints = self.prepared._replace(mesh=mesh), self.constraints
        marks = constraints.on_mesh(
            mesh, prepared.vertex_source, prepared.face_source, prepared.representative
        )
        length = set_lengths(
            prepared,
            self.size,
            self.V,
            L,
            marks,
            constraints.feature_angle,
            self.sizing.gradation,
            self.sizing.max_faces,
            self.recipe.max_deviation,
        )
        return marks, length


def _boundary_length(mesh: Mesh) -> float:
    a, b = ends_of(mesh.origin, np.flatnonzero(mesh.twin == NONE))
    return float(np.linalg.norm(mesh.X[a, :3] - mesh.X[b, :3], axis=1).sum())


def _most_faces(allowed: int) -> int:
    """How many faces a mesh may have during the sweeps if so many are allowed in the end."""
    small = min(_ON_THE_WAY * allowed, _LENT)
    return min(LARGEST_MESH, max(small, int(_ON_THE_WAY_LARGE * allowed)))


def _adaptation(prepared: Prepared, sizing: Sizing) -> Adaptation | None:
    """Say how lengths are corrected, where they follow from the curvature."""
    if not isinstance(sizing.L, Adaptive):
        return None
    return Adaptation(
        sizing.L.tolerance * prepared.scale,
        adaptive_limits(prepared, sizing.L)[0],
        lambda lengths: limited_lengths(prepared, lengths, sizing.gradation),
    )


def _in_words(stop: Stop, tol: float | None, swept: Swept) -> str:
    words = str(stop.value)
    if stop is Stop.CONVERGED:
        words += (
            f" (tol): the last sweep changed less than {tol:g} of the edges and moved "
            f"vertices by less than {tol:g} L"
        )
    if swept.start.clearance:
        words += f"; {clearance_in_words(swept.start.clearance)}"
    if swept.n_flaws:
        words += f"; new flaws at {swept.n_flaws} vertices, see report.defects"
    return words


def _missed(deviation: dict[str, float], bound: float | None, L: Lengths | None) -> str:
    """Say which bound of the distance the surfaces do not keep; nothing where they do."""
    for limit, name, does in (
        (bound, "max_deviation", "is not met"),
        (L.tolerance if isinstance(L, Adaptive) else None, "the tolerance of L", "is exceeded"),
    ):
        worst = max(deviation.values(), default=0.0)
        if limit is not None and worst > limit:
            ways = " and ".join(
                f"{away:.3g} {words}"
                for way, words in _WAYS.items()
                if (away := deviation[way]) > limit
            )
            return f"{name} = {limit:g} {does}: the largest distance is {ways}"
    return ""


def meet_count(job: Job, noun: str, wanted: int) -> Remeshed:
    """Remesh with one length after another until the count is met.

    Each try that comes near meets it by splits or collapses, see `sweeps.counts`. Where edges must stay,
    2 % is near enough.
    """
    faces = wanted if noun == "faces" else 2 * wanted
    if faces > job.sizing.max_faces:
        raise OptionError(
            f"n_{noun} = {wanted:,} is more than max_faces = {job.sizing.max_faces:,}"
        )
    goal = Count(noun, wanted)
    job.plan = replace(job.plan, count=goal)
    L = job.first_length(noun, wanted)
    best = None
    short, long = 0.0, inf  # lengths that gave too many, and too few
    for attempt in range(_TRIES):
        done = job.run(L)
        count = done.count(noun)
        if best is None or abs(count - wanted) < abs(best.count(noun) - wanted):
            best = done
        held = done.count_held() // (1 if noun == "faces" else 2)
        if abs(count - wanted) <= _CLOSE_ENOUGH * wanted or job.monitor.is_cancelled:
            break
        short, long = (max(short, L), long) if count > wanted else (short, min(long, L))
        L *= min(2.0, max(0.5, sqrt(max(count - held, 1) / max(wanted - held, 1))))
        # Where the edges of the input are all alike the number jumps, and tries would go to and fro.
        if long < inf and short > 0.0 and (attempt > 1 or not short < L < long):
            L = sqrt(short * long)
    assert best is not None
    count = best.count(noun)
    if abs(count - wanted) < goal.per_edge:
        return best
    missed = f"{count:,} {noun} are as near to {wanted:,} as {_TRIES} tries came"
    return replace(best, stop=f"{best.stop}; {missed}")
