"""Lloyd rounds: what evens out the areas, after the last sweep and before the finish."""

from __future__ import annotations

from math import cos, radians, tan

import numpy as np

from ..core.vocabulary import FloatArray
from ..operations.flip import FlipLimits, flip_edges
from ..operations.frames import FRAME_SIZE, measure_frames
from ..operations.lloyd import Pace, run_lloyd_round
from ..operations.project import project_vertices
from ..operations.slide import slide_vertices
from ..operations.unfold import undo_folded_edges, undo_folds
from ..reference.bvh import WALK_TRUST
from .guard import Guard
from .phases import refresh_lengths
from .work import Work

__all__ = ["even_out"]

# Rounds between two passes of flips, and between two projections with new frames. Frames that are
# frozen for 4 to 12 rounds give the same, and cost more than two rounds.
_FLIP_EVERY = 4
_PROJECT_EVERY = 8

# Stiffness of the frames; a round moves vertices less than a relaxation does, but there are many.
_STIFFNESS = 400.0

# Longest step of a round, in target lengths.
_REACH = 0.05


def even_out(work: Work, guard: Guard) -> None:
    """Run the Lloyd rounds of the recipe on a compact mesh; a guard may try them as it tries a sweep."""
    if work.plan.recipe.rounds == 0 or work.monitor.is_cancelled:
        return
    with work.monitor.watch.time("even out"):
        for trial in guard.attempts(work, is_compact=True):
            _run_rounds(trial)


def _run_rounds(work: Work) -> None:
    """Move vertices towards the centroids of their cells; flip and project from time to time."""
    recipe, mesh, parallel = work.plan.recipe, work.mesh, work.is_parallel
    pace = Pace(recipe.round_gain, recipe.round_momentum, _REACH)
    velocity = np.zeros((len(mesh.X), 3))
    frames = np.empty((len(mesh.X), FRAME_SIZE))
    before = mesh.X
    for n in range(recipe.rounds):
        if n % _FLIP_EVERY == 0:
            _flip(work)
            before = mesh.X.copy()
        if n % _PROJECT_EVERY == 0:
            measure_frames(mesh, work.blocks, _STIFFNESS, frames, parallel)
        slide_vertices(mesh, work.blocks, work.featured.reference, parallel)
        run_lloyd_round(mesh, work.blocks, frames, velocity, pace, work.varies, parallel)
        is_last = n + 1 == recipe.rounds
        if is_last or (n + 1) % _PROJECT_EVERY == 0:
            _project(work)
        if is_last or (n + 1) % _FLIP_EVERY == 0:
            _unfold(work, before, velocity)


def _flip(work: Work) -> None:
    """Flip edges where the angles opposite outweigh the valences, or the other way round."""
    recipe = work.plan.recipe
    limits = FlipLimits(
        cos(radians(recipe.flip_normal)),
        True,
        recipe.sliver_check,
        tan(radians(recipe.trade_angle)),
    )
    flip_edges(work.mesh, work.blocks, limits, work.is_parallel)


def _project(work: Work) -> None:
    """Put vertices back onto the input, and read target lengths there."""
    if work.plan.recipe.project:
        reference = work.featured.reference
        project_vertices(work.mesh, work.blocks, reference, WALK_TRUST, work.is_parallel)
    refresh_lengths(work)


def _unfold(work: Work, before: FloatArray, velocity: FloatArray) -> None:
    """Take back moves that fold, and stop the vertices that made them."""
    mesh, blocks = work.mesh, work.blocks
    count = undo_folds(mesh, blocks, before, work.is_parallel)
    count += undo_folded_edges(mesh, blocks, before, work.is_parallel)
    if count:
        velocity[(mesh.X[:, :3] == before[:, :3]).all(axis=1)] = 0.0
