"""Features of the input that the sweeps must keep: corners of the boundary, and apexes."""

from __future__ import annotations

import numpy as np

from ._jit import inlined, kernel
from ._types import INNER, NONE, IndexArray, Mesh
from .geometry import corner_angles
from .halfedge import following

__all__ = ["apexes", "boundary_corners"]

# A corner turns by more than this, measured over half a target length on both sides.
CORNER_TURN = 50.0

# On an arc of any radius the turn over L / 2 is half of that over L; at a corner they are the same.
CORNER_SHARE = 0.7

# An inner vertex with a larger angle defect is the tip of a horn or a cone. At 90 degrees, 4 in a
# thousand vertices of a badly triangulated scan are held; at 120, 2.
APEX_DEFECT = 120.0


def apexes(mesh: Mesh, length: float) -> IndexArray:
    """Find inner vertices with an angle defect above 120 degrees, no two closer than ``length``.

    Of two that are closer the larger defect wins, of equals the smaller index. Without them, tips
    thinner than ``length`` lose about as much of their length.

    Returns
    -------
    (k,) int32
        Vertices.
    """
    defect = np.full(len(mesh.X), 2.0 * np.pi)
    _subtract_angles(mesh.X, mesh.origin, defect)
    found = np.flatnonzero((defect > np.radians(APEX_DEFECT)) & (mesh.kind == INNER))
    found = found[np.argsort(-defect[found], kind="stable")]
    kept = np.empty(len(found), np.int32)
    return kept[: _keep_apart(mesh.X, found, length * length, kept)]


@kernel
def _subtract_angles(X, origin, defect):
    for f in range(origin.size // 3):
        a, b, c = origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]
        angle_a, angle_b, angle_c = corner_angles(X, a, b, c)
        defect[a] -= angle_a
        defect[b] -= angle_b
        defect[c] -= angle_c


@kernel
def _keep_apart(X, found, distance_squared, kept):
    count = 0
    for v in found:
        is_free = True
        for i in range(count):
            u = kept[i]
            d = (X[u, 0] - X[v, 0]) ** 2 + (X[u, 1] - X[v, 1]) ** 2 + (X[u, 2] - X[v, 2]) ** 2
            if d < distance_squared:
                is_free = False
                break
        if is_free:
            kept[count] = v
            count += 1
    return count


def boundary_corners(mesh: Mesh, links: IndexArray, length: float) -> IndexArray:
    """Find the corners of the boundary at the scale of ``length``.

    A corner turns by more than 50 degrees between the points half a length behind and ahead, does
    not go on turning beyond (which tells it from an arc of any radius), and turns most within half
    a length. A circle has none, a rectangle four.

    Returns
    -------
    (k,) int32
        Vertices.
    """
    if links.shape[1] == 0:
        return np.empty(0, np.int32)
    turn = np.zeros(mesh.origin.size)
    half = np.zeros(mesh.origin.size)
    _measure_turns(mesh.X, mesh.origin, links, length, turn, half)
    is_corner = np.zeros(mesh.origin.size, np.bool_)
    _pick_corners(mesh.X, mesh.origin, links, half, turn, is_corner)
    return mesh.origin[is_corner]


@inlined
def _edge_length(X, origin, h):
    a = origin[h]
    b = origin[following(h)]
    return np.sqrt((X[a, 0] - X[b, 0]) ** 2 + (X[a, 1] - X[b, 1]) ** 2 + (X[a, 2] - X[b, 2]) ** 2)


@inlined
def _point_along(X, origin, links, h, side, distance):
    """Point of the loop at an arc length ahead (side 0) or behind (side 1) the origin of ``h``."""
    if side == 1:
        h = np.int64(links[1, h])
    for _ in range(links.shape[1]):
        step = _edge_length(X, origin, h)
        if step >= distance:
            break
        distance -= step
        h = np.int64(links[side, h])
    share = distance / step if step > distance else 1.0
    if side == 1:
        share = 1.0 - share
    a = origin[h]
    b = origin[following(h)]
    return (
        X[a, 0] + share * (X[b, 0] - X[a, 0]),
        X[a, 1] + share * (X[b, 1] - X[a, 1]),
        X[a, 2] + share * (X[b, 2] - X[a, 2]),
    )


@inlined
def _turn(X, origin, links, h, distance):
    """Angle in degrees between the chords to the points a distance behind and ahead."""
    v = origin[h]
    ax, ay, az = _point_along(X, origin, links, h, 0, distance)
    bx, by, bz = _point_along(X, origin, links, h, 1, distance)
    ax, ay, az = ax - X[v, 0], ay - X[v, 1], az - X[v, 2]
    bx, by, bz = X[v, 0] - bx, X[v, 1] - by, X[v, 2] - bz
    norm = np.sqrt((ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz))
    if norm == 0.0:
        return 0.0
    cosine = (ax * bx + ay * by + az * bz) / norm
    return np.degrees(np.arccos(min(1.0, max(-1.0, cosine))))


@kernel
def _measure_turns(X, origin, links, length, turn, half):
    """Turn at every corner candidate, 0 elsewhere; short loops are measured at an eighth of them."""
    for first in range(links.shape[1]):
        if links[0, first] == NONE or turn[first] != 0.0:
            continue
        total = 0.0
        h = np.int64(first)
        while True:
            total += _edge_length(X, origin, h)
            h = np.int64(links[0, h])
            if h == first:
                break
        reach = min(0.5 * length, 0.125 * total)
        while True:
            half[h] = reach
            near = _turn(X, origin, links, h, reach)
            is_candidate = near > CORNER_TURN and near >= CORNER_SHARE * _turn(
                X, origin, links, h, 2.0 * reach
            )
            # Below 0: measured, and no candidate.
            turn[h] = near if is_candidate else -1.0
            h = np.int64(links[0, h])
            if h == first:
                break


@kernel
def _pick_corners(X, origin, links, half, turn, is_corner):
    """Keep the candidate that turns most within its reach; of equals the first half-edge."""
    for h in range(links.shape[1]):
        if links[0, h] == NONE or turn[h] <= 0.0:
            continue
        is_corner[h] = True
        for side in range(2):
            walked = 0.0
            g = np.int64(h)
            for _ in range(links.shape[1]):
                walked += _edge_length(X, origin, g if side == 0 else np.int64(links[1, g]))
                g = np.int64(links[side, g])
                # 1e-9: a square with the same turn at all corners keeps them all.
                if walked >= half[h] * (1.0 - 1e-9) or g == h:
                    break
                if turn[g] > turn[h] or (turn[g] == turn[h] and g < h):
                    is_corner[h] = False
