"""Frames: how far each vertex may move in every direction, from the normals of its one-ring.

A step ``d`` of a vertex becomes ``P (I + s Q^2)^-1 P d``: P projects into the tangent plane, Q is the
normal tensor of the ring in this plane, and s the stiffness. Across a curved ridge Q is large and the
vertex stays on it; along the ridge it still slides. Normals are summed over faces, as in `relax`.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..core.compiler import add_four, inlined, threaded
from ..core.geometry import SHARP, area_vector, tangent_basis
from ..core.vocabulary import DEAD, INNER, Blocks, FloatArray, Mesh
from ..mesh.blocks import (
    DONE,
    make_candidates,
    owns_all,
    per_block,
    per_stage_block,
    slots,
    stages,
    vertex_range,
)
from ..mesh.walk import corners_of

__all__ = [
    "FRAME_SIZE",
    "STIFF_SUMS",
    "add_normal",
    "measure_frames",
    "stiffness_along",
    "tangent_normal",
]

# Columns of the sums over rings: four that belong to the caller, then normal and its length without
# cancellation, then the normal tensor (xx xy xz yy, yz; zz follows from its trace). Rows begin where
# cache lines do.
STIFF_SUMS = 16

# Numbers of a symmetric matrix: xx xy xz yy yz zz.
FRAME_SIZE = 6


def measure_frames(
    mesh: Mesh, blocks: Blocks, stiffness: float, frames: FloatArray, parallel: bool
) -> None:
    """Fill in the frames (n, 6) of all vertices; zero for those that must not move.

    So a loop over steps needs no tests. Only inner vertices with a tangent plane move.
    """
    sums = np.empty((mesh.vertex_halfedge.size, STIFF_SUMS))
    across = make_candidates(blocks.face)
    _sum_normals(parallel, mesh, blocks, stiffness, sums, across)
    for stage in stages(blocks)[1:]:
        _sum_normals_across(parallel, mesh, blocks, stage, stiffness, sums, across)
    _fill_frames(parallel, mesh, blocks, stiffness, sums, frames)


@threaded(per_block)
def _sum_normals(span, mesh, blocks, stiffness, sums, across):
    """Sum normals over the faces inside a block; lists the faces across borders."""
    for k in range(span[0], span[1]):
        owned = low, high = blocks.vertex[k], blocks.vertex[k + 1]
        sums[low:high] = 0.0
        end = across.starts[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a, b, c = corners_of(mesh.origin, f)
            if a == DEAD:
                continue
            if owns_all(owned, a, b, c):
                add_normal(mesh.X, a, b, c, stiffness, sums)
            else:
                across.items[end] = f
                end += 1
        across.counts[k] = end - across.starts[k]


@threaded(per_stage_block)
def _sum_normals_across(span, mesh, blocks, stage, stiffness, sums, across):
    """Add the faces across borders."""
    for k in range(span[0], span[1]):
        owned = vertex_range(blocks, stage, k)
        for i in slots(across, blocks, stage, k):
            f = across.items[i]
            if f != DONE:
                a, b, c = corners_of(mesh.origin, f)
                if owns_all(owned, a, b, c):
                    add_normal(mesh.X, a, b, c, stiffness, sums)
                    across.items[i] = DONE


@inlined
def add_normal(X, a, b, c, stiffness, sums):
    """Add the normal of a face, and with a stiffness its tensor, to the sums of its corners."""
    nx, ny, nz = area_vector(X, a, b, c)
    norm = sqrt(nx * nx + ny * ny + nz * nz)
    add_four(sums, a, 4, nx, ny, nz, norm)
    add_four(sums, b, 4, nx, ny, nz, norm)
    add_four(sums, c, 4, nx, ny, nz, norm)
    if stiffness > 0.0 and norm > 0.0:
        scale = 1.0 / norm
        ux, uy = nx * scale, ny * scale
        xx, xy, xz, yy, yz = ux * nx, ux * ny, ux * nz, uy * ny, uy * nz
        add_four(sums, a, 8, xx, xy, xz, yy)
        add_four(sums, b, 8, xx, xy, xz, yy)
        add_four(sums, c, 8, xx, xy, xz, yy)
        sums[a, 12] += yz
        sums[b, 12] += yz
        sums[c, 12] += yz


@threaded(per_block)
def _fill_frames(span, mesh, blocks, stiffness, sums, frames):
    """Turn sums into frames."""
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            for i in range(FRAME_SIZE):
                frames[v, i] = 0.0
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != INNER:
                continue
            normal = tangent_normal(sums, v)
            nx, ny, nz = normal
            if nx == 0.0 and ny == 0.0 and nz == 0.0:
                continue
            sx, sy, sz, tx, ty, tz = tangent_basis(nx, ny, nz)
            m_ss, m_st, m_tt = 1.0, 0.0, 1.0
            if stiffness > 0.0:
                m_ss, m_st, m_tt = stiffness_along(sums, v, normal, stiffness)
            scale = 1.0 / (m_ss * m_tt - m_st * m_st)
            ss, st, tt = scale * m_tt, -scale * m_st, scale * m_ss
            frames[v, 0] = ss * sx * sx + tt * tx * tx + 2.0 * st * sx * tx
            frames[v, 1] = ss * sx * sy + tt * tx * ty + st * (sx * ty + sy * tx)
            frames[v, 2] = ss * sx * sz + tt * tx * tz + st * (sx * tz + sz * tx)
            frames[v, 3] = ss * sy * sy + tt * ty * ty + 2.0 * st * sy * ty
            frames[v, 4] = ss * sy * sz + tt * ty * tz + st * (sy * tz + sz * ty)
            frames[v, 5] = ss * sz * sz + tt * tz * tz + 2.0 * st * sz * tz


@inlined
def tangent_normal(sums, v):
    """Return the unit normal of a vertex; zero where there is no tangent plane.

    Such a vertex, on a sharp edge, stays, or the rim of a sheet would creep inwards.
    """
    nx, ny, nz = sums[v, 4], sums[v, 5], sums[v, 6]
    norm = sqrt(nx * nx + ny * ny + nz * nz)
    if not norm > SHARP * sums[v, 7]:
        return 0.0, 0.0, 0.0
    scale = 1.0 / norm
    return nx * scale, ny * scale, nz * scale


@inlined
def stiffness_along(sums, v, normal, stiffness):
    """Return ``I + s Q^2`` in `tangent_basis`: its entries ss, st and tt."""
    nx, ny, nz = normal
    scale = 1.0 / sums[v, 7]
    xx, xy, xz = sums[v, 8] * scale, sums[v, 9] * scale, sums[v, 10] * scale
    yy, yz = sums[v, 11] * scale, sums[v, 12] * scale
    zz = 1.0 - xx - yy
    # The share of the tensor outside the normal; below 1e-3 the ring is flat to 2 degrees.
    along = (
        nx * (xx * nx + 2.0 * (xy * ny + xz * nz)) + ny * (yy * ny + 2.0 * yz * nz) + nz * zz * nz
    )
    if xx + yy + zz - along < 1e-3:
        return 1.0, 0.0, 1.0
    sx, sy, sz, tx, ty, tz = tangent_basis(nx, ny, nz)
    qs_x, qs_y, qs_z = (
        xx * sx + xy * sy + xz * sz,
        xy * sx + yy * sy + yz * sz,
        xz * sx + yz * sy + zz * sz,
    )
    qt_x, qt_y, qt_z = (
        xx * tx + xy * ty + xz * tz,
        xy * tx + yy * ty + yz * tz,
        xz * tx + yz * ty + zz * tz,
    )
    ss = qs_x * sx + qs_y * sy + qs_z * sz
    st = qs_x * tx + qs_y * ty + qs_z * tz
    tt = qt_x * tx + qt_y * ty + qt_z * tz
    return (
        1.0 + stiffness * (ss * ss + st * st),
        stiffness * st * (ss + tt),
        1.0 + stiffness * (st * st + tt * tt),
    )
