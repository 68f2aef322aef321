"""Split long edges: all long edges of a face at once, by template.

One round marks the long edges, counts, and writes the refined mesh into new arrays: children in the place
of their face, vertices and midpoints behind the half-edge that owns them. Rounds (3 or 4 in the first
sweep) go on until no edge is too long; in place, in half-edge order, splits would never end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, kernel, threaded
from ..core.geometry import distance_squared
from ..core.vocabulary import CURVE, DEAD, INNER, NONE, Blocks, IndexArray, IntArray, Mesh
from ..mesh.blocks import make_candidates, owns_all, per_block
from ..mesh.edge_curves import is_feature
from ..mesh.walk import corners_of, end_of
from .bisect import birth_between, bisect_edges
from .classify import REMOVED, EdgeFlags, classify_edges
from .templates import CORNER, COUNT, GAIN, PART, TWIN

__all__ = ["MAX_ROUNDS", "SPARE", "compact", "split_edges", "split_long_edges"]

# Every round halves the longest edge: 64 rounds divide any float64 length below any other.
MAX_ROUNDS = 64
# Where fewer edges than this share of the faces are long, they are split in place.
_FEW = 1.0 / 16.0

# Spare faces and vertices of a new mesh, as a share of its faces: two for every split.
SPARE = 2.0 * _FEW


class Numbering(NamedTuple):
    """Where the elements of a mesh go when it is written anew.

    Parameters
    ----------
    mask : (m,) uint8
        Template of every face in bits 0 to 3; bits 4 to 6 tell which of its corners follow it, being
        owned by its half-edges; ``REMOVED`` for a removed face.
    first_child : (m,) int32
        New number of the face, or of the first of its children.
    vertex : (n,) int32
        New number of the vertex.
    midpoint : (3 m,) int32
        New vertex in the middle of a split edge, at the later half-edge of the edge.
    end : (b + 1, 2) int64
        First new face and first new vertex of every block.
    """

    mask: NDArray[np.uint8]
    first_child: IndexArray
    vertex: IndexArray
    midpoint: IndexArray
    end: IntArray


def split_long_edges(
    mesh: Mesh,
    blocks: Blocks,
    factor: float,
    parallel: bool,
    siblings: tuple[IndexArray, IndexArray] | None = None,
    flags: EdgeFlags | None = None,
) -> tuple[Mesh, int]:
    """Split every edge longer than ``factor`` times its target length.

    Splits once, by writing the mesh anew; or, if the edges are few and there is space, in place until
    none is left. Siblings (see `polyline.find_siblings`) are split together. ``flags`` is the result of
    `classify_edges` for this mesh and factor, if it is known; splits in place keep it true.

    Returns
    -------
    mesh : Mesh
        The refined mesh in new arrays; the same mesh once no edge is too long any more.
    n_split : int
        Edges split.
    """
    if flags is None:
        flags = classify_edges(mesh, blocks, factor, 0.0, parallel)
    n_split = 0
    n_left = flags.n_long
    if siblings is not None:
        _request_siblings(flags.mask, *siblings)
    elif 2 * n_left <= flags.n_gone and n_left <= _FEW * len(flags.mask):
        n_split, n_left = bisect_edges(mesh, blocks, flags, parallel)
    if not n_left:
        return mesh, n_split
    mesh, more = _refine(mesh, blocks, flags.mask, parallel, SPARE)
    return mesh, n_split + more


def split_edges(mesh: Mesh, blocks: Blocks, edges: IndexArray, parallel: bool) -> Mesh:
    """Split the given half-edges, whatever their length."""
    requested = _request_nothing(mesh)
    np.bitwise_or.at(requested, edges // 3, (1 << (edges % 3)).astype(np.uint8))
    return _refine(mesh, blocks, requested, parallel)[0]


def compact(mesh: Mesh, blocks: Blocks, parallel: bool, spare: float = 0.0) -> Mesh:
    """Drop removed faces and vertices, keeping the order: a split of no edge.

    ``spare`` faces are left free for splits in place, as a share of the faces.
    """
    return _refine(mesh, blocks, _request_nothing(mesh), parallel, spare, False)[0]


def _request_nothing(mesh: Mesh) -> NDArray[np.uint8]:
    requested = np.zeros(mesh.origin.size // 3, np.uint8)
    requested[mesh.origin[::3] == DEAD] = REMOVED
    return requested


def _request_siblings(requested: NDArray[np.uint8], members: IndexArray, group: IndexArray) -> None:
    """Let all faces around an edge with siblings request its split if one face does."""
    if len(members):
        bit = (1 << (members % 3)).astype(np.uint8)
        wanted = np.bitwise_or.reduceat((requested[members // 3] & bit) != 0, group[:-1])
        wanted = np.repeat(wanted, np.diff(group))
        np.bitwise_or.at(requested, members[wanted] // 3, bit[wanted])


def _refine(
    mesh: Mesh,
    blocks: Blocks,
    requested: NDArray[np.uint8],
    parallel: bool,
    spare: float = 0.0,
    splits: bool = True,
) -> tuple[Mesh, int]:
    """Write the mesh anew with the requested edges split; returns their number too.

    ``spare`` faces are left free at the end of every block, as a share of its faces. ``splits`` tells
    whether any edge is requested.
    """
    mask = np.empty_like(requested)
    sizes = np.zeros((len(blocks.face) - 1, 3), np.int64)
    _mark_edges(parallel, mesh, blocks, requested, splits, mask, sizes)
    numbers = Numbering(
        mask,
        np.empty(mask.size, np.int32),
        np.empty(mesh.vertex_halfedge.size, np.int32),
        np.empty(mesh.origin.size, np.int32),
        _ends_of_blocks(sizes, spare),
    )
    _number_new(parallel, mesh, blocks, numbers)
    refined = _empty_mesh(*numbers.end[-1].tolist())
    _write_refined(parallel, mesh, blocks, numbers, refined)
    n_split = int(sizes[:, 2].sum())
    if n_split:
        across = make_candidates(blocks.face)
        _update_valences(parallel, mesh, blocks, numbers, refined.valence_excess, across)
        _update_valences_across(mesh, numbers, refined.valence_excess, across)
    return refined, n_split


def _ends_of_blocks(sizes: IntArray, spare: float) -> NDArray[np.int64]:
    """Lay the blocks of the new mesh end to end, each with its spare faces and half as many vertices."""
    end = np.zeros((len(sizes) + 1, 2), np.int64)
    free = (spare * sizes[:, 0]).astype(np.int64)
    np.cumsum(sizes[:, 0] + free, out=end[1:, 0])
    np.cumsum(sizes[:, 1] + sizes[:, 2] + free // 2, out=end[1:, 1])
    return end


def _empty_mesh(n_faces: int, n_vertices: int) -> Mesh:
    return Mesh(
        np.empty(3 * n_faces, np.int32),
        np.empty(3 * n_faces, np.int32),
        np.empty(3 * n_faces, np.int32),
        np.empty(n_faces, np.int32),
        np.empty(n_vertices, np.int32),
        np.empty(n_vertices, np.int32),
        np.empty((n_vertices, 4)),
        np.empty(n_vertices, np.uint8),
        np.empty(n_vertices, np.int32),
    )


@threaded(per_block)
def _mark_edges(span, mesh, blocks, requested, splits, mask, sizes):
    """Choose the template of every face, see `Numbering`: its edges that it or a neighbour wants split.

    ``sizes`` gets, per block, children, vertices owned, and edges split.
    """
    for k in range(span[0], span[1]):
        children = 0
        owned = 0
        split = 0
        for f in range(blocks.face[k], blocks.face[k + 1]):
            if requested[f] == REMOVED:
                mask[f] = REMOVED
                continue
            m = 7 & requested[f]
            if splits:
                for i in range(3):
                    h = 3 * f + i
                    t = mesh.twin[h]
                    if t != NONE:
                        g = t // 3
                        m |= ((requested[g] >> (t - 3 * g)) & 1) << i
                    split += ((m >> i) & 1) & (t < h)
                if m == 3 or m == 5 or m == 6:
                    m = _choose_diagonal(mesh, f, m)
            children += COUNT[m]
            for i in range(3):
                h = 3 * f + i
                is_owner = mesh.vertex_halfedge[mesh.origin[h]] == h
                owned += is_owner
                m |= is_owner * (16 << i)
            mask[f] = m
        sizes[k, 0] = children
        sizes[k, 1] = owned
        sizes[k, 2] = split


@inlined
def _choose_diagonal(mesh, f, m):
    """Add bit 3 where the shorter diagonal of the quad is the second one of the template.

    The shorter one ends at the midpoint of the longer of the two split edges: of two medians, the
    one to the longer edge is shorter.
    """
    a, b, c = corners_of(mesh.origin, f)
    l0 = distance_squared(mesh.X, a, b)
    l1 = distance_squared(mesh.X, b, c)
    l2 = distance_squared(mesh.X, c, a)
    if (m == 3 and l1 > l0) or (m == 6 and l2 > l1) or (m == 5 and l0 > l2):
        return m | 8
    return m


@threaded(per_block)
def _number_new(span, mesh, blocks, numbers):
    """Give children, vertices and midpoints the order of the half-edges that own them."""
    for k in range(span[0], span[1]):
        child = numbers.end[k, 0]
        vertex = numbers.end[k, 1]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            m = numbers.mask[f]
            if m == REMOVED:
                continue
            numbers.first_child[f] = child
            child += COUNT[m & 15]
            if m == 0:
                continue
            for i in range(3):
                h = 3 * f + i
                if (m >> (4 + i)) & 1:
                    numbers.vertex[mesh.origin[h]] = vertex
                    vertex += 1
                # The later half-edge of a pair owns the midpoint; one without twin is the later.
                if (m >> i) & 1 and mesh.twin[h] < h:
                    numbers.midpoint[h] = vertex
                    vertex += 1


@threaded(per_block)
def _write_refined(span, mesh, blocks, numbers, new):
    """Write the children of every face and the vertices that follow it, into arrays of their own."""
    for k in range(span[0], span[1]):
        ids = np.empty(6, np.int64)
        face = numbers.end[k, 0]
        vertex = numbers.end[k, 1]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            flags = numbers.mask[f]
            if flags == REMOVED:
                continue
            m = flags & 15
            if m == 0:  # most faces
                _copy_face(mesh, f, numbers, new)
            else:
                _write_children(mesh, f, m, ids, numbers, new)
            face = numbers.first_child[f] + COUNT[m]
            if flags != 0:
                vertex = _write_vertices(mesh, f, flags, vertex, numbers, new)
        _mark_spare(new, (face, numbers.end[k + 1, 0]), (vertex, numbers.end[k + 1, 1]))


@inlined
def _copy_face(mesh, f, numbers, new):
    """Write a face without split edges."""
    base = 3 * numbers.first_child[f]
    for i in range(3):
        h = 3 * f + i
        new.origin[base + i] = numbers.vertex[mesh.origin[h]]
        new.twin[base + i] = _part_of(mesh.twin[h], 0, numbers)
        new.curve[base + i] = mesh.curve[h]
    new.source[base // 3] = mesh.source[f]


@inlined
def _write_children(mesh, f, m, ids, numbers, new):
    """Write children and their twins: inside a template from its table, across by parts of edges."""
    first = numbers.first_child[f]
    base = 3 * first
    for i in range(3):
        h = 3 * f + i
        ids[i] = numbers.vertex[mesh.origin[h]]
        if (m >> i) & 1:
            ids[3 + i] = numbers.midpoint[max(h, mesh.twin[h])]
    for j in range(COUNT[m]):
        new.source[first + j] = mesh.source[f]
    for j in range(3 * COUNT[m]):
        new.curve[base + j] = NONE
        new.origin[base + j] = ids[CORNER[m, j]]
        new.twin[base + j] = base + TWIN[m, j] if TWIN[m, j] >= 0 else NONE
    for i in range(3):
        # Halves meet crosswise: the first of this side lies on the second of the other.
        half = (m >> i) & 1
        t = mesh.twin[3 * f + i]
        new.twin[base + PART[m, 2 * i]] = _part_of(t, half, numbers)
        new.curve[base + PART[m, 2 * i]] = mesh.curve[3 * f + i]
        if half:
            new.twin[base + PART[m, 2 * i + 1]] = _part_of(t, 0, numbers)
            new.curve[base + PART[m, 2 * i + 1]] = mesh.curve[3 * f + i]


@inlined
def _part_of(h, half, numbers):
    """Return the place in the new mesh of a half-edge, or of its second half."""
    if h == NONE:
        return NONE
    f = h // 3
    i = h - 3 * f
    m = numbers.mask[f] & 15
    return 3 * numbers.first_child[f] + (i if m == 0 else PART[m, 2 * i + half])


@inlined
def _write_vertices(mesh, f, flags, vertex, numbers, new):
    """Write the vertices that follow a face; returns the first new vertex not yet written."""
    m = flags & 15
    base = 3 * numbers.first_child[f]
    for i in range(3):
        h = 3 * f + i
        if (flags >> (4 + i)) & 1:
            v = mesh.origin[h]
            u = numbers.vertex[v]
            vertex = u + 1
            new.vertex_halfedge[u] = base + (i if m == 0 else PART[m, 2 * i])
            new.valence_excess[u] = mesh.valence_excess[v]
            new.kind[u] = mesh.kind[v]
            new.birth[u] = mesh.birth[v]
            for j in range(4):
                new.X[u, j] = mesh.X[v, j]
        if (m >> i) & 1 and mesh.twin[h] < h:
            u = numbers.midpoint[h]
            vertex = u + 1
            new.vertex_halfedge[u] = base + PART[m, 2 * i + 1]
            _write_midpoint(mesh, h, u, new)
    return vertex


@inlined
def _write_midpoint(mesh, h, u, new):
    """Write vertex ``u`` in the middle of an edge."""
    v, w = mesh.origin[h], end_of(mesh.origin, h)
    # No face yet: `_update_valences` adds them. A boundary has an edge more.
    new.valence_excess[u] = -6 if mesh.twin[h] != NONE else -3
    new.kind[u] = CURVE if is_feature(mesh.curve[h]) else INNER
    new.birth[u] = birth_between(mesh, h, v, w)
    for j in range(4):
        new.X[u, j] = 0.5 * (mesh.X[v, j] + mesh.X[w, j])


@inlined
def _mark_spare(new, faces, vertices):
    """Mark the ranges of faces and vertices that a block has spare as dead."""
    new.origin[3 * faces[0] : 3 * faces[1]] = DEAD
    for v in range(vertices[0], vertices[1]):
        new.vertex_halfedge[v] = DEAD
        new.kind[v] = INNER
        new.birth[v] = 0
        new.X[v] = 1.0


@threaded(per_block)
def _update_valences(span, mesh, blocks, numbers, excess, across):
    """Add the edges that the children of split faces bring.

    Lists the faces whose vertices do not all belong to the block; a midpoint belongs to the block of
    both ends of its edge.
    """
    for k in range(span[0], span[1]):
        owned = blocks.vertex[k], blocks.vertex[k + 1]
        end = across.starts[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            m = numbers.mask[f] & 15
            if m == 0 or numbers.mask[f] == REMOVED:
                continue
            a, b, c = corners_of(mesh.origin, f)
            if owns_all(owned, a, b, c):
                _add_gains(mesh, f, m, numbers, excess)
            else:
                across.items[end] = f
                end += 1
        across.counts[k] = end - across.starts[k]


@kernel
def _update_valences_across(mesh, numbers, excess, across):
    """Add the edges of the faces that `_update_valences` has listed, on one thread."""
    for k in range(across.counts.size):
        for i in range(across.starts[k], across.starts[k] + across.counts[k]):
            f = across.items[i]
            _add_gains(mesh, f, numbers.mask[f] & 15, numbers, excess)


@inlined
def _add_gains(mesh, f, m, numbers, excess):
    """Add the gains of a split face to its corners and midpoints."""
    for i in range(3):
        h = 3 * f + i
        excess[numbers.vertex[mesh.origin[h]]] += GAIN[m, i]
        if (m >> i) & 1:
            excess[numbers.midpoint[max(h, mesh.twin[h])]] += GAIN[m, 3 + i]
