"""The sides of curves: which face of the reference each corner of a face lies on.

A vertex on a curve has two sides or more. Which one a corner belongs to is a matter of the order of
edges around vertices, which the sweeps keep, not of distances: a seam may have the same patch on both
sides, and no width.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, kernel
from ..core.geometry import closest_on_segment, point
from ..core.vocabulary import (
    CURVE,
    DEAD,
    FIXED,
    NON_MANIFOLD,
    NONE,
    BoolArray,
    FloatArray,
    IndexArray,
    IntArray,
    Mesh,
)
from ..mesh.walk import ends_of
from ..reference.bvh import corner, face_distance, walk_to
from .records import Births, Provenance

__all__ = ["locate_corners"]


# How candidates for the side of a corner compare: whatever lies in another patch is wrong, an edge of
# the same curve is right; then the direction decides.
_WRONG_PATCH, _SAME_CURVE = -16.0, 4.0

_ROUND = 1 << 20  # bound for walks around a vertex
_SIDE_ROUNDS = 8  # of moves to the own side of a curve
_DETOUR = 3.0  # a way of so many distances between its ends is straight enough
_NEARBY = 512  # faces to look at


def locate_corners(p: Provenance) -> Births:
    """Faces of the reference on which the corners lie (m, 3), and weights of their corners."""
    mesh = p.mesh
    birth, weights = p.births()
    v = np.maximum(mesh.origin, 0)
    # Edges of curves that leave a vertex: each has a sector of faces on its left.
    h = np.flatnonzero((mesh.curve != NONE) & (mesh.origin != DEAD))
    if not len(h):
        face, where = birth[v] // 3, weights[v]
    else:
        edge = _edges_beside(p, h, birth)
        sector = _sectors(mesh, h)
        at_vertex = _keep_sides(p, sector, edge // 3, birth // 3, weights)
        face, where = at_vertex[0][v], at_vertex[1][v]
        place = np.zeros((len(h), 3))
        along = _shares_along(p, mesh.origin[h], edge, birth, weights)
        place[np.arange(len(h)), edge % 3] = 1.0 - along
        place[np.arange(len(h)), (edge + 1) % 3] = along
        known = np.flatnonzero(sector != NONE)
        face[known], where[known] = edge[sector[known]] // 3, place[sector[known]]
    return face.reshape(-1, 3)[p.rows], where.reshape(-1, 3, 3)[p.rows]


def _edges_beside(p: Provenance, h: IntArray, birth: IndexArray) -> IntArray:
    """Half-edges of the reference at the origins of others on curves, with the same side on the left."""
    mesh, reference = p.mesh, p.reference
    patch = reference.tree.patch
    v, w = ends_of(mesh.origin, h)
    is_fixed = mesh.kind[v] == FIXED
    row, edge = _candidates(p, h, birth[v], is_fixed)
    a, b = ends_of(reference.origin, edge)
    along = _unit_vectors(mesh.X[w[row], :3] - mesh.X[v[row], :3])
    score = np.einsum("ij,ij->i", along, _unit_vectors(reference.X[b, :3] - reference.X[a, :3]))
    score += _WRONG_PATCH * (patch[edge // 3] != patch[mesh.source[h[row] // 3]])
    curves = _curves(p)
    name = mesh.curve[h].astype(np.int64)
    on_curve = name >= 0
    curve = np.full(len(h), -1)
    curve[on_curve] = curves[np.where(name >= NON_MANIFOLD, name - NON_MANIFOLD, name)[on_curve]]
    of_edge = np.full(reference.origin.size, -2)
    of_edge[p.features] = curves[p.names]
    score += _SAME_CURVE * (of_edge[edge] == curve[row])
    order = np.lexsort((edge, score, row))
    last = np.flatnonzero(np.r_[row[order][1:] != row[order][:-1], True])
    best = birth[v].astype(np.int64)
    best[row[order][last]] = edge[order][last]
    return best


def _candidates(
    p: Provenance, h: IntArray, birth: IndexArray, is_fixed: BoolArray
) -> tuple[IntArray, IntArray]:
    """Half-edges of the reference that may be meant: pairs of a place in ``h`` and one of them.

    For a vertex that slides the two sides of its edge, on all sheets; for one that is fixed all that
    leave it.
    """
    by_name = np.argsort(p.names, kind="stable")
    sliding = np.flatnonzero(~is_fixed)
    row, place = _matches(p.names[by_name], birth[sliding])
    edges: NDArray[Any] = p.features[by_name[place]]
    pairs = [(sliding[row], edges)]
    fixed = np.flatnonzero(is_fixed)
    at = p.reference.origin[birth[fixed]]
    near = np.zeros(len(p.reference.X), np.bool_)
    near[at] = True
    leaving = np.flatnonzero(near[p.reference.origin])
    leaving = leaving[np.argsort(p.reference.origin[leaving], kind="stable")]
    row, place = _matches(p.reference.origin[leaving], at)
    pairs.append((fixed[row], leaving[place]))
    row, edges = (np.concatenate(part).astype(np.int64) for part in zip(*pairs, strict=True))
    return row, edges


def _matches(keys: NDArray[Any], wanted: NDArray[Any]) -> tuple[IntArray, IntArray]:
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

    size, names = p.reference.origin.size, np.unique(p.names)
    ends = p.reference.curve_neighbours[:, 1:]  # in the order of the names
    side, at = np.nonzero(ends != NONE)
    pairs = names[at], ends[side, at]
    graph = coo_array((np.ones(len(at), np.int8), pairs), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def _shares_along(
    p: Provenance, v: IndexArray, edge: IntArray, birth: IndexArray, weights: FloatArray
) -> FloatArray:
    """How far along half-edges of the reference vertices lie: fixed ones at the start."""
    known = birth[v].astype(np.int64)
    along = weights[v, (known + 1 - 3 * (known % 3 == 2)) % 3]
    origin, X = p.reference.origin, p.reference.X
    is_same = (X[origin[edge], :3] == X[origin[known], :3]).all(axis=1)
    along = np.where(is_same, along, 1.0 - along)
    return np.asarray(np.where(p.mesh.kind[v] >= FIXED, 0.0, along))


def _sectors(mesh: Mesh, h: IntArray) -> IntArray:
    """For every corner the place in ``h`` of the edge of a curve on whose left it lies, (3 m,).

    -1 off curves.
    """
    sector = np.full(mesh.origin.size, NONE, np.int64)
    at, current = np.arange(len(h)), h
    for _ in range(_ROUND):
        sector[current] = at
        before = current + 2 - 3 * (current % 3 != 0)
        goes_on = (mesh.curve[before] == NONE) & (mesh.twin[before] != NONE)
        at, current = at[goes_on], mesh.twin[before[goes_on]].astype(np.int64)
        if not len(at):
            break
    return sector


def _unit_vectors(x: FloatArray) -> FloatArray:
    length = np.linalg.norm(x, axis=1, keepdims=True)
    return np.asarray(x / np.where(length > 0.0, length, 1.0))


# -- beside curves with one patch on both sides -----------------------------------------------


def _keep_sides(
    p: Provenance,
    sector: IntArray,
    beside: NDArray[Any],
    face: NDArray[Any],
    weights: FloatArray,
) -> Births:
    """Where vertices lie, (n,) faces and weights; not across a curve that has one patch on both sides.

    On a rough surface the closest point of the patch may lie across. It does where the ways over the
    patch from most of its neighbours are long. ``beside`` holds the faces of the sectors.
    """
    mesh, tree = p.mesh, p.reference.tree
    is_near = _faces_beside_slits(p)
    face, weights = face.astype(np.int32), weights.copy()
    may_move = is_near[face] & (mesh.kind < CURVE)
    for _ in range(_SIDE_ROUNDS):
        h = np.flatnonzero(may_move[mesh.origin] & (mesh.origin != DEAD))
        if not len(h):
            break
        v = np.tile(mesh.origin[h], 2).astype(np.int64)
        corner = 3 * np.tile(h // 3, 2) + np.concatenate([(h + 1) % 3, (h + 2) % 3])
        w = mesh.origin[corner]
        at_sector = np.append(beside, NONE)[sector[corner]]
        near, length = _path_lengths(
            p, v, w, np.where(sector[corner] == NONE, face[w], at_sector), face
        )
        is_long = length > _DETOUR * np.linalg.norm(mesh.X[v, :3] - mesh.X[w, :3], axis=1)
        share = np.bincount(v[is_long], minlength=len(face)) / np.bincount(
            v, minlength=len(face)
        ).clip(1)
        long = np.flatnonzero(is_long & (share[v] > 0.5))
        reached, where, distance = walk_to(tree, mesh.X[v[long], :3], near[long])
        order = np.lexsort((reached, distance, v[long]))
        moved, first = np.unique(v[long][order], return_index=True)
        face[moved], weights[moved] = reached[order[first]], where[order[first]]
        may_move = _vertices_beside(mesh, moved) & may_move
        may_move[moved] = False
    return face, weights


def _faces_beside_slits(p: Provenance) -> BoolArray:
    """Faces of the reference with a corner on a curve that has the same patch on both sides."""
    origin = p.reference.origin
    order = np.lexsort((p.reference.tree.patch[p.features // 3], p.names))
    name, patch = p.names[order], p.reference.tree.patch[p.features[order] // 3]
    again = np.flatnonzero((name[1:] == name[:-1]) & (patch[1:] == patch[:-1]))
    on_non_manifold = np.zeros(len(p.reference.X), np.bool_)
    on_non_manifold[ends_of(origin, p.features[order[again]])] = True
    return np.asarray(on_non_manifold[origin].reshape(-1, 3).any(axis=1))


def _vertices_beside(mesh: Mesh, v: IntArray) -> BoolArray:
    """Mask of the vertices of all faces around some."""
    is_one = np.zeros(len(mesh.X), np.bool_)
    is_one[v] = True
    F = mesh.origin.reshape(-1, 3)
    mask = np.zeros(len(mesh.X), np.bool_)
    mask[F[(is_one[F] & (F != DEAD)).any(axis=1)]] = True
    return mask


def _path_lengths(
    p: Provenance, v: IntArray, w: IndexArray, start: NDArray[Any], face: IndexArray
) -> tuple[IndexArray, FloatArray]:
    """Measure paths from vertices ``w``, on faces ``start``, to the faces of vertices ``v``.

    Returns
    -------
    near : (k,) int32
        The face closest to ``v`` among those on short paths.
    length : (k,) float64
        Length of a path that crosses no curve, through a point of every edge on its way; inf where the
        face is far.
    """
    length, near = np.full(len(v), np.inf), start.astype(np.int32)
    seen = np.zeros(len(p.reference.tree.patch), np.int32)
    _find_paths(p.reference.tree, p.mesh.X, v, w, near, face, seen, length)
    return near, length


class _Paths(NamedTuple):
    """The faces that a search has found, in this order, and the paths to them."""

    face: IntArray  # (k,)
    entry: FloatArray  # (k, 3), where the path enters the face
    length: FloatArray  # (k,), up to there
    # The same in single precision, by which paths compare; equal ones in the order of `face`. Paths to
    # the faces around a vertex all end there, often, and are equally long but for rounding, which
    # differs from processor to processor; and the first decides where its neighbours are entered.
    key: NDArray[np.float32]  # (k,)
    is_settled: BoolArray  # (k,)


@kernel
def _find_paths(tree, X, vertices, starts, near, goals, seen, length):
    """Settle faces in the order of their paths [Dijkstra 1959]; ``near`` holds the first faces.

    Unlike there, a face is entered where it was first found, from the nearest of its neighbours.
    """
    paths = _Paths(
        np.empty(_NEARBY, np.int64),
        np.empty((_NEARBY, 3)),
        np.empty(_NEARBY),
        np.empty(_NEARBY, np.float32),
        np.empty(_NEARBY, np.bool_),
    )
    for i in range(vertices.size):
        v = vertices[i]
        goal = point(X, v)
        start = point(X, starts[i])
        limit = _DETOUR * _gap(start, goal)
        seen[near[i]] = i + 1
        _add_path(paths, 0, np.int64(near[i]), start, 0.0)
        size = 1
        best = np.inf
        for _ in range(_NEARBY):
            k = _shortest(paths, size)
            if k == size:
                break
            paths.is_settled[k] = True
            f = paths.face[k]
            if f == goals[v]:
                length[i] = paths.length[k] + _gap(point(paths.entry, k), goal)
                break
            if paths.length[k] <= limit:
                _, _, distance = face_distance(tree.corners, f, goal)
                if distance < best:
                    best = distance
                    near[i] = f
            for e in range(3):
                t = np.int64(tree.twin[3 * f + e])
                if t != NONE and seen[t // 3] != i + 1 and size < _NEARBY:
                    seen[t // 3] = i + 1
                    _extend_path(paths, k, size, tree.corners, e, t // 3, goal)
                    size += 1


@inlined
def _gap(a, b):
    """Distance between two points."""
    dx, dy, dz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return np.sqrt(dx * dx + dy * dy + dz * dz)


@inlined
def _shortest(paths, size):
    """Return the shortest of the paths to faces that are not settled, or ``size``."""
    k = size
    least = np.float32(np.inf)
    for j in range(size):
        if not paths.is_settled[j] and paths.key[j] < least:
            least = paths.key[j]
            k = j
    return k


@inlined
def _extend_path(paths, k, size, corners, e, f, goal):
    """Continue path ``k`` across edge ``e`` to a face.

    It crosses at the point of the edge that is closest to the middle between its last point and the goal.
    """
    last = point(paths.entry, k)
    a = corner(corners, paths.face[k], e)
    b = corner(corners, paths.face[k], (e + 1) % 3)
    middle = 0.5 * (last[0] + goal[0]), 0.5 * (last[1] + goal[1]), 0.5 * (last[2] + goal[2])
    s, _ = closest_on_segment(middle, a, b)
    at = a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])
    _add_path(paths, size, f, at, paths.length[k] + _gap(at, last))


@inlined
def _add_path(paths, k, f, at, length):
    paths.face[k] = f
    paths.entry[k, 0], paths.entry[k, 1], paths.entry[k, 2] = at
    paths.length[k] = length
    paths.key[k] = length
    paths.is_settled[k] = False
