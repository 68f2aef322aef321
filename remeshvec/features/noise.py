"""Noise beside edges: how far a face turns across its smoothest side, averaged around vertices."""

from __future__ import annotations

from math import degrees, sqrt
from typing import Any

import numpy as np

from ..core.compiler import threaded
from ..core.geometry import angle_from_cosine, area_vector, distance_squared
from ..core.vocabulary import MAX_VALENCE, NONE, FloatArray, IndexArray, IntArray
from ..mesh.walk import previous_halfedge
from .dihedral import PROPER, DihedralAngles, face_cosine

__all__ = ["noise_at_vertices"]

# Faces higher than this many target lengths are flat whatever is around them.
FLAT_HEIGHT = 2.5

# Elements in a piece of a loop.
_ELEMENTS_PER_PIECE = 1024


def noise_at_vertices(
    surface: tuple[FloatArray, IndexArray, IndexArray, IndexArray],
    turns: DihedralAngles,
    found: IntArray,
    parallel: bool,
) -> FloatArray:
    """Mean turn, in degrees, across the smoothest side of each face at the ends of edges.

    Weighted by area. Of flat faces, which have many vertices, the turn is computed once.

    Parameters
    ----------
    surface : X (n, 4), origin and twin (3 m,), vertex_halfedge (n,)
        The last column of X is the target length.
    turns : DihedralAngles
    found : (k,) int64
        Half-edges at whose ends the noise is wanted.
    parallel : bool

    Returns
    -------
    (n,) float64
        Not set elsewhere.
    """
    X, origin, twin, vertex_halfedge = surface
    is_asked = np.zeros(len(X), np.bool_)
    is_asked[origin[found]] = True
    is_asked[origin[twin[found]]] = True
    faces = np.empty((len(origin) // 3, 3))
    _measure_faces(parallel, X, origin, twin, turns.normals, turns.state, is_asked, faces)
    noise = np.empty(len(X))
    _sum_noise(parallel, X, origin, twin, vertex_halfedge, faces, is_asked, noise)
    return noise


def _per_piece_of_vertices(X: FloatArray, *_: Any) -> int:
    return -(-len(X) // _ELEMENTS_PER_PIECE)


def _per_piece_of_faces(X: FloatArray, origin: IndexArray, *_: Any) -> int:
    return -(-origin.size // (3 * _ELEMENTS_PER_PIECE))


@threaded(_per_piece_of_faces)
def _measure_faces(span, X, origin, twin, normals, state, is_asked, faces):
    """Twice the area of a face, its longest side, the smallest of its turns in radians."""
    for f in range(_ELEMENTS_PER_PIECE * span[0], min(_ELEMENTS_PER_PIECE * span[1], state.size)):
        a, b, c = origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]
        if not (is_asked[a] or is_asked[b] or is_asked[c]):
            continue
        faces[f, 0] = faces[f, 1] = faces[f, 2] = 0.0
        if state[f] != PROPER:
            continue
        x, y, z = area_vector(X, a, b, c)
        faces[f, 0] = sqrt(x * x + y * y + z * z)
        faces[f, 1] = sqrt(
            max(distance_squared(X, a, b), distance_squared(X, b, c), distance_squared(X, c, a))
        )
        best = -2.0
        for h in range(3 * f, 3 * f + 3):
            t = twin[h]
            if t != NONE and state[t // 3] == PROPER:
                best = max(best, face_cosine(normals, f, t // 3))
        faces[f, 2] = angle_from_cosine(best) if best >= -1.5 else 0.0


@threaded(_per_piece_of_vertices)
def _sum_noise(span, X, origin, twin, vertex_halfedge, faces, is_asked, noise):
    for v in range(_ELEMENTS_PER_PIECE * span[0], min(_ELEMENTS_PER_PIECE * span[1], noise.size)):
        if not is_asked[v]:
            continue
        area = 0.0
        total = 0.0
        height = FLAT_HEIGHT * X[v, 3]
        start = np.int64(vertex_halfedge[v])
        g = start
        for _ in range(MAX_VALENCE):
            f = g // 3
            double_area = faces[f, 0]
            area += double_area
            if double_area <= height * faces[f, 1]:
                total += double_area * faces[f, 2]
            g = np.int64(twin[previous_halfedge(g)])
            if g == NONE or g == start:
                break
        noise[v] = degrees(total / area) if area > 0.0 else 0.0
