"""Edges on chains that turn as a drawn curve does: a little at each end, and to the same side."""

from __future__ import annotations

from math import cos, radians, sin, sqrt

import numpy as np

from ..core.compiler import inlined, kernel
from ..core.vocabulary import NONE, BoolArray, IntArray
from .links import Ends, Segments, link_chains, list_ends

__all__ = ["find_rounded"]

# Degrees by which a chain bends at each end of a rounded edge. On masks chains go straight on, or bend by
# 18 degrees or more: their edges have few directions.
LEAST_BEND, MOST_BEND = 0.25, 16.0

# Both bends lie within this factor of each other, and within so many degrees of the same direction.
UNEVEN = 3.0
ASIDE = 60.0

# Lengths of the difference of two unit vectors at the two bends.
_LEAST, _MOST = 2.0 * sin(radians(LEAST_BEND) / 2.0), 2.0 * sin(radians(MOST_BEND) / 2.0)
_COSINE = cos(radians(ASIDE))


def find_rounded(segments: Segments, chosen: IntArray) -> BoolArray:
    """Tell which edges are rounded.

    Parameters
    ----------
    segments : Segments
    chosen : (j,) int64
        Those of the segments that are linked to chains; the others do not exist.

    Returns
    -------
    (j,) bool
    """
    is_rounded = np.zeros(len(chosen), np.bool_)
    _mark(segments.end, segments.unit, segments.n, chosen, is_rounded)
    return is_rounded


@kernel
def _mark(end, unit, n, chosen, is_rounded):
    k = len(unit)
    lists, links = np.empty((2, n), np.int32), np.empty((2, 2 * k), np.int32)
    ends = Ends(lists[0], lists[1], links[0], links[1])
    list_ends(end, chosen, chosen.size, ends)
    link_chains(unit, ends, np.empty(k, np.int32))
    for i in range(chosen.size):
        e = chosen[i]
        before, after = ends.partner[2 * e], ends.partner[2 * e + 1]
        if before != NONE and after != NONE:
            is_rounded[i] = _is_rounded(unit, before, e, after)


@inlined
def _is_rounded(unit, before, e, after):
    """Compare the bends at the two ends of an edge."""
    p, q = before // 2, after // 2
    # Along the edge: the chain comes in by the second end of the edge before, and leaves by the first
    # of the one after.
    s = 1.0 if before % 2 else -1.0
    t = -1.0 if after % 2 else 1.0
    dot = first = second = 0.0
    for i in range(3):
        x = unit[e, i] - s * unit[p, i]
        y = t * unit[q, i] - unit[e, i]
        dot += x * y
        first += x * x
        second += y * y
    first, second = sqrt(first), sqrt(second)
    low, high = min(first, second), max(first, second)
    is_even = low >= _LEAST and high <= _MOST and high <= UNEVEN * low
    return is_even and dot >= _COSINE * first * second
