"""Measure all edges once a sweep: which are too long, which too short.

Splits and collapses read the answer from one byte a face. The round in which no edge is too long any
more has measured the mesh that the collapses start from.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, threaded
from ..core.geometry import area_vector, distance_squared
from ..core.vocabulary import DEAD, FROZEN, Blocks, Mesh
from ..mesh.blocks import per_block

__all__ = ["REMOVED", "EdgeFlags", "classify_edges", "edge_flags", "is_short"]

REMOVED = 255  # flags of a removed face


class EdgeFlags(NamedTuple):
    """Which edges are too long or too short.

    Parameters
    ----------
    mask : (m,) uint8
        Bit i: the face wants the edge from corner i split; bit 3 + i: that edge is short; ``REMOVED``.
    n_long : int
        Edges to split, twice where both faces want that.
    n_gone : int
        Removed faces.
    longest, shortest : float
        Factors of the target length that were compared with.
    """

    mask: NDArray[np.uint8]
    n_long: int
    n_gone: int
    longest: float
    shortest: float


def classify_edges(
    mesh: Mesh, blocks: Blocks, longest: float, shortest: float, parallel: bool
) -> EdgeFlags:
    """Compare all edges with two factors of the target lengths at their ends.

    An edge is too long above the arithmetic mean, too short below the harmonic one: where lengths jump,
    beside an edge that must not be split, there is room between the two.
    """
    mask = np.empty(mesh.origin.size // 3, np.uint8)
    count = np.zeros((len(blocks.face) - 1, 2), np.int64)
    _classify(parallel, mesh, blocks, 0.5 * longest, 2.0 * shortest, mask, count)
    n_long, n_gone = count.sum(axis=0).tolist()
    return EdgeFlags(mask, n_long, n_gone, longest, shortest)


@threaded(per_block)
def _classify(span, mesh, blocks, half_longest, twice_shortest, mask, count):
    for k in range(span[0], span[1]):
        n_long = 0
        n_gone = 0
        for f in range(blocks.face[k], blocks.face[k + 1]):
            if mesh.origin[3 * f] == DEAD:
                mask[f] = REMOVED
                n_gone += 1
                continue
            flags = edge_flags(mesh, f, half_longest, twice_shortest)
            mask[f] = flags
            if flags & 7:
                n_long += (flags & 1) + ((flags >> 1) & 1) + ((flags >> 2) & 1)
        count[k, 0] = n_long
        count[k, 1] = n_gone


@inlined
def edge_flags(mesh, f, half_longest, twice_shortest):
    """Compute the flags of one face, see `EdgeFlags`."""
    X = mesh.X
    a, b, c = mesh.origin[3 * f], mesh.origin[3 * f + 1], mesh.origin[3 * f + 2]
    l0 = distance_squared(X, a, b)
    l1 = distance_squared(X, b, c)
    l2 = distance_squared(X, c, a)
    s, t, u = X[a, 3], X[b, 3], X[c, 3]
    m0 = half_longest * (s + t)
    m1 = half_longest * (t + u)
    m2 = half_longest * (u + s)
    short = 8 * _is_below(l0, s, t, twice_shortest)
    short |= 16 * _is_below(l1, t, u, twice_shortest)
    short |= 32 * _is_below(l2, u, s, twice_shortest)
    mask = (l0 > m0 * m0) + 2 * (l1 > m1 * m1) + 4 * (l2 > m2 * m2)
    if mask == 0:
        return short
    return short | _to_split(mesh, f, mask, l0, l1, l2, (m0 + m1 + m2) / 3.0)


@inlined
def is_short(length_squared, s, t, factor):
    """Tell whether an edge is shorter than a factor of the harmonic mean of its ends' lengths."""
    return _is_below(length_squared, s, t, 2.0 * factor)


@inlined
def _is_below(length_squared, s, t, twice_factor):
    total = s + t
    product = twice_factor * (s * t)  # the same bits from both sides
    return length_squared * total * total < product * product


@inlined
def _to_split(mesh, f, mask, l0, l1, l2, limit):
    """Of the long edges those that a face wants split: not the frozen ones.

    A face lower than half the limit wants only its longest edge split: all three at once, a needle of
    length l would fall into (l / L)^2 faces instead of 2 l / L.
    """
    for i in range(3):
        if mesh.curve[3 * f + i] <= FROZEN:
            mask &= ~(1 << i)
    if mask == 0 or mask == 1 or mask == 2 or mask == 4:
        return mask
    X = mesh.X
    a, b, c = mesh.origin[3 * f], mesh.origin[3 * f + 1], mesh.origin[3 * f + 2]
    nx, ny, nz = area_vector(X, a, b, c)
    l0 *= mask & 1
    l1 *= (mask >> 1) & 1
    l2 *= (mask >> 2) & 1
    longest = max(l0, l1, l2)
    if nx * nx + ny * ny + nz * nz >= 0.25 * limit * limit * longest:
        return mask
    return 1 if l0 == longest else (2 if l1 == longest else 4)
