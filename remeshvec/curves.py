"""Feature curves: feature edges linked to chains through the vertices where exactly two of them meet.

A feature edge carries a mark on both of its half-edges, or on its only one on the boundary. Chains
end at corners of the network, where one, three or more feature edges meet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ._jit import inlined, kernel
from ._types import NONE, IndexArray
from .halfedge import following, previous

__all__ = ["count_at_vertices", "link_chains"]


def link_chains(
    origin: IndexArray,
    twin: IndexArray,
    vertex_halfedge: IndexArray,
    is_feature: NDArray[np.bool_],
) -> IndexArray:
    """Link feature half-edges to chains.

    Parameters
    ----------
    origin, twin : (3 m,) int32
    vertex_halfedge : (n,) int32
    is_feature : (3 m,) bool
        The same on both half-edges of an edge.

    Returns
    -------
    links : (2, 3 m) int32
        ``links[0, h]`` leaves the vertex where feature half-edge ``h`` ends, and continues its curve
        where exactly two feature edges meet; ``links[1, h]`` ends where ``h`` begins. -1 elsewhere.
        So a chain inside the surface is linked in both directions, one on the boundary along its
        half-edges without twin.
    """
    links = np.full((2, origin.size), NONE, np.int32)
    features = np.flatnonzero(is_feature)
    if len(features):
        count = np.zeros(vertex_halfedge.size, np.int32)
        _count(origin, twin, features, count)
        _link(origin, twin, vertex_halfedge, is_feature, features, count, links)
    return links


def count_at_vertices(
    origin: IndexArray, twin: IndexArray, is_feature: NDArray[np.bool_], n: int
) -> IndexArray:
    """Count the feature edges at each of ``n`` vertices.

    Returns
    -------
    (n,) int32
    """
    count = np.zeros(n, np.int32)
    _count(origin, twin, np.flatnonzero(is_feature), count)
    return count


@kernel
def _count(origin, twin, features, count):
    for h in features:
        if twin[h] < h:  # each edge once; the boundary has no twin
            count[origin[h]] += 1
            count[origin[following(h)]] += 1


@kernel
def _link(origin, twin, vertex_halfedge, is_feature, features, count, links):
    for h in features:
        v = origin[following(h)]
        if count[v] != 2:
            continue
        g = _other_feature(twin, is_feature, np.int64(vertex_halfedge[v]), h)
        if g != NONE:
            links[0, h] = g
            links[1, g] = h


@inlined
def _other_feature(twin, is_feature, start, h):
    """Feature half-edge out of the end of ``h`` that is not of the same edge."""
    g = start
    for _ in range(twin.size):
        if is_feature[g] and (g != twin[h] or twin[h] == NONE):
            return g
        g = np.int64(twin[previous(g)])
        if g == start or g == NONE:
            break
    return np.int64(NONE)
