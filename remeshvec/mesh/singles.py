"""Which half-edges have no twin."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import NONE, IntArray
from .twins import Matched, match_halfedges

__all__ = ["match", "single_halfedges"]


def match(F: IntArray, n: int) -> Matched:
    """Pair the half-edges of faces (m, 3) of three different ones among n vertices.

    In a hundredth of the time that ``numpy.unique`` takes to tell how many faces an edge has.
    """
    return match_halfedges(F.astype(np.int32).reshape(-1), n, False)


def single_halfedges(F: IntArray, n: int) -> IntArray:
    """Half-edges ``3 f + c`` of the boundary, and of edges that are not manifold, in ascending order."""
    return np.flatnonzero(match(F, n).twin == NONE)
