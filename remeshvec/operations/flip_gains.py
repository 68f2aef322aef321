"""What an edge gains from a flip: valences nearer to the ideal, or opposite angles as Delaunay asks."""

from __future__ import annotations

from math import sqrt

from ..core.compiler import inlined
from ..core.geometry import area_vector
from ..mesh.walk import apex_of, end_of

__all__ = ["dot_opposite", "is_good_trade", "quad_of", "valence_gain", "violates_delaunay"]


@inlined
def quad_of(mesh, h, t):
    """Return the vertices of the quad around an edge: its ends a and b, the apexes c and d."""
    origin = mesh.origin
    return origin[h], origin[t], apex_of(origin, h), apex_of(origin, t)


@inlined
def valence_gain(mesh, h, t):
    """Fall of the summed distance from the ideal valences; negative if an end has too few edges."""
    a, b, c, d = quad_of(mesh, h, t)
    excess = mesh.valence_excess
    ea, eb, ec, ed = excess[a], excess[b], excess[c], excess[d]
    # Each of the four comes one nearer to its ideal, or goes one farther away.
    gain = 2 * (ea > 0) + 2 * (eb > 0) + 2 * (ec < 0) + 2 * (ed < 0) - 4
    return -1 if min(ea, eb) <= -3 else gain


@inlined
def violates_delaunay(mesh, h, t):
    """Tell whether the angles opposite the edge sum to more than pi (cotangents below 0)."""
    dot_c = dot_opposite(mesh, h)
    dot_d = dot_opposite(mesh, t)
    if dot_c >= 0.0 and dot_d >= 0.0:  # both acute, as almost always
        return False
    return _cotangent(mesh, h, dot_c) + _cotangent(mesh, t, dot_d) < -1e-9


@inlined
def is_good_trade(mesh, h, t, gain, trade):
    """Tell whether the angles opposite the edge exceed pi by more than the loss of valence costs.

    Each step of two in valence is worth the angle with the tangent ``trade``. A flip that is a good
    trade is a bad one backwards: both the gain and, nearly, the excess change their sign.
    """
    dot_c, dot_d = dot_opposite(mesh, h), dot_opposite(mesh, t)
    if dot_c >= 0.0 and dot_d >= 0.0 and gain <= 0:
        return False
    norm_c, norm_d = norm_opposite(mesh, h), norm_opposite(mesh, t)
    # Sine and cosine of the excess, times the same positive number.
    sine = -(norm_c * dot_d + dot_c * norm_d)
    cosine = norm_c * norm_d - dot_c * dot_d
    least = -0.5 * gain * trade  # tangent; of twice the angle by the formula for sums
    if abs(gain) == 4:
        least /= 1.0 - trade * trade
    if cosine > 0.0:
        sine -= least * cosine
    return sine > 1e-9 * (norm_c * norm_d + abs(dot_c * dot_d))


@inlined
def norm_opposite(mesh, h):
    """Length of the vector product of the two edges that meet opposite a half-edge."""
    a, b, c = mesh.origin[h], end_of(mesh.origin, h), apex_of(mesh.origin, h)
    nx, ny, nz = area_vector(mesh.X, a, b, c)
    return sqrt(nx * nx + ny * ny + nz * nz)


@inlined
def dot_opposite(mesh, h):
    """Scalar product of the two edges that meet opposite a half-edge."""
    X = mesh.X
    a, b, c = mesh.origin[h], end_of(mesh.origin, h), apex_of(mesh.origin, h)
    return (
        (X[a, 0] - X[c, 0]) * (X[b, 0] - X[c, 0])
        + (X[a, 1] - X[c, 1]) * (X[b, 1] - X[c, 1])
        + (X[a, 2] - X[c, 2]) * (X[b, 2] - X[c, 2])
    )


@inlined
def _cotangent(mesh, h, dot):
    """Cotangent of the angle opposite a half-edge; far below zero for a face without area."""
    norm = norm_opposite(mesh, h)
    if norm == 0.0:
        return 0.0 if dot == 0.0 else (1e30 if dot > 0.0 else -1e30)
    return dot / norm
