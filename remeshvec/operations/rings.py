"""The one-rings of both ends of an edge, as a collapse looks at them, and what may become of it."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined
from ..core.geometry import SHARP
from ..core.vocabulary import INNER, NONE, FloatArray
from ..mesh.walk import next_halfedge, previous_halfedge
from .outcomes import COLLAPSED, KEPT_LINK, KEPT_OVERSHOOT, NOT_OWNED

__all__ = [
    "RING_CAPACITY",
    "Rings",
    "make_rings",
    "measure_normals",
    "survey_rings",
]

# Edges at hubs with more spokes stay; collapses along the rim bring the valence down first.
RING_CAPACITY = 128


class Rings(NamedTuple):
    """Scratch: the closed one-rings of both ends of an edge, one row each."""

    face: NDArray[np.int64]  # (2, k) outgoing half-edges of the end
    vertex: NDArray[np.int64]  # (2, k) ring vertices; one more than faces around a boundary vertex
    point: FloatArray  # (2, k, 4) their coordinates and target lengths
    normal: FloatArray  # (2, k, 4) area vectors of the faces and their lengths
    size: NDArray[np.int64]  # (2, 2) faces, and ring vertices


def make_rings() -> Rings:
    """Allocate."""
    return Rings(
        np.empty((2, RING_CAPACITY), np.int64),
        np.empty((2, RING_CAPACITY), np.int64),
        np.empty((2, RING_CAPACITY, 4)),
        np.empty((2, RING_CAPACITY, 4)),
        np.empty((2, 2), np.int64),
    )


@inlined
def survey_rings(mesh, a, b, x, y, z, s, low, high, half_factor, slack, rings):
    """List outgoing half-edges and ring vertices of both ends, with their coordinates.

    Returns an outcome other than ``COLLAPSED`` where a ring vertex lies outside the range, where there
    are too many, or where an edge from (x, y, z) to a ring would be too long for the length ``s`` there
    (edges to inner vertices may be longer by ``slack``). Only faces at the ends are read, which no other
    block can change.
    """
    X = mesh.X
    for side in range(2):
        v, other = (b, a) if side else (a, b)
        start = np.int64(mesh.vertex_halfedge[v])
        h = start
        i = 0
        while True:
            at_end = h == NONE
            if at_end:  # the last vertex around a boundary vertex starts no face at it
                w = np.int64(mesh.origin[previous_halfedge(rings.face[side, i - 1])])
            else:
                rings.face[side, i] = h
                w = np.int64(mesh.origin[next_halfedge(h)])
            if w < low or w >= high:
                return NOT_OWNED
            px, py, pz, length = X[w, 0], X[w, 1], X[w, 2], X[w, 3]
            dx, dy, dz = px - x, py - y, pz - z
            limit = half_factor * (s + length)
            if slack != 1.0 and mesh.kind[w] == INNER:
                limit *= slack
            if w != other and dx * dx + dy * dy + dz * dz > limit * limit:
                return KEPT_OVERSHOOT
            rings.vertex[side, i] = w
            rings.point[side, i, 0], rings.point[side, i, 1] = px, py
            rings.point[side, i, 2], rings.point[side, i, 3] = pz, length
            i += 1
            if at_end:
                break
            h = np.int64(mesh.twin[previous_halfedge(h)])
            if h == start:
                break
            if i == RING_CAPACITY - 1:
                return KEPT_LINK
        rings.size[side, 0] = i - 1 if at_end else i
        rings.size[side, 1] = i
    return COLLAPSED


@inlined
def measure_normals(mesh, a, b, rings):
    """Area vectors of the faces around both ends and their lengths; tells which ends are sharp.

    Sharp: the normals cancel, as on the rim of a sheet.
    """
    point = rings.point
    is_sharp_a = is_sharp = False
    for side in range(2):
        is_sharp_a = is_sharp
        v = b if side else a
        x, y, z = mesh.X[v, 0], mesh.X[v, 1], mesh.X[v, 2]
        sx = sy = sz = total = 0.0
        ux, uy, uz = point[side, 0, 0] - x, point[side, 0, 1] - y, point[side, 0, 2] - z
        for i in range(rings.size[side, 0]):
            j = i + 1 if i + 1 < rings.size[side, 1] else 0
            wx, wy, wz = point[side, j, 0] - x, point[side, j, 1] - y, point[side, j, 2] - z
            nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
            length = sqrt(nx * nx + ny * ny + nz * nz)
            rings.normal[side, i, 0], rings.normal[side, i, 1] = nx, ny
            rings.normal[side, i, 2], rings.normal[side, i, 3] = nz, length
            sx += nx
            sy += ny
            sz += nz
            total += length
            ux, uy, uz = wx, wy, wz
        is_sharp = sx * sx + sy * sy + sz * sz < SHARP * SHARP * total * total
    return is_sharp_a, is_sharp
