"""Creases too close to each other: where two meet at an acute angle, the less sure one gives way."""

from __future__ import annotations

from math import cos, radians, sqrt

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, kernel
from ..core.vocabulary import NONE, BoolArray, FloatArray
from .candidates import CLEAN_RATIO, CROWDED, HARD
from .links import MAX_ENDS, Ends, Segments, bend_cosine, list_ends

__all__ = ["drop_acute"]

# Two edges at a vertex are a pair if the cosine of the angle between them is above this, ...
ACUTE = cos(radians(35.0))

# ... and the end of the one is less than so many target lengths from the line of the other.
CLEARANCE = 0.6


def drop_acute(
    segments: Segments,
    rank: NDArray[np.int8],
    ratio: FloatArray,
    strength: FloatArray,
    kept: BoolArray,
) -> bool:
    """Take the class from kept edges that meet a surer one at an acute angle: on scans mostly flaws.

    Such pairs make slivers: without them the smallest angle of six scans rose by 5 to 26 degrees.

    Parameters
    ----------
    segments : Segments
    rank : (k,) int8
        ``CROWDED`` is written.
    ratio : (k,) float64
        Turn over noise. Of two edges that are clean or hard both stay.
    strength : (k,) float64
        Of the other pairs the edge with less strength goes.
    kept : (k,) bool

    Returns
    -------
    bool
        Whether any was found.
    """
    is_weaker = np.zeros(len(rank), np.bool_)
    is_safe = (ratio >= CLEAN_RATIO) | (rank >= HARD)
    _mark_weaker(segments, np.flatnonzero(kept), is_safe, strength, is_weaker)
    rank[is_weaker] = CROWDED
    return bool(is_weaker.any())


@kernel
def _mark_weaker(segments, kept, is_safe, strength, is_weaker):
    """Mark the lesser edge of every pair; nothing is dropped before all pairs are known."""
    k, n = is_safe.size, segments.n
    lists, links = np.empty((2, n), np.int32), np.empty((2, 2 * k), np.int32)
    ends = Ends(lists[0], lists[1], links[0], links[1])
    list_ends(segments.end, kept, kept.size, ends)
    for v in range(n):
        if not 1 < ends.size[v] <= MAX_ENDS:
            continue
        i = ends.head[v]
        while i != NONE:
            j = ends.after[i]
            while j != NONE:
                p, q = i // 2, j // 2
                cosine = -bend_cosine(segments.unit, i, j)
                if cosine > ACUTE and not (is_safe[p] and is_safe[q]):
                    lesser = p if _is_weaker(is_safe, strength, p, q) else q
                    height = segments.length[lesser, 1] * sqrt(max(0.0, 1.0 - cosine * cosine))
                    is_weaker[lesser] |= height < CLEARANCE
                j = ends.after[j]
            i = ends.after[i]


@inlined
def _is_weaker(is_safe, strength, p, q):
    """Compare two edges; of equal ones the later is the weaker."""
    if is_safe[p] != is_safe[q]:
        return is_safe[q]
    return strength[p] < strength[q]
