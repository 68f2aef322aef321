"""Capillary surfaces against exact answers, and against Surface Evolver in time.

``python -m benchmarks.capillary [--output FOLDER]``
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from remeshvec.evolver import CapillaryProblem, EvolverBackend, EvolverError, evolve, minimize

from .films import REFINED, rings_problem
from .tables import DOCS, machine, machine_line, page, table, write_page

REPEATS = 3
GOALS = (4420.0, 4400.0, 4392.0, 4388.0)  # energies, of a limit of about 4384.6
FINER = (16.0, 8.0, 4.0, 2.8)

# Surface Evolver by itself, as its users write it: refined, and with its own commands for long edges,
# tiny ones, equiangulation and averaging, at falling lengths.
REFINING = (
    "g 30; r; g 30; r; g 60;",
    "g 30; r; g 60; hessian; hessian; r; g 60; hessian; hessian;",
)


def _own_remeshing(*lengths: float) -> str:
    steps = [
        f"s{k} := {{ l {1.5 * L:g}; t {0.5 * L:g}; u; V; u; g 5 }}; s{k} 12;"
        for k, L in enumerate(lengths)
    ]
    return " ".join(["g 10;", *steps, "g 40; m 0; g; hessian; hessian; hessian;"])


OWN = {
    "Evolver, refined": (*REFINING, f"{REFINING[1]} r; g 60; hessian; hessian;"),
    "Evolver, its own remeshing": tuple(_own_remeshing(*(*FINER, 2.0)[:k]) for k in (2, 3, 4, 5)),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and write ``capillary.md``'s tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.capillary", description=__doc__)
    parser.add_argument("--output", type=Path, default=DOCS)
    arguments = parser.parse_args(argv)
    text = page(
        "Capillary surfaces, measured",
        machine_line(machine(("scipy",))),
        "## The report's four simulations",
        "Fluid held by three wires, edge lengths "
        f"{', '.join(f'{L:g}' for L in FINER)}; without remeshing, the initial triangles, each cut "
        "into 16. Energies include the caps.",
        table(
            ["volume", "remeshing", "faces", "energy", "pressure", "parts", "s", "ended"],
            simulations(),
            text_columns=2,
        ),
        "## Time to an energy",
        "Seconds until the energy of the full volume falls below the given value, medians of "
        f"{REPEATS}, interleaved, one process each for Evolver. Native: `evolve`; Evolver with our "
        "remesher: the same loop with `EvolverBackend`; refined: without remeshing, the initial "
        "triangles cut into 16 (Evolver: into 4, 16, 64 on the way); Evolver alone: the script that ends "
        "first, of those in the source of this page.",
        table(["", *(f"{goal:,.0f}" for goal in GOALS), "lowest"], times()),
        "## The same triangles",
        agreement(),
    )
    print(text)
    write_page(arguments.output, "capillary-measured.md", text)
    return 0


def simulations() -> list[list[str]]:
    """Run full and small volume, without and with remeshing."""
    rows = []
    for volume in ("volume_full", "volume_small"):
        for remeshing in (False, True):
            print(volume, remeshing, file=sys.stderr, flush=True)
            problem = rings_problem(volume, 0 if remeshing else 2)
            start = perf_counter()
            done = evolve(problem, FINER if remeshing else REFINED[:1], remeshing=remeshing)
            seconds = perf_counter() - start
            last = done.minimum
            rows.append(
                [
                    volume.removeprefix("volume_"),
                    "yes" if remeshing else "no",
                    f"{len(last.F):,}",
                    f"{last.energy:,.2f}",
                    f"{last.pressure[0]:.5f}",
                    f"{done.history[-1]['components']:.0f}",
                    f"{seconds:.1f}",
                    last.stop,
                ]
            )
    return rows


def times() -> list[list[str]]:
    """Seconds to each energy, by each way."""
    ways: dict[str, Callable[[], list[tuple[float, float]]]] = {
        "native, remeshed": lambda: _traced({}),
        "native, refined": lambda: _traced({"remeshing": False}),
    }
    try:
        backend = EvolverBackend()
    except EvolverError as error:
        print(error, file=sys.stderr)
    else:
        ways["Evolver in our loop"] = lambda: _traced({"backend": backend, "tol": 1e-3})
        for name, scripts in OWN.items():
            ways[name] = lambda scripts=scripts: _scripted(backend, scripts)
    found: dict[str, list[list[tuple[float, float]]]] = {name: [] for name in ways}
    for _ in range(REPEATS):
        for name, run in ways.items():
            print(name, file=sys.stderr, flush=True)
            found[name].append(run())
    return [[name, *_reached(runs)] for name, runs in found.items()]


def _traced(options: dict[str, Any]) -> list[tuple[float, float]]:
    """Seconds and energy after every sweep."""
    trace: list[tuple[float, float]] = []
    start = perf_counter()
    refined = 0 if options.get("remeshing", True) else 2
    evolve(
        rings_problem("volume_full", refined), FINER, **options,
        callback=lambda frame: trace.append((perf_counter() - start, frame.energy)),
    )  # fmt: skip
    return trace


def _scripted(backend: EvolverBackend, scripts: Sequence[str]) -> list[tuple[float, float]]:
    """Seconds and energy at the end of every script."""
    trace = []
    problem = rings_problem("volume_full")
    for script in scripts:
        start = perf_counter()
        try:
            V, F, fixed = backend.run_freely(problem, script)
        except EvolverError as error:
            print(f"{script}: {error}", file=sys.stderr)
            continue
        seconds = perf_counter() - start
        after = CapillaryProblem(
            V, F, fixed, volume=problem.volume, volume_offset=problem.volume_offset,
            energy_offset=problem.energy_offset,
        )  # fmt: skip
        trace.append((seconds, after.energy()))
    return trace


def _reached(runs: list[list[tuple[float, float]]]) -> list[str]:
    cells = []
    for goal in GOALS:
        times = [min((t for t, e in run if e <= goal), default=np.inf) for run in runs]
        cells.append(f"{median(times):.2f}" if np.isfinite(median(times)) else "never")
    return [*cells, f"{min((e for run in runs for _, e in run), default=np.nan):,.2f}"]


def agreement() -> str:
    """Compare both on the triangles where the native evolution ended."""
    done = evolve(rings_problem("volume_full"), REFINED)
    last = minimize(done.minimum.problem, "newton", tol=1e-11)
    try:
        backend = EvolverBackend()
    except EvolverError:
        return "Surface Evolver is not installed here."
    theirs = backend(last.problem, "newton", steps=4)
    same = abs(backend.energy(last.problem) / last.energy - 1)
    return (
        f"On {len(last.F):,} faces: the energy of the same surface differs by {same:.0e} relative, that "
        f"of the two minima by {abs(theirs.energy / last.energy - 1):.0e}; pressures "
        f"{last.pressure[0]:.6f} and {theirs.pressure[0]:.6f}."
    )


if __name__ == "__main__":
    sys.exit(main())
