"""Corners: vertices where a feature curve ends, meets others, or turns sharply."""

from __future__ import annotations

from math import acos, degrees, sqrt
from typing import NamedTuple

import numpy as np

from ..core.compiler import inlined, kernel
from ..core.geometry import distance_squared, point
from ..core.vocabulary import NONE, BoolArray, FloatArray, IndexArray
from ..mesh.walk import next_halfedge
from .curves import Curves

__all__ = ["find_corners"]

# A turn of more degrees than this, measured over half a target length on both sides, is sharp.
CORNER_TURN = 50.0

# On an arc of any radius the turn over L / 2 is half of the turn over L; at a corner the two are equal.
CORNER_SHARE = 0.7

# This fails where the next corner is near, as at the end of a strip about as wide as L / 2. There the
# turn over L / 4 still equals the turn over L / 2. At 0.88 the two tests leave no gap between them on a
# strip of any width; below, they would find corners on a circle of 8 sides.
LOCAL_SHARE = 0.88

# Curves shorter than 4 L are measured over this share of their length. A circle turns by 45 degrees
# there, and a rectangle with sides of up to 3 to 1 keeps its corners.
SHORT_SHARE = 0.125

# Where this share of the corners, and at least so many, vanish over 1.5 L, curves climb from voxel to
# voxel: over L / 2 each of their steps is a corner. Teeth as wide as 3/4 L do not vanish. On 100 meshes
# without labels the share is at most 0.22, but 0.5 on two with ragged borders.
ZIGZAG_SHARE = 0.4
ZIGZAG_CORNERS = 3

# Turns are rounded to so many degrees before they are compared, so that the corners of a square count
# as equal whatever the rounding of their coordinates.
STEP = 1e-6


class _Scale(NamedTuple):
    """Over which way turns are measured: in target lengths, but at most a share of the curve."""

    lengths: float
    of_loop: float
    of_open: float
    from_end: float  # how far from the ends of a curve, in target lengths, its corners begin
    local_share: float
    window: float  # half of the way over which the curve is smoothed before, in target lengths


_FINE = _Scale(0.5, SHORT_SHARE, SHORT_SHARE, 0.0, LOCAL_SHARE, 0.0)
_FAR = _Scale(1.5, 3.0 * SHORT_SHARE, 0.5, 0.0, LOCAL_SHARE, 0.0)  # tells corners from zigzags
# Along zigzags: over a shorter way than this their steps still show, so nothing is local.
_COARSE = _Scale(2.0, SHORT_SHARE, 2.0 * SHORT_SHARE, 1.0, np.inf, 1.0)


class _Path(NamedTuple):
    """The vertices of one curve in their order; a loop ends with its first vertex."""

    vertex: IndexArray
    place: FloatArray  # (n, 3) of the vertices, or smoothed
    at: FloatArray  # arc length
    turn: FloatArray  # degrees where it is sharp, otherwise 0
    is_largest: BoolArray  # whether none within reach is larger


class _Room(NamedTuple):
    """To smooth a curve in."""

    sums: FloatArray  # (n, 3) integral of the places from the start to every vertex
    smoothed: FloatArray  # (n, 3)


def find_corners(
    X: FloatArray,
    origin: IndexArray,
    twin: IndexArray,
    curves: Curves,
    angle: float | str | None,
) -> BoolArray:
    """Find the corners of feature curves at the scale of the target length.

    A vertex with one, three or more feature edges is a corner. A vertex inside a curve is a corner if
    the curve turns by more than ``angle`` between the points half a target length behind and ahead,
    does not go on turning beyond them (unlike an arc of any radius), and turns more here than anywhere
    else within half a target length. A circle has no corners, a rectangle four. Where most such corners
    are the steps of zigzags finer than the target length, as along borders of voxel labels, the
    curves that have them are smoothed before, and measured over two target lengths.

    Parameters
    ----------
    X : (n, 4) float64
        The last column is the target length.
    origin, twin : (3 m,) int32
    curves : Curves
    angle : float, "auto" or None
        Smallest turn in degrees; 50 unless it is a number.

    Returns
    -------
    (n,) bool
    """
    is_end = (curves.degree != 0) & (curves.degree != 2)
    if not len(curves.edges):
        return is_end
    limit = CORNER_TURN if angle is None or isinstance(angle, str) else float(angle)
    surface = X, origin, twin
    is_corner = is_end.copy()
    found, passing = _mark_turns(surface, curves, limit + STEP, False, is_corner)
    if passing >= max(ZIGZAG_CORNERS, ZIGZAG_SHARE * found):
        is_corner = is_end
        _mark_turns(surface, curves, limit + STEP, True, is_corner)
    return is_corner


@kernel
def _mark_turns(surface, curves, limit, has_zigzags, is_corner):
    """Walk every curve once, in one direction, and mark where it turns sharply.

    Returns how many vertices turn sharply, and at how many of them the curve does not over a longer way.
    """
    X, origin, _ = surface
    edges = curves.edges
    total = total_passing = 0
    is_done = np.zeros(origin.size, np.bool_)
    size = edges.size + 1
    at, turn, is_largest = np.empty(size), np.empty(size), np.empty(size, np.bool_)
    path = _Path(np.empty(size, np.int32), np.empty((size, 3)), at, turn, is_largest)
    room = _Room(np.empty((size, 3)), np.empty((size, 3)))
    for loops in range(2):
        for first in range(edges.size):
            if is_done[edges[first]] or (not loops and curves.before[first] != NONE):
                continue
            n = _unroll(surface, curves, first, is_done, path)
            is_corner[path.vertex[0]] |= not loops
            is_corner[path.vertex[n]] |= not loops
            found, passing = _find_sharp(X, path, n, loops, limit, _FINE)
            total += found
            total_passing += passing
            if has_zigzags and passing > 0 and passing >= ZIGZAG_SHARE * found:
                _smooth(X, path, n, loops, _COARSE, room)
                _find_sharp(X, path, n, loops, limit, _COARSE)
            for i in range(n):
                is_corner[path.vertex[i]] |= path.is_largest[i]
    return total, total_passing


@inlined
def _find_sharp(X, path, n, is_loop, limit, scale):
    """Mark the largest of the sharp turns of a curve; returns as `_mark_turns`."""
    for i in range(n + 1):
        path.turn[i] = 0.0
        if 0 < i < n or (is_loop and i == 0):
            path.turn[i] = _sharp_turn(X, path, n, is_loop, i, limit, scale)
    _mark_largest(X, path, n, is_loop, scale)
    found = passing = 0
    for i in range(n):
        if path.is_largest[i]:
            far = _reach(X, path, n, is_loop, i, _FAR)
            found += 1
            passing += _turn(path, n, is_loop, i, far) <= limit
    return found, passing


@inlined
def _unroll(surface, curves, first, is_done, path):
    """List the vertices of a curve and their arc lengths; returns the number of its edges."""
    X, origin, twin = surface
    edges, vertex, place, at = curves.edges, path.vertex, path.place, path.at
    n = 0
    vertex[0] = origin[edges[first]]
    at[0] = 0.0
    place[0, 0], place[0, 1], place[0, 2] = point(X, vertex[0])
    i = np.int64(first)
    while i != NONE and not is_done[edges[i]]:
        h = edges[i]
        is_done[h] = True
        if twin[h] != NONE:
            is_done[twin[h]] = True
        n += 1
        vertex[n] = origin[next_halfedge(h)]
        place[n, 0], place[n, 1], place[n, 2] = point(X, vertex[n])
        at[n] = at[n - 1] + sqrt(distance_squared(place, n - 1, n))
        i = np.int64(curves.after[i])
    return n


@inlined
def _smooth(X, path, n, is_loop, scale, room):
    """Put every vertex to the mean of the curve around it; the ends of an open curve stay."""
    vertex, place, at, _, _ = path
    sums, smoothed = room
    total = at[n]
    sums[0, 0] = sums[0, 1] = sums[0, 2] = 0.0
    for i in range(1, n + 1):
        for k in range(3):
            sums[i, k] = sums[i - 1, k] + 0.5 * (place[i - 1, k] + place[i, k]) * (
                at[i] - at[i - 1]
            )
    for i in range(n + 1):
        half = min(scale.window * X[vertex[i], 3], 0.5 * scale.of_loop * total)
        if not is_loop:
            half = min(half, at[i], total - at[i])
        if half <= 0.0:
            smoothed[i, 0], smoothed[i, 1], smoothed[i, 2] = point(place, i)
            continue
        ahead = _integral(path, n, sums, is_loop, at[i] + half)
        behind = _integral(path, n, sums, is_loop, at[i] - half)
        for k in range(3):
            smoothed[i, k] = (ahead[k] - behind[k]) / (2.0 * half)
    for i in range(n + 1):
        place[i, 0], place[i, 1], place[i, 2] = point(smoothed, i)
    for i in range(1, n + 1):
        at[i] = at[i - 1] + sqrt(distance_squared(place, i - 1, i))


@inlined
def _integral(path, n, sums, is_loop, where):
    """Integral of the places along the curve up to an arc length; around a loop it goes on."""
    place, at = path.place, path.at
    turns = 0.0
    if is_loop:
        turns = (1.0 if where > at[n] else 0.0) - (1.0 if where < 0.0 else 0.0)
        where -= turns * at[n]
    low, share = _find_along(path, n, where)
    x, y, z = _between(place, low, share)
    way = 0.5 * share * (at[low + 1] - at[low])
    return (
        turns * sums[n, 0] + sums[low, 0] + way * (place[low, 0] + x),
        turns * sums[n, 1] + sums[low, 1] + way * (place[low, 1] + y),
        turns * sums[n, 2] + sums[low, 2] + way * (place[low, 2] + z),
    )


@inlined
def _reach(X, path, n, is_loop, i, scale):
    """Arc length over which the turn at a vertex is measured."""
    share = scale.of_loop if is_loop else scale.of_open
    return min(scale.lengths * X[path.vertex[i], 3], share * path.at[n])


@inlined
def _sharp_turn(X, path, n, is_loop, i, limit, scale):
    """Turn in degrees where it is sharp and local, otherwise 0."""
    from_end = min(path.at[i], path.at[n] - path.at[i])
    if not is_loop and from_end < scale.from_end * X[path.vertex[i], 3]:
        return 0.0
    reach = _reach(X, path, n, is_loop, i, scale)
    near = _turn(path, n, is_loop, i, reach)
    if near <= limit:
        return 0.0
    if near >= CORNER_SHARE * _turn(path, n, is_loop, i, 2.0 * reach):
        return near
    return near if _turn(path, n, is_loop, i, 0.5 * reach) >= scale.local_share * near else 0.0


@inlined
def _turn(path, n, is_loop, i, reach):
    """Angle in degrees between the chords from the point ``reach`` behind and to the one ahead.

    Near the end of an open curve the chord leads to its end.
    """
    place, at = path.place, path.at
    bx, by, bz = _point_along(path, n, is_loop, at[i] - reach)
    ax, ay, az = _point_along(path, n, is_loop, at[i] + reach)
    ax, ay, az = ax - place[i, 0], ay - place[i, 1], az - place[i, 2]
    bx, by, bz = place[i, 0] - bx, place[i, 1] - by, place[i, 2] - bz
    norm = sqrt((ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz))
    if norm == 0.0:
        return 0.0
    return degrees(acos(min(1.0, max(-1.0, (ax * bx + ay * by + az * bz) / norm))))


@inlined
def _point_along(path, n, is_loop, where):
    """Point of the curve at an arc length."""
    if is_loop:
        where += path.at[n] if where < 0.0 else 0.0
        where -= path.at[n] if where > path.at[n] else 0.0
    low, share = _find_along(path, n, where)
    return _between(path.place, low, share)


@inlined
def _find_along(path, n, where):
    """Find an arc length: the edge, by its number, and the share of it that lies before."""
    at = path.at
    where = min(max(where, 0.0), at[n])
    low, high = 0, n
    while high - low > 1:
        middle = (low + high) // 2
        if at[middle] <= where:
            low = middle
        else:
            high = middle
    step = at[high] - at[low]
    return low, (where - at[low]) / step if step > 0.0 else 0.0


@inlined
def _between(place, low, share):
    """Point on the edge after a vertex."""
    x, y, z = place[low, 0], place[low, 1], place[low, 2]
    return (
        x + share * (place[low + 1, 0] - x),
        y + share * (place[low + 1, 1] - y),
        z + share * (place[low + 1, 2] - z),
    )


@inlined
def _mark_largest(X, path, n, is_loop, scale):
    """Mark vertices with the largest turn within reach; of equal ones the smaller vertex."""
    vertex, _, at, turn, is_largest = path
    for i in range(n):
        is_largest[i] = turn[i] != 0.0
        if turn[i] == 0.0:
            continue
        # With the factor, corners that are one reach apart both stay.
        reach = _reach(X, path, n, is_loop, i, scale) * (1.0 - 1e-9)
        for side in (-1, 1):
            j = i
            for _ in range(n):
                j += side
                if is_loop:
                    j += n if j < 0 else 0
                    j -= n if j >= n else 0
                if j < 0 or j >= n or j == i:
                    break
                apart = abs(at[j] - at[i])
                if is_loop:
                    apart = min(apart, at[n] - apart)
                if apart >= reach:
                    break
                difference = np.rint(turn[j] / STEP) - np.rint(turn[i] / STEP)
                if difference > 0.0 or (difference == 0.0 and vertex[j] < vertex[i]):
                    is_largest[i] = False
