"""Time spent in each phase."""

from __future__ import annotations

from time import perf_counter

__all__ = ["Stopwatch"]


class _Lap:
    """One timed block. A generator would be slower, which small meshes notice."""

    __slots__ = ("phase", "seconds", "start")

    def __init__(self, seconds: dict[str, float], phase: str) -> None:
        self.seconds = seconds
        self.phase = phase

    def __enter__(self) -> None:
        self.start = perf_counter()

    def __exit__(self, *_: object) -> None:
        elapsed = perf_counter() - self.start
        self.seconds[self.phase] = self.seconds.get(self.phase, 0.0) + elapsed


class Stopwatch:
    """Adds up the seconds that each phase takes."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._start = perf_counter()

    def time(self, phase: str) -> _Lap:
        """Add the duration of a ``with`` block to a phase."""
        return _Lap(self.seconds, phase)

    def stop(self) -> dict[str, float]:
        """Return the seconds per phase, and the total since the watch was made."""
        return {**self.seconds, "total": perf_counter() - self._start}
