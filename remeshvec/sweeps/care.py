"""Sweeps over a mesh with a look for flaws afterwards, and with care where there are some."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core.vocabulary import FloatArray, Mesh
from ..reference.build import FeaturedReference
from .deviation import DeviationCheck
from .finish import finish, has_finish
from .flaws import (
    CrossingCheck,
    FoldCheck,
    TurnedCheck,
    count_more_crossings,
    count_new_flaws,
    has_crossings_at_curves,
)
from .guard import Check, Guard, HoldingGuard
from .loop import Stop, run_sweeps
from .mending import mend_folds
from .monitor import Monitor
from .plan import Plan, make_schedule
from .work import Work

__all__ = ["Sweeper", "Swept"]


@dataclass(frozen=True)
class Swept:
    """A mesh after the sweeps."""

    work: Work
    stop: Stop
    counts: list[dict[str, int]]
    n_flaws: int  # vertices at flaws that the mesh did not have before
    n_crossings: int = 0  # vertices of faces that cross others and did not, where they were counted


class Sweeper:
    """Sweeps over meshes on one reference.

    Parameters
    ----------
    featured : FeaturedReference
    plan : Plan
    monitor : Monitor
    may_run_parallel : bool
        Whether large meshes may use more than one thread.
    parallel : bool
        Whether the checks do.
    tolerated : (k, 3) float64, optional
        Places whose folds need no care, see `FoldCheck`.
    """

    def __init__(
        self,
        featured: FeaturedReference,
        plan: Plan,
        monitor: Monitor,
        may_run_parallel: bool,
        parallel: bool,
        tolerated: FloatArray | None = None,
    ) -> None:
        self.featured = featured
        self.plan = plan
        self.monitor = monitor
        self.may_run_parallel = may_run_parallel
        self.parallel = parallel
        self.tolerated = tolerated

    def sweep(self, meshes: list[Mesh]) -> Swept:
        """Sweep over the mesh in a list, which is emptied: nothing holds it once it is replaced.

        Most meshes are done after one look; where there are flaws, they are swept with care.
        """
        before = _shared_copy(meshes[0], self.featured)
        best = self._swept(meshes, before, ())
        if not self.monitor.is_cancelled:
            if best.n_flaws == 0 and has_crossings_at_curves(best.work.mesh, self.parallel):
                best = self._judged(best, before)
            if best.n_flaws or best.n_crossings:
                best = self._with_care(best, before)
        self.monitor.counts = best.counts
        return replace(best, stop=Stop.CANCELLED) if self.monitor.is_cancelled else best

    def _with_care(self, best: Swept, before: Mesh) -> Swept:
        """Mend the flaws, or sweep again from before with a guard; returns the best of all.

        A guard against crossings takes several times as long as one against folds alone, and holds
        more than it must where an input crosses itself.
        """
        avoids_crossings = self.plan.recipe.avoid_intersections
        folds: tuple[Check, ...] = (FoldCheck(self.parallel, self.tolerated),)
        if self.plan.recipe.project:
            folds += (TurnedCheck(self.featured.reference.tree, self.parallel),)
        crossings = CrossingCheck(self.parallel, avoids_crossings)
        has_folds = best.n_flaws > 0
        if has_folds and self._may_mend():
            last = make_schedule(self.plan.recipe)[-1]
            mend_folds(best.work, before, last, self.tolerated)
            best = self._judged(best, before)
        guards = [folds, (*folds, crossings)]
        for checks in guards[avoids_crossings or not has_folds :]:
            if not (best.n_flaws or best.n_crossings) or self.monitor.is_cancelled:
                break
            other = self._judged(self._swept([before.copy()], before, checks), before)
            if not self.monitor.is_cancelled:
                best = min(best, other, key=lambda swept: (swept.n_flaws, swept.n_crossings))
        return best

    def _judged(self, swept: Swept, before: Mesh) -> Swept:
        """Count flaws, and faces that have come to cross others."""
        after = swept.work.mesh
        n_flaws = self._count_flaws(before, after)
        n_crossings = count_more_crossings(before, after, self.parallel)
        return replace(swept, n_flaws=n_flaws, n_crossings=n_crossings)

    def _may_mend(self) -> bool:
        """Tell whether edges may be changed after the last step: no bound or count says otherwise."""
        plan = self.plan
        bound = plan.max_deviation is not None or plan.adaptation is not None or plan.count
        return not (bound or self.featured.on_non_manifold is not None or self.monitor.is_cancelled)

    def _count_flaws(self, before: Mesh, after: Mesh) -> int:
        """Count the flaws that sweeps have made."""
        if self.monitor.is_cancelled:
            return 0
        recipe = self.plan.recipe
        tree = self.featured.reference.tree if recipe.project else None
        crossings = recipe.avoid_intersections
        return count_new_flaws(before, after, tree, crossings, self.parallel, self.tolerated)

    def _swept(self, meshes: list[Mesh], before: Mesh, checks: tuple[Check, ...]) -> Swept:
        """Sweep over the mesh in a list and finish it, with a guard that makes these checks."""
        self.monitor.counts = []
        work = Work(meshes.pop(), self.featured, self.plan, self.monitor, self.may_run_parallel)
        bound = self.plan.max_deviation
        if bound is not None:
            checks = (*checks, DeviationCheck(self.featured, bound, work.is_parallel))
        guard = HoldingGuard(checks, work.is_parallel) if checks else Guard()
        schedule = make_schedule(self.plan.recipe, self.plan.adaptation is not None)
        stop = run_sweeps(work, schedule, guard)
        if has_finish(work):
            finish(work, guard)
        return Swept(work, stop, self.monitor.counts, self._count_flaws(before, work.mesh))


def _shared_copy(mesh: Mesh, featured: FeaturedReference) -> Mesh:
    """Copy a mesh that sweeps will change, but for what the reference holds already: 28 bytes a face."""
    reference = featured.reference
    if not np.array_equal(reference.origin, mesh.origin):  # a part, beside a larger reference
        return mesh.copy()
    is_same = np.array_equal(reference.X[:, 3], mesh.X[:, 3])  # not where long rims raise lengths
    X = reference.X if is_same else mesh.X.copy()
    kept = mesh._replace(origin=reference.origin[:0], X=X[:0]).copy()
    return kept._replace(origin=reference.origin, X=X)
