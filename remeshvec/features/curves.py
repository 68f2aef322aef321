"""Feature curves: feature edges linked to chains at the vertices where exactly two of them meet.

A feature edge is marked on both of its half-edges, or on the only one at the boundary. Chains end at
corners of the network, where one, three or more feature edges meet.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.compiler import kernel
from ..core.vocabulary import NONE, BoolArray, IndexArray
from ..mesh.walk import next_halfedge

__all__ = ["Curves", "link_chains"]


class Curves(NamedTuple):
    """Feature half-edges, and which of them precede and follow each other on a curve.

    A chain inside the surface is linked in both directions, a chain on the boundary along its half-edges
    without twin.

    Parameters
    ----------
    edges : (k,) int32
        Feature half-edges, in ascending order.
    after : (k,) int32
        Index in ``edges`` of the half-edge that continues the curve where this one ends, if exactly two
        feature edges meet there; otherwise ``NONE``.
    before : (k,) int32
        Index of the half-edge that this one continues, or ``NONE``.
    degree : (n,) int32
        Number of feature edges at each vertex.
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
        _link(origin, twin, curves, np.zeros((n, 2), np.int32))
    return curves


@kernel
def _link(origin, twin, curves, leaving):
    """Fill the record; ``leaving`` holds the first and last feature half-edge at each vertex, plus 1."""
    edges, after, before, degree = curves
    for i in range(edges.size):
        h = edges[i]
        v = origin[h]
        if twin[h] < h:  # each edge once; the boundary has no twin
            degree[v] += 1
            degree[origin[next_halfedge(h)]] += 1
        if leaving[v, 0] == 0:
            leaving[v, 0] = i + 1
        leaving[v, 1] = i + 1
    for i in range(edges.size):
        h = edges[i]
        v = origin[next_halfedge(h)]
        if degree[v] == 2:
            j = leaving[v, 0] - 1
            if edges[j] == twin[h]:
                j = leaving[v, 1] - 1
            if edges[j] != twin[h]:
                after[i] = j
                before[j] = i
