"""The tasks of the rounds: pure functions of files, each of which writes one file when it is done.

So a task may run anywhere that sees the folder, twice if its worker died, and a file that is there need
not be made again.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import compile_notice
from ..core.stopwatch import Stopwatch
from ..core.threads import numba_version, thread_scope
from ..core.version import __version__
from ..core.vocabulary import FIXED, NONE, FloatArray, IntArray, Mesh
from ..errors import WorkerError
from ..input.recipe import Recipe, Rounds
from ..mesh.blocks import make_blocks
from ..operations.split import split_edges
from ..output.extract import locate
from ..sweeps.care import Sweeper
from ..sweeps.monitor import Monitor
from ..sweeps.plan import Plan
from ..sweeps.rounds import run_rounds
from ..sweeps.swept import start_of
from ..sweeps.work import Work, is_large
from .choice import better_regions
from .index import Index, load_index
from .piece import changed_faces, new_chords, read_piece, recognise, reset_lengths
from .reference_piece import read_reference
from .scratch import Arrays, load, save_task
from .vocabulary import Parts, SurfaceMesh, load_mesh

__all__ = ["LOCATE", "MOVE", "OVERLAP", "REPAIR", "SWEEP", "Task", "run_task", "versions"]

SWEEP, REPAIR, MOVE, LOCATE = "sweep", "repair", "move", "locate"

# Moves of a task that changes no edges: where a border was frozen, they bring the areas back.
_MOVES = Rounds(12)

# Rings of faces around the vertices that such a task owns; what it does to them is thrown away. The
# frozen end of a piece is felt one ring farther inside after every move.
OVERLAP = _MOVES.number + 4

_BOX = 256  # vertices in a box


@dataclass(frozen=True)
class Task:
    """One task; all else is read from the folder.

    Attributes
    ----------
    folder : str
        Scratch folder, which the worker must see under this name.
    mesh : str
        Name of the folder in it with the mesh.
    round : str
        Name of the folder in it with the parts, where the result goes.
    part : int
    kind : str
        ``SWEEP``, ``REPAIR``, ``MOVE`` or ``LOCATE``.
    recipe : Recipe
    scale, gradation : float
        See `Plan`.
    versions : dict
        Of the packages on which the bits of a result depend, in the process that asks.
    """

    folder: str
    mesh: str
    round: str
    part: int
    kind: str
    recipe: Recipe
    scale: float
    gradation: float
    versions: dict[str, str]

    @property
    def path(self) -> Path:
        """File that the task writes."""
        return Path(self.folder) / self.round / f"part-{self.part:06}.npz"


def versions() -> dict[str, str]:
    """Versions of the packages on which the bits of a result depend."""
    return {"remeshvec": __version__, "numpy": np.__version__, "numba": numba_version}


def run_task(task: Task, _: Any = None) -> str:
    """Do a task, and return the name of its file.

    Raises
    ------
    WorkerError
        This process has other versions of the packages, or does not see the folder.
    """
    _check_worker(task)
    folder = Path(task.folder)
    index, mesh = load_index(folder / "index"), load_mesh(folder / task.mesh)
    parts = Parts(**load(folder / task.round / "parts", *Parts._fields))
    with compile_notice(), thread_scope(task.recipe.threads) as may_run_parallel:
        result = _KINDS[task.kind](task, index, mesh, parts, may_run_parallel)
    save_task(task.path, result)
    return str(task.path)


def _check_worker(task: Task) -> None:
    here = versions()
    for name, version in task.versions.items():
        if here[name] != version:
            raise WorkerError(
                f"a worker has {name} {here[name]}, the caller {version}: results would differ; "
                "install the same version"
            )
    if not (Path(task.folder) / "index").is_dir():
        raise WorkerError(
            f"a worker does not see the folder {task.folder}; choose a scratch folder on a file "
            "system that all workers share"
        )


def _sweep(
    task: Task, index: Index, whole: SurfaceMesh, parts: Parts, may_run_parallel: bool
) -> Arrays:
    """Remesh the core of a part in its frozen ring."""
    piece = read_piece(whole, index, parts.of("core", task.part), parts.of("ring", task.part))
    plan = Plan(task.recipe, task.scale, task.gradation)
    parallel = may_run_parallel and is_large(len(piece.ring))
    monitor = Monitor(Stopwatch())
    # Cuts are jagged: faces fold there, until a later round remeshes them. To sweep with a guard
    # against that takes several times as long.
    at_cuts = piece.vertices[np.isin(piece.vertices, parts.shared)]
    tolerated = np.array(whole.X[at_cuts, :3]) if len(at_cuts) else None
    sweeper = Sweeper(plan, monitor, may_run_parallel, parallel, tolerated)
    start = start_of(piece.mesh, piece.reference.featured)
    result = sweeper.sweep([piece.mesh.copy()], start).work.mesh
    changed = recognise(piece, result)
    chords = new_chords(piece, changed, np.asarray(parts.shared))
    if len(chords):
        changed = recognise(piece, split_edges(result, make_blocks(result), chords, parallel))
    faces = changed_faces(piece, changed)
    if task.kind == REPAIR:
        old = changed_faces(piece, recognise(piece, piece.mesh))
        faces = better_regions(old, faces, whole.X)
    return faces


def _move(
    task: Task, index: Index, whole: SurfaceMesh, parts: Parts, may_run_parallel: bool
) -> Arrays:
    """Move the vertices of a part, and those around them that nobody will ask for."""
    piece = read_piece(whole, index, parts.of("core", task.part), parts.of("ring", task.part))
    plan = Plan(task.recipe, task.scale, task.gradation)
    featured = piece.reference.featured
    work = Work(piece.mesh, featured, plan, Monitor(Stopwatch()), may_run_parallel)
    work.monitor.begin_sweep()
    run_rounds(work, _MOVES, flips=False)
    reset_lengths(piece, piece.mesh)
    owned = np.flatnonzero(np.isin(piece.vertices, parts.of("moved", task.part)) & ~piece.frozen)
    birth = piece.reference.whole(piece.mesh.birth[owned])
    return {"vertices": piece.vertices[owned], "X": piece.mesh.X[owned], "birth": birth}


def _locate(
    task: Task, index: Index, whole: SurfaceMesh, parts: Parts, may_run_parallel: bool
) -> Arrays:
    """Find where on the input the vertices of a part lie."""
    v = parts.of("moved", task.part)
    X, kind = np.array(whole.X[v]), np.array(whole.kind[v])
    birth = np.array(whole.birth[v])
    boxes = _boxes_of_points(X)
    reference = read_reference(index, boxes, birth // 3)
    mesh = _bare_mesh(X, kind, reference.local(birth))
    parallel = may_run_parallel and is_large(2 * len(v))
    weights = locate(mesh, reference.featured.reference, True, parallel)
    face, weights = _on_input(index, reference.faces[mesh.birth // 3], weights)
    return {"V": X[:, :3], "lengths": X[:, 3], "face": face, "weights": weights,
            **_fixed_points(index, kind, birth)}  # fmt: skip


def _boxes_of_points(X: FloatArray) -> FloatArray:
    starts = np.arange(0, len(X), _BOX)
    low = np.minimum.reduceat(X[:, :3], starts)
    high = np.maximum.reduceat(X, starts)
    return np.column_stack([low, high])


def _bare_mesh(X: FloatArray, kind: NDArray[np.uint8], birth: NDArray[np.int32]) -> Mesh:
    """Vertices without faces."""
    nothing, zeros = np.empty(0, np.int32), np.zeros(len(X), np.int32)
    return Mesh(nothing, nothing, nothing, nothing, zeros, zeros, X, kind, birth)


def _on_input(index: Index, face: IntArray, weights: FloatArray) -> tuple[IntArray, FloatArray]:
    """Faces of the reference to faces of the input."""
    if len(index.flipped):
        flipped = index.flipped[face]
        weights[flipped] = weights[flipped][:, [0, 2, 1]]
    if len(index.cut_row):
        row = index.cut_row[face]
        cut = row != NONE
        weights[cut] = np.einsum("ni,nij->nj", weights[cut], index.cut_weights[row[cut]])
    return np.asarray(index.face_source[face], np.int64), weights


def _fixed_points(index: Index, kind: NDArray[np.uint8], birth: NDArray[np.int32]) -> Arrays:
    """Rows of fixed vertices, and where the caller has them, bit for bit."""
    rows = np.flatnonzero(kind == FIXED)
    order = np.argsort(index.fixed)
    place = order[np.searchsorted(index.fixed[order], birth[rows])]
    return {"fixed": rows, "fixed_points": np.array(index.fixed_points[place])}


_KINDS = {SWEEP: _sweep, REPAIR: _sweep, MOVE: _move, LOCATE: _locate}
