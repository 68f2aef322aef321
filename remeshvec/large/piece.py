"""A piece of the mesh for one task: the faces that it may change, and a frozen ring around them.

Vertices of the ring are held, its edges are locked, so the sweeps need no other rule. Every vertex that
may change has all of its faces in the piece. The outer border of the ring is no boundary of the surface:
it is locked too.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import (
    CURVE,
    FIXED,
    FROZEN,
    HELD,
    INNER,
    NONE,
    PINNED,
    BoolArray,
    FloatArray,
    IndexArray,
    IntArray,
    Mesh,
)
from ..mesh.edges import edge_keys
from ..mesh.halfedge import build_mesh
from ..mesh.morton import order_mesh
from ..mesh.walk import ends_of
from .index import Index, boxes_of
from .reference_piece import ReferencePiece, read_reference
from .scratch import Arrays
from .vocabulary import SurfaceMesh, mark

__all__ = ["Piece", "boxes_with_lengths", "changed_faces", "new_chords", "read_piece"]

_BOX = 256  # faces of the mesh in a box


class Piece(NamedTuple):
    """A piece of the mesh with half-edges and births of its own piece of the reference."""

    mesh: Mesh
    reference: ReferencePiece
    vertices: IntArray  # (n,) vertex of the whole mesh
    frozen: BoolArray  # (n,) vertices of the ring
    ring: BoolArray  # (m,) faces of the ring
    border_curve: IndexArray  # (3 m,) curves of edges between core and ring before they were locked


def read_piece(whole: SurfaceMesh, index: Index, core: IntArray, ring: IntArray) -> Piece:
    """Read the faces of a part and the ring around them, and the reference below."""
    faces = np.sort(np.concatenate([core, ring]))
    vertices, corners = np.unique(whole.F[faces], return_inverse=True)
    F = np.ascontiguousarray(corners.reshape(-1, 3), np.int32)
    points = np.ascontiguousarray(whole.X[vertices, :3])
    ordered = order_mesh(points, F, False)
    mesh, _, copied = build_mesh(ordered.X, ordered.F, owned=True)
    vertices = vertices[ordered.vertex_source[copied]].astype(np.int64)
    faces = faces[ordered.face_source]
    mesh.X[:, 3] = whole.X[vertices, 3]
    mesh.kind[:] = whole.kind[vertices]
    mesh.curve[:] = whole.curve[faces].ravel()
    birth, source = whole.birth[vertices], whole.source[faces]
    _add_spare_valence(mesh, index, birth)
    in_ring = np.isin(faces, ring)
    named = mesh.curve[mesh.curve >= 0]
    boxes = boxes_with_lengths(mesh.X, mesh.origin.reshape(-1, 3))
    reference = read_reference(index, boxes, np.concatenate([birth // 3, source, named // 3]))
    mesh.birth[:] = reference.local(birth)
    mesh.source[:] = reference.local(3 * source) // 3
    mesh.curve[:] = reference.local(mesh.curve)
    frozen = mark(len(vertices), mesh.origin.reshape(-1, 3)[in_ring])
    border_curve = _lock(mesh, frozen, in_ring)
    return Piece(mesh, reference, vertices, frozen, in_ring, border_curve)


def _add_spare_valence(mesh: Mesh, index: Index, birth: IndexArray) -> None:
    """Add what tips lack of six faces; a tip keeps its birth as long as it is held."""
    held = np.flatnonzero(mesh.kind == HELD)
    if not (len(held) and len(index.tips)):
        return
    order = np.argsort(index.tips)
    tips = index.tips[order]
    place = np.minimum(np.searchsorted(tips, birth[held]), len(tips) - 1)
    is_tip = tips[place] == birth[held]
    mesh.valence_excess[held[is_tip]] += index.spare_valence[order][place[is_tip]]


def boxes_with_lengths(X: FloatArray, F: IndexArray) -> FloatArray:
    """Boxes (k, 7) around runs of faces, with the largest target length in each."""
    starts = np.arange(0, len(F), _BOX)
    longest = np.maximum.reduceat(X[F, 3].max(axis=1), starts)
    return np.column_stack([boxes_of(X, F, _BOX), longest])


def _lock(mesh: Mesh, frozen: BoolArray, in_ring: BoolArray) -> IndexArray:
    """Hold the vertices of the ring and lock its edges; returns curves of the border edges before."""
    mesh.kind[frozen & (mesh.kind == INNER)] = HELD
    mesh.kind[frozen & (mesh.kind == CURVE)] = PINNED
    h = np.flatnonzero(np.repeat(in_ring, 3))
    twins = mesh.twin[h]
    twins = twins[twins != NONE]
    border = twins[~in_ring[twins // 3]]
    before = np.full(len(mesh.curve), NONE, np.int32)
    before[border] = mesh.curve[border]
    mesh.curve[h] = FROZEN
    mesh.curve[twins] = FROZEN
    return before


# -- back to the whole ------------------------------------------------------------------------


def changed_faces(piece: Piece, result: Mesh) -> Arrays:
    """Return the faces that took the place of the core of a piece, in numbers of the whole.

    Parameters
    ----------
    piece : Piece
    result : Mesh
        The piece after the sweeps, compact.

    Returns
    -------
    arrays : dict
        ``F (k, 3)`` holds vertices of the ring as ``-1 - vertex`` and new ones as rows of ``X``,
        ``kind`` and ``birth``; ``curve (k, 3)`` and ``source (k,)``.

    Raises
    ------
    RuntimeError
        A vertex of the ring has not stayed.
    """
    whole = _whole_vertices(piece, result)
    F = result.origin.reshape(-1, 3)
    is_core = ~_same_faces(whole[F], piece.vertices[piece.mesh.origin.reshape(-1, 3)[piece.ring]])
    if len(F) - int(is_core.sum()) != int(piece.ring.sum()):
        raise RuntimeError("a task has changed faces that it must only see")
    F = F[is_core]
    new = np.flatnonzero((whole == NONE) & mark(len(whole), F))
    number = -1 - whole
    number[new] = np.arange(len(new))
    return {
        "F": number[F],
        "X": result.X[new],
        "kind": result.kind[new],
        "birth": piece.reference.whole(result.birth[new]),
        "curve": _unlocked(piece, whole, result, np.flatnonzero(np.repeat(is_core, 3))).reshape(
            -1, 3
        ),
        "source": piece.reference.faces[result.source[is_core]].astype(np.int32),
    }


def _whole_vertices(piece: Piece, result: Mesh) -> IntArray:
    """Vertices of the whole mesh that vertices of the result are; ``NONE`` for those of the core.

    The sweeps renumber vertices. Held ones are told by their place and their birth, which stay.
    """
    frozen = np.flatnonzero(piece.frozen)
    held = np.flatnonzero(np.isin(result.kind, (HELD, PINNED, FIXED)))
    keys = np.concatenate([_keys(piece.mesh, frozen), _keys(result, held)])
    _, key = np.unique(keys, axis=0, return_inverse=True)
    key = key.reshape(-1)
    known = np.full(int(key.max(initial=-1)) + 1, NONE, np.int64)
    known[key[: len(frozen)]] = piece.vertices[frozen]
    whole = np.full(len(result.kind), NONE, np.int64)
    whole[held] = known[key[len(frozen) :]]
    found = np.unique(whole[whole != NONE])
    if not np.array_equal(found, np.unique(piece.vertices[frozen])):
        raise RuntimeError("a task has moved vertices that it must only see")
    return whole


def _keys(mesh: Mesh, v: NDArray[Any]) -> NDArray[np.int64]:
    """Bits of coordinates, and births (k, 4)."""
    return np.column_stack([mesh.X[v, :3].view(np.int64), mesh.birth[v].astype(np.int64)])


def _same_faces(F: IntArray, known: IntArray) -> BoolArray:
    """Mark the faces that are among others, in the same winding; ``NONE`` is no vertex of theirs."""
    vertices = np.unique(known)
    place = np.searchsorted(vertices, F)
    place[place == len(vertices)] = 0
    is_near = (vertices[place] == F).all(axis=1) if len(vertices) else np.zeros(len(F), np.bool_)
    keys = _face_keys(np.searchsorted(vertices, known), len(vertices))
    found = np.zeros(len(F), np.bool_)
    found[is_near] = np.isin(_face_keys(place[is_near], len(vertices)), keys)
    return found


def _face_keys(F: IntArray, n: int) -> IntArray:
    """One number per face of less than two million vertices, from whichever corner it starts."""
    first = F.argmin(axis=1)
    a, b, c = (F[np.arange(len(F)), (first + i) % 3].astype(np.int64) for i in range(3))
    return np.asarray((a * n + b) * n + c)


def _unlocked(piece: Piece, whole: IntArray, result: Mesh, h: IntArray) -> IndexArray:
    """Curves of half-edges in numbers of the whole; locks of the border are taken off."""
    border = _border(piece)
    known = _directed(piece.vertices[ends_of(piece.mesh.origin, border)])
    order = np.argsort(known)
    curve = result.curve[h].copy()
    locked = np.flatnonzero(curve == FROZEN)
    keys = _directed(whole[ends_of(result.origin, h[locked])])
    if len(known):
        place = np.minimum(np.searchsorted(known[order], keys), len(known) - 1)
        is_border = known[order][place] == keys
        curve[locked[is_border]] = piece.border_curve[border[order[place[is_border]]]]
    return piece.reference.whole(curve)


def _border(piece: Piece) -> IntArray:
    """Half-edges of core faces whose twins lie in the ring."""
    twin = piece.mesh.twin
    h = np.flatnonzero(np.repeat(~piece.ring, 3) & (twin != NONE))
    return np.asarray(h[piece.ring[twin[h] // 3]])


def _directed(ends: NDArray[Any]) -> IntArray:
    """One number per pair of vertices, in their order; ends that are ``NONE`` match nothing."""
    return np.asarray((ends[0].astype(np.int64) << 31) + ends[1])


def new_chords(piece: Piece, result: Mesh, shared: IntArray) -> IndexArray:
    """List new edges between two vertices that other parts see too, each by its later half-edge.

    Another part may have made an edge between the same two: together they would be one of four faces.
    """
    whole = _whole_vertices(piece, result)
    whole[~np.isin(whole, shared)] = NONE
    h = np.flatnonzero((result.twin < np.arange(len(result.twin))) & (result.curve != FROZEN))
    ends = whole[ends_of(result.origin, h)]
    both = (ends != NONE).all(axis=0)
    h, ends = h[both], ends[:, both]
    n = int(piece.vertices.max()) + 1
    origin = piece.mesh.origin
    old = edge_keys(piece.vertices[ends_of(origin, np.arange(origin.size))], n)
    return np.asarray(h[~np.isin(edge_keys(ends, n), old)], np.int32)
