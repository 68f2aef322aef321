"""Where faces and corners of a result lie on the input, and where the input's vertices lie on the result.

A vertex on a curve has two sides or more, and data of the input may differ on them: each corner of a
face is looked for on its own side. That is a matter of the order of edges around vertices, which the
sweeps keep, not of distances: a seam may have the same patch on both sides, and no width.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import compile_notice
from ._threads import thread_scope
from ._types import CURVE, DEAD, FIXED, NONE, SEAM, FloatArray, IndexArray, Mesh
from .bvh import build_tree, closest_points
from .halfedge import ends_of
from .operations.project import Reference
from .report import Late

__all__ = ["Births", "Provenance", "corner_births", "face_births", "images", "vertex_births"]

IntArray = NDArray[np.int64]

# Faces or half-edges, and weights of the three corners of their faces.
Births = tuple[NDArray[np.integer], FloatArray]

# How candidates for the side of a corner compare: whatever lies in another patch is wrong, an edge of
# the same curve is right, one with the same ends even more so; then the direction decides.
_WRONG_PATCH, _SAME_CURVE, _SAME_ENDS = -16.0, 4.0, 2.0

_ROUND = 1 << 20  # bound for walks around a vertex


class Provenance(NamedTuple):
    """The last mesh of a call and the reference, with what leads from them to the caller's numbers."""

    mesh: Mesh
    births: Late[Births]  # half-edges and weights, of all vertices of the mesh
    rows: IndexArray  # (m,) faces of the mesh in the order of the result
    kept: IndexArray  # (n,) vertices of the mesh in the order of the result; nothing: all
    reference: Reference
    features: IndexArray  # (k,) half-edges of the reference on curves
    names: IndexArray  # (k,) of those curves' edges
    face_source: NDArray[np.integer]  # faces of the reference in the input
    vertex_source: IndexArray  # vertices of the reference in the input
    flipped: NDArray[np.bool_] | None  # faces of the input whose corners 1 and 2 were swapped
    same: IndexArray | None  # the vertex that stands for each of the input; None: itself
    n_in: int
    trust: float
    threads: int


def vertex_births(p: Provenance) -> Births:
    """Faces of the input on which the vertices lie (n,), and weights of their corners (n, 3)."""
    birth, weights = p.births()
    if p.kept.size:
        birth, weights = birth[p.kept], weights[p.kept]
    return _on_input(p, birth // 3, weights)


def corner_births(p: Provenance) -> Births:
    """Faces of the input on which the corners of faces lie (m, 3), and weights of their corners.

    Those of one face all lie in its own patch, and on its own side of every curve.
    """
    return _on_input(p, *_corners_on_reference(p))


def face_births(p: Provenance) -> IntArray:
    """Faces of the input closest to the centroids of the faces (m,), in their own patches."""
    near, _ = _corners_on_reference(p)
    centroids = p.mesh.X[p.mesh.origin.reshape(-1, 3)[p.rows], :3].mean(axis=1)
    with compile_notice(), thread_scope(p.threads) as parallel:
        p.reference.surface.parallel = parallel
        hint = near[:, 0].astype(np.int32)
        face, _ = closest_points(p.reference.tree, centroids, hint, p.trust, parallel)
    return p.face_source[face].astype(np.int64)


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
    return (image, barycentric) if p.same is None else (image[p.same], barycentric[p.same])


def _on_input(p: Provenance, face: NDArray[np.integer], weights: FloatArray) -> Births:
    """Faces of the reference to faces of the input."""
    source = p.face_source[face].astype(np.int64)
    if p.flipped is not None:
        is_flipped = p.flipped[source]
        weights = weights.copy()
        weights[is_flipped] = weights[is_flipped][:, [0, 2, 1]]
    return source, weights


# -- the sides of curves ----------------------------------------------------------------------


def _corners_on_reference(p: Provenance) -> Births:
    """Faces of the reference on which the corners lie (m, 3), and weights of their corners."""
    mesh = p.mesh
    birth, weights = p.births()
    v = np.maximum(mesh.origin, 0)
    face, where = birth[v] // 3, weights[v]
    # Edges of curves that leave a vertex: each has a sector of faces on its left.
    h = np.flatnonzero((mesh.curve != NONE) & (mesh.origin != DEAD))
    if len(h):
        edge = _edges_beside(p, h, birth)
        place = np.zeros((len(h), 3))
        along = _shares_along(p, mesh.origin[h], edge, birth, weights)
        place[np.arange(len(h)), edge % 3] = 1.0 - along
        place[np.arange(len(h)), (edge + 1 - 3 * (edge % 3 == 2)) % 3] = along
        _fill_sectors(mesh, h, edge // 3, place, face, where)
    return face.reshape(-1, 3)[p.rows], where.reshape(-1, 3, 3)[p.rows]


def _edges_beside(p: Provenance, h: IntArray, birth: IndexArray) -> IntArray:
    """Half-edges of the reference at the origins of half-edges on curves, with the same side on the left."""
    mesh, reference = p.mesh, p.reference
    patch = reference.tree.patch
    v, w = ends_of(mesh.origin, h)
    is_fixed = mesh.kind[v] == FIXED
    row, edge = _candidates(p, h, birth[v], is_fixed)
    a, b = ends_of(reference.origin, edge)
    along = _unit(mesh.X[w[row], :3] - mesh.X[v[row], :3])
    score = np.einsum("ij,ij->i", along, _unit(reference.X[b, :3] - reference.X[a, :3]))
    score += _WRONG_PATCH * (patch[edge // 3] != patch[mesh.source[h[row] // 3]])
    curves = _curves(p)
    name = mesh.curve[h].astype(np.int64)
    on_curve = name >= 0
    curve = np.full(len(h), -1)
    curve[on_curve] = curves[np.where(name >= SEAM, name - SEAM, name)[on_curve]]
    of_edge = np.full(reference.origin.size, -2)
    of_edge[p.features] = curves[p.names]
    score += _SAME_CURVE * (of_edge[edge] == curve[row])
    end = np.where(mesh.kind[w] == FIXED, reference.origin[birth[w]], -1)
    score += _SAME_ENDS * (b == end[row])
    order = np.lexsort((edge, score, row))
    last = np.flatnonzero(np.r_[row[order][1:] != row[order][:-1], True])
    best = birth[v].astype(np.int64)
    best[row[order][last]] = edge[order][last]
    return best


def _candidates(
    p: Provenance, h: IntArray, birth: IndexArray, is_fixed: NDArray[np.bool_]
) -> tuple[IntArray, IntArray]:
    """Half-edges of the reference that may be meant: pairs of a place in ``h`` and one of them.

    For a vertex that slides the two sides of its edge, on all sheets; for one that is fixed all that
    leave it.
    """
    by_name = np.argsort(p.names, kind="stable")
    sliding = np.flatnonzero(~is_fixed)
    row, place = _matches(p.names[by_name], birth[sliding])
    pairs = [(sliding[row], p.features[by_name[place]])]
    fixed = np.flatnonzero(is_fixed)
    at = p.reference.origin[birth[fixed]]
    near = np.zeros(len(p.reference.X), np.bool_)
    near[at] = True
    leaving = np.flatnonzero(near[p.reference.origin])
    leaving = leaving[np.argsort(p.reference.origin[leaving], kind="stable")]
    row, place = _matches(p.reference.origin[leaving], at)
    pairs.append((fixed[row], leaving[place]))
    rows, edges = (np.concatenate(part).astype(np.int64) for part in zip(*pairs, strict=True))
    return rows, edges


def _matches(keys: NDArray[np.integer], wanted: NDArray[np.integer]) -> tuple[IntArray, IntArray]:
    """Pairs of a place in ``wanted`` and a place in the ascending ``keys`` that hold the same."""
    start = np.searchsorted(keys, wanted, "left")
    count = np.searchsorted(keys, wanted, "right") - start
    row = np.repeat(np.arange(len(wanted)), count)
    within = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    return row, start[row] + within


def _curves(p: Provenance) -> IntArray:
    """Give the curve of every name a number, (3 m,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size, beside = p.reference.origin.size, p.reference.beside
    names = np.unique(p.names)
    ends = beside[:, names] if len(names) else np.empty((2, 0), np.int64)
    side, at = np.nonzero(ends != NONE)
    pairs = names[at], ends[side, at]
    graph = coo_array((np.ones(len(at), np.int8), pairs), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def _shares_along(
    p: Provenance, v: IndexArray, edge: IntArray, birth: IndexArray, weights: FloatArray
) -> FloatArray:
    """How far along half-edges of the reference vertices lie: those that slide do, others at the start."""
    known = birth[v].astype(np.int64)
    along = weights[v, (known + 1 - 3 * (known % 3 == 2)) % 3]
    origin, X = p.reference.origin, p.reference.X
    is_same = (X[origin[edge], :3] == X[origin[known], :3]).all(axis=1)
    along = np.where(is_same, along, 1.0 - along)
    return np.asarray(np.where(p.mesh.kind[v] >= FIXED, 0.0, along))


def _fill_sectors(
    mesh: Mesh,
    h: IntArray,
    edge_face: IntArray,
    place: FloatArray,
    face: NDArray[np.integer],
    where: FloatArray,
) -> None:
    """Write what is known at edges of curves to all corners on their left, up to the next curve."""
    at, current = np.arange(len(h)), h
    for _ in range(_ROUND):
        face[current] = edge_face[at]
        where[current] = place[at]
        before = current + 2 - 3 * (current % 3 != 0)
        goes_on = (mesh.curve[before] == NONE) & (mesh.twin[before] != NONE)
        at, current = at[goes_on], mesh.twin[before[goes_on]].astype(np.int64)
        if not len(at):
            return


def _unit(x: FloatArray) -> FloatArray:
    length = np.linalg.norm(x, axis=1, keepdims=True)
    return np.asarray(x / np.where(length > 0.0, length, 1.0))


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
    near, _ = _corners_on_reference(p)
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
