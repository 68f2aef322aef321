"""Link candidate edges to chains, and keep the chains that are long or sure enough to be creases."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, kernel
from ..core.vocabulary import NONE, BoolArray, FloatArray, IndexArray, IntArray
from ..mesh.walk import next_halfedge

__all__ = ["BORDER", "CLEAN", "HARD", "STRONG", "SURE", "WEAK", "count_chains", "keep_chains"]

# Classes of candidate edges; each class has the properties of the smaller ones too.
WEAK = 1
STRONG = 2
SURE = 3
CLEAN = 4
HARD = 5  # kept, and its chain with it
BORDER = 6  # on the boundary: kept, but does not keep its chain

# A chain bends by at most 45 degrees at a vertex.
BEND = 0.5**0.5

# Where more edges meet, no curve passes. To pair them would cost the square of their number.
MAX_ENDS = 16

# Least lengths, in target lengths, or in mean edges where these are longer.
CHAIN_LENGTH = 4.0  # of a chain with a strong edge
COMPONENT_LENGTH = 12.0

# Least numbers of edges, however short.
CLOSED_EDGES = 6  # of a sure component without loose ends
CLEAN_EDGES = 4  # of a chain or component that is half clean

# Dropped chains leave loose ends behind, so chains are dropped in rounds. With two rounds a tenth more is
# kept on organic shapes; with eight as much as with four.
ROUNDS = 4

# Equal lengths must compare as equal, whatever the rounding.
SLACK = 1.0 - 1e-9

# Traits of a chain or component.
_A_STRONG = 1
_A_HARD = 2
_A_LOOSE_END = 4
_AN_ANCHOR = 8


class _Candidates(NamedTuple):
    """Candidate edges, and their ends numbered from 0."""

    end: IndexArray  # (k, 2)
    unit: FloatArray  # (k, 3) direction
    length: FloatArray  # (k, 2) in the units of X, and in target lengths
    rank: NDArray[np.int8]  # (k,)


class _Ends(NamedTuple):
    """Ends of candidates (numbers 2 k and 2 k + 1), in a list per vertex."""

    head: IndexArray  # (n,) first of the list
    size: IndexArray  # (n,) length of the list
    after: IndexArray  # (2 k,) next in the list
    partner: IndexArray  # (2 k,) the end of the next edge of the chain, or ``NONE``


class _Groups(NamedTuple):
    """Sets of candidates, and sums over them at the roots."""

    root: IndexArray  # smallest member of the set of an edge, or of a vertex
    sums: FloatArray  # (., 4) target lengths; length, length of sure edges, length of clean edges
    counts: IndexArray  # (., 2) sure edges, clean edges
    traits: NDArray[np.uint8]


def keep_chains(
    X: FloatArray,
    origin: IndexArray,
    edges: IntArray,
    rank: NDArray[np.int8],
    mean_edge: float,
) -> BoolArray:
    """Tell which candidate edges are creases.

    The boundary stays. At each vertex the other candidates are paired, straightest first; linked runs are
    chains. A chain stays if

    - it has a hard edge,
    - it is long and has a strong edge,
    - half of its length is sure and it has no loose end, or
    - half of its length is clean.

    A connected component of the chains that stay is kept if

    - it has a hard edge,
    - it is long in all,
    - it is a third as long, half sure, and begins on the boundary,
    - it is half sure and has no loose end, or
    - it is half clean.

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
        Mean length of all edges of the mesh.

    Returns
    -------
    (k,) bool
    """
    kept = np.zeros(len(edges), np.bool_)
    _keep(X, origin, edges, rank, mean_edge, _no_numbers(X), kept)
    return kept


def count_chains(X: FloatArray, origin: IndexArray, twin: IndexArray, edges: IntArray) -> int:
    """Count the chains that feature edges form, without those that lie on the boundary alone."""
    rank = np.full(len(edges), HARD, np.int8)
    return int(_count(X, origin, edges, rank, twin[edges] != NONE, _no_numbers(X)))


def _no_numbers(X: FloatArray) -> IndexArray:
    """Allocate numbers for the vertices at candidates, none given yet."""
    return np.full(len(X), NONE, np.int32)


@kernel
def _keep(X, origin, edges, rank, mean_edge, number, kept):
    """Drop chains round by round, then components; mark the candidates that are left."""
    k = edges.size
    candidates = _Candidates(np.empty((k, 2), np.int32), np.empty((k, 3)), np.empty((k, 2)), rank)
    n = _describe(X, origin, edges, mean_edge, number, candidates)
    is_anchor = np.zeros(n, np.bool_)
    alive = np.empty(k, np.int32)
    n_alive = _keep_boundary(candidates, kept, is_anchor, alive)
    lists, links = np.empty((2, n), np.int32), np.empty((2, 2 * k), np.int32)
    ends = _Ends(lists[0], lists[1], links[0], links[1])
    size = max(k, n)
    sums, counts = np.empty((size, 4)), np.empty((size, 2), np.int32)
    groups = _Groups(np.empty(size, np.int32), sums, counts, np.empty(size, np.uint8))
    for _ in range(ROUNDS):
        before = n_alive
        _list_ends(candidates, alive, n_alive, ends)
        _link_chains(candidates.unit, ends, groups.root)
        _add_up(candidates, alive, n_alive, False, ends.size, is_anchor, groups)
        n_alive = 0
        for i in range(before):
            if _chain_stays(groups, groups.root[alive[i]]):
                alive[n_alive] = alive[i]
                n_alive += 1
        if n_alive == before:
            break
    _list_ends(candidates, alive, n_alive, ends)
    _connect(candidates.end, alive, n_alive, groups.root)
    _add_up(candidates, alive, n_alive, True, ends.size, is_anchor, groups)
    for i in range(n_alive):
        e = alive[i]
        kept[e] = _component_stays(groups, groups.root[candidates.end[e, 0]])


@kernel
def _count(X, origin, edges, rank, is_marked, number):
    """Count the chains that have a marked edge."""
    k = edges.size
    candidates = _Candidates(np.empty((k, 2), np.int32), np.empty((k, 3)), np.empty((k, 2)), rank)
    n = _describe(X, origin, edges, 1.0, number, candidates)
    lists, links = np.empty((2, n), np.int32), np.empty((2, 2 * k), np.int32)
    ends = _Ends(lists[0], lists[1], links[0], links[1])
    _list_ends(candidates, np.arange(k), k, ends)
    root = np.empty(k, np.int32)
    _link_chains(candidates.unit, ends, root)
    is_counted = np.zeros(k, np.bool_)
    count = 0
    for e in range(k):
        if is_marked[e] and not is_counted[root[e]]:
            is_counted[root[e]] = True
            count += 1
    return count


@inlined
def _describe(X, origin, edges, mean_edge, number, candidates):
    """Measure all candidates and number their ends; returns how many vertices there are."""
    end, unit, length, _ = candidates
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
def _keep_boundary(candidates, kept, is_anchor, alive):
    """Keep edges on the boundary and mark their ends; list the others, and return how many they are.

    The boundary lends an end to chains, but neither length nor certainty: else every turn beside a noisy
    boundary would stay.
    """
    n_alive = 0
    for k in range(candidates.rank.size):
        if candidates.rank[k] == BORDER:
            kept[k] = True
            is_anchor[candidates.end[k, 0]] = True
            is_anchor[candidates.end[k, 1]] = True
        else:
            alive[n_alive] = k
            n_alive += 1
    return n_alive


@inlined
def _list_ends(candidates, alive, n_alive, ends):
    """List the ends that meet at each vertex; none has a partner yet."""
    ends.head[:] = NONE
    ends.size[:] = 0
    for i in range(n_alive):
        for side in range(2):
            e = 2 * alive[i] + side
            v = candidates.end[alive[i], side]
            ends.after[e] = ends.head[v]
            ends.head[v] = e
            ends.size[v] += 1
            ends.partner[e] = NONE


@inlined
def _link_chains(unit, ends, root):
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
            _join(root, i // 2, j // 2)
    for k in range(root.size):
        root[k] = root[root[k]]


@inlined
def _connect(end, alive, n_alive, root):
    """Join the vertices of edges to connected components."""
    for v in range(root.size):
        root[v] = v
    for i in range(n_alive):
        _join(root, end[alive[i], 0], end[alive[i], 1])
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
                p, q = i // 2, j // 2
                cosine = unit[p, 0] * unit[q, 0] + unit[p, 1] * unit[q, 1] + unit[p, 2] * unit[q, 2]
                if i % 2 == j % 2:  # both leave or both arrive
                    cosine = -cosine
                # A pair that is straighter by rounding alone does not count: the first of equals stays.
                if cosine > best + 1e-12:
                    best, best_i, best_j = cosine, i, j
            j = after[j]
        i = after[i]
    return best_i, best_j


@inlined
def _find(root, p):
    """Return the smallest member of a set; halves the path on the way."""
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
def _add_up(candidates, alive, n_alive, by_vertex, size, is_anchor, groups):
    """Add up lengths and traits of the edges of each group, whose roots are edges, or vertices."""
    end, _, length, rank = candidates
    root, sums, counts, traits = groups
    for i in range(n_alive):
        k = alive[i]
        g = root[end[k, 0]] if by_vertex else root[k]
        for j in range(4):
            sums[g, j] = 0.0
        counts[g, 0] = counts[g, 1] = 0
        traits[g] = 0
    for i in range(n_alive):
        k = alive[i]
        g = root[end[k, 0]] if by_vertex else root[k]
        sums[g, 0] += length[k, 1]
        sums[g, 1] += length[k, 0]
        if rank[k] >= SURE:
            sums[g, 2] += length[k, 0]
            counts[g, 0] += 1
        if rank[k] >= CLEAN:
            sums[g, 3] += length[k, 0]
            counts[g, 1] += 1
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
    _, sums, counts, traits = groups
    half = 0.5 * SLACK * sums[g, 1]
    is_long = sums[g, 0] >= CHAIN_LENGTH * SLACK
    return (
        (is_long and traits[g] & _A_STRONG != 0)
        or (counts[g, 0] > 0 and sums[g, 2] >= half and traits[g] & _A_LOOSE_END == 0)
        or (counts[g, 1] >= CLEAN_EDGES and sums[g, 3] >= half)
        or traits[g] & _A_HARD != 0
    )


@inlined
def _component_stays(groups, g):
    _, sums, counts, traits = groups
    half = 0.5 * SLACK * sums[g, 1]
    is_sure = counts[g, 0] > 0 and sums[g, 2] >= half
    is_long = sums[g, 0] >= CHAIN_LENGTH * SLACK
    return (
        sums[g, 0] >= COMPONENT_LENGTH * SLACK
        or (is_sure and is_long and traits[g] & _AN_ANCHOR != 0)
        or (is_sure and counts[g, 0] >= CLOSED_EDGES and traits[g] & _A_LOOSE_END == 0)
        or (counts[g, 1] >= CLEAN_EDGES and sums[g, 3] >= half)
        or traits[g] & _A_HARD != 0
    )
