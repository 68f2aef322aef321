"""Chains as a designer draws them: their edges turn evenly, and none bends far from the last."""

from __future__ import annotations

from math import acos, degrees, log

import numpy as np

from ..core.compiler import kernel
from ..core.vocabulary import NONE, BoolArray, FloatArray
from .candidates import CLEAN, CLEAN_RATIO, ECHO, HARD, TERRACE, Candidates
from .links import Ends, Segments, bend_cosine, connect, link_chains, list_ends

__all__ = ["find_designed"]

# Mean turn of a designed chain, in degrees.
LEAST_TURN = 40.0

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


def promote(candidates: Candidates, segments: Segments) -> None:
    """Raise the class of what a designer drew."""
    turn, ratio, rank = candidates.turn, candidates.ratio, candidates.rank
    length = segments.length[:, 0]
    is_echo = (rank == ECHO) & (ratio >= CLEAN_RATIO)
    is_open = (ratio >= LEAST_RATIO) & (rank != TERRACE) & ~is_echo
    rank[find_designed(candidates, segments) & is_open] = CLEAN
    is_drawn = (turn >= LEAST_TURN) & is_open
    drawn = np.flatnonzero(is_drawn)
    if not len(drawn):
        return
    root = np.empty(segments.n, np.int32)
    _connect(segments.end, drawn, root)
    part = root[segments.end[drawn, 0]]
    total = np.bincount(part, length[drawn], segments.n)
    clean = np.bincount(part, length[drawn] * (rank[drawn] == CLEAN), segments.n)
    rank[drawn[clean[part] >= 0.5 * total[part]]] = CLEAN
    is_sharp = (turn >= LEAST_TURN) & (rank != TERRACE)
    if length[is_sharp & (ratio >= CLEAN_RATIO)].sum() >= 0.5 * length[is_sharp].sum():
        rank[(rank == CLEAN) & is_sharp] = HARD
        q = np.bincount(part, length[drawn] * np.log(ratio[drawn]), segments.n)
        rank[drawn[q[part] >= np.log(8) * total[part]]] = HARD


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
    return found & (t >= LEAST_TURN)


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
