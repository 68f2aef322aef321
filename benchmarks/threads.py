"""One thread against several: time, and the same bytes.

``python -m benchmarks.threads [--threads 1 2 4]``

More threads than cores need ``NUMBA_NUM_THREADS`` in the environment. Runs take turns (1 2 4 1 2 4
...); whether the bytes agree is checked in every one.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

from remeshvec import RemeshResult, remesh
from remeshvec._jit import available_threads

from .meshes import Sample, load
from .tables import DOCS, machine, machine_line, milliseconds, page, table, write_page

MESHES = ("creature", "pretzel-x4", "linked_rings-x16", "creature-x64")  # 10k, 26k, 100k, 666k
RECIPES: dict[str, dict[str, Any]] = {
    "default": {},
    "fast, no projection": {"preset": "fast", "project": False},
}

Times = dict[int, float]  # threads -> median seconds


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and write ``threads.md``."""
    arguments = _parse(argv)
    rows = []
    for name in arguments.meshes:
        for recipe in RECIPES:
            print(f"{name}, {recipe}", file=sys.stderr, flush=True)
            times = in_turns(load(name), recipe, arguments.threads, arguments.repeat)
            rows.append([name, recipe, f"{len(load(name).F):,}", *_cells(times)])
    counts = arguments.threads
    text = page(
        "Threads",
        "Times in ms, medians; in parentheses how many times faster than one thread. The targets "
        "are 1.5 on 2 threads from 100,000 faces, and never below 1. Every run on "
        f"{', '.join(map(str, counts))} threads gave the same bytes: vertices, faces, births and "
        "counts.",
        machine_line(machine()),
        table(
            ["mesh", "options", "faces", *(f"{n} threads" for n in counts)], rows, text_columns=2
        ),
    )
    print(text)
    write_page(arguments.output, "threads.md", text)
    return 0


def in_turns(sample: Sample, recipe: str, counts: Sequence[int], repeat: int) -> Times:
    """Warm up, then time; ends the run where results differ.

    Raises
    ------
    SystemExit
        Two runs differ.
    """
    seconds: dict[int, list[float]] = {count: [] for count in counts}
    digests = set()
    for turn in range(repeat + 1):
        for count in counts:
            start = perf_counter()
            result = remesh(sample.V, sample.F, sample.length, threads=count, **RECIPES[recipe])
            if turn:
                seconds[count].append(perf_counter() - start)
            digests.add(digest(result))
            if len(digests) > 1:
                raise SystemExit(f"{sample.name}, {recipe}: {count} threads gave other bytes")
    return {count: median(values) for count, values in seconds.items()}


def digest(result: RemeshResult) -> str:
    """Hash all that a call returns, but for its times."""
    sha = hashlib.sha256(repr((result.report.sweeps, result.report.dirt)).encode())
    for array in (result.V, result.F, result.birth_face, result.birth_barycentric):
        sha.update(f"{array.dtype}{array.shape}".encode())
        sha.update(array.tobytes())
    return sha.hexdigest()


def _cells(times: Times) -> list[str]:
    first = next(iter(times.values()))
    return [f"{milliseconds(value)} ({first / value:.2f})" for value in times.values()]


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    most = available_threads()
    powers = [1 << k for k in range(most.bit_length())]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.threads", description=__doc__)
    parser.add_argument("--threads", type=int, nargs="+", default=powers, help="1 comes first")
    parser.add_argument("--repeat", type=int, default=5, help="timed runs of each")
    parser.add_argument("--meshes", nargs="+", default=MESHES, metavar="NAME")
    parser.add_argument("--output", type=Path, default=DOCS, help="folder of the page")
    arguments = parser.parse_args(argv)
    arguments.threads = sorted({1, *arguments.threads})
    if arguments.threads[-1] > most:
        parser.error(f"only {most} threads here; set NUMBA_NUM_THREADS={arguments.threads[-1]}")
    return arguments


if __name__ == "__main__":
    sys.exit(main())
