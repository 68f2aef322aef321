"""What was promised, beside what was measured."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from . import contenders as who
from . import start
from .meshes import made
from .results import Entry, Results
from .tables import table

GIGABYTE = 1e9
SAMPLES = ("cat", "iphi_bad10k", "phands", "cow")


class Target(NamedTuple):
    """One figure that is promised."""

    group: str
    what: str
    measured: float | None  # None: not yet
    bound: float
    is_upper: bool = True
    unit: str = ""

    @property
    def is_met(self) -> bool:
        """Whether it was measured and holds."""
        if self.measured is None:
            return False
        return self.measured <= self.bound if self.is_upper else self.measured >= self.bound


def all_targets(results: Results) -> list[Target]:
    """Every target with its figure."""
    return [
        *_equal_work(results),
        *_projected(results),
        *_threads(results),
        *_large(results),
        *_start(results),
    ]


def as_table(results: Results) -> str:
    """Lay out all targets, those missed in bold."""
    targets = all_targets(results)
    rows = []
    group = ""
    for target in targets:
        sign = "<=" if target.is_upper else ">="
        name = target.group if target.group != group else ""
        group = target.group
        rows.append([name, target.what, _figure(target), f"{sign} {target.bound:g}{target.unit}"])
    missed = sum(target.measured is not None and not target.is_met for target in targets)
    unknown = sum(target.measured is None for target in targets)
    said = f"{len(targets) - missed - unknown} of {len(targets)} met, {missed} missed (in bold, with the"
    said += f" difference in parentheses), {unknown} not measured."
    return f"{said}\n\n" + table(["", "", "measured", "target"], rows, text_columns=2)


def _figure(target: Target) -> str:
    if target.measured is None:
        return "-"
    shown = f"{target.measured:.2f}{target.unit}"
    return shown if target.is_met else f"**{shown}** ({target.measured - target.bound:+.2f})"


def _equal_work(results: Results) -> Iterator[Target]:
    group = "fast without projection / trueform, one core"
    yield from _on_samples(results, group, who.FAST, who.TRUEFORM, 0.6)
    for factor, bound in ((0.9, 0.3), (0.5, 0.3), (2.0, 0.6)):
        entry = results.get("large", {}).get(made(64, factor))
        what = f"640,000 faces, L = {factor:g} x the mean edge"
        yield Target(group, what, ratio(entry, who.FAST, who.TRUEFORM), bound)


def _projected(results: Results) -> Iterator[Target]:
    large = results.get("large", {}).get(made(64))
    group = "default, with projection / trueform, without, one core"
    yield from _on_samples(results, group, who.DEFAULT, who.TRUEFORM, 2.0)
    yield Target(group, "640,000 faces", ratio(large, who.DEFAULT, who.TRUEFORM), 0.8)
    group = "default / PMP with projection, one core"
    yield from _on_samples(results, group, who.DEFAULT, who.PMP_PROJECTED, 0.2)
    yield Target(group, "640,000 faces", ratio(large, who.DEFAULT, who.PMP_PROJECTED), 0.2)


def _on_samples(
    results: Results, group: str, over: str, under: str, bound: float
) -> Iterator[Target]:
    for mesh in SAMPLES:
        entry = results.get("samples", {}).get(mesh)
        yield Target(group, mesh, ratio(entry, over, under), bound)


def _threads(results: Results) -> Iterator[Target]:
    entries = results.get("threads", {})
    for times, faces in ((64, "640,000 faces"), (256, "2.6 million faces")):
        for recipe in ("fast, no projection", "default"):
            for count, bound in ((2, 1.8), (16, 9.0)):
                if count == 16 and times < 256:
                    continue
                entry = _on_cores(entries, made(times), count)
                if count == 16 and entry is None:
                    continue
                one, more = (who.on_threads(recipe, n).name for n in (1, count))
                yield Target(
                    f"time on one thread / on {count}",
                    f"{recipe}, {faces}",
                    ratio(entry, one, more),
                    bound,
                    is_upper=False,
                )


def _on_cores(entries: dict[str, Entry], mesh: str, threads: int) -> Entry | None:
    """Find the measurement of a mesh on the smallest machine with so many cores."""
    fitting = [
        (int(entry["measured"]["cores"]), key)
        for key, entry in entries.items()
        if entry["mesh"] == mesh and int(entry["measured"]["cores"]) >= threads
    ]
    return entries[min(fitting)[1]] if fitting else None


def _large(results: Results) -> Iterator[Target]:
    entry = results.get("memory", {}).get(made(1024))
    for name in (who.DEFAULT_ALL, who.FAST_ALL):
        row = entry["contenders"].get(name, {}) if entry else {}
        peak = row["bytes_peak"] / GIGABYTE if "bytes_peak" in row else None
        yield Target("10 million faces, peak memory", name, peak, 8.0, unit=" GB")
    few, many = (results.get("per-face", {}).get(made(times)) for times in (36, 400))
    for name in (who.DEFAULT, who.FAST):
        costs = [_per_face(entry, name) for entry in (few, many)]
        measured = costs[1] / costs[0] if costs[0] and costs[1] else None
        yield Target("cost of a face at 4 million / at 360,000, one core", name, measured, 1.3)


def _per_face(entry: Entry | None, name: str) -> float | None:
    row = entry["contenders"].get(name, {}) if entry else {}
    return row["median"] / entry["faces"] if entry and "median" in row else None


def _start(results: Results) -> Iterator[Target]:
    entry = results.get("start", {}).get(start.MESHES[0])
    ready = start.ready_after(entry) if entry else None
    cold = start.compiling(entry) if entry else None
    yield Target("start, default", "import and first call, compiled before", ready, 1.0, unit=" s")
    yield Target("start, default", "compiling on a new machine", cold, 20.0, unit=" s")


def ratio(entry: Entry | None, over: str, under: str, key: str = "median") -> float | None:
    """Divide two medians; None where one is missing."""
    rows = entry["contenders"] if entry else {}
    above, below = (rows.get(name, {}).get(key) for name in (over, under))
    return above / below if above and below else None
