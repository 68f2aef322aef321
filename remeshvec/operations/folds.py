"""Look for folds and faces without area: what no phase may make, in one pass over the faces."""

from __future__ import annotations

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import area_vector, point
from ..core.vocabulary import DEAD, NONE, Blocks, FloatArray, IndexArray, Mesh
from ..mesh.blocks import per_block
from ..mesh.walk import corners_of

__all__ = [
    "NO_AREA",
    "area_vectors",
    "find_flat_faces",
    "find_folds",
    "has_folds",
    "is_folded",
    "squared_norm",
]

# Square of the cosine of a turn of 150 degrees, from which on an edge counts as folded.
_FOLDED_SQUARED = 0.75

# Twice the area of a face without any, as a share of the squared target length.
NO_AREA = 1e-12


def has_folds(mesh: Mesh, blocks: Blocks, parallel: bool) -> bool:
    """Tell whether an edge turns by more than 150 degrees, or a face has no area."""
    vectors = area_vectors(mesh, blocks, parallel)
    found = np.zeros(len(blocks.face) - 1, np.uint8)
    _look(parallel, mesh, blocks, vectors, found)
    return bool(found.any())


def area_vectors(mesh: Mesh, blocks: Blocks, parallel: bool) -> FloatArray:
    """Compute the area vectors of all faces (m, 3); those of removed ones mean nothing."""
    vectors = np.empty((mesh.origin.size // 3, 3))
    _fill_vectors(parallel, mesh, blocks, vectors)
    return vectors


def find_folds(mesh: Mesh, vectors: FloatArray) -> IndexArray:
    """Return one half-edge of every folded edge."""
    h = np.flatnonzero((mesh.twin > np.arange(len(mesh.twin))) & (mesh.origin != DEAD))
    a, b = vectors[h // 3], vectors[mesh.twin[h] // 3]
    dot = np.einsum("ij,ij->i", a, b)
    squares = np.einsum("ij,ij->i", a, a) * np.einsum("ij,ij->i", b, b)
    return h[(dot < 0.0) & (dot * dot > _FOLDED_SQUARED * squares)].astype(np.int32)


def find_flat_faces(mesh: Mesh, vectors: FloatArray) -> IndexArray:
    """Return the faces without area."""
    alive = np.flatnonzero(mesh.origin[::3] != DEAD)
    limit = NO_AREA * mesh.X[mesh.origin[3 * alive], 3] ** 2
    size = np.einsum("ij,ij->i", vectors[alive], vectors[alive])
    return alive[~(size > limit * limit)].astype(np.int32)


@threaded(per_block)
def _fill_vectors(span, mesh, blocks, vectors):
    for k in range(span[0], span[1]):
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a, b, c = corners_of(mesh.origin, f)
            if a != DEAD:
                vectors[f, 0], vectors[f, 1], vectors[f, 2] = area_vector(mesh.X, a, b, c)


@threaded(per_block)
def _look(span, mesh, blocks, vectors, found):
    """Note per block whether there is a fold or a face without area."""
    for k in range(span[0], span[1]):
        for f in range(blocks.face[k], blocks.face[k + 1]):
            v = mesh.origin[3 * f]
            if v == DEAD:
                continue
            limit = NO_AREA * mesh.X[v, 3] * mesh.X[v, 3]
            here = point(vectors, f)
            if not squared_norm(here) > limit * limit:
                found[k] = 1
            for h in range(3 * f, 3 * f + 3):
                t = mesh.twin[h]
                if t == NONE or t < h:
                    continue
                if is_folded(here, point(vectors, t // 3)):
                    found[k] = 1


@inlined
def is_folded(u, w):
    """Tell whether the area vectors of the faces at an edge differ by more than 150 degrees."""
    dot = u[0] * w[0] + u[1] * w[1] + u[2] * w[2]
    return dot < 0.0 and dot * dot > _FOLDED_SQUARED * squared_norm(u) * squared_norm(w)


@inlined
def squared_norm(u):
    """Square of the length of a vector."""
    return u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
