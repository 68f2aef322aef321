"""The largest principal curvature at every vertex, measured on each side of a crease by itself.

The shape operator is the derivative of the normal along the surface. The area-weighted mean of the
normals around a vertex is, to second order, the normal at the mean of the faces' centroids, not at the
vertex; taken as if it were at the vertex, irregular triangulations put the curvature wrong by a
constant factor, however fine they are. So both means are taken, and the normals differentiated over
triangles of mean positions: linear fields of normals come out exactly, on one-sided fans along
boundaries and creases too. Weights are areas, so slivers count for nothing.
"""

from __future__ import annotations

from math import exp, log, sqrt

import numpy as np

from ..core.compiler import inlined, kernel
from ..core.geometry import area_vector, distance_squared, tangent_basis
from ..core.vocabulary import NONE, BoolArray, FloatArray, IndexArray
from ..mesh.walk import next_halfedge, previous_halfedge

__all__ = ["corner_curvature", "largest_curvature"]

# Means over the one-ring of the shape operators. On a unit sphere of 5,120 faces, noise of 5 % of an
# edge leaves an RMS error of 20, 12, 8 and 5 % after 0, 1, 2 and 4 of them; a fillet of four strips
# beside large faces keeps 0.58, 0.49, 0.43 and 0.37 of its curvature.
_SMOOTHING_ROUNDS = 2

# A face that reaches further from a vertex than its edges are long on (geometric) average counts as if
# cut off there. Without this, large faces beside it leave that fillet 0.24 of its curvature.
_REACH = 1.0

# The least share of an area that its projection to the tangent plane is taken for. Smaller ones come
# from folds.
_FOLD = 0.25


# Of the square of the reach. On a patch of two faces means lie on a line, but for rounding: triangles
# of means say nothing there.
_NOTHING = 1e-12


def largest_curvature(
    X: FloatArray,
    origin: IndexArray,
    twin: IndexArray,
    vertex_halfedge: IndexArray,
    is_feature: BoolArray,
    rounds: int = _SMOOTHING_ROUNDS,
) -> FloatArray:
    """Largest absolute principal curvature at every vertex.

    The tensor, not the number, is smoothed, after the shape operator of each face [Rusinkiewicz 2004,
    section 3]; what is averaged are six numbers of it and six of the projection to the faces' planes,
    whose quotient is free of the error that turning planes make: a prism of eight sides is a cylinder
    to 5 %.

    Parameters
    ----------
    X : (n, 3 or more) float64
        Coordinates in the first three columns.
    origin, twin : (3 m,) int32
    vertex_halfedge : (n,) int32
        See `Mesh`; no face is dead.
    is_feature : (3 m,) bool
        Edges across which nothing is averaged, on both half-edges. Boundaries need no mark.
    rounds : int
        How often the shape operators are averaged over one-rings.

    Returns
    -------
    (n,) float64
        In the inverse unit of ``X``, never negative; where several sides of creases meet, the largest.
        0 at vertices without a face that has an area, and on patches of one or two faces.

    Notes
    -----
    Features less than about four edges wide are flattened by the smoothing.
    """
    _, owner, curvature = _part_curvature(X, origin, twin, vertex_halfedge, is_feature, rounds)
    largest = np.zeros(len(X))
    np.maximum.at(largest, owner, curvature)
    return largest


def corner_curvature(
    X: FloatArray,
    origin: IndexArray,
    twin: IndexArray,
    vertex_halfedge: IndexArray,
    is_feature: BoolArray,
) -> FloatArray:
    """Largest absolute principal curvature at every corner of every face, on its side of features.

    See `largest_curvature`.

    Returns
    -------
    (3 m,) float64
        At the half-edge that leaves the corner.
    """
    arrays = X, origin, twin, vertex_halfedge, is_feature
    part, _, curvature = _part_curvature(*arrays, _SMOOTHING_ROUNDS)
    return curvature[part]


def _part_curvature(
    X: FloatArray,
    origin: IndexArray,
    twin: IndexArray,
    vertex_halfedge: IndexArray,
    is_feature: BoolArray,
    rounds: int,
) -> tuple[IndexArray, IndexArray, FloatArray]:
    """Part of every corner, vertex and curvature of every part."""
    part = np.empty(origin.size, np.int32)
    owner = np.empty(len(X) + np.count_nonzero(is_feature), np.int32)
    count = _part_fans(origin, twin, vertex_halfedge, is_feature, part, owner)
    means = np.zeros((count, 7))
    weights = np.empty(origin.size)
    reach = np.zeros((count, 2))
    _average_normals(X, origin, part, reach, means, weights)
    means = _smoothed(part, weights, means, 1)
    shapes = np.zeros((count, 13))
    _differentiate(part, reach, means, weights, shapes)
    shapes = _smoothed(part, weights, shapes, rounds)
    curvature = np.zeros(count)
    _measure(means, shapes, curvature)
    return part, owner[:count], curvature


def _smoothed(part: IndexArray, weights: FloatArray, fields: FloatArray, rounds: int) -> FloatArray:
    """Average fields of parts over one-rings; their last column is spent as the sum of weights."""
    for _ in range(rounds):
        means = np.zeros_like(fields)
        _smooth(part, weights, fields, means)
        fields = means
    return fields


@kernel
def _part_fans(origin, twin, vertex_halfedge, is_feature, part, owner):
    """Label the sectors that features cut fans into, the first of a vertex as the vertex."""
    n = vertex_halfedge.size
    count = n
    for v in range(n):
        owner[v] = v
        start = np.int64(vertex_halfedge[v])
        if start < 0:
            continue
        if twin[start] != NONE:
            h = start
            while not is_feature[h]:
                h = np.int64(twin[previous_halfedge(h)])
                if h == start:
                    break
            start = h
        sector = v
        h = start
        while True:
            part[h] = sector
            h = np.int64(twin[previous_halfedge(h)])
            if h == NONE or h == start:
                break
            if is_feature[h]:
                sector = count
                owner[count] = v
                count += 1
    return count


@inlined
def _cut_off(reach, x, y, z):
    """Share of a vector that lies within reach."""
    length = sqrt(x * x + y * y + z * z)
    return reach / length if length > reach else 1.0


@kernel
def _average_normals(X, origin, part, reach, means, weights):
    """Mean position and mean unit normal around every part, and the weights of the faces in them.

    The first column of ``reach`` becomes the geometric mean of the edges: short edges of slivers do
    not shorten it much, edges to far vertices do not lengthen it much.
    """
    for h in range(origin.size):
        g = next_halfedge(np.int64(h))
        length = distance_squared(X, origin[h], origin[g])
        if length > 0.0:
            for end in (part[h], part[g]):
                reach[end, 0] += 0.5 * log(length)
                reach[end, 1] += 1.0
    for p in range(len(reach)):
        if reach[p, 1] > 0.0:
            reach[p, 0] = _REACH * exp(reach[p, 0] / reach[p, 1])
    for f in range(origin.size // 3):
        a, b, c = origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]
        nx, ny, nz = area_vector(X, a, b, c)
        area = sqrt(nx * nx + ny * ny + nz * nz)
        for h in range(3 * f, 3 * f + 3):
            v = origin[h]
            p = part[h]
            x = (X[a, 0] + X[b, 0] + X[c, 0]) / 3.0 - X[v, 0]
            y = (X[a, 1] + X[b, 1] + X[c, 1]) / 3.0 - X[v, 1]
            z = (X[a, 2] + X[b, 2] + X[c, 2]) / 3.0 - X[v, 2]
            share = _cut_off(reach[p, 0], x, y, z)
            square = share * share
            weights[h] = square * area
            means[p, 0] += square * area * (X[v, 0] + share * x)
            means[p, 1] += square * area * (X[v, 1] + share * y)
            means[p, 2] += square * area * (X[v, 2] + share * z)
            means[p, 3] += square * nx
            means[p, 4] += square * ny
            means[p, 5] += square * nz
            means[p, 6] += square * area
    _divide(means)


@inlined
def _divide(fields):
    """Divide by the last column."""
    last = fields.shape[1] - 1
    for p in range(len(fields)):
        if fields[p, last] > 0.0:
            for i in range(last):
                fields[p, i] /= fields[p, last]


@kernel
def _smooth(part, weights, fields, means):
    """Mean over the faces of a part, each with the mean of its three parts."""
    last = fields.shape[1] - 1
    for f in range(part.size // 3):
        h = 3 * f
        a, b, c = part[h], part[h + 1], part[h + 2]
        for i in range(last):
            mean = (fields[a, i] + fields[b, i] + fields[c, i]) / 3.0
            means[a, i] += weights[h] * mean
            means[b, i] += weights[h + 1] * mean
            means[c, i] += weights[h + 2] * mean
        means[a, last] += weights[h]
        means[b, last] += weights[h + 1]
        means[c, last] += weights[h + 2]
    _divide(means)


@kernel
def _differentiate(part, reach, means, weights, shapes):
    """Mean shape operator and mean projection around every part; sets the weights of the faces.

    Six numbers each, of a symmetric matrix: xx, yy, zz, xy, yz, zx. Times twice the area of a face,
    the derivative of the normals is a sum of products with its edges, which no sliver makes large.
    """
    for f in range(part.size // 3):
        a, b, c = part[3 * f], part[3 * f + 1], part[3 * f + 2]
        ux, uy, uz = area_vector(means, a, b, c)
        area = sqrt(ux * ux + uy * uy + uz * uz)
        nothing = _NOTHING * reach[a, 0] * reach[a, 0]
        if area <= nothing or min(means[a, 6], means[b, 6], means[c, 6]) == 0.0:
            weights[3 * f : 3 * f + 3] = 0.0
            continue
        ux, uy, uz = ux / area, uy / area, uz / area
        xx, yy, zz, xy, yz, zx = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for p, q, r in ((a, b, c), (b, c, a), (c, a, b)):
            ex, ey, ez = (
                means[r, 0] - means[q, 0],
                means[r, 1] - means[q, 1],
                means[r, 2] - means[q, 2],
            )
            gx, gy, gz = uy * ez - uz * ey, uz * ex - ux * ez, ux * ey - uy * ex
            nx, ny, nz = means[p, 3], means[p, 4], means[p, 5]
            xx += nx * gx
            yy += ny * gy
            zz += nz * gz
            xy += 0.5 * (nx * gy + ny * gx)
            yz += 0.5 * (ny * gz + nz * gy)
            zx += 0.5 * (nz * gx + nx * gz)
        mx = (means[a, 0] + means[b, 0] + means[c, 0]) / 3.0
        my = (means[a, 1] + means[b, 1] + means[c, 1]) / 3.0
        mz = (means[a, 2] + means[b, 2] + means[c, 2]) / 3.0
        for h in range(3 * f, 3 * f + 3):
            p = part[h]
            share = _cut_off(reach[p, 0], mx - means[p, 0], my - means[p, 1], mz - means[p, 2])
            square = share * share
            weight = square * area
            weights[h] = weight
            shapes[p, 0] += square * xx
            shapes[p, 1] += square * yy
            shapes[p, 2] += square * zz
            shapes[p, 3] += square * xy
            shapes[p, 4] += square * yz
            shapes[p, 5] += square * zx
            shapes[p, 6] += weight * (1.0 - ux * ux)
            shapes[p, 7] += weight * (1.0 - uy * uy)
            shapes[p, 8] += weight * (1.0 - uz * uz)
            shapes[p, 9] -= weight * ux * uy
            shapes[p, 10] -= weight * uy * uz
            shapes[p, 11] -= weight * uz * ux
            shapes[p, 12] += weight
    _divide(shapes)


@inlined
def _form(shapes, p, i, a, b):
    """Bilinear form of the symmetric matrix at column ``i``, for two vectors."""
    ax, ay, az = a
    bx, by, bz = b
    diagonal = ax * bx * shapes[p, i] + ay * by * shapes[p, i + 1] + az * bz * shapes[p, i + 2]
    xy = (ax * by + ay * bx) * shapes[p, i + 3]
    yz = (ay * bz + az * by) * shapes[p, i + 4]
    zx = (az * bx + ax * bz) * shapes[p, i + 5]
    return diagonal + xy + yz + zx


@kernel
def _measure(means, shapes, curvature):
    """Largest curvature of every part, from the operators in the tangent plane.

    With shape operator S and projection P, the principal curvatures solve ``det(S - k P) = 0``.
    """
    for p in range(len(shapes)):
        nx, ny, nz = means[p, 3], means[p, 4], means[p, 5]
        norm = sqrt(nx * nx + ny * ny + nz * nz)
        if norm == 0.0:
            continue
        ax, ay, az, bx, by, bz = tangent_basis(nx / norm, ny / norm, nz / norm)
        a, b = (ax, ay, az), (bx, by, bz)
        s_aa = _form(shapes, p, 0, a, a)
        s_ab = _form(shapes, p, 0, a, b)
        s_bb = _form(shapes, p, 0, b, b)
        p_aa = _form(shapes, p, 6, a, a)
        p_ab = _form(shapes, p, 6, a, b)
        p_bb = _form(shapes, p, 6, b, b)
        least = 0.5 * (p_aa + p_bb) - sqrt(0.25 * (p_aa - p_bb) ** 2 + p_ab * p_ab)
        lift = max(0.0, _FOLD - least)
        p_aa += lift
        p_bb += lift
        determinant = p_aa * p_bb - p_ab * p_ab
        mean = 0.5 * (s_aa * p_bb + s_bb * p_aa - 2.0 * s_ab * p_ab) / determinant
        gauss = (s_aa * s_bb - s_ab * s_ab) / determinant
        curvature[p] = abs(mean) + sqrt(max(0.0, mean * mean - gauss))
