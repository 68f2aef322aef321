"""Guards of a collapse: each says of one thing whether the mesh would be worse off.

A collapse moves the ends a and b of an edge to one place. Row 0 of `Rings` is the ring of a, row 1 that
of b.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from .._jit import inlined
from .._types import CURVE, INNER, NONE
from ..geometry import distance_squared, face_vector, is_flat, mean_ratio, turn_exceeds
from ..halfedge import following, previous

__all__ = ["folds_over", "joins_curves", "keeps_curves", "keeps_link", "makes_sliver", "overshoots"]


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
    return t != NONE or (mesh.twin[following(h)] != NONE or mesh.twin[previous(h)] != NONE)


@inlined
def joins_curves(mesh, h):
    """Tell whether both other edges of a face are on curves."""
    return mesh.curve[following(h)] != NONE and mesh.curve[previous(h)] != NONE


@inlined
def keeps_link(mesh, h, ring, n_a, m_a, n_b, m_b):
    """Guard: the link condition, link(a) and link(b) meet in link(ab) only.

    [Dey et al. 1999]: the common neighbours are the apexes of the edge's faces, and a tetrahedron,
    whose links share an edge too, stays.
    """
    common = 0
    for i in range(m_a):
        for j in range(m_b):
            common += ring[0, i] == ring[1, j]
    if mesh.twin[h] == NONE:
        return common == 1
    return common == 2 and not (n_a == 3 and m_a == 3 and n_b == 3 and m_b == 3)


@inlined
def overshoots(rings, side, m, x, y, z, s, other, half_factor):
    """Guard: an edge from the new position to the ring would be too long for the length ``s`` there."""
    for i in range(m):
        dx = rings.point[side, i, 0] - x
        dy = rings.point[side, i, 1] - y
        dz = rings.point[side, i, 2] - z
        limit = half_factor * (s + rings.point[side, i, 3])
        if rings.vertex[side, i] != other and dx * dx + dy * dy + dz * dz > limit * limit:
            return True
    return False


@inlined
def folds_over(mesh, x, y, z, kind, other, rings, side, n, m, cosine):
    """Guard: a face that stays would turn its normal too far, or lose its area.

    ``kind`` is that of the vertex that stays. On a curve, faces whose corners all lie on curves may
    become flat along a straight one, with a normal that is rounding.
    """
    point = rings.point
    normal = rings.normal
    for i in range(n):
        j = i + 1 if i + 1 < m else 0
        v = rings.vertex[side, i]
        w = rings.vertex[side, j]
        if v == other or w == other:
            continue
        nx, ny, nz = face_vector(
            x, y, z,
            point[side, i, 0], point[side, i, 1], point[side, i, 2],
            point[side, j, 0], point[side, j, 1], point[side, j, 2],
        )  # fmt: skip
        if normal[side, i, 3] == 0.0:
            if nx == 0.0 and ny == 0.0 and nz == 0.0:
                return True
        elif turn_exceeds(
            normal[side, i, 0], normal[side, i, 1], normal[side, i, 2], nx, ny, nz, cosine
        ):
            return True
        if kind >= CURVE and mesh.kind[v] >= CURVE and mesh.kind[w] >= CURVE:
            X = mesh.X
            longest = max(
                distance_squared(X, v, w),
                (X[v, 0] - x) ** 2 + (X[v, 1] - y) ** 2 + (X[v, 2] - z) ** 2,
                (X[w, 0] - x) ** 2 + (X[w, 1] - y) ** 2 + (X[w, 2] - z) ** 2,
            )
            if is_flat(nx, ny, nz, longest):
                return True
    return False


@inlined
def makes_sliver(mesh, x, y, z, a, b, faces, n_a, n_b):
    """Guard (optional): the worst triangle after would be worse than the worst before."""
    X = mesh.X
    before = 1.0
    after = 1.0
    for side in range(2):
        other = b if side == 0 else a
        for i in range(n_a if side == 0 else n_b):
            h = faces[side, i]
            u = mesh.origin[h]
            v = mesh.origin[following(h)]
            w = mesh.origin[previous(h)]
            opposite = distance_squared(X, v, w)
            before = min(before, _shape(X, X[u, 0], X[u, 1], X[u, 2], v, w, opposite))
            if v != other and w != other:
                after = min(after, _shape(X, x, y, z, v, w, opposite))
    return after < before


@inlined
def _shape(X, x, y, z, v, w, opposite):
    nx, ny, nz = face_vector(x, y, z, X[v, 0], X[v, 1], X[v, 2], X[w, 0], X[w, 1], X[w, 2])
    lv = (X[v, 0] - x) ** 2 + (X[v, 1] - y) ** 2 + (X[v, 2] - z) ** 2
    lw = (X[w, 0] - x) ** 2 + (X[w, 1] - y) ** 2 + (X[w, 2] - z) ** 2
    return mean_ratio(lv, lw, opposite, sqrt(nx * nx + ny * ny + nz * nz))
