"""What happened in a call: options, counts, seconds, quality; and values that are made when asked for."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Any, Generic, TypeVar

from numpy.typing import ArrayLike

from .options import Options
from .quality import Quality, quality

__all__ = ["Late", "Postponed", "Report", "Stopwatch"]

T = TypeVar("T")


class Late(Generic[T]):
    """A value that is made when it is first asked for: once, and at the latest for a pickle or a copy.

    What ``make`` holds is let go of then.
    """

    def __init__(self, make: Callable[[], T]) -> None:
        self._make: Callable[[], T] | None = make
        self._lock = threading.Lock()

    def __call__(self) -> T:
        """Return the value."""
        with self._lock:
            if self._make is not None:
                self._value = self._make()
                self._make = None
        return self._value

    def __reduce__(self) -> tuple[Any, ...]:
        return _known, (self(),)


def _known(value: T) -> Late[T]:
    return Late(lambda: value)


class Postponed(Late[T]):
    """The same, but a pickle or a copy takes along what it is made of, which is sooner done."""

    def __reduce__(self) -> tuple[Any, ...]:
        with self._lock:
            make = self._make
        return (_known, (self._value,)) if make is None else (Postponed, (make,))


class _Lap:
    """One timed block; a generator in its place is slower, which small meshes notice."""

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
    """Adds up seconds by phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._start = perf_counter()

    def time(self, phase: str) -> _Lap:
        """Add the duration of a ``with`` block to a phase."""
        return _Lap(self.seconds, phase)

    def stop(self) -> dict[str, float]:
        """Return the seconds by phase, with the total since the watch was made."""
        return {**self.seconds, "total": perf_counter() - self._start}


@dataclass
class Report:
    """What happened in a call.

    Attributes
    ----------
    target_length : float
        L, in the units of the input.
    options : Options
        The options in force.
    sweeps : list of dict
        Counts of edges split, collapsed and flipped, one dict a sweep.
    seconds : dict
        Seconds by phase, and "total".
    stop : str
        Why the sweeps ended.
    dirt : dict
        What was wrong with the input, and how often; empty for a clean mesh.
    features : dict
        Creases of the input that are kept: "crease_edges", "chains", "corners", and how many edges the
        rule of ``feature_angle="auto"`` dropped: "dropped_echo", "dropped_noise", "dropped_short".
    deviation : dict
        With ``max_deviation`` or an adaptive length, the largest distance found: "to_input" from
        samples of the result (21 a face, on a grid) to the input, and "from_input" from such samples of
        the input to the result. With ``max_deviation`` no sample exceeds 0.8 times the bound; what lies
        between samples is not looked at.
    """

    target_length: float
    options: Options
    sweeps: list[dict[str, int]]
    seconds: dict[str, float]
    stop: str
    dirt: dict[str, int]
    features: dict[str, int]
    deviation: dict[str, float]
    before: tuple[ArrayLike, ArrayLike] = field(repr=False)
    after: tuple[ArrayLike, ArrayLike] = field(repr=False)

    @property
    def preset(self) -> str:
        """Name of the preset that the call started from."""
        return self.options.preset

    @cached_property
    def quality_before(self) -> Quality:
        """Quality of the input; computed when first asked for, from the caller's arrays."""
        return quality(*self.before, L=self.target_length)

    @cached_property
    def quality_after(self) -> Quality:
        """Quality of the output; computed when first asked for."""
        return quality(*self.after, L=self.target_length)

    def to_dict(self) -> dict[str, Any]:
        """Return everything as a JSON-ready dict."""
        return {
            "target_length": self.target_length,
            "preset": self.preset,
            "options": dict(vars(self.options)),
            "sweeps": self.sweeps,
            "seconds": self.seconds,
            "stop": self.stop,
            "dirt": self.dirt,
            "features": self.features,
            "deviation": self.deviation,
            "quality_before": self.quality_before.to_dict(),
            "quality_after": self.quality_after.to_dict(),
        }
