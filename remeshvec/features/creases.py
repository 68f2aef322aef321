"""Creases of the input, found without a threshold that the caller must choose.

A crease is a turn across an edge that does not repeat beside it: a tessellated limb, a fillet or a
coarse cylinder has the same turn again one facet further (an echo), a crease has not. Edges that
turn far enough and stand out of the noise around them are classified, lose their class where they
echo (`_echo`), are linked to chains and kept if the chain is long or sure enough (`_chains`).
"""

from __future__ import annotations

from math import acos, degrees, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, threaded
from ..core.geometry import angle_from_cosine, area_vector, distance_squared
from ..core.vocabulary import MAX_VALENCE, NONE, BoolArray, FloatArray, IndexArray, IntArray
from ..mesh.walk import previous_halfedge
from .chains import BORDER, CLEAN, HARD, STRONG, SURE, WEAK, count_chains, keep_chains
from .dihedral import (
    ANGLE_TOLERANCE,
    PROPER,
    DihedralAngles,
    face_cosine,
    find_dihedral_angles,
    least_cosine,
)
from .echo import echo_cosines, echoes_beside

__all__ = ["find_creases", "least_turn"]

# Degrees that an edge must turn to be a candidate, and to be more than a weak one. What turns by
# more than the last is no tessellation: it is sure with less, and may have echoes (plates, blades).
WEAK_TURN = 25.0
STRONG_TURN = 30.0
STEEP_TURN = 70.0

# The turn over the noise at its ends. Beside a clean edge faces are flat to a fraction of a degree.
WEAK_RATIO = 4.0
STRONG_RATIO = 6.0
SURE_RATIO = 8.0
STEEP_RATIO = 5.0
CLEAN_RATIO = 100.0

# In target lengths: facets narrower than the first are curvature at the scale of the new mesh;
# beside a clean edge the second. Faces higher than the third are flat whatever is around them.
ECHO_REACH = 1.5
CLEAN_REACH = 1.25
FLAT_HEIGHT = 2.5

# Elements in a piece of a loop.
_ELEMENTS_PER_PIECE = 1024


def find_creases(
    X: FloatArray,
    origin: IndexArray,
    twin: IndexArray,
    vertex_halfedge: IndexArray,
    hard: BoolArray,
    angle: float | str | None,
    mean_edge: float,
    turns: DihedralAngles | None = None,
    parallel: bool = False,
) -> tuple[BoolArray, dict[str, int]]:
    """Find the feature edges of a mesh.

    Parameters
    ----------
    X : (n, 4) float64
        The last column is the target length.
    origin, twin : (3 m,) int32
    vertex_halfedge : (n,) int32
    hard : (3 m,) bool
        Edges that are features whatever their angle; the same on both half-edges. Boundary edges
        are without being named.
    angle : "auto", float or None
        The rule of this module; or all edges that turn by more than so many degrees; or none.
    mean_edge : float
        Mean length of the edges.
    turns : Turns, optional
        The edges that turn by `least_turn` of ``angle`` or more, where they are known.
    parallel : bool

    Returns
    -------
    is_feature : (3 m,) bool
        The same on both half-edges of an edge; true on the boundary.
    counts : dict of int
        ``crease_edges``, feature edges without those on the boundary; ``chains``, the curves they
        form, passing straight through junctions; and of the edges that turn far enough under
        "auto", ``dropped_noise``, those that do not stand out of the noise, ``dropped_echo``, those
        whose turn repeats beside them, ``dropped_short``, those whose chain is too short or unsure.
    """
    is_feature = hard | (twin == NONE)
    counts = dict.fromkeys(
        ("crease_edges", "chains", "dropped_echo", "dropped_noise", "dropped_short"), 0
    )
    if angle is not None:
        if turns is None:
            turns = find_dihedral_angles(X, origin, twin, least_turn(angle), parallel)
        found = turns.edges[~is_feature[turns.edges]]
        if angle == "auto":
            mesh = X, origin, twin, vertex_halfedge
            found = _creases(mesh, turns, is_feature, found, mean_edge, counts, parallel)
        else:
            found = found[_cosines(turns.normals, twin, found) <= least_cosine(least_turn(angle))]
        is_feature[found] = True
        is_feature[twin[found]] = True
    edges = _one_of_each(is_feature, twin)
    counts["crease_edges"] = int((twin[edges] != NONE).sum())
    if counts["crease_edges"]:
        counts["chains"] = count_chains(X, origin, twin, edges)
    return is_feature, counts


def least_turn(angle: float | str | None) -> float:
    """Degrees by which an edge must turn to be a candidate; for none those of the rule."""
    if angle is None or isinstance(angle, str):
        return WEAK_TURN - ANGLE_TOLERANCE
    return float(angle) + ANGLE_TOLERANCE


def _cosines(normals: FloatArray, twin: IndexArray, edges: IntArray) -> FloatArray:
    """Cosines of the turns across edges; the same bits as `face_cosine`."""
    a, b = normals[edges // 3].T, normals[twin[edges] // 3].T
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _one_of_each(is_feature: BoolArray, twin: IndexArray) -> IntArray:
    """List one half-edge of every feature edge."""
    edges = np.flatnonzero(is_feature)
    return edges[twin[edges] < edges]


def _creases(
    mesh: tuple[FloatArray, IndexArray, IndexArray, IndexArray],
    turns: DihedralAngles,
    is_hard: BoolArray,
    found: IntArray,
    mean_edge: float,
    counts: dict[str, int],
    parallel: bool,
) -> IntArray:
    """Of the edges that turn far enough, keep the creases; counts the others by reason."""
    X, origin, twin, _ = mesh
    if not len(found):
        return found
    rank = np.empty(len(found), np.int8)
    noise = _noise(mesh, turns, found, parallel)
    _rank_edges(parallel, found, X, origin, twin, noise, turns.normals, is_hard, rank)
    counts["dropped_noise"] = int(np.count_nonzero(rank == _NOISE))
    counts["dropped_echo"] = int(np.count_nonzero(rank == _ECHO))
    found, rank = found[rank > 0], rank[rank > 0]
    if not len(found):
        return found
    fixed = _one_of_each(is_hard, twin)
    edges = np.concatenate([fixed, found])
    hard = np.where(twin[fixed] == NONE, BORDER, HARD).astype(np.int8)
    rank = np.concatenate([hard, rank])
    keep = keep_chains(X, origin, edges, rank, mean_edge)[len(fixed) :]
    counts["dropped_short"] = int((~keep).sum())
    return found[keep]


def _noise(
    mesh: tuple[FloatArray, IndexArray, IndexArray, IndexArray],
    turns: DihedralAngles,
    found: IntArray,
    parallel: bool,
) -> FloatArray:
    """Mean turn, in degrees, across the smoothest side of each face at the ends of edges.

    Weighted by area. Of flat faces, which have many vertices, the turn is computed once.
    """
    X, origin, twin, vertex_halfedge = mesh
    is_asked = np.zeros(len(X), np.bool_)
    is_asked[origin[found]] = True
    is_asked[origin[twin[found]]] = True
    faces = np.empty((len(origin) // 3, 3))
    _measure_faces(parallel, X, origin, twin, turns.normals, turns.state, is_asked, faces)
    noise = np.empty(len(X))
    _sum_noise(parallel, X, origin, twin, vertex_halfedge, faces, is_asked, noise)
    return noise


# -- noise and echo ---------------------------------------------------------------------------

# Instead of a class.
_NOISE = 0
_ECHO = -1


def _per_element_piece(first: NDArray[Any], *_: Any) -> int:
    return -(-len(first) // _ELEMENTS_PER_PIECE)


def _per_piece_of_faces(X: FloatArray, origin: IndexArray, *_: Any) -> int:
    return -(-origin.size // (3 * _ELEMENTS_PER_PIECE))


@threaded(_per_element_piece)
def _rank_edges(span, found, X, origin, twin, noise, normals, is_hard, rank):
    """Class every edge, or say why it is none."""
    for k in range(_ELEMENTS_PER_PIECE * span[0], min(_ELEMENTS_PER_PIECE * span[1], len(found))):
        h = found[k]
        t = np.int64(twin[h])
        v, w = origin[h], origin[t]
        noise_here = max(noise[v], noise[w])
        angle = acos(min(1.0, max(-1.0, face_cosine(normals, h // 3, t // 3))))
        turn = degrees(angle) + ANGLE_TOLERANCE
        rank[k] = _class(turn, noise_here)
        if rank[k] == _NOISE or turn >= STEEP_TURN:
            continue
        is_clean = turn >= CLEAN_RATIO * noise_here
        target = 0.5 * X[v, 3] + 0.5 * X[w, 3]
        reach = target * (CLEAN_REACH if is_clean else ECHO_REACH)
        # In noise one echo is enough. A clean turn that comes twice makes a chamfer or a land;
        # if it comes three times it is curvature.
        enough = 2 if is_clean else 1
        quiet, loud = echo_cosines(angle)
        total = 0
        open_sides = 0
        for g in (h, t):
            if total < enough:
                echoes, is_cut_short = echoes_beside(
                    X, origin, twin, normals, is_hard, g, reach, quiet, loud, enough
                )
                total += echoes
                open_sides += echoes == 0 and not is_cut_short
        if total >= enough or (total == 1 and open_sides == 0):
            rank[k] = _ECHO


@inlined
def _class(turn, noise):
    if turn >= CLEAN_RATIO * noise:
        return CLEAN
    if turn >= STEEP_TURN and turn >= STEEP_RATIO * noise:
        return SURE
    if turn >= STRONG_TURN and turn >= SURE_RATIO * noise:
        return SURE
    if turn >= STRONG_TURN and turn >= STRONG_RATIO * noise:
        return STRONG
    return WEAK if turn >= WEAK_RATIO * noise else 0


@threaded(_per_piece_of_faces)
def _measure_faces(span, X, origin, twin, normals, state, is_asked, faces):
    """Twice the area of a face, its longest side, the smallest of its turns in radians."""
    for f in range(_ELEMENTS_PER_PIECE * span[0], min(_ELEMENTS_PER_PIECE * span[1], state.size)):
        a, b, c = origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]
        if not (is_asked[a] or is_asked[b] or is_asked[c]):
            continue
        faces[f, 0] = faces[f, 1] = faces[f, 2] = 0.0
        if state[f] != PROPER:
            continue
        x, y, z = area_vector(X, a, b, c)
        faces[f, 0] = sqrt(x * x + y * y + z * z)
        faces[f, 1] = sqrt(
            max(distance_squared(X, a, b), distance_squared(X, b, c), distance_squared(X, c, a))
        )
        best = -2.0
        for h in range(3 * f, 3 * f + 3):
            t = twin[h]
            if t != NONE and state[t // 3] == PROPER:
                best = max(best, face_cosine(normals, f, t // 3))
        faces[f, 2] = angle_from_cosine(best) if best >= -1.5 else 0.0


@threaded(_per_element_piece)
def _sum_noise(span, X, origin, twin, vertex_halfedge, faces, is_asked, noise):
    for v in range(_ELEMENTS_PER_PIECE * span[0], min(_ELEMENTS_PER_PIECE * span[1], noise.size)):
        if not is_asked[v]:
            continue
        area = 0.0
        total = 0.0
        height = FLAT_HEIGHT * X[v, 3]
        start = np.int64(vertex_halfedge[v])
        g = start
        for _ in range(MAX_VALENCE):
            f = g // 3
            double_area = faces[f, 0]
            area += double_area
            if double_area <= height * faces[f, 1]:
                total += double_area * faces[f, 2]
            g = np.int64(twin[previous_halfedge(g)])
            if g == NONE or g == start:
                break
        noise[v] = degrees(total / area) if area > 0.0 else 0.0
