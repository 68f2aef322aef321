"""Tips of horns and cones, which no crease marks."""

from __future__ import annotations

from math import pi, radians

import numpy as np

from ..core.compiler import inlined, kernel
from ..core.geometry import angle_from_cosine, corner_angles
from ..core.vocabulary import HELD, INNER, MAX_VALENCE, FloatArray, IndexArray, Mesh
from ..mesh.walk import end_of, next_halfedge, next_spoke, previous_halfedge
from .dihedral import PROPER, DihedralAngles, face_cosine

__all__ = ["LEAST_TURN", "find_tips", "hold_tips"]

# An inner vertex with a larger angle defect is the tip of a horn or a cone. At 90 degrees, 4 in a
# thousand vertices of a badly triangulated scan are held; at 120, 2.
APEX_DEFECT = 120.0

# So is one with a defect above this, if the surface around it can be unrolled: if no inner vertex of its
# ring has more than this share of the defect. On noise the ring has as much as its centre.
CONE_DEFECT = 50.0
_CONE_SHARE = 0.1

# The edges around a vertex turn by this much in all where its defect exceeds that: if the angles of its
# faces sum up to s and the turns of its edges to t, s^2 + t^2 >= 360^2. (The unit normals around it, or
# the directions of its edges, are a closed curve on a sphere: the isoperimetric inequality.) So defects
# are measured only where it can be, from a list of the edges that turn more than the others at most do.
APEX_TURN = 0.97 * (360.0**2 - (360.0 - CONE_DEFECT) ** 2) ** 0.5
LEAST_TURN = 25.0

# The corners of the faces at a tip should have 60 degrees, as everywhere; three faces close the ring.
_FEWEST_FACES = 3


def hold_tips(mesh: Mesh, turns: DihedralAngles) -> None:
    """Keep tips in their places, with as few faces around them as suits the angle that is there.

    Flips would else bring six faces to a tip: narrow ones, with angles of 20 degrees on a cone of height
    3 and radius 1.

    Parameters
    ----------
    mesh : Mesh
        ``kind`` and ``valence_excess`` are changed.
    turns : DihedralAngles
        As for `find_tips`.
    """
    tips, defects = _tips_and_defects(mesh, turns)
    mesh.kind[tips] = HELD
    faces = np.rint((2.0 * pi - defects) / (pi / 3.0)).astype(np.int32)
    mesh.valence_excess[tips] += 6 - np.clip(faces, _FEWEST_FACES, 6)


def find_tips(mesh: Mesh, turns: DihedralAngles) -> IndexArray:
    """Find tips: inner vertices with a large angle defect, no two closer than their target length.

    Large is 120 degrees, or 50 where the surface around them can be unrolled, as that of a cone. Of two
    that are closer the larger defect wins, of equals the smaller index. Without them, tips thinner than
    that lose about as much of their length.

    Parameters
    ----------
    mesh : Mesh
    turns : DihedralAngles
        Edges that turn by ``LEAST_TURN`` or less, and all that turn more.

    Returns
    -------
    (k,) int32
        Vertices, the sharpest first.
    """
    return _tips_and_defects(mesh, turns)[0]


def _tips_and_defects(mesh: Mesh, turns: DihedralAngles) -> tuple[IndexArray, FloatArray]:
    """Return tips, the sharpest first, and their angle defects."""
    at_most = np.zeros(len(mesh.X))
    if turns.slivers:  # nobody knows how sharply they turn
        odd = np.flatnonzero(turns.state != PROPER)
        at_most[mesh.origin.reshape(-1, 3)[odd]] = np.inf
    found = np.empty(len(mesh.X), np.int32)
    defect = np.empty(len(mesh.X))
    count = _find_tips(mesh, turns.edges, turns.normals, at_most, found, defect)
    found, defect = found[:count], defect[:count]
    order = np.argsort(-defect, kind="stable")
    kept = np.empty(len(found), np.int64)
    kept = kept[: _keep_apart(mesh.X, found[order], kept)] if len(found) else kept
    return found[order][kept], defect[order][kept]


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
        if left > radians(APEX_DEFECT) or (
            left > radians(CONE_DEFECT) and _is_alone(mesh, v, _CONE_SHARE * left, ring, angle)
        ):
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
def _is_alone(mesh, v, most, ring, angle):
    """Tell whether the inner vertices next to a vertex have defects of ``most`` either way."""
    start = np.int64(mesh.vertex_halfedge[v])
    h = start
    for _ in range(MAX_VALENCE):
        w = end_of(mesh.origin, h)
        if mesh.kind[w] == INNER and mesh.valence_excess[w] + 6 <= ring.size:
            left = _defect(mesh, w, ring, angle)
            if abs(left) > most:
                return False
        h = next_spoke(mesh.twin, h)
        if h == start:
            break
    return True


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
    """List the places in ``found`` of vertices that are not too close to an earlier one that is kept."""
    count = 0
    for k in range(found.size):
        v = found[k]
        is_free = True
        for i in range(count):
            u = found[kept[i]]
            d = (X[u, 0] - X[v, 0]) ** 2 + (X[u, 1] - X[v, 1]) ** 2 + (X[u, 2] - X[v, 2]) ** 2
            if d < X[v, 3] * X[v, 3]:
                is_free = False
                break
        if is_free:
            kept[count] = k
            count += 1
    return count
