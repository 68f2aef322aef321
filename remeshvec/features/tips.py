"""Tips of horns and cones, which no crease marks."""

from __future__ import annotations

from math import pi, radians

import numpy as np

from ..core.compiler import inlined, kernel
from ..core.geometry import angle_from_cosine, corner_angles
from ..core.vocabulary import INNER, MAX_VALENCE, IndexArray, Mesh
from ..mesh.walk import next_halfedge, previous_halfedge
from .dihedral import PROPER, DihedralAngles, face_cosine

__all__ = ["LEAST_TURN", "find_tips"]

# An inner vertex with a larger angle defect is the tip of a horn or a cone. At 90 degrees, 4 in a
# thousand vertices of a badly triangulated scan are held; at 120, 2.
APEX_DEFECT = 120.0

# The edges around a vertex turn by this much in all where its defect exceeds that: if the angles of its
# faces sum up to s and the turns of its edges to t, s^2 + t^2 >= 360^2. (The unit normals around it, or
# the directions of its edges, are a closed curve on a sphere: the isoperimetric inequality.) So defects
# are measured only where it can be, from a list of the edges that turn more than the others at most do.
APEX_TURN = 0.97 * (360.0**2 - (360.0 - APEX_DEFECT) ** 2) ** 0.5
LEAST_TURN = 25.0


def find_tips(mesh: Mesh, turns: DihedralAngles) -> IndexArray:
    """Find inner vertices with an angle defect above 120 degrees, no two closer than their target length.

    Of two that are closer the larger defect wins, of equals the smaller index. Without them, tips
    thinner than that lose about as much of their length.

    Parameters
    ----------
    mesh : Mesh
    turns : Turns
        Edges that turn by ``LEAST_TURN`` or less, and all that turn more.

    Returns
    -------
    (k,) int32
        Vertices.
    """
    at_most = np.zeros(len(mesh.X))
    if turns.slivers:  # nobody knows how sharply they turn
        odd = np.flatnonzero(turns.state != PROPER)
        at_most[mesh.origin.reshape(-1, 3)[odd]] = np.inf
    found = np.empty(len(mesh.X), np.int32)
    defect = np.empty(len(mesh.X))
    count = _find_tips(mesh, turns.edges, turns.normals, at_most, found, defect)
    found, defect = found[:count], defect[:count]
    found = found[np.argsort(-defect, kind="stable")]
    kept = np.empty(len(found), np.int32)
    return kept[: _keep_apart(mesh.X, found, kept)] if len(found) else kept


@kernel
def _find_tips(mesh, edges, normals, at_most, found, defect):
    """List inner vertices with a large defect; ``at_most`` is room for what edges may turn in all."""
    twin = mesh.twin
    for h in edges:
        turn = angle_from_cosine(face_cosine(normals, h // 3, twin[h] // 3)) * (180.0 / pi)
        for v in (mesh.origin[h], mesh.origin[next_halfedge(h)]):
            at_most[v] += turn - LEAST_TURN
    ring = np.empty(64, np.int32)
    angle = np.empty(64)
    count = 0
    for v in range(mesh.kind.size):
        valence = mesh.valence_excess[v] + 6
        if mesh.kind[v] != INNER or at_most[v] + LEAST_TURN * valence < APEX_TURN:
            continue
        if valence > ring.size:
            ring = np.empty(valence, np.int32)
            angle = np.empty(valence)
        if at_most[v] < np.inf and _turn_around(mesh, normals, v) < APEX_TURN * (pi / 180.0):
            continue
        left = _defect(mesh, v, ring, angle)
        if left > radians(APEX_DEFECT):
            found[count] = v
            defect[count] = left
            count += 1
    return count


@inlined
def _turn_around(mesh, normals, v):
    """Add up the turns of all edges at an inner vertex, in radians."""
    start = np.int64(mesh.vertex_halfedge[v])
    h = start
    total = 0.0
    for _ in range(MAX_VALENCE):
        t = np.int64(mesh.twin[previous_halfedge(h)])
        total += angle_from_cosine(face_cosine(normals, h // 3, t // 3))
        h = t
        if h == start:
            break
    return total


@inlined
def _defect(mesh, v, ring, angle):
    """Angle defect of an inner vertex; its faces in ascending order, from wherever the walk begins."""
    start = np.int64(mesh.vertex_halfedge[v])
    h = start
    n = 0
    while n < ring.size:
        f = h // 3
        ring[n] = f
        angle[n] = corner_angles(
            mesh.X, mesh.origin[3 * f], mesh.origin[3 * f + 1], mesh.origin[3 * f + 2]
        )[h - 3 * f]
        n += 1
        h = np.int64(mesh.twin[previous_halfedge(h)])
        if h == start:
            break
    _sort(ring, angle, n)
    left = 2.0 * pi
    for i in range(n):
        left -= angle[i]
    return left


@inlined
def _sort(key, value, n):
    """Sort by key [Shell 1959]; there may be hubs of any size."""
    gap = 1
    while gap < n // 3:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, n):
            k, x = key[i], value[i]
            j = i
            while j >= gap and key[j - gap] > k:
                key[j] = key[j - gap]
                value[j] = value[j - gap]
                j -= gap
            key[j] = k
            value[j] = x
        gap //= 3


@kernel
def _keep_apart(X, found, kept):
    count = 0
    for v in found:
        is_free = True
        for i in range(count):
            u = kept[i]
            d = (X[u, 0] - X[v, 0]) ** 2 + (X[u, 1] - X[v, 1]) ** 2 + (X[u, 2] - X[v, 2]) ** 2
            if d < X[v, 3] * X[v, 3]:
                is_free = False
                break
        if is_free:
            kept[count] = v
            count += 1
    return count
