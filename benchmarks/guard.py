"""A guard against getting slower that holds on noisy machines: ``python -m benchmarks.guard``.

Two measures, both of one thread with compiled kernels, both minima over rounds:

- Instructions, where Linux lets a process count its own: repeatable within a percent whatever else
  runs, so that a few percent more are seen. They depend on the machine code, so they are compared only
  where processor features and versions are those of the record, and where the reference kernel below
  takes as many as recorded.
- Processor time, as a ratio to the reference kernel, which runs in between. It holds on any machine
  with a generous limit, and sees what instructions do not: loads that miss the cache, divisions.

The record is ``guard.json`` beside this file. ``--write`` replaces what it says of this machine; commit
it together with the change that made it necessary.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import hashlib
import json
import os
import platform
import struct
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from time import get_clock_info, perf_counter, thread_time
from typing import Any, NamedTuple
from unittest.mock import patch

import numba
import numpy as np
from llvmlite import binding

import remeshvec
import remeshvec.core.stopwatch

from .meshes import load

FILE = Path(__file__).with_suffix(".json")

CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "creature, default": ("creature", {}),
    "creature, fast, no projection": ("creature", {"preset": "fast", "project": False}),
    "pretzel, default": ("pretzel", {}),
    "pretzel, fast, no projection": ("pretzel", {"preset": "fast", "project": False}),
}

# How many times the record is too much. Of a phase more than of the whole: work may move from one to
# another; and phases below this share of the whole are not looked at.
INSTRUCTIONS = 1.08
PHASE_INSTRUCTIONS = 1.2
SMALL = 0.03
TIME = 1.6
# The reference kernel never changes, so more than this means other machine code.
SAME_CODE = 1.02

ROUNDS = 8
ATTEMPTS = 3  # before an alarm: noise comes and goes

Phases = dict[str, float]  # "total" among them


class Found(NamedTuple):
    """What was measured."""

    times: dict[str, float]  # of the reference kernel's
    instructions: dict[str, Phases] | None  # millions; None: cannot be counted here
    reference: float  # millions of instructions of the reference kernel


# -- the reference kernel ------------------------------------------------------------------------


# Never to be changed, nor what is below it, nor its flags: all records are in units of it.
@numba.njit(cache=True, error_model="numpy")
def _walk(origin, twin, first, X, rows, rounds):  # type: ignore[no-untyped-def]
    """What remeshing does all the time: walk rings, gather rows, branch on what they say."""
    turned = 0
    for _ in range(rounds):
        for v in range(first.size):
            h = first[v]
            x = y = z = 0.0
            for _ in range(12):
                f = h // 3
                a = 3 * f + (h + 1) % 3
                b = 3 * f + (h + 2) % 3
                p, q = origin[a], origin[b]
                ux, uy, uz = X[p, 0] - X[v, 0], X[p, 1] - X[v, 1], X[p, 2] - X[v, 2]
                wx, wy, wz = X[q, 0] - X[v, 0], X[q, 1] - X[v, 1], X[q, 2] - X[v, 2]
                dot = ux * wx + uy * wy + uz * wz
                size = np.sqrt((ux * ux + uy * uy + uz * uz) * (wx * wx + wy * wy + wz * wz))
                if dot > 0.5 * size:
                    x += uy * wz - uz * wy
                    y += uz * wx - ux * wz
                    z += ux * wy - uy * wx
                else:
                    turned += 1
                    x -= 0.5 * dot / size
                if X[p, 2] > X[q, 2]:
                    turned += p & 1
                h = twin[b]
                if h == first[v]:
                    break
            rows[v, 0] = x
            rows[v, 1] = y
            rows[v, 2] = z
    return turned


@cache
def _torus() -> tuple[Any, ...]:
    """Arguments of `_walk`: half-edges of a torus, its vertices moved and renumbered irregularly."""
    n = 96
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    noise = _hash(np.arange(2 * n * n)).reshape(2, -1) / 2.0**32 - 0.5
    s, t = 2.0 * np.pi / n * (np.stack([i, j]) + 0.8 * noise)
    ring = 1.0 + 0.4 * np.cos(t)
    V = np.column_stack([ring * np.cos(s), ring * np.sin(s), 0.4 * np.sin(t)])
    order = np.lexsort((_hash(np.arange(n * n)), np.arange(n * n) // 64))
    new = np.empty(n * n, np.int64)
    new[order] = np.arange(n * n)

    def at(di: int, dj: int) -> Any:
        return new[(i + di) % n * n + (j + dj) % n]

    lower = np.column_stack([at(0, 0), at(1, 0), at(1, 1)])
    upper = np.column_stack([at(0, 0), at(1, 1), at(0, 1)])
    F = np.stack([lower, upper], axis=1).reshape(-1, 3)
    to = np.roll(F, -1, axis=1).ravel()
    origin = F.ravel()
    along, against = np.argsort(origin * n * n + to), np.argsort(to * n * n + origin)
    twin = np.empty(origin.size, np.int64)
    twin[along] = against
    first = np.empty(n * n, np.int64)
    first[origin] = np.arange(origin.size)
    return *(a.astype(np.int32) for a in (origin, twin, first)), V[order], np.empty((n * n, 3))


def _hash(k: Any) -> Any:
    """Numbers below 2 to the 32, the same everywhere."""
    k = k.astype(np.uint64) * np.uint64(2654435761) % np.uint64(2**32)
    return (k ^ (k >> np.uint64(13))) * np.uint64(2246822519) % np.uint64(2**32)


def reference() -> int:
    """Do a fixed piece of work of some milliseconds; returns a number that tells it was done."""
    walk: Any = _walk
    return int(walk(*_torus(), 5))


# -- clocks --------------------------------------------------------------------------------------

_SYSCALL = {"x86_64": 298, "aarch64": 241, "riscv64": 241, "ppc64le": 319, "s390x": 331}


@contextmanager
def instruction_counter() -> Iterator[Callable[[], float]]:
    """Count instructions of this thread in user mode; called, it says how many so far.

    Raises
    ------
    OSError
        The machine or its settings do not allow that.
    """
    number = _SYSCALL.get(platform.machine())
    if sys.platform != "linux" or number is None:
        raise OSError("only Linux counts instructions")
    hardware, instructions, with_times = 0, 1, 3
    user_mode_only = 1 << 5 | 1 << 6  # neither kernel nor hypervisor
    head = (hardware, 112, instructions, 0, 0, with_times, user_mode_only)
    attributes = struct.pack("<IIQQQQQ", *head).ljust(112, b"\0")
    libc = ctypes.CDLL(None, use_errno=True)
    file = libc.syscall(number, ctypes.c_char_p(attributes), 0, -1, -1, 0)
    if file < 0:
        raise OSError(ctypes.get_errno(), "perf_event_open")

    def read() -> float:
        count, enabled, running = struct.unpack("<QQQ", os.read(file, 24))
        if running < enabled:
            raise OSError("the counter is shared with others")
        return float(count)

    try:
        yield read
    finally:
        os.close(file)


def _seconds() -> Callable[[], float]:
    """Return a clock of this thread's processor time, where that is fine enough."""
    return thread_time if get_clock_info("thread_time").resolution < 1e-4 else perf_counter


def why_not() -> str | None:
    """Say why nothing that is measured here would mean anything."""
    config: Any = numba.config
    if config.DISABLE_JIT:
        return "kernels are not compiled"
    if config.OPT != 3 or config.BOUNDSCHECK or config.DEBUGINFO_DEFAULT:
        return "kernels are compiled in another way than for users"
    monitoring = getattr(sys, "monitoring", None)
    tools = [monitoring.get_tool(k) for k in range(6)] if monitoring else []
    if sys.gettrace() or sys.getprofile() or any(tools):
        return "Python is being traced"
    return None


# -- measuring -----------------------------------------------------------------------------------


def measure(rounds: int = ROUNDS) -> Found:
    """Run reference and cases in turn; minima."""
    for name in CASES:
        _run(name)  # compiles, and fills caches
    reference()
    gc.collect()
    gc.disable()
    try:
        with instruction_counter() as count:
            return _measure(rounds, count)
    except OSError:
        return _measure(rounds, None)
    finally:
        gc.enable()


def _measure(rounds: int, count: Callable[[], float] | None) -> Found:
    clock = _seconds()
    seconds: dict[str, list[float]] = {name: [] for name in ("", *CASES)}
    counted: dict[str, list[Phases]] = {name: [] for name in ("", *CASES)}
    for _ in range(rounds):
        for name in CASES:
            for timed in ("", name):
                start = clock()
                phases = _run(timed, count)
                seconds[timed].append(clock() - start)
                counted[timed].append(phases)
    unit = min(seconds[""])
    times = {name: min(seconds[name]) / unit for name in CASES}
    if count is None:
        return Found(times, None, 0.0)
    least = {name: _least(runs) for name, runs in counted.items()}
    return Found(times, {name: least[name] for name in CASES}, least[""]["total"])


def _run(name: str, count: Callable[[], float] | None = None) -> Phases:
    """Run a case, or the reference where it has no name; what each phase counts by a clock."""
    if not name:
        before = count() if count else 0.0
        reference()
        return {"total": (count() if count else 0.0) - before}
    mesh, options = CASES[name]
    sample = load(mesh)
    with patch.object(remeshvec.core.stopwatch, "perf_counter", count or perf_counter):
        before = count() if count else 0.0
        result = remeshvec.remesh(sample.V, sample.F, sample.length, threads=1, **options)
        _ = result.birth_face  # made when it is asked for
        return {**result.report.seconds, "total": (count() if count else 0.0) - before}


def _least(runs: Sequence[Phases]) -> Phases:
    return {phase: round(min(run[phase] for run in runs) / 1e6, 2) for phase in runs[0]}


# -- the record ----------------------------------------------------------------------------------


def key() -> str:
    """Tell which machine code and interpreter instructions are counted of."""
    on = sorted(name for name, is_on in binding.get_host_cpu_features().items() if is_on)
    features = hashlib.sha256(" ".join(on).encode()).hexdigest()[:8]
    versions = [
        f"{name} {'.'.join(version.split('.')[:2])}"
        for name, version in (
            ("python", platform.python_version()),
            ("numpy", np.__version__),
            ("numba", numba.__version__),
        )
    ]
    return f"{platform.machine()} {binding.get_host_cpu_name()} {features}, {', '.join(versions)}"


def read_record(path: Path = FILE) -> dict[str, Any]:
    """Read the record; empty where there is none."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write_record(found: Found, path: Path = FILE) -> None:
    """Replace times, and the instructions of this kind of machine; others' counts are out of date."""
    record: dict[str, Any] = {"times": {name: round(x, 3) for name, x in found.times.items()}}
    if found.instructions is not None:
        counts = {"reference": found.reference, **found.instructions}
        record["instructions"] = {key(): counts}
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def comparable(found: Found, record: dict[str, Any]) -> dict[str, Phases] | None:
    """Return the recorded instructions, where they are of the same machine code."""
    recorded: dict[str, Any] | None = record.get("instructions", {}).get(key())
    if found.instructions is None or recorded is None:
        return None
    was = recorded["reference"]
    if not was / SAME_CODE <= found.reference <= was * SAME_CODE:
        return None
    return {name: phases for name, phases in recorded.items() if name != "reference"}


def complaints(found: Found, record: dict[str, Any]) -> list[str]:
    """Say what takes more than it may."""
    said = [
        f"{name}: {100 * (found.times[name] / was - 1):.0f} % more time "
        f"({found.times[name]:.2f} times the reference kernel, recorded {was:.2f})"
        for name, was in record.get("times", {}).items()
        if name in found.times and found.times[name] > TIME * was
    ]
    for name, phases in (comparable(found, record) or {}).items():
        now = (found.instructions or {}).get(name, {})
        for phase, was in phases.items():
            limit = INSTRUCTIONS if phase == "total" else PHASE_INSTRUCTIONS
            if was >= SMALL * phases["total"] and now.get(phase, 0.0) > limit * was:
                said.append(
                    f"{name}: {100 * (now[phase] / was - 1):.1f} % more instructions in {phase} "
                    f"({now[phase]:.1f} million, recorded {was:.1f})"
                )
    return said


def check(record: dict[str, Any]) -> tuple[Found, list[str]]:
    """Measure, again where that gives reason to complain; only what is always slow counts."""
    for _ in range(ATTEMPTS):
        found = measure()
        said = complaints(found, record)
        if not said:
            break
    return found, said


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and compare, or record."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.guard", description=__doc__)
    parser.add_argument("--write", action="store_true", help="replace the record by what is found")
    write = parser.parse_args(argv).write
    if (reason := why_not()) is not None:
        print(f"nothing to measure: {reason}", file=sys.stderr)
        return 2
    if write:
        write_record(measure(4 * ROUNDS))
        return 0
    record = read_record()
    found, said = check(record)
    print(_summary(found, record))
    print("\n".join(said) or "no slower than recorded")
    return 1 if said else 0


def _summary(found: Found, record: dict[str, Any]) -> str:
    """One line a case: now, and how much of the record that is."""
    counts = comparable(found, record)
    lines = [key()]
    if counts is None:
        lines.append("instructions are not compared: not countable here, or other machine code")
    for name, time in found.times.items():
        was = record.get("times", {}).get(name, np.nan)
        line = f"{name}: {time:.2f} times the reference kernel ({time / was:.2f} of the record)"
        if found.instructions is not None:
            now = found.instructions[name]["total"]
            line += f", {now:.1f} million instructions"
        if found.instructions is not None and counts is not None and name in counts:
            line += f" ({now / counts[name]['total']:.3f})"
        lines.append(line)
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
