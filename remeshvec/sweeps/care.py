"""Sweeps over a mesh with a look for flaws afterwards, and with care where there are some."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..core.vocabulary import FloatArray, Mesh
from ..errors import OptionError
from .counts import count_elements
from .deviation import DeviationCheck
from .finish import finish, has_finish
from .flaws import (
    CrossingCheck,
    FoldCheck,
    TurnedCheck,
    count_more_crossings,
    count_new_flaws,
    has_crossings_where_thin,
)
from .guard import Check, Guard, HoldingGuard
from .loop import Stop, run_sweeps
from .mending import mend_folds
from .monitor import Monitor
from .plan import Plan, make_schedule
from .swept import Start, Swept
from .work import Work

__all__ = ["Sweeper"]


class Sweeper:
    """Sweeps over meshes.

    Parameters
    ----------
    plan : Plan
    monitor : Monitor
    may_run_parallel : bool
        Whether large meshes may use more than one thread.
    parallel : bool
        Whether the checks do.
    tolerated : (k, 3) float64, optional
        Places whose folds need no care, see `FoldCheck`.
    clear : callable, optional
        Returns a start with shorter edges where sheets are near, or None.
    """

    def __init__(
        self,
        plan: Plan,
        monitor: Monitor,
        may_run_parallel: bool,
        parallel: bool,
        tolerated: FloatArray | None = None,
        clear: Callable[[Swept], Start | None] | None = None,
    ) -> None:
        self.plan = plan
        self.monitor = monitor
        self.may_run_parallel = may_run_parallel
        self.parallel = parallel
        self.tolerated = tolerated
        self.clear = clear

    def sweep(self, meshes: list[Mesh], start: Start) -> Swept:
        """Sweep over the mesh in a list, which is emptied: nothing holds it once it is replaced.

        Most meshes are done after one look; where there are flaws, they are swept with care.
        """
        best = self._swept(meshes, start, ())
        if not self.monitor.is_cancelled:
            is_thin = None if start.gap is None else np.isfinite(start.gap)
            if best.is_clean and has_crossings_where_thin(best.work.mesh, is_thin, self.parallel):
                best = self._judged(best)
            if not best.is_clean or best.has_lost:
                best = self._with_care(best)
        self.monitor.counts = best.counts
        return replace(best, stop=Stop.CANCELLED) if self.monitor.is_cancelled else best

    def _with_care(self, best: Swept) -> Swept:
        """Mend the flaws, or sweep again from before; returns the best of all.

        With shorter edges where sheets are near, and then with a guard. A guard against crossings takes
        several times as long as one against folds alone, and holds more than it must where an input
        crosses itself.
        """
        has_folds = best.n_flaws > 0
        if has_folds and self._may_mend(best.work):
            last = make_schedule(self.plan.recipe)[-1]
            mend_folds(best.work, best.start.mesh, last, self.tolerated)
            best = self._judged(best)
        if (not best.is_clean or best.has_lost) and not self.monitor.is_cancelled:
            best = self._with_clearance(best)
            has_folds &= best.n_flaws > 0 or not best.start.clearance
        avoids_crossings = self.plan.recipe.avoid_intersections
        folds = self._against_folds(best.start)
        guards = [folds, (*folds, CrossingCheck(self.parallel, avoids_crossings))]
        for checks in guards[avoids_crossings or not has_folds :]:
            if best.is_clean or self.monitor.is_cancelled:
                break
            other = self._judged(self._swept([best.start.mesh.copy()], best.start, checks))
            if not self.monitor.is_cancelled:
                best = min(best, other, key=lambda swept: (swept.n_flaws, swept.n_crossings))
        return best

    def _with_clearance(self, best: Swept) -> Swept:
        """Sweep again with shorter edges where sheets are near, if that is worth its faces."""
        if self.clear is None:
            return best
        with self.monitor.watch.time("clearance"):
            start = self.clear(best)
        if start is None:
            return best
        # A lost volume is one flaw; folds instead of it must not be left, so a guard is tried as well.
        guards: list[tuple[Check, ...]] = [(), self._against_folds(start)]
        for checks in guards[: 1 + best.is_clean]:
            try:
                other = self._judged(self._swept([start.mesh.copy()], start, checks))
            except OptionError:  # more faces than allowed, on the way
                break
            if self.monitor.is_cancelled:
                break
            n_faces = count_elements(other.work.mesh, "faces")
            if n_faces <= self.plan.max_faces and other.is_far_better(best):
                return other
        return best

    def _against_folds(self, start: Start) -> tuple[Check, ...]:
        """Return checks against folds, and against faces turned over where vertices lie on the input."""
        folds = FoldCheck(self.parallel, self.tolerated)
        if not self.plan.recipe.project:
            return (folds,)
        return folds, TurnedCheck(start.featured.reference.tree, self.parallel)

    def _judged(self, swept: Swept) -> Swept:
        """Count flaws, and faces that have come to cross others."""
        before, after = swept.start.mesh, swept.work.mesh
        n_flaws = self._count_flaws(swept.start, after)
        n_crossings = count_more_crossings(before, after, self.parallel)
        return replace(swept, n_flaws=n_flaws, n_crossings=n_crossings)

    def _may_mend(self, work: Work) -> bool:
        """Tell whether edges may be changed after the last step: no bound or count says otherwise."""
        plan = self.plan
        bound = plan.max_deviation is not None or plan.adaptation is not None or plan.count
        return not (bound or work.featured.on_non_manifold is not None or self.monitor.is_cancelled)

    def _count_flaws(self, start: Start, after: Mesh) -> int:
        """Count the flaws that sweeps have made."""
        if self.monitor.is_cancelled:
            return 0
        recipe = self.plan.recipe
        tree = start.featured.reference.tree if recipe.project else None
        crossings = recipe.avoid_intersections
        return count_new_flaws(start.mesh, after, tree, crossings, self.parallel, self.tolerated)

    def _swept(self, meshes: list[Mesh], start: Start, checks: tuple[Check, ...]) -> Swept:
        """Sweep over the mesh in a list and finish it, with a guard that makes these checks."""
        self.monitor.counts = []
        work = Work(meshes.pop(), start.featured, self.plan, self.monitor, self.may_run_parallel)
        bound = self.plan.max_deviation
        if bound is not None:
            checks = (*checks, DeviationCheck(start.featured, bound, work.is_parallel))
        guard = HoldingGuard(checks, work.is_parallel) if checks else Guard()
        schedule = make_schedule(self.plan.recipe, self.plan.adaptation is not None)
        stop = run_sweeps(work, schedule, guard)
        if has_finish(work):
            finish(work, guard)
        n_flaws = self._count_flaws(start, work.mesh)
        return Swept(start, work, stop, self.monitor.counts, n_flaws)
