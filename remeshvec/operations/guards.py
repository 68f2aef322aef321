"""Guards of a collapse: each tells for one property of the mesh whether a collapse would spoil it.

A collapse moves the ends a and b of an edge to one place; places and rings as in `rings`.
"""

from __future__ import annotations

from math import sqrt

from ..core.compiler import inlined
from ..core.geometry import (
    distance_squared,
    face_vector,
    is_flat,
    mean_ratio,
    point,
    turn_exceeds,
)
from ..core.vocabulary import CURVE, INNER, NONE
from ..mesh.blocks import owns
from ..mesh.edge_curves import is_feature, is_named
from ..mesh.walk import apex_of, end_of, next_halfedge, next_spoke, previous_halfedge
from .rings import is_too_far, place_of

__all__ = [
    "collapse_makes_sliver",
    "folds_over",
    "joins_curves",
    "keeps_curves",
    "keeps_link",
    "overshoots",
    "overshoots_ahead",
]


# A flat face keeps this share of its height by its longest side.
_FLATTER = 0.7


@inlined
def keeps_curves(mesh, h, a, b):
    """Guard: fixed and held vertices stay, and a vertex of a curve leaves along this curve only.

    The other two edges of each vanishing face become one, so at most one of them may be on a curve. A
    boundary edge stays if it is all that connects its face to the mesh.
    """
    kind = min(mesh.kind[a], mesh.kind[b])
    if kind == INNER:
        return True
    if kind != CURVE or not is_named(mesh.curve[h]):
        return False
    t = mesh.twin[h]
    if joins_curves(mesh, h) or (t != NONE and joins_curves(mesh, t)):
        return False
    return t != NONE or (
        mesh.twin[next_halfedge(h)] != NONE or mesh.twin[previous_halfedge(h)] != NONE
    )


@inlined
def joins_curves(mesh, h):
    """Tell whether both other edges of a face are on curves."""
    return is_feature(mesh.curve[next_halfedge(h)]) and is_feature(mesh.curve[previous_halfedge(h)])


@inlined
def overshoots_ahead(mesh, h, place, owned, half_factor):
    """Guard, incomplete but fast: the edge to the vertex straight ahead of either end would be too long.

    That is the third vertex of both rings, straight ahead in most of them.
    """
    for side in range(2):
        g = mesh.twin[h] if side else h
        for _ in range(3):
            if g != NONE:
                g = next_spoke(mesh.twin, g)
        if g == NONE:
            continue
        w = end_of(mesh.origin, g)
        if owns(owned, w) and is_too_far(place, place_of(mesh.X, w), half_factor, 1.0):
            return True
    return False


@inlined
def keeps_link(mesh, h, rings):
    """Guard: the link condition, link(a) and link(b) meet in link(ab) only [Dey et al. 1999].

    The common neighbours must be the apexes of the edge's faces. A tetrahedron, whose links share an
    edge too, stays.
    """
    size = rings.size
    common = 0
    for i in range(size[0, 1]):
        for j in range(size[1, 1]):
            common += rings.vertex[0, i] == rings.vertex[1, j]
    if mesh.twin[h] == NONE:
        return common == 1
    is_tetrahedron = size[0, 0] == 3 and size[0, 1] == 3 and size[1, 0] == 3 and size[1, 1] == 3
    return common == 2 and not is_tetrahedron


@inlined
def overshoots(rings, place, a, b, half_factor):
    """Guard: an edge from the new place to a ring vertex would be too long, see `is_too_far`."""
    at = rings.place
    for side in range(2):
        other = a if side else b
        for i in range(rings.size[side, 1]):
            there = at[side, i, 0], at[side, i, 1], at[side, i, 2], at[side, i, 3]
            if rings.vertex[side, i] != other and is_too_far(place, there, half_factor, 1.0):
                return True
    return False


@inlined
def folds_over(mesh, place, kind, a, b, rings, cosine):
    """Guard: a face that stays would turn its normal too far, or lose its area.

    ``kind`` is that of the vertex that stays. On a straight curve, a face with all corners on curves may
    become flat, and its normal is then rounding noise; such a collapse is refused too. A face that is
    flat already may stay so: along fine curves all are, and could never be thinned.
    """
    at = rings.place
    normal = rings.normal
    p = place[0], place[1], place[2]
    for side in range(2):
        other = a if side else b
        centre = point(mesh.X, b if side else a)
        for i in range(rings.size[side, 0]):
            j = i + 1 if i + 1 < rings.size[side, 1] else 0
            v = rings.vertex[side, i]
            w = rings.vertex[side, j]
            if v == other or w == other:
                continue
            pv = at[side, i, 0], at[side, i, 1], at[side, i, 2]
            pw = at[side, j, 0], at[side, j, 1], at[side, j, 2]
            new = nx, ny, nz = face_vector(p, pv, pw)
            if normal[side, i, 3] == 0.0:
                if nx == 0.0 and ny == 0.0 and nz == 0.0:
                    return True
            else:
                old = normal[side, i, 0], normal[side, i, 1], normal[side, i, 2]
                if turn_exceeds(old, new, cosine):
                    return True
            on_curves = kind >= CURVE and mesh.kind[v] >= CURVE and mesh.kind[w] >= CURVE
            if on_curves:
                longest = _longest_squared(p, pv, pw)
                if is_flat(nx, ny, nz, longest):
                    old_longest = _longest_squared(centre, pv, pw)
                    height = sqrt(nx * nx + ny * ny + nz * nz) / longest
                    if height * old_longest < _FLATTER * normal[side, i, 3]:
                        return True
    return False


@inlined
def _longest_squared(p, v, w):
    """Squared length of the longest side of a triangle."""
    x, y, z = p
    vx, vy, vz = v
    wx, wy, wz = w
    return max(
        (wx - vx) ** 2 + (wy - vy) ** 2 + (wz - vz) ** 2,
        (vx - x) ** 2 + (vy - y) ** 2 + (vz - z) ** 2,
        (wx - x) ** 2 + (wy - y) ** 2 + (wz - z) ** 2,
    )


@inlined
def collapse_makes_sliver(mesh, place, a, b, rings):
    """Guard (optional): the worst triangle after the collapse would be worse than the worst before."""
    X = mesh.X
    before = 1.0
    after = 1.0
    for side in range(2):
        other = b if side == 0 else a
        for i in range(rings.size[side, 0]):
            h = rings.face[side, i]
            u = mesh.origin[h]
            v = end_of(mesh.origin, h)
            w = apex_of(mesh.origin, h)
            opposite = distance_squared(X, v, w)
            before = min(before, _shape(X, point(X, u), v, w, opposite))
            if v != other and w != other:
                p = place[0], place[1], place[2]
                after = min(after, _shape(X, p, v, w, opposite))
    return after < before


@inlined
def _shape(X, p, v, w, opposite):
    """Mean ratio of a triangle from a point and an edge v-w of squared length ``opposite``."""
    x, y, z = p
    nx, ny, nz = face_vector(p, point(X, v), point(X, w))
    lv = (X[v, 0] - x) ** 2 + (X[v, 1] - y) ** 2 + (X[v, 2] - z) ** 2
    lw = (X[w, 0] - x) ** 2 + (X[w, 1] - y) ** 2 + (X[w, 2] - z) ** 2
    return mean_ratio(lv, lw, opposite, sqrt(nx * nx + ny * ny + nz * nz))
