"""Flip edges towards valence 6 inside and 4 on the boundary; ties go to Delaunay.

A flip owns the four vertices of its quad: two edges that share no face may still make the same new
edge (on a bipyramid), so owning the two faces is not enough. Ties cost almost no time and bring the
first percentile of the angles up by half a degree (`docs/ablation.md`).
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import area_vector, distance_squared, is_flat, mean_ratio, turn_exceeds
from ..core.vocabulary import CURVE, DEAD, MAX_VALENCE, NONE, Blocks, Mesh
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
from ..mesh.edge_curves import is_feature
from ..mesh.walk import (
    apex_of,
    corners_of,
    end_of,
    next_halfedge,
    next_spoke,
    previous_halfedge,
)
from .flip_gains import dot_opposite, is_good_trade, quad_of, valence_gain, violates_delaunay
from .folds import is_folded
from .outcomes import (
    FLIPPED,
    KEPT_DUPLICATE,
    KEPT_NORMAL,
    KEPT_SLIVER,
    N_FLIP_OUTCOMES,
    NO_LONGER_WANTED,
    NOT_OWNED,
)

__all__ = ["FlipLimits", "flip_edges"]


class FlipLimits(NamedTuple):
    """What a flip may do."""

    normal_cosine: float  # cosine of the largest turn of the normals across the quad
    delaunay_ties: bool  # flip without valence gain where Delaunay is violated
    sliver_check: bool  # the worse of the two triangles must not get worse
    trade: float = 0.0  # tangent of the angle by which Delaunay may outweigh valence; 0: not at all


def flip_edges(
    mesh: Mesh, blocks: Blocks, limits: FlipLimits, parallel: bool, passes: int = 1
) -> np.ndarray:
    """Flip every edge that gains from it, once per pass; returns counts by outcome.

    Later passes look only at edges that the previous pass has touched: all others would be refused
    again, for the same reasons.
    """
    candidates = make_candidates(3 * blocks.face)
    touched = np.zeros(mesh.vertex_halfedge.size, np.uint8)
    total = np.zeros(N_FLIP_OUTCOMES, np.int64)
    for n in range(passes):
        if n > 0:
            _find_again(parallel, mesh, blocks, limits, touched, candidates)
        elif limits.trade > 0.0:
            _find_trades(parallel, mesh, blocks, limits, candidates)
        else:
            _find_flips(parallel, mesh, blocks, limits, candidates)
        if not candidates.counts.any():
            break
        tally = np.zeros((len(blocks.face) - 1, N_FLIP_OUTCOMES), np.int64)
        for stage in stages(blocks):
            tally[:, NOT_OWNED] = 0
            _flip(parallel, mesh, blocks, stage, limits, candidates, touched, tally)
        total += tally.sum(axis=0)
    return total


@threaded(per_block)
def _find_flips(span, mesh, blocks, limits, candidates):
    """List the edges to flip, by two sieves without branches, which no processor could predict.

    A flip takes an edge from both ends and gives one to both apexes. It gains if three of the four are
    better off, and loses nothing if two are; so of the three in one face at least one is better off.
    """
    item = candidates.items
    for k in range(span[0], span[1]):
        start = candidates.starts[k]
        end = start
        for f in range(blocks.face[k], blocks.face[k + 1]):
            if mesh.origin[3 * f] == DEAD:
                continue
            a, b, c = corners_of(mesh.origin, f)
            ea, eb, ec = mesh.valence_excess[a], mesh.valence_excess[b], mesh.valence_excess[c]
            for i in range(3):
                h = 3 * f + i
                t = mesh.twin[h]
                item[end] = h
                end += (t < h) & (t != NONE) & ((ea > 0) | (eb > 0) | (ec < 0))
                ea, eb, ec = eb, ec, ea
        sieved = start
        for i in range(start, end):
            h = item[i]
            item[sieved] = h
            sieved += valence_gain(mesh, h, mesh.twin[h]) >= 0
        end = sieved
        sieved = start
        for i in range(start, end):
            h = item[i]
            item[sieved] = h
            sieved += _is_wanted(mesh, h, mesh.twin[h], limits)
        candidates.counts[k] = sieved - start


@threaded(per_block)
def _find_trades(span, mesh, blocks, limits, candidates):
    """List the edges to flip by trades, each by one of its two faces.

    Only an edge opposite an obtuse angle violates Delaunay. One that gains valence lets three of four
    vertices be better off, so two of the three in either face.
    """
    item = candidates.items
    for k in range(span[0], span[1]):
        start = candidates.starts[k]
        end = start
        for f in range(blocks.face[k], blocks.face[k + 1]):
            if mesh.origin[3 * f] == DEAD:
                continue
            a, b, c = corners_of(mesh.origin, f)
            ea, eb, ec = mesh.valence_excess[a], mesh.valence_excess[b], mesh.valence_excess[c]
            lc, la, lb = _squared_sides(mesh.X, a, b, c)
            for i in range(3):
                h = 3 * f + i
                t = mesh.twin[h]
                may_gain = _may_gain(ea, eb, ec) & (t < h)
                item[end] = h
                end += (t != NONE) & (may_gain | (lc > la + lb))
                ea, eb, ec = eb, ec, ea
                lc, la, lb = la, lb, lc
        sieved = start
        for i in range(start, end):
            h = item[i]
            t = mesh.twin[h]
            item[sieved] = h
            sieved += (t < h or not _is_listed(mesh, h, t)) and _is_wanted(mesh, h, t, limits)
        candidates.counts[k] = sieved - start


@inlined
def _squared_sides(X, a, b, c):
    """Squared lengths of the sides a-b, b-c and c-a."""
    return distance_squared(X, a, b), distance_squared(X, b, c), distance_squared(X, c, a)


@inlined
def _may_gain(ea, eb, ec):
    """Tell whether a flip may gain valence, from the excess at the ends of an edge and one apex."""
    return 1 * (ea > 0) + (eb > 0) + (ec < 0) >= 2


@inlined
def _is_listed(mesh, h, t):
    """Tell whether ``t``, the larger half-edge of an edge, was listed."""
    excess = mesh.valence_excess
    a, b, _, d = quad_of(mesh, h, t)
    return dot_opposite(mesh, t) < 0.0 or _may_gain(excess[a], excess[b], excess[d])


@threaded(per_block)
def _find_again(span, mesh, blocks, limits, touched, candidates):
    """List the edges to flip around touched vertices, each by one of its two faces."""
    for k in range(span[0], span[1]):
        end = candidates.starts[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            if mesh.origin[3 * f] == DEAD or not _is_touched(mesh, f, touched):
                continue
            for h in range(3 * f, 3 * f + 3):
                t = mesh.twin[h]
                if t != NONE and (t < h or not _is_touched(mesh, t // 3, touched)):
                    candidates.items[end] = h
                    end += _is_wanted(mesh, h, t, limits)
        candidates.counts[k] = end - candidates.starts[k]


@inlined
def _is_touched(mesh, f, touched):
    """Tell whether a corner of a face is marked."""
    a, b, c = corners_of(mesh.origin, f)
    return touched[a] | touched[b] | touched[c]


@inlined
def _is_wanted(mesh, h, t, limits):
    """Tell whether a flip gains valence, or keeps it and restores Delaunay, or is a good trade."""
    gain = valence_gain(mesh, h, t)
    if limits.trade > 0.0:
        wanted = gain != -1 and is_good_trade(mesh, h, t, gain, limits.trade)
    elif gain == 0:
        wanted = limits.delaunay_ties and violates_delaunay(mesh, h, t)
    else:
        wanted = gain > 0
    return wanted and not is_feature(mesh.curve[h])


@threaded(per_stage_block)
def _flip(span, mesh, blocks, stage, limits, candidates, touched, tally):
    """Flip the candidates that the blocks of a stage own."""
    for k in range(span[0], span[1]):
        owned = vertex_range(blocks, stage, k)
        for i in slots(candidates, blocks, stage, k):
            h = candidates.items[i]
            if h == DONE or not owns(owned, mesh.origin[h]):
                continue
            outcome = _flip_edge(mesh, h, owned, limits, touched)
            tally[k, outcome] += 1
            if outcome != NOT_OWNED:
                candidates.items[i] = DONE


@inlined
def _flip_edge(mesh, h, owned, limits, touched):
    """Flip one edge if it still gains from it and every guard agrees; returns the outcome."""
    a, b, c = mesh.origin[h], end_of(mesh.origin, h), apex_of(mesh.origin, h)
    if not (owns(owned, b) and owns(owned, c)):
        return NOT_OWNED
    t = mesh.twin[h]
    if t == NONE:
        return NO_LONGER_WANTED
    d = apex_of(mesh.origin, t)
    if not owns(owned, d):
        return NOT_OWNED
    if not _is_wanted(mesh, h, t, limits):
        return NO_LONGER_WANTED
    if duplicates_edge(mesh, c, d):
        return KEPT_DUPLICATE
    if bends_quad(mesh, h, t, limits.normal_cosine) or folds_neighbour(mesh, h, t):
        return KEPT_NORMAL
    if limits.sliver_check and flip_makes_sliver(mesh, h, t):
        return KEPT_SLIVER
    for v in (a, b, c, d):
        touched[v] = 1
    _turn_edge(mesh, h, t)
    return FLIPPED


@inlined
def duplicates_edge(mesh, c, d):
    """Guard: the new edge exists already, or both its ends are the same vertex."""
    if c == d:
        return True
    start = mesh.vertex_halfedge[c]
    h = start
    for _ in range(MAX_VALENCE):
        if end_of(mesh.origin, h) == d:
            return True
        last = h
        h = next_spoke(mesh.twin, h)
        if h == NONE:
            return apex_of(mesh.origin, last) == d
        if h == start:
            return False
    return True


@inlined
def bends_quad(mesh, h, t, cosine):
    """Guard: a new face would turn too far from the quad's mean normal.

    The old and the new pair of triangles have the same summed area vector, which is that normal.
    Comparing with the old faces instead would keep caps from flipping away: their normals are noise.
    """
    X = mesh.X
    a, b, c, d = quad_of(mesh, h, t)
    u = ux, uy, uz = area_vector(X, a, d, c)
    w = wx, wy, wz = area_vector(X, b, c, d)
    mean = ux + wx, uy + wy, uz + wz
    # Three vertices of a straight curve: the normal is rounding.
    if mesh.kind[c] >= CURVE and mesh.kind[d] >= CURVE:
        new = distance_squared(X, c, d)
        if mesh.kind[a] >= CURVE and is_flat(ux, uy, uz, new):
            return True
        if mesh.kind[b] >= CURVE and is_flat(wx, wy, wz, new):
            return True
    return turn_exceeds(u, mean, cosine) or turn_exceeds(w, mean, cosine)


@inlined
def folds_neighbour(mesh, h, t):
    """Guard: a new face would be folded onto a face beside the quad, which is not so now.

    On a rough ridge the quad's own normals agree within the limit, and yet trades made most of the folds
    that a call made.
    """
    a, b, c, d = quad_of(mesh, h, t)
    old_h, old_t = area_vector(mesh.X, a, b, c), area_vector(mesh.X, b, a, d)
    new_a, new_b = area_vector(mesh.X, a, d, c), area_vector(mesh.X, b, c, d)
    return (
        _folds_beside(mesh, previous_halfedge(h), old_h, new_a)
        or _folds_beside(mesh, next_halfedge(h), old_h, new_b)
        or _folds_beside(mesh, next_halfedge(t), old_t, new_a)
        or _folds_beside(mesh, previous_halfedge(t), old_t, new_b)
    )


@inlined
def _folds_beside(mesh, h, old, new):
    """Tell whether the face across a half-edge would be folded by a new normal on this side."""
    g = mesh.twin[h]
    if g == NONE:
        return False
    a, b, c = corners_of(mesh.origin, g // 3)
    across = area_vector(mesh.X, a, b, c)
    return is_folded(across, new) and not is_folded(across, old)


@inlined
def flip_makes_sliver(mesh, h, t):
    """Guard (optional): the worse of the two triangles would get worse."""
    X = mesh.X
    a, b, c, d = quad_of(mesh, h, t)
    before = min(_flip_shape(X, a, b, c), _flip_shape(X, b, a, d))
    return min(_flip_shape(X, a, d, c), _flip_shape(X, b, c, d)) < before


@inlined
def _flip_shape(X, a, b, c):
    """Mean ratio of the triangle of three vertices."""
    nx, ny, nz = area_vector(X, a, b, c)
    return mean_ratio(
        distance_squared(X, a, b),
        distance_squared(X, b, c),
        distance_squared(X, c, a),
        sqrt(nx * nx + ny * ny + nz * nz),
    )


@inlined
def _turn_edge(mesh, h, t):
    """Replace edge a-b of faces a b c and b a d by edge c-d, in the same six slots.

    The face of ``h`` becomes a d c (its half-edge c-a stays), that of ``t`` becomes b c d (d-b stays).
    """
    origin = mesh.origin
    twin = mesh.twin
    a, b, c, d = quad_of(mesh, h, t)
    hn = next_halfedge(h)
    tn = next_halfedge(t)
    bc = twin[hn]
    ad = twin[tn]
    twin[h] = ad
    if ad != NONE:
        twin[ad] = h
    twin[t] = bc
    if bc != NONE:
        twin[bc] = t
    origin[hn] = d
    origin[tn] = c
    twin[hn] = tn
    twin[tn] = hn
    curve = mesh.curve
    curve[h], curve[t] = curve[tn], curve[hn]
    curve[hn] = NONE
    curve[tn] = NONE
    # Edge a-d moved from slot tn to h, b-c from hn to t.
    if mesh.vertex_halfedge[a] == tn:
        mesh.vertex_halfedge[a] = h
    if mesh.vertex_halfedge[b] == hn:
        mesh.vertex_halfedge[b] = t
    mesh.valence_excess[a] -= 1
    mesh.valence_excess[b] -= 1
    mesh.valence_excess[c] += 1
    mesh.valence_excess[d] += 1
