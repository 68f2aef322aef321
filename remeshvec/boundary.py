"""Boundary of the reference surface: its loops as linked half-edges, and their corners."""

from __future__ import annotations

import numpy as np

from ._jit import inlined, kernel
from ._types import NONE, IndexArray, Mesh
from .geometry import closest_on_segment
from .halfedge import following

__all__ = ["boundary_corners", "closest_on_boundary", "link_boundary"]

# A corner turns by more than this, measured over half a target length on both sides.
CORNER_TURN = 50.0

# On an arc of any radius the turn over L / 2 is half of that over L; at a corner they are the same.
CORNER_SHARE = 0.7


def link_boundary(mesh: Mesh) -> IndexArray:
    """Link boundary half-edges to loops.

    Returns
    -------
    links : (2, 3 m) int32, or (2, 0) for a closed mesh
        Following and preceding boundary half-edge of the same loop; -1 at inner half-edges.
    """
    if not (mesh.twin == NONE).any():
        return np.empty((2, 0), np.int32)
    links = np.full((2, mesh.origin.size), NONE, np.int32)
    _link(mesh.origin, mesh.twin, mesh.vertex_halfedge, links)
    return links


@kernel
def _link(origin, twin, vertex_halfedge, links):
    for h in range(origin.size):
        if twin[h] == NONE:
            after = vertex_halfedge[origin[following(np.int64(h))]]
            links[0, h] = after
            links[1, after] = h


@inlined
def closest_on_boundary(X, origin, links, start, x, y, z):
    """Closest point of a boundary loop near half-edge ``start``: half-edge, parameter, distance squared.

    Searched are the half-edges within three times the distance to ``start`` along the loop, on both
    sides: a vertex stays on its own stretch where another comes close.
    """
    a = origin[start]
    b = origin[following(start)]
    best = start
    s, distance = closest_on_segment(x, y, z, X[a, 0], X[a, 1], X[a, 2], X[b, 0], X[b, 1], X[b, 2])
    reach = 3.0 * np.sqrt(distance)
    for side in range(2):
        h = np.int64(links[side, start])
        walked = 0.0
        for _ in range(links.shape[1]):
            if walked > reach or h == start:
                break
            a = origin[h]
            b = origin[following(h)]
            r, d = closest_on_segment(x, y, z, X[a, 0], X[a, 1], X[a, 2], X[b, 0], X[b, 1], X[b, 2])
            if d < distance:
                best, s, distance = h, r, d
            walked += np.sqrt(
                (X[a, 0] - X[b, 0]) ** 2 + (X[a, 1] - X[b, 1]) ** 2 + (X[a, 2] - X[b, 2]) ** 2
            )
            h = np.int64(links[side, h])
    return best, s, distance


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
    _measure_turns(mesh.X, mesh.origin, links, length, turn)
    is_corner = np.zeros(mesh.origin.size, np.bool_)
    _pick_corners(mesh.X, mesh.origin, links, length, turn, is_corner)
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
def _measure_turns(X, origin, links, length, turn):
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
        half = min(0.5 * length, 0.125 * total)
        while True:
            near = _turn(X, origin, links, h, half)
            is_candidate = near > CORNER_TURN and near >= CORNER_SHARE * _turn(
                X, origin, links, h, 2.0 * half
            )
            # Below 0: measured, and no candidate.
            turn[h] = near if is_candidate else -1.0
            h = np.int64(links[0, h])
            if h == first:
                break


@kernel
def _pick_corners(X, origin, links, length, turn, is_corner):
    """Keep the candidate that turns most within half a length; of equals the first half-edge."""
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
                if walked >= 0.5 * length * (1.0 - 1e-9) or g == h:
                    break
                if turn[g] > turn[h] or (turn[g] == turn[h] and g < h):
                    is_corner[h] = False
