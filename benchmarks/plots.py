"""Plots of the results, where matplotlib is installed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from . import contenders as who
from .contenders import CONTENDERS
from .results import Entry, Results

SIZE, DPI = (7.6, 4.6), 130
OURS = {
    who.FAST: ("#c2185b", "-"),
    who.FAST_ALL: ("#c2185b", "--"),
    who.DEFAULT: ("#1565c0", "-"),
    who.DEFAULT_ALL: ("#1565c0", "--"),
}
PEERS = ("#555555", "#2e7d32", "#ef6c00", "#6a1b9a", "#00838f", "#9e9d24", "#795548", "#ad8a00",
         "#78909c", "#b0685a")  # fmt: skip
MARKS = "osD^v<>pPX"
# In the order of a call; what a report names besides comes last.
PHASES = ("check", "build", "reference", "split", "collapse", "flip", "slide", "relax", "project",
          "unfold", "finish", "locate", "extract")  # fmt: skip


def write_plots(folder: Path, results: Results) -> set[str]:
    """Draw what there are results for; returns the names of all plots in the folder."""
    if find_spec("matplotlib") is None:
        print("matplotlib is not installed: no plots", file=sys.stderr)
    else:
        for name, draw in DRAWERS.items():
            _draw(folder / f"{name}.png", draw, results)
    return {path.stem for path in folder.glob("*.png")}


def _draw(path: Path, draw: Callable[[Any, Results], bool], results: Results) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=SIZE, layout="constrained")
    if draw(axes, results):
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=DPI, metadata={"Software": None})
        print(f"wrote {path.parent.name}/{path.name}", file=sys.stderr)
    pyplot.close(figure)


def _time(axes: Any, results: Results) -> bool:
    lines = _lines(results.get("sizes", {}), lambda row: row.get("median"))
    axes.set_ylabel("seconds")
    return _against_faces(axes, lines, "Time of a call")


def _memory(axes: Any, results: Results) -> bool:
    entries = {**results.get("sizes", {}), **results.get("memory", {})}
    lines = _lines(entries, lambda row: row.get("bytes_peak", 0) / 1e9)
    axes.set_ylabel("GB")
    return _against_faces(axes, lines, "Peak memory of the process, libraries and mesh included")


def _lines(
    entries: dict[str, Entry], figure: Callable[[Any], float | None]
) -> dict[str, list[tuple[int, float]]]:
    """Faces and figure of every contender, by size."""
    lines: dict[str, list[tuple[int, float]]] = {}
    for entry in sorted(entries.values(), key=lambda entry: entry["faces"]):
        for name in CONTENDERS:
            row = entry["contenders"].get(name, {"failed": ""})
            value = None if "failed" in row else figure(row)
            if value:
                lines.setdefault(name, []).append((entry["faces"], value))
    return lines


def _against_faces(axes: Any, lines: dict[str, list[tuple[int, float]]], title: str) -> bool:
    styles = _styles(lines)
    for name in sorted(lines, key=lambda name: name in OURS):  # ours on top
        faces, values = zip(*lines[name], strict=True)
        axes.plot(faces, values, label=name, **styles[name])
    axes.set(xscale="log", yscale="log", xlabel="faces of the input", title=title)
    axes.xaxis.set_major_formatter(lambda faces, _: _short(faces))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.grid(which="both", alpha=0.2)
    _legend_beside(axes)
    return bool(lines)


def _short(count: float) -> str:
    """Write 10,000 as 10k, and a million as 1M."""
    return f"{count / 1e6:g}M" if count >= 1e6 else f"{count / 1e3:g}k"


def _styles(names: Any) -> dict[str, dict[str, Any]]:
    """Colours: ours bold, one for every peer; thin and dashed on all cores."""
    styles = {}
    packages = list(dict.fromkeys(c.package for c in CONTENDERS.values() if not c.is_ours))
    for name in names:
        contender = CONTENDERS[name]
        if name in OURS:
            colour, line = OURS[name]
            styles[name] = {"color": colour, "linestyle": line, "linewidth": 2.4, "marker": "o"}
            continue
        k = packages.index(contender.package)
        first = next(c for c in CONTENDERS.values() if c.package == contender.package)
        styles[name] = {
            "color": PEERS[k % len(PEERS)],
            "linestyle": "-" if contender is first else "--" if contender.all_cores else ":",
            "linewidth": 1.2,
            "marker": MARKS[k % len(MARKS)],
            "markersize": 4,
        }
    return styles


def _legend_beside(axes: Any) -> None:
    """Put the legend to the right, in the order of the last values, highest first."""
    handles, labels = axes.get_legend_handles_labels()
    order = sorted(
        range(len(handles)),
        key=lambda k: (
            (-handles[k].get_xdata()[-1], -handles[k].get_ydata()[-1])
            if len(handles[k].get_xdata())
            else (0, 0)
        ),
    )
    axes.legend(
        [handles[k] for k in order],
        [labels[k] for k in order],
        loc="center left",
        bbox_to_anchor=(1.0, 0.5),
        fontsize=7.5,
        frameon=False,
    )


def thread_counts(entry: Entry) -> list[int]:
    """Numbers of threads of an entry of the part ``threads``."""
    return sorted({int(name.rpartition(",")[2].split()[0]) for name in entry["contenders"]})


def _threads(axes: Any, results: Results) -> bool:
    most = 1
    for entry in results.get("threads", {}).values():
        for k, recipe in enumerate(("fast, no projection", "default")):
            rows = {n: entry["contenders"].get(who.on_threads(recipe, n).name, {})
                    for n in thread_counts(entry)}  # fmt: skip
            medians = {n: row["median"] for n, row in rows.items() if "median" in row}
            if 1 not in medians:
                continue
            most = max(most, *medians)
            axes.plot(
                list(medians),
                [medians[1] / seconds for seconds in medians.values()],
                label=f"{recipe}, {entry['faces']:,} faces, {entry['measured']['cores']} cores",
                color=("#c2185b", "#1565c0")[k],
                linestyle="-" if entry["faces"] > 1e6 else "--",
                marker="o",
            )
    axes.plot([1, most], [1, most], color="#aaaaaa", linewidth=1.0, label="perfect")
    ticks = [1 << k for k in range(most.bit_length())]
    axes.set(xlabel="threads", title="Times faster than one thread", xticks=ticks)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, frameon=False)
    return most > 1


def _phases(axes: Any, results: Results) -> bool:
    """Draw a bar for every recipe on every mesh, in microseconds a face."""
    from matplotlib import colormaps

    bars = [
        (f"{entry['mesh']}\n{recipe}", entry["recipes"][recipe], entry["faces"])
        for entry in sorted(results.get("phases", {}).values(), key=lambda e: e["faces"])
        for recipe in entry["recipes"]
    ]
    named = {phase for _, seconds, _ in bars for phase in seconds} - {"total"}
    phases = [p for p in PHASES if p in named] + sorted(named - set(PHASES))
    ends = [0.0] * len(bars)
    for k, phase in enumerate([*phases, "between"]):
        widths = [1e6 * _seconds_of(seconds, phase) / faces for _, seconds, faces in bars]
        colour = "#dddddd" if phase == "between" else colormaps["tab20"](k % 20)
        axes.barh(range(len(bars)), widths, left=ends, label=phase, color=colour, height=0.75)
        ends = [end + width for end, width in zip(ends, widths, strict=True)]
    axes.set_yticks(range(len(bars)), [label for label, _, _ in bars], fontsize=7)
    axes.invert_yaxis()
    axes.set(xlabel="microseconds a face of the input, one core", title="Time by phase")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    return bool(bars)


def _seconds_of(seconds: dict[str, float], phase: str) -> float:
    if phase != "between":
        return seconds.get(phase, 0.0)
    return max(2 * seconds["total"] - sum(seconds.values()), 0.0)  # the total is in the sum


DRAWERS: dict[str, Callable[[Any, Results], bool]] = {
    "time": _time,
    "memory": _memory,
    "threads": _threads,
    "phases": _phases,
}
