"""Feature curves: feature edges linked to chains through the vertices where exactly two of them meet.

A feature edge carries a mark on both of its half-edges, or on its only one on the boundary. Chains
end at corners of the network, where one, three or more feature edges meet.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.compiler import kernel
from ..core.vocabulary import NONE, BoolArray, IndexArray
from ..mesh.walk import next_halfedge

__all__ = ["Curves", "link_chains"]


class Curves(NamedTuple):
    """Feature half-edges, k of them, and what precedes and follows each on its curve.

    A chain inside the surface is linked in both directions, one on the boundary along its half-edges
    without twin.

    Parameters
    ----------
    edges : (k,) int32
        Feature half-edges, in ascending order.
    after : (k,) int32
        Place in ``edges`` of the one that leaves the vertex where each ends and continues its curve,
        where exactly two feature edges meet; -1 elsewhere.
    before : (k,) int32
        Place of the one that each continues; -1 where there is none.
    degree : (n,) int32
        Feature edges at each vertex.
    """

    edges: IndexArray
    after: IndexArray
    before: IndexArray
    degree: IndexArray


def link_chains(origin: IndexArray, twin: IndexArray, is_feature: BoolArray, n: int) -> Curves:
    """Link feature half-edges to chains.

    Parameters
    ----------
    origin, twin : (3 m,) int32
    is_feature : (3 m,) bool
        The same on both half-edges of an edge.
    n : int
        Number of vertices.
    """
    edges = np.flatnonzero(is_feature).astype(np.int32)
    curves = Curves(
        edges, np.full_like(edges, NONE), np.full_like(edges, NONE), np.zeros(n, np.int32)
    )
    if len(edges):
        _link(origin, twin, *curves, np.zeros((n, 2), np.int32))
    return curves


@kernel
def _link(origin, twin, edges, after, before, count, leaving):
    """Link; ``leaving`` is room for the first and last feature half-edge that leave a vertex."""
    for i in range(edges.size):
        h = edges[i]
        v = origin[h]
        if twin[h] < h:  # each edge once; the boundary has no twin
            count[v] += 1
            count[origin[next_halfedge(h)]] += 1
        if leaving[v, 0] == 0:
            leaving[v, 0] = i + 1
        leaving[v, 1] = i + 1
    for i in range(edges.size):
        h = edges[i]
        v = origin[next_halfedge(h)]
        if count[v] == 2:
            j = leaving[v, 0] - 1
            if edges[j] == twin[h]:
                j = leaving[v, 1] - 1
            if edges[j] != twin[h]:
                after[i] = j
                before[j] = i
