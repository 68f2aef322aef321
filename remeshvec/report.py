"""What a call returns: the mesh, where its vertices come from, and the report."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .options import Options
from .quality import Quality, quality

__all__ = ["Late", "RemeshResult", "Report", "Stopwatch"]

T = TypeVar("T")

Births = tuple[NDArray[np.int64], NDArray[np.float64]]


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


@dataclass
class RemeshResult:
    """A remeshed surface; unpacks as ``V, F = result``.

    What few callers read is computed when it is first asked for, or when the result is copied or
    pickled. Until then births of vertices that were not projected hold the input's faces in memory.

    Attributes
    ----------
    V : (n, 3)
        Vertices, in the dtype of the input (float64 for integers).
    F : (m, 3)
        Faces, in the dtype of the input.
    report : Report
    face_labels : (m,) int, or None
        Label of every face, where the input had labels.
    lengths : (n,) float64
        Target edge length at every vertex.
    """

    V: NDArray[Any]
    F: NDArray[Any]
    report: Report
    face_labels: NDArray[Any] | None
    lengths: NDArray[np.float64]
    _births: Late[Births] = field(repr=False, compare=False)
    _vertex_map: Late[NDArray[np.int64]] = field(repr=False, compare=False)
    _face_map: Late[NDArray[np.int64]] = field(repr=False, compare=False)
    _feature_edges: Late[NDArray[np.int64]] = field(repr=False, compare=False)
    _corners: Late[NDArray[np.int64]] = field(repr=False, compare=False)

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return iter((self.V, self.F))

    def show(self, *, title: str = "", up: str = "y") -> None:
        """Show a page with both meshes, histograms and measures (the extra ``[html]``).

        In a Jupyter notebook it appears below the cell, about 5 MB of output; elsewhere it opens in
        the browser, from a file in the folder for temporary files.

        Parameters
        ----------
        title : str
            Heading, such as the name of the mesh.
        up : {"y", "z"}
            Axis that points up in the first view.

        Raises
        ------
        PlotlyMissingError
            Plotly is not installed.
        OptionError
            `up` is no such axis.
        """
        import remeshvec  # not the page's module: results know nothing of what shows them

        remeshvec.show_html(self, title=title, up=up)

    @property
    def birth_face(self) -> NDArray[np.int64]:
        """Input face on which each vertex lies, (n,)."""
        return self._births()[0]

    @property
    def birth_barycentric(self) -> NDArray[np.float64]:
        """Where on its birth face each vertex lies, (n, 3).

        ``V = sum(birth_barycentric[:, i] * V_in[F_in[birth_face, i]])`` for vertices that lie on the
        input; otherwise that is the point of the input closest to the vertex, among those that a walk
        over the input sees where it ends within 0.05 L.
        """
        return self._births()[1]

    @property
    def vertex_map(self) -> NDArray[np.int64]:
        """For every input vertex the output vertex that is the same, bit for bit; -1 for none."""
        return self._vertex_map()

    @property
    def face_map(self) -> NDArray[np.int64]:
        """For every input face that had to stay the output face; -1 for the others."""
        return self._face_map()

    @property
    def feature_edges(self) -> NDArray[np.int64]:
        """Edges on creases, boundaries, borders of labels, and where sheets meet, (k, 2)."""
        return self._feature_edges()

    @property
    def corners(self) -> NDArray[np.int64]:
        """Vertices that did not move, (k,)."""
        return self._corners()
