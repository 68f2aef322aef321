"""The parts of the suite: which contenders race on which meshes, and how long."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from remeshvec.core.threads import available_threads

from . import contenders as who
from . import phases, start
from .contenders import CONTENDERS, Contender
from .meshes import DATA, LENGTH_FACTOR, SAMPLES, find_file, load, made
from .race import Effort, Entrant, Row, race
from .results import read_results, record
from .tables import usable_cores

# Taken as lost on a mesh with four times the faces: more time than this share of the limit.
TOO_SLOW = 0.2


class Run(NamedTuple):
    """What the command line asks for."""

    folder: Path
    meshes: Sequence[str] = ()  # all
    contenders: Sequence[str] = ()  # all
    repeat: int | None = None  # as the part has it
    limit: float | None = None
    budget: float | None = None
    deadline: float = float("inf")  # no case starts after that, on the monotonic clock
    only_missing: bool = False
    quick: bool = False


class Case(NamedTuple):
    """Contenders on meshes, all in one race."""

    meshes: tuple[str, ...]
    contenders: Sequence[Contender]


class Part(NamedTuple):
    """One part of the suite."""

    about: str
    minutes: float  # about, on two cores
    for_targets: bool
    cases: Callable[[bool], list[Case]]  # of a quick run or not
    effort: Effort = Effort()
    grows: bool = False  # who is too slow on one mesh is left out on the next
    key: Callable[[str], str] = str  # name of an entry, from the mesh


def _all_on_one_core() -> list[Contender]:
    return [c for c in CONTENDERS.values() if not c.all_cores]


def _named(*names: str) -> list[Contender]:
    return [CONTENDERS[name] for name in names]


def _samples(quick: bool) -> list[Case]:
    names = [name for name in SAMPLES if find_file(name)]
    return [Case((name,), _all_on_one_core()) for name in (names[-2:] if quick else names)]


def _data(quick: bool) -> list[Case]:
    return [Case((name,), _all_on_one_core()) for name in (DATA[1:2] if quick else DATA)]


def _large(quick: bool) -> list[Case]:
    equal_work = _named(who.FAST, who.FAST_PLAIN, who.TRUEFORM, who.DEFAULT)
    peers = _named(who.MESHLIB, who.PMP_PROJECTED)
    times = 4 if quick else 64
    return [
        Case((made(times),), equal_work + peers),
        Case((made(times, 0.5),), equal_work),
        Case((made(times, 2.0),), equal_work),
    ]


def _threads(quick: bool) -> list[Case]:
    most = min(usable_cores(), available_threads())
    counts = sorted({*(1 << k for k in range(most.bit_length())), most})
    contenders = [
        who.on_threads(recipe, count)
        for recipe in ("fast, no projection", "default")
        for count in counts
    ]
    return [Case((made(times),), contenders) for times in ((9,) if quick else (64, 256))]


def _per_face(quick: bool) -> list[Case]:
    meshes = tuple(map(made, (1, 9) if quick else (36, 400)))
    return [Case(meshes, _named(who.FAST, who.DEFAULT))]


def _memory(quick: bool) -> list[Case]:
    return [Case((made(16 if quick else 1024),), _named(who.DEFAULT_ALL, who.FAST_ALL))]


def _sizes(quick: bool) -> list[Case]:
    left_out = {who.FAST_PLAIN, who.FINE, who.PYMESHLAB}
    contenders = [c for c in CONTENDERS.values() if c.name not in left_out]
    if usable_cores() == 1:
        contenders = [c for c in contenders if not c.all_cores]
    return [Case((made(n),), contenders) for n in ((1, 4) if quick else (1, 4, 16, 64, 256))]


def _on_these_cores(mesh: str) -> str:
    return f"{mesh} on {usable_cores()} cores"


RACES = {
    "samples": Part("the meshes of the report, all contenders on one core", 5, True, _samples),
    "large": Part(
        "640,000 faces: finer, as it is, coarser",
        8,
        True,
        _large,
        Effort(limit=120.0, budget=150.0),
    ),
    "threads": Part(
        "640,000 and 2.6 million faces on one thread and more",
        4,
        True,
        _threads,
        Effort(limit=300.0, budget=150.0, has_quality=False),
        key=_on_these_cores,
    ),
    "per-face": Part(
        "cost of a face at 4 million over that at 360,000",
        3,
        True,
        _per_face,
        Effort(limit=300.0, budget=150.0, has_quality=False),
    ),
    "memory": Part(
        "10 million faces: peak memory",
        3,
        True,
        _memory,
        Effort(repeat=0, limit=600.0, has_quality=False),
    ),
    "data": Part("the meshes in data/, all contenders on one core", 5, False, _data),
    "sizes": Part(
        "time and memory against faces, all contenders",
        20,
        False,
        _sizes,
        Effort(limit=60.0, budget=40.0),
        grows=True,
    ),
}


class Other(NamedTuple):
    """A part that is no race."""

    about: str
    minutes: float
    for_targets: bool
    run: Callable[[Path, int, bool], None]  # folder, repeat, quick


OTHERS = {
    "start": Other("import, first call, compilation, in fresh processes", 3, True, start.run),
    "phases": Other("time by phase", 1, False, phases.run),
}

# From the most important to the least.
PARTS: dict[str, Part | Other] = {
    name: {**RACES, **OTHERS}[name]
    for name in (
        "samples", "large", "threads", "per-face", "memory", "start", "phases", "data", "sizes",
    )
}  # fmt: skip


def run_part(name: str, run: Run) -> None:
    """Measure a part, and record each case when it is done."""
    part = PARTS[name]
    if isinstance(part, Other):
        if run.only_missing and read_results(run.folder).get(name):
            return
        part.run(run.folder, run.repeat or (2 if run.quick else 5), run.quick)
        return
    effort = _effort(part, run)
    lost: dict[str, str] = {}
    for case in _wanted(part, run):
        if run.only_missing and _is_known(name, part, case, run.folder):
            continue
        if monotonic() > run.deadline:
            print(f"no time left for {name}, {', '.join(case.meshes)}", file=sys.stderr)
            continue
        rows = _run_case(name, part, case, effort, run.folder, lost)
        if part.grows:
            lost |= {who: why for who, row in rows.items() if (why := _is_lost(row, effort.limit))}


def _effort(part: Part, run: Run) -> Effort:
    quick = {"repeat": min(part.effort.repeat, 2), "budget": 5.0} if run.quick else {}
    asked = {"repeat": run.repeat, "limit": run.limit, "budget": run.budget}
    if part.effort.repeat == 0:
        del asked["repeat"]
    return part.effort._replace(**quick)._replace(
        **{key: value for key, value in asked.items() if value is not None}
    )


def _wanted(part: Part, run: Run) -> list[Case]:
    """The cases asked for; a mesh that the part does not have gets the contenders of its first."""
    cases = part.cases(run.quick)
    if run.meshes:
        known = {mesh for case in cases for mesh in case.meshes}
        others = [mesh for mesh in run.meshes if mesh not in known]
        extra = [Case((mesh,), cases[0].contenders) for mesh in others] if cases else []
        cases = [case for case in cases if set(case.meshes) & set(run.meshes)] + extra
    if run.contenders:
        cases = [
            case._replace(contenders=[c for c in case.contenders if c.name in run.contenders])
            for case in cases
        ]
    return cases


def _is_known(name: str, part: Part, case: Case, folder: Path) -> bool:
    return {part.key(mesh) for mesh in case.meshes} <= set(read_results(folder).get(name, {}))


def _run_case(
    name: str, part: Part, case: Case, effort: Effort, folder: Path, lost: dict[str, str]
) -> dict[str, Row]:
    """Race and record; returns the rows of the last mesh by contender."""
    print(f"{name}: {', '.join(case.meshes)}", file=sys.stderr, flush=True)
    present = [c for c in case.contenders if c.is_installed]
    running = [c for c in present if c.name not in lost]
    samples = [load(mesh) for mesh in case.meshes]
    entrants = [Entrant(contender, sample) for sample in samples for contender in running]
    found = iter(race(entrants, effort))
    rows: dict[str, Row] = {}
    for sample in samples:
        ran = {contender.name: next(found) for contender in running}
        rows = {c.name: ran.get(c.name) or {"failed": lost[c.name]} for c in present}
        entry = {
            "mesh": sample.name,
            "vertices": len(sample.V),
            "faces": len(sample.F),
            "length": sample.length,
            "factor": float(sample.name.partition("@")[2] or LENGTH_FACTOR),
            "bytes": sample.V.nbytes + sample.F.nbytes,
            "contenders": rows,
        }
        record(folder, name, part.key(sample.name), entry)
    return rows


def _is_lost(row: Row, limit: float) -> str:
    """Say why a contender is left out on the next, larger mesh; empty if it is not."""
    if "failed" in row:
        return (
            row["failed"] if row["failed"].startswith("left out") else "left out: " + row["failed"]
        )
    took = row.get("median", row["first"])
    return f"left out: {took:.1f} s on the mesh before" if took > TOO_SLOW * limit else ""
