"""After the last sweep: meet a count, even out, project once more, untangle and fit."""

from __future__ import annotations

from math import cos, radians

import numpy as np

from ..operations.fit import fit_vertices
from ..operations.project import project_vertices
from ..operations.unfold import (
    restore_births,
    undo_folded_edges,
    undo_folds,
    undo_turned_faces,
)
from ..operations.untangle import untangle_vertices
from ..reference.bvh import WALK_TRUST
from ..reference.non_manifold import non_manifold_copies
from ..sizing.target_lengths import bound_gradation
from .counts import meet_count
from .deviation import measure_deviation
from .guard import Guard
from .rounds import even_out
from .sheets import separate_sheets
from .work import Work

__all__ = ["deviation_of", "finish", "has_finish"]

# How far a fit may move a vertex, as a share of the target length.
_FIT_REACH = 0.2


def has_finish(work: Work) -> bool:
    """Tell whether `finish` has something to do."""
    plan = work.plan
    recipe = plan.recipe
    moves = recipe.project or recipe.rounds or recipe.untangle_rounds or recipe.fit_rounds
    is_bounded = recipe.max_deviation is not None or plan.adaptation is not None
    return bool(
        moves
        or is_bounded
        or plan.count
        or work.varies
        or work.featured.on_non_manifold is not None
    )


def finish(work: Work, guard: Guard) -> None:
    """Bring a swept mesh into its last shape; it is compact afterwards."""
    watch = work.monitor.watch
    with watch.time("extract"):
        work.compact()
        meet_count(work, guard)
    even_out(work, guard)
    with watch.time("extract"):
        if work.featured.on_non_manifold is not None:
            work.put(separate_sheets(work.mesh, work.featured))
    with watch.time("finish"):
        for trial in guard.attempts(work, is_compact=True):
            polish(trial)
        if np.ptp(work.mesh.X[:, 3]) > 0.0:
            copies = non_manifold_copies(work.mesh, work.featured)
            bound_gradation(work.mesh, work.plan.gradation, copies)


def polish(work: Work) -> None:
    """Move vertices for the last time: onto the input, out of bad triangles, to a closer fit."""
    mesh, blocks, recipe = work.mesh, work.blocks, work.plan.recipe
    reference, parallel = work.featured.reference, work.is_parallel
    before, births = mesh.X.copy(), mesh.birth.copy()
    if recipe.project:
        project_vertices(mesh, blocks, reference, WALK_TRUST, parallel)
        undo_folds(mesh, blocks, before, parallel)
    if recipe.untangle_rounds:
        cosine = cos(radians(recipe.untangle_angle))
        untangle_vertices(
            mesh,
            blocks,
            reference.tree,
            recipe.project,
            cosine,
            recipe.untangle_rounds,
            parallel,
        )
    for _ in range(recipe.fit_rounds):
        fit_vertices(mesh, blocks, reference.tree, _FIT_REACH, parallel)
    n_undone = undo_folded_edges(mesh, blocks, before, parallel)
    restore_births(mesh, before, births, n_undone)
    if recipe.project:
        n_undone = undo_turned_faces(mesh, blocks, before, reference.tree, parallel)
        restore_births(mesh, before, births, n_undone)


def deviation_of(work: Work) -> dict[str, float]:
    """Measure how far the two surfaces are apart, in the caller's units, where a bound was asked for."""
    plan = work.plan
    if plan.max_deviation is None and plan.adaptation is None:
        return {}
    with work.monitor.watch.time("deviation"):
        found = measure_deviation(work.mesh, work.featured, work.is_parallel)
        return {way: float(d / plan.scale) for way, d in found.items()}
