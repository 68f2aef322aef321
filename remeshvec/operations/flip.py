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
from ..mesh.blocks import DONE, list_range, per_block, per_stage_block, stages, vertex_range
from ..mesh.walk import next_halfedge, previous_halfedge
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


def flip_edges(
    mesh: Mesh, blocks: Blocks, limits: FlipLimits, parallel: bool, passes: int = 1
) -> np.ndarray:
    """Flip every edge whose flip is worth it, once a pass; returns counts by outcome.

    Later passes look at what the one before has touched: all else stays as it was, and for the same
    reasons.
    """
    candidates = np.empty(mesh.origin.size, np.int32)
    touched = np.zeros(mesh.vertex_halfedge.size, np.uint8)
    total = np.zeros(N_FLIP_OUTCOMES, np.int64)
    for n in range(passes):
        count = np.zeros(len(blocks.face) - 1, np.int64)
        if n == 0:
            _find_flips(parallel, mesh, blocks, limits.delaunay_ties, candidates, count)
        else:
            _find_again(parallel, mesh, blocks, limits.delaunay_ties, touched, candidates, count)
        if not count.any():
            break
        tally = np.zeros((len(count), N_FLIP_OUTCOMES), np.int64)
        for stage in stages(blocks):
            tally[:, NOT_OWNED] = 0
            _flip(parallel, mesh, blocks, stage, limits, candidates, count, touched, tally)
        total += tally.sum(axis=0)
    return total


@threaded(per_block)
def _find_flips(span, mesh, blocks, delaunay_ties, candidates, count):
    """List the edges worth a flip, by two sieves without branches, which could not be predicted.

    A flip takes an edge from both ends and gives one to both apexes. It gains something where three of
    the four are better off, nothing where two are; so of the three in one face at least one is.
    """
    for k in range(span[0], span[1]):
        start = 3 * blocks.face[k]
        end = start
        for f in range(blocks.face[k], blocks.face[k + 1]):
            if mesh.origin[3 * f] == DEAD:
                continue
            ea = mesh.valence_excess[mesh.origin[3 * f]]
            eb = mesh.valence_excess[mesh.origin[3 * f + 1]]
            ec = mesh.valence_excess[mesh.origin[3 * f + 2]]
            for i in range(3):
                h = 3 * f + i
                t = mesh.twin[h]
                candidates[end] = h
                end += (t < h) & (t != NONE) & ((ea > 0) | (eb > 0) | (ec < 0))
                ea, eb, ec = eb, ec, ea
        sieved = start
        for i in range(start, end):
            h = np.int64(candidates[i])
            candidates[sieved] = h
            sieved += valence_gain(mesh, h, np.int64(mesh.twin[h])) >= 0
        end = sieved
        sieved = start
        for i in range(start, end):
            h = np.int64(candidates[i])
            candidates[sieved] = h
            sieved += _is_wanted(mesh, h, np.int64(mesh.twin[h]), delaunay_ties)
        count[k] = sieved - start


@threaded(per_block)
def _find_again(span, mesh, blocks, delaunay_ties, touched, candidates, count):
    """List what is worth a flip around touched vertices: each edge by one of its two faces."""
    for k in range(span[0], span[1]):
        end = 3 * blocks.face[k]
        for f in range(blocks.face[k], blocks.face[k + 1]):
            if mesh.origin[3 * f] == DEAD or not _is_touched(mesh, f, touched):
                continue
            for h in range(3 * f, 3 * f + 3):
                t = np.int64(mesh.twin[h])
                if t != NONE and (t < h or not _is_touched(mesh, t // 3, touched)):
                    candidates[end] = h
                    end += _is_wanted(mesh, h, t, delaunay_ties)
        count[k] = end - 3 * blocks.face[k]


@inlined
def _is_touched(mesh, f, touched):
    origin = mesh.origin
    return touched[origin[3 * f]] | touched[origin[3 * f + 1]] | touched[origin[3 * f + 2]]


@inlined
def _is_wanted(mesh, h, t, delaunay_ties):
    """Tell whether a flip gains valence, or keeps it and restores Delaunay."""
    gain = valence_gain(mesh, h, t)
    wanted = gain > 0 or (gain == 0 and delaunay_ties and violates_delaunay(mesh, h, t))
    return wanted and mesh.curve[h] == NONE


@threaded(per_stage_block)
def _flip(span, mesh, blocks, stage, limits, candidates, count, touched, tally):
    for k in range(span[0], span[1]):
        low, high = vertex_range(blocks, stage, k)
        first, end = list_range(blocks, stage, k)
        for j in range(first, end):
            for i in range(3 * blocks.face[j], 3 * blocks.face[j] + count[j]):
                h = np.int64(candidates[i])
                if h == DONE:
                    continue
                v = mesh.origin[h]
                if v < low or v >= high:
                    continue
                outcome = _flip_edge(mesh, h, low, high, limits, touched)
                tally[k, outcome] += 1
                if outcome != NOT_OWNED:
                    candidates[i] = DONE


@inlined
def _flip_edge(mesh, h, low, high, limits, touched):
    """Flip one edge if it is still worth it and every guard agrees; returns the outcome."""
    b = mesh.origin[next_halfedge(h)]
    c = mesh.origin[previous_halfedge(h)]
    if b < low or b >= high or c < low or c >= high:
        return NOT_OWNED
    t = np.int64(mesh.twin[h])
    if t == NONE:
        return NO_LONGER_WANTED
    d = mesh.origin[previous_halfedge(t)]
    if d < low or d >= high:
        return NOT_OWNED
    if not _is_wanted(mesh, h, t, limits.delaunay_ties):
        return NO_LONGER_WANTED
    if duplicates_edge(mesh, c, d):
        return KEPT_DUPLICATE
    if bends_quad(mesh, h, t, limits.normal_cosine):
        return KEPT_NORMAL
    if limits.sliver_check and flip_makes_sliver(mesh, h, t):
        return KEPT_SLIVER
    touched[mesh.origin[h]] = 1
    touched[b] = 1
    touched[c] = 1
    touched[d] = 1
    _turn_edge(mesh, h, t)
    return FLIPPED


@inlined
def valence_gain(mesh, h, t):
    """Fall of the summed distance from the ideal valences; negative where an end has too few edges."""
    excess = mesh.valence_excess
    a = excess[mesh.origin[h]]
    b = excess[mesh.origin[t]]
    c = excess[mesh.origin[previous_halfedge(h)]]
    d = excess[mesh.origin[previous_halfedge(t)]]
    # Each of the four comes one nearer to its ideal, or one farther away.
    nearer = np.int64(a > 0) + np.int64(b > 0) + np.int64(c < 0) + np.int64(d < 0)
    gain = 2 * nearer - 4
    return -1 if min(a, b) <= -3 else gain


@inlined
def violates_delaunay(mesh, h, t):
    """Tell whether the angles opposite the edge sum to more than pi (cotangents below 0)."""
    dot_c = _dot_opposite(mesh, h)
    dot_d = _dot_opposite(mesh, t)
    if dot_c >= 0.0 and dot_d >= 0.0:  # both acute, as almost always
        return False
    return _cotangent(mesh, h, dot_c) + _cotangent(mesh, t, dot_d) < -1e-9


@inlined
def _dot_opposite(mesh, h):
    """Scalar product of the two edges that meet opposite a half-edge."""
    X = mesh.X
    a = mesh.origin[h]
    b = mesh.origin[next_halfedge(h)]
    c = mesh.origin[previous_halfedge(h)]
    return (
        (X[a, 0] - X[c, 0]) * (X[b, 0] - X[c, 0])
        + (X[a, 1] - X[c, 1]) * (X[b, 1] - X[c, 1])
        + (X[a, 2] - X[c, 2]) * (X[b, 2] - X[c, 2])
    )


@inlined
def _cotangent(mesh, h, dot):
    """Cotangent of the angle opposite a half-edge; far below zero for a face without area."""
    X = mesh.X
    a = mesh.origin[h]
    b = mesh.origin[next_halfedge(h)]
    c = mesh.origin[previous_halfedge(h)]
    nx, ny, nz = area_vector(X, a, b, c)
    norm = sqrt(nx * nx + ny * ny + nz * nz)
    if norm == 0.0:
        return 0.0 if dot == 0.0 else (1e30 if dot > 0.0 else -1e30)
    return dot / norm


@inlined
def duplicates_edge(mesh, c, d):
    """Guard: the new edge exists already, or both its ends are the same vertex."""
    if c == d:
        return True
    start = np.int64(mesh.vertex_halfedge[c])
    h = start
    for _ in range(MAX_VALENCE):
        if mesh.origin[next_halfedge(h)] == d:
            return True
        p = previous_halfedge(h)
        h = np.int64(mesh.twin[p])
        if h == NONE:
            return mesh.origin[p] == d
        if h == start:
            return False
    return True


@inlined
def bends_quad(mesh, h, t, cosine):
    """Guard: a new face would turn too far from the quad's mean normal.

    The old and the new pair of triangles have the same summed area vector, which is that normal.
    Comparing with the old faces instead keeps caps from flipping away: their normals are noise.
    """
    X = mesh.X
    a = mesh.origin[h]
    b = mesh.origin[t]
    c = mesh.origin[previous_halfedge(h)]
    d = mesh.origin[previous_halfedge(t)]
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
def flip_makes_sliver(mesh, h, t):
    """Guard (optional): the worse of the two triangles would get worse."""
    a = mesh.origin[h]
    b = mesh.origin[t]
    c = mesh.origin[previous_halfedge(h)]
    d = mesh.origin[previous_halfedge(t)]
    before = min(_flip_shape(mesh.X, a, b, c), _flip_shape(mesh.X, b, a, d))
    return min(_flip_shape(mesh.X, a, d, c), _flip_shape(mesh.X, b, c, d)) < before


@inlined
def _flip_shape(X, a, b, c):
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
    hn = next_halfedge(h)
    tn = next_halfedge(t)
    a = np.int64(origin[h])
    b = np.int64(origin[t])
    c = np.int64(origin[previous_halfedge(h)])
    d = np.int64(origin[previous_halfedge(t)])
    bc = np.int64(twin[hn])
    ad = np.int64(twin[tn])
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
