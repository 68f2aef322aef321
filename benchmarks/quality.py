"""Quality of every preset on all meshes, beside the targets.

``python -m benchmarks.quality [--meshes cat cow]``
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from remeshvec import RemeshResult, quality, remesh

from . import contenders as who
from .contenders import CONTENDERS
from .measures import COLUMNS, LEGEND, cells, measure, topology_changes, turned_faces
from .meshes import Sample, load, small_meshes
from .race import Effort, Entrant, Row, race
from .tables import DOCS, machine, machine_line, page, table, write_page

RECIPES: dict[str, dict[str, Any]] = {
    "default": {},
    "even": {"preset": "even"},
    "fast": {"preset": "fast"},
    "fine": {"preset": "fine"},
    "default, no projection": {"project": False},
    "fast, no projection": {"preset": "fast", "project": False},
}

# Of the default preset, by `COLUMNS`: (bound, whether it is the most or the least).
AT_MOST, AT_LEAST = True, False
TARGETS: dict[str, dict[str, tuple[float, bool]]] = {
    name: {
        "area_error_voronoi": (voronoi, AT_MOST),
        "area_error_face": (face, AT_MOST),
        "valence6": (valence, AT_LEAST),
        "min_angle_p1": (p1, AT_LEAST),
        "min_angle": (25.0, AT_LEAST),
        "in_band": (96.0, AT_LEAST),
        "hausdorff": (hausdorff, AT_MOST),
        "rms": (rms, AT_MOST),
    }
    for name, voronoi, face, valence, p1, hausdorff, rms in (
        ("cat", 3.7, 4.7, 84.5, 44.3, 0.4, 0.016),
        ("iphi_bad10k", 6.6, 7.8, 80.5, 43.0, 1.0, 0.11),
        ("phands", 3.7, 4.7, 83.5, 44.3, 0.5, 0.04),
        ("cow", 5.6, 6.4, 82.0, 43.5, 1.8, 0.09),
    )
}
TARGETS["wolf_head"] = {"area_error_face": (13.4, AT_MOST), "hausdorff": (9.0, AT_MOST)}


# Shown beside ours, where installed: triangles along a field have the fewest irregular vertices. Other
# libraries are on the page that compares.
BESIDE = (who.FIELD,)


class Entry(NamedTuple):
    """One recipe on one mesh."""

    mesh: str
    recipe: str
    measures: dict[str, float]
    topology: str
    turned: int


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and write ``quality.md``."""
    arguments = _parse(argv)
    entries, beside = [], {}
    for name in arguments.meshes or small_meshes():
        print(name, file=sys.stderr, flush=True)
        entries += [entry(load(name), recipe) for recipe in RECIPES]
        beside[name] = others(load(name))
    text = as_page(entries, beside)
    print(text)
    write_page(arguments.output, "quality.md", text)
    return 0


def entry(sample: Sample, recipe: str) -> Entry:
    """Remesh and measure."""
    result = remesh(sample.V, sample.F, sample.length, **RECIPES[recipe])
    return Entry(
        sample.name,
        recipe,
        measure(sample, result.V, result.F),
        _topology(sample, result),
        turned_faces(sample, result),
    )


def others(sample: Sample) -> dict[str, Row]:
    """Measure results of other libraries, each in a process of its own: some crash."""
    installed = [name for name in BESIDE if CONTENDERS[name].is_installed]
    rows = race([Entrant(CONTENDERS[name], sample) for name in installed], Effort(repeat=0))
    return dict(zip(installed, rows, strict=True))


def _topology(sample: Sample, result: RemeshResult) -> str:
    before, after = quality(sample.V, sample.F), quality(result.V, result.F)
    changes = ", ".join(topology_changes(before, after)) or "kept"
    dirt = ", ".join(f"{count:,} {name}" for name, count in result.report.dirt.items())
    return f"{changes} (input: {dirt.replace('_', ' ')})" if dirt else changes


def as_page(entries: list[Entry], beside: dict[str, dict[str, Row]]) -> str:
    """Lay out targets and figures, and other libraries by mesh."""
    aimed = [e for e in entries if e.recipe == "default" and e.mesh in TARGETS]
    missed = sum(cell.endswith(")") for e in aimed for cell in _beside_targets(e))
    titles = [column.title for column in COLUMNS]
    return page(
        "Quality",
        "L = 0.9 x the mean edge length of the input.",
        LEGEND,
        machine_line(machine()),
        _targets_part(aimed, missed, titles),
        "## All presets",
        "Topology: components, boundary loops, Euler number; no non-manifold, misoriented, "
        "degenerate or unreferenced elements that the input did not have. Turned: faces that point "
        "against all the input faces on which their corners lie.",
        table(
            ["mesh", "preset", "topology", *titles, "turned"],
            [[e.mesh, e.recipe, e.topology, *cells(e.measures), str(e.turned)] for e in entries],
            text_columns=3,
        ),
        _beside_part(entries, beside),
    )


def _beside_part(entries: list[Entry], beside: dict[str, dict[str, Row]]) -> str:
    """Lay out what other libraries make of the meshes, under our most even preset."""
    ours = {entry.mesh: entry.measures for entry in entries if entry.recipe == "even"}
    rows, failed = [], []
    for mesh, found in beside.items():
        measured = {name: row["quality"] for name, row in found.items() if "quality" in row}
        failed += [
            f"{name} on {mesh}: {row['failed']}" for name, row in found.items() if "failed" in row
        ]
        if measured:
            both = {"remeshvec even": ours[mesh], **measured}
            rows += [[mesh, name, *cells(figures)] for name, figures in both.items()]
    if not rows:
        return ""
    versions = [
        f"{n} {CONTENDERS[n].version}: {CONTENDERS[n].settings}."
        for n in BESIDE
        if CONTENDERS[n].is_installed
    ]
    return "\n\n".join(
        (
            "## Beside triangles along a field",
            " ".join(versions),
            table(["mesh", "", *(column.title for column in COLUMNS)], rows, text_columns=2),
            *(f"No result: {'; '.join(failed)}." for _ in failed[:1]),
        )
    )


def _targets_part(aimed: list[Entry], missed: int, titles: list[str]) -> str:
    if not aimed:
        return ""
    return "\n\n".join(
        (
            "## Default preset beside its targets",
            f"Measured / target, with the difference in parentheses if it is missed: {missed} missed.",
            table(["mesh", *titles], [[e.mesh, *_beside_targets(e)] for e in aimed]),
        )
    )


def _beside_targets(entry: Entry) -> list[str]:
    targets = TARGETS[entry.mesh]
    return [
        _beside_target(cell, entry.measures[column.key], targets.get(column.key), column.digits)
        for column, cell in zip(COLUMNS, cells(entry.measures), strict=True)
    ]


def _beside_target(
    cell: str, measured: float, target: tuple[float, bool] | None, digits: int
) -> str:
    """Put figure, target and, where it is missed, the difference into one cell."""
    if target is None:
        return cell
    bound, is_upper = target
    beside = f"{cell} / {bound:g}"
    over = measured - bound if is_upper else bound - measured
    return beside if over <= 0.0 else f"{beside} (**{measured - bound:+.{digits + 1}f}**)"


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.quality", description=__doc__)
    parser.add_argument("--meshes", nargs="+", metavar="NAME", help="these meshes only")
    parser.add_argument("--output", type=Path, default=DOCS, help="folder of the page")
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
