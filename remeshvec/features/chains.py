"""Which candidate edges form creases: linked to chains, kept when long or sure enough."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, kernel
from ..core.vocabulary import NONE, BoolArray, FloatArray, IndexArray, IntArray
from ..mesh.walk import next_halfedge

__all__ = ["BORDER", "CLEAN", "HARD", "STRONG", "SURE", "WEAK", "count_chains", "keep_chains"]

# Classes of candidate edges; each class is all that the smaller ones are.
WEAK = 1
STRONG = 2
SURE = 3
CLEAN = 4
HARD = 5  # kept, and its chain with it
BORDER = 6  # on the boundary: kept, and only that

# A chain bends by at most 45 degrees at a vertex.
BEND = 0.5**0.5

# Where more edges meet, no curve passes (and pairing would cost the square of their number).
MAX_ENDS = 16

# Lengths in target lengths, or in mean edges where these are longer.
CHAIN_LENGTH = 4.0  # of a chain with a strong edge
COMPONENT_LENGTH = 12.0
CLOSED_EDGES = 6  # of a sure component without loose ends, however short
CLEAN_EDGES = 4  # of a chain or component that is half clean, however short

# Dropped chains leave loose ends behind. After two rounds a tenth more is kept on organic shapes,
# after eight as much as after four.
ROUNDS = 4

# Equal lengths must compare equal whatever the rounding.
SLACK = 1.0 - 1e-9


def keep_chains(
    X: FloatArray,
    origin: IndexArray,
    edges: IntArray,
    rank: NDArray[np.int8],
    mean_edge: float,
) -> BoolArray:
    """Tell which candidate edges are creases.

    The boundary stays. At each vertex the others that meet are paired, straightest first; linked runs
    are chains. A chain stays if it has a hard edge, if it is long and has a strong edge, if half of it
    is sure and no end of it is loose, or if half of it is clean. What is connected stays if it is long in
    all or has a hard edge, or is a third as long, half sure and begins on the boundary, or has no loose
    end and is half sure, or is half clean.

    Parameters
    ----------
    X : (n, 4) float64
        The last column is the target length.
    origin : (3 m,) int32
    edges : (k,) int64
        One half-edge of every candidate.
    rank : (k,) int8
        ``WEAK``, ``STRONG``, ``SURE``, ``CLEAN``, ``HARD`` or ``BORDER``.
    mean_edge : float
        Of the whole mesh.

    Returns
    -------
    (k,) bool
    """
    kept = np.zeros(len(edges), np.bool_)
    _sift(X, origin, edges, rank, mean_edge, _numbers(X), ROUNDS, kept)
    return kept


def count_chains(X: FloatArray, origin: IndexArray, twin: IndexArray, edges: IntArray) -> int:
    """Count the chains among feature edges, those that lie on the boundary alone left out."""
    counts = twin[edges] != NONE
    rank = np.full(len(edges), HARD, np.int8)
    return int(_sift(X, origin, edges, rank, 1.0, _numbers(X), 0, counts))


def _numbers(X: FloatArray) -> IndexArray:
    """Room for numbers of the vertices at candidates."""
    return np.full(len(X), NONE, np.int32)


@kernel
def _sift(X, origin, edges, rank, mean_edge, number, rounds, kept):
    """Mark the candidates that are kept; with no rounds, count the chains that have a marked edge."""
    n = edges.size
    end = np.empty((n, 2), np.int32)
    unit = np.empty((n, 3))
    length = np.empty((n, 2))  # in the units of X, and in target lengths
    n_vertices = _describe(X, origin, edges, mean_edge, number, end, unit, length)
    is_anchor = np.zeros(n_vertices, np.bool_)
    alive = np.empty(n, np.int32)
    n_alive = 0
    for k in range(n):
        if rank[k] == BORDER:
            # It lends an end to the others, neither length nor certainty: else every turn beside a
            # noisy one would stay.
            kept[k] = True
            is_anchor[end[k, 0]] = True
            is_anchor[end[k, 1]] = True
        else:
            alive[n_alive] = k
            n_alive += 1
    lists = np.empty((2, n_vertices), np.int32)
    links = np.empty((2, 2 * n), np.int32)
    n_groups = max(n, n_vertices)
    root = np.empty(n_groups, np.int32)
    sums = np.empty((n_groups, 4))
    count = np.empty((n_groups, 2), np.int32)
    traits = np.empty(n_groups, np.uint8)
    groups = sums, count, traits
    is_settled = False
    for turn in range(rounds + 1):
        by_vertex = rounds > 0 and (is_settled or turn == rounds)  # what is connected, at the end
        _list_ends(end, alive, n_alive, lists, links)
        for g in range(n_groups):
            root[g] = g
        if by_vertex:
            for i in range(n_alive):
                _join(root, end[alive[i], 0], end[alive[i], 1])
        else:
            _pair(unit, lists, links, root)
        for g in range(n_groups):
            root[g] = root[root[g]]
        if rounds == 0:
            return _count_marked(root, kept, traits)
        _add_up(alive, n_alive, by_vertex, root, end, length, rank, lists[1], is_anchor, groups)
        before = n_alive
        n_alive = 0
        for i in range(before):
            k = alive[i]
            if by_vertex:
                kept[k] = _component_stays(groups, root[end[k, 0]])
            elif _chain_stays(groups, root[k]):
                alive[n_alive] = k
                n_alive += 1
        if by_vertex:
            break
        is_settled = n_alive == before
    return 0


@inlined
def _describe(X, origin, edges, mean_edge, number, end, unit, length):
    """Measure all edges and number their ends; returns the number of vertices."""
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
def _list_ends(end, alive, n_alive, lists, links):
    """List the ends of edges (number 2 k or 2 k + 1) that meet at each vertex; none has a partner."""
    head, size = lists
    after, partner = links
    head[:] = NONE
    size[:] = 0
    for i in range(n_alive):
        for side in range(2):
            e = 2 * alive[i] + side
            v = end[alive[i], side]
            after[e] = head[v]
            head[v] = e
            size[v] += 1
            partner[e] = NONE


@inlined
def _pair(unit, lists, links, root):
    """Pair the ends that meet at a vertex, straightest first, and join their edges."""
    head, size = lists
    after, partner = links
    for v in range(head.size):
        if not 1 < size[v] <= MAX_ENDS:
            continue
        while True:
            i, j = _straightest(unit, after, partner, head[v])
            if j == NONE:
                break
            partner[i] = j
            partner[j] = i
            _join(root, i // 2, j // 2)


@inlined
def _straightest(unit, after, partner, first):
    """Find the two free ends of a list that bend least, -1 where none bend by 45 degrees at most."""
    best = BEND - 1e-8
    best_i = np.int32(NONE)
    best_j = np.int32(NONE)
    i = first
    while i != NONE:
        j = after[i]
        while j != NONE and partner[i] == NONE:
            if partner[j] == NONE:
                p, q = i // 2, j // 2
                cosine = unit[p, 0] * unit[q, 0] + unit[p, 1] * unit[q, 1] + unit[p, 2] * unit[q, 2]
                if i % 2 == j % 2:  # both leave or both arrive
                    cosine = -cosine
                # A straighter pair by rounding alone is none: the first of equals stays.
                if cosine > best + 1e-12:
                    best, best_i, best_j = cosine, i, j
            j = after[j]
        i = after[i]
    return best_i, best_j


@inlined
def _find(root, p):
    """Return the smallest number of a set; halves the path on the way."""
    while root[p] != p:
        root[p] = root[root[p]]
        p = root[p]
    return p


@inlined
def _join(root, p, q):
    p = _find(root, p)
    q = _find(root, q)
    root[max(p, q)] = min(p, q)


@inlined
def _count_marked(root, is_marked, is_counted):
    """Count the sets that have a marked edge."""
    count = 0
    is_counted[:] = 0
    for k in range(is_marked.size):
        if is_marked[k] and not is_counted[root[k]]:
            is_counted[root[k]] = 1
            count += 1
    return count


# What a group of edges has.
_A_STRONG = 1
_A_HARD = 2
_A_LOOSE_END = 4
_AN_ANCHOR = 8


@inlined
def _add_up(alive, n_alive, by_vertex, root, end, length, rank, size, is_anchor, groups):
    """Add up lengths and traits of the edges of each group."""
    sums, count, traits = groups
    for i in range(n_alive):
        k = alive[i]
        g = root[end[k, 0]] if by_vertex else root[k]
        for j in range(4):
            sums[g, j] = 0.0
        count[g, 0] = count[g, 1] = 0
        traits[g] = 0
    for i in range(n_alive):
        k = alive[i]
        g = root[end[k, 0]] if by_vertex else root[k]
        sums[g, 0] += length[k, 1]
        sums[g, 1] += length[k, 0]
        if rank[k] >= SURE:
            sums[g, 2] += length[k, 0]
            count[g, 0] += 1
        if rank[k] >= CLEAN:
            sums[g, 3] += length[k, 0]
            count[g, 1] += 1
        has = _A_STRONG * (rank[k] >= STRONG) + _A_HARD * (rank[k] >= HARD)
        for side in range(2):
            v = end[k, side]
            if is_anchor[v]:
                has |= _AN_ANCHOR
            elif size[v] == 1:
                has |= _A_LOOSE_END
        traits[g] |= has


@inlined
def _chain_stays(groups, g):
    sums, count, traits = groups
    half = 0.5 * SLACK * sums[g, 1]
    is_long = sums[g, 0] >= CHAIN_LENGTH * SLACK
    return (
        (is_long and traits[g] & _A_STRONG != 0)
        or (count[g, 0] > 0 and sums[g, 2] >= half and traits[g] & _A_LOOSE_END == 0)
        or (count[g, 1] >= CLEAN_EDGES and sums[g, 3] >= half)
        or traits[g] & _A_HARD != 0
    )


@inlined
def _component_stays(groups, g):
    sums, count, traits = groups
    half = 0.5 * SLACK * sums[g, 1]
    is_sure = count[g, 0] > 0 and sums[g, 2] >= half
    is_long = sums[g, 0] >= CHAIN_LENGTH * SLACK
    return (
        sums[g, 0] >= COMPONENT_LENGTH * SLACK
        or (is_sure and is_long and traits[g] & _AN_ANCHOR != 0)
        or (is_sure and count[g, 0] >= CLOSED_EDGES and traits[g] & _A_LOOSE_END == 0)
        or (count[g, 1] >= CLEAN_EDGES and sums[g, 3] >= half)
        or traits[g] & _A_HARD != 0
    )
