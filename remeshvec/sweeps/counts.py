"""Meet a number of faces or vertices exactly: the last splits or collapses, where they hurt least."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import DEAD, NONE, FloatArray, IndexArray, Mesh
from ..mesh.edge_curves import is_locked, is_non_manifold
from ..operations.classify import REMOVED, EdgeFlags
from ..operations.collapse import CollapseLimits, collapse_short_edges
from ..operations.flip import FlipLimits, flip_edges
from ..operations.outcomes import COLLAPSED
from ..operations.relax import relax_vertices
from ..operations.split import split_edges
from .guard import Guard
from .plan import Count
from .work import Work

__all__ = ["count_elements", "meet_count"]

# A mesh that has so many more or fewer, as a share, is left alone: another length will be tried.
_REACH = 0.04

# What a step away from the ideal valences costs, in target lengths.
_VALENCE = 0.1

# Collapses may turn a normal by 45 degrees and make edges of 1.6 target lengths: few are made, and flips
# and rounds follow.
_COLLAPSES = CollapseLimits(1e9, 1.6, 0.7, 0.5, False)
_FLIPS = FlipLimits(0.5, True, False)

# Attempts to find as many edges as are wanted: guards refuse some, and neighbours wait.
_ATTEMPTS = 8

# Relaxations afterwards, where no rounds follow.
_RELAXATIONS = 3


def count_elements(mesh: Mesh, noun: str) -> int:
    """Count the faces or the vertices of a mesh."""
    alive = mesh.origin[::3] if noun == "faces" else mesh.vertex_halfedge
    return int(np.count_nonzero(alive != DEAD))


def meet_count(work: Work, guard: Guard) -> None:
    """Split or collapse as many edges of a compact mesh as are missing or too many; it stays compact.

    Each changes the vertices by one, and the faces by two.
    """
    count = work.plan.count
    if count is None or work.monitor.is_cancelled:
        return
    missing = _missing(work.mesh, count)
    if missing == 0 or abs(missing) * count.per_edge > _REACH * count.wanted:
        return
    if missing > 0:
        _split(work, count)
    for trial in guard.attempts(work, is_compact=True):
        if missing < 0:
            _collapse(trial, count)
        flip_edges(trial.mesh, trial.blocks, _FLIPS, trial.is_parallel)
        if not work.plan.recipe.rounds:
            for _ in range(_RELAXATIONS):
                relax_vertices(trial.mesh, trial.blocks, 0.0, trial.is_parallel)
    work.compact()


def _missing(mesh: Mesh, count: Count) -> int:
    """How many edges must be split, or, if negative, collapsed."""
    difference = count.wanted - count_elements(mesh, count.noun)
    return int(difference / count.per_edge)  # towards zero


def _split(work: Work, count: Count) -> None:
    """Split long edges, as few as possible with a face in common."""
    for _ in range(_ATTEMPTS):
        missing = _missing(work.mesh, count)
        if missing <= 0:
            return
        edges, length, excess = _candidates(work.mesh)
        cost = -length + _VALENCE * (np.abs(excess[:, 2:] + 1) - np.abs(excess[:, 2:])).sum(axis=1)
        chosen = _spread(work.mesh, edges, cost, missing)
        if not len(chosen):
            return
        work.put(split_edges(work.mesh, work.blocks, chosen, work.is_parallel))


def _collapse(work: Work, count: Count) -> None:
    """Collapse short edges until there are no more too many; where a guard refuses, other edges."""
    mesh = work.mesh
    refused = np.zeros(mesh.origin.size, np.bool_)
    for _ in range(_ATTEMPTS):
        missing = -_missing(mesh, count)
        edges, length, excess = _candidates(mesh)
        after = np.abs(excess[:, 0] + excess[:, 1] + 2) + np.abs(excess[:, 2:] - 1).sum(axis=1)
        cost = length + _VALENCE * (after - np.abs(excess).sum(axis=1))
        is_new = ~refused[edges]
        chosen = _spread(mesh, edges[is_new], cost[is_new], missing)
        if not len(chosen):
            return
        refused[chosen] = True
        mask = np.zeros(mesh.origin.size // 3, np.uint8)
        mask[mesh.origin[::3] == DEAD] = REMOVED
        np.bitwise_or.at(mask, chosen // 3, (8 << (chosen % 3)).astype(np.uint8))
        flags = EdgeFlags(mask, 0, 0, np.inf, _COLLAPSES.shortest)
        tally = collapse_short_edges(mesh, work.blocks, _COLLAPSES, work.is_parallel, flags)
        if tally[COLLAPSED] == missing:
            return


def _candidates(mesh: Mesh) -> tuple[IndexArray, FloatArray, FloatArray]:
    """List the inner edges that may change.

    Returns
    -------
    edges : (k,) int32
        The larger half-edge of each.
    length : (k,) float64
        In target lengths.
    excess : (k, 4) float64
        Valence less the ideal, of both ends and of both apexes.
    """
    h = np.flatnonzero((mesh.twin != NONE) & (mesh.origin != DEAD)).astype(np.int32)
    h = h[(mesh.twin[h] < h) & ~is_locked(mesh.curve[h]) & ~is_non_manifold(mesh.curve[h])]
    quad = _quads(mesh, h)
    a, b = mesh.X[quad[:, 0]], mesh.X[quad[:, 1]]
    length = np.linalg.norm(a[:, :3] - b[:, :3], axis=1) / (0.5 * (a[:, 3] + b[:, 3]))
    return h, length, mesh.valence_excess[quad].astype(np.float64)


def _quads(mesh: Mesh, h: IndexArray) -> IndexArray:
    """Both ends and both apexes of inner edges (k, 4)."""
    t = mesh.twin[h]
    apexes = (mesh.origin[g - g % 3 + (g + 2) % 3] for g in (h, t))
    return np.stack([mesh.origin[h], mesh.origin[t], *apexes], axis=1)


def _spread(mesh: Mesh, edges: IndexArray, cost: FloatArray, most: int) -> IndexArray:
    """Choose the cheapest edges, no two of which have a vertex of their quads in common."""
    order = np.argsort(cost, kind="stable")[: 64 * most]
    used = np.zeros(mesh.vertex_halfedge.size, np.bool_)
    chosen: list[int] = []
    for h, quad in zip(edges[order].tolist(), _quads(mesh, edges[order]), strict=True):
        if len(chosen) == most:
            break
        if not used[quad].any():
            used[quad] = True
            chosen.append(h)
    return np.array(chosen, np.int32)
