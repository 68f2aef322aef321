"""The rounds, one after the other; a round that is done is not done again."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ..batch.progress import bar
from ..input.recipe import Recipe
from .engine import Engine
from .merge import merge_changes, merge_moves
from .plans import ROUNDS, Plan, Round, even_runs, save_plan
from .scratch import load, read_json, remove, write_json
from .tasks import LOCATE, MOVE, Task, versions
from .vocabulary import Parts, SurfaceMesh, load_mesh, mark, save_mesh

__all__ = ["Call", "run_rounds_of_parts"]


@dataclass(frozen=True)
class Call:
    """All that the rounds share.

    Attributes
    ----------
    folder : Path
        Scratch folder with the index and ``mesh-0``.
    recipe : Recipe
    scale, gradation : float
        See `sweeps.plan.Plan`.
    plan : Plan
    engine : Engine
    progress : bool
        Whether to show progress on the error stream.
    """

    folder: Path
    recipe: Recipe
    scale: float
    gradation: float
    plan: Plan
    engine: Engine
    progress: bool

    @property
    def last_mesh(self) -> Path:
        """Folder of the mesh after all rounds."""
        return self.folder / f"mesh-{len(ROUNDS)}"


def run_rounds_of_parts(call: Call) -> tuple[list[dict[str, Any]], list[Path]]:
    """Run the rounds that are left, then find births.

    Returns
    -------
    rounds : list of dict
        What happened in each round.
    births : list of path
        Results of `tasks.LOCATE`, by part.
    """
    done = _last_mesh(call.folder)
    for number, step in enumerate(ROUNDS, 1):
        if number > done:
            _run_round(call, number, step)
    births = _run_tasks(call, "births", LOCATE, call.last_mesh.name, _vertex_runs(call))
    return [read_json(call.folder / step.name / "done.json") for step in ROUNDS], births


def _last_mesh(folder: Path) -> int:
    return max(int(path.name.removeprefix("mesh-")) for path in folder.glob("mesh-*"))


def _run_round(call: Call, number: int, step: Round) -> None:
    """Cut the mesh into parts, let the tasks run, and write the next mesh."""
    start = perf_counter()
    before, folder = call.folder / f"mesh-{number - 1}", call.folder / step.name
    mesh = load_mesh(before)
    parts = _known_parts(folder)
    if parts is None:
        parts = step.cut(call.plan, mesh)
        folder.mkdir(exist_ok=True)
        save_plan(folder, mesh, parts)
    files = _run_tasks(call, step.name, step.kind, before.name, parts)
    done = {"name": step.name, "parts": len(files), "faces": len(parts.core)}
    done["seconds"] = perf_counter() - start
    write_json(folder / "done.json", done)
    after = call.folder / f"mesh-{number}"
    if files:
        save_mesh(after, _merged(mesh, step, parts, files))
        del mesh
        remove(before)
    else:
        del mesh
        os.replace(before, after)
    for path in files:
        path.unlink()


def _merged(mesh: SurfaceMesh, step: Round, parts: Parts, files: Sequence[Path]) -> SurfaceMesh:
    if step.kind == MOVE:
        return merge_moves(mesh, files)
    return merge_changes(mesh, mark(len(mesh.F), parts.core), files)


def _known_parts(folder: Path) -> Parts | None:
    if not (folder / "parts").is_dir():
        return None
    return Parts(**load(folder / "parts", *Parts._fields))


def _vertex_runs(call: Call) -> Parts:
    """Cut the vertices of the last mesh, whose births are found, into runs."""
    folder = call.folder / "births"
    parts = _known_parts(folder)
    if parts is None:
        mesh = load_mesh(call.last_mesh)
        parts = even_runs(len(mesh.X), call.plan.part_faces)
        folder.mkdir(exist_ok=True)
        save_plan(folder, mesh, parts)
    return parts


def _run_tasks(call: Call, name: str, kind: str, mesh: str, parts: Parts) -> list[Path]:
    """Run the tasks of a round whose files are not there; returns all files, by part."""
    rows = np.diff(parts.core_start if kind != LOCATE else parts.moved_start)
    tasks = [
        Task(
            str(call.folder),
            mesh,
            name,
            k,
            kind,
            call.recipe,
            call.scale,
            call.gradation,
            versions(),
        )
        for k in np.flatnonzero(rows).tolist()
    ]
    left = [task for task in tasks if not task.path.is_file()]
    done = call.engine.run(left) if left else iter(())
    if call.progress and left:
        done = bar(done, len(left), lambda task: False, noun=f"parts ({name})")
    for _ in done:
        pass
    return [task.path for task in tasks]
