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
    (who.FIELD, who.DEFAULT),
)
OURS = (who.FAST, who.DEFAULT, who.FINE)
BEST_IS_LOW = {"area_error_voronoi", "area_error_face", "hausdorff", "rms"}
PART = "bracket"  # the mesh with creases

INTRO = (
    "This page compares other libraries on the same meshes with the same length. All numbers come from "
    "the run that [speed, measured](benchmarks.md) shows mesh by mesh, with the settings of each library "
    "and how to repeat it."
)
HINTS = (
    "The default preset is compared with libraries that project onto the input, the fast preset without "
    "projection with those that do not.",
    "No library leads in all columns. Smaller distances come with triangles that stay as uneven as those "
    "of the input, and more even areas on the part come with worse valences.",
    "On the two smallest meshes, of a few hundred faces, some libraries are faster: there the calls "
    "themselves cost as much as the work.",
    "The first call of remeshvec on a machine compiles for a while ([start](start.md)); the other "
    "libraries come compiled.",
    "Boundaries, labels, seams and provenance are not compared here. [Parameters](parameters.md) shows "
    "them for remeshvec.",
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
        "Times of other libraries over that of the remeshvec preset that does the same work, on "
        f"{_listed(entries)}; one core. Below 1 the other library is faster.",
        _times(entries),
        "## Quality",
        f"Medians over {_listed(smooth)}. {LEGEND} The best of each column in bold.",
        _qualities(smooth),
        *(_part(entry) for entry in parts),
        "## Remarks",
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
    head = ["", "compared with", "projects", "median", "least", "most"]
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
        f"## A part with creases\n\nThe same measures for {entry['mesh']}, {entry['faces']} faces. "
        "Distances show which libraries keep the creases without being asked. PyMeshLab does with its "
        "defaults; PyMeshLab, lean, and mmgpy were told not to look for creases.\n\n"
        + _with_best(measures)
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
