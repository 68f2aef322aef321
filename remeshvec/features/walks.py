"""Straight walks over unfolded faces, away from an edge."""

from __future__ import annotations

from math import sqrt

from ..core.compiler import inlined
from ..core.geometry import distance_squared
from ..mesh.walk import next_halfedge, previous_halfedge

__all__ = ["PARALLEL", "across", "cross_face", "edge_vector", "is_convex"]

# An edge met at more than 45 degrees to ours belongs to another direction of curvature.
PARALLEL = 0.7


@inlined
def edge_vector(X, origin, h):
    """Vector along a half-edge, and its length."""
    a, b = origin[h], origin[next_halfedge(h)]
    x, y, z = X[b, 0] - X[a, 0], X[b, 1] - X[a, 1], X[b, 2] - X[a, 2]
    return x, y, z, sqrt(x * x + y * y + z * z)


@inlined
def is_convex(normals, f, g, x, y, z):
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
def across(normals, f, x, y, z):
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
def cross_face(ground, h, vector, share, u, w):
    """Cross the face of a half-edge straight on.

    Parameters
    ----------
    ground : Ground
    h : int
        The half-edge by which the walk enters.
    vector : x, y, z, length
        See `edge_vector`.
    share : float
        Where on it the walk enters.
    u, w : float
        Direction, along the half-edge and into its face.

    Returns
    -------
    h : int
        The half-edge by which the walk leaves; it enters the next face by its twin.
    distance : float
        Length of the way over the face.
    share, u, w : float
        As above, for the twin.
    """
    ex, ey, ez, length = vector
    x, y = _unfolded_apex(ground.X, ground.origin, h, ex, ey, ez, length)
    is_last, distance, share, dx, dy = _exit(x, y, length, share * length, u, w)
    h = previous_halfedge(h) if is_last else next_halfedge(h)
    return h, distance, share, u * dx + w * dy, max(abs(u * dy - w * dx), 1e-9)
