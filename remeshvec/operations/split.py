"""Split long edges: all long edges of a face at once, by template.

One round marks the edges that are too long, counts, and writes the refined mesh into new arrays, so
that compaction and vertex order come for free: children take the place of their face, vertices follow
the half-edge that owns them (``vertex_halfedge``), midpoints follow theirs. Rounds go on until no edge
is too long, 3 or 4 in the first sweep, 1 later; each halves the longest edge. Splitting in place in
half-edge order never ends: a long neighbour moves to a new slot again and again.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import inlined, kernel, threaded
from ..core.geometry import distance_squared
from ..core.vocabulary import CURVE, DEAD, INNER, NONE, Blocks, IndexArray, Mesh
from ..mesh.blocks import per_block
from .bisect import birth_between, bisect_edges
from .classify import REMOVED, EdgeFlags, classify_edges
from .templates import CORNER, COUNT, GAIN, PART, TWIN

__all__ = ["MAX_ROUNDS", "SPARE", "compact", "split_edges", "split_long_edges"]

# Every round halves the longest edge: 64 rounds divide any float64 length below any other.
MAX_ROUNDS = 64

# Where fewer edges than this share of the faces are long, they are split in place.
_FEW = 1.0 / 16.0

# Faces and vertices that a new mesh has room for, as a share of its faces: two for every split.
SPARE = 2.0 * _FEW


def split_long_edges(
    mesh: Mesh,
    blocks: Blocks,
    factor: float,
    parallel: bool,
    siblings: tuple[IndexArray, IndexArray] | None = None,
    flags: EdgeFlags | None = None,
) -> tuple[Mesh, int]:
    """Split every edge longer than ``factor`` times its target length.

    Once, by writing the mesh anew; or, where they are few and there is room, in place until none is left.
    Siblings (see `polyline.find_siblings`) are split together. ``flags`` are what `classify_edges`
    says of this mesh and factor, where that is known; of a mesh that is split in place they stay true.

    Returns
    -------
    mesh : Mesh
        The refined mesh in new arrays; the same one where no edge is too long any more.
    n_split : int
        Edges split.
    """
    if flags is None:
        flags = classify_edges(mesh, blocks, factor, 0.0, parallel)
    n_split = 0
    n_left = flags.n_long
    if siblings is not None:
        _ask_siblings(flags.mask, *siblings)
    elif 2 * n_left <= flags.n_gone and n_left <= _FEW * len(flags.mask):
        n_split, n_left = bisect_edges(mesh, blocks, flags, parallel)
    if not n_left:
        return mesh, n_split
    mesh, more = _refine(mesh, blocks, flags.mask, parallel, SPARE)
    return mesh, n_split + more


def split_edges(mesh: Mesh, blocks: Blocks, edges: IndexArray, parallel: bool) -> Mesh:
    """Split the given half-edges, whatever their length."""
    requested = np.zeros(mesh.origin.size // 3, np.uint8)
    requested[mesh.origin[::3] == DEAD] = REMOVED
    np.bitwise_or.at(requested, edges // 3, (1 << (edges % 3)).astype(np.uint8))
    return _refine(mesh, blocks, requested, parallel)[0]


def _ask_siblings(requested: np.ndarray, members: IndexArray, group: IndexArray) -> None:
    """Let all faces around an edge with siblings ask for its split if one does."""
    if len(members):
        bit = (1 << (members % 3)).astype(np.uint8)
        wanted = np.bitwise_or.reduceat((requested[members // 3] & bit) != 0, group[:-1])
        wanted = np.repeat(wanted, np.diff(group))
        np.bitwise_or.at(requested, members[wanted] // 3, bit[wanted])


def compact(mesh: Mesh, blocks: Blocks, parallel: bool, room: float = 0.0) -> Mesh:
    """Drop removed faces and vertices, keeping the order: a split of no edge.

    ``room`` is left free for splits in place, as a share of the faces.
    """
    requested = np.zeros(mesh.origin.size // 3, np.uint8)
    requested[mesh.origin[::3] == DEAD] = REMOVED
    return _refine(mesh, blocks, requested, parallel, room, False)[0]


def _refine(
    mesh: Mesh,
    blocks: Blocks,
    requested: np.ndarray,
    parallel: bool,
    room: float = 0.0,
    splits: bool = True,
) -> tuple[Mesh, int]:
    """Write the mesh anew with the edges split that any face asks for; returns their number too.

    ``room`` is left free at the end of every block, as a share of its faces. ``splits`` says whether
    any edge is asked for.
    """
    mask = np.empty_like(requested)
    sizes = np.zeros((len(blocks.face) - 1, 3), np.int64)
    _mark_edges(parallel, mesh, blocks, requested, splits, mask, sizes)
    ends = np.zeros((len(sizes) + 1, 2), np.int64)
    free = (room * sizes[:, 0]).astype(np.int64)
    np.cumsum(sizes[:, 0] + free, out=ends[1:, 0])
    np.cumsum(sizes[:, 1] + sizes[:, 2] + free // 2, out=ends[1:, 1])
    n_faces, n_vertices = ends[-1].tolist()
    n_split = int(sizes[:, 2].sum())
    first_child = np.empty(mask.size, np.int32)
    new_vertex = np.empty(mesh.vertex_halfedge.size, np.int32)
    middle = np.empty(mesh.origin.size, np.int32)
    refined = Mesh(
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
    _number_new(parallel, mesh, blocks, mask, ends, first_child, new_vertex, middle)
    numbers = (mask, first_child, new_vertex, middle)
    _write_refined(parallel, mesh, blocks, ends, *numbers, *refined)
    if n_split:
        across, count = np.empty(mask.size, np.int32), np.zeros(len(sizes), np.int64)
        changes = (mask, new_vertex, middle, refined.valence_excess, across, count)
        _update_valences(parallel, mesh, blocks, *changes)
        _update_valences_across(mesh, blocks, *changes)
    return refined, n_split


@threaded(per_block)
def _mark_edges(span, mesh, blocks, requested, splits, mask, sizes):
    """Template of every face: mask of the edges that it or a neighbour wants split, and the diagonal.

    Bits 4 to 6 say which of the corners' vertices follow this face. Sizes per block: children, vertices
    owned, edges split.
    """
    for k in range(span[0], span[1]):
        children = 0
        owned = 0
        split = 0
        for f in range(blocks.face[k], blocks.face[k + 1]):
            m = np.int64(requested[f])
            if m == REMOVED:
                mask[f] = REMOVED
                continue
            m &= 7
            if splits:
                for i in range(3):
                    h = 3 * f + i
                    t = np.int64(mesh.twin[h])
                    if t != NONE:
                        g = t // 3
                        m |= ((np.int64(requested[g]) >> (t - 3 * g)) & 1) << i
                    split += ((m >> i) & 1) & (t < h)
                if m == 3 or m == 5 or m == 6:
                    m = _choose_diagonal(mesh, f, m)
            children += COUNT[m]
            for i in range(3):
                h = 3 * f + i
                is_owner = np.int64(mesh.vertex_halfedge[mesh.origin[h]] == h)
                owned += is_owner
                m |= is_owner << (4 + i)
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
    a, b, c = mesh.origin[3 * f], mesh.origin[3 * f + 1], mesh.origin[3 * f + 2]
    l0 = distance_squared(mesh.X, a, b)
    l1 = distance_squared(mesh.X, b, c)
    l2 = distance_squared(mesh.X, c, a)
    if (m == 3 and l1 > l0) or (m == 6 and l2 > l1) or (m == 5 and l0 > l2):
        return m | 8
    return m


@threaded(per_block)
def _number_new(span, mesh, blocks, mask, ends, first_child, new_vertex, middle):
    """Give children, vertices and midpoints the order of the half-edges that own them."""
    for k in range(span[0], span[1]):
        child = ends[k, 0]
        vertex = ends[k, 1]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            m = np.int64(mask[f])
            if m == REMOVED:
                continue
            first_child[f] = child
            child += COUNT[m & 15]
            if m == 0:
                continue
            for i in range(3):
                h = 3 * f + i
                if (m >> (4 + i)) & 1:
                    new_vertex[mesh.origin[h]] = vertex
                    vertex += 1
                # The later half-edge of a pair owns the midpoint; one without twin is the later.
                if (m >> i) & 1 and mesh.twin[h] < h:
                    middle[h] = vertex
                    vertex += 1


@threaded(per_block)
def _write_refined(
    span, mesh, blocks, ends, mask, first_child, new_vertex, middle,
    origin, twin, curve, source, halfedge, excess, X, kind, birth,
):  # fmt: skip
    """Write the children of every face and the vertices that follow it; what is left free is dead."""
    for k in range(span[0], span[1]):
        ids = np.empty(6, np.int64)
        face = ends[k, 0]
        vertex = ends[k, 1]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            m = np.int64(mask[f])
            if m == REMOVED:
                continue
            owned = m >> 4
            m &= 15
            base = 3 * np.int64(first_child[f])
            face = first_child[f] + COUNT[m]
            if m == 0:  # most faces: a copy
                for i in range(3):
                    origin[base + i] = new_vertex[mesh.origin[3 * f + i]]
                    twin[base + i] = _part_of(mesh.twin[3 * f + i], 0, mask, first_child)
                    curve[base + i] = mesh.curve[3 * f + i]
                source[base // 3] = mesh.source[f]
            else:
                for i in range(3):
                    h = 3 * f + i
                    ids[i] = new_vertex[mesh.origin[h]]
                    if (m >> i) & 1:
                        ids[3 + i] = middle[max(h, np.int64(mesh.twin[h]))]
                _write_children(
                    mesh, f, m, base, ids, mask, first_child, origin, twin, curve, source
                )
            if owned == 0 and m == 0:
                continue
            for i in range(3):
                h = 3 * f + i
                v = mesh.origin[h]
                if (owned >> i) & 1:
                    new = new_vertex[v]
                    vertex = np.int64(new) + 1
                    halfedge[new] = base + (i if m == 0 else PART[m, 2 * i])
                    excess[new] = mesh.valence_excess[v]
                    kind[new] = mesh.kind[v]
                    birth[new] = mesh.birth[v]
                    for j in range(4):
                        X[new, j] = mesh.X[v, j]
                if (m >> i) & 1 and mesh.twin[h] < h:
                    new = middle[h]
                    vertex = np.int64(new) + 1
                    w = mesh.origin[3 * f + (i + 1) % 3]
                    halfedge[new] = base + PART[m, 2 * i + 1]
                    # No face yet: `_update_valences` adds them. A boundary has an edge more.
                    excess[new] = -6 if mesh.twin[h] != NONE else -3
                    kind[new] = INNER if mesh.curve[h] == NONE else CURVE
                    birth[new] = birth_between(mesh, h, v, w)
                    for j in range(4):
                        X[new, j] = 0.5 * (mesh.X[v, j] + mesh.X[w, j])
        origin[3 * face : 3 * ends[k + 1, 0]] = DEAD
        for v in range(vertex, ends[k + 1, 1]):
            halfedge[v] = DEAD
            kind[v] = INNER
            birth[v] = 0
            X[v] = 1.0


@inlined
def _write_children(mesh, f, m, base, ids, mask, first_child, origin, twin, curve, source):
    """Write children and their twins: inside a template from its table, across by parts of edges."""
    for j in range(COUNT[m]):
        source[base // 3 + j] = mesh.source[f]
    for j in range(3 * COUNT[m]):
        curve[base + j] = NONE
        origin[base + j] = ids[CORNER[m, j]]
        twin[base + j] = base + TWIN[m, j] if TWIN[m, j] >= 0 else NONE
    for i in range(3):
        # Halves meet crosswise: the first of this side lies on the second of the other.
        half = (m >> i) & 1
        t = mesh.twin[3 * f + i]
        twin[base + PART[m, 2 * i]] = _part_of(t, half, mask, first_child)
        curve[base + PART[m, 2 * i]] = mesh.curve[3 * f + i]
        if half:
            twin[base + PART[m, 2 * i + 1]] = _part_of(t, 0, mask, first_child)
            curve[base + PART[m, 2 * i + 1]] = mesh.curve[3 * f + i]


@inlined
def _part_of(h, half, mask, first_child):
    """Place in the refined mesh of a half-edge, or of its second half."""
    if h == NONE:
        return np.int64(NONE)
    f = np.int64(h) // 3
    i = np.int64(h) - 3 * f
    m = np.int64(mask[f]) & 15
    return 3 * np.int64(first_child[f]) + (i if m == 0 else PART[m, 2 * i + half])


@threaded(per_block)
def _update_valences(span, mesh, blocks, mask, new_vertex, middle, excess, across, count):
    """Add what the children of split faces bring; lists the faces whose vertices are not all the block's.

    A midpoint belongs to the block of both ends of its edge.
    """
    for k in range(span[0], span[1]):
        low = blocks.vertex[k]
        high = blocks.vertex[k + 1]
        end = blocks.face[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            m = np.int64(mask[f]) & 15
            if m == 0 or mask[f] == REMOVED:
                continue
            a, b, c = mesh.origin[3 * f], mesh.origin[3 * f + 1], mesh.origin[3 * f + 2]
            if min(a, b, c) >= low and max(a, b, c) < high:
                _add_gains(mesh, f, m, new_vertex, middle, excess)
            else:
                across[end] = f
                end += 1
        count[k] = end - blocks.face[k]


@kernel
def _update_valences_across(mesh, blocks, mask, new_vertex, middle, excess, across, count):
    for k in range(blocks.face.size - 1):
        for i in range(blocks.face[k], blocks.face[k] + count[k]):
            f = np.int64(across[i])
            _add_gains(mesh, f, np.int64(mask[f]) & 15, new_vertex, middle, excess)


@inlined
def _add_gains(mesh, f, m, new_vertex, middle, excess):
    for i in range(3):
        h = 3 * f + i
        excess[new_vertex[mesh.origin[h]]] += GAIN[m, i]
        if (m >> i) & 1:
            excess[middle[max(h, np.int64(mesh.twin[h]))]] += GAIN[m, 3 + i]
