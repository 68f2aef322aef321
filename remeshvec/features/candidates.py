"""Edges that turn far enough to be creases: how far, how clean, and how sure that makes them."""

from __future__ import annotations

from math import acos, degrees
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, threaded
from ..core.vocabulary import BoolArray, FloatArray, IndexArray, IntArray
from .dihedral import ANGLE_TOLERANCE, face_cosine

__all__ = [
    "BORDER",
    "CLEAN",
    "CROWDED",
    "CURVED",
    "ECHO",
    "HARD",
    "NOISE",
    "PIECE",
    "SHORT",
    "STRONG",
    "SURE",
    "TERRACE",
    "WEAK",
    "WEAK_TURN",
    "Candidates",
    "Ground",
    "measure_candidates",
    "per_piece",
]

# Classes of candidate edges; each class has the properties of the smaller ones too.
WEAK = 1
STRONG = 2
SURE = 3
CLEAN = 4
HARD = 5  # kept, and its chain with it
BORDER = 6  # on the boundary: kept, but does not keep its chain

# Instead of a class, why an edge is no crease.
NOISE = 0  # it does not stand out of the noise around it
ECHO = -1  # its turn comes twice
CURVED = -5  # its turn comes again and again
TERRACE = -2  # it is the edge of a step of a terraced surface
SHORT = -3  # its chain is too short or unsure
CROWDED = -4  # a surer crease runs along it, or meets it at an acute angle

# Degrees that an edge must turn to be a candidate, and to be more than a weak one. What turns by
# more than the last is no tessellation: it is sure with less, and may have echoes (plates, blades).
WEAK_TURN = 25.0
STRONG_TURN = 30.0
STEEP_TURN = 70.0

# The turn over the noise at its ends. Beside a clean edge faces are flat to a fraction of a degree.
WEAK_RATIO = 4.0
STRONG_RATIO = 6.0
SURE_RATIO = 8.0
STEEP_RATIO = 5.0
CLEAN_RATIO = 100.0

# Candidates in a piece of a loop.
PIECE = 1024


class Ground(NamedTuple):
    """The surface as walks over it see it."""

    X: FloatArray  # (n, 4)
    origin: IndexArray  # (3 m,)
    twin: IndexArray  # (3 m,)
    normals: FloatArray  # (m, 3)
    is_hard: BoolArray  # (3 m,) edges that no walk crosses


class Candidates(NamedTuple):
    """Edges that turn far enough."""

    edges: IntArray  # (k,) one half-edge of each
    turn: FloatArray  # (k,) degrees
    ratio: FloatArray  # (k,) turn over the noise
    rank: NDArray[np.int8]  # (k,) class, or the reason why it has none


def measure_candidates(
    ground: Ground, edges: IntArray, noise: FloatArray, parallel: bool
) -> Candidates:
    """Measure edges and class them by their turn and the noise (n,) at their ends."""
    k = len(edges)
    candidates = Candidates(edges, np.empty(k), np.empty(k), np.empty(k, np.int8))
    _measure(parallel, edges, ground, noise, candidates)
    return candidates


def per_piece(edges: NDArray[Any], *_: Any) -> int:
    """Return the number of pieces of a loop over candidates, which come first."""
    return -(-len(edges) // PIECE)


@threaded(per_piece)
def _measure(span, edges, ground, noise, candidates):
    """Fill the record; a turn may miss a threshold by the tolerance."""
    for k in range(PIECE * span[0], min(PIECE * span[1], len(edges))):
        h = edges[k]
        t = np.int64(ground.twin[h])
        noise_here = max(noise[ground.origin[h]], noise[ground.origin[t]])
        cosine = face_cosine(ground.normals, h // 3, t // 3)
        turn = degrees(acos(min(1.0, max(-1.0, cosine)))) + ANGLE_TOLERANCE
        candidates.turn[k] = turn
        candidates.ratio[k] = turn / max(noise_here, 1e-9)
        candidates.rank[k] = _class(turn, noise_here)


@inlined
def _class(turn, noise):
    if turn >= CLEAN_RATIO * noise:
        return CLEAN
    if turn >= STEEP_TURN and turn >= STEEP_RATIO * noise:
        return SURE
    if turn >= STRONG_TURN and turn >= SURE_RATIO * noise:
        return SURE
    if turn >= STRONG_TURN and turn >= STRONG_RATIO * noise:
        return STRONG
    return WEAK if turn >= WEAK_RATIO * noise else NOISE
