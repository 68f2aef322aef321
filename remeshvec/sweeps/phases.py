"""The five phases of a sweep, as the loop calls them: ``phase(work, sweep)`` changes the work.

Each hands the mesh to its kernels in `operations`, and keeps the counts. What belongs to a phase besides
its kernel is here: siblings on non-manifold edges, room for later splits, curves, lengths that vary.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps

import numpy as np

from ..core.vocabulary import DEAD, FloatArray, Mesh
from ..errors import OptionError
from ..operations.classify import EdgeFlags, classify_edges
from ..operations.collapse import collapse_short_edges
from ..operations.flip import flip_edges
from ..operations.project import project_vertices, read_lengths
from ..operations.relax import relax_vertices
from ..operations.siblings import collapse_siblings
from ..operations.slide import slide_vertices
from ..operations.split import MAX_ROUNDS, SPARE, split_long_edges
from ..operations.unfold import undo_folded_edges, undo_folds
from ..reference.bvh import WALK_TRUST
from ..reference.non_manifold import find_non_manifold_edges, non_manifold_copies
from ..sizing.target_lengths import bound_gradation
from .plan import Sweep
from .work import Work

__all__ = ["collapse", "flip", "project", "refresh_lengths", "relax", "split"]

Phase = Callable[[Work, Sweep], None]

# Above this share of dead faces the holes are closed, because every loop reads them.
_SPARSE = 1.0 / 3.0

# So many sweeps that split and collapse about as many edges, and below this share of all, go in circles.
_CYCLE = 4
_CALM = 0.05


def _phase(*, reports_as: str | None) -> Callable[[Phase], Phase]:
    """Time a phase, tell the callback afterwards, and leave it out once the call is cancelled."""

    def decorate(run: Phase) -> Phase:
        @wraps(run)
        def timed(work: Work, sweep: Sweep) -> None:
            if work.monitor.is_cancelled:
                return
            with work.monitor.watch.time(run.__name__):
                run(work, sweep)
            if reports_as is not None:
                work.monitor.report(reports_as)

        return timed

    return decorate


@_phase(reports_as="split")
def split(work: Work, sweep: Sweep) -> None:
    """Split long edges by rounds until none is left; what the last round measured is kept."""
    factor = _split_factor(work, sweep)
    shortest = sweep.collapse.shortest
    count = 0
    for _ in range(MAX_ROUNDS):
        mesh, blocks = work.mesh, work.blocks
        flags = classify_edges(mesh, blocks, factor, shortest, work.is_parallel)
        _check_room(work, flags)
        siblings = None
        if work.featured.on_non_manifold is not None:
            siblings = find_non_manifold_edges(mesh)
        refined, n_split = split_long_edges(mesh, blocks, factor, work.is_parallel, siblings, flags)
        count += n_split
        if refined is mesh:
            work.flags = flags._replace(n_gone=flags.n_gone - 2 * n_split)
            break
        work.put(refined)
    else:
        work.flags = classify_edges(work.mesh, work.blocks, factor, shortest, work.is_parallel)
    work.monitor.counts[-1]["split"] = count


def _check_room(work: Work, flags: EdgeFlags) -> None:
    """Refuse splits that would make more faces than the plan allows.

    An edge makes two; most are counted twice, by both of their faces.

    Raises
    ------
    OptionError
    """
    n_faces = work.n_faces - flags.n_gone
    n_after = n_faces + flags.n_long
    if n_after > work.plan.most_faces:
        sweep = len(work.monitor.counts)
        raise OptionError(
            f"sweep {sweep} would split {n_faces:,} faces into about {n_after:,}, too many for "
            f"max_faces = {work.plan.max_faces:,}: long thin faces, or edges that must stay, need "
            "many more faces than the area; raise L or max_faces, or mend these faces"
        )


def _split_factor(work: Work, sweep: Sweep) -> float:
    """Factor above which edges are split.

    Once all that is left is edges that are split and collapsed again and again, because their place has
    room for neither one nor two, edges stay whose halves would soon be collapsed.
    """
    counts = work.monitor.counts[:-1][-_CYCLE:]
    done = [count["split"] + count["collapse"] for count in counts]
    if len(done) == _CYCLE and min(done) > 0.7 * max(done):
        work.is_calm |= done[-1] < max(_CALM * work.count_edges(), 10.0)
    return max(sweep.split, 2.5 * sweep.collapse.shortest) if work.is_calm else sweep.split


@_phase(reports_as="collapse")
def collapse(work: Work, sweep: Sweep) -> None:
    """Collapse short edges; where that leaves many holes, close them."""
    mesh, flags = work.mesh, work.flags
    tally = collapse_short_edges(mesh, work.blocks, sweep.collapse, work.is_parallel, flags)
    count = int(tally[0])
    if work.featured.on_non_manifold is not None:
        count += collapse_siblings(mesh, *find_non_manifold_edges(mesh), sweep.collapse)
    work.monitor.counts[-1]["collapse"] = count
    n_gone = 0 if flags is None else flags.n_gone + 2 * count
    if n_gone > _SPARSE * work.n_faces and not work.keeps_numbers:
        work.compact(SPARE)


@_phase(reports_as="flip")
def flip(work: Work, sweep: Sweep) -> None:
    """Flip edges towards valence 6."""
    tally = flip_edges(work.mesh, work.blocks, sweep.flip, work.is_parallel, sweep.flip_passes)
    work.monitor.counts[-1]["flip"] = int(tally[0])


@_phase(reports_as=None)
def relax(work: Work, sweep: Sweep) -> None:
    """Move vertices in their tangent planes, and those on curves along them."""
    mesh, blocks, reference = work.mesh, work.blocks, work.featured.reference
    is_kept = work.featured.has_curves or work.measures_steps or sweep.unfolds
    work.before = mesh.X.copy() if is_kept else None
    for _ in range(sweep.relaxations):
        slide_vertices(mesh, blocks, reference, work.is_parallel)
        relax_vertices(mesh, blocks, sweep.stiffness, work.is_parallel)


@_phase(reports_as="relax")  # to a callback, both moves are one
def project(work: Work, sweep: Sweep) -> None:
    """Put vertices back onto the input, take back moves that fold, and read target lengths there."""
    mesh, blocks, reference = work.mesh, work.blocks, work.featured.reference
    if sweep.projects:
        project_vertices(mesh, blocks, reference, WALK_TRUST, work.is_parallel)
    if work.featured.has_curves and work.before is not None:
        undo_folds(mesh, blocks, work.before, work.is_parallel)
    if sweep.unfolds and work.before is not None:
        undo_folded_edges(mesh, blocks, work.before, work.is_parallel)
    refresh_lengths(work)
    if work.measures_steps and work.before is not None:
        work.step = _mean_step(mesh, work.before)
    work.before = None


def refresh_lengths(work: Work) -> None:
    """Read target lengths from the input where vertices lie now, if they vary."""
    if not work.varies:
        return
    mesh, reference, rims = work.mesh, work.featured.reference, work.featured.long_rims
    weights = read_lengths(mesh, work.blocks, reference, work.is_parallel)
    if rims is not None:
        rims.lengthen(mesh, reference.origin.reshape(-1, 3)[mesh.birth // 3], weights)
    bound_gradation(mesh, work.plan.gradation, non_manifold_copies(mesh, work.featured))


def _mean_step(mesh: Mesh, before: FloatArray) -> float:
    """Root mean square of the moves of all vertices, in target lengths."""
    alive = mesh.vertex_halfedge != DEAD
    move = mesh.X[alive, :3] - before[alive, :3]
    return float(np.sqrt(((move * move).sum(axis=1) / mesh.X[alive, 3] ** 2).mean()))
