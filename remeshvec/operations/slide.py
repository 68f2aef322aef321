"""Slide: vertices on curves move along their curve, to where the edges to both neighbours suit.

The position is the arc length along the polyline of the input: chords would not do, on a small hole
three vertices in a row would run together. All vertices move at once, from where they lie on the curve;
all sheets that share a curve compute the same bits.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.vocabulary import CURVE, DEAD, FIXED, MAX_VALENCE, NONE, Blocks, Mesh
from ..features.polyline import move_on_curve
from ..mesh.blocks import per_block
from ..mesh.walk import next_halfedge, previous_halfedge
from ..reference.surface import Reference
from .project import project_curves

__all__ = ["slide_vertices"]

# Share of the way that a vertex goes. Going all of it at once, two neighbours swap their errors for ever.
SLIDE_SHARE = 0.75


def slide_vertices(mesh: Mesh, blocks: Blocks, reference: Reference, parallel: bool) -> None:
    """Move all vertices on curves once."""
    if not reference.curve_neighbours.shape[1]:
        return
    project_curves(mesh, blocks, reference, parallel)
    arc = np.zeros(mesh.vertex_halfedge.size)
    _find_arcs(parallel, mesh, blocks, reference.X, reference.origin, reference.arcs, arc)
    _slide(parallel, mesh, blocks, *reference[1:], arc, mesh.X, mesh.birth)


@threaded(per_block)
def _find_arcs(span, mesh, blocks, X_in, origin, arcs, arc):
    """Arc length at which each vertex lies on its curve."""
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] < CURVE or mesh.kind[v] == FIXED:
                continue
            h = np.int64(mesh.birth[v])
            a = origin[h]
            b = origin[next_halfedge(h)]
            along = 0.0
            length = 0.0
            for i in range(3):
                direction = X_in[b, i] - X_in[a, i]
                along += direction * (mesh.X[v, i] - X_in[a, i])
                length += direction * direction
            s = along / length if length > 0.0 else 0.0
            arc[v] = arcs[0, h] + s * (arcs[1, h] - arcs[0, h])


@threaded(per_block)
def _slide(span, mesh, blocks, X_in, origin, curve_neighbours, arcs, arc, X, birth):
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != CURVE:
                continue
            u, w = _neighbours(mesh, v)
            if u == NONE:
                continue
            here = np.int64(birth[v])
            step = _slide_step(mesh, arc, v, u, w, arcs[2, here])
            h, s = move_on_curve(curve_neighbours, arcs, here, arc[v] + SLIDE_SHARE * step)
            birth[v] = h
            a = origin[h]
            b = origin[next_halfedge(h)]
            for i in range(3):
                X[v, i] = X_in[a, i] + s * (X_in[b, i] - X_in[a, i])


@inlined
def _neighbours(mesh, v):
    """Both neighbours on the curve, ``NONE`` where there are not two."""
    start = np.int64(mesh.vertex_halfedge[v])
    h = start
    u = w = np.int64(NONE)
    for _ in range(MAX_VALENCE):
        if mesh.curve[h] != NONE:
            u, w = w, np.int64(mesh.origin[next_halfedge(h)])
        p = previous_halfedge(h)
        h = np.int64(mesh.twin[p])
        if h == NONE:
            return w, np.int64(mesh.origin[p])
        if h == start:
            break
    return u, w


@inlined
def _slide_step(mesh, arc, v, u, w, total):
    """Arc length to the point where the edges to both neighbours are as their target lengths.

    The order of the neighbours does not matter. Corners lie at the ends of their curve, on the side
    where the other neighbour is not.
    """
    t = arc[v]
    su, sw = mesh.X[u, 3], mesh.X[w, 3]
    if total < 0.0:
        fixed_u = mesh.kind[u] == FIXED
        fixed_w = mesh.kind[w] == FIXED
        if fixed_u and fixed_w:
            return -0.5 * total - t
        tu, tw = arc[u], arc[w]
        if fixed_u:
            tu = 0.0 if tw > t else -total
        elif fixed_w:
            tw = 0.0 if tu > t else -total
        forward_is_u = tu > tw
        ahead = max(tu, tw) - t
        behind = t - min(tu, tw)
    else:
        du = (arc[u] - t) % total
        dw = (arc[w] - t) % total
        forward_is_u = du < dw
        ahead = min(du, dw)
        behind = total - max(du, dw)
    s_ahead = mesh.X[v, 3] + (su if forward_is_u else sw)
    s_behind = mesh.X[v, 3] + (sw if forward_is_u else su)
    return (ahead * s_behind - behind * s_ahead) / (s_ahead + s_behind)
