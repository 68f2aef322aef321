"""Creases of the input, found without a threshold that the caller must choose.

A crease is a turn across an edge that does not repeat beside it: a tessellated limb, a fillet or a
coarse cylinder has the same turn again one facet further (an echo), a crease has not. Edges that
turn far enough and stand out of the noise around them are classified, lose their class where they
echo (`_echo`), are linked to chains and kept if the chain is long or sure enough (`_chains`).
"""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import NONE, BoolArray, FloatArray, IndexArray, IntArray
from .candidates import (
    BORDER,
    CROWDED,
    CURVED,
    ECHO,
    HARD,
    NOISE,
    TERRACE,
    WEAK_TURN,
    Ground,
    measure_candidates,
)
from .chains import count_chains, keep_chains
from .crowds import drop_acute
from .designed import find_designed, is_part, promote
from .dihedral import ANGLE_TOLERANCE, DihedralAngles, find_dihedral_angles, least_cosine
from .echo import drop_echoes, restore_facets
from .links import measure_segments
from .noise import noise_at_vertices
from .terraces import drop_terraces

__all__ = ["find_creases", "least_turn"]

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
        segments = measure_segments(X, origin, edges, mean_edge)
        counts["chains"] = count_chains(segments, twin[edges] != NONE)
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
    ground = Ground(X, origin, twin, turns.normals, is_hard)
    noise = noise_at_vertices(mesh, turns, found, parallel)
    candidates = measure_candidates(ground, found, noise, parallel)
    rank = candidates.rank
    segments = measure_segments(X, origin, found, mean_edge)
    drop_terraces(ground, candidates, segments, mean_edge, parallel)
    drop_echoes(ground, candidates, parallel)
    designed = find_designed(candidates, segments)
    on_part = is_part(candidates, segments)
    if on_part:
        restore_facets(ground, candidates, parallel)
    promote(candidates, segments, designed, on_part)
    counts["dropped_noise"] = int(np.count_nonzero(rank == NOISE))
    counts["dropped_echo"] = int(np.count_nonzero((rank == ECHO) | (rank == CURVED)))
    counts["dropped_terrace"] = int(np.count_nonzero(rank == TERRACE))
    fixed = _one_of_each(is_hard, twin)
    edges = np.concatenate([fixed, found])
    hard = np.where(twin[fixed] == NONE, BORDER, HARD).astype(np.int8)
    ranks = np.concatenate([hard, rank])
    segments = measure_segments(X, origin, edges, mean_edge)
    strength = np.concatenate([np.full(len(fixed), np.inf), candidates.ratio * candidates.turn])
    is_safe = (ranks >= HARD) | (np.concatenate([np.full(len(fixed), np.inf), candidates.ratio]) >= 100)
    keep = keep_chains(segments, ranks)
    for _ in range(2):
        if not drop_acute(segments, ranks, strength, is_safe, keep):
            break
        keep = keep_chains(segments, ranks)
    counts["dropped_crowded"] = int(np.count_nonzero(ranks == CROWDED))
    keep = keep[len(fixed):]
    counts["dropped_short"] = int((~keep & (rank > 0)).sum())
    return candidates.edges[keep]
