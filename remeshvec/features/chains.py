"""Link candidate edges to chains, and keep the chains that are long or sure enough to be creases."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, kernel
from ..core.vocabulary import BoolArray, FloatArray, IndexArray
from .candidates import BORDER, CLEAN, HARD, STRONG, SURE
from .links import Ends, Segments, connect, link_chains, list_ends

__all__ = ["count_chains", "keep_chains"]

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


class _Groups(NamedTuple):
    """Sets of candidates, and sums over them at the roots."""

    root: IndexArray  # smallest member of the set of an edge, or of a vertex
    sums: FloatArray  # (., 4) target lengths; length, length of sure edges, length of clean edges
    counts: IndexArray  # (., 2) sure edges, clean edges
    traits: NDArray[np.uint8]


def keep_chains(segments: Segments, rank: NDArray[np.int8]) -> BoolArray:
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
    segments : Segments
        The candidates.
    rank : (k,) int8
        ``WEAK``, ``STRONG``, ``SURE``, ``CLEAN``, ``HARD`` or ``BORDER``; those of 0 and less are none.

    Returns
    -------
    (k,) bool
    """
    kept = np.zeros(len(rank), np.bool_)
    _keep(segments, rank, kept)
    return kept


def count_chains(segments: Segments, is_counted: BoolArray) -> int:
    """Count the chains that feature edges form and that have an edge to be counted."""
    return int(_count(segments, is_counted))


@kernel
def _keep(segments, rank, kept):
    """Drop chains round by round, then components; mark the candidates that are left."""
    k, n = rank.size, segments.n
    is_anchor = np.zeros(n, np.bool_)
    alive = np.empty(k, np.int32)
    n_alive = _keep_boundary(segments.end, rank, kept, is_anchor, alive)
    lists, links = np.empty((2, n), np.int32), np.empty((2, 2 * k), np.int32)
    ends = Ends(lists[0], lists[1], links[0], links[1])
    size = max(k, n)
    sums, counts = np.empty((size, 4)), np.empty((size, 2), np.int32)
    groups = _Groups(np.empty(size, np.int32), sums, counts, np.empty(size, np.uint8))
    for _ in range(ROUNDS):
        before = n_alive
        list_ends(segments.end, alive, n_alive, ends)
        link_chains(segments.unit, ends, groups.root)
        _add_up(segments, rank, alive, n_alive, False, ends.size, is_anchor, groups)
        n_alive = 0
        for i in range(before):
            if _chain_stays(groups, groups.root[alive[i]]):
                alive[n_alive] = alive[i]
                n_alive += 1
        if n_alive == before:
            break
    list_ends(segments.end, alive, n_alive, ends)
    connect(segments.end, alive, n_alive, groups.root)
    _add_up(segments, rank, alive, n_alive, True, ends.size, is_anchor, groups)
    for i in range(n_alive):
        e = alive[i]
        kept[e] = _component_stays(groups, groups.root[segments.end[e, 0]])


@kernel
def _count(segments, is_counted):
    """Count the chains that have a marked edge."""
    k, n = is_counted.size, segments.n
    lists, links = np.empty((2, n), np.int32), np.empty((2, 2 * k), np.int32)
    ends = Ends(lists[0], lists[1], links[0], links[1])
    list_ends(segments.end, np.arange(k), k, ends)
    root = np.empty(k, np.int32)
    link_chains(segments.unit, ends, root)
    is_done = np.zeros(k, np.bool_)
    count = 0
    for e in range(k):
        if is_counted[e] and not is_done[root[e]]:
            is_done[root[e]] = True
            count += 1
    return count


@inlined
def _keep_boundary(end, rank, kept, is_anchor, alive):
    """Keep edges on the boundary and mark their ends; list the others, and return how many they are.

    The boundary lends an end to chains, but neither length nor certainty: else every turn beside a noisy
    boundary would stay.
    """
    n_alive = 0
    for k in range(rank.size):
        if rank[k] == BORDER:
            kept[k] = True
            is_anchor[end[k, 0]] = True
            is_anchor[end[k, 1]] = True
        elif rank[k] > 0:
            alive[n_alive] = k
            n_alive += 1
    return n_alive


@inlined
def _add_up(segments, rank, alive, n_alive, by_vertex, size, is_anchor, groups):
    """Add up lengths and traits of the edges of each group, whose roots are edges, or vertices."""
    end, _, length, _ = segments
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
        or (is_sure and is_long and counts[g, 0] >= CLOSED_EDGES and traits[g] & _A_LOOSE_END == 0)
        or (is_long and counts[g, 1] >= CLEAN_EDGES and sums[g, 3] >= half)
        or traits[g] & _A_HARD != 0
    )
