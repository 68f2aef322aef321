"""Which closed components face inwards, and are no cavities."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import BoolArray, FloatArray, IntArray
from ..mesh.singles import single_halfedges

__all__ = ["turn_outwards"]


def turn_outwards(V: FloatArray, F: IntArray, n: int, part: IntArray) -> BoolArray:
    """Mask (n,) of the components to turn inside out.

    Closed components that enclose a negative volume; but what lies in the box of a larger one may be a
    cavity of it, and is turned as that one is.
    """
    volume = np.where(_closed(F, n, part), _volumes(V, F, n, part), 0.0)
    low, high = _boxes(V, F, n, part)
    turned = volume < 0.0
    # Large boxes first: what holds a box is decided before the box.
    order = np.argsort(-np.prod(high - low, axis=1), kind="stable")
    outer = order[:0]
    for k in order:
        around = (low[outer] <= low[k]).all(axis=1) & (high[outer] >= high[k]).all(axis=1)
        if around.any():
            turned[k] = turned[outer[np.argmax(around)]]
        elif volume[k]:
            outer = np.append(outer, k)
    return turned


def _closed(F: IntArray, n: int, part: IntArray) -> BoolArray:
    """Mask (n,) of the components without boundary whose faces have one winding."""
    closed = np.ones(n, np.bool_)
    closed[part[single_halfedges(F, int(F.max()) + 1) // 3]] = False
    return closed


def _volumes(V: FloatArray, F: IntArray, n: int, part: IntArray) -> FloatArray:
    """Six times the volumes of components, each from a vertex of its own, for precision."""
    origin = np.empty((n, 3))
    origin[part[::-1]] = V[F[::-1, 0]]
    a, b, c = (V[F[:, k]] - origin[part] for k in range(3))
    return np.asarray(np.bincount(part, np.einsum("fi,fi->f", a, np.cross(b, c)), n), np.float64)


def _boxes(V: FloatArray, F: IntArray, n: int, part: IntArray) -> tuple[FloatArray, FloatArray]:
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    for k in range(3):
        np.minimum.at(low, part, V[F[:, k]])
        np.maximum.at(high, part, V[F[:, k]])
    return low, high
