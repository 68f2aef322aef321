"""Project vertices onto the reference surface, and record where on it they lie.

Inner vertices go to the closest point of their patch of the surface, by a walk from the face where they
lay the last time. Vertices on curves go to the closest point of their own stretch of the curve, so that
a border does not shrink and a crease stays sharp. Fixed vertices stay.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import area_vector, point
from ..core.vocabulary import CURVE, DEAD, FIXED, INNER, MAX_VALENCE, NONE, Blocks, FloatArray, Mesh
from ..features.polyline import closest_on_curve
from ..mesh.blocks import per_block
from ..mesh.walk import apex_of, end_of, next_spoke
from ..reference.bvh import NO_NORMAL, STACK, point_on_face, search_face, walk_to_face
from ..reference.surface import Reference

__all__ = [
    "locate_vertices",
    "place_on_edge",
    "project_curves",
    "project_vertices",
    "read_lengths",
]


def project_vertices(
    mesh: Mesh, blocks: Blocks, reference: Reference, trust: float, parallel: bool
) -> None:
    """Move vertices inside patches and on curves to the closest points of the reference surface.

    Vertices walk there from where they lay the last time. For a vertex that ends farther away than
    ``trust`` times its target length the whole patch is searched, except faces that look the other way.
    """
    before = mesh.X.copy()
    _project_inner(parallel, mesh, blocks, reference.tree, trust * trust, before)
    project_curves(mesh, blocks, reference, parallel)


def project_curves(mesh: Mesh, blocks: Blocks, reference: Reference, parallel: bool) -> None:
    """Move only the vertices on curves: they slide in every sweep, the others drift for some."""
    if reference.curve_neighbours.shape[1]:
        _project_curves(parallel, mesh, blocks, reference.polylines)


def locate_vertices(
    mesh: Mesh,
    blocks: Blocks,
    reference: Reference,
    trust: float,
    parallel: bool,
    near: float | None = None,
) -> FloatArray:
    """Find where every vertex lies without moving it; sets ``mesh.birth``.

    Parameters
    ----------
    trust : float
        As in `project_vertices`, but a length; inf for vertices that were just projected.
    near : float, optional
        If a walk leaves a vertex farther away than this, by default ``trust``, the whole patch is
        searched for a place within it: most vertices lie on the reference, but some were put back where
        they were.

    Returns
    -------
    barycentric : (n, 3) float64
        Weights of the corners of the face of ``mesh.birth``: the point of the reference closest to
        the vertex.
    """
    barycentric = np.zeros((mesh.vertex_halfedge.size, 3))
    limits = trust * trust, (trust if near is None else near) ** 2
    tree, polylines = reference.tree, reference.polylines
    _locate(parallel, mesh, blocks, tree, polylines, limits, barycentric)
    return barycentric


def read_lengths(mesh: Mesh, blocks: Blocks, reference: Reference, parallel: bool) -> FloatArray:
    """Read the target length of every vertex that may move from the reference where it lies.

    Returns
    -------
    barycentric : (n, 3) float64
        As `locate_vertices`.
    """
    weights = locate_vertices(mesh, blocks, reference, np.inf, parallel)
    _read_lengths(parallel, mesh, blocks, reference.polylines, weights)
    return weights


@threaded(per_block)
def _project_inner(span, mesh, blocks, tree, trust_squared, before):
    """Move inner vertices; normals of rings are read from the positions ``before`` (Jacobi)."""
    for k in range(span[0], span[1]):
        stack = np.empty((2, STACK), np.int64)
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != INNER:
                continue
            p = point(before, v)
            f, s, t, d = walk_to_face(tree, p, mesh.birth[v] // 3)
            if d > trust_squared * before[v, 3] * before[v, 3]:
                f, s, t, d = search_face(tree, p, f, _ring_normal(mesh, before, v), stack)
            mesh.birth[v] = 3 * f
            mesh.X[v, 0], mesh.X[v, 1], mesh.X[v, 2] = point_on_face(tree.corners, f, s, t)


@inlined
def _ring_normal(mesh, X, v):
    """Sum of the area vectors around a vertex."""
    sx = sy = sz = 0.0
    start = mesh.vertex_halfedge[v]
    h = start
    for _ in range(MAX_VALENCE):
        b, c = end_of(mesh.origin, h), apex_of(mesh.origin, h)
        nx, ny, nz = area_vector(X, v, b, c)
        sx += nx
        sy += ny
        sz += nz
        h = next_spoke(mesh.twin, h)
        if h == NONE or h == start:
            break
    return sx, sy, sz


@threaded(per_block)
def _project_curves(span, mesh, blocks, polylines):
    """Move the vertices on curves; each reads its own position only."""
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != CURVE:
                continue
            h, s, _ = closest_on_curve(polylines, mesh.birth[v], point(mesh.X, v))
            place_on_edge(mesh, v, polylines, h, s)


@inlined
def place_on_edge(mesh, v, polylines, h, s):
    """Put a vertex on an edge of a curve, at parameter ``s``."""
    mesh.birth[v] = h
    X = polylines.X
    a, b = polylines.origin[h], end_of(polylines.origin, h)
    for i in range(3):
        mesh.X[v, i] = X[a, i] + s * (X[b, i] - X[a, i])


@threaded(per_block)
def _locate(span, mesh, blocks, tree, polylines, limits, barycentric):
    """Set births and barycentric weights; ``limits`` are the squares of trust and near."""
    for k in range(span[0], span[1]):
        stack = np.empty((2, STACK), np.int64)
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD:
                continue
            if mesh.kind[v] < CURVE:
                f, s, t = _locate_inner(tree, point(mesh.X, v), mesh.birth[v] // 3, limits, stack)
                mesh.birth[v] = 3 * f
                barycentric[v, 0] = 1.0 - s - t
                barycentric[v, 1] = s
                barycentric[v, 2] = t
            else:  # a fixed vertex lies where its edge starts, and finds itself there
                h, s, _ = closest_on_curve(polylines, mesh.birth[v], point(mesh.X, v))
                mesh.birth[v] = h
                corner = h - 3 * (h // 3)
                barycentric[v, corner] = 1.0 - s
                barycentric[v, (corner + 1) % 3] = s


@inlined
def _locate_inner(tree, p, hint, limits, stack):
    """Find the face and weights of the point closest to ``p``: by a walk, then by a search."""
    trust, near = limits
    f, s, t, d = walk_to_face(tree, p, hint)
    if d > near:
        g, gs, gt, gd = search_face(tree, p, f, NO_NORMAL, stack)
        if d > trust or gd <= near:
            f, s, t = g, gs, gt
    return f, s, t


@threaded(per_block)
def _read_lengths(span, mesh, blocks, polylines, weights):
    """Interpolate target lengths on the reference faces of ``mesh.birth``."""
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] != DEAD and mesh.kind[v] != FIXED:
                f = mesh.birth[v] // 3
                length = 0.0
                for i in range(3):
                    length += weights[v, i] * polylines.X[polylines.origin[3 * f + i], 3]
                mesh.X[v, 3] = length
