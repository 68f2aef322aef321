"""What a user waits for before the first result: import, first call, compilation.

``python -m benchmarks.start [--repeat 5] [--cold 1]``

Every figure comes from fresh processes. The kernels' cache is a temporary folder: empty for the
cold figures, filled by these for the warm ones.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from .meshes import ROOT, Sample, load
from .tables import DOCS, machine, machine_line, page, table, write_page

MESHES = ("bracket", "creature")  # one thread only; enough faces for the parallel kernels too

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


class Child(NamedTuple):
    """What one fresh process took, seconds."""

    imported: float
    first: float
    later: float  # the faster of the next two calls
    notices: list[str]  # lines on its error stream


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and write ``start.md``."""
    arguments = _parse(argv)
    cold: dict[str, list[Child]] = {}
    warm: dict[str, list[Child]] = {}
    with tempfile.TemporaryDirectory(prefix="remeshvec-start-") as folder:
        for name in arguments.meshes:
            file = _save(load(name), Path(folder))
            caches = [Path(folder) / f"{name}-{k}" for k in range(arguments.cold)]
            cold[name] = [run_child(file, cache) for cache in caches]
            warm[name] = [run_child(file, caches[-1]) for _ in range(arguments.repeat)]
    write_page(arguments.output, "start.md", as_page(cold, warm))
    return 0


def run_child(file: Path, cache: Path) -> Child:
    """Import and call in a fresh process with this folder for compiled kernels."""
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(file)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(f"the fresh process failed:\n{done.stderr}")
    seconds: dict[str, Any] = json.loads(done.stdout)
    notices = done.stderr.splitlines()
    return Child(seconds["import"], seconds["first"], seconds["later"], notices)


def _save(sample: Sample, folder: Path) -> Path:
    file = folder / f"{sample.name}.npz"
    np.savez(file, V=sample.V, F=sample.F)
    return file


def as_page(cold: dict[str, list[Child]], warm: dict[str, list[Child]]) -> str:
    """Lay out the medians and print them."""
    imports = [child.imported for children in warm.values() for child in children]
    rows = [["`import remeshvec`", "", _seconds(imports), "0.6"]]
    for name in warm:
        extra = [child.first - child.later for child in warm[name]]
        compile_ = [child.first - child.later for child in cold[name]]
        later = [child.later for child in warm[name]]
        rows += [
            ["first call beyond a later one, compiled before", name, _seconds(extra), "1"],
            ["first call beyond a later one, compiling", name, _seconds(compile_), "30"],
            ["later call", name, _seconds(later), ""],
        ]
    text = page(
        "Start",
        "Seconds, medians over fresh processes (spread in parentheses), default options.",
        machine_line(machine()),
        table(["", "mesh", "seconds", "target, at most"], rows, text_columns=2),
        *(_faces(name) for name in warm),
        _said(cold, warm),
    )
    print(text)
    return text


def _seconds(values: list[float]) -> str:
    return f"{median(values):.2f} ({min(values):.2f} to {max(values):.2f})"


def _faces(name: str) -> str:
    return f"{name}: {len(load(name).F):,} faces."


def _said(cold: dict[str, list[Child]], warm: dict[str, list[Child]]) -> str:
    """Report what users read while they wait."""
    lines = sorted({line for children in cold.values() for c in children for line in c.notices})
    quiet = not any(child.notices for children in warm.values() for child in children)
    said = "\n".join(f"    {line}" for line in lines) or "    (nothing)"
    after = "Nothing is said once compiled." if quiet else "Warm processes say something too."
    return f"While compiling, the error stream says:\n\n{said}\n\n{after}"


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.start", description=__doc__)
    parser.add_argument("--repeat", type=int, default=5, help="warm processes a mesh")
    parser.add_argument("--cold", type=int, default=1, help="cold processes a mesh")
    parser.add_argument("--meshes", nargs="+", default=MESHES, metavar="NAME")
    parser.add_argument("--output", type=Path, default=DOCS, help="folder of the page")
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
