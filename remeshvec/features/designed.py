"""What was designed: chains that turn evenly, and surfaces on which all that turns sharply is clean."""

from __future__ import annotations

from math import acos, degrees, log
from typing import NamedTuple

import numpy as np

from ..core.compiler import kernel
from ..core.vocabulary import NONE, BoolArray, FloatArray
from .candidates import CLEAN, CLEAN_RATIO, CURVED, HARD, TERRACE, Candidates
from .links import Ends, Segments, bend_cosine, link_chains, list_ends, networks

__all__ = ["find_designed", "is_part", "promote"]

# Degrees by which designed chains turn in the mean, and edges that a person would draw.
SHARP_TURN = 40.0

# What turns by more is a fold.
FOLD_TURN = 135.0

# Geometric mean of turn over noise, but at most that of a clean edge, in all that turn so far: on 60
# parts 31 and more, on 40 scans and sculptures at most 25.
PART_RATIO = 28.0

# Where no larger share of them than this is clean and free of echoes, all facets are those of a
# tessellation.
FACETED_SHARE = 0.1

# Geometric mean of turn over noise in the networks of a part.
QUIET_RATIO = 8.0

# Larger ratios, of faces flat to the last digit, count as this.
LARGEST_RATIO = 1e6

# What stands out of the noise by less is noise.
LEAST_RATIO = 2.0


class Sums(NamedTuple):
    """Sums over the edges of each chain, at its root, and over pairs of consecutive edges."""

    edges: FloatArray  # (k,), as all are
    pairs: FloatArray
    length: FloatArray  # in target lengths
    turn: FloatArray
    unevenness: FloatArray  # of pairs: difference of their turns, over the larger one
    bend: FloatArray  # of pairs, squared degrees
    ratio: FloatArray  # logarithm of turn over noise, by length


# A chain is designed if this holds for any row: it has at least so many edges; an unevenness and a bend
# (root mean square, degrees) of at most, a ratio (geometric mean) and a length of at least so much.
DESIGNED = (
    (5, 0.06, 25.0, 8.0, 0.0),
    (20, 0.13, 16.0, 8.0, 0.0),
    (4, 0.15, 16.0, 20.0, 4.0),
    (2, 0.04, 25.0, 12.0, 3.0),
)


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
    sums = Sums(*np.zeros((7, k)))
    root = np.arange(k, dtype=np.int32)
    _sum_chains(segments, linked, candidates.turn, candidates.ratio, root, sums)
    return _is_designed(sums)[root]


def _is_designed(sums: Sums) -> BoolArray:
    """Compare the chains with the rows of the table; what is no root, or one edge, is none."""
    pairs, length = np.maximum(sums.pairs, 1.0), np.where(sums.length > 0.0, sums.length, 1.0)
    unevenness, bend = sums.unevenness / pairs, np.sqrt(sums.bend / pairs)
    ratio = np.exp(sums.ratio / length)
    found = np.zeros(len(pairs), np.bool_)
    for edges, most_uneven, most_bend, least_ratio, least_length in DESIGNED:
        found |= (
            (sums.edges >= edges)
            & (unevenness <= most_uneven)
            & (bend <= most_bend)
            & (ratio >= least_ratio)
            & (sums.length >= least_length)
        )
    return found & (sums.turn >= SHARP_TURN * sums.edges)


@kernel
def _sum_chains(segments, linked, turn, ratio, root, sums):
    """Link edges to chains and add up; ``root`` gets the edge at which the sums of each lie."""
    k, n = turn.size, segments.n
    lists, links = np.empty((2, n), np.int32), np.empty((2, 2 * k), np.int32)
    ends = Ends(lists[0], lists[1], links[0], links[1])
    list_ends(segments.end, linked, linked.size, ends)
    link_chains(segments.unit, ends, root)
    for e in linked:
        r = root[e]
        length = segments.length[e, 1]
        sums.edges[r] += 1.0
        sums.length[r] += length
        sums.turn[r] += turn[e]
        sums.ratio[r] += length * log(min(ratio[e], LARGEST_RATIO))
        for side in range(2):
            i = 2 * e + side
            j = ends.partner[i]
            if j != NONE and i < j:
                a, b = turn[e], turn[j // 2]
                cosine = bend_cosine(segments.unit, i, j)
                sums.pairs[r] += 1.0
                sums.unevenness[r] += abs(a - b) / max(a, b)
                sums.bend[r] += degrees(acos(min(1.0, max(-1.0, cosine)))) ** 2


def is_part(candidates: Candidates, segments: Segments) -> bool:
    """Tell whether the surface is that of a part: what turns sharply stands out of the noise.

    Facets of a coarse torus do, too, but each is the echo of the next.
    """
    turn, ratio, rank, length = (*candidates[1:], segments.length[:, 0])
    is_sharp = (turn >= SHARP_TURN) & (rank != TERRACE)
    total = length[is_sharp].sum()
    quiet = (length * np.log(np.minimum(ratio, CLEAN_RATIO)))[is_sharp].sum()
    alone = length[is_sharp & (ratio >= CLEAN_RATIO) & (rank == CLEAN)].sum()
    return bool(quiet >= log(PART_RATIO) * total and alone > FACETED_SHARE * total)


def promote(candidates: Candidates, segments: Segments, designed: BoolArray, on_part: bool) -> None:
    """Raise the class of what a designer drew.

    Edges of designed chains become clean, and those of networks that are half clean. On a part sharp
    edges need no chain, but for folds, which are flaws where they are short.
    """
    turn, ratio, rank, length = (*candidates[1:], segments.length[:, 0])
    is_open = (ratio >= LEAST_RATIO) & (rank != TERRACE) & (rank != CURVED)
    rank[designed & is_open] = CLEAN
    drawn = np.flatnonzero((turn >= SHARP_TURN) & is_open)
    if not len(drawn):
        return
    network = networks(segments, drawn)
    total = np.bincount(network, length[drawn])[network]
    clean = np.bincount(network, length[drawn] * (rank[drawn] == CLEAN))[network]
    rank[drawn[clean >= 0.5 * total]] = CLEAN
    if on_part:
        quiet = np.bincount(network, length[drawn] * np.log(ratio[drawn]))[network]
        rank[drawn[quiet >= log(QUIET_RATIO) * total]] = CLEAN
        rank[(rank == CLEAN) & (turn >= SHARP_TURN) & (turn <= FOLD_TURN)] = HARD
