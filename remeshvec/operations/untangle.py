"""Untangle: move the vertices of the worst triangles until these are acceptable.

Relaxation evens out areas, and now and then buys that with a bad triangle. Here only the corners of
such triangles move, each to where the worst of its one-ring is best: a pattern search in 8 directions
of the tangent plane. The worst has the smallest angle; or else its centroid lies farthest from the
reference surface, or its circumcircle is the largest for its target length, which says how far from a
curved surface its points lie at most. A move owns the closed one-ring of its vertex.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, threaded
from ..core.geometry import distance_squared, face_vector, point, tangent_basis, turn_exceeds
from ..core.vocabulary import DEAD, INNER, NONE, Blocks, IndexArray, Mesh, Tree
from ..mesh.blocks import DONE, list_range, per_block, per_stage_block, stages, vertex_range
from ..mesh.walk import next_halfedge, previous_halfedge
from ..reference.bvh import point_on_face, walk_to_face

__all__ = ["approach_vertices", "untangle_vertices"]

# Hubs with more spokes are left alone.
_CAPACITY = 64

# Rounds of 8 trials; the step starts at a tenth of the mean spoke and halves where no trial is better.
_SEARCH_ROUNDS = 12
_FIRST_STEP = 0.1
_LAST_STEP = 0.006

_DIRECTIONS = np.stack(
    [np.cos(np.arange(8) * np.pi / 4.0), np.sin(np.arange(8) * np.pi / 4.0)], axis=1
)


def untangle_vertices(
    mesh: Mesh,
    blocks: Blocks,
    tree: Tree,
    on_surface: bool,
    limit: float,
    rounds: int,
    parallel: bool,
) -> int:
    """Improve rings with an angle below ``acos(limit)``; returns how many vertices moved.

    With ``on_surface`` every trial position is the closest point that a walk on the reference surface
    finds, so that no projection spoils afterwards what was gained. Rounds after the first look at rings
    that the one before has changed.
    """
    n = mesh.vertex_halfedge.size
    candidates = np.empty(n, np.int32)
    moved = np.ones(n, np.uint8)
    total = 0
    for _ in range(rounds):
        bad, near = np.zeros(n, np.uint8), np.zeros(n, np.uint8)
        _mark_bad_faces(parallel, mesh, blocks, limit, moved, bad, near)
        count = np.zeros(len(blocks.face) - 1, np.int64)
        _list_marked(parallel, mesh, blocks, bad, near, candidates, count)
        moved[:] = 0
        _search_rings(
            mesh, blocks, tree, on_surface, limit, 0.0, candidates, count, moved, parallel
        )
        n_moved = int(np.count_nonzero(moved))
        if not n_moved:
            break
        total += n_moved
    return total


def approach_vertices(
    mesh: Mesh,
    blocks: Blocks,
    tree: Tree,
    on_surface: bool,
    limit: float,
    distance: float,
    parallel: bool,
) -> int:
    """Improve rings with a face whose centroid is farther than a distance from the reference surface.

    ``limit`` is a squared circumradius in squared target lengths that costs as much as the distance.
    Returns how many vertices moved.
    """
    n = mesh.vertex_halfedge.size
    candidates = np.empty(n, np.int32)
    count = np.zeros(len(blocks.face) - 1, np.int64)
    weight = limit / distance**2  # both costs against one limit
    _find_far_rings(parallel, mesh, blocks, tree, limit, weight, candidates, count)
    moved = np.zeros(n, np.uint8)
    _search_rings(mesh, blocks, tree, on_surface, limit, weight, candidates, count, moved, parallel)
    return int(np.count_nonzero(moved))


def _search_rings(
    mesh: Mesh,
    blocks: Blocks,
    tree: Tree,
    on_surface: bool,
    limit: float,
    weight: float,
    candidates: IndexArray,
    count: NDArray[np.int64],
    moved: NDArray[np.uint8],
    parallel: bool,
) -> None:
    if count.any():
        for stage in stages(blocks):
            _untangle(
                parallel, mesh, blocks, stage, tree, on_surface, limit, weight, candidates, count, moved
            )  # fmt: skip


@threaded(per_block)
def _mark_bad_faces(span, mesh, blocks, limit, moved, bad, near):
    """Mark the corners of faces with a small angle, and those of faces with a moved corner.

    Blocks may mark the same vertex, with the same value.
    """
    X = mesh.X
    for k in range(span[0], span[1]):
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a = mesh.origin[3 * f]
            if a == DEAD:
                continue
            b = mesh.origin[3 * f + 1]
            c = mesh.origin[3 * f + 2]
            if not moved[a] | moved[b] | moved[c]:
                continue
            near[a] = 1
            near[b] = 1
            near[c] = 1
            l0 = distance_squared(X, a, b)
            l1 = distance_squared(X, b, c)
            l2 = distance_squared(X, c, a)
            # The smallest angle lies opposite the shortest side, between the two others.
            shortest = min(l0, l1, l2)
            product = l0 * l1 * l2 / shortest
            dot = 0.5 * (l0 + l1 + l2) - shortest
            if not dot * dot <= limit * limit * product:
                bad[a] = 1
                bad[b] = 1
                bad[c] = 1


@threaded(per_block)
def _list_marked(span, mesh, blocks, bad, near, candidates, count):
    for k in range(span[0], span[1]):
        end = blocks.vertex[k]
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            candidates[end] = v
            end += (bad[v] & near[v]) == 1 and mesh.kind[v] == INNER
        count[k] = end - blocks.vertex[k]


@threaded(per_block)
def _find_far_rings(span, mesh, blocks, tree, limit, weight, candidates, count):
    for k in range(span[0], span[1]):
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
                face = np.int64(mesh.birth[v]) // 3
                # Only a distance makes a ring bad, not a circle alone: the surface may be flat there.
                if _cost(ring, n, x, y, z, x, y, z, weight, 0.0, tree, face) > limit:
                    candidates[end] = v
                    end += 1
        count[k] = end - blocks.vertex[k]


@threaded(per_stage_block)
def _untangle(span, mesh, blocks, stage, tree, on_surface, limit, weight, candidates, count, moved):
    for k in range(span[0], span[1]):
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
                    moved[v] = _search(
                        mesh.X, mesh.birth, v, ring, n, tree, on_surface, limit, weight
                    )


@inlined
def _copy_ring(origin, twin, vertex_halfedge, X, v, low, high, ring):
    """Copy the ring's coordinates; returns their number, 0 where one lies outside the range."""
    start = np.int64(vertex_halfedge[v])
    h = start
    for i in range(_CAPACITY):
        w = origin[next_halfedge(h)]
        if w < low or w >= high:
            return 0
        ring[i, 0] = X[w, 0]
        ring[i, 1] = X[w, 1]
        ring[i, 2] = X[w, 2]
        h = np.int64(twin[previous_halfedge(h)])
        if h == NONE:
            return 0
        if h == start:
            return i + 1
    return 0


@inlined
def _cost(ring, n, x, y, z, x0, y0, z0, weight, scale, tree, face):
    """Cosine of the smallest angle around (x, y, z); with a weight, what `untangle_vertices` says.

    1e30 where a face has no area or turns by more than 60 degrees against the ring around (x0, y0, z0).
    Against the vertex normal instead, rings around tips never improve: they have faces on all sides.
    """
    worst = -1.0
    px, py, pz = ring[n - 1, 0] - x, ring[n - 1, 1] - y, ring[n - 1, 2] - z
    pp = px * px + py * py + pz * pz
    for i in range(n):
        qx, qy, qz = ring[i, 0] - x, ring[i, 1] - y, ring[i, 2] - z
        qq = qx * qx + qy * qy + qz * qz
        pq = px * qx + py * qy + pz * qz
        rr = pp + qq - 2.0 * pq
        # The smallest angle lies opposite the shortest side.
        if rr <= pp and rr <= qq:
            cosine = pq / sqrt(pp * qq)
        elif pp <= qq:
            cosine = (qq - pq) / sqrt(qq * rr)
        else:
            cosine = (pp - pq) / sqrt(pp * rr)
        if not cosine < 1.0:
            return 1e30
        if weight > 0.0:
            centroid = x + (px + qx) / 3.0, y + (py + qy) / 3.0, z + (pz + qz) / 3.0
            _, _, _, d = walk_to_face(tree, centroid, face)
            nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
            radius = 0.25 * pp * qq * rr / (nx * nx + ny * ny + nz * nz)
            cosine = max(weight * d, scale * radius)
        worst = max(worst, cosine)
        if x != x0 or y != y0 or z != z0:
            j = i - 1 if i > 0 else n - 1
            ox, oy, oz = face_vector((x0, y0, z0), point(ring, j), point(ring, i))
            nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
            if ox * ox + oy * oy + oz * oz > 0.0 and turn_exceeds((ox, oy, oz), (nx, ny, nz), 0.5):
                return 1e30
        px, py, pz, pp = qx, qy, qz, qq
    return worst


@inlined
def _search(X, birth, v, ring, n, tree, on_surface, limit, weight):
    """Pattern search; returns 1 if the vertex moved."""
    x, y, z = X[v, 0], X[v, 1], X[v, 2]
    scale = 1.0 / X[v, 3] ** 2
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
    sx, sy, sz, tx, ty, tz = tangent_basis(nx / norm, ny / norm, nz / norm)
    face = np.int64(birth[v]) // 3
    best = _cost(ring, n, x, y, z, x, y, z, weight, scale, tree, face)
    step = _FIRST_STEP
    moved = 0
    for _ in range(_SEARCH_ROUNDS):
        if best <= limit or step < _LAST_STEP:
            break
        bx, by, bz, better_face = x, y, z, face
        better = best
        for i in range(8):
            s = step * length * _DIRECTIONS[i, 0]
            t = step * length * _DIRECTIONS[i, 1]
            cx, cy, cz = x + s * sx + t * tx, y + s * sy + t * ty, z + s * sz + t * tz
            f = face
            if on_surface:
                f, s, t, _ = walk_to_face(tree, (cx, cy, cz), face)
                cx, cy, cz = point_on_face(tree.corners, f, s, t)
            trial = _cost(ring, n, cx, cy, cz, X[v, 0], X[v, 1], X[v, 2], weight, scale, tree, f)
            if trial < better:
                bx, by, bz, better_face, better = cx, cy, cz, f, trial
        if better < best:
            x, y, z, face, best = bx, by, bz, better_face, better
            moved = 1
        else:
            step *= 0.5
    if moved:
        X[v, 0], X[v, 1], X[v, 2] = x, y, z
        birth[v] = 3 * face
    return moved
