"""Guards of a collapse: each says of one thing whether the mesh would be worse off.

A collapse moves the ends a and b of an edge to one place. Row 0 of `Rings` is the ring of a, row 1 that
of b.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

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
from ..mesh.walk import next_halfedge, previous_halfedge

__all__ = [
    "collapse_makes_sliver",
    "folds_over",
    "joins_curves",
    "keeps_curves",
    "keeps_link",
    "overshoots",
]


@inlined
def keeps_curves(mesh, h, a, b):
    """Guard: fixed and held vertices stay, and a vertex of a curve leaves along this curve only.

    Of the face beside a vanishing edge at most one other edge may be on a curve, since the two become
    one; a boundary edge stays where its face hangs on it alone.
    """
    kind = min(mesh.kind[a], mesh.kind[b])
    if kind == INNER:
        return True
    if kind != CURVE or mesh.curve[h] < 0:
        return False
    t = np.int64(mesh.twin[h])
    if joins_curves(mesh, h) or (t != NONE and joins_curves(mesh, t)):
        return False
    return t != NONE or (
        mesh.twin[next_halfedge(h)] != NONE or mesh.twin[previous_halfedge(h)] != NONE
    )


@inlined
def joins_curves(mesh, h):
    """Tell whether both other edges of a face are on curves."""
    return mesh.curve[next_halfedge(h)] != NONE and mesh.curve[previous_halfedge(h)] != NONE


@inlined
def keeps_link(mesh, h, rings):
    """Guard: the link condition, link(a) and link(b) meet in link(ab) only.

    [Dey et al. 1999]: the common neighbours are the apexes of the edge's faces, and a tetrahedron,
    whose links share an edge too, stays.
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
def overshoots(rings, x, y, z, s, a, b, half_factor):
    """Guard: an edge from the new position to a ring would be too long for the length ``s`` there."""
    for side in range(2):
        other = a if side else b
        for i in range(rings.size[side, 1]):
            dx = rings.point[side, i, 0] - x
            dy = rings.point[side, i, 1] - y
            dz = rings.point[side, i, 2] - z
            limit = half_factor * (s + rings.point[side, i, 3])
            if rings.vertex[side, i] != other and dx * dx + dy * dy + dz * dz > limit * limit:
                return True
    return False


@inlined
def folds_over(mesh, x, y, z, kind, a, b, rings, cosine):
    """Guard: a face that stays would turn its normal too far, or lose its area.

    ``kind`` is that of the vertex that stays. On a curve, faces whose corners all lie on curves may
    become flat along a straight one, with a normal that is rounding.
    """
    at = rings.point
    normal = rings.normal
    for side in range(2):
        other = a if side else b
        for i in range(rings.size[side, 0]):
            j = i + 1 if i + 1 < rings.size[side, 1] else 0
            v = rings.vertex[side, i]
            w = rings.vertex[side, j]
            if v == other or w == other:
                continue
            vx, vy, vz = at[side, i, 0], at[side, i, 1], at[side, i, 2]
            wx, wy, wz = at[side, j, 0], at[side, j, 1], at[side, j, 2]
            nx, ny, nz = face_vector((x, y, z), (vx, vy, vz), (wx, wy, wz))
            if normal[side, i, 3] == 0.0:
                if nx == 0.0 and ny == 0.0 and nz == 0.0:
                    return True
            elif turn_exceeds(
                (normal[side, i, 0], normal[side, i, 1], normal[side, i, 2]), (nx, ny, nz), cosine
            ):
                return True
            if kind >= CURVE and mesh.kind[v] >= CURVE and mesh.kind[w] >= CURVE:
                longest = max(
                    (wx - vx) ** 2 + (wy - vy) ** 2 + (wz - vz) ** 2,
                    (vx - x) ** 2 + (vy - y) ** 2 + (vz - z) ** 2,
                    (wx - x) ** 2 + (wy - y) ** 2 + (wz - z) ** 2,
                )
                if is_flat(nx, ny, nz, longest):
                    return True
    return False


@inlined
def collapse_makes_sliver(mesh, x, y, z, a, b, faces, n_a, n_b):
    """Guard (optional): the worst triangle after would be worse than the worst before."""
    X = mesh.X
    before = 1.0
    after = 1.0
    for side in range(2):
        other = b if side == 0 else a
        for i in range(n_a if side == 0 else n_b):
            h = faces[side, i]
            u = mesh.origin[h]
            v = mesh.origin[next_halfedge(h)]
            w = mesh.origin[previous_halfedge(h)]
            opposite = distance_squared(X, v, w)
            before = min(before, _worst_shape(X, X[u, 0], X[u, 1], X[u, 2], v, w, opposite))
            if v != other and w != other:
                after = min(after, _worst_shape(X, x, y, z, v, w, opposite))
    return after < before


@inlined
def _worst_shape(X, x, y, z, v, w, opposite):
    nx, ny, nz = face_vector((x, y, z), point(X, v), point(X, w))
    lv = (X[v, 0] - x) ** 2 + (X[v, 1] - y) ** 2 + (X[v, 2] - z) ** 2
    lw = (X[w, 0] - x) ** 2 + (X[w, 1] - y) ** 2 + (X[w, 2] - z) ** 2
    return mean_ratio(lv, lw, opposite, sqrt(nx * nx + ny * ny + nz * nz))
