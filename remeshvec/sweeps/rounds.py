"""Lloyd rounds: what evens out the areas, after the last sweep and before the finish."""

from __future__ import annotations

from math import cos, inf, radians, tan

import numpy as np

from ..core.vocabulary import FloatArray, IndexArray
from ..input.recipe import Rounds
from ..operations.flip import FlipLimits, flip_edges
from ..operations.frames import FRAME_SIZE, measure_frames
from ..operations.lloyd import Pace, run_lloyd_round, turn_velocities
from ..operations.project import project_vertices
from ..operations.slide import slide_vertices
from ..operations.spread import area_spread
from ..operations.unfold import restore_births, undo_folded_edges
from ..reference.bvh import WALK_TRUST
from .guard import Guard
from .phases import refresh_lengths
from .work import Work

__all__ = ["even_out", "run_rounds"]

# Rounds between two passes of flips; 4 cost .08 of the area error, in percent.
_FLIP_EVERY = 2

# Rounds between two projections with new frames: frames may be as old as this.
_PROJECT_EVERY = 10

# Longest step of a round, in target lengths. Without a bound rounds on thin parts blow up; between .03
# and .08 it changes nothing.
_REACH = 0.05

# Areas are more even where their spread has fallen by this share. Between two looks it also rises, by up
# to .4 percent.
_PROGRESS = 0.01


class Settling:
    """When to stop: once the areas have not become more even for some rounds.

    Every look at the mesh asks whether the spread of the areas lies a share below a mark, which then
    moves there. As long as the spread falls, however unsteadily, the rounds go on.
    """

    def __init__(self, patience: int) -> None:
        self.patience = patience  # rounds; 0: for ever
        self._mark, self._since = inf, 0

    def has_settled(self, rounds: int, spread: float) -> bool:
        """Look at the spread after so many rounds."""
        if spread < (1.0 - _PROGRESS) * self._mark:
            self._mark, self._since = spread, rounds
        return 0 < self.patience <= rounds - self._since


def even_out(work: Work, guard: Guard) -> None:
    """Run the Lloyd rounds of the recipe on a compact mesh; a guard may try them as it tries a sweep."""
    if not work.plan.recipe.rounds or work.monitor.is_cancelled:
        return
    with work.monitor.watch.time("even out"):
        for trial in guard.attempts(work, is_compact=True):
            for rounds in work.plan.recipe.rounds:
                run_rounds(trial, rounds)


def run_rounds(work: Work, rounds: Rounds, flips: bool = True) -> None:
    """Move vertices towards the centroids of their cells; flip and project from time to time.

    With patience, they end where the areas have settled, which is looked for at every projection.
    Without flips, a vertex depends on no others than those within as many rings as there are rounds,
    and three more.
    """
    mesh, blocks, parallel = work.mesh, work.blocks, work.is_parallel
    pace = Pace(rounds.gain, rounds.momentum, _REACH)
    velocity = np.zeros((len(mesh.X), 3))
    frames = np.empty((len(mesh.X), FRAME_SIZE))
    settling = Settling(rounds.patience)
    for first in range(0, rounds.number, _PROJECT_EVERY):
        if work.monitor.is_cancelled or _has_settled(work, settling, first):
            return
        start, births = mesh.X.copy(), mesh.birth.copy()
        measure_frames(mesh, blocks, rounds.stiffness, frames, parallel)
        turn_velocities(mesh, blocks, frames, velocity, parallel)
        for n in range(first, min(first + _PROJECT_EVERY, rounds.number)):
            if flips and n % _FLIP_EVERY == 0:
                _flip(work, rounds)
            slide_vertices(mesh, blocks, work.featured.reference, parallel)
            run_lloyd_round(mesh, blocks, frames, velocity, pace, work.varies, parallel)
        _project(work)
        _unfold(work, start, births, velocity)
        work.monitor.report("even out")


def _has_settled(work: Work, settling: Settling, rounds: int) -> bool:
    if not settling.patience:
        return False
    return settling.has_settled(rounds, area_spread(work.mesh, work.blocks, work.is_parallel))


def _flip(work: Work, rounds: Rounds) -> None:
    """Flip edges where the angles opposite outweigh the valences, or the other way round."""
    recipe = work.plan.recipe
    cosine, trade = cos(radians(recipe.flip_normal)), tan(radians(rounds.trade_angle))
    limits = FlipLimits(cosine, True, recipe.sliver_check, trade)
    flip_edges(work.mesh, work.blocks, limits, work.is_parallel)


def _project(work: Work) -> None:
    """Put vertices back onto the input, and read target lengths there."""
    if work.plan.recipe.project:
        reference = work.featured.reference
        project_vertices(work.mesh, work.blocks, reference, WALK_TRUST, work.is_parallel)
    refresh_lengths(work)


def _unfold(work: Work, before: FloatArray, births: IndexArray, velocity: FloatArray) -> None:
    """Take back moves that folded an edge, and stop the vertices that made them."""
    n_undone = undo_folded_edges(work.mesh, work.blocks, before, work.is_parallel)
    restore_births(work.mesh, before, births, n_undone)
    if n_undone:
        velocity[(work.mesh.X[:, :3] == before[:, :3]).all(axis=1)] = 0.0
