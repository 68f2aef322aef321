"""Collapse short edges, where every guard agrees.

Candidates are the edges below the limit, in the order of the arrays (sorting them by length gains
nothing). A collapse removes one end and moves the other to the midpoint or to the quadric point; it
owns the closed one-rings of both ends. Guards: curves, link condition, overshoot, foldover, sliver.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import distance_squared
from ..core.vocabulary import CURVE, DEAD, FROZEN, INNER, NON_MANIFOLD, NONE, Blocks, Mesh
from ..mesh.blocks import DONE, list_range, per_block, per_stage_block, stages, vertex_range
from ..mesh.walk import next_halfedge, previous_halfedge
from .classify import REMOVED, EdgeFlags, classify_edges, is_short
from .guards import collapse_makes_sliver, folds_over, keeps_curves, keeps_link, overshoots
from .outcomes import (
    COLLAPSED,
    KEPT_CURVE,
    KEPT_FOLDOVER,
    KEPT_LINK,
    KEPT_OVERSHOOT,
    KEPT_SLIVER,
    N_COLLAPSE_OUTCOMES,
    NO_LONGER_WANTED,
    NOT_OWNED,
)
from .rings import RING_CAPACITY, Rings, measure_normals, survey_rings

__all__ = [
    "CollapseLimits",
    "collapse_short_edges",
    "examine_edge",
    "remove_edge",
]

# Pull of the quadric point towards the midpoint, as a share of the planes' weight: without it flat
# regions have no minimum.
_REGULARISER = 0.03


# Along a curve the sheets on all sides must agree. Their own edges may become longer by this factor,
# and are split by the next sweep: otherwise one long edge somewhere keeps a curve of short ones.
_CURVE_SLACK = 1.5


class CollapseLimits(NamedTuple):
    """What a collapse may do; lengths as factors of the target length, the mean of an edge's ends."""

    shortest: float  # edges below are candidates
    longest: float  # no edge may become longer
    foldover_cosine: float  # cosine of the largest turn of a face normal
    quadric_reach: float  # largest distance of the quadric point from the midpoint; 0: midpoint
    sliver_check: bool  # the worst triangle must not get worse


def collapse_short_edges(
    mesh: Mesh,
    blocks: Blocks,
    limits: CollapseLimits,
    parallel: bool,
    flags: EdgeFlags | None = None,
) -> np.ndarray:
    """Collapse the short edges but for those with siblings; returns counts by outcome.

    ``flags`` are what `classify_edges` says of this mesh and these limits, where that is known.
    """
    if flags is None:
        flags = classify_edges(mesh, blocks, np.inf, limits.shortest, parallel)
    candidates = np.empty(mesh.origin.size, np.int32)
    count = np.zeros(len(blocks.face) - 1, np.int64)
    _list_short_edges(parallel, mesh, blocks, flags.mask, candidates, count)
    tally = np.zeros((len(count), N_COLLAPSE_OUTCOMES), np.int64)
    if count.any():
        for stage in stages(blocks):
            tally[:, NOT_OWNED] = 0
            _collapse(parallel, mesh, blocks, stage, limits, candidates, count, tally)
    return tally.sum(axis=0)


@threaded(per_block)
def _list_short_edges(span, mesh, blocks, mask, candidates, count):
    for k in range(span[0], span[1]):
        end = 3 * blocks.face[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            short = mask[f] >> 3
            if short == 0 or mask[f] == REMOVED:
                continue
            for i in range(3):
                h = 3 * f + i
                candidates[end] = h
                end += ((short >> i) & 1) & (mesh.twin[h] < h)
        count[k] = end - 3 * blocks.face[k]


@threaded(per_stage_block)
def _collapse(span, mesh, blocks, stage, limits, candidates, count, tally):
    for k in range(span[0], span[1]):
        low, high = vertex_range(blocks, stage, k)
        first, end = list_range(blocks, stage, k)
        rings = Rings(
            np.empty((2, RING_CAPACITY), np.int64),
            np.empty((2, RING_CAPACITY), np.int64),
            np.empty((2, RING_CAPACITY, 4)),
            np.empty((2, RING_CAPACITY, 4)),
            np.empty((2, 2), np.int64),
        )
        for j in range(first, end):
            for i in range(3 * blocks.face[j], 3 * blocks.face[j] + count[j]):
                h = np.int64(candidates[i])
                if h == DONE:
                    continue
                v = mesh.origin[h]
                if v < low or v >= high:  # another block's, or DEAD
                    continue
                outcome = _collapse_edge(mesh, h, low, high, limits, rings)
                tally[k, outcome] += 1
                if outcome != NOT_OWNED:
                    candidates[i] = DONE


@inlined
def _collapse_edge(mesh, h, low, high, limits, rings):
    """Collapse one edge if every guard agrees; returns the outcome."""
    c = mesh.curve[h]
    if c >= NON_MANIFOLD:
        return KEPT_CURVE
    outcome, x, y, z, s, n_a, n_b = examine_edge(mesh, h, low, high, limits, rings)
    if outcome == COLLAPSED:
        remove_edge(mesh, h, x, y, z, s, rings.face, n_a, n_b)
    return outcome


@inlined
def examine_edge(mesh, h, low, high, limits, rings):
    """Ask every guard, those first that refuse most for least.

    Returns the outcome, the new position and length, and the number of faces of both rings.
    """
    X = mesh.X
    a = np.int64(mesh.origin[h])
    b = np.int64(mesh.origin[next_halfedge(h)])
    if b < low or b >= high:
        return NOT_OWNED, 0.0, 0.0, 0.0, 0.0, 0, 0
    length = distance_squared(X, a, b)
    if not is_short(length, X[a, 3], X[b, 3], limits.shortest):
        return NO_LONGER_WANTED, 0.0, 0.0, 0.0, 0.0, 0, 0
    if not keeps_curves(mesh, h, a, b):
        return KEPT_CURVE, 0.0, 0.0, 0.0, 0.0, 0, 0
    # Three quarters of all candidates overshoot. Whether they do can be seen from the midpoint before
    # anything else is computed: straight ahead first, then on the way around the rings.
    kind = max(mesh.kind[a], mesh.kind[b])
    x, y, z, s = _meeting_point(mesh, a, b, False, False)
    half = 0.5 * limits.longest
    slack = _CURVE_SLACK if min(mesh.kind[a], mesh.kind[b]) == CURVE else 1.0
    if slack == 1.0 and _overshoots_ahead(mesh, h, x, y, z, s, low, high, half):
        return KEPT_OVERSHOOT, 0.0, 0.0, 0.0, 0.0, 0, 0
    refused = survey_rings(mesh, a, b, x, y, z, s, low, high, half, slack, rings)
    if refused != COLLAPSED:
        return refused, 0.0, 0.0, 0.0, 0.0, 0, 0
    n_a, n_b = rings.size[0, 0], rings.size[1, 0]
    if not keeps_link(mesh, h, rings):
        return KEPT_LINK, 0.0, 0.0, 0.0, 0.0, 0, 0
    sharp_a, sharp_b = measure_normals(mesh, a, b, rings)
    if kind == INNER and (sharp_a != sharp_b or limits.quadric_reach > 0.0):
        x, y, z, s = _meeting_point(mesh, a, b, sharp_a, sharp_b)
        if sharp_a == sharp_b:
            x, y, z = _quadric_point(mesh, x, y, z, limits.quadric_reach * s, rings)
        if overshoots(rings, x, y, z, s, a, b, half):
            return KEPT_OVERSHOOT, 0.0, 0.0, 0.0, 0.0, 0, 0
    outcome = COLLAPSED
    if folds_over(mesh, x, y, z, kind, a, b, rings, limits.foldover_cosine):
        outcome = KEPT_FOLDOVER
    elif limits.sliver_check and collapse_makes_sliver(mesh, x, y, z, a, b, rings.face, n_a, n_b):
        outcome = KEPT_SLIVER
    return outcome, x, y, z, s, n_a, n_b


@inlined
def _overshoots_ahead(mesh, h, x, y, z, s, low, high, half_factor):
    """Guard of `survey_rings` for the third vertex of both rings, straight ahead in most of them."""
    X = mesh.X
    for side in range(2):
        g = np.int64(mesh.twin[h]) if side else h
        for _ in range(3):
            if g != NONE:
                g = np.int64(mesh.twin[previous_halfedge(g)])
        if g == NONE:
            continue
        w = mesh.origin[next_halfedge(g)]
        if w < low or w >= high:
            continue
        dx, dy, dz = X[w, 0] - x, X[w, 1] - y, X[w, 2] - z
        limit = half_factor * (s + X[w, 3])
        if dx * dx + dy * dy + dz * dz > limit * limit:
            return True
    return False


@inlined
def _meeting_point(mesh, a, b, sharp_a, sharp_b):
    """Where the two ends meet: at the more constrained or sharper one, else in the middle.

    The target length there comes last.
    """
    X = mesh.X
    if mesh.kind[a] > mesh.kind[b] or (sharp_a and not sharp_b):
        return X[a, 0], X[a, 1], X[a, 2], X[a, 3]
    if mesh.kind[b] > mesh.kind[a] or (sharp_b and not sharp_a):
        return X[b, 0], X[b, 1], X[b, 2], X[b, 3]
    return (
        0.5 * (X[a, 0] + X[b, 0]),
        0.5 * (X[a, 1] + X[b, 1]),
        0.5 * (X[a, 2] + X[b, 2]),
        0.5 * (X[a, 3] + X[b, 3]),
    )


@inlined
def _quadric_point(mesh, x, y, z, reach, rings):
    """Point closest to the planes of both rings, weighted by area [Garland and Heckbert 1997]."""
    xx = xy = xz = yy = yz = zz = gx = gy = gz = weight = 0.0
    X = mesh.X
    for side in range(2):
        # All planes of a ring pass through its centre.
        v = mesh.origin[rings.face[side, 0]]
        dx, dy, dz = x - X[v, 0], y - X[v, 1], z - X[v, 2]
        for i in range(rings.size[side, 0]):
            norm = rings.normal[side, i, 3]
            if norm == 0.0:
                continue
            nx, ny, nz = (
                rings.normal[side, i, 0],
                rings.normal[side, i, 1],
                rings.normal[side, i, 2],
            )
            weight += norm
            nx_unit, ny_unit, nz_unit = nx / norm, ny / norm, nz / norm
            height = nx_unit * dx + ny_unit * dy + nz_unit * dz
            gx -= nx * height
            gy -= ny * height
            gz -= nz * height
            xx += nx * nx_unit
            xy += ny * nx_unit
            xz += nz * nx_unit
            yy += ny * ny_unit
            yz += nz * ny_unit
            zz += nz * nz_unit
    if weight == 0.0:
        return x, y, z
    pull = _REGULARISER * weight
    xx += pull
    yy += pull
    zz += pull
    c0 = yy * zz - yz * yz
    c1 = xz * yz - xy * zz
    c2 = xy * yz - xz * yy
    scale = 1.0 / (xx * c0 + xy * c1 + xz * c2)
    dx = (c0 * gx + c1 * gy + c2 * gz) * scale
    dy = (c1 * gx + (xx * zz - xz * xz) * gy + (xy * xz - xx * yz) * gz) * scale
    dz = (c2 * gx + (xy * xz - xx * yz) * gy + (xx * yy - xy * xy) * gz) * scale
    length = sqrt(dx * dx + dy * dy + dz * dz)
    if not length < np.inf:
        return x, y, z
    shrink = reach / length if length > reach else 1.0
    return x + shrink * dx, y + shrink * dy, z + shrink * dz


@inlined
def remove_edge(mesh, h, x, y, z, s, faces, n_a, n_b):
    """Close the edge's one or two faces and give the other faces of the removed end to the survivor."""
    twin = mesh.twin
    a = np.int64(mesh.origin[h])
    b = np.int64(mesh.origin[next_halfedge(h)])
    t = np.int64(twin[h])
    n = next_halfedge(h)
    tn = np.int64(twin[n])
    tp = np.int64(twin[previous_halfedge(h)])
    survivor, removed, side, count = a, b, 1, n_b
    if mesh.kind[b] > mesh.kind[a]:
        survivor, removed, side, count = b, a, 0, n_a
    # Where the survivor's one-ring will start: boundary vertices at their half-edge without twin.
    start = np.int64(mesh.vertex_halfedge[a])
    if t == NONE or twin[start] != NONE:
        start = np.int64(mesh.vertex_halfedge[b])
    inner = twin[start] != NONE
    if inner or start == n:
        start = tp
    elif t != NONE and start == next_halfedge(t):
        start = np.int64(twin[previous_halfedge(t)])
    excess = mesh.valence_excess[a] + mesh.valence_excess[b] + (1 if t == NONE else 2)

    _close_face(mesh, h, tn, tp)
    if t != NONE:
        _close_face(mesh, t, np.int64(twin[next_halfedge(t)]), np.int64(twin[previous_halfedge(t)]))
    for i in range(count):
        if mesh.origin[faces[side, i]] != DEAD:
            mesh.origin[faces[side, i]] = survivor
    mesh.vertex_halfedge[survivor] = start
    mesh.valence_excess[survivor] = excess
    mesh.vertex_halfedge[removed] = DEAD
    mesh.X[survivor, 0] = x
    mesh.X[survivor, 1] = y
    mesh.X[survivor, 2] = z
    mesh.X[survivor, 3] = s
    if mesh.kind[removed] == CURVE and mesh.kind[survivor] == CURVE:
        mesh.birth[survivor] = min(mesh.birth[a], mesh.birth[b])  # the same for all siblings


@inlined
def _close_face(mesh, h, tn, tp):
    """Remove the face of ``h`` and join the twins of its other two edges; at most one is on a curve."""
    p = previous_halfedge(h)
    apex = mesh.origin[p]
    curve = max(mesh.curve[next_halfedge(h)], mesh.curve[p])
    if min(mesh.curve[next_halfedge(h)], mesh.curve[p]) <= FROZEN:
        curve = min(mesh.curve[next_halfedge(h)], mesh.curve[p])
    if tn != NONE:
        mesh.twin[tn] = tp
        mesh.curve[tn] = curve
    if tp != NONE:
        mesh.twin[tp] = tn
        mesh.curve[tp] = curve
    if mesh.vertex_halfedge[apex] == p:
        mesh.vertex_halfedge[apex] = tn
    mesh.valence_excess[apex] -= 1
    f = h // 3
    mesh.origin[3 * f] = DEAD
    mesh.origin[3 * f + 1] = DEAD
    mesh.origin[3 * f + 2] = DEAD
