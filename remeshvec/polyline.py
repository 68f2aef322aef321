"""Feature curves of the reference surface as polylines: which edges follow each other, closest point.

Every edge of a curve goes by one name, the smallest of its half-edges (of all sheets that share it), so
that its two sides, and all sheets, look for a point in the same way.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ._jit import inlined
from ._types import NONE, FloatArray, IndexArray
from .geometry import closest_on_segment
from .halfedge import following

__all__ = ["closest_on_curve", "find_siblings", "join_edges", "name_edges"]


def name_edges(
    twin: IndexArray, is_feature: NDArray[np.bool_], members: IndexArray, group: IndexArray
) -> IndexArray:
    """Give every edge on a curve one name.

    Parameters
    ----------
    twin : (3 m,) int32
    is_feature : (3 m,) bool
    members, group : int32
        Siblings, see `find_siblings`.

    Returns
    -------
    (3 m,) int32
        Smallest half-edge of the edge, ``NONE`` off curves.
    """
    name = np.full(len(twin), NONE, np.int32)
    h = np.flatnonzero(is_feature).astype(np.int32)
    name[h] = np.where(twin[h] == NONE, h, np.minimum(h, twin[h]))
    if len(members):
        smallest = np.minimum.reduceat(members, group[:-1])
        name[members] = np.repeat(smallest, np.diff(group))
    return name


def join_edges(
    name: IndexArray, links: IndexArray, origin: IndexArray, is_corner: NDArray[np.bool_]
) -> IndexArray:
    """Join the edges of curves to polylines that end at corners.

    Parameters
    ----------
    name : (3 m,) int32
        See `name_edges`.
    links : (2, 3 m) int32
        Following and preceding half-edge of the same curve, ``NONE`` at its ends.
    origin : (3 m,) int32
    is_corner : (n,) bool

    Returns
    -------
    beside : (2, 3 m) int32
        At the names: the names of the neighbours at their start and their end, ``NONE`` at corners;
        (2, 0) where there are no curves.
    """
    edges = np.unique(name[name != NONE])
    if not len(edges):
        return np.empty((2, 0), np.int32)
    beside = np.full((2, len(name)), NONE, np.int32)
    ends = origin[edges], origin[edges - edges % 3 + (edges + 1) % 3]
    for side in range(2):
        neighbour = links[1 - side, edges]
        is_open = (neighbour == NONE) | is_corner[ends[side]]
        beside[side, edges] = np.where(is_open, NONE, name[neighbour])
    return beside


def find_siblings(
    X: FloatArray, origin: IndexArray, candidates: IndexArray
) -> tuple[IndexArray, IndexArray]:
    """Group half-edges whose two ends lie in the same places, bit for bit.

    Parameters
    ----------
    X : (n, 3) or (n, 4) float64
    origin : (3 m,) int32
    candidates : (k,) int32
        Half-edges.

    Returns
    -------
    members : (j,) int32
        Half-edges that have siblings, those of a group together and in ascending order.
    group : (g + 1,) int32
        Where the groups start.
    """
    if not len(candidates):
        return np.empty(0, np.int32), np.zeros(1, np.int32)
    ends = np.stack([origin[candidates], origin[candidates - candidates % 3 + (candidates + 1) % 3]])
    vertices, place = np.unique(ends, return_inverse=True)
    place = place.reshape(2, -1)
    _, same = np.unique(X[vertices, :3] + 0.0, axis=0, return_inverse=True)  # no -0.0
    key = np.sort(same.reshape(-1)[place], axis=0)
    order = np.lexsort((candidates, key[1], key[0]))
    key = key[:, order]
    starts = np.flatnonzero(np.r_[True, (key[:, 1:] != key[:, :-1]).any(axis=0)])
    sizes = np.diff(np.r_[starts, len(order)])
    is_shared = np.repeat(sizes > 1, sizes)
    group = np.r_[0, np.cumsum(sizes[sizes > 1])].astype(np.int32)
    return candidates[order][is_shared].astype(np.int32), group


@inlined
def closest_on_curve(X, origin, beside, start, x, y, z):
    """Closest point of a curve near edge ``start``: edge, parameter, distance squared.

    Searched are the edges within three times the distance to ``start`` along the curve, on both
    sides: a vertex stays on its own stretch where another comes close.
    """
    a = origin[start]
    b = origin[following(start)]
    best = start
    s, distance = closest_on_segment(x, y, z, X[a, 0], X[a, 1], X[a, 2], X[b, 0], X[b, 1], X[b, 2])
    reach = 3.0 * np.sqrt(distance)
    for side in range(2 if beside.shape[1] > 0 else 0):
        before = start
        h = np.int64(beside[side, start])
        walked = 0.0
        for _ in range(beside.shape[1]):
            if walked > reach or h == start or h == NONE:
                break
            a = origin[h]
            b = origin[following(h)]
            r, d = closest_on_segment(x, y, z, X[a, 0], X[a, 1], X[a, 2], X[b, 0], X[b, 1], X[b, 2])
            if d < distance:
                best, s, distance = h, r, d
            walked += np.sqrt(
                (X[a, 0] - X[b, 0]) ** 2 + (X[a, 1] - X[b, 1]) ** 2 + (X[a, 2] - X[b, 2]) ** 2
            )
            after = np.int64(beside[0, h])
            if after == before:
                after = np.int64(beside[1, h])
            before, h = h, after
    return best, s, distance
