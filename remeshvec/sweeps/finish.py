"""After the last sweep: even out, project, untangle, fit, and refine what a tolerance asks for."""

from __future__ import annotations

from math import cos, radians

import numpy as np

from ..core.vocabulary import CURVE, HELD, INNER, PINNED
from ..operations.fit import fit_vertices
from ..operations.flip import FlipLimits, flip_edges
from ..operations.project import project_vertices
from ..operations.split import split_edges
from ..operations.unfold import undo_folded_edges, undo_folds
from ..operations.untangle import approach_vertices, untangle_vertices
from ..reference.bvh import WALK_TRUST
from ..reference.non_manifold import non_manifold_copies
from ..sizing.target_lengths import bound_gradation
from .counts import meet_count
from .deviation import DeviationCheck, edges_to_refine
from .flaws import count_new_flaws
from .guard import Guard
from .plan import Adaptation
from .rounds import even_out
from .sheets import separate_sheets
from .work import Work

__all__ = ["finish", "has_finish", "measure_deviation"]

# How far a fit may move a vertex, as a share of the target length.
_FIT_REACH = 0.2

# Faces made for a tolerance are moved until their centroids, which are not where they are worst, and
# split until their samples keep these shares of it. Where more than this share of all faces would be
# split, the input is rougher than the tolerance, and splits would follow its own faces.
_CENTROID_SHARE = 0.84
_SAMPLE_SHARE = 1.0
_ROUGH = 0.05

# Rounds of moves that make the largest faces smaller; then of splits where chords are still too long,
# each of which takes a quarter off the error.
_EVENING_ROUNDS = 20
_REFINEMENTS = 3


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
    _refine(work, work.plan.adaptation)
    if count_new_flaws(before.mesh, work.mesh, False, work.is_parallel):
        work.adopt(before)


def _refine(work: Work, adaptation: Adaptation) -> None:
    """Bring faces within the tolerance, first by moving vertices, then by splits of the longest edge.

    A third of the squared length is the squared circumradius of an equilateral face.
    """
    tolerance, recipe = adaptation.tolerance, work.plan.recipe
    reference = work.featured.reference
    for _ in range(_EVENING_ROUNDS):
        if not approach_vertices(
            work.mesh,
            work.blocks,
            reference.tree,
            recipe.project,
            1.0 / 3.0,
            _CENTROID_SHARE * tolerance,
            work.is_parallel,
        ):
            break
    flips = FlipLimits(cos(radians(recipe.flip_normal)), False, True)
    for _ in range(_REFINEMENTS):
        parallel = work.is_parallel
        edges = edges_to_refine(work.mesh, work.featured, _SAMPLE_SHARE * tolerance, parallel)
        if not 0 < len(edges) <= _ROUGH * work.n_faces:
            break
        work.put(split_edges(work.mesh, work.blocks, edges, parallel))
        project_vertices(work.mesh, work.blocks, reference, WALK_TRUST, parallel)
        flip_edges(work.mesh, work.blocks, flips, parallel)


def measure_deviation(work: Work) -> dict[str, float]:
    """Measure how far the two surfaces are apart, in the caller's units, where a bound was asked for."""
    plan = work.plan
    bound = plan.max_deviation
    if bound is None:
        if plan.adaptation is None:
            return {}
        bound = plan.adaptation.tolerance
    with work.monitor.watch.time("deviation"):
        check = DeviationCheck(work.featured, bound, work.is_parallel)
        return {way: d / plan.scale for way, d in check.measure(work.mesh).items()}
