"""Feature edges as segments: their ends listed per vertex, and linked to chains or components."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from ..core.compiler import inlined, kernel
from ..core.vocabulary import NONE, FloatArray, IndexArray, IntArray
from ..mesh.walk import next_halfedge

__all__ = [
    "Ends",
    "Segments",
    "bend_cosine",
    "connect",
    "join",
    "link_chains",
    "list_ends",
    "measure_segments",
    "networks",
]

# A chain bends by at most 45 degrees at a vertex.
BEND = 0.5**0.5

# Where more edges meet, no curve passes. To pair them would cost the square of their number.
MAX_ENDS = 16


class Segments(NamedTuple):
    """Edges in space, and their ends numbered from 0."""

    end: IndexArray  # (k, 2)
    unit: FloatArray  # (k, 3) direction
    length: FloatArray  # (k, 2) in the units of X, and in target lengths
    n: int  # number of different ends

    def after(self, k: int) -> Segments:
        """Return the segments after the first ``k``."""
        return Segments(self.end[k:], self.unit[k:], self.length[k:], self.n)


class Ends(NamedTuple):
    """Ends of segments (numbers 2 k and 2 k + 1), in a list per vertex."""

    head: IndexArray  # (n,) first of the list
    size: IndexArray  # (n,) length of the list
    after: IndexArray  # (2 k,) next in the list
    partner: IndexArray  # (2 k,) the end of the next edge of the chain, or ``NONE``


def measure_segments(
    X: FloatArray, origin: IndexArray, edges: IntArray, mean_edge: float
) -> Segments:
    """Measure edges and number their ends.

    Parameters
    ----------
    X : (n, 4) float64
        The last column is the target length.
    origin : (3 m,) int32
    edges : (k,) int64
        One half-edge of each.
    mean_edge : float
        Lengths are also given in target lengths, or in this where it is longer.
    """
    k = len(edges)
    segments = Segments(np.empty((k, 2), np.int32), np.empty((k, 3)), np.empty((k, 2)), 0)
    n = _measure(X, origin, edges, mean_edge, np.full(len(X), NONE, np.int32), segments)
    return segments._replace(n=int(n))


def networks(segments: Segments, chosen: IntArray) -> IndexArray:
    """Return for some of the segments the smallest end of the connected network to which each belongs."""
    root = np.empty(segments.n, np.int32)
    _connect_all(segments.end, chosen, root)
    return root[segments.end[chosen, 0]]


@kernel
def _connect_all(end, chosen, root):
    connect(end, chosen, chosen.size, root)


@kernel
def _measure(X, origin, edges, mean_edge, number, segments):
    """Fill the record; ``number`` is room for the numbers of vertices. Returns how many there are."""
    end, unit, length, _ = segments
    count = 0
    for k in range(edges.size):
        h = edges[k]
        a, b = origin[h], origin[next_halfedge(h)]
        for side in range(2):
            v = b if side else a
            if number[v] == NONE:
                number[v] = count
                count += 1
            end[k, side] = number[v]
        x, y, z = X[b, 0] - X[a, 0], X[b, 1] - X[a, 1], X[b, 2] - X[a, 2]
        norm = sqrt(x * x + y * y + z * z)
        length[k, 0] = norm
        length[k, 1] = norm / max(0.5 * (X[a, 3] + X[b, 3]), mean_edge)
        if norm > 0.0:
            x, y, z = x / norm, y / norm, z / norm
        unit[k, 0] = x
        unit[k, 1] = y
        unit[k, 2] = z
    return count


@inlined
def list_ends(end, alive, n_alive, ends):
    """List the ends that meet at each vertex; none has a partner yet."""
    ends.head[:] = NONE
    ends.size[:] = 0
    for i in range(n_alive):
        for side in range(2):
            e = 2 * alive[i] + side
            v = end[alive[i], side]
            ends.after[e] = ends.head[v]
            ends.head[v] = e
            ends.size[v] += 1
            ends.partner[e] = NONE


@inlined
def link_chains(unit, ends, root):
    """Pair the ends that meet at each vertex, straightest first, and join their edges to chains."""
    for k in range(root.size):
        root[k] = k
    for v in range(ends.head.size):
        if not 1 < ends.size[v] <= MAX_ENDS:
            continue
        while True:
            i, j = _straightest(unit, ends, ends.head[v])
            if j == NONE:
                break
            ends.partner[i] = j
            ends.partner[j] = i
            join(root, i // 2, j // 2)
    for k in range(root.size):
        root[k] = root[root[k]]


@inlined
def connect(end, alive, n_alive, root):
    """Join the vertices of edges to connected components."""
    for v in range(root.size):
        root[v] = v
    for i in range(n_alive):
        join(root, end[alive[i], 0], end[alive[i], 1])
    for v in range(root.size):
        root[v] = root[root[v]]


@inlined
def _straightest(unit, ends, first):
    """Find the two free ends of a list that bend least; ``NONE`` if all pairs bend by over 45 degrees."""
    after, partner = ends.after, ends.partner
    best = BEND - 1e-8
    best_i = np.int32(NONE)
    best_j = np.int32(NONE)
    i = first
    while i != NONE:
        j = after[i]
        while j != NONE and partner[i] == NONE:
            if partner[j] == NONE:
                cosine = bend_cosine(unit, i, j)
                # A pair that is straighter by rounding alone does not count: the first of equals stays.
                if cosine > best + 1e-12:
                    best, best_i, best_j = cosine, i, j
            j = after[j]
        i = after[i]
    return best_i, best_j


@inlined
def bend_cosine(unit, i, j):
    """Cosine of the angle by which a path bends that comes in by one end and goes on by another."""
    p, q = i // 2, j // 2
    cosine = unit[p, 0] * unit[q, 0] + unit[p, 1] * unit[q, 1] + unit[p, 2] * unit[q, 2]
    return -cosine if i % 2 == j % 2 else cosine  # both leave or both arrive


@inlined
def _find(root, p):
    """Return the smallest member of a set; halves the path on the way."""
    while root[p] != p:
        root[p] = root[root[p]]
        p = root[p]
    return p


@inlined
def join(root, p, q):
    """Join the sets of two members."""
    p = _find(root, p)
    q = _find(root, q)
    root[max(p, q)] = min(p, q)
