"""Boundary of the reference surface: its loops as linked half-edges, and the closest point of one."""

from __future__ import annotations

import numpy as np

from ._jit import inlined, kernel
from ._types import NONE, IndexArray, Mesh
from .geometry import closest_on_segment
from .halfedge import following

__all__ = ["closest_on_boundary", "link_boundary"]


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
