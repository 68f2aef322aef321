"""How fast target lengths may grow over the surface: the slope of the field on edges and in faces."""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..core.compiler import inlined, kernel
from ..core.geometry import area_vector, distance_squared
from ..core.vocabulary import NONE, FloatArray, IndexArray
from ..mesh.walk import next_halfedge, previous_halfedge

__all__ = ["gradation_slope", "limit_gradation"]

# Slopes above the limit by less than this share are left.
_SLACK = 1e-9

# Faces that are too steep are lowered to this share of the limit: chains of slivers, each of which
# takes a little from the next, then end 15 times sooner.
_AIM = 0.999

# Vertices are visited about twice each, on meshes of nothing but folds and slivers three times. Where so
# many visits are not enough, the whole field is scaled.
_VISITS = 100


def gradation_slope(gradation: float) -> float:
    """Growth of length by distance that keeps the ratio at the ends of new edges below a gradation.

    With an edge as long as 4/3 of the mean of the lengths at its ends.
    """
    return 1.5 * (gradation - 1.0) / (gradation + 1.0)


def limit_gradation(
    X: FloatArray,
    origin: IndexArray,
    twin: IndexArray,
    vertex_halfedge: IndexArray,
    lengths: FloatArray,
    gradation: float,
) -> FloatArray:
    """Lower lengths until they grow slowly enough on every edge and inside every face.

    Vertices are visited by rising length, as Dijkstra does, and limit their neighbours: first along
    edges alone, then the gradient of the linear interpolant in every face. Bounds on gradients have
    no largest solution (of two vertices, either may give way); here both give way by the same. On small
    meshes the sum of lengths is on average 95 % of the largest possible, on the worst slivers 75 %.

    Parameters
    ----------
    X : (n, 3 or more) float64
    origin, twin : (3 m,) int32
    vertex_halfedge : (n,) int32
    lengths : (n,) float64
        Positive; unchanged.
    gradation : float
        Largest ratio of the lengths at the ends of a new edge, above 1.

    Returns
    -------
    (n,) float64
        Between the smallest of the lengths and each. Its slope is at most ``gradation_slope`` on every
        edge and in every face, but for 1e-9 of it, and for rounding in faces without height. Applied
        to its own result, the function changes no bit.
    """
    slope = gradation_slope(gradation)
    limited = lengths.astype(np.float64)
    n = len(lengths)
    arrays = (X, origin, twin, vertex_halfedge, slope, limited)
    heap, place = np.empty(n, np.int32), np.full(n, NONE, np.int32)
    _limit(*arrays, False, n * n, heap, place)
    if not _limit(*arrays, True, _VISITS * n, heap, place):
        # Flatten the field as a whole: sound, whatever kept the visits from an end.
        least = limited.min()
        excess = _steepest(X, origin, limited) / (slope * (1.0 - _SLACK))
        limited = np.minimum(limited, least + (limited - least) / max(1.0, excess))
    return limited


@inlined
def _is_before(lengths, u, v):
    return lengths[u] < lengths[v] or (lengths[u] == lengths[v] and u < v)


@inlined
def _push(heap, place, lengths, size, v):
    """Add a vertex to the heap, or move it up after its length was lowered; returns the new size."""
    i = np.int64(place[v])
    if i == NONE:
        i = size
        size += 1
    while i > 0:
        u = heap[(i - 1) // 2]
        if _is_before(lengths, u, v):
            break
        heap[i] = u
        place[u] = i
        i = (i - 1) // 2
    heap[i] = v
    place[v] = i
    return size


@inlined
def _pop(heap, place, lengths, size):
    """Take the vertex with the smallest length from the heap."""
    top = heap[0]
    place[top] = NONE
    size -= 1
    v = heap[size]
    i = np.int64(0)
    while 2 * i + 1 < size:
        child = 2 * i + 1
        if child + 1 < size and _is_before(lengths, heap[child + 1], heap[child]):
            child += 1
        if _is_before(lengths, v, heap[child]):
            break
        heap[i] = heap[child]
        place[heap[i]] = i
        i = child
    if size > 0:
        heap[i] = v
        place[v] = i
    return top


@inlined
def _turned_gradient(X, u, a, b, c):
    """Gradient of ``u`` in a face, times twice its area and turned by 90 degrees; that area.

    It is the sum of ``u`` times opposite edges, so its product with an edge is, up to a positive factor,
    the slope towards the opposite vertex.
    """
    x, y, z = area_vector(X, a, b, c)
    p, q = u[b] - u[a], u[c] - u[a]
    return (
        p * (X[a, 0] - X[c, 0]) + q * (X[b, 0] - X[a, 0]),
        p * (X[a, 1] - X[c, 1]) + q * (X[b, 1] - X[a, 1]),
        p * (X[a, 2] - X[c, 2]) + q * (X[b, 2] - X[a, 2]),
        sqrt(x * x + y * y + z * z),
    )


@inlined
def _rounding(X, u, a, b, c):
    """Error of the turned gradient: what is left where a face has no height."""
    longest = max(distance_squared(X, a, b), distance_squared(X, b, c), distance_squared(X, c, a))
    return 1e-15 * max(u[a], u[b], u[c]) * sqrt(longest)


@inlined
def _is_steep(X, u, a, b, c, slope):
    """Tell whether the gradient in a face exceeds a slope by more than slack and rounding."""
    x, y, z, area = _turned_gradient(X, u, a, b, c)
    allowed = slope * area * (1.0 + _SLACK) + _rounding(X, u, a, b, c)
    return sqrt(x * x + y * y + z * z) > allowed


@inlined
def _along(X, x, y, z, a, b):
    return x * (X[b, 0] - X[a, 0]) + y * (X[b, 1] - X[a, 1]) + z * (X[b, 2] - X[a, 2])


@inlined
def _front_step(excess, product, squared_edge):
    """Smallest step ``t`` with ``|w - t e| = r``, from ``w w - r r``, ``w e`` and ``e e``."""
    return excess / (product + sqrt(max(0.0, product * product - squared_edge * excess)))


@inlined
def _flatten_face(X, u, a, b, c, slope):
    """Lower ``u`` at the corners of a steep face, by about as little as possible.

    ``a`` is the corner that the gradient leads away from most. If it leads towards one other corner,
    this gives way; if towards both, both by the same. Where they would end below the smallest of the
    three, which obtuse faces may ask for, the higher one alone, and where even that is too much, all
    three are drawn towards the smallest.
    """
    for _ in range(2):
        x, y, z, area = _turned_gradient(X, u, a, b, c)
        towards_a = _along(X, x, y, z, b, c)
        if towards_a <= _along(X, x, y, z, c, a) and towards_a <= _along(X, x, y, z, a, b):
            break
        a, b, c = b, c, a
    x, y, z, area = _turned_gradient(X, u, a, b, c)
    towards_a = _along(X, x, y, z, b, c)
    towards_b = _along(X, x, y, z, c, a)
    towards_c = _along(X, x, y, z, a, b)
    radius = _AIM * slope * area
    square = x * x + y * y + z * z
    excess = square - radius * radius
    least = min(u[a], u[b], u[c])
    if towards_b > 0.0 and towards_c > 0.0:
        step = _front_step(excess, -towards_a, distance_squared(X, b, c))
        if min(u[b], u[c]) - step >= least:
            u[b] -= step
            u[c] -= step
            return
        b_gives_way = u[b] > u[c]
    else:
        b_gives_way = towards_b > towards_c
    if b_gives_way:
        b, c = c, b
        towards_c = towards_b
    step = _front_step(excess, towards_c, distance_squared(X, a, b))
    if u[c] - step >= least:
        u[c] -= step
        return
    share = radius / sqrt(square)
    u[a] = least + share * (u[a] - least)
    u[b] = least + share * (u[b] - least)
    u[c] = least + share * (u[c] - least)


@inlined
def _reach_of(X, u, slope, a, b):
    """Largest value at ``b`` that the slope from ``a`` allows."""
    return u[a] + slope * sqrt(distance_squared(X, a, b))


@kernel
def _limit(X, origin, twin, vertex_halfedge, slope, u, by_faces, visits, heap, place):
    """Limit the slope of ``u`` along edges, and by request in faces; False if visits ran out."""
    size = 0
    for h in range(origin.size):
        a, b = origin[h], origin[next_halfedge(np.int64(h))]
        is_bad = _reach_of(X, u, slope, a, b) < u[b] or _reach_of(X, u, slope, b, a) < u[a]
        if by_faces and not is_bad:
            is_bad = _is_steep(X, u, a, b, origin[previous_halfedge(np.int64(h))], slope)
        if is_bad:
            size = _push(heap, place, u, size, a)
            size = _push(heap, place, u, size, b)
    while size > 0:
        if visits == 0:
            return False
        visits -= 1
        v = _pop(heap, place, u, size)
        size -= 1
        start = np.int64(vertex_halfedge[v])
        h = start
        while True:
            a, b, c = origin[h], origin[next_halfedge(h)], origin[previous_halfedge(h)]
            before_a, before_b, before_c = u[a], u[b], u[c]
            u[b] = min(u[b], _reach_of(X, u, slope, a, b))
            u[c] = min(u[c], _reach_of(X, u, slope, a, c))
            if by_faces and _is_steep(X, u, a, b, c, slope):
                _flatten_face(X, u, a, b, c, slope)
            if u[a] < before_a:
                size = _push(heap, place, u, size, a)
            if u[b] < before_b:
                size = _push(heap, place, u, size, b)
            if u[c] < before_c:
                size = _push(heap, place, u, size, c)
            h = np.int64(twin[previous_halfedge(h)])
            if h == NONE or h == start:
                break
    return True


@kernel
def _steepest(X, origin, u):
    """Largest slope of ``u`` on an edge or in a face; those without an extent are left out."""
    steepest = 0.0
    for f in range(origin.size // 3):
        a, b, c = origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]
        for p, q in ((a, b), (b, c), (c, a)):
            length = sqrt(distance_squared(X, p, q))
            if length > 0.0:
                steepest = max(steepest, abs(u[p] - u[q]) / length)
        x, y, z, area = _turned_gradient(X, u, a, b, c)
        if area > 0.0:
            rest = sqrt(x * x + y * y + z * z) - _rounding(X, u, a, b, c)
            steepest = max(steepest, rest / area)
    return steepest
