"""Time and quality of the whole call, ours and the peers', in one run.

``python -m benchmarks.compare [--quick] [--repeat 5] [--meshes cat creature-x16]``

Every contender runs once on each mesh for warming up; then they take turns (A B C A B C ...), so
that a disturbance of the machine meets all alike. Medians are reported.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from remeshvec import MeshInputError

from . import contenders as who
from .contenders import CONTENDERS, Arrays, Contender
from .measures import COLUMNS, LEGEND, cells, measure
from .meshes import LARGE, Sample, load, small_meshes
from .tables import DOCS, machine, machine_line, milliseconds, page, table, usable_cores, write_page
from .workers import Failed, Worker

Row = dict[str, Any]  # of one contender on one mesh


class Ratio(NamedTuple):
    """A ratio of times that is reported."""

    title: str
    over: str
    under: str
    target: str


RATIOS = (
    Ratio("fast / trueform", who.FAST, who.TRUEFORM, "<= 1; <= 0.5 from 600,000 faces"),
    Ratio("fast / trueform, all cores", who.FAST_ALL, who.TRUEFORM_ALL, ""),
    Ratio("default / trueform", who.DEFAULT, who.TRUEFORM, "<= 4"),
    Ratio("gpytoolbox / default", who.GPYTOOLBOX, who.DEFAULT, ">= 3"),
    Ratio("PyMeshLab / default", who.PYMESHLAB, who.DEFAULT, ">= 3"),
    Ratio("PyMeshLab lean / default", who.PYMESHLAB_LEAN, who.DEFAULT, ">= 3"),
    Ratio("fast, one core / all", who.FAST, who.FAST_ALL, ">= 1.5 from 100,000 faces, never < 1"),
    Ratio(
        "default, one core / all",
        who.DEFAULT,
        who.DEFAULT_ALL,
        ">= 1.5 from 100,000 faces, never < 1",
    ),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the comparison and write ``benchmarks.json`` and ``benchmarks.md``."""
    arguments = _parse(argv)
    names = arguments.meshes or small_meshes() + ([] if arguments.quick else list(LARGE))
    present = [c for c in _wanted(arguments.contenders) if c.is_installed]
    results: dict[str, Any] = {
        "machine": machine(sorted({c.package for c in present if not c.is_ours})),
        "absent": sorted({c.package for c in CONTENDERS.values() if not c.is_installed}),
        "settings": {c.name: f"{c.settings} (version {c.version})" for c in present},
        "meshes": [],
    }
    for package in results["absent"]:
        print(f"{package} is not installed and left out", file=sys.stderr)
    workers = [Worker(contender) for contender in present]
    try:
        for name in names:
            results["meshes"].append(compare_on(load(name), workers, arguments))
            _write(arguments.output, results)
    finally:
        for worker in workers:
            worker.stop()
    return 0


def compare_on(sample: Sample, workers: list[Worker], arguments: argparse.Namespace) -> Row:
    """Warm up, measure the quality, and time in turns."""
    print(f"{sample.name}: {len(sample.F):,} faces", file=sys.stderr, flush=True)
    rows: dict[str, Row] = {}
    for worker in workers:
        rows[worker.contender.name] = _warm_up(sample, worker, arguments.limit)
    for _ in range(arguments.repeat):
        for worker in workers:
            row = rows[worker.contender.name]
            if "failed" not in row and _has_time(row, arguments.budget):
                _take_turn(worker, row, arguments.limit)
    for row in rows.values():
        if row.get("seconds"):
            row["median"], row["cpu_median"] = median(row["seconds"]), median(row["cpu_seconds"])
    return {
        "name": sample.name,
        "vertices": len(sample.V),
        "faces": len(sample.F),
        "length": sample.length,
        "contenders": rows,
    }


def _warm_up(sample: Sample, worker: Worker, limit: float) -> Row:
    try:
        result = worker.warm_up(sample, _limit(worker.contender, limit))
        return {"seconds": [], "cpu_seconds": [], "quality": _measure(sample, result)}
    except Failed as reason:
        print(f"  {worker.contender.name}: {reason}", file=sys.stderr, flush=True)
        return {"failed": str(reason)}


def _measure(sample: Sample, result: Arrays) -> dict[str, float]:
    try:
        return measure(sample, *result)
    except MeshInputError as error:
        raise Failed(f"its result is no mesh: {error}") from None


def _take_turn(worker: Worker, row: Row, limit: float) -> None:
    try:
        turn = worker.turn(_limit(worker.contender, limit))
    except Failed as reason:
        row["failed"] = str(reason)
        return
    row["seconds"].append(turn.seconds)
    row["cpu_seconds"].append(turn.cpu_seconds)


def _has_time(row: Row, budget: float) -> bool:
    return sum(row["seconds"]) < budget


def _limit(contender: Contender, limit: float) -> float | None:
    """Give us no limit: our first call may compile."""
    return None if contender.is_ours else limit


def _write(folder: Path, results: dict[str, Any]) -> None:
    """Write after every mesh: what was measured is kept if the run is stopped."""
    write_page(folder, "benchmarks.json", json.dumps(results, indent=1) + "\n")
    write_page(folder, "benchmarks.md", as_page(results))


def as_page(results: dict[str, Any]) -> str:
    """Lay out the results."""
    meshes, names = results["meshes"], list(results["settings"])
    return page(
        "Time and quality beside other libraries",
        "L = 0.9 x the mean edge length of the input, the same for all. Contenders run warm, in "
        "turns, each in a process of its own; one core means bound to one core. Arrays in, arrays "
        "out. `-x16`: the input cut into 16 times the faces and perturbed in its tangent planes.",
        machine_line(results["machine"]),
        *(f"{package} was not installed." for package in results["absent"]),
        "## Ratios of times",
        "Median by median; in parentheses of processor time, which a busy machine disturbs less.",
        table(["mesh", "faces", *(r.title for r in RATIOS)], [_targets(), *map(_ratios, meshes)]),
        "## Times, ms",
        table(["mesh", "faces", *names], [_times(mesh, names) for mesh in meshes]),
        _failures(meshes),
        "## Quality",
        LEGEND,
        *(f"### {mesh['name']}\n\n{_quality(mesh)}" for mesh in meshes),
        "## Settings",
        "\n".join(f"- {name}: {settings}" for name, settings in results["settings"].items()),
    )


def _targets() -> list[str]:
    return ["*target*", "", *(ratio.target for ratio in RATIOS)]


def _ratios(mesh: Row) -> list[str]:
    return [mesh["name"], f"{mesh['faces']:,}", *(_ratio(mesh, ratio) for ratio in RATIOS)]


def _ratio(mesh: Row, ratio: Ratio) -> str:
    over, under = (mesh["contenders"].get(name, {}) for name in (ratio.over, ratio.under))
    if "median" not in over or "median" not in under:
        return "-"
    wall = f"{over['median'] / under['median']:.2f}"
    if any(CONTENDERS[name].all_cores for name in (ratio.over, ratio.under)):
        return wall
    return f"{wall} ({over['cpu_median'] / under['cpu_median']:.2f})"


def _times(mesh: Row, names: list[str]) -> list[str]:
    rows = [mesh["contenders"][name] for name in names]
    times = [milliseconds(row["median"]) if "median" in row else "failed" for row in rows]
    return [mesh["name"], f"{mesh['faces']:,}", *times]


def _failures(meshes: list[Row]) -> str:
    return "\n".join(
        f"- {name} on {mesh['name']}: {row['failed']}"
        for mesh in meshes
        for name, row in mesh["contenders"].items()
        if "failed" in row
    )


def _quality(mesh: Row) -> str:
    rows = [
        [name, *cells(row["quality"])]
        for name, row in mesh["contenders"].items()
        if "quality" in row and not _repeats(name)
    ]
    return table(["", *(column.title for column in COLUMNS)], rows)


def _repeats(name: str) -> bool:
    """Tell whether this is one of ours on more threads, with the same result bit for bit."""
    return name in (who.FAST_ALL, who.DEFAULT_ALL)


def _wanted(names: Sequence[str] | None) -> list[Contender]:
    chosen = [CONTENDERS[name] for name in names or CONTENDERS]
    return [c for c in chosen if not c.all_cores or usable_cores() > 1]


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.compare", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="no generated large meshes")
    parser.add_argument("--meshes", nargs="+", metavar="NAME", help="these meshes only")
    parser.add_argument("--contenders", nargs="+", choices=CONTENDERS, metavar="NAME")
    parser.add_argument("--repeat", type=int, default=5, help="turns of each contender")
    parser.add_argument(
        "--limit", type=float, default=60.0, help="seconds a call of a peer may take"
    )
    parser.add_argument(
        "--budget", type=float, default=30.0, help="seconds after which no further turn is taken"
    )
    parser.add_argument("--output", type=Path, default=DOCS, help="folder of the pages")
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
