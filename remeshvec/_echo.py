"""Does the turn across an edge repeat beside it? The walk that tells a facet from a crease."""

from __future__ import annotations

from math import acos, cos, sqrt

import numpy as np

from ._jit import inlined
from ._types import NONE
from .geometry import distance_squared, face_vector
from .halfedge import following, previous

__all__ = ["echoes_beside", "face_cosine"]

# An echo turns by at least this share of our edge: with 0.6 a quarter more is kept on organic
# shapes, and a fillet of two segments has a crease in its middle. What turns by this multiple of it
# is the end of the face.
SHARE = 0.4
MULTIPLE = 1.7

# An edge met at more than 45 degrees to ours belongs to another direction of curvature.
PARALLEL = 0.7

# A walk that turned by more than about 70 degrees in space is no longer beside its edge.
AWAY = 0.3

# A walk unfolds at most so many edges.
MAX_STEPS = 24


@inlined
def face_cosine(normals, f, g):
    """Cosine of the angle between two faces."""
    return (
        normals[f, 0] * normals[g, 0]
        + normals[f, 1] * normals[g, 1]
        + normals[f, 2] * normals[g, 2]
    )


@inlined
def _is_convex(X, origin, normals, h, t):
    """Tell whether the surface bends away from its normals across the edge of ``h`` and its twin."""
    a, b = origin[h], origin[following(h)]
    f, g = h // 3, t // 3
    x = normals[f, 1] * normals[g, 2] - normals[f, 2] * normals[g, 1]
    y = normals[f, 2] * normals[g, 0] - normals[f, 0] * normals[g, 2]
    z = normals[f, 0] * normals[g, 1] - normals[f, 1] * normals[g, 0]
    return x * (X[b, 0] - X[a, 0]) + y * (X[b, 1] - X[a, 1]) + z * (X[b, 2] - X[a, 2]) > 0.0


@inlined
def _unfolded_apex(X, origin, h):
    """Third corner of the face of ``h``, from its origin: along the edge, and across; the length too."""
    a, b, c = origin[h], origin[following(h)], origin[previous(h)]
    squared = distance_squared(X, a, b)
    if squared == 0.0:
        return 0.0, sqrt(distance_squared(X, a, c)), 0.0
    length = sqrt(squared)
    along = 0.0
    for i in range(3):
        along += (X[c, i] - X[a, i]) * (X[b, i] - X[a, i])
    nx, ny, nz = face_vector(
        X[a, 0], X[a, 1], X[a, 2], X[b, 0], X[b, 1], X[b, 2], X[c, 0], X[c, 1], X[c, 2]
    )
    return along / length, sqrt(nx * nx + ny * ny + nz * nz) / length, length


@inlined
def _direction(X, origin, normals, h, u, w):
    """Vector in space that goes ``u`` along half-edge ``h`` and ``w`` into its face."""
    a, b = origin[h], origin[following(h)]
    f = h // 3
    x, y, z = X[b, 0] - X[a, 0], X[b, 1] - X[a, 1], X[b, 2] - X[a, 2]
    length = sqrt(x * x + y * y + z * z)
    if length > 0.0:
        x, y, z = x / length, y / length, z / length
    nx, ny, nz = normals[f, 0], normals[f, 1], normals[f, 2]
    return (
        u * x + w * (ny * z - nz * y),
        u * y + w * (nz * x - nx * z),
        u * z + w * (nx * y - ny * x),
    )


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
def echoes_beside(X, origin, twin, normals, is_hard, h, reach):
    """Count how often the turn across ``h`` comes again, straight into its face.

    The walk runs over unfolded faces from the middle of the edge, perpendicular to it, for a length
    of ``reach``. The first edge that is nearly parallel and turns by a comparable angle decides: it
    is an echo if it turns to the same side. From there the walk goes on for a second one.

    Returns
    -------
    echoes : int
        0, 1 or 2.
    is_cut_short : bool
        Whether the walk ended where the face does, so that there might be more of them.
    """
    turn = acos(min(1.0, max(-1.0, face_cosine(normals, h // 3, twin[h] // 3))))
    quiet = cos(SHARE * turn)
    loud = cos(min(3.0, MULTIPLE * turn))
    convex = _is_convex(X, origin, normals, h, twin[h])
    x0, y0, z0 = _direction(X, origin, normals, h, 0.0, 1.0)
    echoes = 0
    left = reach
    g = h
    share, u, w = 0.5, 0.0, 1.0
    for _ in range(MAX_STEPS):
        x, y, length = _unfolded_apex(X, origin, g)
        is_last, distance, share, dx, dy = _exit(x, y, length, share * length, u, w)
        left -= distance
        if left < 0.0:
            return echoes, False
        g = previous(g) if is_last else following(g)
        t = np.int64(twin[g])
        if t == NONE or is_hard[g]:
            return echoes, True
        u, w = u * dx + w * dy, max(abs(u * dy - w * dx), 1e-9)
        cosine = face_cosine(normals, g // 3, t // 3)
        if cosine <= quiet and w >= PARALLEL:
            if cosine <= loud:
                return echoes, True
            if _is_convex(X, origin, normals, g, t) != convex:
                return echoes, False
            echoes += 1
            left = reach
            if echoes == 2:
                return echoes, False
        g = t
        if echoes == 0:
            xd, yd, zd = _direction(X, origin, normals, g, u, w)
            if xd * x0 + yd * y0 + zd * z0 < AWAY:
                return echoes, False
    return echoes, False
