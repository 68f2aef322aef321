"""Does the turn across an edge repeat beside it? The walk that tells a facet from a crease."""

from __future__ import annotations

from math import cos, sqrt

import numpy as np

from ..core.compiler import inlined
from ..core.geometry import distance_squared
from ..core.vocabulary import NONE
from ..mesh.walk import next_halfedge, previous_halfedge
from .dihedral import face_cosine

__all__ = ["echo_cosines", "echoes_beside"]

# An echo turns by at least this share of our edge: with 0.6 a quarter more is kept on organic
# shapes, and a fillet of two segments has a crease in its middle. What turns by this multiple of it
# is the end of the face.
ECHO_SHARE = 0.4
MULTIPLE = 1.7

# An edge met at more than 45 degrees to ours belongs to another direction of curvature.
PARALLEL = 0.7

# A walk that turned by more than about 70 degrees in space is no longer beside its edge.
AWAY = 0.3

# A walk unfolds at most so many edges.
MAX_STEPS = 24


@inlined
def _edge(X, origin, h):
    """Vector along a half-edge, and its length."""
    a, b = origin[h], origin[next_halfedge(h)]
    x, y, z = X[b, 0] - X[a, 0], X[b, 1] - X[a, 1], X[b, 2] - X[a, 2]
    return x, y, z, sqrt(x * x + y * y + z * z)


@inlined
def _is_convex(normals, f, g, x, y, z):
    """Tell whether the surface bends away from its normals from face f on the left of an edge to g."""
    nx = normals[f, 1] * normals[g, 2] - normals[f, 2] * normals[g, 1]
    ny = normals[f, 2] * normals[g, 0] - normals[f, 0] * normals[g, 2]
    nz = normals[f, 0] * normals[g, 1] - normals[f, 1] * normals[g, 0]
    return nx * x + ny * y + nz * z > 0.0


@inlined
def _unfolded_apex(X, origin, h, x, y, z, length):
    """Third corner of the face of ``h``, from its origin: along the edge (x, y, z), and across."""
    a, c = origin[h], origin[previous_halfedge(h)]
    if length == 0.0:
        return 0.0, sqrt(distance_squared(X, a, c))
    wx, wy, wz = X[c, 0] - X[a, 0], X[c, 1] - X[a, 1], X[c, 2] - X[a, 2]
    nx, ny, nz = y * wz - z * wy, z * wx - x * wz, x * wy - y * wx
    along = wx * x + wy * y + wz * z
    return along / length, sqrt(nx * nx + ny * ny + nz * nz) / length


@inlined
def _across(normals, f, x, y, z):
    """Vector into a face, perpendicular to its edge (x, y, z) and as long."""
    nx, ny, nz = normals[f, 0], normals[f, 1], normals[f, 2]
    return ny * z - nz * y, nz * x - nx * z, nx * y - ny * x


@inlined
def _exit(x, y, length, at, u, w):
    """Leave the triangle (0, 0), (length, 0), (x, y) from (``at``, 0) along (u, w).

    Returns whether the ray meets the last side (from the apex to the origin), the distance, the
    parameter on that side in [0, 1] and the direction of it, both as the next triangle sees them.
    """
    is_last = w * (x - at) > u * y
    if is_last:
        below = x * w - u * y
        share = at * w / below if below > 0.0 else 0.0
        dx, dy = x, y
    else:
        below = u * y - (x - length) * w
        share = (length - at) * w / below if below > 0.0 else 0.0
        dx, dy = length - x, -y
    share = min(1.0, max(0.0, share))
    side = sqrt(dx * dx + dy * dy)
    distance = share * y / w
    if side > 0.0:
        dx, dy = dx / side, dy / side
    return is_last, distance, share if is_last else 1.0 - share, dx, dy


@inlined
def echo_cosines(turn):
    """Cosines between which an edge is an echo of one that turns by so many radians."""
    return cos(ECHO_SHARE * turn), cos(min(3.0, MULTIPLE * turn))


@inlined
def echoes_beside(X, origin, twin, normals, is_hard, h, reach, quiet, loud, enough):
    """Count how often the turn across ``h`` comes again, straight into its face, up to ``enough``.

    The walk runs over unfolded faces from the middle of the edge, perpendicular to it, for a length
    of ``reach``. The first edge that is nearly parallel and turns by a comparable angle, with a cosine
    between ``loud`` and ``quiet``, decides: it is an echo if it turns to the same side. From there the
    walk goes on for a second one.

    Returns
    -------
    echoes : int
    is_cut_short : bool
        Whether the walk ended where the face does, so that there might be more of them.
    """
    ex, ey, ez, length = _edge(X, origin, h)
    f = h // 3
    convex = _is_convex(normals, f, twin[h] // 3, ex, ey, ez)
    x0, y0, z0 = _across(normals, f, ex, ey, ez)
    away = AWAY * length
    echoes = 0
    left = reach
    g = h
    share, u, w = 0.5, 0.0, 1.0
    for _ in range(MAX_STEPS):
        x, y = _unfolded_apex(X, origin, g, ex, ey, ez, length)
        is_last, distance, share, dx, dy = _exit(x, y, length, share * length, u, w)
        left -= distance
        if left < 0.0:
            return echoes, False
        g = previous_halfedge(g) if is_last else next_halfedge(g)
        t = np.int64(twin[g])
        if t == NONE or is_hard[g]:
            return echoes, True
        u, w = u * dx + w * dy, max(abs(u * dy - w * dx), 1e-9)
        before, f = f, t // 3
        ex, ey, ez, length = _edge(X, origin, t)
        cosine = face_cosine(normals, before, f)
        if cosine <= quiet and w >= PARALLEL:
            if cosine <= loud:
                return echoes, True
            if _is_convex(normals, before, f, -ex, -ey, -ez) != convex:
                return echoes, False
            echoes += 1
            left = reach
            if echoes == enough:
                return echoes, False
        g = t
        if echoes == 0:
            xa, ya, za = _across(normals, f, ex, ey, ez)
            along = u * (ex * x0 + ey * y0 + ez * z0) + w * (xa * x0 + ya * y0 + za * z0)
            if not along >= away * length:
                return echoes, False
    return echoes, False
