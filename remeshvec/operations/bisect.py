"""Bisect: split the few long edges of later sweeps in place, in the space that collapses leave.

Writing the whole mesh anew for a handful of splits took most of the time of the later sweeps. Here an
edge is cut at its midpoint and its faces are halved; the new vertex and faces go into dead slots of the
same block. A split owns the four vertices of its quad.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.vocabulary import CURVE, DEAD, FIXED, HELD, INNER, NONE, Blocks, Mesh
from ..mesh.blocks import (
    face_range,
    list_range,
    owns,
    owns_all,
    per_stage_block,
    stages,
    vertex_range,
)
from ..mesh.edge_curves import curve_name, is_feature
from ..mesh.walk import apex_of, corners_of, end_of, next_halfedge
from .classify import REMOVED, EdgeFlags, edge_flags

__all__ = ["birth_between", "bisect_edges"]


def bisect_edges(mesh: Mesh, blocks: Blocks, flags: EdgeFlags, parallel: bool) -> tuple[int, int]:
    """Split long edges until none is left or there is no space for more.

    Keeps ``flags.mask`` true: afterwards it describes the mesh as split.

    Returns
    -------
    n_split : int
        Edges split.
    n_left : int
        Edges that are still too long, for lack of space.
    """
    n_split = 0
    factors = (0.5 * flags.longest, 2.0 * flags.shortest)
    while True:
        done = np.zeros(len(blocks.face) - 1, np.int64)
        for stage in stages(blocks):
            left = np.zeros(len(done), np.int64)
            _bisect(parallel, mesh, blocks, stage, factors, flags.mask, done, left)
            if not left.any():
                break
        n_split += int(done.sum())
        n_left = int(left.sum())
        if not n_left or not done.any():
            return n_split, n_left


@threaded(per_stage_block)
def _bisect(span, mesh, blocks, stage, factors, mask, done, left):
    """Split what the blocks of a stage own; counts the edges that are done and those that are left."""
    for k in range(span[0], span[1]):
        owned = vertex_range(blocks, stage, k)
        first, end = list_range(blocks, stage, k)
        space, space_end = face_range(blocks, stage, k)
        v, high = owned
        for f in range(blocks.face[first], blocks.face[end]):
            if mask[f] & 7 == 0 or mask[f] == REMOVED:
                continue
            for i in range(3):
                if not (mask[f] >> i) & 1:
                    continue
                h = 3 * f + i
                is_inner = mesh.twin[h] != NONE
                if not (_owns_quad(mesh, h, owned) and _is_wanted_across(mesh, h, mask)):
                    left[k] += 1
                    continue
                v = _next_dead(mesh.vertex_halfedge, 1, v, high)
                space = _next_dead(mesh.origin, 3, space, space_end)
                other = _next_dead(mesh.origin, 3, space + 1, space_end) if is_inner else space
                if v == high or max(space, other) >= space_end:
                    left[k] += 1
                    continue
                done[k] += 1
                left[k] += _split_edge(mesh, h, v, space, other, factors, mask)


@inlined
def _next_dead(array, stride, start, end):
    """Return the first removed element from ``start`` on, ``end`` if there is none."""
    while start < end and array[stride * start] != DEAD:
        start += 1
    return start


@inlined
def _owns_quad(mesh, h, owned):
    """Tell whether all corners of the faces beside an edge lie in the block's vertex range."""
    a, b, c = corners_of(mesh.origin, h // 3)
    if not owns_all(owned, a, b, c):
        return False
    t = mesh.twin[h]
    return t == NONE or owns(owned, apex_of(mesh.origin, t))


@inlined
def _is_wanted_across(mesh, h, mask):
    """Tell whether the face across wants the same split, if there is one.

    If not, it is a needle with a longer edge, which goes first [Rivara 1984, section 3]. Otherwise two
    needles would cut one another's shorter edges, until vertices meet in one place.
    """
    t = mesh.twin[h]
    return t == NONE or (mask[t // 3] >> (t % 3)) & 1 == 1


@inlined
def _split_edge(mesh, h, v, f, g, factors, mask):
    """Put vertex ``v`` in the middle of an edge, with new faces ``f`` and, across it, ``g``.

    Tells whether one of the four faces wants more splits.
    """
    h = max(h, mesh.twin[h])  # as in `split`, the later half-edge gives the birth
    t = mesh.twin[h]
    _place_midpoint(mesh, h, v)
    mesh.valence_excess[v] = -1 if t == NONE else -2
    mesh.vertex_halfedge[v] = 3 * f
    _halve_face(mesh, h, v, f)
    mesh.twin[3 * f] = t
    flags = 0
    if t != NONE:
        _halve_face(mesh, t, v, g)
        mesh.twin[t] = 3 * f
        mesh.twin[3 * g] = h
        mesh.twin[h] = 3 * g
        flags = _update_flags(mesh, t // 3, g, factors, mask)
    flags |= _update_flags(mesh, h // 3, f, factors, mask)
    return (flags & 7) != 0


@inlined
def _place_midpoint(mesh, h, v):
    a, b = mesh.origin[h], end_of(mesh.origin, h)
    mesh.birth[v] = birth_between(mesh, h, a, b)
    mesh.kind[v] = CURVE if is_feature(mesh.curve[h]) else INNER
    for i in range(4):
        mesh.X[v, i] = 0.5 * (mesh.X[a, i] + mesh.X[b, i])


@inlined
def _halve_face(mesh, h, v, f):
    """Turn face a b c of ``h`` into a v c, and face ``f`` into v b c; twins across the edge stay open."""
    n = next_halfedge(h)
    b = mesh.origin[n]
    c = apex_of(mesh.origin, h)
    mesh.origin[n] = v
    mesh.origin[3 * f], mesh.origin[3 * f + 1], mesh.origin[3 * f + 2] = v, b, c
    mesh.curve[3 * f] = mesh.curve[h]
    mesh.curve[3 * f + 1] = mesh.curve[n]
    mesh.curve[3 * f + 2] = NONE
    mesh.curve[n] = NONE
    t = mesh.twin[n]
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
def _update_flags(mesh, f, g, factors, mask):
    """Classify the edges of both halves of a face again; returns their flags, combined."""
    half_longest, twice_shortest = factors
    one = edge_flags(mesh, f, half_longest, twice_shortest)
    other = edge_flags(mesh, g, half_longest, twice_shortest)
    mask[f] = one
    mask[g] = other
    return one | other


@inlined
def birth_between(mesh, h, v, w):
    """Choose the birth of a midpoint: on the curve of its edge, or else in the edge's patch.

    Both half-edges of an edge on a curve, and all siblings of a non-manifold edge, give the same answer.
    """
    curve = mesh.curve[h]
    if not is_feature(curve):
        # The birth of a vertex on a curve may be a face on the other side.
        if mesh.kind[v] <= HELD:
            return mesh.birth[v]
        return mesh.birth[w] if mesh.kind[w] <= HELD else np.int32(3 * mesh.source[h // 3])
    slides_v = CURVE <= mesh.kind[v] < FIXED
    slides_w = CURVE <= mesh.kind[w] < FIXED
    if slides_v:
        return min(mesh.birth[v], mesh.birth[w]) if slides_w else mesh.birth[v]
    return mesh.birth[w] if slides_w else np.int32(curve_name(curve))
