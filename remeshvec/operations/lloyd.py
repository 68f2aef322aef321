"""Lloyd rounds: every vertex moves towards the centroid of its Voronoi cell [Lloyd 1982].

A fixed point is a centroidal Voronoi tessellation [Du et al. 1999], whose cells are as even as can be
[Gersho 1979]. Cells are taken from the triangles: half cells between a corner, the midpoint of a side and
the circumcentre, which in an obtuse triangle is moved to the midpoint of its longest side. All of them
are summed in one pass over the faces. Vertices keep a part of their velocity [heavy ball: Polyak 1964],
which reaches in 24 rounds what takes 100 without.

Where target lengths vary, half cells have the density ``L^-4``: in the plane, cells of a centroidal
tessellation have areas that go with the density to the power of -1/2.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from ..core.compiler import add_moment, inlined, threaded
from ..core.vocabulary import DEAD, Blocks, FloatArray, Mesh
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

__all__ = ["Pace", "run_lloyd_round", "turn_velocities"]

# Weights of the lengths at a corner, at the other end of the side, and at the third corner in that of a
# half cell. Its centroid has (.611, .278, .111), but densities at centroids carry only 87 % of the
# gradient over a cell.
_OWN, _BESIDE, _ACROSS = 0.551, 0.321, 0.128


class Pace(NamedTuple):
    """How vertices move in Lloyd rounds."""

    gain: float  # share of the way to the centroid that is added to the velocity
    momentum: float  # share of the velocity that stays
    reach: float  # longest step, in target lengths: without it rounds on thin parts blow up


def run_lloyd_round(
    mesh: Mesh,
    blocks: Blocks,
    frames: FloatArray,
    velocity: FloatArray,
    pace: Pace,
    varies: bool,
    parallel: bool,
) -> None:
    """Move all vertices once.

    Parameters
    ----------
    mesh : Mesh
    blocks : Blocks
    frames : (n, 6) float64
        From `frames.measure_frames`; they may be some rounds old.
    velocity : (n, 3) float64
        Of every vertex, from the round before; changed in place.
    pace : Pace
    varies : bool
        Whether target lengths vary.
    parallel : bool
    """
    sums = np.empty((mesh.vertex_halfedge.size, 4))
    across = make_candidates(blocks.face)
    _sum_cells(parallel, mesh, blocks, varies, sums, across)
    for stage in stages(blocks)[1:]:
        _sum_cells_across(parallel, mesh, blocks, stage, varies, sums, across)
    _move(parallel, mesh, blocks, frames, velocity, pace, sums)


def turn_velocities(
    mesh: Mesh, blocks: Blocks, frames: FloatArray, velocity: FloatArray, parallel: bool
) -> None:
    """Turn velocities into new frames.

    Without this, a momentum near 1 carries vertices off thin ridges: the Hausdorff distance of a rough
    mesh went up by half, now by a few percent.
    """
    _turn(parallel, mesh, blocks, frames, velocity)


@threaded(per_block)
def _turn(span, mesh, blocks, frames, velocity):
    """Apply frames to velocities."""
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            velocity[v, 0], velocity[v, 1], velocity[v, 2] = _framed(
                frames, v, (velocity[v, 0], velocity[v, 1], velocity[v, 2])
            )


@inlined
def _framed(frames, v, step):
    """Apply the frame of a vertex to a vector."""
    dx, dy, dz = step
    xx, xy, xz = frames[v, 0], frames[v, 1], frames[v, 2]
    yy, yz, zz = frames[v, 3], frames[v, 4], frames[v, 5]
    return (
        xx * dx + xy * dy + xz * dz,
        xy * dx + yy * dy + yz * dz,
        xz * dx + yz * dy + zz * dz,
    )


@threaded(per_block)
def _sum_cells(span, mesh, blocks, varies, sums, across):
    """Sum half cells over the faces inside a block; lists the faces across borders."""
    for k in range(span[0], span[1]):
        owned = low, high = blocks.vertex[k], blocks.vertex[k + 1]
        sums[low:high] = 0.0
        end = across.starts[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a, b, c = corners_of(mesh.origin, f)
            if a == DEAD:
                continue
            if owns_all(owned, a, b, c):
                _add_cells(mesh.X, a, b, c, varies, sums)
            else:
                across.items[end] = f
                end += 1
        across.counts[k] = end - across.starts[k]


@threaded(per_stage_block)
def _sum_cells_across(span, mesh, blocks, stage, varies, sums, across):
    """Add the faces across borders."""
    for k in range(span[0], span[1]):
        owned = vertex_range(blocks, stage, k)
        for i in slots(across, blocks, stage, k):
            f = across.items[i]
            if f != DONE:
                a, b, c = corners_of(mesh.origin, f)
                if owns_all(owned, a, b, c):
                    _add_cells(mesh.X, a, b, c, varies, sums)
                    across.items[i] = DONE


@inlined
def _add_cells(X, a, b, c, varies, sums):
    """Add the half cells of a face to its corners: three times first moment, and weight.

    Both are in units of a quarter of the area.
    """
    ux, uy, uz = X[c, 0] - X[b, 0], X[c, 1] - X[b, 1], X[c, 2] - X[b, 2]
    vx, vy, vz = X[a, 0] - X[c, 0], X[a, 1] - X[c, 1], X[a, 2] - X[c, 2]
    wx, wy, wz = X[b, 0] - X[a, 0], X[b, 1] - X[a, 1], X[b, 2] - X[a, 2]
    ga, gb, gc, norm = _circumcentre(
        ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz
    )
    # The half cells on both sides of a side are as large as each other: at a side opposite c, gc.
    ab = ba = norm * gc
    bc = cb = norm * ga
    ca = ac = norm * gb
    if varies:
        la, lb, lc = X[a, 3], X[b, 3], X[c, 3]
        ab *= _density(la, lb, lc)
        ac *= _density(la, lc, lb)
        ba *= _density(lb, la, lc)
        bc *= _density(lb, lc, la)
        ca *= _density(lc, la, lb)
        cb *= _density(lc, lb, la)
    s = ab + ac
    add_moment(sums, a, X, (a, b, c), 0.5 * ab + s * gb, 0.5 * ac + s * gc, s)
    s = bc + ba
    add_moment(sums, b, X, (b, c, a), 0.5 * bc + s * gc, 0.5 * ba + s * ga, s)
    s = ca + cb
    add_moment(sums, c, X, (c, a, b), 0.5 * ca + s * ga, 0.5 * cb + s * gb, s)


@inlined
def _circumcentre(u, v, w):
    """Barycentric weights of the circumcentre of a triangle with these squared sides, and twice its area.

    An obtuse triangle has the midpoint of its longest side instead, one without area nothing.
    """
    ga, gb, gc = u * (v + w - u), v * (w + u - v), w * (u + v - w)
    total = ga + gb + gc  # four times the square of twice the area
    if not total > 0.0:
        return 0.0, 0.0, 0.0, 0.0
    norm = 0.5 * sqrt(total)
    if ga <= 0.0:
        return 0.0, 0.5, 0.5, norm
    if gb <= 0.0:
        return 0.5, 0.0, 0.5, norm
    if gc <= 0.0:
        return 0.5, 0.5, 0.0, norm
    scale = 1.0 / total
    return ga * scale, gb * scale, gc * scale, norm


@inlined
def _density(own, beside, across):
    """Density of a half cell, relative to that at its corner, from the target lengths at all three."""
    ratio = own / (_OWN * own + _BESIDE * beside + _ACROSS * across)
    return (ratio * ratio) * (ratio * ratio)


@threaded(per_block)
def _move(span, mesh, blocks, frames, velocity, pace, sums):
    """Add the way to the centroid to the velocity, and the velocity to the position."""
    X = mesh.X  # changed in place: a vertex reads the sums and its own row
    for k in range(span[0], span[1]):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            scale = pace.gain / (3.0 * sums[v, 3]) if sums[v, 3] > 0.0 else 0.0
            step = sums[v, 0] * scale, sums[v, 1] * scale, sums[v, 2] * scale
            dx, dy, dz = _framed(frames, v, step)
            x = pace.momentum * velocity[v, 0] + dx
            y = pace.momentum * velocity[v, 1] + dy
            z = pace.momentum * velocity[v, 2] + dz
            squared, limit = x * x + y * y + z * z, pace.reach * X[v, 3]
            if squared > limit * limit:
                shorter = limit / sqrt(squared)
                x *= shorter
                y *= shorter
                z *= shorter
            velocity[v, 0], velocity[v, 1], velocity[v, 2] = x, y, z
            X[v, 0] += x
            X[v, 1] += y
            X[v, 2] += z
