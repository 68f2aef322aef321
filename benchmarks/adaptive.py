"""Lengths from the curvature, beside the same lengths as an array and beside MMG.

``python -m benchmarks.adaptive [--tolerance 0.002]``. Writes ``docs/adaptive.md``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from remeshvec import Adaptive, quality, remesh, surface_distance

from . import peers
from .meshes import Sample, find_file, load
from .tables import DOCS, machine, machine_line, page, table, write_page

MESHES = ("cow", "phands", "creature", "iphi_bad10k", "cat")
HEAD = (
    "mesh",
    "lengths",
    "faces",
    "p1 angle",
    "min angle",
    "below 30 %",
    "Hausdorff %",
    "RMS %",
    "time",
)
SAMPLES = 200_000
ROUNDS = 3

# MMG's bound for the distance is sought between these shares of the diagonal, by halving this often.
MMG_BOUNDS = (1e-4, 2e-2)
MMG_HALVINGS = 7


class Outcome(NamedTuple):
    """What a call led to."""

    faces: int
    p1: float
    least: float
    below_30: float  # percent
    hausdorff: float  # percent of the diagonal, as the next
    rms: float
    seconds: float


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.adaptive", description=__doc__)
    parser.add_argument("--tolerance", type=float, default=0.002, help="share of the diagonal")
    parser.add_argument("--output", type=Path, default=DOCS, help="folder of the page")
    arguments = parser.parse_args(argv)
    rows = []
    for name in MESHES:
        if find_file(name):
            print(name, file=sys.stderr, flush=True)
            rows += rows_of(load(name), arguments.tolerance)
    text = page(
        "Adaptive lengths, measured",
        f"`Adaptive(tolerance)` with {100 * arguments.tolerance:g} % of the diagonal, on one thread. "
        "Below it the lengths that it led to, given as an array, and MMG's surface remesher (`mmgpy`, "
        "`MmgMeshS.remesh(hausd=, hgrad=1.5, angle=0)`), with the `hausd` by which its result comes "
        f"closest to the same distance from the input without exceeding it. Distances from {SAMPLES:,} "
        "samples each way, in % of the diagonal; p1: first percentile of the faces' smallest angles. "
        "Time: CPU time, in times of the array's.",
        machine_line(machine(["mmgpy"] if find_spec("mmgpy") else [])),
        table(HEAD, rows, text_columns=2),
    )
    write_page(arguments.output, "adaptive.md", text)
    return 0


def rows_of(sample: Sample, tolerance: float) -> list[list[str]]:
    """The rows of a mesh."""
    V, F = sample.V, sample.F
    diagonal = float(np.linalg.norm(np.ptp(V[np.unique(F)], axis=0)))
    asked = Adaptive(tolerance * diagonal)
    result = remesh(V, F, asked, threads=1)
    _, nearest = cKDTree(result.V).query(V)
    array = result.lengths[nearest]

    def ours(L: Any) -> Callable[[], Any]:
        return lambda: tuple(remesh(V, F, L, threads=1))

    adaptive, given = measure(sample, ours(asked), diagonal), measure(sample, ours(array), diagonal)
    rows = [cells(sample, "Adaptive", adaptive, given), cells(sample, "array", given, given)]
    if find_spec("mmgpy"):
        rows.append(cells(sample, "MMG", as_far(sample, adaptive.hausdorff, diagonal), given))
    return rows


def as_far(sample: Sample, hausdorff: float, diagonal: float) -> Outcome:
    """Let MMG find a result that is at most as far from the input."""
    low, high = MMG_BOUNDS
    best = None
    for _ in range(MMG_HALVINGS):
        share = float(np.sqrt(low * high))

        def call(bound: float = share * diagonal) -> Any:
            return peers.mmgpy_adaptive(sample.V, sample.F, bound)

        found = measure(sample, call, diagonal, rounds=1)
        if found.hausdorff <= hausdorff:
            low, best = share, found
        else:
            high = share
    return best or found


def measure(
    sample: Sample, call: Callable[[], Any], diagonal: float, rounds: int = ROUNDS
) -> Outcome:
    """Call, and measure the result."""
    seconds = []
    for _ in range(rounds):
        start = process_time()
        W, G = call()
        seconds.append(process_time() - start)
    seen = quality(W, G)
    apart = surface_distance(sample.V, sample.F, W, G, samples=SAMPLES)
    return Outcome(
        len(G),
        seen.min_angle_p1,
        seen.min_angle,
        100 * seen.faces_below_30,
        100 * apart.hausdorff / diagonal,
        100 * apart.rms / diagonal,
        float(np.median(seconds)),
    )


def cells(sample: Sample, lengths: str, found: Outcome, given: Outcome) -> list[str]:
    """One row."""
    return [
        sample.name,
        lengths,
        f"{found.faces:,}",
        f"{found.p1:.1f}",
        f"{found.least:.1f}",
        f"{found.below_30:.2f}",
        f"{found.hausdorff:.3f}",
        f"{found.rms:.4f}",
        f"{found.seconds / given.seconds:.1f}",
    ]


if __name__ == "__main__":
    sys.exit(main())
