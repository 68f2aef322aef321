"""What the sweeps count and time, and the callback that may end them."""

from __future__ import annotations

from ..core.arguments import asks_to_stop
from ..core.stopwatch import Stopwatch
from ..input.options import Callback

__all__ = ["Monitor"]


class Monitor:
    """Counts of every sweep, seconds of every phase.

    Attributes
    ----------
    counts : list of dict
        Edges split, collapsed and flipped, one dict per sweep.
    watch : Stopwatch
    is_cancelled : bool
        Whether the callback has returned False. From then on no phase does anything.
    """

    def __init__(self, watch: Stopwatch, callback: Callback | None = None) -> None:
        self.counts: list[dict[str, int]] = []
        self.watch = watch
        self.is_cancelled = False
        self._callback = callback

    def begin_sweep(self) -> None:
        """Count from zero for the next sweep."""
        self.counts.append({})

    def report(self, phase: str) -> None:
        """Tell the callback that a phase is done."""
        if self._callback is not None:
            count = self.counts[-1].get(phase, 0)
            answer = self._callback(len(self.counts) - 1, phase, count)
            self.is_cancelled = asks_to_stop(answer)
