"""Steps from half-edge to half-edge, and the ends of edges."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined

__all__ = [
    "apex_of",
    "corners_of",
    "end_of",
    "ends_of",
    "next_halfedge",
    "next_spoke",
    "previous_halfedge",
]


@inlined
def next_halfedge(h):
    """Return the next half-edge of the same face."""
    return h + 1 - 3 * np.int64(np.uint64(h) % np.uint64(3) == np.uint64(2))


@inlined
def previous_halfedge(h):
    """Return the previous half-edge of the same face."""
    return h - 1 + 3 * np.int64(np.uint64(h) % np.uint64(3) == np.uint64(0))


@inlined
def next_spoke(twin, h):
    """Return the next half-edge counter-clockwise around an origin; ``NONE`` at the boundary."""
    return np.int64(twin[previous_halfedge(h)])


@inlined
def end_of(origin, h):
    """Return the vertex where a half-edge ends."""
    return origin[next_halfedge(h)]


@inlined
def apex_of(origin, h):
    """Return the vertex opposite a half-edge in its face."""
    return origin[previous_halfedge(h)]


@inlined
def corners_of(origin, f):
    """Return the three vertices of a face."""
    return origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]


def ends_of(origin: NDArray[Any], h: NDArray[Any]) -> NDArray[Any]:
    """Return the vertices (2, k) where the half-edges ``h`` (k,) start and end."""
    return origin[np.stack([h, h - h % 3 + (h + 1) % 3])]
