"""After the last sweep: even out, project, untangle, fit, and refine what a tolerance asks for."""

from __future__ import annotations

from math import cos, radians

import numpy as np

from ..core.vocabulary import CURVE, HELD, INNER, PINNED
from ..input.recipe import Rounds
from ..operations.fit import fit_vertices
from ..operations.project import project_vertices
from ..operations.split import split_edges
from ..operations.unfold import undo_folded_edges, undo_folds
from ..operations.untangle import untangle_vertices
from ..reference.bvh import WALK_TRUST
from ..reference.non_manifold import non_manifold_copies
from ..sizing.target_lengths import bound_gradation
from .counts import meet_count
from .deviation import edges_to_refine, measure_deviation
from .flaws import count_new_flaws
from .guard import Guard
from .rounds import even_out, run_rounds
from .sheets import separate_sheets
from .work import Work

__all__ = ["deviation_of", "finish", "has_finish"]

# How far a fit may move a vertex, as a share of the target length.
_FIT_REACH = 0.2

# Splits that bring faces within the tolerance of adaptive lengths; each takes a quarter off the error.
# Where more than this share of all faces would be split, the input is rougher than the tolerance, and
# splits would follow its own faces.
# Faces that are off by a tenth more than the tolerance are left: to split them too takes 10 % more faces.
_REFINEMENTS = 3
_SPARED = 1.1
_ROUGH = 0.05

# Rounds after each: few, because only the surroundings of the splits are uneven.
_ROUNDS = Rounds(10)


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
        _let_go(work)
        if work.featured.on_non_manifold is not None:
            work.put(separate_sheets(work.mesh, work.featured))
    with watch.time("finish"):
        for trial in guard.attempts(work, is_compact=True):
            polish(trial)
        refine(work)
        if np.ptp(work.mesh.X[:, 3]) > 0.0:
            copies = non_manifold_copies(work.mesh, work.featured)
            bound_gradation(work.mesh, work.plan.gradation, copies)


def _let_go(work: Work) -> None:
    """Let vertices move again that were held for the sweeps."""
    kind = work.mesh.kind
    kind[kind == HELD] = INNER
    kind[kind == PINNED] = CURVE


def polish(work: Work) -> None:
    """Move vertices for the last time: onto the input, out of bad triangles, to a closer fit."""
    mesh, blocks, recipe = work.mesh, work.blocks, work.plan.recipe
    reference, parallel = work.featured.reference, work.is_parallel
    before = mesh.X.copy()
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
    undo_folded_edges(mesh, blocks, before, parallel)


def refine(work: Work) -> None:
    """Bring all faces within the tolerance of adaptive lengths; nothing else asks for this.

    Where that would make folds, faces stay as they are.
    """
    if work.plan.adaptation is None:
        return
    before = work.trial()
    _refine(work, work.plan.adaptation.tolerance)
    if count_new_flaws(before.mesh, work.mesh, False, work.is_parallel):
        work.adopt(before)


def _refine(work: Work, tolerance: float) -> None:
    """Split the longest edge of faces that are off; rounds and the polish follow, so angles stay good.

    To move the vertices of such faces instead took most of the time of a call, and made slivers.
    """
    for _ in range(_REFINEMENTS):
        limit = _SPARED * tolerance
        edges = edges_to_refine(work.mesh, work.featured, limit, work.is_parallel)
        if not 0 < len(edges) <= _ROUGH * work.n_faces:
            break
        work.put(split_edges(work.mesh, work.blocks, edges, work.is_parallel))
        run_rounds(work, _ROUNDS)
        polish(work)


def deviation_of(work: Work) -> dict[str, float]:
    """Measure how far the two surfaces are apart, in the caller's units, where a bound was asked for."""
    plan = work.plan
    if plan.max_deviation is None and plan.adaptation is None:
        return {}
    with work.monitor.watch.time("deviation"):
        found = measure_deviation(work.mesh, work.featured, work.is_parallel)
        return {way: float(d / plan.scale) for way, d in found.items()}
