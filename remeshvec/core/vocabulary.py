"""Vocabulary: dtypes, the records of arrays that kernels take, sentinels, shared constants."""

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
    "LARGEST_MESH",
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

NONE = -1  # as a twin: the half-edge is on the boundary; as a curve: the edge is not a feature
DEAD = -1  # origin of all three half-edges of a removed face

# A number on both half-edges tells the curve of an edge; `mesh.edge_curves` reads it. On a feature curve
# it is the name of the curve, which is a half-edge of the reference surface on it, or one of these:
FROZEN = -2  # locked: never split, collapsed or flipped
HALTED = -3  # locked until the end of the sweep
# Added to the name of a non-manifold edge, whose siblings on other sheets must change as it does.
NON_MANIFOLD = 1 << 30

# Faces of the largest mesh: half-edges that are names of curves lie below `NON_MANIFOLD`.
LARGEST_MESH = (NON_MANIFOLD - 1) // 3

# Kinds of vertices, from free to fixed; a collapse keeps the larger kind.
INNER = 0  # moves freely
HELD = 1  # inner, but held: a tip, or for a sweep where moves lead too far
CURVE = 2  # slides along its feature curve: a crease, the boundary, a border between labels
PINNED = 3  # on a curve, and held for a sweep
FIXED = 4  # a vertex of the input that never moves and never vanishes

# Where the caller names no length, the target length is this many mean edges.
DEFAULT_LENGTH_FACTOR = 0.9

# Area of an equilateral triangle with edges of length 1.
EQUILATERAL_AREA = sqrt(3.0) / 4.0

# Data on corners that differ by less than this share of their range are equal: single precision has
# 6e-8, and texture coordinates of one vertex are often computed once for every face.
EQUAL_DATA = 1e-6

# Bound for every walk around a vertex. On a mesh that passed the build every walk ends earlier; the bound
# turns a broken mesh into a wrong answer instead of a hang.
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
        ``NONE`` off feature curves; otherwise read with `mesh.edge_curves`. Either both half-edges of an
        edge are on a curve or neither is.
    source : (m,) int32
        Face of the reference surface that the face comes from, in the same patch between curves.
    vertex_halfedge : (n,) int32
        One outgoing half-edge; for a boundary vertex the one without twin; ``DEAD`` if removed.
    valence_excess : (n,) int32
        Valence minus the ideal one: 6, or 4 on the boundary, or what suits the angle at a held tip.
    X : (n, 4) float64
        Coordinates, and in the last column the target edge length.
    kind : (n,) uint8
        ``INNER``, ``HELD``, ``CURVE``, ``PINNED`` or ``FIXED``.
    birth : (n,) int32
        Half-edge of the reference surface. An inner vertex lies on its face, a vertex of a curve on its
        edge, and a fixed vertex is its origin.
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
        """Return a copy with arrays of its own: phases change arrays in place."""
        return Mesh(*(array.copy() for array in self))  # type: ignore[arg-type]


class Blocks(NamedTuple):
    """Ranges of faces and of vertices that lie together in space (both (k + 1,) int64)."""

    face: IntArray
    vertex: IntArray


class Tree(NamedTuple):
    """Reference surface with its bounding-volume tree; see `reference.bvh`.

    Parameters
    ----------
    corners : (m, 9) float64
        Corner coordinates of every face, in Morton order.
    twin : (3 m,) int32
        Opposite half-edges, ``NONE`` on feature curves: no walk leaves its patch.
    patch : (m,) int32
        Patch of every face: faces that walks can reach from each other.
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
