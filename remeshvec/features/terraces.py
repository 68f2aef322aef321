"""Terraces: the steps by which a mask of voxels or a stepped height field climbs a slope.

The edges of its steps are as clean as those of a part, but they come in turn: where the surface bends
one way it soon bends back, and then the same way again. So a ledge or a groove, which bends back once,
is none of them, nor is the round shoulder of a part: the steps of voxels have few directions.
"""

from __future__ import annotations

from math import radians

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.vocabulary import NONE
from .candidates import CLEAN, PIECE, TERRACE, Candidates, Ground, per_piece
from .dihedral import face_cosine
from .echo import echo_cosines
from .links import Segments, networks
from .rounded import find_rounded
from .walks import PARALLEL, cross_face, edge_vector, is_convex

__all__ = ["drop_terraces"]

# Steeper edges are those of a part; those of whole voxels turn by 90 degrees.
TERRACE_TURN = 100.0

# Longer edges, in target lengths or mean edges, are not those of voxels.
EDGE = 1.5

# A step: within the first of these, in target lengths, the same turn comes again; between the two lies a
# turn back, at most the second away from one of them. A ledge has no second turn.
REACH = 8.0
GAP = 0.95

# Where this share of the clean edges, by length, are steps, the surface is that of a mask: at least 0.6
# on masks, at most 0.42 on 60 parts, whose steps are longer. There one turn back within the second is
# enough: voxels may be taller than the target length.
MASK_SHARE = 0.5
MASK_GAP = 2.25

# A set of connected edges is dropped if this share of its length belongs to steps.
SHARE = 0.5

# A walk unfolds at most so many edges.
MAX_STEPS = 48


def drop_terraces(
    ground: Ground, candidates: Candidates, segments: Segments, mean_edge: float, parallel: bool
) -> None:
    """Take the class from the edges of terraces.

    Parameters
    ----------
    ground : Ground
    candidates : Candidates
    segments : Segments
        Of the candidates.
    mean_edge : float
    parallel : bool
    """
    is_clean = candidates.rank == CLEAN
    is_asked = is_clean & (candidates.turn < TERRACE_TURN)
    asked = np.flatnonzero(is_asked)
    if not len(asked):
        return
    is_step, back = np.empty(len(asked), np.bool_), np.empty(len(asked))
    edges, turn = candidates.edges[asked], candidates.turn[asked]
    _walk_down(parallel, edges, ground, turn, mean_edge, is_step, back)
    is_rounded = find_rounded(segments, asked)
    is_step &= ~is_rounded
    length = segments.length[asked, 0]
    is_short = segments.length[asked, 1] <= EDGE
    if (length * (is_step & is_short)).sum() < MASK_SHARE * segments.length[is_clean, 0].sum():
        return
    is_step |= (back <= MASK_GAP) & ~is_rounded
    network = networks(segments, asked)
    of_steps = np.bincount(network, length * is_step)[network]
    total = np.bincount(network, length)[network]
    candidates.rank[asked[of_steps >= SHARE * total]] = TERRACE


@threaded(per_piece)
def _walk_down(span, edges, ground, turn, mean_edge, is_step, back):
    """Walk away from both sides of edges; note which are steps, and how near the surface bends back."""
    X = ground.X
    for k in range(PIECE * span[0], min(PIECE * span[1], len(edges))):
        h = edges[k]
        t = np.int64(ground.twin[h])
        scale = max(0.5 * X[ground.origin[h], 3] + 0.5 * X[ground.origin[t], 3], mean_edge)
        quiet, loud = echo_cosines(radians(turn[k]))
        here, there = _bends(ground, h, REACH * scale, quiet, loud)
        left, right = _bends(ground, t, REACH * scale, quiet, loud)
        is_step[k] = _is_step(here, there, GAP * scale) or _is_step(left, right, GAP * scale)
        back[k] = min(here, left) / scale


@inlined
def _is_step(back, again, gap):
    """Tell whether the same turn comes again, with one to the other side close to either."""
    return again < np.inf and min(back, again - back) <= gap


@inlined
def _bends(ground, h, reach, quiet, loud):
    """How far into the face of ``h`` the surface bends back, and how far it then bends as here again.

    Infinite where it does not.
    """
    X, origin, twin, normals, is_hard = ground
    vector = edge_vector(X, origin, h)
    ex, ey, ez, _ = vector
    f = h // 3
    convex = is_convex(normals, f, twin[h] // 3, ex, ey, ez)
    g = h
    share, u, w = 0.5, 0.0, 1.0
    walked = 0.0
    back = np.inf
    for _ in range(MAX_STEPS):
        g, distance, share, u, w = cross_face(ground, g, vector, share, u, w)
        walked += distance
        t = np.int64(twin[g])
        if walked > reach or t == NONE or is_hard[g]:
            break
        before, f = f, t // 3
        vector = edge_vector(X, origin, t)
        ex, ey, ez, _ = vector
        cosine = face_cosine(normals, before, f)
        if cosine <= quiet and w >= PARALLEL:
            is_same = is_convex(normals, before, f, -ex, -ey, -ez) == convex
            if cosine <= loud or (is_same and back == np.inf):
                break
            if is_same:
                return back, walked
            back = min(back, walked)
        g = t
    return back, np.inf
