"""Dihedral angles: unit normals of all faces, and the edges across which they turn far."""

from __future__ import annotations

from math import cos, radians, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, kernel, threaded
from ..core.geometry import area_vector, distance_squared
from ..core.vocabulary import NONE, FloatArray, IndexArray, IntArray
from ..mesh.walk import next_halfedge

__all__ = [
    "ANGLE_TOLERANCE",
    "MISSING",
    "PROPER",
    "DihedralAngles",
    "face_cosine",
    "find_dihedral_angles",
    "least_cosine",
]

# Degrees by which a turn may miss a threshold.
ANGLE_TOLERANCE = 1e-6

# A face lower than this share of its longest edge and of the target length has no normal of its own:
# coordinates in single precision turn it by 0.1 degrees and more.
SLIVER = 1e-3

# Rounds in which slivers borrow normals.
SLIVER_ROUNDS = 8

# States of faces.
PROPER = 0  # has a normal of its own
LENT = 1  # a sliver with the normal of a face beside it
MISSING = 2  # a sliver without normal

# Faces per piece of a threaded loop.
_FACES_PER_RANGE = 4096


class DihedralAngles(NamedTuple):
    """Normals, and the edges across which they turn.

    Parameters
    ----------
    normals : (m, 3) float64
        Unit normals of the faces, 0 where they are missing.
    state : (m,) uint8
        ``PROPER``, ``LENT`` or ``MISSING``.
    slivers : bool
        Whether any face is not ``PROPER``.
    edges : (k,) int64
        Inner edges that turn far enough, without those beside a missing normal. Each is named by the
        larger of its half-edges; in ascending order.
    """

    normals: FloatArray
    state: NDArray[np.uint8]
    slivers: bool
    edges: IntArray


def find_dihedral_angles(
    X: FloatArray, origin: IndexArray, twin: IndexArray, degrees: float, parallel: bool
) -> DihedralAngles:
    """Find the edges that turn by at least ``degrees``.

    Parameters
    ----------
    X : (n, 4) float64
        The last column is the target length.
    origin, twin : (3 m,) int32
    degrees : float
    parallel : bool
    """
    n_faces = origin.size // 3
    pieces = per_piece(X, origin)
    normals = np.empty((n_faces, 3))
    state = np.zeros(n_faces, np.uint8)
    count = np.empty(pieces, np.int64)
    _fill_normals(parallel, X, origin, normals, state, count)
    slivers = bool(count.any())
    if slivers:
        _lend_normals(X, origin, twin, normals, state)
    limit = least_cosine(degrees)
    found = np.empty(origin.size, np.int32)
    _list_turns(parallel, twin, normals, limit, found, count)
    size = 3 * _FACES_PER_RANGE
    edges = np.concatenate([found[size * k : size * k + n] for k, n in enumerate(count.tolist())])
    if slivers:
        edges = edges[(state[edges // 3] != MISSING) & (state[twin[edges] // 3] != MISSING)]
    return DihedralAngles(normals, state, slivers, edges.astype(np.int64))


def least_cosine(degrees: float) -> float:
    """Return the cosine to compare with: normals turn by ``degrees`` or more where theirs is below."""
    return cos(radians(min(degrees, 180.0))) - 1e-14  # rounding of angles near 0


def per_piece(first: Any, halfedges: NDArray[Any], *_: Any) -> int:
    """Return the number of pieces of a loop over faces, whose half-edges come second."""
    return -(-halfedges.size // (3 * _FACES_PER_RANGE))


def per_piece_of_twins(twin: NDArray[Any], *_: Any) -> int:
    """Return the number of pieces of a loop over faces, whose half-edges come first."""
    return -(-twin.size // (3 * _FACES_PER_RANGE))


@inlined
def face_cosine(normals, f, g):
    """Cosine of the angle between two faces."""
    return (
        normals[f, 0] * normals[g, 0]
        + normals[f, 1] * normals[g, 1]
        + normals[f, 2] * normals[g, 2]
    )


@threaded(per_piece)
def _fill_normals(span, X, origin, normals, state, slivers):
    n_faces = state.size
    for k in range(span[0], span[1]):
        count = 0
        for f in range(_FACES_PER_RANGE * k, min(_FACES_PER_RANGE * k + _FACES_PER_RANGE, n_faces)):
            a, b, c = origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]
            x, y, z = area_vector(X, a, b, c)
            double_area = sqrt(x * x + y * y + z * z)
            longest = max(
                distance_squared(X, a, b), distance_squared(X, b, c), distance_squared(X, c, a)
            )
            if not double_area > SLIVER * longest and not double_area > SLIVER * min(
                longest, sqrt(longest) * X[a, 3]
            ):
                state[f] = MISSING
                x = y = z = 0.0
                double_area = 1.0
                count += 1
            normals[f, 0] = x / double_area
            normals[f, 1] = y / double_area
            normals[f, 2] = z / double_area
        slivers[k] = count


@kernel
def _lend_normals(X, origin, twin, normals, state):
    """Give each sliver the normal of a neighbour, across the longest side that has one, in rounds.

    So a crease that runs along a cap passes over its short sides, in one piece.
    """
    for _ in range(SLIVER_ROUNDS):
        for f in range(origin.size // 3):
            if state[f] != MISSING:
                continue
            longest = -1.0
            for h in range(3 * f, 3 * f + 3):
                t = twin[h]
                side = distance_squared(X, origin[h], origin[next_halfedge(h)])
                if t != NONE and state[t // 3] != MISSING and side > longest:
                    longest = side
                    state[f] = LENT
                    for axis in range(3):
                        normals[f, axis] = normals[t // 3, axis]


@threaded(per_piece_of_twins)
def _list_turns(span, twin, normals, cosine, found, counts):
    """List edges per piece, without branches: write every candidate, advance the counter only for hits.

    Processors cannot predict which of two half-edges is the larger, nor where noise turns.
    """
    n_faces = normals.shape[0]
    for k in range(span[0], span[1]):
        start = 3 * _FACES_PER_RANGE * k
        count = start
        for f in range(_FACES_PER_RANGE * k, min(_FACES_PER_RANGE * k + _FACES_PER_RANGE, n_faces)):
            x, y, z = normals[f, 0], normals[f, 1], normals[f, 2]
            for h in range(3 * f, 3 * f + 3):
                t = twin[h]
                # A boundary edge does not turn. This branch is predicted well.
                g = np.uint64(t) // np.uint64(3) if t != NONE else np.uint64(f)
                turn = x * normals[g, 0] + y * normals[g, 1] + z * normals[g, 2]
                found[count] = h
                count += np.int64((turn <= cosine) & (t < h))
        counts[k] = count - start
