"""The sweeps of one call and what comes after them: split, collapse, flip, relax, project; finish."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import cos, radians
from typing import Any, NamedTuple

import numpy as np

from ..core.stopwatch import Stopwatch
from ..core.vocabulary import CURVE, DEAD, FIXED, HELD, INNER, PINNED, Blocks, FloatArray, Mesh
from ..input.options import Options
from ..mesh.blocks import make_blocks
from ..operations.classify import EdgeFlags, classify_edges
from ..operations.collapse import CollapseLimits, collapse_short_edges
from ..operations.fit import fit_vertices
from ..operations.flip import FlipLimits, flip_edges
from ..operations.project import project_vertices, read_lengths
from ..operations.relax import relax_vertices
from ..operations.siblings import collapse_siblings
from ..operations.slide import slide_vertices
from ..operations.split import MAX_ROUNDS, SPARE, compact, split_edges, split_long_edges
from ..operations.unfold import undo_folds
from ..operations.untangle import approach_vertices, untangle_vertices
from ..reference.build import FeaturedReference
from ..reference.non_manifold import find_non_manifold_edges, non_manifold_copies
from ..sizing.target_lengths import bound_gradation
from .deviation import DeviationGuard, edges_to_refine, shortened_lengths
from .sheets import separate_sheets

__all__ = ["Callback", "Sweeps"]

Callback = Callable[[int, str, int], Any]

# Below this a parallel region costs more than it saves when another process holds a core.
_PARALLEL_FACES = 50_000

# Vertices that a walk brings this close to the input, as a share of the target length, are not checked
# against the whole of their patch.
_PROJECTION_TRUST = 0.05

# How far a fit may move a vertex, likewise.
_FIT_REACH = 0.2

# Times that a sweep is tried with more of the mesh held, before it is left out.
_ATTEMPTS = 8


# Faces made for a tolerance are moved until their centroids, which are not where they are worst, and
# split until their samples keep these shares of it. Where more than this share of all faces would be
# split, the input is rougher than the tolerance, and splits would follow its own faces.
_CENTROID_SHARE = 0.84
_SAMPLE_SHARE = 1.0
_ROUGH = 0.05

# Collapses leave holes. Above this share of the faces they are closed, because every loop reads them.
_SPARSE = 1.0 / 3.0

# Sweeps, counted from the last one as 1, after which lengths are compared with what they led to.
_FEEDBACK = (7, 5, 3)

# Rounds of moves that make the largest faces smaller; then of splits where chords are still too long,
# each of which takes a quarter off the error.
_EVENING_ROUNDS = 20
_REFINEMENTS = 3

# So many sweeps that split and collapse about as many edges, and below this share of all, go in circles.
_CYCLE = 4
_CALM = 0.05


class _Changed(NamedTuple):
    """A mesh after some phases."""

    mesh: Mesh
    blocks: Blocks
    # Root mean square of the moves of all vertices, in target lengths. Their maximum never comes down:
    # wherever a single edge is flipped, vertices move.
    step: float


class Sweeps:
    """The sweeps of one call: options in, counts and seconds out."""

    def __init__(
        self, options: Options, watch: Stopwatch, may_run: bool, callback: Callback | None
    ) -> None:
        self.options = options
        self.watch = watch
        self.may_run = may_run
        self.callback = callback
        self.scale = 1.0  # of the frame that meshes come in
        # Where lengths follow from the curvature: the largest distance of a chord, the shortest length,
        # and what bounds the growth of lengths on the input.
        self.gradation = np.inf
        self.tolerance: float | None = None
        self.shortest = 0.0
        self.limit_lengths: Callable[[FloatArray], FloatArray] = lambda lengths: lengths
        self.guard: DeviationGuard | None = None
        self.deviation: dict[str, float] = {}
        self.is_calm = False
        self.varies = False  # target lengths do
        self.counts: list[dict[str, int]] = []
        self.stop = "all sweeps done"

    def is_parallel(self, n_faces: int) -> bool:
        """Tell whether a mesh of so many faces is worth more than one thread."""
        return self.may_run and n_faces >= _PARALLEL_FACES

    def run(self, mesh: Mesh, featured: FeaturedReference) -> Mesh:
        """Run all sweeps, or until little changes, or until the callback ends them."""
        blocks = make_blocks(mesh)
        self.varies = varies = bool(np.ptp(mesh.X[:, 3]) > 0.0)
        self.counts = []
        self.is_calm = False
        self.guard = self._make_guard(mesh, featured)
        for sweep in range(self.options.iterations):
            factor = self._split_factor(mesh, sweep)
            self.counts.append({})
            flags: EdgeFlags | None
            mesh, blocks, flags = self._split(mesh, blocks, featured, sweep, factor)
            if self._is_cancelled(sweep, "split"):
                break
            if self.guard is not None:
                mesh = compact(mesh, blocks, self.is_parallel(mesh.origin.size // 3))
                blocks, flags = make_blocks(mesh), None
            mesh, blocks, step = self._guarded(
                mesh,
                blocks,
                partial(self._change, featured=featured, sweep=sweep, varies=varies, flags=flags),
            )
            if self.stop == "cancelled" or self._has_converged(mesh, step):
                break
            if self.tolerance is not None and self.options.iterations - sweep in _FEEDBACK:
                mesh = compact(mesh, blocks, self.is_parallel(mesh.origin.size // 3))
                blocks = make_blocks(mesh)
                self._shorten(mesh, featured, self.tolerance)
        return mesh

    def _shorten(self, mesh: Mesh, featured: FeaturedReference, tolerance: float) -> None:
        """Shorten target lengths where faces made for them lie too far from the input."""
        with self.watch.time("deviation"):
            parallel = self.is_parallel(len(mesh.origin) // 3)
            lengths = shortened_lengths(mesh, featured, tolerance, parallel)
            X = featured.reference.X
            old = X[:, 3].copy()
            X[:, 3] = self.limit_lengths(np.maximum(lengths, np.minimum(old, self.shortest)))
            # Fixed vertices keep their length, which may be that of an edge that must not be split.
            v = np.flatnonzero(mesh.kind == FIXED)
            at = featured.reference.origin[mesh.birth[v]]
            mesh.X[v, 3] = np.where(mesh.X[v, 3] == old[at], X[at, 3], mesh.X[v, 3])

    def _split_factor(self, mesh: Mesh, sweep: int) -> float:
        """Factor above which edges are split, from now on.

        Once all that is left is edges that are split and collapsed again and again, because their
        place has room for neither one nor two, those stay whose halves would soon be collapsed.
        """
        done = [counts["split"] + counts["collapse"] for counts in self.counts[-_CYCLE:]]
        if len(done) == _CYCLE and min(done) > 0.7 * max(done):
            edges = 1.5 * np.count_nonzero(mesh.origin[::3] != DEAD)
            self.is_calm |= done[-1] < max(_CALM * edges, 10.0)
        factor = self.options.split[sweep]
        return max(factor, 2.5 * self.options.collapse[sweep]) if self.is_calm else factor

    def _make_guard(self, mesh: Mesh, featured: FeaturedReference) -> DeviationGuard | None:
        if self.options.max_deviation is None:
            return None
        distance = self.options.max_deviation * self.scale
        return DeviationGuard(featured, distance, self.is_parallel(mesh.origin.size // 3))

    def _guarded(
        self, mesh: Mesh, blocks: Blocks, change: Callable[[Mesh, Blocks], _Changed]
    ) -> _Changed:
        """Change a mesh; where that leads too far from the input, hold the mesh there and try again."""
        if self.guard is None:
            return change(mesh, blocks)
        with self.watch.time("deviation"):
            self.guard.remember(mesh)
        counts = self.counts[-1].copy()
        for attempt in range(_ATTEMPTS):
            self.counts[-1] = counts.copy()
            trial = change(mesh.copy(), blocks)
            with self.watch.time("deviation"):
                offenders = self.guard.offenders(trial.mesh)
                if not len(offenders):
                    self.guard.release(trial.mesh)
                    return trial
                self.guard.hold(mesh, offenders, attempt)
        self.guard.release(mesh)
        self.counts[-1] = counts | {"collapse": 0, "flip": 0}
        return _Changed(mesh, blocks, np.inf)

    def _change(
        self,
        mesh: Mesh,
        blocks: Blocks,
        featured: FeaturedReference,
        sweep: int,
        varies: bool,
        flags: EdgeFlags | None,
    ) -> _Changed:
        """Run the phases that change the mesh in place."""
        mesh, blocks = self._connect(mesh, blocks, featured, sweep, flags)
        if self.stop == "cancelled":
            return _Changed(mesh, blocks, np.inf)
        before = mesh.X[:, :3].copy() if self.options.tol is not None else None
        self._move(mesh, blocks, featured, sweep, varies)
        self._is_cancelled(sweep, "relax")
        if before is None:
            return _Changed(mesh, blocks, np.inf)
        alive = mesh.vertex_halfedge != DEAD
        move = mesh.X[alive, :3] - before[alive]
        step = float(np.sqrt(((move * move).sum(axis=1) / mesh.X[alive, 3] ** 2).mean()))
        return _Changed(mesh, blocks, step)

    def _split(
        self, mesh: Mesh, blocks: Blocks, featured: FeaturedReference, sweep: int, factor: float
    ) -> tuple[Mesh, Blocks, EdgeFlags]:
        """Split by rounds until no edge is too long; returns what the last one measured too."""
        count = 0
        with self.watch.time("split"):
            for _ in range(MAX_ROUNDS):
                parallel = self.is_parallel(mesh.origin.size // 3)
                flags = classify_edges(mesh, blocks, factor, self.options.collapse[sweep], parallel)
                siblings = (
                    None if featured.on_non_manifold is None else find_non_manifold_edges(mesh)
                )
                refined, n_split = split_long_edges(mesh, blocks, factor, parallel, siblings, flags)
                count += n_split
                if refined is mesh:
                    flags = flags._replace(n_gone=flags.n_gone - 2 * n_split)
                    break
                mesh, blocks = refined, make_blocks(refined)
            else:
                flags = classify_edges(mesh, blocks, factor, self.options.collapse[sweep], parallel)
        self.counts[-1]["split"] = count
        return mesh, blocks, flags

    def _connect(
        self,
        mesh: Mesh,
        blocks: Blocks,
        featured: FeaturedReference,
        sweep: int,
        flags: EdgeFlags | None,
    ) -> tuple[Mesh, Blocks]:
        """Collapse and flip."""
        options = self.options
        parallel = self.is_parallel(mesh.origin.size // 3)
        limits = CollapseLimits(
            options.collapse[sweep],
            options.split[sweep],
            options.foldover_cosine,
            options.quadric_reach,
            options.sliver_check,
        )
        with self.watch.time("collapse"):
            tally = collapse_short_edges(mesh, blocks, limits, parallel, flags)
            self.counts[-1]["collapse"] = int(tally[0])
            if featured.on_non_manifold is not None:
                self.counts[-1]["collapse"] += collapse_siblings(
                    mesh, *find_non_manifold_edges(mesh), limits
                )
        if self._is_cancelled(sweep, "collapse"):
            return mesh, blocks
        n_faces = mesh.origin.size // 3
        with self.watch.time("collapse"):
            # What the guard has seen must keep its numbers.
            gone = 0 if flags is None else flags.n_gone + 2 * self.counts[-1]["collapse"]
            if gone > _SPARSE * n_faces and self.guard is None:
                mesh = compact(mesh, blocks, parallel, SPARE)
                blocks = make_blocks(mesh)
                parallel = self.is_parallel(mesh.origin.size // 3)
        flips = FlipLimits(
            cos(radians(options.flip_normal)), options.delaunay_ties, options.sliver_check
        )
        with self.watch.time("flip"):
            tally = flip_edges(mesh, blocks, flips, parallel, options.flip_passes)
            self.counts[-1]["flip"] = int(tally[0])
        self._is_cancelled(sweep, "flip")
        return mesh, blocks

    def _move(
        self, mesh: Mesh, blocks: Blocks, featured: FeaturedReference, sweep: int, varies: bool
    ) -> None:
        """Relax and project."""
        options = self.options
        left = options.iterations - sweep
        parallel = self.is_parallel(mesh.origin.size // 3)
        before = mesh.X.copy() if featured.has_curves else None
        with self.watch.time("relax"):
            for _ in range(options.last_relaxations if left == 1 else 1):
                slide_vertices(mesh, blocks, featured.reference, parallel)
                relax_vertices(mesh, blocks, options.stiffness, parallel)
        with self.watch.time("project"):
            must = self.guard is not None or options.tol is not None
            if options.project and (must or left <= options.projected_sweeps):
                project_vertices(mesh, blocks, featured.reference, _PROJECTION_TRUST, parallel)
            if before is not None:
                undo_folds(mesh, blocks, before, parallel)
            if varies:
                read_lengths(mesh, blocks, featured.reference, parallel)
                bound_gradation(mesh, self.gradation, non_manifold_copies(mesh, featured))

    def has_more(self, featured: FeaturedReference) -> bool:
        """Tell whether something is left for `finish`."""
        options = self.options
        is_guarded = self.guard is not None or self.tolerance is not None
        moves = options.project or options.untangle_rounds or options.fit_rounds
        return bool(moves or is_guarded or self.varies or featured.on_non_manifold is not None)

    def finish(self, mesh: Mesh, featured: FeaturedReference) -> Mesh:
        """Project for the last time, untangle, fit; returns a compact mesh."""
        parallel = self.is_parallel(mesh.origin.size // 3)
        with self.watch.time("extract"):
            mesh = compact(mesh, make_blocks(mesh), parallel)
            mesh.kind[mesh.kind == HELD] = INNER
            mesh.kind[mesh.kind == PINNED] = CURVE
            if featured.on_non_manifold is not None:
                mesh = separate_sheets(mesh, featured)
            blocks = make_blocks(mesh)
        with self.watch.time("finish"):
            mesh, _, _ = self._guarded(
                mesh, blocks, partial(self._polish, featured=featured, parallel=parallel)
            )
            if self.tolerance is not None:
                mesh = self._refine(mesh, featured, self.tolerance)
            if np.ptp(mesh.X[:, 3]) > 0.0:
                bound_gradation(mesh, self.gradation, non_manifold_copies(mesh, featured))
        guard = self.guard
        if guard is None and self.tolerance is not None:
            guard = DeviationGuard(featured, self.tolerance, parallel)
        if guard is not None:
            with self.watch.time("deviation"):
                measured = guard.measure(mesh)
                self.deviation = {way: d / self.scale for way, d in measured.items()}
        return mesh

    def _polish(
        self, mesh: Mesh, blocks: Blocks, featured: FeaturedReference, parallel: bool
    ) -> _Changed:
        """Move vertices for the last time."""
        options, reference = self.options, featured.reference
        if options.project:
            before = mesh.X.copy()
            project_vertices(mesh, blocks, reference, _PROJECTION_TRUST, parallel)
            undo_folds(mesh, blocks, before, parallel)
        if options.untangle_rounds:
            cosine = cos(radians(options.untangle_angle))
            rounds = options.untangle_rounds
            untangle_vertices(
                mesh, blocks, reference.tree, options.project, cosine, rounds, parallel
            )
        for _ in range(options.fit_rounds):
            fit_vertices(mesh, blocks, reference.tree, _FIT_REACH, parallel)
        return _Changed(mesh, blocks, 0.0)

    def _refine(self, mesh: Mesh, featured: FeaturedReference, tolerance: float) -> Mesh:
        """Bring all faces within a tolerance of the input.

        First by moving vertices: a third of the squared length is the squared circumradius of an
        equilateral face. Then by splits of the longest edge.
        """
        parallel = self.is_parallel(len(mesh.origin) // 3)
        blocks, tree = make_blocks(mesh), featured.reference.tree
        for _ in range(_EVENING_ROUNDS):
            if not approach_vertices(
                mesh,
                blocks,
                tree,
                self.options.project,
                1.0 / 3.0,
                _CENTROID_SHARE * tolerance,
                parallel,
            ):
                break
        for _ in range(_REFINEMENTS):
            parallel = self.is_parallel(len(mesh.origin) // 3)
            edges = edges_to_refine(mesh, featured, _SAMPLE_SHARE * tolerance, parallel)
            if not 0 < len(edges) <= _ROUGH * len(mesh.origin) / 3:
                break
            mesh = split_edges(mesh, make_blocks(mesh), edges, parallel)
            blocks = make_blocks(mesh)
            project_vertices(mesh, blocks, featured.reference, _PROJECTION_TRUST, parallel)
            flips = FlipLimits(cos(radians(self.options.flip_normal)), False, True)
            flip_edges(mesh, blocks, flips, parallel)
        return mesh

    def _has_converged(self, mesh: Mesh, step: float) -> bool:
        """Tell whether a sweep changed few edges and hardly moved the vertices."""
        tol = self.options.tol
        if tol is None or step > tol:
            return False
        n_edges = 1.5 * np.count_nonzero(mesh.origin[::3] != DEAD)
        if sum(self.counts[-1].values()) > tol * n_edges:
            return False
        self.stop = (
            f"converged (tol): the last sweep changed less than {tol:g} of the edges and moved "
            f"vertices by less than {tol:g} L"
        )
        return True

    def _is_cancelled(self, sweep: int, phase: str) -> bool:
        if self.callback is None:
            return False
        if self.callback(sweep, phase, self.counts[-1].get(phase, 0)) is False:
            self.stop = "cancelled"
        return self.stop == "cancelled"
