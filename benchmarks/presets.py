"""What each preset costs and brings: medians over meshes and orientations.

``python -m benchmarks.presets [--rotations 5]``
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from remeshvec import remesh

from .measures import COLUMNS, LEGEND, measure
from .meshes import Sample, load, small_meshes
from .tables import DOCS, machine, machine_line, page, table, write_page

PRESETS = {
    "fast": "five sweeps of the published algorithm",
    "default": "eight sweeps, twenty rounds",
    "fine": "sixteen sweeps, twenty rounds, and the fit: vertices beside the input",
    "even": "eight sweeps, rounds until the areas settle, at most five hundred",
}
TIME = "time"
SHOWN = tuple(column for column in COLUMNS if column.key not in ("in_band", "faces"))

# A CAD part whose creases are rounded: its figures say how, not how well a preset works.
LEFT_OUT = ("bracket",)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and write ``presets.md``."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.presets", description=__doc__)
    parser.add_argument("--rotations", type=int, default=5, help="orientations of every mesh")
    parser.add_argument("--output", type=Path, default=DOCS, help="folder of the page")
    arguments = parser.parse_args(argv)
    names = [name for name in small_meshes() if name not in LEFT_OUT]
    found = {}
    for name in names:
        print(name, file=sys.stderr, flush=True)
        found[name] = over(load(name), arguments.rotations)
    write_page(arguments.output, "presets.md", as_page(found, arguments.rotations))
    return 0


def over(sample: Sample, rotations: int) -> dict[str, dict[str, float]]:
    """Means over the orientations of a mesh, by preset; the time in those of the default."""
    figures: dict[str, list[dict[str, float]]] = {preset: [] for preset in PRESETS}
    for seed in range(rotations):
        for preset, rows in figures.items():  # in turn, so that other work slows all alike
            rows.append(figures_of(turned(sample, seed), preset))
    keys = (*(column.key for column in SHOWN), TIME)
    means = {
        preset: {key: float(np.mean([row[key] for row in rows])) for key in keys}
        for preset, rows in figures.items()
    }
    base = means["default"][TIME]
    return {preset: {**row, TIME: row[TIME] / base} for preset, row in means.items()}


def turned(sample: Sample, seed: int) -> Sample:
    """Rotate a mesh; not at all with seed 0."""
    if not seed:
        return sample
    return sample._replace(V=Rotation.random(random_state=seed).apply(sample.V))


def figures_of(sample: Sample, preset: str) -> dict[str, float]:
    """Remesh twice, so that nothing is compiled in the second, and measure."""
    call: Any = {"preset": preset, "threads": 1}
    remesh(sample.V, sample.F, sample.length, **call)
    start = process_time()
    result = remesh(sample.V, sample.F, sample.length, **call)
    seconds = process_time() - start
    return {**measure(sample, result.V, result.F), TIME: seconds}


def as_page(found: dict[str, dict[str, dict[str, float]]], rotations: int) -> str:
    """Lay out one table of medians, and one row per mesh and preset below it."""
    titles = [*(column.title for column in SHOWN), TIME]
    medians = [
        [preset, contents, *cells({key: median(found, preset, key) for key in keys()})]
        for preset, contents in PRESETS.items()
    ]
    rows = [
        [name, preset, *cells(figures)]
        for name, by_preset in found.items()
        for preset, figures in by_preset.items()
    ]
    return page(
        "Presets",
        "What each preset costs and brings. L = 0.9 x the mean edge length of the input; medians "
        f"over {len(found)} meshes of means over {rotations} orientations. Time: CPU time on one "
        "thread, in times of the default.",
        LEGEND,
        machine_line(machine()),
        table(["preset", "what it does", *titles], medians, text_columns=2),
        "## Mesh by mesh",
        table(["mesh", "preset", *titles], rows, text_columns=2),
    )


def keys() -> list[str]:
    """List the keys of the figures, as shown."""
    return [*(column.key for column in SHOWN), TIME]


def median(found: dict[str, dict[str, dict[str, float]]], preset: str, key: str) -> float:
    """Median of a figure over the meshes."""
    return float(np.median([by_preset[preset][key] for by_preset in found.values()]))


def cells(figures: dict[str, float]) -> list[str]:
    """Format figures by `COLUMNS`."""
    shown = [f"{figures[column.key]:,.{column.digits}f}" for column in SHOWN]
    return [*shown, f"{figures[TIME]:.1f}"]


if __name__ == "__main__":
    sys.exit(main())
