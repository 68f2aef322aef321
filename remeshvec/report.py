"""What a call returns: the mesh, where its vertices come from, and the report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .options import Options
from .quality import Quality, quality

__all__ = ["RemeshResult", "Report", "Stopwatch"]


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

    Attributes
    ----------
    V : (n, 3)
        Vertices, in the dtype of the input (float64 for integers).
    F : (m, 3)
        Faces, in the dtype of the input.
    birth_face : (n,) int64
        Input face on which each vertex lies.
    birth_barycentric : (n, 3) float64
        Where on it: ``V = sum(birth_barycentric[:, i] * V_in[F_in[birth_face, i]])`` for vertices
        that lie on the input; otherwise that is the point of the input closest to the vertex, among
        those that a walk over the input sees where it ends within 0.05 L.
    report : Report
    face_labels : (m,) int, or None
        Label of every face, where the input had labels.
    vertex_map : (n_in,) int64
        For every input vertex the output vertex that is the same, held bit for bit; -1 for none.
    face_map : (m_in,) int64
        For every input face that had to stay the output face; -1 for the others.
    feature_edges : (k, 2) int64
        Edges on creases, boundaries, borders of labels, and where sheets meet.
    corners : (k,) int64
        Vertices that did not move.
    lengths : (n,) float64
        Target edge length at every vertex.
    """

    V: NDArray[Any]
    F: NDArray[Any]
    birth_face: NDArray[np.int64]
    birth_barycentric: NDArray[np.float64]
    report: Report
    face_labels: NDArray[Any] | None
    vertex_map: NDArray[np.int64]
    face_map: NDArray[np.int64]
    feature_edges: NDArray[np.int64]
    corners: NDArray[np.int64]
    lengths: NDArray[np.float64]

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return iter((self.V, self.F))
