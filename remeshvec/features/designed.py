"""Chains as a designer draws them: their edges turn evenly, and none bends far from the last."""

from __future__ import annotations

from math import acos, degrees, log

import numpy as np

from ..core.compiler import kernel
from ..core.vocabulary import NONE, BoolArray, FloatArray
from .candidates import CLEAN, CLEAN_RATIO, CURVED, HARD, TERRACE, Candidates
from .links import Ends, Segments, bend_cosine, connect, link_chains, list_ends

__all__ = ["find_designed"]

# Degrees by which designed chains turn in the mean, and edges that a person would draw.
SHARP_TURN = 40.0

# What turns by more is a fold.
FOLD_TURN = 135.0

# Geometric mean of turn over noise, but at most that of a clean edge, in all that turn so far: on 60 parts
# 31 and more, on 40 scans and sculptures at most 25.
PART_RATIO = 28.0

# Where no larger share of them than this is clean and free of echoes, all facets are those of a tessellation.
FACETED_SHARE = 0.1

# Geometric mean of turn over noise in the networks of a part.
QUIET_RATIO = 8.0

# What stands out of the noise by less is noise.
LEAST_RATIO = 2.0


def find_designed(candidates: Candidates, segments: Segments) -> BoolArray:
    """Tell which candidates belong to a chain that was designed.

    Candidates of all classes are linked, also those that were dropped as noise or echoes, but for the
    edges of terraces. Along a designed chain the turn changes little from edge to edge: on parts by 1 %
    (median; 95 % of them below 11 %), on scans by 12 %.

    Parameters
    ----------
    candidates : Candidates
    segments : Segments
        Of the candidates.

    Returns
    -------
    (k,) bool
    """
    k = len(candidates.edges)
    linked = np.flatnonzero(candidates.rank != TERRACE)
    sums = np.zeros((k, 7))
    root = np.empty(k, np.int32)
    _sum_chains(segments, linked, candidates.turn, candidates.ratio, root, sums)
    return is_designed(sums)[root]


def is_part(candidates: Candidates, segments: Segments) -> bool:
    """Tell whether the surface is that of a part: what turns sharply stands out of the noise.

    Facets of a coarse torus do, too, but each is the echo of the next.
    """
    turn, ratio, rank, length = (*candidates[1:], segments.length[:, 0])
    is_sharp = (turn >= SHARP_TURN) & (rank != TERRACE)
    total = length[is_sharp].sum()
    quiet = length[is_sharp] @ np.log(np.minimum(ratio[is_sharp], CLEAN_RATIO))
    alone = length[is_sharp & (ratio >= CLEAN_RATIO) & (rank == CLEAN)].sum()
    return bool(quiet >= log(PART_RATIO) * total and alone > FACETED_SHARE * total)


def promote(
    candidates: Candidates, segments: Segments, designed: BoolArray, on_part: bool
) -> None:
    """Raise the class of what a designer drew.

    Edges of designed chains become clean, and those of networks that are half clean. On a part sharp edges
    need no chain, but for folds, which are flaws where they are short.
    """
    turn, ratio, rank, length = (*candidates[1:], segments.length[:, 0])
    is_open = (ratio >= LEAST_RATIO) & (rank != TERRACE) & (rank != CURVED)
    rank[designed & is_open] = CLEAN
    drawn = np.flatnonzero((turn >= SHARP_TURN) & is_open)
    if not len(drawn):
        return
    root = np.empty(segments.n, np.int32)
    _connect(segments.end, drawn, root)
    network = root[segments.end[drawn, 0]]
    total = np.bincount(network, length[drawn], segments.n)[network]
    clean = np.bincount(network, length[drawn] * (rank[drawn] == CLEAN), segments.n)[network]
    rank[drawn[clean >= 0.5 * total]] = CLEAN
    if on_part:
        quiet = np.bincount(network, length[drawn] * np.log(ratio[drawn]), segments.n)[network]
        rank[drawn[quiet >= log(QUIET_RATIO) * total]] = CLEAN
        rank[(rank == CLEAN) & (turn >= SHARP_TURN) & (turn <= FOLD_TURN)] = HARD


@kernel
def _connect(end, asked, root):
    connect(end, asked, asked.size, root)


def is_designed(sums: FloatArray) -> BoolArray:
    n, length, turn, unevenness, bend, ratio, pairs = sums.T
    with np.errstate(invalid="ignore", divide="ignore"):
        d = unevenness / pairs
        b = np.sqrt(bend / pairs)
        c = np.exp(ratio / length)
        t = turn / n
    found = (n >= 5) & (d <= 0.06) & (b <= 25) & (c >= 8)
    found |= (n >= 20) & (d <= 0.13) & (b <= 16) & (c >= 8)
    found |= (n >= 4) & (d <= 0.15) & (b <= 16) & (c >= 20) & (length >= 4)
    found |= (d <= 0.04) & (b <= 25) & (c >= 12) & (length >= 3)
    return found & (t >= SHARP_TURN)


@kernel
def _sum_chains(segments, linked, turn, ratio, root, sums):
    k, n = turn.size, segments.n
    lists, links = np.empty((2, n), np.int32), np.empty((2, 2 * k), np.int32)
    ends = Ends(lists[0], lists[1], links[0], links[1])
    list_ends(segments.end, linked, linked.size, ends)
    link_chains(segments.unit, ends, root)
    for e in linked:
        row = sums[root[e]]
        length = segments.length[e, 1]
        row[0] += 1.0
        row[1] += length
        row[2] += turn[e]
        row[5] += length * log(min(ratio[e], 1e6))
        for side in range(2):
            i = 2 * e + side
            j = ends.partner[i]
            if j != NONE and i < j:
                a, b = turn[e], turn[j // 2]
                cosine = bend_cosine(segments.unit, i, j)
                row[3] += abs(a - b) / max(a, b)
                row[4] += degrees(acos(min(1.0, max(-1.0, cosine)))) ** 2
                row[6] += 1.0
