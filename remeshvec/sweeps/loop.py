"""The algorithm [Botsch and Kobbelt 2004, section 4]: split, collapse, flip, relax, project; repeat."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from .feedback import correct_lengths
from .guard import Guard
from .phases import collapse, flip, project, relax, split
from .plan import Sweep
from .work import Work

__all__ = ["Stop", "run_sweeps"]


class Stop(Enum):
    """Why the sweeps ended."""

    DONE = "all sweeps done"
    CONVERGED = "converged"
    CANCELLED = "cancelled"


def run_sweeps(work: Work, schedule: Sequence[Sweep], guard: Guard) -> Stop:
    """Sweep over a mesh until the schedule ends, little changes, or the callback ends it.

    Splits do not move the surface. What follows them does: a guard may try it on a copy of the mesh,
    and try again with parts of the mesh held.
    """
    for sweep in schedule:
        work.monitor.begin_sweep()
        split(work, sweep)
        for trial in guard.attempts(work):
            collapse(trial, sweep)
            flip(trial, sweep)
            relax(trial, sweep)
            project(trial, sweep)
        if work.monitor.is_cancelled:
            return Stop.CANCELLED
        if has_converged(work):
            return Stop.CONVERGED
        if sweep.compares_lengths:
            correct_lengths(work)
    return Stop.DONE


def has_converged(work: Work) -> bool:
    """Tell whether the last sweep changed few edges and hardly moved the vertices."""
    tol = work.plan.recipe.tol
    if tol is None or work.step > tol:
        return False
    return sum(work.monitor.counts[-1].values()) <= tol * work.count_edges()
