"""Formulas: lengths, normals, Voronoi areas, shape, closest points.

Scalars in, scalars out, no Python objects: the same source could be compiled for a GPU. Points and
vectors are tuples of three numbers, which the compiler keeps in registers. Kernels index coordinates
as ``X[v, 0..2]``; `point` reads all three.
"""

from __future__ import annotations

from math import sqrt

from .compiler import inlined

__all__ = [
    "SHARP",
    "angle_from_cosine",
    "area_vector",
    "closest_on_segment",
    "closest_on_triangle",
    "corner_angles",
    "distance_squared",
    "face_vector",
    "is_flat",
    "mean_ratio",
    "mixed_voronoi_areas",
    "point",
    "squared_length",
    "tangent_basis",
    "turn_exceeds",
]


# A vertex is sharp where its normals cancel: their weighted sum is shorter than this share of what it
# would be on a plane (a fold of 60 degrees to each side; 0.71 on the edge of a cube, 0.58 at its
# corner).
SHARP = 0.3


@inlined
def point(X, v):
    """Return the coordinates of a row of ``X`` as a tuple."""
    return X[v, 0], X[v, 1], X[v, 2]


@inlined
def distance_squared(X, a, b):
    """Squared length of the edge a-b; the same bits in both directions."""
    x = X[a, 0] - X[b, 0]
    y = X[a, 1] - X[b, 1]
    z = X[a, 2] - X[b, 2]
    return x * x + y * y + z * z


@inlined
def squared_length(p, q):
    """Squared distance of two points."""
    px, py, pz = p
    qx, qy, qz = q
    return (px - qx) ** 2 + (py - qy) ** 2 + (pz - qz) ** 2


@inlined
def face_vector(a, b, c):
    """Twice the area times the unit normal of the triangle a, b, c."""
    ax, ay, az = a
    bx, by, bz = b
    cx, cy, cz = c
    ux = bx - ax
    uy = by - ay
    uz = bz - az
    wx = cx - ax
    wy = cy - ay
    wz = cz - az
    return uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx


@inlined
def area_vector(X, a, b, c):
    """Twice the area times the unit normal of the face with corners ``X[a]``, ``X[b]``, ``X[c]``."""
    return face_vector(point(X, a), point(X, b), point(X, c))


@inlined
def is_flat(nx, ny, nz, longest_squared):
    """Tell from its vector whether a face is lower than a thirtieth of its longest side.

    Three points of a straight line are, and three in a row on a curve that hardly bends.
    """
    limit = 0.03 * longest_squared
    return nx * nx + ny * ny + nz * nz < limit * limit


@inlined
def turn_exceeds(u, w, cosine):
    """Tell whether the angle between two vectors exceeds ``acos(cosine)``, ``cosine >= 0``.

    A zero ``w`` always exceeds; no square root is taken.
    """
    ux, uy, uz = u
    wx, wy, wz = w
    dot = ux * wx + uy * wy + uz * wz
    if dot <= 0.0:
        return True
    norms = (ux * ux + uy * uy + uz * uz) * (wx * wx + wy * wy + wz * wz)
    return dot * dot < cosine * cosine * norms


@inlined
def mean_ratio(l0, l1, l2, double_area):
    """Shape of a triangle from squared lengths: 1 equilateral, 0 degenerate.

    ``4 sqrt(3) area / (sum of squared edge lengths)`` [Bank and Smith 1997].
    """
    total = l0 + l1 + l2
    if total <= 0.0:
        return 0.0
    return 3.4641016151377544 * double_area / total


@inlined
def mixed_voronoi_areas(l0, l1, l2, double_area):
    """Split a triangle's area among its corners [Meyer et al. 2003, section 3.3].

    ``l0, l1, l2`` are the squared lengths of the edges opposite corners 0, 1, 2.
    """
    quarter = 0.125 * double_area
    if l0 > l1 + l2:
        return 2.0 * quarter, quarter, quarter
    if l1 > l2 + l0:
        return quarter, 2.0 * quarter, quarter
    if l2 > l0 + l1:
        return quarter, quarter, 2.0 * quarter
    if double_area <= 0.0:
        return 0.0, 0.0, 0.0
    # cot_i = (l_j + l_k - l_i) / (4 area); each corner gets (l_j cot_j + l_k cot_k) / 8.
    scale = 0.0625 / double_area
    w0 = scale * l0 * (l1 + l2 - l0)
    w1 = scale * l1 * (l2 + l0 - l1)
    w2 = scale * l2 * (l0 + l1 - l2)
    return w1 + w2, w2 + w0, w0 + w1


@inlined
def angle_from_cosine(cosine):
    """Angle in [0, pi], to 7e-5 rad [Abramowitz and Stegun 1964, 4.4.45].

    For sums that need no more, at a fifth of the time of ``acos``.
    """
    x = abs(cosine)
    if x > 1.0:
        x = 1.0
    angle = sqrt(1.0 - x) * (1.5707288 + x * (-0.2121144 + x * (0.0742610 - 0.0187293 * x)))
    return 3.141592653589793 - angle if cosine < 0.0 else angle


@inlined
def corner_angles(X, a, b, c):
    """Angles of a triangle to 1e-4 rad, the third as what is missing to pi.

    All are 0 where an edge has no length.
    """
    ux, uy, uz = X[b, 0] - X[a, 0], X[b, 1] - X[a, 1], X[b, 2] - X[a, 2]
    vx, vy, vz = X[c, 0] - X[a, 0], X[c, 1] - X[a, 1], X[c, 2] - X[a, 2]
    uu = ux * ux + uy * uy + uz * uz
    vv = vx * vx + vy * vy + vz * vz
    uv = ux * vx + uy * vy + uz * vz
    ww = uu + vv - 2.0 * uv
    if not (uu > 0.0 and vv > 0.0 and ww > 0.0):
        return 0.0, 0.0, 0.0
    angle_a = angle_from_cosine(uv / sqrt(uu * vv))
    angle_b = angle_from_cosine((uu - uv) / sqrt(uu * ww))
    return angle_a, angle_b, max(0.0, 3.141592653589793 - angle_a - angle_b)


@inlined
def tangent_basis(nx, ny, nz):
    """Two unit vectors normal to a unit vector and to each other [Duff et al. 2017]."""
    sign = 1.0 if nz >= 0.0 else -1.0
    p = -1.0 / (sign + nz)
    q = nx * ny * p
    return 1.0 + sign * nx * nx * p, sign * q, -sign * nx, q, sign + ny * ny * p, -ny


@inlined
def closest_on_segment(p, a, b):
    """Parameter in [0, 1] of the point of a-b closest to p, and the squared distance."""
    px, py, pz = p
    ax, ay, az = a
    bx, by, bz = b
    ux = bx - ax
    uy = by - ay
    uz = bz - az
    length = ux * ux + uy * uy + uz * uz
    s = 0.0
    if length > 0.0:
        s = ((px - ax) * ux + (py - ay) * uy + (pz - az) * uz) / length
        s = min(max(s, 0.0), 1.0)
    x = px - (ax + s * ux)
    y = py - (ay + s * uy)
    z = pz - (az + s * uz)
    return s, x * x + y * y + z * z


@inlined
def closest_on_triangle(p, a, b, c):
    """Barycentric weights of b and c of the closest point, and the squared distance.

    Where p does not lie over the triangle, the closest of its three edges decides; so it does for a
    triangle without area. Weights come from vector products: the usual scalar products lose all
    digits on needles.
    """
    px, py, pz = p
    ax, ay, az = a
    bx, by, bz = b
    cx, cy, cz = c
    ux, uy, uz = bx - ax, by - ay, bz - az
    wx, wy, wz = cx - ax, cy - ay, cz - az
    qx, qy, qz = px - ax, py - ay, pz - az
    nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    nn = nx * nx + ny * ny + nz * nz
    s = (qy * wz - qz * wy) * nx + (qz * wx - qx * wz) * ny + (qx * wy - qy * wx) * nz
    t = (uy * qz - uz * qy) * nx + (uz * qx - ux * qz) * ny + (ux * qy - uy * qx) * nz
    # Below an angle of 1e-9 the normal is rounding; the edges are then as close.
    flat = 1e-18 * (ux * ux + uy * uy + uz * uz) * (wx * wx + wy * wy + wz * wz)
    if s >= 0.0 and t >= 0.0 and s + t <= nn and nn > flat:
        s /= nn
        t /= nn
        x = qx - s * ux - t * wx
        y = qy - s * uy - t * wy
        z = qz - s * uz - t * wz
        return s, t, x * x + y * y + z * z
    best_s, best = closest_on_segment(p, a, b)
    best_t = 0.0
    r, d = closest_on_segment(p, a, c)
    if d < best:
        best_s, best_t, best = 0.0, r, d
    r, d = closest_on_segment(p, b, c)
    if d < best:
        best_s, best_t, best = 1.0 - r, r, d
    return best_s, best_t, best
