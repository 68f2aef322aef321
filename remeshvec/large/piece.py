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
from ..mesh.blocks import make_blocks
from ..mesh.edges import edge_keys
from ..mesh.halfedge import build_mesh
from ..mesh.morton import order_mesh
from ..mesh.walk import ends_of
from ..operations.project import read_lengths
from ..reference.long_rims import LongRims
from .index import Index, boxes_of
from .reference_piece import ReferencePiece, read_reference
from .scratch import Arrays
from .vocabulary import SurfaceMesh, mark

__all__ = [
    "Piece",
    "boxes_with_lengths",
    "changed_faces",
    "new_chords",
    "read_piece",
    "recognise",
    "reset_lengths",
]

_BOX = 256  # faces of the mesh in a box

# Locked edges that are so many target lengths long raise these; to any length, in a frame below 2. With
# 2 in place of 4/3 splits do not end.
_LONG = 4.0 / 3.0
_ANY = 1e6


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
    _add_spare_valence(mesh, index)
    in_ring = np.isin(faces, ring)
    named = mesh.curve[mesh.curve >= 0]
    boxes = boxes_with_lengths(mesh.X, mesh.origin.reshape(-1, 3))
    reference = read_reference(index, boxes, np.concatenate([birth // 3, source, named // 3]))
    mesh.birth[:] = reference.local(birth)
    mesh.source[:] = reference.local(3 * source) // 3
    mesh.curve[:] = reference.local(mesh.curve)
    frozen = mark(len(vertices), mesh.origin.reshape(-1, 3)[in_ring])
    border_curve = _lock(mesh, frozen, in_ring)
    featured = reference.featured._replace(long_rims=_lengthen(mesh, reference))
    reference = reference._replace(featured=featured)
    return Piece(mesh, reference, vertices, frozen, in_ring, border_curve)


def _add_spare_valence(mesh: Mesh, index: Index) -> None:
    """Add what tips lack of six faces; tips stay where they are."""
    held = np.flatnonzero(mesh.kind == HELD)
    if not (len(held) and len(index.tips)):
        return
    points = np.concatenate([index.tips, mesh.X[held, :3]])
    _, place = np.unique(points.view(np.int64), axis=0, return_inverse=True)
    place = place.reshape(-1)
    spare = np.zeros(int(place.max()) + 1, np.int32)
    spare[place[: len(index.tips)]] = index.spare_valence
    mesh.valence_excess[held] += spare[place[len(index.tips) :]]


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


def _lengthen(mesh: Mesh, reference: ReferencePiece) -> LongRims | None:
    """Raise target lengths at locked edges that are much longer, and towards them.

    The edges of a face with a long locked side cannot all be short: they would be split for ever. Where
    locked edges are about as long as asked for, as they are after the first round, lengths stay.
    """
    h = np.flatnonzero(mesh.curve == FROZEN)
    a, b = ends_of(mesh.origin, h)
    length = np.linalg.norm(mesh.X[a, :3] - mesh.X[b, :3], axis=1)
    is_long = length > _LONG * 0.5 * (mesh.X[a, 3] + mesh.X[b, 3])
    if not is_long.any():
        return None
    a, b, length = a[is_long], b[is_long], length[is_long]
    rims = LongRims(
        mesh.X[a, :3], mesh.X[b, :3], np.full(len(reference.featured.reference.X), _ANY)
    )
    for end in (a, b):
        np.maximum.at(mesh.X[:, 3], end, length)
    return rims


# -- back to the whole ------------------------------------------------------------------------


class Changed(NamedTuple):
    """A piece after its sweeps, with what is known again of the mesh before."""

    mesh: Mesh  # compact
    vertices: IntArray  # (n,) vertex of the whole mesh for those of the ring, else ``NONE``
    ring: BoolArray  # (m,) faces of the ring


def recognise(piece: Piece, result: Mesh) -> Changed:
    """Find the ring in the result of a piece. Sweeps renumber faces and vertices, but leave it as it is.

    Its faces are told by the bits of their corners, and where several lie in one place by their order,
    which stays. Vertices alone would not do: those of two sheets may share a place.

    Raises
    ------
    RuntimeError
        The ring has changed.
    """
    ring = np.flatnonzero(piece.ring)
    locked = (result.curve == FROZEN).reshape(-1, 3).all(axis=1)
    candidates = np.flatnonzero(locked)
    keys = np.concatenate([_corner_bits(piece.mesh, ring), _corner_bits(result, candidates)])
    _, key = np.unique(keys, axis=0, return_inverse=True)
    key = key.reshape(-1)
    wanted, found = key[: len(ring)], key[len(ring) :]
    is_ring = np.isin(found, wanted)
    candidates, found = candidates[is_ring], found[is_ring]
    order, there = np.argsort(wanted, kind="stable"), np.argsort(found, kind="stable")
    if not np.array_equal(wanted[order], found[there]):
        raise RuntimeError("a task has changed faces that it must only see")
    vertices = np.full(len(result.kind), NONE, np.int64)
    before = piece.mesh.origin.reshape(-1, 3)[ring[order]]
    vertices[result.origin.reshape(-1, 3)[candidates[there]]] = piece.vertices[before]
    return Changed(result, vertices, mark(len(locked), candidates))


def _corner_bits(mesh: Mesh, faces: IntArray) -> NDArray[np.int64]:
    """Bits of the coordinates of all corners (k, 9)."""
    return mesh.X[mesh.origin.reshape(-1, 3)[faces], :3].reshape(-1, 9).view(np.int64)


def changed_faces(piece: Piece, changed: Changed) -> Arrays:
    """Return the faces that took the place of the core of a piece, in numbers of the whole.

    Returns
    -------
    arrays : dict
        ``F (k, 3)`` holds vertices of the ring as ``-1 - vertex`` and new ones as rows of ``X``,
        ``kind`` and ``birth``; ``curve (k, 3)`` and ``source (k,)``.
    """
    result, is_core = changed.mesh, ~changed.ring
    F = result.origin.reshape(-1, 3)[is_core]
    new = np.flatnonzero((changed.vertices == NONE) & mark(len(result.kind), F))
    reset_lengths(piece, result)
    number = -1 - changed.vertices
    number[new] = np.arange(len(new))
    h = np.flatnonzero(np.repeat(is_core, 3))
    return {
        "F": number[F],
        "X": result.X[new],
        "kind": result.kind[new],
        "birth": piece.reference.whole(result.birth[new]),
        "curve": _unlocked(piece, changed, h).reshape(-1, 3),
        "source": piece.reference.faces[result.source[is_core]].astype(np.int32),
    }


def reset_lengths(piece: Piece, result: Mesh) -> None:
    """Let target lengths be those of the reference again, where they were raised."""
    if piece.reference.featured.long_rims is None:
        return
    reference = piece.reference.featured.reference
    asked = reference.X[:, 3]
    if asked.min() == asked.max():
        result.X[result.kind != FIXED, 3] = asked[0]
    else:
        read_lengths(result, make_blocks(result), reference, False)


def _unlocked(piece: Piece, changed: Changed, h: IntArray) -> IndexArray:
    """Curves of half-edges in numbers of the whole; locks of the border are taken off."""
    border, result = _border(piece), changed.mesh
    known = _directed(piece.vertices[ends_of(piece.mesh.origin, border)])
    order = np.argsort(known)
    curve = result.curve[h].copy()
    locked = np.flatnonzero(curve == FROZEN)
    keys = _directed(changed.vertices[ends_of(result.origin, h[locked])])
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


def new_chords(piece: Piece, changed: Changed, shared: IntArray) -> IndexArray:
    """List new edges between two vertices that other parts see too, each by its later half-edge.

    Another part may have made an edge between the same two: together they would be one of four faces.
    """
    result, whole = changed.mesh, changed.vertices.copy()
    whole[~np.isin(whole, shared)] = NONE
    h = np.flatnonzero((result.twin < np.arange(len(result.twin))) & (result.curve != FROZEN))
    ends = whole[ends_of(result.origin, h)]
    both = (ends != NONE).all(axis=0)
    h, ends = h[both], ends[:, both]
    n, origin = int(piece.vertices.max()) + 1, piece.mesh.origin
    old = edge_keys(piece.vertices[ends_of(origin, np.arange(origin.size))], n)
    return np.asarray(h[~np.isin(edge_keys(ends, n), old)], np.int32)
