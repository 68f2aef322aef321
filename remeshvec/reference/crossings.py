"""Faces of a surface that cross other faces of it."""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import face_vector
from ..core.vocabulary import BoolArray, IndexArray, Tree
from .bvh import ARITY, LEAF, STACK, corner

__all__ = ["box_meets", "crossing_faces"]

# An end of an edge lies on one side of a plane only from this distance on: in the frame of the mesh,
# smaller distances are rounding errors.
_APART = 1e-13


def crossing_faces(
    tree: Tree, parallel: bool, adjacent: bool = True, among: BoolArray | None = None
) -> IndexArray:
    """Return the faces that cross another one, in order: an edge of one passes through the other.

    Faces that touch, or lie in one plane, do not cross. Two faces that share a corner cross if they also
    meet elsewhere [Moeller 1997; here by signed volumes]. Without ``adjacent``, only faces without a
    common corner are tested, which is faster. With ``among``, an (m,) mask, only its faces are tested
    against all others.
    """
    marks = np.zeros(len(tree.corners), np.uint8)
    is_asked = np.ones(len(marks), np.bool_) if among is None else among
    _find_crossings(parallel, tree, adjacent, is_asked, among is None, marks)
    return np.flatnonzero(marks).astype(np.int32)


@threaded(lambda *args: -(-args[-1].size // LEAF))
def _find_crossings(span, tree, adjacent, is_asked, are_all, marks):
    """Mark the faces asked for in the leaves of a span, and the others that they cross.

    Pieces may mark the same face, with the same value.
    """
    for leaf in range(span[0], span[1]):
        stack = np.empty((2, STACK), np.int64)
        for f in range(LEAF * leaf, min(LEAF * leaf + LEAF, marks.size)):
            if is_asked[f]:
                _mark_crossed(tree, f, adjacent, is_asked, are_all, stack, marks)


@inlined
def _mark_crossed(tree, f, adjacent, is_asked, are_all, stack, marks):
    """Mark a face and those that it crosses, if any; of two that are asked for, at the earlier one."""
    low, high = _box_of(tree.corners, f)
    stack[0, 0] = 0
    stack[1, 0] = tree.level.size - 2
    size = 1
    while size > 0:
        size -= 1
        i = stack[0, size]
        d = stack[1, size]
        if d == 0:
            for g in range(LEAF * i, min(LEAF * i + LEAF, tree.corners.shape[0])):
                if (g <= f and is_asked[g]) or not _meets(tree.corners, g, low, high):
                    continue
                if _cross(tree.corners, f, g, adjacent):
                    marks[f] = 1
                    marks[g] = 1
            continue
        start = tree.level[d - 1]
        end = min(start + ARITY * i + ARITY, tree.level[d])
        # Boxes of earlier faces alone are left out, if these ask for themselves.
        first = f // (LEAF * np.int64(ARITY) ** (d - 1)) if are_all else 0
        for j in range(start + max(ARITY * i, first), end):
            if box_meets(tree.boxes, j, low, high):
                stack[0, size] = j - start
                stack[1, size] = d - 1
                size += 1


@inlined
def _box_of(corners, f):
    ax, ay, az = corner(corners, f, 0)
    bx, by, bz = corner(corners, f, 1)
    cx, cy, cz = corner(corners, f, 2)
    low = min(ax, bx, cx), min(ay, by, cy), min(az, bz, cz)
    high = max(ax, bx, cx), max(ay, by, cy), max(az, bz, cz)
    return low, high


@inlined
def _meets(corners, g, low, high):
    """Tell whether the box around a face meets another one."""
    (ax, ay, az), (bx, by, bz) = _box_of(corners, g)
    return (
        ax <= high[0]
        and ay <= high[1]
        and az <= high[2]
        and bx >= low[0]
        and by >= low[1]
        and bz >= low[2]
    )


@inlined
def box_meets(boxes, j, low, high):
    """Tell whether a box of the tree meets another one."""
    return (
        boxes[j, 0] <= high[0]
        and boxes[j, 1] <= high[1]
        and boxes[j, 2] <= high[2]
        and boxes[j, 3] >= low[0]
        and boxes[j, 4] >= low[1]
        and boxes[j, 5] >= low[2]
    )


@inlined
def _cross(corners, f, g, adjacent):
    """Tell whether two faces cross: an edge of one, off all common corners, passes through the other."""
    common = _count_common(corners, f, g)
    if common > 1 or (common == 1 and not adjacent):
        return False
    return _pierces(corners, f, g) or _pierces(corners, g, f)


@inlined
def _count_common(corners, f, g):
    """Count the corners of a face that another one shares."""
    a, b, c = corner(corners, g, 0), corner(corners, g, 1), corner(corners, g, 2)
    count = 0
    for i in range(3):
        count += _is_corner(corner(corners, f, i), a, b, c)
    return count


@inlined
def _pierces(corners, f, g):
    """Tell whether an edge of face f passes through face g."""
    a, b, c = corner(corners, g, 0), corner(corners, g, 1), corner(corners, g, 2)
    nx, ny, nz = face_vector(a, b, c)
    apart = _APART * sqrt(nx * nx + ny * ny + nz * nz)
    if apart == 0.0:
        return False
    for i in range(3):
        p = corner(corners, f, i)
        q = corner(corners, f, (i + 1) % 3)
        if _is_corner(p, a, b, c) or _is_corner(q, a, b, c):
            continue
        side_p = (p[0] - a[0]) * nx + (p[1] - a[1]) * ny + (p[2] - a[2]) * nz
        side_q = (q[0] - a[0]) * nx + (q[1] - a[1]) * ny + (q[2] - a[2]) * nz
        if not ((side_p > apart and side_q < -apart) or (side_p < -apart and side_q > apart)):
            continue
        u = _volume(p, q, a, b)
        v = _volume(p, q, b, c)
        w = _volume(p, q, c, a)
        if (u > 0.0 and v > 0.0 and w > 0.0) or (u < 0.0 and v < 0.0 and w < 0.0):
            return True
    return False


@inlined
def _is_corner(p, a, b, c):
    """Tell whether a point equals one of three, bit for bit: sheets that meet have separate corners."""
    return (
        (p[0] == a[0] and p[1] == a[1] and p[2] == a[2])
        or (p[0] == b[0] and p[1] == b[1] and p[2] == b[2])
        or (p[0] == c[0] and p[1] == c[1] and p[2] == c[2])
    )


@inlined
def _volume(p, q, a, b):
    """Six times the signed volume of a tetrahedron."""
    nx, ny, nz = face_vector(p, q, a)
    return (b[0] - p[0]) * nx + (b[1] - p[1]) * ny + (b[2] - p[2]) * nz
