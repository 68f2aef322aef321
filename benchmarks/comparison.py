"""The page that compares: other libraries beside ours, over all meshes of one run, in three tables."""

from __future__ import annotations

from statistics import median

from . import contenders as who
from .contenders import CONTENDERS
from .measures import COLUMNS, LEGEND
from .results import Entry, Results, measured_lines
from .tables import page, table
from .targets import ratio

# Who is compared with which of our presets: those that do the same work.
PAIRS = (
    (who.TRUEFORM, who.FAST),
    (who.PMP, who.FAST),
    (who.MESHLIB, who.FAST),
    (who.PMP_PROJECTED, who.DEFAULT),
    (who.MESHLIB_EVEN, who.DEFAULT),
    (who.GPYTOOLBOX, who.DEFAULT),
    (who.CGAL, who.DEFAULT),
    (who.PYMESHLAB, who.DEFAULT),
    (who.PYMESHLAB_LEAN, who.DEFAULT),
    (who.MMG, who.DEFAULT),
    (who.ACVD, who.DEFAULT),
)
OURS = (who.FAST, who.DEFAULT, who.FINE)
BEST_IS_LOW = {"area_error_voronoi", "area_error_face", "hausdorff", "rms"}
PART = "bracket"  # the mesh with creases

INTRO = (
    "What other libraries do with the same meshes and the same length, from the run that "
    "[speed, measured](benchmarks.md) shows mesh by mesh, with the settings of each and how to repeat "
    "it. Nothing here is measured apart."
)
HINTS = (
    "The default preset is compared with libraries that project onto the input, the fast one, without "
    "projection, with those that do not.",
    "Nobody leads in all columns. Smaller distances come with triangles that stay as uneven as the "
    "input's, more even areas on the part with worse valences.",
    "On the two smallest meshes, of some hundred faces, some are faster than ours: there the calls "
    "themselves cost what the work does.",
    "The first call on a machine compiles for a while ([start](start.md)); the others come compiled.",
    "Not compared here: boundaries, labels, seams, provenance. [Parameters](parameters.md) shows what "
    "ours does with them.",
)


def comparison_page(results: Results) -> str:
    """Lay out the page; empty where there is nothing to compare."""
    entries = [*results.get("samples", {}).values(), *results.get("data", {}).values()]
    if not entries:
        return ""
    parts = [entry for entry in entries if entry["mesh"] == PART]
    smooth = [entry for entry in entries if entry["mesh"] != PART]
    return page(
        "Comparison with other libraries",
        INTRO,
        "## Time",
        f"How many times as long they take as ours with the same work, on {_listed(entries)}; one "
        "core. Below 1 they are faster.",
        _times(entries),
        "## Quality",
        f"Medians over {_listed(smooth)}. {LEGEND} The best of each column in bold.",
        _qualities(smooth),
        *(_part(entry) for entry in parts),
        "## What to take from it",
        "\n".join(f"- {hint}" for hint in HINTS),
        "## Measured on",
        measured_lines(entries),
    )


def _listed(entries: list[Entry]) -> str:
    return f"{len(entries)} meshes ({', '.join(entry['mesh'] for entry in entries)})"


def _times(entries: list[Entry]) -> str:
    rows = []
    for theirs, ours in PAIRS:
        found = {e["mesh"]: r for e in entries if (r := ratio(e, theirs, ours)) is not None}
        if not found:
            continue
        low, high = min(found, key=found.__getitem__), max(found, key=found.__getitem__)
        rows.append(
            [
                theirs,
                ours,
                CONTENDERS[theirs].projects,
                f"{median(found.values()):.1f}",
                f"{found[low]:.1f} ({low})",
                f"{found[high]:.1f} ({high})",
            ]
        )
    head = ["", "beside", "projects", "median", "least", "most"]
    return table(head, rows, text_columns=3)


def _qualities(entries: list[Entry]) -> str:
    """Medians of the measures over meshes on which all of them succeeded."""
    names = [*OURS, *(theirs for theirs, _ in PAIRS)]
    found = {
        name: [e["contenders"][name]["quality"] for e in entries if _succeeded(e, name)]
        for name in names
    }
    whole = {name: rows for name, rows in found.items() if len(rows) == len(entries)}
    measures = {
        name: {c.key: median(row[c.key] for row in rows) for c in COLUMNS}
        for name, rows in whole.items()
    }
    return _with_best(measures)


def _part(entry: Entry) -> str:
    names = [*OURS, *(theirs for theirs, _ in PAIRS)]
    measures = {n: entry["contenders"][n]["quality"] for n in names if _succeeded(entry, n)}
    return (
        f"## A part with creases\n\nThe same for {entry['mesh']}, {entry['faces']} faces. Distances "
        "tell who keeps the creases without being asked. PyMeshLab does with its defaults; lean, and "
        "mmgpy, were told not to look for any.\n\n" + _with_best(measures)
    )


def _with_best(measures: dict[str, dict[str, float]]) -> str:
    columns = [column for column in COLUMNS if column.key != "faces"]
    rows = [[name] for name in measures]
    for column in columns:
        shown = [f"{row[column.key]:,.{column.digits}f}" for row in measures.values()]
        choose = min if column.key in BEST_IS_LOW else max
        best = choose(shown, key=lambda text: float(text.replace(",", "")))
        for row, text in zip(rows, shown, strict=True):
            row.append(f"**{text}**" if text == best else text)
    return table(["", *(column.title for column in columns)], rows)


def _succeeded(entry: Entry, name: str) -> bool:
    return "quality" in entry["contenders"].get(name, {})
