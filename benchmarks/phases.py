"""Where the time of a call goes: seconds by phase, as the report of the call says."""

from __future__ import annotations

import sys
from pathlib import Path
from statistics import median

from remeshvec import remesh

from .contenders import RECIPES
from .meshes import find_file, load, made
from .results import record

MESHES = ("cow", "creature", "cat")
SHOWN = ("default", "fast, no projection", "fine")


def run(folder: Path, repeat: int, quick: bool) -> None:
    """Measure and record; medians of every phase on one thread."""
    names = [name for name in MESHES if find_file(name)] + ([] if quick else [made(64)])
    for name in names:
        print(f"phases: {name}", file=sys.stderr, flush=True)
        entry = {"mesh": name, "faces": len(load(name).F)}
        record(folder, "phases", name, {**entry, "recipes": by_recipe(name, repeat)})


def by_recipe(name: str, repeat: int) -> dict[str, dict[str, float]]:
    """Median seconds by recipe and phase, "total" among them."""
    sample = load(name)
    seconds: dict[str, list[dict[str, float]]] = {recipe: [] for recipe in SHOWN}
    for _ in range(repeat + 1):
        for recipe, runs in seconds.items():
            options = RECIPES[recipe]
            result = remesh(sample.V, sample.F, sample.length, threads=1, **options)
            runs.append(result.report.seconds)
    return {
        recipe: {phase: median(one[phase] for one in runs[1:]) for phase in runs[0]}
        for recipe, runs in seconds.items()
    }
