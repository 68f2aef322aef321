"""Slide: vertices on curves move along their curve, to where the edges to both neighbours suit.

Positions are arc lengths along the polyline of the input; by chords, three vertices in a row on a small
hole would run together. All vertices move at once, from where they lie on the curve; all sheets that
share a curve compute the same bits.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.vocabulary import CURVE, DEAD, FIXED, MAX_VALENCE, NONE, Blocks, Mesh
from ..features.polyline import move_on_curve
from ..mesh.blocks import per_block
from ..mesh.edge_curves import is_feature
from ..mesh.walk import apex_of, end_of, next_spoke
from ..reference.surface import Reference
from .project import place_on_edge, project_curves

__all__ = ["slide_vertices"]

# Share of the way that a vertex goes. At a full step, two neighbours would swap their errors for ever.
SLIDE_SHARE = 0.75


def slide_vertices(mesh: Mesh, blocks: Blocks, reference: Reference, parallel: bool) -> None:
    """Move all vertices on curves once."""
    if not reference.curve_neighbours.shape[1]:
        return
    project_curves(mesh, blocks, reference, parallel)
    arc = np.zeros(mesh.vertex_halfedge.size)
    _find_arcs(parallel, mesh, blocks, reference.polylines, arc)
    _slide(parallel, mesh, blocks, reference.polylines, arc)


@threaded(per_block)
def _find_arcs(span, mesh, blocks, polylines, arc):
    """Compute the arc length at which each vertex lies on its curve."""
    X, origin, row, _, arcs = polylines
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] < CURVE or mesh.kind[v] == FIXED:
                continue
            h = mesh.birth[v]
            a, b = origin[h], end_of(origin, h)
            along = 0.0
            length = 0.0
            for i in range(3):
                direction = X[b, i] - X[a, i]
                along += direction * (mesh.X[v, i] - X[a, i])
                length += direction * direction
            s = along / length if length > 0.0 else 0.0
            here = row[h]
            arc[v] = arcs[0, here] + s * (arcs[1, here] - arcs[0, here])


@threaded(per_block)
def _slide(span, mesh, blocks, polylines, arc):
    """Move every vertex by the arc lengths before the move, which are in ``arc`` (Jacobi)."""
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != CURVE:
                continue
            u, w = _neighbours_on_curve(mesh, v)
            if u == NONE:
                continue
            here = mesh.birth[v]
            step = _slide_step(mesh, arc, v, u, w, polylines.arcs[2, polylines.row[here]])
            h, s = move_on_curve(polylines, here, arc[v] + SLIDE_SHARE * step)
            place_on_edge(mesh, v, polylines, h, s)


@inlined
def _neighbours_on_curve(mesh, v):
    """Return both neighbours on the curve; the first is ``NONE`` where there are not two."""
    start = mesh.vertex_halfedge[v]
    h = start
    u = w = NONE
    for _ in range(MAX_VALENCE):
        if is_feature(mesh.curve[h]):
            u, w = w, end_of(mesh.origin, h)
        last = h
        h = next_spoke(mesh.twin, h)
        if h == NONE:
            return w, apex_of(mesh.origin, last)
        if h == start:
            break
    return u, w


@inlined
def _slide_step(mesh, arc, v, u, w, total):
    """Compute the arc length to the point where the edges to both neighbours suit their target lengths.

    The order of the neighbours does not matter. Corners lie at the ends of their curve, on the side
    where the other neighbour is not.
    """
    t = arc[v]
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
    su, sw = mesh.X[u, 3], mesh.X[w, 3]
    s_ahead = mesh.X[v, 3] + (su if forward_is_u else sw)
    s_behind = mesh.X[v, 3] + (sw if forward_is_u else su)
    return (ahead * s_behind - behind * s_ahead) / (s_ahead + s_behind)
