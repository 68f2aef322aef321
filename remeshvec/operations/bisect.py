"""Bisect: split the few long edges of later sweeps in place, in the room that collapses left.

Writing the whole mesh anew for a handful of splits took most of the time of the later sweeps. Here an
edge is cut at its midpoint, its faces are halved, and vertex and faces go where dead ones lie, in the
same block. A split owns the four vertices of its quad.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from .._jit import driver, inlined
from .._types import CURVE, DEAD, FIXED, HELD, INNER, NONE, SEAM, Blocks, Mesh
from ..edge_sets import OWNED, REST, SHIFTED, list_range, stage_blocks, stages, vertex_range
from ..geometry import distance_squared
from ..halfedge import following, previous

__all__ = ["bisect_edges", "birth_between"]

_GONE = 255  # of a removed face, see `split`


def bisect_edges(
    mesh: Mesh, blocks: Blocks, factor: float, asked: np.ndarray, parallel: bool
) -> int:
    """Split the edges asked for, where there is room; returns how many were.

    Parameters
    ----------
    mesh : Mesh
    blocks : Blocks
    factor : float
        Only edges longer than this times their target length: earlier splits may have halved one.
    asked : (m,) uint8
        Mask of edges a face (bit i: that from corner i), 255 for removed faces. Bits that are dealt with
        are cleared.
    parallel : bool
    """
    done = np.zeros(len(blocks.face) - 1, np.int64)
    for stage in stages(blocks):
        left = np.zeros(len(done), np.int64)
        _bisect(parallel, mesh, blocks, stage, 0.5 * factor, asked, done, left)
        if not left.any():
            break
    return int(done.sum())


@driver
def _bisect(mesh, blocks, stage, half_factor, asked, done, left):
    for k in prange(stage_blocks(blocks, stage)):
        low, high = vertex_range(blocks, stage, k)
        first, end = list_range(blocks, stage, k)
        room, room_end = _face_range(blocks, stage, k)
        v = low
        for f in range(blocks.face[first], blocks.face[end]):
            if asked[f] == 0 or asked[f] == _GONE:
                continue
            for i in range(3):
                if not (asked[f] >> i) & 1:
                    continue
                h = 3 * f + i
                if not _is_owned(mesh, h, low, high):
                    left[k] += 1
                    continue
                if not _is_long(mesh, h, half_factor):
                    asked[f] &= ~(1 << i)
                    continue
                v = _next_dead(mesh.vertex_halfedge, 1, v, high)
                room = _next_dead(mesh.origin, 3, room, room_end)
                other = room_end
                if mesh.twin[h] != NONE:
                    other = _next_dead(mesh.origin, 3, room + 1, room_end)
                if v == high or room == room_end or (mesh.twin[h] != NONE and other == room_end):
                    left[k] += 1
                    continue
                _split_edge(mesh, h, v, room, other, asked)
                done[k] += 1


@inlined
def _face_range(blocks, stage, k):
    """Faces whose room block ``k`` of a stage may use."""
    last = blocks.face.size - 1
    if stage == OWNED:
        return blocks.face[k], blocks.face[k + 1]
    if stage == SHIFTED:
        low = (blocks.face[k] + blocks.face[k + 1]) // 2
        high = (blocks.face[k + 1] + blocks.face[k + 2]) // 2
        return low, high
    return np.int64(0), blocks.face[last]


@inlined
def _next_dead(array, stride, start, end):
    while start < end and array[stride * start] != DEAD:
        start += 1
    return start


@inlined
def _is_owned(mesh, h, low, high):
    """Tell whether all corners of the faces beside an edge lie in a range."""
    a = mesh.origin[h]
    b = mesh.origin[following(h)]
    c = mesh.origin[previous(h)]
    if min(a, b, c) < low or max(a, b, c) >= high:
        return False
    t = np.int64(mesh.twin[h])
    if t == NONE:
        return True
    d = mesh.origin[previous(t)]
    return low <= d < high


@inlined
def _is_long(mesh, h, half_factor):
    a = mesh.origin[h]
    b = mesh.origin[following(h)]
    limit = half_factor * (mesh.X[a, 3] + mesh.X[b, 3])
    return distance_squared(mesh.X, a, b) > limit * limit


@inlined
def _split_edge(mesh, h, v, f, g, asked):
    """Put vertex ``v`` in the middle of an edge, with new faces ``f`` and, across it, ``g``."""
    t = np.int64(mesh.twin[h])
    is_inner = t != NONE
    h = max(h, t)  # births of midpoints, as in `split`, are those that the later half-edge gives
    t = np.int64(mesh.twin[h])
    a = np.int64(mesh.origin[h])
    b = np.int64(mesh.origin[following(h)])
    mesh.birth[v] = birth_between(mesh, h, a, b)
    mesh.kind[v] = INNER if mesh.curve[h] == NONE else CURVE
    for i in range(4):
        mesh.X[v, i] = 0.5 * (mesh.X[a, i] + mesh.X[b, i])
    mesh.valence_excess[v] = -2 if is_inner else -1
    mesh.vertex_halfedge[v] = 3 * f
    _halve_face(mesh, h, v, f, asked)
    mesh.twin[3 * f] = t
    if is_inner:
        _halve_face(mesh, t, v, g, asked)
        mesh.twin[3 * f] = t
        mesh.twin[t] = 3 * f
        mesh.twin[3 * g] = h
        mesh.twin[h] = 3 * g


@inlined
def _halve_face(mesh, h, v, f, asked):
    """Face a b c of ``h`` becomes a v c, and face ``f`` v b c; twins across the edge are left open."""
    n = following(h)
    b = np.int64(mesh.origin[n])
    c = mesh.origin[previous(h)]
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
    # What was asked for the edge that moved to the new face is left to the next round.
    i = h % 3
    asked[h // 3] &= ~((1 << i) | (1 << ((i + 1) % 3)))


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
    return mesh.birth[w] if slides_w else np.int32(c & (SEAM - 1))
