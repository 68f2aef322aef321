"""Where a surface is thin: how near the next sheet is, and how short chords must be not to reach it.

A chord of length l leaves an arc of radius R by ``h = R - sqrt(R^2 - l^2 / 4)``. Two sheets at a distance
g stay apart if each leaves its own place by less than 0.4 g: on a tube of radius 1 with a wall of .006,
faces cross above a length of .14. Flat sheets, however near, need nothing.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import face_vector
from ..core.vocabulary import BoolArray, FloatArray, Mesh, Tree
from ..sizing.curvature import corner_curvature
from .bvh import ARITY, LEAF, STACK, corner
from .crossings import box_meets

__all__ = ["clearance_lengths", "find_gaps"]

# Sheets farther away than this, in target lengths, do not matter: for chords to take 0.4 of such a gap,
# the radius must be below 0.73 lengths. With 1.25 the results on 12 thin parts were the same.
_REACH = 0.5

# Sheets face each other if their normals differ from opposite by less than 60 degrees.
_FACING = -0.5


def find_gaps(tree: Tree, mesh: Mesh, parallel: bool) -> FloatArray:
    """Measure how far it is from every face to the next sheet that faces it, on either side.

    From the middle of the face along its normal. Faces that share a corner are no other sheet.

    Parameters
    ----------
    tree : Tree
        Over the faces of the mesh.
    mesh : Mesh
        Target lengths in the last column of ``X``.
    parallel : bool

    Returns
    -------
    (m,) float64
        Infinite where no sheet is within half a target length.
    """
    gap = np.empty(len(mesh.origin) // 3)
    normal = np.empty((len(gap), 3))
    _fill_normals(parallel, tree, normal)
    _find_gaps(parallel, tree, mesh.origin, mesh.X, normal, gap)
    return gap


def clearance_lengths(
    mesh: Mesh, is_feature: BoolArray, gap: FloatArray, share: float
) -> FloatArray:
    """Lengths of chords that take no more than a share of the gap to the next sheet.

    Parameters
    ----------
    mesh : Mesh
        Before the first sweep.
    is_feature : (3 m,) bool
        Edges across which the surface does not bend.
    gap : (m,) float64
        See `find_gaps`.
    share : float

    Returns
    -------
    (n,) float64
        The longest length at every vertex; infinite where there is no bound.
    """
    curvature = corner_curvature(mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge, is_feature)
    with np.errstate(divide="ignore"):
        radius = 1.0 / curvature.reshape(-1, 3)
    height = np.broadcast_to(share * gap[:, None], radius.shape)
    is_bound = (height < radius) & np.isfinite(radius)
    longest = np.full(len(mesh.X), np.inf)
    chord = 2.0 * np.sqrt(height[is_bound] * (2.0 * radius[is_bound] - height[is_bound]))
    np.minimum.at(longest, mesh.origin.reshape(-1, 3)[is_bound], chord)
    return longest


@threaded(lambda tree, normal: -(-len(normal) // LEAF))
def _fill_normals(span, tree, normal):
    """Fill in the unit normals of the faces; zero for those without area."""
    for f in range(LEAF * span[0], min(LEAF * span[1], len(normal))):
        a, b, c = corner(tree.corners, f, 0), corner(tree.corners, f, 1), corner(tree.corners, f, 2)
        x, y, z = face_vector(a, b, c)
        norm = sqrt(x * x + y * y + z * z)
        inverse = 1.0 / norm if norm > 0.0 else 0.0
        normal[f, 0], normal[f, 1], normal[f, 2] = x * inverse, y * inverse, z * inverse


@threaded(lambda tree, origin, X, normal, gap: -(-gap.size // LEAF))
def _find_gaps(span, tree, origin, X, normal, gap):
    """Distance from the middle of every face to the next sheet that faces it, on either side.

    The faces of a leaf look together: their lines lie in one box.
    """
    stack = np.empty((2, STACK), np.int64)
    for leaf in range(span[0], span[1]):
        first = LEAF * leaf
        end = min(first + LEAF, gap.size)
        low, high = _box_of_lines(tree, origin, X, normal, first, end, gap)
        _visit(tree, normal, first, end, low, high, gap, stack)
        for f in range(first, end):
            if gap[f] < 0.0:  # the reach: nothing is there
                gap[f] = np.inf


@inlined
def _box_of_lines(tree, origin, X, normal, first, end, gap):
    """Box around the lines of some faces; sets their gaps to minus the reach."""
    low_x, low_y, low_z = np.inf, np.inf, np.inf
    high_x, high_y, high_z = -np.inf, -np.inf, -np.inf
    for f in range(first, end):
        a, b, c = origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]
        r = _REACH * max(X[a, 3], X[b, 3], X[c, 3])
        gap[f] = -r
        px, py, pz = _middle(tree.corners, f)
        x, y, z = r * abs(normal[f, 0]), r * abs(normal[f, 1]), r * abs(normal[f, 2])
        low_x, low_y, low_z = min(low_x, px - x), min(low_y, py - y), min(low_z, pz - z)
        high_x, high_y, high_z = max(high_x, px + x), max(high_y, py + y), max(high_z, pz + z)
    return (low_x, low_y, low_z), (high_x, high_y, high_z)


@inlined
def _middle(corners, f):
    x = (corners[f, 0] + corners[f, 3] + corners[f, 6]) / 3.0
    y = (corners[f, 1] + corners[f, 4] + corners[f, 7]) / 3.0
    z = (corners[f, 2] + corners[f, 5] + corners[f, 8]) / 3.0
    return x, y, z


@inlined
def _visit(tree, normal, first, end, low, high, gap, stack):
    """Shorten the gaps of some faces by all faces in a box."""
    stack[0, 0] = 0
    stack[1, 0] = tree.level.size - 2
    size = 1
    while size > 0:
        size -= 1
        i = stack[0, size]
        d = stack[1, size]
        if d == 0:
            for g in range(LEAF * i, min(LEAF * i + LEAF, gap.size)):
                x, y, z = normal[g, 0], normal[g, 1], normal[g, 2]
                for f in range(first, end):
                    if x * normal[f, 0] + y * normal[f, 1] + z * normal[f, 2] < _FACING:
                        _shorten(tree.corners, normal, f, g, gap)
            continue
        start = tree.level[d - 1]
        stop = min(start + ARITY * i + ARITY, tree.level[d])
        for j in range(start + ARITY * i, stop):
            if box_meets(tree.boxes, j, low, high):
                stack[0, size] = j - start
                stack[1, size] = d - 1
                size += 1


@inlined
def _shorten(corners, normal, f, g, gap):
    """Shorten the gap of a face if its line meets a face that looks back sooner."""
    p = _middle(corners, f)
    n = normal[f, 0], normal[f, 1], normal[f, 2]
    mx, my, mz = normal[g, 0], normal[g, 1], normal[g, 2]
    away = (corners[g, 0] - p[0]) * mx + (corners[g, 1] - p[1]) * my + (corners[g, 2] - p[2]) * mz
    distance = abs(away / (mx * n[0] + my * n[1] + mz * n[2]))
    if distance < abs(gap[f]) and _is_met(corners, g, p, n) and not _touch(corners, f, g):
        gap[f] = distance


@inlined
def _is_met(corners, g, p, n):
    """Tell whether a line meets a face that looks against its direction."""
    a, b, c = corner(corners, g, 0), corner(corners, g, 1), corner(corners, g, 2)
    return _side(p, n, a, b) <= 0.0 and _side(p, n, b, c) <= 0.0 and _side(p, n, c, a) <= 0.0


@inlined
def _side(p, n, a, b):
    """On which side of an edge a line passes: positive on the left, seen against its direction."""
    ux, uy, uz = a[0] - p[0], a[1] - p[1], a[2] - p[2]
    vx, vy, vz = b[0] - p[0], b[1] - p[1], b[2] - p[2]
    return (uy * vz - uz * vy) * n[0] + (uz * vx - ux * vz) * n[1] + (ux * vy - uy * vx) * n[2]


@inlined
def _touch(corners, f, g):
    """Tell whether two faces have a corner in one place."""
    for i in range(3):
        p = corner(corners, f, i)
        for j in range(3):
            q = corner(corners, g, j)
            if p[0] == q[0] and p[1] == q[1] and p[2] == q[2]:
                return True
    return False
