"""Project vertices onto the reference surface, and say where on it they lie.

Inner vertices go to the closest point of their patch of the surface, found from the face of the last
time; vertices on curves to the closest point of their own stretch of the curve, so that a border does
not shrink and a crease stays sharp; fixed vertices stay.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import area_vector, point
from ..core.vocabulary import (
    CURVE,
    DEAD,
    FIXED,
    INNER,
    MAX_VALENCE,
    NONE,
    Blocks,
    FloatArray,
    Mesh,
)
from ..features.polyline import closest_on_curve
from ..mesh.blocks import per_block
from ..mesh.walk import next_halfedge, previous_halfedge
from ..reference.bvh import NO_NORMAL, STACK, point_on_face, search_face, walk_to_face
from ..reference.surface import Reference

__all__ = [
    "locate_vertices",
    "project_curves",
    "project_vertices",
    "read_lengths",
]


def project_vertices(
    mesh: Mesh, blocks: Blocks, reference: Reference, trust: float, parallel: bool
) -> None:
    """Move vertices inside patches and on curves to the closest points of the reference surface.

    Vertices walk there from where they were the last time. Of those that end farther than ``trust``
    times their target length away, the whole patch is searched, but for faces that look the other way.
    """
    before = mesh.X.copy()
    _project_inner(
        parallel, mesh, blocks, reference.tree, trust * trust, before, mesh.X, mesh.birth
    )
    project_curves(mesh, blocks, reference, parallel)


def project_curves(mesh: Mesh, blocks: Blocks, reference: Reference, parallel: bool) -> None:
    """Move vertices on curves only: they slide in every sweep, the others drift for some."""
    if reference.curve_neighbours.shape[1]:
        _project_curves(parallel, mesh, blocks, *reference[1:4], mesh.X, mesh.birth)


def locate_vertices(
    mesh: Mesh,
    blocks: Blocks,
    reference: Reference,
    trust: float,
    parallel: bool,
    near: float | None = None,
) -> FloatArray:
    """Find where every vertex lies without moving it; sets ``mesh.birth``.

    ``trust`` as in `project_vertices`, but a length: inf for vertices that were just projected. For
    vertices that a walk leaves farther away than ``near``, by default ``trust``, a place within ``near``
    is looked for in the whole patch: most lie on the reference, some were put back where they were.

    Returns
    -------
    barycentric : (n, 3) float64
        Weights of the corners of the face of ``mesh.birth``: the point of the reference closest to
        the vertex.
    """
    barycentric = np.zeros((mesh.vertex_halfedge.size, 3))
    _locate(
        parallel,
        mesh,
        blocks,
        reference.tree,
        *reference[1:4],
        trust * trust,
        (trust if near is None else near) ** 2,
        mesh.birth,
        barycentric,
    )
    return barycentric


def read_lengths(mesh: Mesh, blocks: Blocks, reference: Reference, parallel: bool) -> None:
    """Set the target length at every vertex that may move to that of the reference where it lies."""
    weights = locate_vertices(mesh, blocks, reference, np.inf, parallel)
    _read_lengths(
        parallel, mesh, blocks, reference.X, reference.origin, mesh.birth, weights, mesh.X
    )


@threaded(per_block)
def _project_inner(span, mesh, blocks, tree, trust, before, X, birth):
    for k in range(span[0], span[1]):
        stack = np.empty((2, STACK), np.int64)
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != INNER:
                continue
            at = point(before, v)
            f, s, t, d = walk_to_face(tree, at, np.int64(birth[v]) // 3)
            if d > trust * before[v, 3] * before[v, 3]:
                f, s, t, d = search_face(tree, at, f, _ring_normal(mesh, before, v), stack)
            birth[v] = 3 * f
            X[v, 0], X[v, 1], X[v, 2] = point_on_face(tree.corners, f, s, t)


@inlined
def _ring_normal(mesh, X, v):
    """Sum of the area vectors around a vertex."""
    sx = sy = sz = 0.0
    start = np.int64(mesh.vertex_halfedge[v])
    h = start
    for _ in range(MAX_VALENCE):
        b = mesh.origin[next_halfedge(h)]
        c = mesh.origin[previous_halfedge(h)]
        nx, ny, nz = area_vector(X, v, b, c)
        sx += nx
        sy += ny
        sz += nz
        h = np.int64(mesh.twin[previous_halfedge(h)])
        if h == NONE or h == start:
            break
    return sx, sy, sz


@threaded(per_block)
def _project_curves(span, mesh, blocks, X_in, origin, curve_neighbours, X, birth):
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != CURVE:
                continue
            start = np.int64(birth[v])
            h, s, _ = closest_on_curve(X_in, origin, curve_neighbours, start, point(X, v))
            birth[v] = h
            a = origin[h]
            b = origin[next_halfedge(h)]
            for i in range(3):
                X[v, i] = X_in[a, i] + s * (X_in[b, i] - X_in[a, i])


@threaded(per_block)
def _locate(
    span, mesh, blocks, tree, X_in, origin, curve_neighbours, trust, near, birth, barycentric
):
    for k in range(span[0], span[1]):
        stack = np.empty((2, STACK), np.int64)
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD:
                continue
            at = point(mesh.X, v)
            hint = np.int64(birth[v])
            if mesh.kind[v] < CURVE:
                f, s, t, d = walk_to_face(tree, at, hint // 3)
                if d > near:
                    g, gs, gt, gd = search_face(tree, at, f, NO_NORMAL, stack)
                    if d > trust or gd <= near:
                        f, s, t = g, gs, gt
                birth[v] = 3 * f
                barycentric[v, 0] = 1.0 - s - t
                barycentric[v, 1] = s
                barycentric[v, 2] = t
                continue
            # A fixed vertex lies where its edge starts, and finds itself there.
            h, s, _ = closest_on_curve(X_in, origin, curve_neighbours, hint, at)
            birth[v] = h
            corner = h - 3 * (h // 3)
            barycentric[v, corner] = 1.0 - s
            barycentric[v, (corner + 1) % 3] = s


@threaded(per_block)
def _read_lengths(span, mesh, blocks, X_in, origin, birth, weights, X):
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] != DEAD and mesh.kind[v] != FIXED:
                f = np.int64(birth[v]) // 3
                length = 0.0
                for i in range(3):
                    length += weights[v, i] * X_in[origin[3 * f + i], 3]
                X[v, 3] = length
