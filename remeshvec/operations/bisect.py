"""Bisect: split the few long edges of later sweeps in place, in the room that collapses left.

Writing the whole mesh anew for a handful of splits took most of the time of the later sweeps. Here an
edge is cut at its midpoint, its faces are halved, and vertex and faces go where dead ones lie, in the
same block. A split owns the four vertices of its quad.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.vocabulary import CURVE, DEAD, FIXED, HELD, INNER, NON_MANIFOLD, NONE, Blocks, Mesh
from ..mesh.blocks import face_range, list_range, per_stage_block, stages, vertex_range
from ..mesh.walk import next_halfedge, previous_halfedge
from .classify import REMOVED, EdgeFlags, edge_flags

__all__ = ["birth_between", "bisect_edges"]


def bisect_edges(mesh: Mesh, blocks: Blocks, flags: EdgeFlags, parallel: bool) -> tuple[int, int]:
    """Split all long edges until there are none, or no room; returns how many were, and are left.

    ``flags.mask`` is kept up to date: it says of the mesh afterwards what it said of that before.
    """
    n_split = 0
    while True:
        done = np.zeros(len(blocks.face) - 1, np.int64)
        for stage in stages(blocks):
            left = np.zeros(len(done), np.int64)
            _bisect(
                parallel, mesh, blocks, stage, 0.5 * flags.longest, 2.0 * flags.shortest,
                flags.mask, done, left,
            )  # fmt: skip
            if not left.any():
                break
        n_split += int(done.sum())
        n_left = int(left.sum())
        if not n_left or not done.any():
            return n_split, n_left


@threaded(per_stage_block)
def _bisect(span, mesh, blocks, stage, half_longest, twice_shortest, mask, done, left):
    for k in range(span[0], span[1]):
        low, high = vertex_range(blocks, stage, k)
        first, end = list_range(blocks, stage, k)
        room, room_end = face_range(blocks, stage, k)
        v = low
        for f in range(blocks.face[first], blocks.face[end]):
            if mask[f] & 7 == 0 or mask[f] == REMOVED:
                continue
            for i in range(3):
                if not (mask[f] >> i) & 1:
                    continue
                h = 3 * f + i
                is_inner = mesh.twin[h] != NONE
                if not _is_owned(mesh, h, low, high):
                    left[k] += 1
                    continue
                v = _next_dead(mesh.vertex_halfedge, 1, v, high)
                room = _next_dead(mesh.origin, 3, room, room_end)
                other = _next_dead(mesh.origin, 3, room + 1, room_end) if is_inner else room
                if v == high or max(room, other) >= room_end:
                    left[k] += 1
                    continue
                done[k] += 1
                left[k] += _split_edge(mesh, h, v, room, other, half_longest, twice_shortest, mask)


@inlined
def _next_dead(array, stride, start, end):
    while start < end and array[stride * start] != DEAD:
        start += 1
    return start


@inlined
def _is_owned(mesh, h, low, high):
    """Tell whether all corners of the faces beside an edge lie in a range."""
    a = mesh.origin[h]
    b = mesh.origin[next_halfedge(h)]
    c = mesh.origin[previous_halfedge(h)]
    if min(a, b, c) < low or max(a, b, c) >= high:
        return False
    t = np.int64(mesh.twin[h])
    if t == NONE:
        return True
    d = mesh.origin[previous_halfedge(t)]
    return low <= d < high


@inlined
def _split_edge(mesh, h, v, f, g, half_longest, twice_shortest, mask):
    """Put vertex ``v`` in the middle of an edge, with new faces ``f`` and, across it, ``g``.

    Tells whether one of the four faces wants more splits.
    """
    h = max(h, np.int64(mesh.twin[h]))  # as in `split`, the later half-edge gives the birth
    t = np.int64(mesh.twin[h])
    a = np.int64(mesh.origin[h])
    b = np.int64(mesh.origin[next_halfedge(h)])
    mesh.birth[v] = birth_between(mesh, h, a, b)
    mesh.kind[v] = INNER if mesh.curve[h] == NONE else CURVE
    for i in range(4):
        mesh.X[v, i] = 0.5 * (mesh.X[a, i] + mesh.X[b, i])
    mesh.valence_excess[v] = -1 if t == NONE else -2
    mesh.vertex_halfedge[v] = 3 * f
    _halve_face(mesh, h, v, f)
    mesh.twin[3 * f] = t
    if t != NONE:
        _halve_face(mesh, t, v, g)
        mesh.twin[t] = 3 * f
        mesh.twin[3 * g] = h
        mesh.twin[h] = 3 * g
        mask[t // 3] = edge_flags(mesh, t // 3, half_longest, twice_shortest)
        mask[g] = edge_flags(mesh, g, half_longest, twice_shortest)
    mask[h // 3] = edge_flags(mesh, h // 3, half_longest, twice_shortest)
    mask[f] = edge_flags(mesh, f, half_longest, twice_shortest)
    wanted = mask[h // 3] | mask[f]
    if t != NONE:
        wanted |= mask[t // 3] | mask[g]
    return (wanted & 7) != 0


@inlined
def _halve_face(mesh, h, v, f):
    """Face a b c of ``h`` becomes a v c, and face ``f`` v b c; twins across the edge are left open."""
    n = next_halfedge(h)
    b = np.int64(mesh.origin[n])
    c = mesh.origin[previous_halfedge(h)]
    mesh.origin[n] = v
    mesh.origin[3 * f], mesh.origin[3 * f + 1], mesh.origin[3 * f + 2] = v, b, c
    mesh.curve[3 * f] = mesh.curve[h]
    mesh.curve[3 * f + 1] = mesh.curve[n]
    mesh.curve[3 * f + 2] = NONE
    mesh.curve[n] = NONE
    t = np.int64(mesh.twin[n])
    mesh.twin[3 * f + 1] = t
    if t != NONE:
        mesh.twin[t] = 3 * f + 1
    mesh.twin[n] = 3 * f + 2
    mesh.twin[3 * f + 2] = n
    mesh.source[f] = mesh.source[h // 3]
    mesh.valence_excess[c] += 1
    if mesh.vertex_halfedge[b] == n:
        mesh.vertex_halfedge[b] = 3 * f + 1


@inlined
def birth_between(mesh, h, v, w):
    """Where on the reference a midpoint is looked for: on the curve of its edge, or in its patch.

    Both half-edges of an edge on a curve, and all siblings of a seam, give the same answer.
    """
    c = mesh.curve[h]
    if c == NONE:
        # The birth of a vertex on a curve may be a face on the other side.
        if mesh.kind[v] <= HELD:
            return mesh.birth[v]
        return mesh.birth[w] if mesh.kind[w] <= HELD else np.int32(3 * mesh.source[h // 3])
    slides_v = CURVE <= mesh.kind[v] < FIXED
    slides_w = CURVE <= mesh.kind[w] < FIXED
    if slides_v:
        return min(mesh.birth[v], mesh.birth[w]) if slides_w else mesh.birth[v]
    return mesh.birth[w] if slides_w else np.int32(c & (NON_MANIFOLD - 1))
