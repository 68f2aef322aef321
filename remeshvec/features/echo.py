"""Does the turn across an edge repeat beside it? The walk that tells a facet from a crease."""

from __future__ import annotations

from math import cos, radians

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.vocabulary import NONE
from ..mesh.walk import next_halfedge
from .candidates import (
    CLEAN,
    CLEAN_RATIO,
    CURVED,
    ECHO,
    PIECE,
    STEEP_TURN,
    Candidates,
    Ground,
    per_piece,
)
from .dihedral import face_cosine
from .walks import PARALLEL, across, cross_face, edge_vector, is_convex

__all__ = ["drop_echoes", "echo_cosines", "echoes_beside"]

# An echo turns by at least this share of our edge: with 0.6 a quarter more is kept on organic
# shapes, and a fillet of two segments has a crease in its middle. What turns by this multiple of it
# is the end of the face.
ECHO_SHARE = 0.4
MULTIPLE = 1.7

# Edges at the ends of a fillet turn by less than this share of one inside.
FILLET_SHARE = 0.65

# A walk that turned by more than about 70 degrees in space is no longer beside its edge.
AWAY = 0.3

# A walk unfolds at most so many edges.
MAX_STEPS = 24

# In target lengths: facets narrower than the first are curvature at the scale of the new mesh; beside a
# clean edge the second, on a part the third.
ECHO_REACH = 1.5
CLEAN_REACH = 1.25
FACET_REACH = 0.75

# On a part an edge that turns by more degrees than this is drawn, not tessellated, whatever is beside it:
# facets of a nut, chamfers, both rims of a groove.
DRAWN_TURN = 40.0


def drop_echoes(ground: Ground, candidates: Candidates, parallel: bool) -> None:
    """Take the class from edges whose turn repeats beside them.

    In noise one echo is enough. A clean turn that comes twice makes a chamfer or a land; if it comes
    three times it is curvature.

    All are judged by what the surface is, so the order does not matter.
    """
    _drop(parallel, candidates.edges, ground, candidates.turn, candidates.rank)


def restore_facets(ground: Ground, candidates: Candidates, parallel: bool) -> None:
    """Give the edges of wide or sharp facets their class back: on a part they are those of a prism."""
    curved = np.flatnonzero(candidates.rank == CURVED)
    is_facet = np.empty(len(curved), np.bool_)
    _mark_facets(parallel, candidates.edges[curved], ground, candidates.turn[curved], is_facet)
    facets = curved[is_facet]
    candidates.rank[facets] = np.where(candidates.ratio[facets] >= CLEAN_RATIO, CLEAN, ECHO)


@threaded(per_piece)
def _drop(span, edges, ground, turn, rank):
    for k in range(PIECE * span[0], min(PIECE * span[1], len(edges))):
        if rank[k] <= 0 or turn[k] >= STEEP_TURN:
            continue
        is_clean = rank[k] == CLEAN
        echoes = _echoes(ground, edges[k], turn[k], CLEAN_REACH if is_clean else ECHO_REACH)
        if echoes == 2:
            rank[k] = CURVED
        elif echoes == 1 and not is_clean:
            rank[k] = ECHO


@threaded(per_piece)
def _mark_facets(span, edges, ground, turn, is_facet):
    for k in range(PIECE * span[0], min(PIECE * span[1], len(edges))):
        if turn[k] >= DRAWN_TURN:
            is_facet[k] = not _is_inside_fillet(ground, edges[k], turn[k])
        else:
            is_facet[k] = _echoes(ground, edges[k], turn[k], FACET_REACH) < 2


@inlined
def _target(ground, h):
    """Target length at an edge."""
    a, b = ground.origin[h], ground.origin[next_halfedge(h)]
    return 0.5 * ground.X[a, 3] + 0.5 * ground.X[b, 3]


@inlined
def _echoes(ground, h, turn, reach):
    """Count how often a turn comes again, up to 2, on both sides together.

    Once is enough where the walk ends at the border on the other side: there might be more of them.
    """
    quiet, loud = echo_cosines(radians(turn))
    reach = reach * _target(ground, h)
    total = 0
    open_sides = 0
    for g in (h, np.int64(ground.twin[h])):
        if total < 2:
            echoes, is_cut_short = echoes_beside(ground, g, reach, quiet, loud, 2)
            total += echoes
            open_sides += echoes == 0 and not is_cut_short
    return 2 if total == 1 and open_sides == 0 else min(total, 2)


@inlined
def _is_inside_fillet(ground, h, turn):
    """Tell whether a drawn edge has a smaller turn to the same side on both of its sides.

    So a fillet of two segments has; facets of a prism all turn alike.
    """
    quiet, loud = cos(radians(ECHO_SHARE * turn)), cos(radians(FILLET_SHARE * turn))
    reach = CLEAN_REACH * _target(ground, h)
    left, _ = echoes_beside(ground, h, reach, quiet, loud, 1)
    right, _ = echoes_beside(ground, np.int64(ground.twin[h]), reach, quiet, loud, 1)
    return left + right == 2


@inlined
def echo_cosines(turn):
    """Cosines between which an edge is an echo of one that turns by so many radians."""
    return cos(ECHO_SHARE * turn), cos(min(3.0, MULTIPLE * turn))


@inlined
def echoes_beside(ground, h, reach, quiet, loud, enough):
    """Count how often the turn across ``h`` comes again, straight into its face, up to ``enough``.

    The walk runs over unfolded faces from the middle of the edge, perpendicular to it, for a length
    of ``reach``. The first edge that is nearly parallel and turns by a comparable angle, with a cosine
    between ``loud`` and ``quiet``, decides: it is an echo if it turns to the same side. From there the
    walk goes on for a second one.

    Returns
    -------
    echoes : int
    is_cut_short : bool
        Whether the walk ended where the face does, so that there might be more of them.
    """
    X, origin, twin, normals, is_hard = ground
    vector = edge_vector(X, origin, h)
    ex, ey, ez, length = vector
    f = h // 3
    convex = is_convex(normals, f, twin[h] // 3, ex, ey, ez)
    x0, y0, z0 = across(normals, f, ex, ey, ez)
    away = AWAY * length
    echoes = 0
    left = reach
    g = h
    share, u, w = 0.5, 0.0, 1.0
    for _ in range(MAX_STEPS):
        g, distance, share, u, w = cross_face(ground, g, vector, share, u, w)
        left -= distance
        if left < 0.0:
            return echoes, False
        t = np.int64(twin[g])
        if t == NONE or is_hard[g]:
            return echoes, True
        before, f = f, t // 3
        vector = edge_vector(X, origin, t)
        ex, ey, ez, length = vector
        cosine = face_cosine(normals, before, f)
        if cosine <= quiet and w >= PARALLEL:
            if cosine <= loud:
                return echoes, True
            if is_convex(normals, before, f, -ex, -ey, -ez) != convex:
                return echoes, False
            echoes += 1
            left = reach
            if echoes == enough:
                return echoes, False
        g = t
        if echoes == 0:
            xa, ya, za = across(normals, f, ex, ey, ez)
            along = u * (ex * x0 + ey * y0 + ez * z0) + w * (xa * x0 + ya * y0 + za * z0)
            if not along >= away * length:
                return echoes, False
    return echoes, False
