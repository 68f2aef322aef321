"""Which candidate edges form creases: linked to chains, kept when long or sure enough."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import inlined, kernel
from ._types import NONE, FloatArray, IndexArray

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


class Candidates(NamedTuple):
    """Candidate edges, k of them with n ends in all."""

    end: IndexArray  # (k, 2) numbers of the vertices at both ends
    unit: FloatArray  # (k, 3) from the first end to the second
    length: FloatArray  # (k,)
    targets: FloatArray  # (k,) length in target lengths, or in mean edges where these are longer
    rank: NDArray[np.uint8]  # (k,) class


def keep_chains(
    X: FloatArray,
    origin: IndexArray,
    edges: NDArray[np.int64],
    rank: NDArray[np.uint8],
    mean_edge: float,
) -> NDArray[np.bool_]:
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
    rank : (k,) uint8
        ``WEAK``, ``STRONG``, ``SURE``, ``CLEAN``, ``HARD`` or ``BORDER``.
    mean_edge : float
        Of the whole mesh.

    Returns
    -------
    (k,) bool
    """
    every = _candidates(X, origin, edges, rank, mean_edge)
    kept = rank == BORDER
    # The boundary lends an end to the others, neither length nor certainty: else every turn beside a
    # noisy one would stay.
    is_anchor = np.zeros(every.end.max(initial=-1) + 1, np.bool_)
    is_anchor[every.end[kept]] = True
    alive = np.flatnonzero(~kept)
    for _ in range(ROUNDS):
        found = _selected(every, alive)
        keep = _lasting_chains(found, is_anchor)
        alive = alive[keep]
        if keep.all():
            break
    found = _selected(every, alive)
    kept[alive[_lasting_components(found, is_anchor)]] = True
    return kept


def count_chains(
    X: FloatArray, origin: IndexArray, twin: IndexArray, edges: NDArray[np.int64]
) -> int:
    """Count the chains among feature edges, those that lie on the boundary alone left out."""
    found = _candidates(X, origin, edges, np.full(len(edges), HARD, np.uint8), 1.0)
    return len(np.unique(_chains(found)[twin[edges] != NONE]))


def _candidates(
    X: FloatArray,
    origin: IndexArray,
    edges: NDArray[np.int64],
    rank: NDArray[np.uint8],
    mean_edge: float,
) -> Candidates:
    following = np.where(edges % 3 == 2, edges - 2, edges + 1)
    ends = np.stack([origin[edges], origin[following]], axis=1)
    vector = X[ends[:, 1], :3] - X[ends[:, 0], :3]
    length = np.sqrt((vector * vector).sum(axis=1))
    target = 0.5 * (X[ends[:, 0], 3] + X[ends[:, 1], 3])
    unit = vector / np.where(length > 0.0, length, 1.0)[:, None]
    number = np.unique(ends, return_inverse=True)[1].reshape(ends.shape).astype(np.int32)
    return Candidates(number, unit, length, length / np.maximum(target, mean_edge), rank)


def _selected(every: Candidates, alive: NDArray[np.intp]) -> Candidates:
    return Candidates(
        every.end[alive],
        every.unit[alive],
        every.length[alive],
        every.targets[alive],
        every.rank[alive],
    )


def _lasting_chains(found: Candidates, is_anchor: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell for each edge whether its chain stays."""
    chain = _chains(found)
    is_long = np.bincount(chain, found.targets) >= CHAIN_LENGTH * SLACK
    keep = is_long & _has(found, chain, STRONG)
    keep |= _is_mostly(found, chain, SURE) & _has_no_loose_end(found, chain, is_anchor)
    keep |= _is_mostly(found, chain, CLEAN, CLEAN_EDGES)
    keep |= _has(found, chain, HARD)
    return keep[chain]


def _lasting_components(found: Candidates, is_anchor: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell for each edge whether its component stays."""
    first, second = np.ascontiguousarray(found.end.T)
    root = np.arange(found.end.max(initial=0) + 1, dtype=np.int32)
    _join(root, first, second)
    component = root[first]
    keep = np.bincount(component, found.targets) >= COMPONENT_LENGTH * SLACK
    from_border = np.bincount(component, is_anchor[found.end].any(axis=1)) > 0.0
    is_long = np.bincount(component, found.targets) >= CHAIN_LENGTH * SLACK
    keep |= from_border & is_long & _is_mostly(found, component, SURE)
    is_tied = _has_no_loose_end(found, component, is_anchor)
    keep |= _is_mostly(found, component, SURE, CLOSED_EDGES) & is_tied
    keep |= _is_mostly(found, component, CLEAN, CLEAN_EDGES)
    keep |= _has(found, component, HARD)
    return keep[component]


def _has(found: Candidates, group: IndexArray, rank: int) -> NDArray[np.bool_]:
    """Tell for each group whether one of its edges is of this class."""
    return np.bincount(group, found.rank >= rank) > 0.0


def _is_mostly(
    found: Candidates, group: IndexArray, rank: int, edges: int = 1
) -> NDArray[np.bool_]:
    """Tell for each group whether half of its length, and so many edges, are of this class."""
    is_such = found.rank >= rank
    enough = np.bincount(group, is_such) >= edges
    half = 0.5 * SLACK * np.bincount(group, found.length)
    return enough & (np.bincount(group, found.length * is_such) >= half)


def _has_no_loose_end(
    found: Candidates, group: IndexArray, is_anchor: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Tell for each group whether all its edges end at other candidates or on the boundary."""
    is_loose = (np.bincount(found.end.ravel(), minlength=len(is_anchor)) == 1) & ~is_anchor
    return np.bincount(group, is_loose[found.end].any(axis=1)) == 0.0


def _chains(found: Candidates) -> IndexArray:
    """Pair and link; returns for each edge the number of the first edge of its chain."""
    partner = np.full(2 * len(found.end), NONE, np.int32)
    _pair(found.end, found.unit, partner)
    linked = np.flatnonzero(partner != NONE).astype(np.int32)
    root = np.arange(len(found.end), dtype=np.int32)
    _join(root, linked // 2, partner[linked] // 2)
    return root


@kernel
def _pair(end, unit, partner):
    """Pair the ends of edges (number 2 k or 2 k + 1) that meet at a vertex, straightest first."""
    n = 0
    for k in range(len(end)):
        n = max(n, end[k, 0] + 1, end[k, 1] + 1)
    head = np.full(n, NONE, np.int32)
    size = np.zeros(n, np.int32)
    after = np.empty(2 * len(end), np.int32)
    for i in range(2 * len(end)):
        v = end[i // 2, i % 2]
        after[i] = head[v]
        head[v] = i
        size[v] += 1
    for v in range(n):
        if size[v] > MAX_ENDS:
            continue
        while True:
            i, j = _straightest(unit, after, partner, head[v])
            if j == NONE:
                break
            partner[i] = j
            partner[j] = i


@inlined
def _straightest(unit, after, partner, first):
    """Find the two free ends of a list that bend least, -1 where none bend by 45 degrees at most."""
    best = BEND - 1e-8
    best_i = NONE
    best_j = NONE
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


@kernel
def _join(root, a, b):
    """Join numbers a[i] and b[i]; leaves in ``root`` the smallest number of each set."""
    for i in range(len(a)):
        p, q = a[i], b[i]
        while root[p] != p:
            p = root[p]
        while root[q] != q:
            q = root[q]
        root[max(p, q)] = min(p, q)
        # Halving the paths afterwards keeps the trees flat.
        r = min(p, q)
        p, q = a[i], b[i]
        while root[p] > r:
            root[p], p = r, root[p]
        while root[q] > r:
            root[q], q = r, root[q]
    for i in range(len(root)):
        root[i] = root[root[i]]
