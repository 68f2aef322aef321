"""What a user waits for before the first result: import, first call, compilation.

Every figure comes from fresh processes. The kernels' cache is a temporary folder: empty for the
cold figures, filled by these for the warm ones.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from .meshes import ROOT, Sample, load
from .results import Entry, Results, measured_lines, record
from .tables import page, table

# A mesh as users have, one that the parallel kernels run on, too.
MESHES = ("creature", "creature-x9")
COLD = {"creature": 3, "creature-x9": 1}  # cold processes: half a minute each

CHILD = """
import json, sys, time
clock = time.perf_counter
start = clock()
import remeshvec
imported = clock()
import numpy as np
mesh = np.load(sys.argv[1])
V, F = mesh["V"], mesh["F"]
calls = []
for _ in range(3):
    called = clock()
    remeshvec.remesh(V, F)
    calls.append(clock() - called)
print(json.dumps({"import": imported - start, "first": calls[0], "later": min(calls[1:])}))
"""

Child = dict[str, Any]  # seconds of one fresh process, and "notices": lines on its error stream


def run(folder: Path, repeat: int, quick: bool) -> None:
    """Measure and record."""
    with tempfile.TemporaryDirectory(prefix="remeshvec-start-") as scratch:
        for name in MESHES[:1] if quick else MESHES:
            print(f"start: {name}", file=sys.stderr, flush=True)
            file = save(load(name), Path(scratch))
            cold_runs = 1 if quick else COLD[name]
            caches = [Path(scratch) / f"{name}-{k}" for k in range(cold_runs)]
            entry: Entry = {"mesh": name, "faces": len(load(name).F)}
            entry["cold"] = [run_child(file, cache) for cache in caches]
            entry["warm"] = [run_child(file, caches[-1]) for _ in range(repeat)]
            record(folder, "start", name, entry)


def run_child(file: Path, cache: Path | None = None) -> Child:
    """Import and call in a fresh process, with this folder for compiled kernels.

    Raises
    ------
    RuntimeError
        The process failed.
    """
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(file)],
        env={**os.environ, **({"NUMBA_CACHE_DIR": str(cache)} if cache else {})},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"the fresh process failed:\n{done.stderr}")
    return {**json.loads(done.stdout), "notices": done.stderr.splitlines()}


def save(sample: Sample, folder: Path) -> Path:
    """Write the arrays for `run_child`."""
    file = folder / f"{sample.name}.npz"
    np.savez(file, V=sample.V, F=sample.F)
    return file


def ready_after(entry: Entry) -> float:
    """Median seconds of import and first call together, compiled before."""
    return median(child["import"] + child["first"] for child in entry["warm"])


def compiling(entry: Entry) -> float:
    """Median seconds of a first call on a new machine, beyond a later one."""
    return median(child["first"] - child["later"] for child in entry["cold"])


def as_page(results: Results) -> str:
    """Lay out the medians."""
    entries = list(results.get("start", {}).values())
    if not entries:
        return ""
    rows = []
    for entry in entries:
        warm, cold, mesh = entry["warm"], entry["cold"], entry["mesh"]
        rows += [
            ["`import remeshvec`", mesh, _seconds([c["import"] for c in warm]), ""],
            ["first call, compiled before", mesh, _seconds([c["first"] for c in warm]), ""],
            ["both together", mesh, _seconds([c["import"] + c["first"] for c in warm]), "1"],
            ["later call", mesh, _seconds([c["later"] for c in warm]), ""],
            [
                "first call on a new machine beyond a later one",
                mesh,
                _seconds([c["first"] - c["later"] for c in cold]),
                "20",
            ],
        ]
    return page(
        "Start",
        "Seconds, medians over fresh processes (spread in parentheses), default options.",
        measured_lines(entries),
        table(["", "mesh", "seconds", "target, at most"], rows, text_columns=2),
        *(f"{entry['mesh']}: {entry['faces']:,} faces." for entry in entries),
        _said(entries),
    )


def _seconds(values: Sequence[float]) -> str:
    return f"{median(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def _said(entries: Sequence[Entry]) -> str:
    """Report what users read while they wait."""
    lines = sorted({line for entry in entries for c in entry["cold"] for line in c["notices"]})
    quiet = not any(child["notices"] for entry in entries for child in entry["warm"])
    said = "\n".join(f"    {line}" for line in lines) or "    (nothing)"
    after = (
        "Once everything is compiled, there is no message."
        if quiet
        else "Warm processes print a message too."
    )
    return f"While compiling, the error stream says:\n\n{said}\n\n{after}"
