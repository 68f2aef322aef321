"""Creases of the input, found without a threshold that the caller must choose.

Edges that turn far enough are candidates. Each has a class, by how far it turns and by the noise around
it (`candidates`). Some lose it again: the steps of a terraced surface (`terraces`), and turns that
repeat beside themselves as those of a tessellated limb, a fillet or a coarse cylinder do (`echo`). What
a designer drew gains one: chains that turn evenly, and what turns sharply on a part (`designed`).
Chains of candidates are kept if they are long or sure enough (`chains`), but not where a surer one is
too close (`crowds`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import NONE, BoolArray, FloatArray, IndexArray, IntArray
from .candidates import (
    BORDER,
    CROWDED,
    CURVED,
    ECHO,
    HARD,
    NOISE,
    SHORT,
    TERRACE,
    WEAK_TURN,
    Candidates,
    Ground,
    measure_candidates,
)
from .chains import count_chains, keep_chains
from .crowds import drop_acute
from .designed import find_designed, is_part, promote
from .dihedral import ANGLE_TOLERANCE, DihedralAngles, find_dihedral_angles, least_cosine
from .echo import drop_echoes, restore_facets
from .links import Segments, measure_segments
from .noise import noise_at_vertices
from .terraces import drop_terraces

__all__ = ["DROPPED", "Creases", "find_creases", "judge_edges", "least_turn"]

# Why an edge that turns far enough is no crease: the names that callers see.
DROPPED = {
    "noise": (NOISE,),
    "echo": (ECHO, CURVED),
    "terrace": (TERRACE,),
    "short": (SHORT,),
    "crowded": (CROWDED,),
}

# Dropping one of a crowd leaves loose ends, so chains are judged again, at most so often.
CROWD_ROUNDS = 2

# X (n, 4) with the target length in its last column, origin and twin (3 m,), vertex_halfedge (n,).
Surface = tuple[FloatArray, IndexArray, IndexArray, IndexArray]


class Creases(NamedTuple):
    """Feature edges, and the edges that turn far enough but are none."""

    is_feature: BoolArray  # (3 m,) the same on both half-edges of an edge; true on the boundary
    dropped: dict[str, IntArray]  # one half-edge of each, by the names in ``DROPPED``


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
    """Find and count the feature edges of a mesh.

    Parameters
    ----------
    X : (n, 4) float64
        The last column is the target length.
    origin, twin : (3 m,) int32
    vertex_halfedge : (n,) int32
    hard, angle, mean_edge, turns, parallel
        See `judge_edges`.

    Returns
    -------
    is_feature : (3 m,) bool
        The same on both half-edges of an edge; true on the boundary.
    counts : dict of int
        ``crease_edges``, feature edges without those on the boundary; ``chains``, the curves they form,
        passing straight through junctions; and of the edges that turn far enough under "auto",
        ``dropped_noise``, those that do not stand out of the noise, ``dropped_echo``, those whose turn
        repeats beside them, ``dropped_terrace``, steps of voxels, ``dropped_short``, those whose chain
        is too short or unsure, and ``dropped_crowded``, those that a surer crease runs close to.
    """
    surface = X, origin, twin, vertex_halfedge
    is_feature, dropped = judge_edges(surface, hard, angle, mean_edge, turns, parallel)
    edges = _one_of_each(is_feature, twin)
    is_inside = twin[edges] != NONE
    counts = {"crease_edges": int(is_inside.sum()), "chains": 0}
    counts |= {f"dropped_{name}": len(dropped.get(name, ())) for name in DROPPED}
    if counts["crease_edges"]:
        counts["chains"] = count_chains(measure_segments(X, origin, edges, mean_edge), is_inside)
    return is_feature, counts


def judge_edges(
    surface: Surface,
    hard: BoolArray,
    angle: float | str | None,
    mean_edge: float,
    turns: DihedralAngles | None = None,
    parallel: bool = False,
) -> Creases:
    """Tell which edges are features, and why others are none.

    Parameters
    ----------
    surface : X (n, 4), origin and twin (3 m,), vertex_halfedge (n,)
    hard : (3 m,) bool
        Edges that are features whatever their angle; the same on both half-edges. Boundary edges
        are without being named.
    angle : "auto", float or None
        The rule of this module; or all edges that turn by more than so many degrees; or none.
    mean_edge : float
        Mean length of the edges.
    turns : DihedralAngles, optional
        The edges that turn by `least_turn` of ``angle`` or more, where they are known.
    parallel : bool
    """
    X, origin, twin, _ = surface
    is_feature = hard | (twin == NONE)
    dropped: dict[str, IntArray] = {}
    if angle is not None:
        if turns is None:
            turns = find_dihedral_angles(X, origin, twin, least_turn(angle), parallel)
        found = turns.edges[~is_feature[turns.edges]]
        if angle != "auto":
            found = found[_cosines(turns.normals, twin, found) <= least_cosine(least_turn(angle))]
        else:
            rank = np.empty(0, np.int8)
            if len(found):
                rank = _judge(surface, turns, is_feature, found, mean_edge, parallel)
            dropped = {name: found[np.isin(rank, why)] for name, why in DROPPED.items()}
            found = found[rank > 0]
        is_feature[found] = True
        is_feature[twin[found]] = True
    return Creases(is_feature, dropped)


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


def _judge(
    surface: Surface,
    turns: DihedralAngles,
    is_hard: BoolArray,
    found: IntArray,
    mean_edge: float,
    parallel: bool,
) -> NDArray[np.int8]:
    """Return the class of each edge that is a crease, and the reason why the others are none."""
    X, origin, twin, _ = surface
    ground = Ground(X, origin, twin, turns.normals, is_hard)
    noise = noise_at_vertices(surface, turns, found, parallel)
    candidates = measure_candidates(ground, found, noise, parallel)
    fixed = _one_of_each(is_hard, twin)
    segments = measure_segments(X, origin, np.concatenate([fixed, found]), mean_edge)
    own = segments.after(len(fixed))
    drop_terraces(ground, candidates, own, mean_edge, parallel)
    drop_echoes(ground, candidates, parallel)
    designed = find_designed(candidates, own)
    on_part = is_part(candidates, own)
    if on_part:
        restore_facets(ground, candidates, parallel)
    promote(candidates, own, designed, on_part)
    is_border = twin[fixed] == NONE
    return _keep(segments, np.where(is_border, BORDER, HARD).astype(np.int8), candidates)


def _keep(segments: Segments, fixed: NDArray[np.int8], candidates: Candidates) -> NDArray[np.int8]:
    """Judge chains of fixed edges, which come first, and candidates; return the ranks of the latter."""
    rank = np.concatenate([fixed, candidates.rank])
    surest = np.full(len(fixed), np.inf)
    ratio = np.concatenate([surest, candidates.ratio])
    strength = np.concatenate([surest, candidates.ratio * candidates.turn])
    kept = keep_chains(segments, rank)
    for _ in range(CROWD_ROUNDS):
        if not drop_acute(segments, rank, ratio, strength, kept):
            break
        kept = keep_chains(segments, rank)
    rank[~kept & (rank > 0)] = SHORT
    return rank[len(fixed) :]
