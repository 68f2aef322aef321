"""Mend the few folds and turned faces that sweeps left: sweep around them, with ever shorter edges.

Most folds lie alone on a tip or a ridge that is thin beside L. More of the same often opens them, or
edges as short as the place needs; everything else stays as it is.
"""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import FloatArray, IndexArray, Mesh
from ..mesh.edge_curves import is_locked
from ..mesh.walk import ends_of
from ..operations.split import split_edges
from .finish import polish
from .flaws import FoldCheck, TurnedCheck
from .guard import Check, lazy_tree
from .holding import hold, let_go, rings_around
from .phases import collapse, flip, project, relax
from .plan import Sweep
from .work import Work

__all__ = ["mend_folds"]

# A round takes about a sixth of a call. With five, hardly more meshes are mended than with three; where
# more than so many vertices are at folds, hardly any (60 real meshes).
_ROUNDS = 3
_MOST = 40

# From the second round on, target lengths within so many rings of faces around a fold fall by a factor.
_SHORTER_RINGS = 2
_SHORTER = 0.7

# Rings that are free to move. Splits have made two of each by then, and no new vertex may be left out.
_RINGS = 2 * _SHORTER_RINGS


def mend_folds(work: Work, before: Mesh, sweep: Sweep, tolerated: FloatArray | None = None) -> None:
    """Sweep around new folds, and new faces without area or turned over; keep what lessens them.

    Parameters
    ----------
    work : Work
        With a compact mesh, which is replaced by a better one.
    before : Mesh
        Its flaws are not new.
    sweep : Sweep
        What a round does.
    tolerated : (k, 3) float64, optional
        See `FoldCheck`.
    """
    folds = FoldCheck(work.is_parallel, tolerated)
    folds.remember(before, lazy_tree(before, work.is_parallel))
    checks: list[Check] = [folds]
    if work.plan.recipe.project:
        checks.append(TurnedCheck(work.featured.reference.tree, work.is_parallel))
    flaws = _vertices(checks, work)
    for n in range(_ROUNDS):
        if not 0 < len(flaws) <= _MOST:
            break
        trial = work.trial()
        work.monitor.begin_sweep()
        if n > 0:
            _split_around(trial, flaws, sweep)
        _sweep_around(trial, _vertices(checks, trial), _RINGS + n, sweep)
        work.monitor.counts.pop()
        left = _vertices(checks, trial)
        if len(left) <= len(flaws):
            work.adopt(trial)
            flaws = left


def _vertices(checks: list[Check], work: Work) -> IndexArray:
    """Vertices at flaws."""
    tree = lazy_tree(work.mesh, work.is_parallel)
    found = [check.offenders(work.mesh, tree).vertices for check in checks]
    return np.unique(np.concatenate(found))


def _split_around(work: Work, vertices: IndexArray, sweep: Sweep) -> None:
    """Ask for shorter edges around vertices, and split those that are too long then, once."""
    mesh = work.mesh
    near = rings_around(mesh, vertices, _SHORTER_RINGS)
    mesh.X[near, 3] *= _SHORTER
    h = np.flatnonzero((mesh.twin < np.arange(len(mesh.twin))) & ~is_locked(mesh.curve))
    a, b = ends_of(mesh.origin, h)
    length = np.linalg.norm(mesh.X[a, :3] - mesh.X[b, :3], axis=1)
    is_long = length > sweep.split * 0.5 * (mesh.X[a, 3] + mesh.X[b, 3])
    edges = h[near[a] & near[b] & is_long].astype(np.int32)
    if len(edges):
        work.put(split_edges(mesh, work.blocks, edges, work.is_parallel))


def _sweep_around(work: Work, vertices: IndexArray, rings: int, sweep: Sweep) -> None:
    """Sweep over rings around vertices, without splits; the mesh is compact afterwards."""
    held = hold(work.mesh, ~rings_around(work.mesh, vertices, rings))
    work.flags = None
    for phase in (collapse, flip, relax, project):
        phase(work, sweep)
    polish(work)
    let_go(work.mesh, held)
    work.compact()
