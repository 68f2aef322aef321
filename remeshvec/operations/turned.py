"""Faces that lie against the input: what turned over as a whole, so that hardly an edge is folded."""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import area_vector
from ..core.vocabulary import CURVE, DEAD, Blocks, IndexArray, Mesh, Tree
from ..mesh.blocks import make_candidates, per_block
from ..mesh.walk import corners_of
from ..reference.bvh import (
    NO_NORMAL,
    STACK,
    has_agreeing_face,
    looks_away,
    search_face,
    walk_to_face,
)

__all__ = ["find_turned_faces"]

# A face of the input that looks the same way is as close within this share of the target length, and
# twice the distance of the closest: thin sheets, and noise below the target length, turn nothing over.
_AS_CLOSE = 0.2


def find_turned_faces(mesh: Mesh, blocks: Blocks, tree: Tree, parallel: bool) -> IndexArray:
    """Return the faces that look against the input below them, as `output.births.turned_faces`.

    Faces that look the same way as the input where all their corners were born are taken for good. On
    clean meshes this leaves only faces at creases for a closer look.
    """
    faces = make_candidates(blocks.face)
    _list_turned(parallel, mesh, blocks, tree, faces)
    parts = [faces.items[i : i + n] for i, n in zip(faces.starts, faces.counts, strict=False)]
    return np.concatenate(parts).astype(np.int32)


@threaded(per_block)
def _list_turned(span, mesh, blocks, tree, faces):
    for k in range(span[0], span[1]):
        stack = np.empty((2, STACK), np.int64)
        end = faces.starts[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a, b, c = corners_of(mesh.origin, f)
            if a == DEAD:
                continue
            normal = area_vector(mesh.X, a, b, c)
            if (
                looks_away(tree.corners, mesh.birth[a] // 3, normal)
                or looks_away(tree.corners, mesh.birth[b] // 3, normal)
                or looks_away(tree.corners, mesh.birth[c] // 3, normal)
            ):
                faces.items[end] = f
                end += _is_turned(mesh, tree, f, normal, stack)
        faces.counts[k] = end - faces.starts[k]


@inlined
def _is_turned(mesh, tree, f, normal, stack):
    """Look closely: at the closest face of the patch, then at all within reach."""
    a, b, c = corners_of(mesh.origin, f)
    p = (
        (mesh.X[a, 0] + mesh.X[b, 0] + mesh.X[c, 0]) / 3.0,
        (mesh.X[a, 1] + mesh.X[b, 1] + mesh.X[c, 1]) / 3.0,
        (mesh.X[a, 2] + mesh.X[b, 2] + mesh.X[c, 2]) / 3.0,
    )
    start = np.int64(mesh.source[f])
    for v in (a, b, c):
        if mesh.kind[v] < CURVE:
            start = np.int64(mesh.birth[v] // 3)
    below, _, _, distance = walk_to_face(tree, p, start)
    if not looks_away(tree.corners, below, normal):
        return False
    below, _, _, distance = search_face(tree, p, below, NO_NORMAL, stack)
    if not looks_away(tree.corners, below, normal):
        return False
    reach = 2.0 * sqrt(distance) + _AS_CLOSE * mesh.X[a, 3]
    return not has_agreeing_face(tree, p, normal, reach * reach, stack)
