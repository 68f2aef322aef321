"""The one-rings of both ends of an edge, as the guards of a collapse read them.

A collapse moves the ends a and b of an edge to one place. A place is a row of ``Mesh.X`` as a tuple:
x, y, z, and the target length there.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from ..core.compiler import inlined
from ..core.geometry import SHARP
from ..core.vocabulary import INNER, NONE, FloatArray, IntArray
from ..mesh.blocks import owns
from ..mesh.walk import apex_of, end_of, next_spoke
from .outcomes import COLLAPSED, KEPT_LINK, KEPT_OVERSHOOT, NOT_OWNED

__all__ = [
    "RING_CAPACITY",
    "Rings",
    "is_too_far",
    "make_rings",
    "measure_normals",
    "place_of",
    "survey_rings",
]

# Edges at hubs with more spokes stay; collapses along the rim bring the valence down first.
RING_CAPACITY = 128


class Rings(NamedTuple):
    """Scratch: the closed one-rings of both ends of an edge, a in row 0 and b in row 1."""

    face: IntArray  # (2, k) outgoing half-edges of the end
    vertex: IntArray  # (2, k) ring vertices; one more than faces around a boundary vertex
    place: FloatArray  # (2, k, 4) rows of ``Mesh.X`` of the ring vertices
    normal: FloatArray  # (2, k, 4) area vectors of the faces and their lengths
    size: IntArray  # (2, 2) number of faces, number of ring vertices


def make_rings() -> Rings:
    """Allocate the scratch arrays."""
    return Rings(
        np.empty((2, RING_CAPACITY), np.int64),
        np.empty((2, RING_CAPACITY), np.int64),
        np.empty((2, RING_CAPACITY, 4)),
        np.empty((2, RING_CAPACITY, 4)),
        np.empty((2, 2), np.int64),
    )


@inlined
def place_of(X, v):
    """Return a row of ``X`` as a tuple."""
    return X[v, 0], X[v, 1], X[v, 2], X[v, 3]


@inlined
def survey_rings(mesh, a, b, place, owned, half_factor, slack, rings):
    """List outgoing half-edges and ring vertices of both ends, with their places.

    Returns an outcome other than ``COLLAPSED`` if the block does not own a ring vertex, if there are too
    many, or if an edge from ``place`` to a ring vertex would be too long, see `is_too_far`; edges to
    inner vertices may be longer by ``slack``. Only faces at the ends are read, which no other block can
    change.
    """
    for side in range(2):
        v, other = (b, a) if side else (a, b)
        start = mesh.vertex_halfedge[v]
        h = start
        i = 0
        while True:
            at_end = h == NONE
            if at_end:  # the last vertex around a boundary vertex starts no face at it
                w = apex_of(mesh.origin, rings.face[side, i - 1])
            else:
                rings.face[side, i] = h
                w = end_of(mesh.origin, h)
            if not owns(owned, w):
                return NOT_OWNED
            there = place_of(mesh.X, w)
            factor = slack if slack != 1.0 and mesh.kind[w] == INNER else 1.0
            if w != other and is_too_far(place, there, half_factor, factor):
                return KEPT_OVERSHOOT
            rings.vertex[side, i] = w
            rings.place[side, i, 0], rings.place[side, i, 1] = there[0], there[1]
            rings.place[side, i, 2], rings.place[side, i, 3] = there[2], there[3]
            i += 1
            if at_end:
                break
            h = next_spoke(mesh.twin, h)
            if h == start:
                break
            if i == RING_CAPACITY - 1:
                return KEPT_LINK
        rings.size[side, 0] = i - 1 if at_end else i
        rings.size[side, 1] = i
    return COLLAPSED


@inlined
def is_too_far(place, there, half_factor, slack):
    """Tell whether an edge between two places would be longer than a factor of the mean length there."""
    dx, dy, dz = there[0] - place[0], there[1] - place[1], there[2] - place[2]
    limit = half_factor * (place[3] + there[3]) * slack
    return dx * dx + dy * dy + dz * dz > limit * limit


@inlined
def measure_normals(mesh, a, b, rings):
    """Fill in the area vectors around both ends and their lengths; tells which ends are sharp.

    At a sharp end the normals cancel, as on the rim of a sheet.
    """
    is_sharp_a = is_sharp_b = False
    for side in range(2):  # one call, which the compiler inlines once
        is_sharp = _measure_ring(mesh.X, b if side else a, side, rings)
        is_sharp_a, is_sharp_b = is_sharp_b, is_sharp
    return is_sharp_a, is_sharp_b


@inlined
def _measure_ring(X, v, side, rings):
    """Fill in the normals around one end; tells whether it is sharp."""
    place = rings.place
    x, y, z = X[v, 0], X[v, 1], X[v, 2]
    sx = sy = sz = total = 0.0
    ux, uy, uz = place[side, 0, 0] - x, place[side, 0, 1] - y, place[side, 0, 2] - z
    for i in range(rings.size[side, 0]):
        j = i + 1 if i + 1 < rings.size[side, 1] else 0
        wx, wy, wz = place[side, j, 0] - x, place[side, j, 1] - y, place[side, j, 2] - z
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        length = sqrt(nx * nx + ny * ny + nz * nz)
        rings.normal[side, i, 0], rings.normal[side, i, 1] = nx, ny
        rings.normal[side, i, 2], rings.normal[side, i, 3] = nz, length
        sx += nx
        sy += ny
        sz += nz
        total += length
        ux, uy, uz = wx, wy, wz
    return sx * sx + sy * sy + sz * sz < SHARP * SHARP * total * total
