"""Unfold: take back the moves that turned faces beside curves over.

The middle of a ring lies outside where a curve is concave, or where the ring hangs on an edge that must
not be split. All vertices move at once, so this shows only afterwards. Away from curves nothing is
taken back: that would keep the folds of the input.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import threaded
from ..core.geometry import area_vector, turn_exceeds
from ..core.vocabulary import CURVE, DEAD, INNER, Blocks, FloatArray, Mesh
from ..mesh.blocks import per_block

__all__ = ["undo_folds"]

# A face may turn by 60 degrees.
_COSINE = 0.5


def undo_folds(mesh: Mesh, blocks: Blocks, before: FloatArray, parallel: bool) -> int:
    """Put inner vertices back of faces at curves that turned too far; returns how many vertices.

    Repeated until there are none: what is put back may fold a neighbour.

    Parameters
    ----------
    mesh : Mesh
    blocks : Blocks
    before : (n, 3) or (n, 4) float64
        Where the vertices were.
    parallel : bool
    """
    total = 0
    marked = np.zeros(mesh.vertex_halfedge.size, np.uint8)
    faces = np.empty(mesh.origin.size // 3, np.int32)
    n_faces = np.zeros(len(blocks.face) - 1, np.int64)
    _list_faces_at_curves(parallel, mesh, blocks, faces, n_faces)
    if not n_faces.any():
        return 0
    while True:
        found = np.zeros(len(n_faces), np.int64)
        _find_folds(parallel, mesh, blocks, before, faces, n_faces, marked, found)
        if not found.any():
            return total
        count = np.zeros(len(n_faces), np.int64)
        _put_back(parallel, mesh, blocks, before, marked, mesh.X, count)
        if not count.any():
            return total
        total += int(count.sum())


@threaded(per_block)
def _list_faces_at_curves(span, mesh, blocks, faces, n_faces):
    for k in range(span[0], span[1]):
        end = blocks.face[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a = mesh.origin[3 * f]
            if a != DEAD:
                b = mesh.origin[3 * f + 1]
                c = mesh.origin[3 * f + 2]
                faces[end] = f
                end += max(mesh.kind[a], mesh.kind[b], mesh.kind[c]) >= CURVE
        n_faces[k] = end - blocks.face[k]


@threaded(per_block)
def _find_folds(span, mesh, blocks, before, faces, n_faces, marked, found):
    """Mark the corners of folded faces; blocks may mark the same vertex, with the same value."""
    X = mesh.X
    for k in range(span[0], span[1]):
        for i in range(blocks.face[k], blocks.face[k] + n_faces[k]):
            f = faces[i]
            a = mesh.origin[3 * f]
            b = mesh.origin[3 * f + 1]
            c = mesh.origin[3 * f + 2]
            old = ux, uy, uz = area_vector(before, a, b, c)
            new = area_vector(X, a, b, c)
            if ux * ux + uy * uy + uz * uz > 0.0 and turn_exceeds(old, new, _COSINE):
                marked[a] = 1
                marked[b] = 1
                marked[c] = 1
                found[k] += 1


@threaded(per_block)
def _put_back(span, mesh, blocks, before, marked, X, count):
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if marked[v] == 0:
                continue
            marked[v] = 0
            if mesh.kind[v] == INNER and (
                X[v, 0] != before[v, 0] or X[v, 1] != before[v, 1] or X[v, 2] != before[v, 2]
            ):
                X[v, 0] = before[v, 0]
                X[v, 1] = before[v, 1]
                X[v, 2] = before[v, 2]
                count[k] += 1
