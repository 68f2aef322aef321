"""Target lengths as a field on the input: from curvature, or given, and how fast they may grow."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, log1p, sqrt
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.arguments import number
from ..core.compiler import inlined, kernel
from ..core.geometry import area_vector
from ..core.vocabulary import EQUILATERAL_AREA, BoolArray, FloatArray, IndexArray
from ..errors import OptionError
from .curvature import largest_curvature
from .gradation import limit_gradation

__all__ = [
    "Adaptive",
    "adaptive_lengths",
    "expected_faces",
    "limit_gradation",
    "target_lengths",
]


@dataclass(frozen=True)
class Adaptive:
    """Edge lengths from the curvature, so that flat triangles stay within a tolerance of the surface.

    On a surface with a largest absolute principal curvature ``k``, an edge gets the length
    ``sqrt(6 tolerance / k - 3 tolerance^2)``: the middle of an equilateral triangle of that size, with
    its corners on a sphere of curvature ``k``, is off by ``tolerance`` [Dunyach et al. 2013, section 3].
    Lengths are for 0.9 of the tolerance, and shortened between sweeps where they turn out too long: on a
    smooth surface nearly all of it ends within the tolerance, on one that is rough at that scale less.
    Nothing is split at the end, where it would leave slivers. ``report.deviation``
    says; ``max_deviation`` is a bound.

    Parameters
    ----------
    tolerance : float
        Distance from the surface, in the units of the vertices.
    min_length : float, optional
        Shortest target length. By default three times the tolerance, which is reached at radii of two
        tolerances: smaller ones, such as tips of cones or noise, do not shorten edges further.
    max_length : float, optional
        Longest target length, taken where the surface is flat. By default a tenth of the longest side
        of the bounding box, or, with a coarse tolerance, the length on a sphere with that radius.

    Raises
    ------
    OptionError
        A value is not a positive number, or ``min_length`` is above ``max_length``.

    Examples
    --------
    >>> remesh(V, F, Adaptive(tolerance=0.01))  # doctest: +SKIP
    """

    tolerance: float
    min_length: float | None = None
    max_length: float | None = None

    def __post_init__(self) -> None:
        number(self.tolerance, "tolerance", above=0.0, unit="units of V")
        for name in ("min_length", "max_length"):
            if getattr(self, name) is not None:
                number(getattr(self, name), name, above=0.0, unit="units of V")
        if self.min_length and self.max_length and self.min_length > self.max_length:
            raise OptionError(
                f"min_length = {self.min_length} is above max_length = {self.max_length}; "
                "swap them, or leave one out"
            )

    def limits(self, extent: float) -> tuple[float, float]:
        """Return the shortest and the longest length for a mesh whose longest side is ``extent``.

        Parameters
        ----------
        extent : float
            Longest side of the bounding box.

        Raises
        ------
        OptionError
            ``extent`` is not a number, or negative.
        """
        extent = number(extent, "extent", low=0.0)
        shortest, longest = self.min_length, self.max_length
        if shortest is None:
            shortest = min(3.0 * self.tolerance, inf if longest is None else longest)
        if longest is None:
            on_sphere = sqrt(max(0.0, 6.0 * self.tolerance * extent - 3.0 * self.tolerance**2))
            longest = max(0.1 * extent, on_sphere, shortest)
        return float(shortest), float(longest)


def adaptive_lengths(
    X: FloatArray,
    origin: IndexArray,
    twin: IndexArray,
    vertex_halfedge: IndexArray,
    is_feature: BoolArray,
    tolerance: float,
    shortest: float,
    longest: float,
) -> FloatArray:
    """Length at every vertex for a distance of ``tolerance`` from the surface; see `Adaptive`.

    Parameters
    ----------
    X : (n, 3 or more) float64
    origin, twin : (3 m,) int32
    vertex_halfedge : (n,) int32
    is_feature : (3 m,) bool
        Edges whose two sides are measured apart.
    tolerance, shortest, longest : float
        In the units of ``X``.

    Returns
    -------
    (n,) float64
        Between ``shortest`` and ``longest``.
    """
    curvature = largest_curvature(X, origin, twin, vertex_halfedge, is_feature)
    with np.errstate(divide="ignore", over="ignore"):
        squared = 6.0 * tolerance / curvature - 3.0 * tolerance * tolerance
    return np.clip(np.sqrt(np.maximum(squared, 0.0)), shortest, longest)


# -- what the caller gives --------------------------------------------------------------------


def target_lengths(V: FloatArray, L: Any) -> float | FloatArray:
    """Turn a number, an array or a function into target lengths, checked.

    Parameters
    ----------
    V : (n, 3) float64
        Vertices of the input. Where one is not finite, which no face may use, any length is accepted.
    L : float, (n,) array or callable
        Functions take points (n, 3) and return (n,) lengths.

    Returns
    -------
    float or (n,) float64
        A number stays a number. Arrays are the caller's own where no cast is needed: do not write.

    Raises
    ------
    OptionError
        What ``L`` gives is not positive and finite, or not one number a vertex.
    """
    if isinstance(L, Real):
        return number(L, "L", above=0.0, unit="units of V")
    name = "L"
    if callable(L):
        L, name = L(np.array(V, np.float64)), "L(points)"  # a copy: it may write to its argument
    try:
        lengths = np.asarray(L)
    except (ValueError, TypeError):
        lengths = np.empty(0, object)
    if lengths.dtype.kind not in "fiu":
        raise OptionError(
            f"{name} must hold real numbers, one length a vertex; got {_kind(L, lengths)}"
        )
    if lengths.shape != (len(V),):
        hint = "; flatten it" if lengths.size == len(V) else ""
        raise OptionError(
            f"{name} must have shape ({len(V)},), one length a vertex of V; "
            f"got {lengths.shape}{hint}"
        )
    with np.errstate(over="ignore"):
        lengths = lengths.astype(np.float64, copy=False)
    is_bad = ~(np.isfinite(lengths) & (lengths > 0.0)) & np.isfinite(V).all(axis=1)
    if is_bad.any():
        bad = np.flatnonzero(is_bad)
        shown = ", ".join(str(i) for i in bad[:5]) + (", ..." if len(bad) > 5 else "")
        raise OptionError(
            f"{name} must be positive and finite; it is not at {len(bad)} of {len(V)} vertices "
            f"({shown}), where it is {lengths[bad[0]]:g} first"
        )
    return lengths


def _kind(value: Any, array: NDArray[Any]) -> str:
    """Say what was given instead of an array of numbers."""
    is_array = isinstance(value, np.ndarray | list | tuple) and array.dtype.kind != "O"
    return f"dtype {array.dtype}" if is_array else f"{type(value).__name__}"


# -- how many faces they make -----------------------------------------------------------------


def expected_faces(X: FloatArray, origin: IndexArray, lengths: FloatArray) -> float:
    """Estimate the number of faces of a mesh with these lengths.

    A face of the new mesh is about equilateral, with edges of the target length; the density
    ``1 / (sqrt(3) / 4 L^2)`` of the linear interpolant of ``L`` is integrated exactly.

    Parameters
    ----------
    X : (n, 3 or more) float64
    origin : (3 m,) int32
    lengths : (n,) float64
    """
    return float(_integrate_density(X, origin, lengths)) / EQUILATERAL_AREA


@inlined
def _mean_inverse(a, b):
    """Mean of ``1 / t`` between two lengths: ``log(b / a) / (b - a)``."""
    x = (b - a) / a
    return (1.0 - 0.5 * x if x < 1e-8 else log1p(x) / x) / a


@inlined
def _mean_density(a, b, c):
    """Mean of ``1 / L^2`` over a face with ``L`` linear, from the lengths at its corners.

    It is twice the second divided difference of ``-log`` [Hermite and Genocchi].
    """
    low, high = min(a, b, c), max(a, b, c)
    if high < 1.001 * low:  # the difference of nearly equal numbers; the middle is good to 1e-6
        return 9.0 / (a + b + c) ** 2
    middle = max(min(a, b), min(max(a, b), c))
    return 2.0 * (_mean_inverse(low, middle) - _mean_inverse(middle, high)) / (high - low)


@kernel
def _integrate_density(X, origin, lengths):
    total = 0.0
    for f in range(origin.size // 3):
        a, b, c = origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]
        x, y, z = area_vector(X, a, b, c)
        area = 0.5 * sqrt(x * x + y * y + z * z)
        total += area * _mean_density(lengths[a], lengths[b], lengths[c])
    return total
