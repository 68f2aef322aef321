"""Collapse short edges where every guard agrees.

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
from ..core.vocabulary import CURVE, DEAD, INNER, NONE, Blocks, Mesh
from ..mesh.blocks import (
    DONE,
    make_candidates,
    owns,
    per_block,
    per_stage_block,
    slots,
    stages,
    vertex_range,
)
from ..mesh.edge_curves import is_locked, is_non_manifold
from ..mesh.walk import end_of, next_halfedge, next_spoke, previous_halfedge
from .classify import REMOVED, EdgeFlags, classify_edges, is_short
from .guards import (
    collapse_makes_sliver,
    folds_over,
    keeps_curves,
    keeps_link,
    overshoots,
    overshoots_ahead,
)
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
from .rings import RING_CAPACITY, Rings, measure_normals, place_of, survey_rings

__all__ = ["CollapseLimits", "collapse_short_edges", "examine_edge", "remove_edge"]

# Pull of the quadric point towards the midpoint, as a share of the planes' weight: without it flat
# regions have no minimum.
_REGULARISER = 0.03

# Along a curve the sheets on all sides must agree. Their own edges may become longer by this factor,
# and are split by the next sweep: otherwise one long edge somewhere keeps a curve of short ones.
_CURVE_SLACK = 1.5

# The place of an edge that stays.
_NOWHERE = (0.0, 0.0, 0.0, 0.0)


class CollapseLimits(NamedTuple):
    """What a collapse may do; lengths are factors of the mean target length of an edge's ends."""

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
    """Collapse the short edges, except those with siblings; returns counts by outcome.

    ``flags`` is the result of `classify_edges` for this mesh and these limits, if it is known.
    """
    if flags is None:
        flags = classify_edges(mesh, blocks, np.inf, limits.shortest, parallel)
    candidates = make_candidates(3 * blocks.face)
    _list_short_edges(parallel, mesh, blocks, flags.mask, candidates)
    tally = np.zeros((len(blocks.face) - 1, N_COLLAPSE_OUTCOMES), np.int64)
    if candidates.counts.any():
        for stage in stages(blocks):
            tally[:, NOT_OWNED] = 0
            _collapse(parallel, mesh, blocks, stage, limits, candidates, tally)
    return tally.sum(axis=0)


@threaded(per_block)
def _list_short_edges(span, mesh, blocks, mask, candidates):
    """List every short edge once, by the later of its half-edges."""
    for k in range(span[0], span[1]):
        end = candidates.starts[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            short = mask[f] >> 3
            if short == 0 or mask[f] == REMOVED:
                continue
            for i in range(3):
                h = 3 * f + i
                candidates.items[end] = h
                end += ((short >> i) & 1) & (mesh.twin[h] < h)
        candidates.counts[k] = end - candidates.starts[k]


@threaded(per_stage_block)
def _collapse(span, mesh, blocks, stage, limits, candidates, tally):
    """Collapse the candidates that the blocks of a stage own."""
    for k in range(span[0], span[1]):
        owned = vertex_range(blocks, stage, k)
        rings = Rings(
            np.empty((2, RING_CAPACITY), np.int64),
            np.empty((2, RING_CAPACITY), np.int64),
            np.empty((2, RING_CAPACITY, 4)),
            np.empty((2, RING_CAPACITY, 4)),
            np.empty((2, 2), np.int64),
        )
        for i in slots(candidates, blocks, stage, k):
            h = candidates.items[i]
            if h == DONE or not owns(owned, mesh.origin[h]):  # another block's, or DEAD
                continue
            outcome = _collapse_edge(mesh, h, owned, limits, rings)
            tally[k, outcome] += 1
            if outcome != NOT_OWNED:
                candidates.items[i] = DONE


@inlined
def _collapse_edge(mesh, h, owned, limits, rings):
    """Collapse one edge if every guard agrees; returns the outcome."""
    if is_non_manifold(mesh.curve[h]):
        return KEPT_CURVE
    outcome, place = examine_edge(mesh, h, owned, limits, rings)
    if outcome == COLLAPSED:
        remove_edge(mesh, h, place, rings)
    return outcome


@inlined
def examine_edge(mesh, h, owned, limits, rings):
    """Ask every guard, first the cheap ones that refuse most.

    Returns the outcome, and the place where the two ends would meet; fills in the rings.
    """
    a, b = mesh.origin[h], end_of(mesh.origin, h)
    outcome = _examine_alone(mesh, h, a, b, owned, limits)
    if outcome != COLLAPSED:
        return outcome, _NOWHERE
    # Three quarters of all candidates overshoot. The midpoint tells, before anything else is computed:
    # first straight ahead, then on the way around the rings.
    place = _meeting_place(mesh, a, b, False, False)
    half = 0.5 * limits.longest
    slack = _CURVE_SLACK if min(mesh.kind[a], mesh.kind[b]) == CURVE else 1.0
    if slack == 1.0 and overshoots_ahead(mesh, h, place, owned, half):
        return KEPT_OVERSHOOT, _NOWHERE
    outcome = survey_rings(mesh, a, b, place, owned, half, slack, rings)
    if outcome != COLLAPSED:
        return outcome, _NOWHERE
    if not keeps_link(mesh, h, rings):
        return KEPT_LINK, _NOWHERE
    kind = max(mesh.kind[a], mesh.kind[b])
    sharp_a, sharp_b = measure_normals(mesh, a, b, rings)
    if kind == INNER and (sharp_a != sharp_b or limits.quadric_reach > 0.0):
        place = _meeting_place(mesh, a, b, sharp_a, sharp_b)
        if sharp_a == sharp_b:
            place = _quadric_place(mesh, place, limits.quadric_reach * place[3], rings)
        if overshoots(rings, place, a, b, half):
            return KEPT_OVERSHOOT, _NOWHERE
    if folds_over(mesh, place, kind, a, b, rings, limits.foldover_cosine):
        outcome = KEPT_FOLDOVER
    elif limits.sliver_check and collapse_makes_sliver(mesh, place, a, b, rings):
        outcome = KEPT_SLIVER
    return outcome, place


@inlined
def _examine_alone(mesh, h, a, b, owned, limits):
    """Ask the guards that read only the edge and its faces; returns the outcome."""
    if not owns(owned, b):
        return NOT_OWNED
    length = distance_squared(mesh.X, a, b)
    if not is_short(length, mesh.X[a, 3], mesh.X[b, 3], limits.shortest):
        return NO_LONGER_WANTED
    return COLLAPSED if keeps_curves(mesh, h, a, b) else KEPT_CURVE


@inlined
def _meeting_place(mesh, a, b, sharp_a, sharp_b):
    """Choose where the two ends meet: at the more constrained or sharper one, else in the middle."""
    X = mesh.X
    if mesh.kind[a] > mesh.kind[b] or (sharp_a and not sharp_b):
        return place_of(X, a)
    if mesh.kind[b] > mesh.kind[a] or (sharp_b and not sharp_a):
        return place_of(X, b)
    return (
        0.5 * (X[a, 0] + X[b, 0]),
        0.5 * (X[a, 1] + X[b, 1]),
        0.5 * (X[a, 2] + X[b, 2]),
        0.5 * (X[a, 3] + X[b, 3]),
    )


@inlined
def _quadric_place(mesh, place, reach, rings):
    """Find the point closest to the planes of both rings, weighted by area [Garland and Heckbert 1997].

    It lies no farther than ``reach`` from ``place``, and keeps its target length.
    """
    matrix, gradient, weight = _sum_planes(mesh, place, rings)
    if weight == 0.0:
        return place
    dx, dy, dz = _solve_symmetric(matrix, gradient, _REGULARISER * weight)
    length = sqrt(dx * dx + dy * dy + dz * dz)
    if not length < np.inf:
        return place
    shrink = reach / length if length > reach else 1.0
    return place[0] + shrink * dx, place[1] + shrink * dy, place[2] + shrink * dz, place[3]


@inlined
def _sum_planes(mesh, place, rings):
    """Sum the planes of both rings: symmetric matrix, gradient at a place, weight."""
    xx = xy = xz = yy = yz = zz = gx = gy = gz = weight = 0.0
    X = mesh.X
    for side in range(2):
        # All planes of a ring pass through its centre.
        v = mesh.origin[rings.face[side, 0]]
        dx, dy, dz = place[0] - X[v, 0], place[1] - X[v, 1], place[2] - X[v, 2]
        for i in range(rings.size[side, 0]):
            norm = rings.normal[side, i, 3]
            if norm == 0.0:
                continue
            nx, ny = rings.normal[side, i, 0], rings.normal[side, i, 1]
            nz = rings.normal[side, i, 2]
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
    return (xx, xy, xz, yy, yz, zz), (gx, gy, gz), weight


@inlined
def _solve_symmetric(matrix, right, pull):
    """Solve for a symmetric 3 x 3 matrix (xx, xy, xz, yy, yz, zz) plus ``pull`` on its diagonal."""
    xx, xy, xz, yy, yz, zz = matrix
    gx, gy, gz = right
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
    return dx, dy, dz


@inlined
def remove_edge(mesh, h, place, rings):
    """Close the edge's one or two faces and give the other faces of the removed end to the survivor."""
    twin = mesh.twin
    a, b = mesh.origin[h], end_of(mesh.origin, h)
    t = twin[h]
    survivor, removed, side = a, b, 1
    if mesh.kind[b] > mesh.kind[a]:
        survivor, removed, side = b, a, 0
    start = _start_of_merged_ring(mesh, h, a, b)
    excess = mesh.valence_excess[a] + mesh.valence_excess[b] + (1 if t == NONE else 2)

    _close_face(mesh, h)
    if t != NONE:
        _close_face(mesh, t)
    for i in range(rings.size[side, 0]):
        if mesh.origin[rings.face[side, i]] != DEAD:
            mesh.origin[rings.face[side, i]] = survivor
    mesh.vertex_halfedge[survivor] = start
    mesh.valence_excess[survivor] = excess
    mesh.vertex_halfedge[removed] = DEAD
    mesh.X[survivor, 0], mesh.X[survivor, 1] = place[0], place[1]
    mesh.X[survivor, 2], mesh.X[survivor, 3] = place[2], place[3]
    if mesh.kind[removed] == CURVE and mesh.kind[survivor] == CURVE:
        mesh.birth[survivor] = min(mesh.birth[a], mesh.birth[b])  # the same for all siblings


@inlined
def _start_of_merged_ring(mesh, h, a, b):
    """Choose the half-edge where the survivor's ring will start: at the boundary the one without twin."""
    twin = mesh.twin
    t = twin[h]
    start = mesh.vertex_halfedge[a]
    if t == NONE or twin[start] != NONE:
        start = mesh.vertex_halfedge[b]
    inner = twin[start] != NONE
    if inner or start == next_halfedge(h):
        return twin[previous_halfedge(h)]
    if t != NONE and start == next_halfedge(t):
        return next_spoke(twin, t)
    return start


@inlined
def _close_face(mesh, h):
    """Remove the face of ``h`` and join the twins of its other two edges; at most one is on a curve."""
    n, p = next_halfedge(h), previous_halfedge(h)
    tn, tp = mesh.twin[n], mesh.twin[p]
    apex = mesh.origin[p]
    curve = max(mesh.curve[n], mesh.curve[p])
    if is_locked(min(mesh.curve[n], mesh.curve[p])):
        curve = min(mesh.curve[n], mesh.curve[p])
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
