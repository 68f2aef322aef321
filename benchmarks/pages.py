"""The pages: laid out from the results alone, so they can be written again without measuring."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from . import contenders as who
from . import plots, start, targets
from .comparison import comparison_page
from .contenders import CONTENDERS
from .measures import COLUMNS, LEGEND, cells
from .meshes import SAMPLES
from .parts import PARTS
from .race import Row
from .results import Entry, Results, measured_lines, read_results
from .tables import milliseconds, page, table, write_page
from .targets import ratio

# The report's table, seconds: its Python code, and what it quotes for the PMP library.
REPORT_PYTHON = {
    "cat": 58.52,
    "iphi_bad10k": 37.06,
    "phands": 34.1,
    "cow": 25.06,
    "wolf_head": 1.15,
}
REPORT_PMP = {"cat": 0.13}
REPORT_NAMES = {"phands": "Hand"}

RATIOS = (
    ("fast / trueform", who.FAST, who.TRUEFORM),
    ("default / trueform", who.DEFAULT, who.TRUEFORM),
    ("PMP, no projection / fast", who.PMP, who.FAST),
    ("MeshLib / fast", who.MESHLIB, who.FAST),
    ("PMP / default", who.PMP_PROJECTED, who.DEFAULT),
    ("MeshLib, relaxed / default", who.MESHLIB_EVEN, who.DEFAULT),
    ("gpytoolbox / default", who.GPYTOOLBOX, who.DEFAULT),
    ("compas_cgal / default", who.CGAL, who.DEFAULT),
    ("PyMeshLab, lean / default", who.PYMESHLAB_LEAN, who.DEFAULT),
    ("mmgpy / default", who.MMG, who.DEFAULT),
    ("pyacvd / default", who.ACVD, who.DEFAULT),
    ("pyinstantmeshes / default", who.FIELD, who.DEFAULT),
)
INTRO = (
    "L = 0.9 x the mean edge length of the input unless stated otherwise, the same for all. "
    "Contenders run warm, in turns (A B C A B C ...), each in a separate process; one core "
    "means bound to one core. Arrays in, arrays out. Medians of five turns, unless a number of turns is "
    "given. `-x16`: the input cut into 16 times the faces, vertices moved at random within their faces; "
    "`@0.5`: L = 0.5 x the mean edge."
)

HOW = """## How to measure

```sh
pip install -e '.[peers]'            # every library is optional; absent ones are named above
export REMESHVEC_PMP=~/pmp/remesh    # also optional
python -m benchmarks                 # all parts, the most important first
python -m benchmarks targets         # those that the table of targets needs
python -m benchmarks large threads   # some; --help lists them and what they take
python -m benchmarks --missing       # continue a run that was stopped
python -m benchmarks --quick         # does everything run? Small meshes, into build/benchmarks
python -m benchmarks --merge FILE    # take over the benchmarks.json of another machine
pytest benchmarks                    # phases, calls and starts one at a time; -m slow from 1M faces
```

All results are in `benchmarks.json`, each with its date and machine, and are written after every mesh.
A contender that fails, crashes or takes too long loses only its own row.

The executable for the PMP library gets `INPUT OUTPUT LENGTH ITERATIONS PROJECT` (OFF files, PROJECT 0
or 1) and prints the seconds of the remeshing alone. Built with `-O3 -march=native`, it runs in essence:

```cpp
pmp::SurfaceMesh mesh;
pmp::read(mesh, argv[1]);
const auto start = std::chrono::steady_clock::now();
pmp::uniform_remeshing(mesh, std::atof(argv[3]), std::atoi(argv[4]), std::atoi(argv[5]) != 0);
const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
pmp::write(mesh, argv[2]);
std::printf("%.6f\\n", seconds.count());
```"""


def write_pages(folder: Path) -> None:
    """Write all pages and plots for which there are results."""
    results = read_results(folder)
    pictures = plots.write_plots(folder / "plots", results)
    for name, text in {
        "benchmarks.md": _benchmarks(results, pictures),
        "comparison.md": comparison_page(results),
        "threads.md": _threads(results, pictures),
        "start.md": start.as_page(results),
    }.items():
        if text:
            write_page(folder, name, text)


def _benchmarks(results: Results, pictures: set[str]) -> str:
    races = {part: results.get(part, {}) for part in ("samples", "data", "large", "sizes")}
    compared = [*races["samples"].values(), *races["data"].values()]
    return page(
        "Speed, measured",
        INTRO,
        _absent(entry for entries in races.values() for entry in entries.values()),
        "## Targets",
        targets.as_table(results),
        "## The report's table",
        _report_table(races["samples"]),
        "## Time and memory against faces",
        _picture(pictures, "time", "Time against faces"),
        _picture(pictures, "memory", "Peak memory against faces"),
        _times(races["sizes"]),
        _memory(results.get("memory", {})),
        "## Ratios of times",
        "Ratios of medians; in parentheses those of processor time, which a busy machine disturbs less.",
        _ratio_table([*compared, *races["large"].values()]),
        "## Phases",
        _picture(pictures, "phases", "Time by phase"),
        "## Time beside quality",
        LEGEND + " x default: time over that of remeshvec default. Memory: peak of the process, in "
        "parentheses the part above its libraries and the mesh.",
        *(_mesh(entry) for entry in (*compared, *races["large"].values())),
        "## Settings",
        _settings(),
        HOW,
        "## Measured on",
        *_dates(results),
    )


def _picture(pictures: set[str], name: str, title: str) -> str:
    return f"![{title}](plots/{name}.png)" if name in pictures else ""


def _absent(entries: Iterable[Entry]) -> str:
    """Name the peers of which nothing was measured."""
    seen = {name for entry in entries for name in entry["contenders"]}
    ran = {CONTENDERS[name].package for name in seen if name in CONTENDERS}
    absent = sorted({c.package for c in CONTENDERS.values()} - ran)
    return f"Not installed where this was measured: {', '.join(absent)}." if absent else ""


# --- tables of several meshes --------------------------------------------------------------------


def _report_table(entries: dict[str, Entry]) -> str:
    """Lay out the report's own table with our columns."""
    measured = (who.PMP, who.PMP_PROJECTED, who.FAST, who.DEFAULT)
    rows = []
    for mesh in SAMPLES:
        if mesh not in entries:
            continue
        found = [_time(entries[mesh]["contenders"].get(name)) for name in measured]
        quoted = [1e3 * REPORT_PYTHON[mesh], 1e3 * REPORT_PMP.get(mesh, 0.0)]
        rows.append(
            [
                REPORT_NAMES.get(mesh, mesh),
                f"{entries[mesh]['faces']:,}",
                *(f"{ms:,.0f}" if ms else "" for ms in quoted),
                *found,
            ]
        )
    if not rows:
        return "Its meshes are not part of this repository and were not available."
    head = ["mesh", "faces", "report's Python *", "PMP as the report has it *"]
    return (
        "Milliseconds. Columns with * are quoted from the report, which measured them elsewhere; the "
        "others are measured here, on one core. The report's code does not project.\n\n"
        + table([*head, *measured], rows)
    )


def _times(entries: dict[str, Entry]) -> str:
    names = _names(entries.values())
    if not names:
        return ""
    sized = _by_size(entries)
    head = ["ms", *(f"{entry['faces']:,}" for entry in sized)]
    rows = [[name, *(_time(e["contenders"].get(name)) for e in sized)] for name in names]
    return table(head, rows) + "\n\n" + _failures(sized)


def _memory(entries: dict[str, Entry]) -> str:
    """Lay out the largest meshes."""
    rows = [
        [
            name,
            f"{entry['faces']:,}",
            f"{entry['bytes'] / 1e9:.2f}",
            f"{row['bytes_before'] / 1e9:.2f}",
            f"{row['bytes_peak'] / 1e9:.2f}",
            f"{row['first']:.1f}",
        ]
        for entry in _by_size(entries)
        for name, row in entry["contenders"].items()
        if "failed" not in row
    ]
    if not rows:
        return ""
    head = ["", "faces", "arrays, GB", "before the call, GB", "peak, GB", "seconds"]
    return (
        "The first call of a fresh process on the largest mesh: size of the arrays, and peak memory of "
        "the process before the call (libraries and mesh) and after it.\n\n" + table(head, rows)
    )


def _ratio_table(entries: list[Entry]) -> str:
    if not entries:
        return ""
    head = ["mesh", "faces", *(title for title, _, _ in RATIOS)]
    rows = [
        [e["mesh"], f"{e['faces']:,}", *(_ratio(e, over, under) for _, over, under in RATIOS)]
        for e in entries
    ]
    return table(head, rows)


def _ratio(entry: Entry, over: str, under: str) -> str:
    wall, cpu = (ratio(entry, over, under, key) for key in ("median", "cpu_median"))
    if wall is None:
        return "-"
    return f"{wall:.2f} ({cpu:.2f})" if cpu else f"{wall:.2f}"


# --- one mesh ------------------------------------------------------------------------------------


def _mesh(entry: Entry) -> str:
    """Lay out time, memory and quality of every contender."""
    rows = [
        [
            name,
            CONTENDERS[name].projects if name in CONTENDERS else "",
            _time(row),
            _times_default(entry, name),
            _peak(row),
            *cells(row["quality"]),
        ]
        for name, row in entry["contenders"].items()
        if "failed" not in row
    ]
    head = ["", "projects", "ms", "x default", "memory, MB", *(c.title for c in COLUMNS)]
    title = f"### {entry['mesh']}, {entry['faces']:,} faces"
    parts = (title, table(head, rows, text_columns=2), _failures([entry]))
    return "\n\n".join(part for part in parts if part)


def _times_default(entry: Entry, name: str) -> str:
    times = ratio(entry, name, who.DEFAULT)
    return f"{times:.2f}" if times else "-"


def _peak(row: Row) -> str:
    """Peak memory and what the call itself needed; an executable reads the mesh itself."""
    if not row["bytes_peak"]:
        return "-"
    beyond = (row["bytes_peak"] - row["bytes_before"]) / 1e6
    return f"{row['bytes_peak'] / 1e6:,.0f}" + (f" (+{beyond:,.0f})" if row["bytes_before"] else "")


def _time(row: Row | None) -> str:
    if row is None:
        return "-"
    if "median" not in row:
        is_slow = row.get("failed", "").startswith(("left out", "no result within"))
        return "too slow" if is_slow else "failed"
    turns = len(row["seconds"])
    return milliseconds(row["median"]) + (f" ({turns} turns)" if turns < 5 else "")


def _failures(entries: Iterable[Entry]) -> str:
    return "\n".join(
        f"- {name} on {entry['mesh']}: {row['failed']}"
        for entry in entries
        for name, row in entry["contenders"].items()
        if "failed" in row
    )


# --- other pages ---------------------------------------------------------------------------------


def _threads(results: Results, pictures: set[str]) -> str:
    entries = _by_size(results.get("threads", {}))
    if not entries:
        return ""
    rows = []
    for entry in entries:
        for recipe in ("fast, no projection", "default"):
            rows.append(
                [entry["mesh"], entry["measured"]["cores"], recipe, *_speedups(entry, recipe)]
            )
    counts = sorted({n for entry in entries for n in plots.thread_counts(entry)})
    rows = [row + [""] * (3 + len(counts) - len(row)) for row in rows]
    agree = all(_digests_agree(entry) for entry in entries)
    head = ["mesh", "cores", "options", *(f"{n} thread{'s' * (n > 1)}" for n in counts)]
    return page(
        "Threads",
        "Times in ms, medians; in parentheses how many times faster than one thread. The targets are "
        "1.8 on two threads, and 9 on sixteen from 2.5 million faces. "
        + (
            "All runs on the same mesh gave the same bytes: vertices, faces, births and counts."
            if agree
            else "**Runs gave different bytes.**"
        ),
        _picture(pictures, "threads", "Times faster than one thread"),
        table(head, rows, text_columns=3),
        measured_lines(entries),
    )


def _speedups(entry: Entry, recipe: str) -> list[str]:
    one = who.on_threads(recipe, 1).name
    names = [who.on_threads(recipe, n).name for n in plots.thread_counts(entry)]
    found = [(entry["contenders"].get(name), ratio(entry, one, name)) for name in names]
    return [_time(row) + (f" ({times:.2f})" if times else "") for row, times in found]


def _digests_agree(entry: Entry) -> bool:
    digests: dict[str, set[str]] = {}
    for name, row in entry["contenders"].items():
        if "digest" in row:
            digests.setdefault(name.rpartition(",")[0], set()).add(row["digest"])
    return all(len(found) == 1 for found in digests.values())


def _settings() -> str:
    return "\n".join(f"- {c.name}: {c.settings}" for c in CONTENDERS.values())


def _dates(results: Results) -> list[str]:
    return [
        f"**{part}** ({PARTS[part].about}). {measured_lines(results[part].values())}"
        for part in PARTS
        if results.get(part)
    ]


def _names(entries: Iterable[Entry]) -> list[str]:
    """Contenders in the order of `CONTENDERS`."""
    seen = {name for entry in entries for name in entry["contenders"]}
    return [name for name in CONTENDERS if name in seen]


def _by_size(entries: dict[str, Entry]) -> list[Entry]:
    return sorted(entries.values(), key=lambda entry: (entry["faces"], entry["mesh"]))


if __name__ == "__main__":
    write_pages(Path(sys.argv[1]))
