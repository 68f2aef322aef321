"""Steps from half-edge to half-edge, and the ends of edges."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined

__all__ = ["ends_of", "next_halfedge", "next_spoke", "previous_halfedge"]


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


def ends_of(origin: NDArray[Any], h: NDArray[Any]) -> NDArray[Any]:
    """Return the vertices (2, k) where the half-edges ``h`` (k,) start and end."""
    return origin[np.stack([h, h - h % 3 + (h + 1) % 3])]
