"""A triangulation of a loop in space that bends little: dynamic programming over its chords."""

from __future__ import annotations

import numpy as np

from ..core.compiler import inlined, kernel
from ..core.vocabulary import BoolArray, FloatArray, IntArray

__all__ = ["triangulate"]

# Bends whose cosines differ by less count as the same: else rounding would decide on flat holes, and tiny
# gains in the bend would be paid with needles.
_SAME_BEND = 1e-2

_NO_BEND = -1.0
_FLAT = 1.5  # of a face without area: worse than a fold, which is 1
_IMPOSSIBLE = 2.0

# A face without area: its area is this much smaller than its squared edges.
_NO_AREA = 1e-9


def triangulate(P: FloatArray, outer: FloatArray, taken: BoolArray) -> IntArray | None:
    """Close a loop of points by faces between them [Barequet and Sharir 1995; Liepa 2003, section 3].

    The sharpest bend, between two new faces or a new one and one beside the loop, is to be as small as
    possible, and among equals the sum of squared edge lengths. (Areas, which the source takes, are all
    the same in a plane, where many holes lie.) Every chord remembers one way to close what it cuts off,
    so the best may be missed by a little.

    Parameters
    ----------
    P : (n, 3) float64
        Points in the direction in which the faces beside the loop run it.
    outer : (n, 3) float64
        Unit normals of the faces beside the edges from each point to the next; 0 where nothing is known.
    taken : (n, n) bool
        Chords that must not become edges.

    Returns
    -------
    (n - 2, 3) int64 or None
        Faces, as indices of points; None if the chords that are taken leave no way.
    """
    n = len(P)
    apex = np.full((n, n), -1, np.int64)
    if not _choose_apexes(P, outer, taken, apex):
        return None
    faces, open_chords = [], [(0, n - 1)]
    while open_chords:
        i, j = open_chords.pop()
        m = int(apex[i, j])
        if m >= 0:
            faces.append((j, m, i))
            open_chords += [(i, m), (m, j)]
    return np.array(faces, np.int64).reshape(-1, 3)


@kernel
def _choose_apexes(P, outer, taken, apex):
    """Find the best apex over every chord, short chords first; tells whether the last one has one."""
    n = len(P)
    bend = np.full((n, n), _IMPOSSIBLE)
    size = np.zeros((n, n))
    normal = np.zeros((n, n, 3))
    for i in range(n - 1):
        bend[i, i + 1] = _NO_BEND
        for k in range(3):
            normal[i, i + 1, k] = outer[i, k]
    for gap in range(2, n):
        for i in range(n - gap):
            j = i + gap
            is_last = gap == n - 1
            if taken[i, j] and not is_last:
                continue
            for m in range(i + 1, j):
                worst = max(bend[i, m], bend[m, j])
                if worst >= _IMPOSSIBLE or worst > bend[i, j] + _SAME_BEND:
                    continue
                x, y, z, squares = _face(P, j, m, i)
                if x == 0.0 and y == 0.0 and z == 0.0:
                    worst = max(worst, _FLAT)
                worst = max(worst, _bend_to(normal, i, m, x, y, z))
                worst = max(worst, _bend_to(normal, m, j, x, y, z))
                if is_last:
                    worst = max(worst, _turn(outer[j, 0], outer[j, 1], outer[j, 2], x, y, z))
                total = size[i, m] + size[m, j] + squares
                if worst < bend[i, j] - _SAME_BEND or (
                    worst < bend[i, j] + _SAME_BEND and total < size[i, j]
                ):
                    bend[i, j], size[i, j], apex[i, j] = worst, total, m
                    normal[i, j, 0], normal[i, j, 1], normal[i, j, 2] = x, y, z
    return apex[0, n - 1] >= 0


@inlined
def _face(P, a, b, c):
    """Return the unit normal of a face, 0 if it has no area, and the sum of its squared edges."""
    ux, uy, uz = P[b, 0] - P[a, 0], P[b, 1] - P[a, 1], P[b, 2] - P[a, 2]
    vx, vy, vz = P[c, 0] - P[a, 0], P[c, 1] - P[a, 1], P[c, 2] - P[a, 2]
    wx, wy, wz = ux - vx, uy - vy, uz - vz
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    squares = ux * ux + uy * uy + uz * uz + vx * vx + vy * vy + vz * vz
    squares += wx * wx + wy * wy + wz * wz
    length = np.sqrt(x * x + y * y + z * z)
    if not length > _NO_AREA * squares:
        return 0.0, 0.0, 0.0, squares
    return x / length, y / length, z / length, squares


@inlined
def _bend_to(normal, i, j, x, y, z):
    return _turn(normal[i, j, 0], normal[i, j, 1], normal[i, j, 2], x, y, z)


@inlined
def _turn(ax, ay, az, x, y, z):
    """Return the negative cosine between two unit normals; that of no bend where one is unknown."""
    if ax == 0.0 and ay == 0.0 and az == 0.0:
        return _NO_BEND
    return -(ax * x + ay * y + az * z)
