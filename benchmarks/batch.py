"""Batches: five hundred meshes, five of them hostile, with one worker and with two.

``python -m benchmarks.batch`` writes docs/batch.md. The command is timed from the start of its process
to its end, with reading, writing and measures of quality; the library on arrays in memory, in a process
where kernels are loaded; workers start inside the time.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median
from time import perf_counter, sleep
from typing import Any

import numpy as np

from remeshvec import read_mesh, remesh, remesh_many, write_mesh

from .meshes import DATA, ROOT, find_file
from .tables import DOCS, machine, machine_line, page, table, write_page

GOOD = 495
FACES = (1_000, 20_000)
NOISE = 0.12  # of the vertices, in edge lengths: remeshed meshes alone would be too easy

OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
HOSTILE = {
    "049-nan.obj": OBJ.replace(b"v 1", b"v nan"),
    "150-empty.obj": b"",
    "251-garbage.ply": bytes(range(256)) * 40,
    "352-cut short.obj": OBJ[:-3],
    "453-no such vertex.obj": OBJ + b"f 1 2 9\n",
}

WORKERS = (1, 2)
EVERY = 0.1  # seconds between two looks at the memory

Sample = dict[str, float]


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=3, help="runs of everything")
    parser.add_argument("--output", type=Path, default=DOCS, help="folder of the page")
    arguments = parser.parse_args(argv)
    facts = machine()
    with tempfile.TemporaryDirectory(prefix="remeshvec-batch-") as folder:
        root = Path(folder)
        sizes = make_meshes(root / "in")
        commands, calls = _measured(root, arguments.repeat)
    write_page(arguments.output, "batch.md", _page(facts, sizes, commands, calls))


def make_meshes(folder: Path) -> list[int]:
    """Write the meshes, hostile ones among them; returns the numbers of faces of the others."""
    folder.mkdir(parents=True)
    for name, content in HOSTILE.items():
        (folder / name).write_bytes(content)
    free = [k for k in range(500) if k not in {int(name[:3]) for name in HOSTILE}]
    sources = [read_mesh(find_file(name) or name)[:2] for name in DATA]
    sizes = []
    for k, number in enumerate(free):
        wanted = (
            1.06 * FACES[0] * (0.94 * FACES[1] / FACES[0] / 1.06) ** (k * 97 % GOOD / (GOOD - 1))
        )
        V, F = _made(*sources[k % len(sources)], int(wanted), seed=k)
        write_mesh(folder / f"{number:03}-{DATA[k % len(DATA)]}.obj", V, F)
        sizes.append(len(F))
    return sizes


def _made(V: Any, F: Any, faces: int, seed: int) -> tuple[Any, Any]:
    """Return a mesh of about so many faces, of uneven shapes."""
    result = remesh(V, F, preset="fast", n_faces=faces)
    sigma = NOISE * result.report.target_length
    return result.V + np.random.default_rng(seed).normal(0, sigma, result.V.shape), result.F


def measure(inputs: Path, outputs: Path, workers: int) -> dict[str, Any]:
    """Run the command; returns its summary, exit status, seconds, and memory over time."""
    words = [
        "batch",
        str(inputs / "*"),
        "--out",
        str(outputs),
        "--workers",
        str(workers),
        "--quiet",
    ]
    samples: list[Sample] = []
    start = perf_counter()
    process = subprocess.Popen([sys.executable, "-m", "remeshvec", *words], cwd=ROOT)
    while process.poll() is None:
        samples.append({"seconds": perf_counter() - start} | _memory(process.pid))
        sleep(EVERY)
    seconds = perf_counter() - start
    summary = json.loads((outputs / "summary.json").read_text(encoding="utf-8"))
    return summary | {
        "status": process.returncode,
        "seconds": seconds,
        "resident": [sample for sample in samples if sample["parent"]],
    }


def _memory(pid: int) -> Sample:
    """Return what a process and its children hold, in bytes; 0 where the system does not tell."""
    return {"parent": _resident(pid), "workers": float(sum(map(_resident, _children(pid))))}


def _resident(pid: int | str) -> float:
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    except (OSError, IndexError):
        return 0.0
    return float(pages * os.sysconf("SC_PAGE_SIZE"))


def _children(pid: int) -> list[str]:
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        return [child for task in tasks for child in (task / "children").read_text().split()]
    except OSError:
        return []


def _measured(root: Path, repeat: int) -> tuple[dict[int, list[Any]], dict[str, list[float]]]:
    """Run everything so many times, in turns."""
    meshes = [read_mesh(path)[:2] for path in sorted((root / "in").iterdir()) if _is_good(path)]
    ways = _ways_to_run()
    commands: dict[int, list[Any]] = {workers: [] for workers in WORKERS}
    calls: dict[str, list[float]] = {name: [] for name in ways}
    for mesh in meshes[:12]:  # loads kernels
        remesh(*mesh)
    for turn in range(repeat):
        print(f"turn {turn + 1} of {repeat}", file=sys.stderr, flush=True)
        for workers in WORKERS:
            commands[workers].append(measure(root / "in", root / f"{workers}-{turn}", workers))
        for name, way in ways.items():
            start = perf_counter()
            assert sum(way(meshes)) > 0
            calls[name].append(perf_counter() - start)
    return commands, calls


def _is_good(path: Path) -> bool:
    return path.name not in HOSTILE


def _ways_to_run() -> dict[str, Callable[[list[Any]], Iterable[int]]]:
    def threads(meshes: list[Any]) -> Iterable[int]:
        with ThreadPoolExecutor(2) as executor:
            yield from executor.map(lambda mesh: len(remesh(*mesh).F), meshes)

    return {
        "one after another": lambda meshes: (len(remesh(*mesh).F) for mesh in meshes),
        "`workers=1`": lambda meshes: (
            len(item.result.F) for item in remesh_many(meshes, workers=1)
        ),
        "`workers=2`": lambda meshes: (
            len(item.result.F) for item in remesh_many(meshes, workers=2)
        ),
        "two threads": threads,
    }


# -- the page -------------------------------------------------------------------------------------


def _page(
    facts: dict[str, str],
    sizes: list[int],
    commands: dict[int, list[Any]],
    calls: dict[str, list[float]],
) -> str:
    runs = [run for found in commands.values() for run in found]
    assert all((run["good"], run["failed"], run["status"]) == (GOOD, 5, 3) for run in runs)
    intro = (
        f"{GOOD} meshes of {min(sizes):,} to {max(sizes):,} faces (median {median(sizes):,.0f}), made "
        "from those in data/ with noise, and five that cannot be read. Medians over "
        f"{len(runs) // len(commands)} runs in turns, spread in parentheses. The target is 1.7 times "
        "faster with two workers."
    )
    return page(
        "Batches",
        intro,
        machine_line(facts),
        "## The command",
        "`remeshvec batch 'in/*' --out out`, from start to end of the process: read, remesh, measure "
        f"quality, write. Every run remeshed {GOOD} meshes and named the 5 that failed:",
        "\n".join(f"- {Path(k).name}: {_said(e)}" for k, e in sorted(runs[0]["failures"].items())),
        _command_table(commands),
        "## Memory of the command",
        "Resident memory in MB at shares of the run time. Workers are added up, although they share "
        "their libraries.",
        _memory_table(commands),
        "## From Python",
        "`remesh_many` on arrays in memory, and the same with threads, whose Python parts wait for each "
        "other. The time includes the start of the workers.",
        _call_table(calls),
    )


def _said(error: str) -> str:
    """Leave out the path, which is that of a temporary folder."""
    kind, _, reason = error.partition(": ")
    return f"{kind}: {reason.rpartition(': ')[2]}"


def _command_table(commands: dict[int, list[Any]]) -> str:
    one = [run["seconds"] for run in commands[1]]
    rows = []
    for workers, runs in commands.items():
        seconds = [run["seconds"] for run in runs]
        rate = 500 / median(seconds)
        rows.append([str(workers), _spread(seconds), f"{rate:.0f}", _times(one, seconds)])
    return table(["workers", "seconds", "meshes per second", "times faster"], rows)


def _memory_table(commands: dict[int, list[Any]]) -> str:
    parts = (0.2, 0.4, 0.6, 0.8, 0.95)
    rows = []
    for workers, runs in commands.items():
        samples = runs[-1]["resident"]
        for kind in ("parent", "workers") if workers > 1 else ("parent",):
            at = [samples[int(part * len(samples))][kind] / 1e6 for part in parts]
            most = max(sample[kind] for sample in samples) / 1e6
            rows.append([str(workers), kind, *(f"{value:.0f}" for value in at), f"{most:.0f}"])
    head = ["workers", "of", *(f"{100 * part:.0f} %" for part in parts), "most"]
    return table(head, rows, text_columns=2)


def _call_table(calls: dict[str, list[float]]) -> str:
    one = calls["one after another"]
    rows = [[name, _spread(seconds), _times(one, seconds)] for name, seconds in calls.items()]
    return table(["", "seconds", "times faster"], rows)


def _spread(seconds: list[float]) -> str:
    return f"{median(seconds):.2f} ({min(seconds):.2f} to {max(seconds):.2f})"


def _times(one: list[float], other: list[float]) -> str:
    return f"{median(one) / median(other):.2f}"


if __name__ == "__main__":
    main()
