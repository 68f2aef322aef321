"""Untangle: move the vertices of the worst triangles until these are acceptable.

Relaxation evens out areas, and now and then makes a bad triangle. Here only the corners of such
triangles move, each to where the smallest angle of its one-ring is largest: a pattern search in 8
directions of the tangent plane. A move owns the closed one-ring of its vertex.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import distance_squared, face_vector, point, tangent_basis, turn_exceeds
from ..core.vocabulary import DEAD, INNER, NONE, Blocks, Mesh, Tree
from ..mesh.blocks import (
    DONE,
    Candidates,
    make_candidates,
    owns,
    per_block,
    per_stage_block,
    slots,
    stages,
    vertex_range,
)
from ..mesh.walk import corners_of, end_of, next_spoke
from ..reference.bvh import point_on_face, walk_to_face

__all__ = ["untangle_vertices"]

# Hubs with more spokes are left alone.
_CAPACITY = 64

# Rounds of 8 trials; the step starts at a tenth of the mean spoke and halves where no trial is better.
_SEARCH_ROUNDS = 12
_FIRST_STEP = 0.1
_LAST_STEP = 0.006

_DIRECTIONS = np.stack(
    [np.cos(np.arange(8) * np.pi / 4.0), np.sin(np.arange(8) * np.pi / 4.0)], axis=1
)

# Cost of a ring with a face that has no area or turns over.
_REFUSED = 1e30


class Search(NamedTuple):
    """What a search looks for, and where."""

    on_surface: bool  # trial positions are walked to the reference surface
    limit: float  # cost at which a ring is good enough


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
    finds, so that no later projection spoils the gain. Rounds after the first look at rings that the
    previous round has changed.
    """
    n = mesh.vertex_halfedge.size
    candidates = make_candidates(blocks.vertex)
    moved = np.ones(n, np.uint8)
    total = 0
    for _ in range(rounds):
        bad, near = np.zeros(n, np.uint8), np.zeros(n, np.uint8)
        _mark_bad_faces(parallel, mesh, blocks, limit, moved, bad, near)
        _list_marked(parallel, mesh, blocks, bad, near, candidates)
        search = Search(on_surface, limit)
        moved = _search_rings(mesh, blocks, tree, search, candidates, parallel)
        n_moved = int(np.count_nonzero(moved))
        if not n_moved:
            break
        total += n_moved
    return total


def _search_rings(
    mesh: Mesh, blocks: Blocks, tree: Tree, search: Search, candidates: Candidates, parallel: bool
) -> np.ndarray:
    """Search for better places of the candidates; returns marks of the vertices that moved."""
    moved = np.zeros(mesh.vertex_halfedge.size, np.uint8)
    if candidates.counts.any():
        for stage in stages(blocks):
            _untangle(parallel, mesh, blocks, stage, tree, search, candidates, moved)
    return moved


@threaded(per_block)
def _mark_bad_faces(span, mesh, blocks, limit, moved, bad, near):
    """Mark the corners of faces with a small angle, and those of faces with a moved corner.

    Blocks may mark the same vertex, with the same value.
    """
    X = mesh.X
    for k in range(span[0], span[1]):
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a, b, c = corners_of(mesh.origin, f)
            if a == DEAD or not moved[a] | moved[b] | moved[c]:
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
def _list_marked(span, mesh, blocks, bad, near, candidates):
    """List the inner vertices with both marks."""
    for k in range(span[0], span[1]):
        end = candidates.starts[k]
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            candidates.items[end] = v
            end += (bad[v] & near[v]) == 1 and mesh.kind[v] == INNER
        candidates.counts[k] = end - candidates.starts[k]


@threaded(per_stage_block)
def _untangle(span, mesh, blocks, stage, tree, search, candidates, moved):
    """Move the candidates whose closed one-ring the blocks of a stage own."""
    for k in range(span[0], span[1]):
        owned = vertex_range(blocks, stage, k)
        ring = np.empty((_CAPACITY, 3))
        for i in slots(candidates, blocks, stage, k):
            v = candidates.items[i]
            if v == DONE or not owns(owned, v):
                continue
            n = _copy_ring(mesh, v, owned, ring)
            if n > 0:
                candidates.items[i] = DONE
                moved[v] = _search(mesh, v, ring, n, tree, search)


@inlined
def _copy_ring(mesh, v, owned, ring):
    """Copy the ring's coordinates; returns their number, 0 if one lies outside the block's range."""
    start = mesh.vertex_halfedge[v]
    h = start
    for i in range(_CAPACITY):
        w = end_of(mesh.origin, h)
        if not owns(owned, w):
            return 0
        ring[i, 0], ring[i, 1], ring[i, 2] = point(mesh.X, w)
        h = next_spoke(mesh.twin, h)
        if h == NONE:
            return 0
        if h == start:
            return i + 1
    return 0


@inlined
def _search(mesh, v, ring, n, tree, search):
    """Search for the place of a vertex with the lowest cost; returns 1 if the vertex moved."""
    home = point(mesh.X, v)
    length, basis = _tangent_plane(ring, n, home)
    if length == 0.0:
        return 0
    p, face = home, mesh.birth[v] // 3
    best = _cost(ring, n, p, home)
    step = _FIRST_STEP
    moved = 0
    for _ in range(_SEARCH_ROUNDS):
        if best <= search.limit or step < _LAST_STEP:
            break
        better_p, better_face, better = p, face, best
        for i in range(8):
            q, f = _trial(tree, p, face, basis, step * length, i, search.on_surface)
            trial = _cost(ring, n, q, home)
            if trial < better:
                better_p, better_face, better = q, f, trial
        if better < best:
            p, face, best = better_p, better_face, better
            moved = 1
        else:
            step *= 0.5
    if moved:
        mesh.X[v, 0], mesh.X[v, 1], mesh.X[v, 2] = p
        mesh.birth[v] = 3 * face
    return moved


@inlined
def _tangent_plane(ring, n, p):
    """Return the mean spoke and two tangent vectors of a ring; a length of 0 where it has no normal."""
    x, y, z = p
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
        return 0.0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return length, tangent_basis(nx / norm, ny / norm, nz / norm)


@inlined
def _trial(tree, p, face, basis, step, i, on_surface):
    """Return the trial position in direction ``i``, and the reference face to walk from there."""
    x, y, z = p
    sx, sy, sz, tx, ty, tz = basis
    s = step * _DIRECTIONS[i, 0]
    t = step * _DIRECTIONS[i, 1]
    q = x + s * sx + t * tx, y + s * sy + t * ty, z + s * sz + t * tz
    if on_surface:
        face, s, t, _ = walk_to_face(tree, q, face)
        q = point_on_face(tree.corners, face, s, t)
    return q, face


@inlined
def _cost(ring, n, p, home):
    """Cost of a ring around ``p``: the cosine of its smallest angle.

    Refused where a face has no area or turns over against the ring around ``home``.
    """
    x, y, z = p
    worst = -1.0
    u = ring[n - 1, 0] - x, ring[n - 1, 1] - y, ring[n - 1, 2] - z
    uu = _dot(u, u)
    for i in range(n):
        w = ring[i, 0] - x, ring[i, 1] - y, ring[i, 2] - z
        ww = _dot(w, w)
        uw = _dot(u, w)
        cost = _angle_cost(uu, ww, uw)
        if not cost < 1.0:
            return _REFUSED
        worst = max(worst, cost)
        if (x != home[0] or y != home[1] or z != home[2]) and _turns_over(ring, n, i, home, u, w):
            return _REFUSED
        u, uu = w, ww
    return worst


@inlined
def _dot(u, w):
    return u[0] * w[0] + u[1] * w[1] + u[2] * w[2]


@inlined
def _angle_cost(uu, ww, uw):
    """Cosine of the smallest angle of a triangle, from the scalar products of two of its sides.

    Not below 1 (1 or NaN) for a triangle without area.
    """
    rr = uu + ww - 2.0 * uw
    # The smallest angle lies opposite the shortest side.
    if rr <= uu and rr <= ww:
        return uw / sqrt(uu * ww)
    if uu <= ww:
        return (ww - uw) / sqrt(ww * rr)
    return (uu - uw) / sqrt(uu * rr)


@inlined
def _turns_over(ring, n, i, home, u, w):
    """Tell whether a face turns by more than 60 degrees against the same face around ``home``.

    Against the vertex normal instead, rings around tips would never improve: they have faces on all
    sides.
    """
    j = i - 1 if i > 0 else n - 1
    old = ox, oy, oz = face_vector(home, point(ring, j), point(ring, i))
    ux, uy, uz = u
    wx, wy, wz = w
    new = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    return ox * ox + oy * oy + oz * oz > 0.0 and turn_exceeds(old, new, 0.5)
