"""Vocabulary: dtypes, the records of arrays that kernels take, sentinels, tolerances."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "APEX",
    "BOUNDARY",
    "DEAD",
    "FIXED",
    "INNER",
    "MAX_VALENCE",
    "NONE",
    "Blocks",
    "FloatArray",
    "IndexArray",
    "Mesh",
    "Tree",
]

IndexArray = NDArray[np.int32]
FloatArray = NDArray[np.float64]

NONE = -1  # no twin: the half-edge lies on the boundary
DEAD = -1  # origin of all three half-edges of a removed face

# Kinds of vertices, in the order of what they may do; a collapse keeps the larger kind.
INNER = 0  # moves freely
APEX = 1  # tip of a horn: held during the sweeps, an inner vertex afterwards
BOUNDARY = 2  # stays on its boundary loop
FIXED = 3  # never moves, never vanishes

# Bound for every walk around a vertex. A structure that passed the build always closes sooner; the
# bound turns a broken one into a wrong answer instead of a hang.
MAX_VALENCE = 1 << 20


class Mesh(NamedTuple):
    """Half-edge mesh as flat arrays; half-edge ``h = 3 f + c`` leaves corner ``c`` of face ``f``.

    Parameters
    ----------
    origin : (3 m,) int32
        Origin vertex of every half-edge; ``DEAD`` in removed faces.
    twin : (3 m,) int32
        Opposite half-edge, ``NONE`` on the boundary.
    vertex_halfedge : (n,) int32
        One outgoing half-edge; for a boundary vertex the one without twin; ``DEAD`` if removed.
    valence_excess : (n,) int32
        Valence minus 6, or minus 4 on the boundary.
    X : (n, 4) float64
        Coordinates, and in the last column the mixed Voronoi area while relaxing.
    kind : (n,) uint8
        ``INNER``, ``APEX``, ``BOUNDARY`` or ``FIXED``.
    birth : (n,) int32
        Face of the reference surface on or near which the vertex lies.
    """

    origin: IndexArray
    twin: IndexArray
    vertex_halfedge: IndexArray
    valence_excess: IndexArray
    X: FloatArray
    kind: NDArray[np.uint8]
    birth: IndexArray


class Blocks(NamedTuple):
    """Ranges of faces and of vertices that lie together in space (both (k + 1,) int64)."""

    face: NDArray[np.int64]
    vertex: NDArray[np.int64]


class Tree(NamedTuple):
    """Reference surface with its bounding-volume tree; see ``bvh``.

    Parameters
    ----------
    corners : (m, 9) float64
        Corner coordinates of every face, in Morton order.
    twin : (3 m,) int32
        Opposite half-edges, for walks from face to face.
    boxes : (k, 6) float64
        Lower and upper corners of the boxes, leaves first.
    level : (l + 1,) int64
        Where the boxes of each level start.
    """

    corners: FloatArray
    twin: IndexArray
    boxes: FloatArray
    level: NDArray[np.int64]
