"""A piece of the reference: the cells of its faces near some part of a mesh.

Tasks look back at a piece of the input, never at what an earlier round made of it: chained, calls leave
40 to 100 % of the vertices off the input.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import NONE, BoolArray, FloatArray, IndexArray, IntArray
from ..features.polyline import Polylines
from ..reference.build import FeaturedReference
from ..reference.bvh import Surface
from ..reference.surface import Reference
from .index import CELL, Index

__all__ = ["ReferencePiece", "read_reference"]

# Target lengths around the mesh within which the reference is read. Vertices move by a length or two in
# a round, and a walk goes no farther than they do.
_REACH = 4.0


class ReferencePiece(NamedTuple):
    """Some faces of the reference, in their order, and the numbers that they have in the whole."""

    featured: FeaturedReference
    faces: IntArray  # (k,) in the whole
    cell_start: IntArray  # place of the first face of every cell; NONE for those left out

    def local(self, halfedges: NDArray[Any]) -> IndexArray:
        """Half-edges of the whole as those of the piece; negative numbers stay, others are ``NONE``."""
        return _local(self.cell_start, halfedges)

    def whole(self, halfedges: NDArray[Any]) -> IndexArray:
        """Half-edges of the piece as those of the whole; negative numbers stay."""
        inside = np.maximum(halfedges, 0)
        return np.where(halfedges < 0, halfedges, 3 * self.faces[inside // 3] + inside % 3).astype(
            np.int32
        )


def read_reference(index: Index, boxes: FloatArray, needed: NDArray[Any]) -> ReferencePiece:
    """Read the cells of the reference near some boxes, and those of some faces.

    Parameters
    ----------
    index : Index
    boxes : (k, 7) float64
        Lower and upper corners around parts of a mesh, and the largest target length in each.
    needed : (j,) int
        Faces that must be among them.
    """
    n_faces = len(index.origin) // 3
    is_near = _cells_near(np.asarray(index.cells), boxes)
    is_near[np.unique(needed // CELL)] = True
    cells = np.flatnonzero(is_near)
    size = np.minimum(CELL, n_faces - CELL * cells)
    cell_start = np.full(len(is_near), NONE, np.int64)
    cell_start[cells] = np.cumsum(size) - size
    place = np.arange(int(size.sum())) - np.repeat(cell_start[cells], size)
    faces = np.repeat(CELL * cells, size) + place
    vertices, corners = np.unique(index.origin.reshape(-1, 3)[faces], return_inverse=True)
    origin = corners.ravel().astype(np.int32)
    twin = _local(cell_start, index.twin.reshape(-1, 3)[faces].ravel())
    X = np.array(index.X[vertices])
    names, polylines = _polylines(index, cell_start, X, origin)
    reference = Reference(Surface(X, origin, twin, False), X, origin, *polylines[2:])
    featured = FeaturedReference(reference, None, None, None, names, names, {})
    return ReferencePiece(featured, faces, cell_start)


def _cells_near(cells: FloatArray, boxes: FloatArray) -> BoolArray:
    """Mark cells whose boxes come within `_REACH` target lengths of some boxes."""
    reach = _REACH * boxes[:, 6:]
    low, high = boxes[:, :3] - reach, boxes[:, 3:6] + reach
    found = np.zeros(len(cells), np.bool_)
    left = np.flatnonzero(_meets(cells, low.min(axis=0), high.max(axis=0)))
    for lower, upper in zip(low, high, strict=True):
        meets = _meets(cells[left], lower, upper)
        found[left[meets]] = True
        left = left[~meets]
    return found


def _meets(cells: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    return np.asarray(((cells[:, :3] <= high) & (cells[:, 3:] >= low)).all(axis=1))


def _local(cell_start: IntArray, halfedges: NDArray[Any]) -> IndexArray:
    inside = np.maximum(halfedges, 0)
    start = cell_start[inside // (3 * CELL)]
    found = np.where(start == NONE, NONE, 3 * start + inside % (3 * CELL))
    return np.where(halfedges < 0, halfedges, found).astype(np.int32)


def _polylines(
    index: Index, cell_start: IntArray, X: FloatArray, origin: IndexArray
) -> tuple[IndexArray, Polylines]:
    """Read the curves of the piece. They end where it does; arc lengths are those of whole curves."""
    here = _local(cell_start, np.asarray(index.names))
    inside = np.flatnonzero(here != NONE)
    names = here[inside]
    if not len(names):
        nothing = np.empty((2, 0), np.int32), np.empty((3, 0))
        return names, Polylines(X, origin, np.empty(0, np.int32), *nothing)
    row = np.zeros(len(origin), np.int32)
    row[names] = np.arange(1, 1 + len(names))
    neighbours = np.full((2, 1 + len(names)), NONE, np.int32)
    neighbours[:, 1:] = _local(cell_start, index.neighbours[:, inside])
    arcs = np.zeros((3, 1 + len(names)))
    arcs[:, 1:] = index.arcs[:, inside]
    return names, Polylines(X, origin, row, neighbours, arcs)
