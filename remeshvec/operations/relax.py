"""Tangential relaxation: every vertex moves towards the area-weighted centroid of its one-ring.

``p += (I - n n^T) (g - p)`` with ``g = sum A_j p_j / sum A_j`` and A the mixed Voronoi area [Botsch and
Kobbelt 2004, section 4], over the square of the target length where that varies [Dunyach et al. 2013,
section 3]. All vertices move at once (Jacobi). Sums run over faces, not over rings: faces are read in
order without dependent loads, and every normal and area is computed once instead of three times. A block
adds up the faces inside its vertex range; the faces across borders follow in later stages, so each vertex
sums in the same order on any number of threads.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..core.compiler import add_row, inlined, threaded
from ..core.geometry import mixed_voronoi_areas, tangent_basis
from ..core.vocabulary import CURVE, DEAD, INNER, NONE, Blocks, Mesh
from ..mesh.blocks import (
    make_candidates,
    owns_all,
    per_block,
    per_stage_block,
    slots,
    stages,
    vertex_range,
)
from ..mesh.walk import corners_of
from .frames import STIFF_SUMS, add_normal, stiffness_along, tangent_normal

__all__ = ["relax_vertices"]

# Columns of the sums without a stiffness: weighted positions and weights, then as in `frames`.
_PLAIN_SUMS = 8


def relax_vertices(mesh: Mesh, blocks: Blocks, stiffness: float, parallel: bool) -> None:
    """Move every inner vertex once in its tangent plane.

    ``stiffness`` tells how strongly curved ridges hold their vertices; 0 for not at all.
    """
    n = mesh.vertex_halfedge.size
    weighted = np.empty((n, 4))  # positions times weights, and weights
    sums = np.empty((n, STIFF_SUMS if stiffness > 0.0 else _PLAIN_SUMS))
    across = make_candidates(blocks.face)
    _sum_areas(parallel, mesh, blocks, weighted, across)
    for stage in stages(blocks)[1:]:
        _sum_areas_across(parallel, mesh, blocks, stage, weighted, across)
    _weight(parallel, mesh, blocks, weighted)
    _sum_rings(parallel, mesh, blocks, stiffness, weighted, sums)
    for stage in stages(blocks)[1:]:
        _sum_rings_across(parallel, mesh, blocks, stage, stiffness, weighted, across, sums)
    _move(parallel, mesh, blocks, stiffness, sums)


@threaded(per_block)
def _sum_areas(span, mesh, blocks, weighted, across):
    """Sum mixed Voronoi areas over the faces inside a block; lists the faces across borders."""
    for k in range(span[0], span[1]):
        owned = low, high = blocks.vertex[k], blocks.vertex[k + 1]
        for v in range(low, high):
            weighted[v, 3] = 0.0
        end = across.starts[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a, b, c = corners_of(mesh.origin, f)
            if a == DEAD:
                continue
            if owns_all(owned, a, b, c):
                _add_areas(mesh.X, a, b, c, weighted)
            else:
                across.items[end] = f
                end += 1
        across.counts[k] = end - across.starts[k]


@threaded(per_stage_block)
def _sum_areas_across(span, mesh, blocks, stage, weighted, across):
    """Add the faces across borders; a complemented number marks a face that is done."""
    for k in range(span[0], span[1]):
        owned = vertex_range(blocks, stage, k)
        for i in slots(across, blocks, stage, k):
            f = across.items[i]
            if f >= 0:
                a, b, c = corners_of(mesh.origin, f)
                if owns_all(owned, a, b, c):
                    _add_areas(mesh.X, a, b, c, weighted)
                    across.items[i] = ~f


@inlined
def _add_areas(X, a, b, c, weighted):
    """Add the mixed Voronoi areas of a face to its corners."""
    ux, uy, uz = X[c, 0] - X[b, 0], X[c, 1] - X[b, 1], X[c, 2] - X[b, 2]
    vx, vy, vz = X[a, 0] - X[c, 0], X[a, 1] - X[c, 1], X[a, 2] - X[c, 2]
    wx, wy, wz = X[b, 0] - X[a, 0], X[b, 1] - X[a, 1], X[b, 2] - X[a, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    area_a, area_b, area_c = mixed_voronoi_areas(
        ux * ux + uy * uy + uz * uz,
        vx * vx + vy * vy + vz * vz,
        wx * wx + wy * wy + wz * wz,
        sqrt(nx * nx + ny * ny + nz * nz),
    )
    weighted[a, 3] += area_a
    weighted[b, 3] += area_b
    weighted[c, 3] += area_c


@threaded(per_block)
def _weight(span, mesh, blocks, weighted):
    """Divide areas by the squared target length, and multiply positions by the quotient."""
    X = mesh.X
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            weight = weighted[v, 3] / (X[v, 3] * X[v, 3])
            # Half of the cell of a boundary vertex is missing. Without the factor its neighbours would
            # drift inwards until the edges between are split, and collapsed, for ever.
            if mesh.kind[v] >= CURVE and mesh.twin[max(0, mesh.vertex_halfedge[v])] == NONE:
                weight *= 2.0
            weighted[v, 0] = weight * X[v, 0]
            weighted[v, 1] = weight * X[v, 1]
            weighted[v, 2] = weight * X[v, 2]
            weighted[v, 3] = weight


@threaded(per_block)
def _sum_rings(span, mesh, blocks, stiffness, weighted, sums):
    """Sum weighted positions and normals over the faces inside a block."""
    for k in range(span[0], span[1]):
        owned = low, high = blocks.vertex[k], blocks.vertex[k + 1]
        sums[low:high] = 0.0
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a, b, c = corners_of(mesh.origin, f)
            if owns_all(owned, a, b, c):
                _add_face(mesh.X, weighted, a, b, c, stiffness, sums)


@threaded(per_stage_block)
def _sum_rings_across(span, mesh, blocks, stage, stiffness, weighted, across, sums):
    """Add the faces across borders, in the order of `_sum_areas_across`, and take their marks off."""
    for k in range(span[0], span[1]):
        owned = vertex_range(blocks, stage, k)
        for i in slots(across, blocks, stage, k):
            f = ~across.items[i]
            if f >= 0:
                a, b, c = corners_of(mesh.origin, f)
                if owns_all(owned, a, b, c):
                    _add_face(mesh.X, weighted, a, b, c, stiffness, sums)
                    across.items[i] = f


@inlined
def _add_face(X, weighted, a, b, c, stiffness, sums):
    """Add a face to the sums of its corners; each half-edge adds the vertex that it ends at."""
    add_row(sums, a, weighted, b)
    add_row(sums, b, weighted, c)
    add_row(sums, c, weighted, a)
    add_normal(X, a, b, c, stiffness, sums)


@threaded(per_block)
def _move(span, mesh, blocks, stiffness, sums):
    """Move the inner vertices."""
    X = mesh.X  # changed in place: a vertex reads the sums and its own row
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] != DEAD and mesh.kind[v] == INNER:
                dx, dy, dz = _relaxation_step(X, v, sums, stiffness)
                X[v, 0] += dx
                X[v, 1] += dy
                X[v, 2] += dz


@inlined
def _relaxation_step(X, v, sums, stiffness):
    """Compute the step of a vertex in its tangent plane; none where it has no such plane."""
    normal = nx, ny, nz = tangent_normal(sums, v)
    if not sums[v, 3] > 0.0 or (nx == 0.0 and ny == 0.0 and nz == 0.0):
        return 0.0, 0.0, 0.0
    scale = 1.0 / sums[v, 3]
    dx = sums[v, 0] * scale - X[v, 0]
    dy = sums[v, 1] * scale - X[v, 1]
    dz = sums[v, 2] * scale - X[v, 2]
    along = dx * nx + dy * ny + dz * nz
    dx -= along * nx
    dy -= along * ny
    dz -= along * nz
    if stiffness > 0.0:
        return _stiffened(sums, v, normal, (dx, dy, dz), stiffness)
    return dx, dy, dz


@inlined
def _stiffened(sums, v, normal, step, stiffness):
    """Damp a step in the tangent plane where normals vary."""
    m_ss, m_st, m_tt = stiffness_along(sums, v, normal, stiffness)
    if m_ss == 1.0 and m_tt == 1.0:
        return step
    dx, dy, dz = step
    sx, sy, sz, tx, ty, tz = tangent_basis(normal[0], normal[1], normal[2])
    ds = dx * sx + dy * sy + dz * sz
    dt = dx * tx + dy * ty + dz * tz
    determinant = m_ss * m_tt - m_st * m_st
    s = (m_tt * ds - m_st * dt) / determinant
    t = (m_ss * dt - m_st * ds) / determinant
    return s * sx + t * tx, s * sy + t * ty, s * sz + t * tz
