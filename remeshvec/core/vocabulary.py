"""Vocabulary: dtypes, the records of arrays that kernels take, sentinels, tolerances."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "CURVE",
    "DEAD",
    "DEFAULT_LENGTH_FACTOR",
    "EQUAL_DATA",
    "EQUILATERAL_AREA",
    "FIXED",
    "FROZEN",
    "HALTED",
    "HELD",
    "INNER",
    "MAX_VALENCE",
    "NONE",
    "NON_MANIFOLD",
    "PINNED",
    "Blocks",
    "BoolArray",
    "FloatArray",
    "IndexArray",
    "IntArray",
    "Mesh",
    "Tree",
]

IndexArray = NDArray[np.int32]
IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

NONE = -1  # no twin: the half-edge lies on the boundary; no curve: the edge is no feature
DEAD = -1  # origin of all three half-edges of a removed face

# Edges on feature curves name a half-edge of the reference surface that lies on the same curve.
FROZEN = -2  # instead of that: the edge stays as it is
HALTED = -3  # likewise, until the end of the sweep
NON_MANIFOLD = (
    1 << 30
)  # added to that: the edge has siblings on other sheets, which must do what it does

# Kinds of vertices, in the order of what they may do; a collapse keeps the larger kind.
INNER = 0  # moves freely
HELD = 1  # an inner vertex that the sweeps hold: the tip of a horn, or where moves lead too far
CURVE = 2  # slides along its feature curve: a crease, the boundary, a border between labels
PINNED = 3  # a vertex of a curve that the sweeps hold
FIXED = 4  # a vertex of the input that never moves, never vanishes

# Where the caller names no length, the target length is this many mean edges.
DEFAULT_LENGTH_FACTOR = 0.9

# Area of an equilateral triangle with edges of length 1.
EQUILATERAL_AREA = sqrt(3.0) / 4.0

# Data on corners that differ by less than this share of their range are equal: single precision has
# 6e-8, and texture coordinates of one vertex are often computed once for every face.
EQUAL_DATA = 1e-6

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
    curve : (3 m,) int32
        ``NONE`` off feature curves; see ``FROZEN`` and ``NON_MANIFOLD`` for the others. Both half-edges
        of an edge are on a curve or neither is.
    source : (m,) int32
        Face of the reference surface, in the same patch between curves: where the face comes from.
    vertex_halfedge : (n,) int32
        One outgoing half-edge; for a boundary vertex the one without twin; ``DEAD`` if removed.
    valence_excess : (n,) int32
        Valence minus 6, or minus 4 on the boundary.
    X : (n, 4) float64
        Coordinates, and in the last column the target edge length.
    kind : (n,) uint8
        ``INNER``, ``HELD``, ``CURVE``, ``PINNED`` or ``FIXED``.
    birth : (n,) int32
        Half-edge of the reference surface: on its face lies an inner vertex, on its edge the vertex
        of a curve; a fixed vertex is its origin.
    """

    origin: IndexArray
    twin: IndexArray
    curve: IndexArray
    source: IndexArray
    vertex_halfedge: IndexArray
    valence_excess: IndexArray
    X: FloatArray
    kind: NDArray[np.uint8]
    birth: IndexArray

    def copy(self) -> Mesh:
        """Return the mesh in arrays of its own: phases change theirs."""
        return Mesh(*(array.copy() for array in self))  # type: ignore[arg-type]


class Blocks(NamedTuple):
    """Ranges of faces and of vertices that lie together in space (both (k + 1,) int64)."""

    face: IntArray
    vertex: IntArray


class Tree(NamedTuple):
    """Reference surface with its bounding-volume tree; see ``bvh``.

    Parameters
    ----------
    corners : (m, 9) float64
        Corner coordinates of every face, in Morton order.
    twin : (3 m,) int32
        Opposite half-edges, ``NONE`` on feature curves: no walk leaves its patch.
    patch : (m,) int32
        Patch of every face: what walks can reach.
    boxes : (k, 6) float64
        Lower and upper corners of the boxes, leaves first.
    level : (l + 1,) int64
        Where the boxes of each level start.
    """

    corners: FloatArray
    twin: IndexArray
    patch: IndexArray
    boxes: FloatArray
    level: IntArray
