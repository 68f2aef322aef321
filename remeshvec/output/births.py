"""Where vertices, faces and corners lie on the input, and the input's vertices on the result."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import compile_notice
from ..core.threads import thread_scope
from ..core.vocabulary import NONE, FloatArray, IndexArray, IntArray, Mesh
from ..reference.bvh import build_tree, closest_points, face_distance, walk_to
from .records import Births, Provenance
from .sides import locate_corners

__all__ = ["corner_births", "face_births", "images", "turned_faces", "vertex_births"]

# A face of the input that looks the same way is as close within this share of the target length, and
# twice the distance of the closest.
_AS_CLOSE = 0.2


def vertex_births(p: Provenance) -> Births:
    """Faces of the input on which the vertices lie (n,), and weights of their corners (n, 3)."""
    birth, weights = p.births()
    if p.vertices.size:
        birth, weights = birth[p.vertices], weights[p.vertices]
    return _on_input(p, birth // 3, weights)


def corner_births(p: Provenance) -> Births:
    """Faces of the input on which the corners of faces lie (m, 3), and weights of their corners.

    Those of one face all lie in its own patch, and on its own side of every curve.
    """
    return _on_input(p, *locate_corners(p))


def face_births(p: Provenance) -> IntArray:
    """Faces of the input closest to the centroids of the faces (m,), in their own patches."""
    return p.face_source[_faces_below(p)[0]].astype(np.int64)


def turned_faces(p: Provenance) -> IntArray:
    """Faces that look against the face of the input closest to their centroids.

    Not so where a face that looks the same way is almost as close, as on thin sheets.
    """
    below, centroids = _faces_below(p)
    normals = _area_vectors(p.mesh.X, p.mesh.origin.reshape(-1, 3)[p.rows])
    X, F = p.reference.X, p.reference.origin.reshape(-1, 3)
    against = _area_vectors(X, F)
    suspects = np.flatnonzero((normals * against[below]).sum(axis=1) < 0.0)
    if not len(suspects):
        return suspects
    low, high = X[F, :3].min(axis=1), X[F, :3].max(axis=1)
    tree = p.reference.tree
    found = []
    for f in suspects.tolist():
        point = centroids[f]
        _, _, squared = walk_to(tree, point[None], below[f : f + 1])
        reach = (
            2.0 * float(np.sqrt(squared[0])) + _AS_CLOSE * p.mesh.X[p.mesh.origin[3 * p.rows[f]], 3]
        )
        near = ((low <= point + reach) & (high >= point - reach)).all(axis=1)
        agree = np.flatnonzero(near & (against @ normals[f] > 0.0))
        distances = [face_distance(tree.corners, g, tuple(point))[2] for g in agree.tolist()]
        if not distances or min(distances) > reach * reach:
            found.append(f)
    return np.array(found, np.int64)


def _area_vectors(X: FloatArray, F: IndexArray) -> FloatArray:
    a, b, c = (X[F[:, i], :3] for i in range(3))
    return np.asarray(np.cross(b - a, c - a))


def _faces_below(p: Provenance) -> tuple[IndexArray, FloatArray]:
    """Faces of the reference closest to the centroids of the faces, in their patches; centroids."""
    near, _ = locate_corners(p)
    centroids = p.mesh.X[p.mesh.origin.reshape(-1, 3)[p.rows], :3].mean(axis=1)
    with compile_notice(), thread_scope(p.threads) as parallel:
        p.reference.surface.parallel = parallel
        hint = near[:, 0].astype(np.int32)
        face, _ = closest_points(p.reference.tree, centroids, hint, p.trust, parallel)
    return face, centroids


def images(p: Provenance) -> Births:
    """Faces of the result closest to the vertices of the input (n_in,), and weights of their corners.

    -1 for vertices that no face uses.
    """
    mesh, reference = p.mesh, p.reference
    alive = np.sort(p.rows)
    patch = reference.tree.patch[mesh.source[alive]]
    with compile_notice(), thread_scope(p.threads) as parallel:
        twin = _twins_inside(mesh, alive)
        tree = build_tree(mesh.X, mesh.origin.reshape(-1, 3)[alive], twin, patch, parallel)
        hint = _faces_near(p, alive, patch)
        points = np.ascontiguousarray(reference.X[:, :3])
        face, weights = closest_points(tree, points, hint, 0.0, parallel)
    place = np.empty(mesh.origin.size // 3, np.int64)
    place[p.rows] = np.arange(len(p.rows))
    image, barycentric = np.full(p.n_in, -1, np.int64), np.zeros((p.n_in, 3))
    image[p.vertex_source], barycentric[p.vertex_source] = place[alive[face]], weights
    return (
        (image, barycentric)
        if p.representative is None
        else (image[p.representative], barycentric[p.representative])
    )


def _on_input(p: Provenance, face: NDArray[np.integer], weights: FloatArray) -> Births:
    """Faces of the reference to faces of the input."""
    source = p.face_source[face].astype(np.int64)
    if p.flipped is not None:
        is_flipped = p.flipped[source]
        weights = weights.copy()
        weights[is_flipped] = weights[is_flipped][:, [0, 2, 1]]
    if p.cuts is not None:
        row = p.cuts.row[face]
        is_cut = row != NONE
        weights = weights.copy()
        parts = p.cuts.weights[row[is_cut]]
        weights[is_cut] = np.einsum("...i,...ij->...j", weights[is_cut], parts)
    return source, weights


# -- from the input to the result -------------------------------------------------------------


def _twins_inside(mesh: Mesh, alive: IndexArray) -> IndexArray:
    """Twins among the faces that are left, ``NONE`` on curves."""
    new = np.full(mesh.origin.size // 3, NONE, np.int64)
    new[alive] = np.arange(len(alive))
    h = (3 * alive.astype(np.int64)[:, None] + np.arange(3)).ravel()
    twin = mesh.twin[h].astype(np.int64)
    is_inner = (twin != NONE) & (mesh.curve[h] == NONE)
    return np.where(is_inner, 3 * new[twin // 3] + twin % 3, NONE).astype(np.int32)


def _faces_near(p: Provenance, alive: IndexArray, patch: IndexArray) -> IndexArray:
    """Faces of the result, as places in ``alive``, near the vertices of the reference."""
    origin = p.reference.origin
    of_face = np.full(origin.size // 3, NONE)
    near, _ = locate_corners(p)
    place = np.empty(p.mesh.origin.size // 3, np.int64)
    place[alive] = np.arange(len(alive))
    np.maximum.at(of_face, near.ravel(), np.repeat(place[p.rows], 3))
    hint = np.full(len(p.reference.X), NONE)
    np.maximum.at(hint, origin, np.repeat(of_face, 3))
    # Vertices beside which nothing is born take the face of one before them in the same patch.
    own = np.full(len(hint), NONE)
    own[origin] = np.repeat(p.reference.tree.patch, 3)
    last = np.maximum.accumulate(np.where(hint != NONE, np.arange(len(hint)), 0))
    hint = np.where((hint == NONE) & (own[last] == own), hint[last], hint)
    first = np.zeros(int(p.reference.tree.patch.max()) + 1, np.int64)
    first[patch[::-1]] = np.arange(len(patch))[::-1]
    return np.where(hint == NONE, first[np.maximum(own, 0)], hint).astype(np.int32)
