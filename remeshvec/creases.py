"""Creases of the input, found without a threshold that the caller must choose.

A crease is a turn across an edge that does not repeat beside it: a tessellated limb, a fillet or a
coarse cylinder has the same turn again one facet further (an echo), a crease has not. Edges that
turn far enough and stand out of the noise around them are classified, lose their class where they
echo (`_echo`), are linked to chains and kept if the chain is long or sure enough (`_chains`).
"""

from __future__ import annotations

from math import acos, cos, degrees, radians, sqrt

import numpy as np
from numpy.typing import NDArray

from ._chains import BORDER, CLEAN, HARD, STRONG, SURE, WEAK, count_chains, keep_chains
from ._echo import echoes_beside, face_cosine
from ._jit import inlined, kernel
from ._types import MAX_VALENCE, NONE, FloatArray, IndexArray
from .geometry import angle_from_cosine, distance_squared, face_vector
from .halfedge import following, previous

__all__ = ["find_creases"]

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

# Degrees by which turns may miss a threshold.
ANGLE_TOLERANCE = 1e-6

# A face flatter than this share of its longest edge and of the target length has no normal of its
# own: coordinates in single precision turn it by 0.1 degrees and more.
SLIVER = 1e-3
SLIVER_ROUNDS = 8


def find_creases(
    X: FloatArray,
    origin: IndexArray,
    twin: IndexArray,
    vertex_halfedge: IndexArray,
    hard: NDArray[np.bool_],
    angle: float | str | None,
) -> tuple[NDArray[np.bool_], dict[str, int]]:
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
        is_auto = angle == "auto"
        limit = WEAK_TURN - ANGLE_TOLERANCE if is_auto else float(angle) + ANGLE_TOLERANCE
        normals = np.empty((origin.size // 3, 3))
        state = np.zeros(origin.size // 3, np.uint8)
        found = np.empty(origin.size // 2, np.int64)
        # 1e-14: rounding of the cosine itself, for limits near 0.
        cosine = cos(radians(min(limit, 180.0))) - 1e-14
        found = found[: _find_turns(X, origin, twin, is_feature, cosine, normals, state, found)]
        if is_auto and len(found):
            mesh = X, origin, twin, vertex_halfedge
            found = _creases(mesh, normals, state, is_feature, found, counts)
        is_feature[found] = True
        is_feature[twin[found]] = True
    edges = _one_of_each(is_feature, twin)
    counts["crease_edges"] = int((twin[edges] != NONE).sum())
    if counts["crease_edges"]:
        counts["chains"] = count_chains(X, origin, twin, edges)
    return is_feature, counts


def _one_of_each(is_feature: NDArray[np.bool_], twin: IndexArray) -> NDArray[np.int64]:
    """List one half-edge of every feature edge."""
    edges = np.flatnonzero(is_feature)
    return edges[twin[edges] < edges]


def _creases(
    mesh: tuple[FloatArray, IndexArray, IndexArray, IndexArray],
    normals: FloatArray,
    state: NDArray[np.uint8],
    is_hard: NDArray[np.bool_],
    found: NDArray[np.int64],
    counts: dict[str, int],
) -> NDArray[np.int64]:
    """Of the edges that turn far enough, keep the creases; counts the others by reason."""
    X, origin, twin, _ = mesh
    rank = np.zeros(len(found), np.uint8)
    noise, echo = _rank_edges(*mesh, normals, state, is_hard, found, rank)
    found, rank = found[rank > 0], rank[rank > 0]
    counts["dropped_noise"], counts["dropped_echo"] = noise, echo
    if not len(found):
        return found
    fixed = _one_of_each(is_hard, twin)
    edges = np.concatenate([fixed, found])
    hard = np.where(twin[fixed] == NONE, BORDER, HARD).astype(np.uint8)
    rank = np.concatenate([hard, rank])
    keep = keep_chains(X, origin, edges, rank, _mean_edge(X, origin, twin))[len(fixed) :]
    counts["dropped_short"] = int((~keep).sum())
    return found[keep]


@kernel
def _mean_edge(X, origin, twin):
    total = 0.0
    count = 0
    for h in range(origin.size):
        if twin[h] < h:
            total += sqrt(distance_squared(X, origin[h], origin[following(h)]))
            count += 1
    return total / count


# -- turns ------------------------------------------------------------------------------------

PROPER = 0  # a face with a normal of its own
LENT = 1  # a sliver, with the normal of a face beside it
MISSING = 2  # a sliver without


@kernel
def _find_turns(X, origin, twin, is_hard, cosine, normals, state, found):
    """List inner edges whose faces' normals have at most this cosine; fills the normals."""
    slivers = 0
    for f in range(origin.size // 3):
        slivers += _fill_normal(X, origin, f, normals, state)
    if slivers:
        _lend_normals(X, origin, twin, normals, state)
    count = 0
    for h in range(origin.size):
        t = np.int64(twin[h])
        if t >= h or t == NONE or is_hard[h]:
            continue
        if face_cosine(normals, h // 3, t // 3) <= cosine and (
            not slivers or (state[h // 3] != MISSING and state[t // 3] != MISSING)
        ):
            found[count] = h
            count += 1
    return count


@inlined
def _fill_normal(X, origin, f, normals, state):
    """Set the unit normal of a face; returns 1 for a sliver."""
    a, b, c = origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]
    x, y, z = face_vector(
        X[a, 0], X[a, 1], X[a, 2], X[b, 0], X[b, 1], X[b, 2], X[c, 0], X[c, 1], X[c, 2]
    )
    double_area = sqrt(x * x + y * y + z * z)
    longest = max(distance_squared(X, a, b), distance_squared(X, b, c), distance_squared(X, c, a))
    if not double_area > SLIVER * min(longest, sqrt(longest) * X[a, 3]):
        state[f] = MISSING
        normals[f, 0] = 0.0
        normals[f, 1] = 0.0
        normals[f, 2] = 0.0
        return 1
    normals[f, 0] = x / double_area
    normals[f, 1] = y / double_area
    normals[f, 2] = z / double_area
    return 0


@inlined
def _lend_normals(X, origin, twin, normals, state):
    """Give slivers the normal across their longest side that has one, round by round.

    So a crease that runs along a cap goes over its short sides, in one piece.
    """
    for _ in range(SLIVER_ROUNDS):
        for f in range(origin.size // 3):
            if state[f] != MISSING:
                continue
            longest = -1.0
            for h in range(3 * f, 3 * f + 3):
                t = twin[h]
                side = distance_squared(X, origin[h], origin[following(h)])
                if t != NONE and state[t // 3] != MISSING and side > longest:
                    longest = side
                    state[f] = LENT
                    for axis in range(3):
                        normals[f, axis] = normals[t // 3, axis]


# -- noise and echo ---------------------------------------------------------------------------


@kernel
def _rank_edges(X, origin, twin, vertex_halfedge, normals, state, is_hard, found, rank):
    """Class every edge, 0 for those in the noise and those that echo; returns how many of each."""
    noise_at = np.full(vertex_halfedge.size, -1.0)
    in_noise = 0
    echoing = 0
    for k in range(len(found)):
        h = found[k]
        t = np.int64(twin[h])
        noise = 0.0
        target = 0.0
        for v in (origin[h], origin[t]):
            if noise_at[v] < 0.0:
                noise_at[v] = _noise(X, origin, twin, normals, state, np.int64(vertex_halfedge[v]))
            noise = max(noise, noise_at[v])
            target += 0.5 * X[v, 3]
        cosine = face_cosine(normals, h // 3, t // 3)
        turn = degrees(acos(min(1.0, max(-1.0, cosine)))) + ANGLE_TOLERANCE
        rank[k] = _class(turn, noise)
        if rank[k] == 0:
            in_noise += 1
        elif turn < STEEP_TURN:
            is_clean = turn >= CLEAN_RATIO * noise
            reach = target * (CLEAN_REACH if is_clean else ECHO_REACH)
            total = 0
            open_sides = 0
            for g in (h, t):
                echoes, is_cut_short = echoes_beside(X, origin, twin, normals, is_hard, g, reach)
                total += echoes
                open_sides += echoes == 0 and not is_cut_short
            # In noise one echo is enough. A clean turn that comes twice makes a chamfer or a land;
            # if it comes three times it is curvature.
            if total >= 2 or (total == 1 and (open_sides == 0 or not is_clean)):
                rank[k] = 0
                echoing += 1
    return in_noise, echoing


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


@inlined
def _noise(X, origin, twin, normals, state, start):
    """Mean turn, in degrees, across the smoothest side of each face at a vertex, weighted by area."""
    area = 0.0
    total = 0.0
    longest_target = FLAT_HEIGHT * X[origin[start], 3]
    g = start
    for _ in range(MAX_VALENCE):
        f = g // 3
        if state[f] == PROPER:
            a, b, c = origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]
            x, y, z = face_vector(
                X[a, 0], X[a, 1], X[a, 2], X[b, 0], X[b, 1], X[b, 2], X[c, 0], X[c, 1], X[c, 2]
            )
            double_area = sqrt(x * x + y * y + z * z)
            longest = sqrt(
                max(distance_squared(X, a, b), distance_squared(X, b, c), distance_squared(X, c, a))
            )
            area += double_area
            if double_area <= longest_target * longest:
                total += double_area * _smoothest_turn(twin, normals, state, f)
        g = np.int64(twin[previous(g)])
        if g == NONE or g == start:
            break
    return degrees(total / area) if area > 0.0 else 0.0


@inlined
def _smoothest_turn(twin, normals, state, f):
    best = -2.0
    for h in range(3 * f, 3 * f + 3):
        t = twin[h]
        if t != NONE and state[t // 3] == PROPER:
            best = max(best, face_cosine(normals, f, t // 3))
    return angle_from_cosine(best) if best >= -1.5 else 0.0
