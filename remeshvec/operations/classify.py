"""Classify all edges once per sweep: too long, too short, or neither.

Splits and collapses read the answer from one byte per face. The last round of splits, in which no edge
is too long any more, has classified the mesh that the collapses start from.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, threaded
from ..core.geometry import area_vector, distance_squared
from ..core.vocabulary import DEAD, Blocks, Mesh
from ..mesh.blocks import per_block
from ..mesh.edge_curves import is_locked
from ..mesh.walk import corners_of

__all__ = ["REMOVED", "EdgeFlags", "classify_edges", "edge_flags", "is_short"]

REMOVED = 255  # flags of a removed face

# Twice the logarithmic mean of s and t is s + t less so many times (sqrt(s) - sqrt(t))^2, to 1 % where
# they differ by a factor of 10. So many edges fit where lengths grow evenly from one end to the other.
_TO_LOGARITHMIC = 2.0 / 3.0


class EdgeFlags(NamedTuple):
    """Which edges are too long or too short.

    Parameters
    ----------
    mask : (m,) uint8
        Bit i: the face wants the edge from corner i split; bit 3 + i: that edge is short; ``REMOVED``
        for a removed face.
    n_long : int
        Edges to split; an edge counts twice where both faces want it split.
    n_gone : int
        Removed faces.
    longest, shortest : float
        Limits, as factors of the target length.
    """

    mask: NDArray[np.uint8]
    n_long: int
    n_gone: int
    longest: float
    shortest: float


def classify_edges(
    mesh: Mesh, blocks: Blocks, longest: float, shortest: float, parallel: bool
) -> EdgeFlags:
    """Compare all edges with two limits, given as factors of the target lengths at their ends.

    An edge is too long above the logarithmic mean of both lengths, too short below the harmonic mean.
    Where lengths jump, the gap between the two means stops splits and collapses from alternating.
    """
    mask = np.empty(mesh.origin.size // 3, np.uint8)
    count = np.zeros((len(blocks.face) - 1, 2), np.int64)
    _classify(parallel, mesh, blocks, 0.5 * longest, 2.0 * shortest, mask, count)
    n_long, n_gone = count.sum(axis=0).tolist()
    return EdgeFlags(mask, n_long, n_gone, longest, shortest)


@threaded(per_block)
def _classify(span, mesh, blocks, half_longest, twice_shortest, mask, count):
    """Write the flags of every face; ``count`` gets long edges and removed faces per block."""
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
    a, b, c = corners_of(mesh.origin, f)
    l0 = distance_squared(X, a, b)
    l1 = distance_squared(X, b, c)
    l2 = distance_squared(X, c, a)
    s, t, u = X[a, 3], X[b, 3], X[c, 3]
    m0 = half_longest * (s + t)
    m1 = half_longest * (t + u)
    m2 = half_longest * (u + s)
    if s != t or t != u:
        p, q, r = sqrt(s), sqrt(t), sqrt(u)
        m0 -= half_longest * _TO_LOGARITHMIC * (p - q) * (p - q)
        m1 -= half_longest * _TO_LOGARITHMIC * (q - r) * (q - r)
        m2 -= half_longest * _TO_LOGARITHMIC * (r - p) * (r - p)
    short = 8 * _is_below(l0, s, t, twice_shortest)
    short |= 16 * _is_below(l1, t, u, twice_shortest)
    short |= 32 * _is_below(l2, u, s, twice_shortest)
    mask = (l0 > m0 * m0) + 2 * (l1 > m1 * m1) + 4 * (l2 > m2 * m2)
    if mask == 0:
        return short
    return short | _edges_to_split(mesh, f, mask, (l0, l1, l2), (m0 + m1 + m2) / 3.0)


@inlined
def is_short(length_squared, s, t, factor):
    """Tell whether an edge is shorter than a factor of the harmonic mean of both target lengths."""
    return _is_below(length_squared, s, t, 2.0 * factor)


@inlined
def _is_below(length_squared, s, t, twice_factor):
    """`is_short` without a division."""
    total = s + t
    product = twice_factor * (s * t)  # the same bits from both sides
    return length_squared * total * total < product * product


@inlined
def _edges_to_split(mesh, f, mask, lengths_squared, limit):
    """Select the long edges that a face wants split: no locked ones.

    A face lower than half the limit wants only its longest edge split. If all three were split at once,
    a needle of length l would fall into (l / L)^2 faces instead of 2 l / L.
    """
    for i in range(3):
        if is_locked(mesh.curve[3 * f + i]):
            mask &= ~(1 << i)
    if mask == 0 or mask == 1 or mask == 2 or mask == 4:
        return mask
    a, b, c = corners_of(mesh.origin, f)
    nx, ny, nz = area_vector(mesh.X, a, b, c)
    l0, l1, l2 = lengths_squared
    l0 *= mask & 1
    l1 *= (mask >> 1) & 1
    l2 *= (mask >> 2) & 1
    longest = max(l0, l1, l2)
    if nx * nx + ny * ny + nz * nz >= 0.25 * limit * limit * longest:
        return mask
    return 1 if l0 == longest else (2 if l1 == longest else 4)
