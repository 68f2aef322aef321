"""Untangle: move the vertices of the worst triangles until their smallest angle is acceptable.

Relaxation evens out areas, and now and then buys that with a bad triangle. Here only the corners of
triangles below an angle move, each to where the smallest angle of its one-ring is largest: a pattern
search in 8 directions of the tangent plane. A move owns the closed one-ring of its vertex.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import prange

from .._jit import driver, inlined
from .._types import DEAD, INNER, NONE, Blocks, Mesh
from ..edge_sets import DONE, list_range, stage_blocks, stages, vertex_range
from ..halfedge import following, previous

__all__ = ["untangle_vertices"]

# Hubs with more spokes are left alone.
_CAPACITY = 64

# Rounds of 8 trials; the step starts at a tenth of the mean spoke and halves where no trial is better.
_ROUNDS = 12
_FIRST_STEP = 0.1
_LAST_STEP = 0.006

_DIRECTIONS = np.stack(
    [np.cos(np.arange(8) * np.pi / 4.0), np.sin(np.arange(8) * np.pi / 4.0)], axis=1
)


def untangle_vertices(mesh: Mesh, blocks: Blocks, cosine: float, parallel: bool) -> int:
    """Improve rings with an angle below ``acos(cosine)``; returns how many vertices moved."""
    candidates = np.empty(mesh.vertex_halfedge.size, np.int32)
    count = np.zeros(len(blocks.face) - 1, np.int64)
    _find_bad_rings(parallel, mesh, blocks, cosine, candidates, count)
    moved = np.zeros(len(count), np.int64)
    if count.any():
        for stage in stages(blocks):
            _untangle(parallel, mesh, blocks, stage, cosine, candidates, count, moved)
    return int(moved.sum())


@driver
def _find_bad_rings(mesh, blocks, cosine, candidates, count):
    for k in prange(blocks.vertex.size - 1):
        ring = np.empty((_CAPACITY, 3))
        end = blocks.vertex[k]
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != INNER:
                continue
            n = _copy_ring(
                mesh.origin, mesh.twin, mesh.vertex_halfedge, mesh.X, v, 0, 1 << 40, ring
            )
            if n > 0:
                x, y, z = mesh.X[v, 0], mesh.X[v, 1], mesh.X[v, 2]
                if _largest_cosine(ring, n, x, y, z, 0.0, 0.0, 0.0) > cosine:
                    candidates[end] = v
                    end += 1
        count[k] = end - blocks.vertex[k]


@driver
def _untangle(mesh, blocks, stage, cosine, candidates, count, moved):
    for k in prange(stage_blocks(blocks, stage)):
        low, high = vertex_range(blocks, stage, k)
        first, end = list_range(blocks, stage, k)
        ring = np.empty((_CAPACITY, 3))
        for j in range(first, end):
            for i in range(blocks.vertex[j], blocks.vertex[j] + count[j]):
                v = np.int64(candidates[i])
                if v == DONE or v < low or v >= high:
                    continue
                n = _copy_ring(
                    mesh.origin, mesh.twin, mesh.vertex_halfedge, mesh.X, v, low, high, ring
                )
                if n > 0:
                    candidates[i] = DONE
                    moved[k] += _search(mesh.X, v, ring, n, cosine)


@inlined
def _copy_ring(origin, twin, vertex_halfedge, X, v, low, high, ring):
    """Copy the ring's coordinates; returns their number, 0 where one lies outside the range."""
    start = np.int64(vertex_halfedge[v])
    h = start
    for i in range(_CAPACITY):
        w = origin[following(h)]
        if w < low or w >= high:
            return 0
        ring[i, 0] = X[w, 0]
        ring[i, 1] = X[w, 1]
        ring[i, 2] = X[w, 2]
        h = np.int64(twin[previous(h)])
        if h == NONE:
            return 0
        if h == start:
            return i + 1
    return 0


@inlined
def _largest_cosine(ring, n, x, y, z, nx, ny, nz):
    """Cosine of the smallest angle around (x, y, z); 2 where a face turns away from the normal."""
    worst = -1.0
    px, py, pz = ring[n - 1, 0] - x, ring[n - 1, 1] - y, ring[n - 1, 2] - z
    pp = px * px + py * py + pz * pz
    for i in range(n):
        qx, qy, qz = ring[i, 0] - x, ring[i, 1] - y, ring[i, 2] - z
        qq = qx * qx + qy * qy + qz * qz
        pq = px * qx + py * qy + pz * qz
        turn = nx * (py * qz - pz * qy) + ny * (pz * qx - px * qz) + nz * (px * qy - py * qx)
        if turn < 0.0:
            return 2.0
        rr = pp + qq - 2.0 * pq
        # The smallest angle lies opposite the shortest side.
        if rr <= pp and rr <= qq:
            cosine = pq / sqrt(pp * qq)
        elif pp <= qq:
            cosine = (qq - pq) / sqrt(qq * rr)
        else:
            cosine = (pp - pq) / sqrt(pp * rr)
        if not cosine <= 1.0:
            return 2.0
        worst = max(worst, cosine)
        px, py, pz, pp = qx, qy, qz, qq
    return worst


@inlined
def _search(X, v, ring, n, cosine):
    """Pattern search; returns 1 if the vertex moved."""
    x, y, z = X[v, 0], X[v, 1], X[v, 2]
    nx = ny = nz = length = 0.0
    px, py, pz = ring[n - 1, 0] - x, ring[n - 1, 1] - y, ring[n - 1, 2] - z
    for i in range(n):
        qx, qy, qz = ring[i, 0] - x, ring[i, 1] - y, ring[i, 2] - z
        nx += py * qz - pz * qy
        ny += pz * qx - px * qz
        nz += px * qy - py * qx
        length += sqrt(qx * qx + qy * qy + qz * qz)
        px, py, pz = qx, qy, qz
    length /= n
    norm = sqrt(nx * nx + ny * ny + nz * nz)
    if norm == 0.0:
        return 0
    nx, ny, nz = nx / norm, ny / norm, nz / norm
    # A basis of the tangent plane [Duff et al. 2017].
    sign = 1.0 if nz >= 0.0 else -1.0
    p = -1.0 / (sign + nz)
    q = nx * ny * p
    sx, sy, sz = 1.0 + sign * nx * nx * p, sign * q, -sign * nx
    tx, ty, tz = q, sign + ny * ny * p, -ny
    best = _largest_cosine(ring, n, x, y, z, nx, ny, nz)
    step = _FIRST_STEP
    moved = 0
    for _ in range(_ROUNDS):
        if best <= cosine or step < _LAST_STEP:
            break
        bx, by, bz = x, y, z
        better = best
        for i in range(8):
            s = step * length * _DIRECTIONS[i, 0]
            t = step * length * _DIRECTIONS[i, 1]
            cx, cy, cz = x + s * sx + t * tx, y + s * sy + t * ty, z + s * sz + t * tz
            trial = _largest_cosine(ring, n, cx, cy, cz, nx, ny, nz)
            if trial < better:
                bx, by, bz, better = cx, cy, cz, trial
        if better < best:
            x, y, z, best = bx, by, bz, better
            moved = 1
        else:
            step *= 0.5
    X[v, 0], X[v, 1], X[v, 2] = x, y, z
    return moved
