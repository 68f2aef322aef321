"""Unfold: take back the moves that turned faces over.

All vertices move at once, so a foldover shows only afterwards. Beside curves, the middle of a ring lies
outside where the curve is concave, or where the ring hangs on an edge that must not be split: there no
face may turn far. Elsewhere that would keep the folds of the input: there, moves are taken back only
where an edge has come to be folded that was not.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import area_vector, point, turn_exceeds
from ..core.vocabulary import CURVE, DEAD, INNER, NONE, Blocks, FloatArray, IndexArray, Mesh, Tree
from ..mesh.blocks import make_candidates, per_block
from ..mesh.walk import corners_of
from .folds import NO_AREA, area_vectors, is_folded, squared_norm
from .turned import find_turned_faces

__all__ = ["restore_births", "undo_folded_edges", "undo_folds", "undo_turned_faces"]

# A face may turn by 60 degrees.
_COSINE = 0.5


def undo_folds(mesh: Mesh, blocks: Blocks, before: FloatArray, parallel: bool) -> int:
    """Put back the inner vertices of faces at curves that turned too far; returns how many.

    Repeats until no face is folded or nothing moves: a vertex that is put back may fold a neighbour.

    Parameters
    ----------
    mesh : Mesh
    blocks : Blocks
    before : (n, 3) or (n, 4) float64
        Positions before the moves.
    parallel : bool
    """
    total = 0
    marked = np.zeros(mesh.vertex_halfedge.size, np.uint8)
    faces = make_candidates(blocks.face)
    _list_faces_at_curves(parallel, mesh, blocks, faces)
    if not faces.counts.any():
        return 0
    while True:
        found = np.zeros(len(faces.counts), np.int64)
        _find_folds(parallel, mesh, blocks, before, faces, marked, found)
        if not found.any():
            return total
        count = np.zeros(len(faces.counts), np.int64)
        _put_back(parallel, mesh, blocks, before, marked, count)
        if not count.any():
            return total
        total += int(count.sum())


def undo_folded_edges(mesh: Mesh, blocks: Blocks, before: FloatArray, parallel: bool) -> int:
    """Put back the inner vertices at edges that moves have folded, and of faces that lost their area.

    Returns how many; repeats as `undo_folds`, and takes the same positions. No edge may have been flipped
    since.
    """
    total = 0
    marked = np.zeros(mesh.vertex_halfedge.size, np.uint8)
    while True:
        vectors = area_vectors(mesh, blocks, parallel)
        found = np.zeros(len(blocks.face) - 1, np.int64)
        _find_folded_edges(parallel, mesh, blocks, before, vectors, marked, found)
        if not found.any():
            return total
        count = np.zeros(len(found), np.int64)
        _put_back(parallel, mesh, blocks, before, marked, count)
        if not count.any():
            return total
        total += int(count.sum())


def undo_turned_faces(
    mesh: Mesh, blocks: Blocks, before: FloatArray, tree: Tree, parallel: bool
) -> int:
    """Put back the inner vertices of faces that moves have turned against the input; returns how many.

    A whole ring may turn over with no edge of it folded. Repeats as `undo_folds`; ``before`` is (n, 4).
    """
    total = 0
    turned = find_turned_faces(mesh, blocks, tree, parallel)
    if not len(turned):
        return 0
    old = find_turned_faces(mesh._replace(X=before), blocks, tree, parallel)
    marked = np.zeros(mesh.vertex_halfedge.size, np.uint8)
    while True:
        marked[mesh.origin.reshape(-1, 3)[np.setdiff1d(turned, old)]] = 1
        count = np.zeros(len(blocks.face) - 1, np.int64)
        _put_back(parallel, mesh, blocks, before, marked, count)
        if not count.any():
            return total
        total += int(count.sum())
        turned = find_turned_faces(mesh, blocks, tree, parallel)


def restore_births(mesh: Mesh, before: FloatArray, births: IndexArray, n_undone: int) -> None:
    """Give vertices that were put back the births that they had there."""
    if n_undone:
        same = (mesh.X[:, :3] == before[:, :3]).all(axis=1)
        mesh.birth[same] = births[same]


@threaded(per_block)
def _find_folded_edges(span, mesh, blocks, before, vectors, marked, found):
    """Mark the vertices around edges that are folded now, and the corners of faces without area.

    Blocks may mark the same vertex, with the same value.
    """
    for k in range(span[0], span[1]):
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a, b, c = corners_of(mesh.origin, f)
            if a == DEAD:
                continue
            here = point(vectors, f)
            limit = (NO_AREA * mesh.X[a, 3] * mesh.X[a, 3]) ** 2
            if (
                not squared_norm(here) > limit
                and squared_norm(area_vector(before, a, b, c)) > limit
            ):
                _mark_corners(mesh, f, marked)
                found[k] += 1
            for h in range(3 * f, 3 * f + 3):
                t = mesh.twin[h]
                if t != NONE and is_folded(here, point(vectors, t // 3)):
                    d, e, g = corners_of(mesh.origin, t // 3)
                    there = area_vector(before, d, e, g)
                    if not is_folded(area_vector(before, a, b, c), there):
                        _mark_corners(mesh, f, marked)
                        found[k] += 1


@inlined
def _mark_corners(mesh, f, marked):
    """Mark the corners of a face."""
    for v in corners_of(mesh.origin, f):
        marked[v] = 1


@threaded(per_block)
def _list_faces_at_curves(span, mesh, blocks, faces):
    """List the faces with a vertex on a curve."""
    for k in range(span[0], span[1]):
        end = faces.starts[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a, b, c = corners_of(mesh.origin, f)
            if a != DEAD:
                faces.items[end] = f
                end += max(mesh.kind[a], mesh.kind[b], mesh.kind[c]) >= CURVE
        faces.counts[k] = end - faces.starts[k]


@threaded(per_block)
def _find_folds(span, mesh, blocks, before, faces, marked, found):
    """Mark the corners of folded faces; blocks may mark the same vertex, with the same value."""
    for k in range(span[0], span[1]):
        for i in range(faces.starts[k], faces.starts[k] + faces.counts[k]):
            a, b, c = corners_of(mesh.origin, faces.items[i])
            old = ux, uy, uz = area_vector(before, a, b, c)
            new = area_vector(mesh.X, a, b, c)
            if ux * ux + uy * uy + uz * uz > 0.0 and turn_exceeds(old, new, _COSINE):
                _mark_corners(mesh, faces.items[i], marked)
                found[k] += 1


@threaded(per_block)
def _put_back(span, mesh, blocks, before, marked, count):
    """Put marked inner vertices back, and take the marks off; counts the vertices that moved."""
    X = mesh.X
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
