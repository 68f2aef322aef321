"""Fit: move vertices along their normals until faces straddle the input instead of cutting through it.

A mesh whose vertices lie on a curved surface lies inside it everywhere else. Half of the ring's mean
signed distance takes a good part off the RMS distance (`docs/quality.md`), but vertices then no longer
lie on the input. Offered as an option.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import area_vector
from ..core.vocabulary import DEAD, HELD, INNER, MAX_VALENCE, NONE, Blocks, Mesh, Tree
from ..mesh.blocks import per_block
from ..mesh.walk import corners_of, next_spoke
from ..reference.bvh import STACK, closest_face, point_on_face

__all__ = ["fit_vertices"]

_FIT_SHARE = 0.5


def fit_vertices(mesh: Mesh, blocks: Blocks, tree: Tree, reach: float, parallel: bool) -> None:
    """Move inner vertices once, by at most ``reach`` times their target length."""
    gaps = np.zeros((mesh.origin.size // 3, 4))
    _measure_gaps(parallel, mesh, blocks, tree, gaps)
    _shift(parallel, mesh, blocks, gaps, reach)


@threaded(per_block)
def _measure_gaps(span, mesh, blocks, tree, gaps):
    """Compute the area vector of every face, and area times signed distance from centroid to input."""
    X = mesh.X
    for k in range(span[0], span[1]):
        stack = np.empty((2, STACK), np.int64)
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a, b, c = corners_of(mesh.origin, f)
            if a == DEAD:
                continue
            nx, ny, nz = area_vector(X, a, b, c)
            x = (X[a, 0] + X[b, 0] + X[c, 0]) / 3.0
            y = (X[a, 1] + X[b, 1] + X[c, 1]) / 3.0
            z = (X[a, 2] + X[b, 2] + X[c, 2]) / 3.0
            hint = _face_to_start_at(mesh, f)
            g, s, t, _ = closest_face(tree, (x, y, z), hint, 0.0, stack)
            qx, qy, qz = point_on_face(tree.corners, g, s, t)
            gap = (qx - x) * nx + (qy - y) * ny + (qz - z) * nz
            gaps[f, 0], gaps[f, 1], gaps[f, 2], gaps[f, 3] = nx, ny, nz, gap


@inlined
def _face_to_start_at(mesh, f):
    """Return a face of the reference near a face: where an inner corner was born, or its source."""
    hint = mesh.source[f]  # for a face with all vertices on curves
    for c in range(3):
        v = mesh.origin[3 * f + c]
        if mesh.kind[v] <= HELD:
            hint = mesh.birth[v] // 3
    return hint


@threaded(per_block)
def _shift(span, mesh, blocks, gaps, reach):
    """Move every inner vertex along the mean normal of its ring, by the mean gap."""
    X = mesh.X  # changed in place: a vertex reads the gaps and its own row
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != INNER:
                continue
            nx = ny = nz = gap = weight = 0.0
            start = mesh.vertex_halfedge[v]
            h = start
            for _ in range(MAX_VALENCE):
                f = h // 3
                nx += gaps[f, 0]
                ny += gaps[f, 1]
                nz += gaps[f, 2]
                gap += gaps[f, 3]
                weight += sqrt(gaps[f, 0] ** 2 + gaps[f, 1] ** 2 + gaps[f, 2] ** 2)
                h = next_spoke(mesh.twin, h)
                if h == start or h == NONE:
                    break
            norm = sqrt(nx * nx + ny * ny + nz * nz)
            if norm > 0.0:
                limit = reach * X[v, 3]
                step = max(-limit, min(limit, _FIT_SHARE * gap / weight)) / norm
                X[v, 0] += step * nx
                X[v, 1] += step * ny
                X[v, 2] += step * nz
