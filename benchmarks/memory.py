"""Memory of one call, stage by stage, in bytes per face of the input: ``python -m benchmarks.memory``.

Writes docs/memory.md. The call runs in a process of its own that gives freed arrays back to the system at
once, as it does by itself on meshes of ten million faces; below, the allocator keeps some of them.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from remeshvec import remesh
from remeshvec.core.stopwatch import Stopwatch

from .meshes import ROOT, load
from .tables import DOCS, machine, machine_line, page, table, write_page

MESH = "creature-x64"  # iphi_bad10k-x64 has flaws at first, and is swept again on copies

STAGES = {
    "build": "clean, order, connect",
    "reference": "features, reference, target lengths",
    "split": "split",
    "collapse": "collapse",
    "flip": "flip",
    "relax": "relax",
    "project": "project; the tree is built",
    "even out": "even out",
    "finish": "project once more, untangle",
    "locate": "births",
    "extract": "arrays of the result",
}


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and write the page, or do the call."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mesh", default=MESH, help="name, as in benchmarks/meshes.py")
    parser.add_argument("--output", type=Path, default=DOCS, help="folder of the page")
    parser.add_argument("--call", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    if arguments.call:
        print(json.dumps(measured_call(arguments.mesh)))
        return
    facts = machine()
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.memory", "--call", "--mesh", arguments.mesh],
        env=os.environ | {"MALLOC_MMAP_THRESHOLD_": "1000000", "NUMBA_NUM_THREADS": "1"},
        cwd=ROOT,
        stdout=subprocess.PIPE,
        check=True,
    )
    write_page(arguments.output, "memory.md", _page(facts, arguments.mesh, json.loads(done.stdout)))


def measured_call(name: str) -> dict[str, Any]:
    """Remesh once; return what every stage added to the resident memory, in bytes."""
    small, sample = load(name.partition("-x")[0]), load(name)
    remesh(small.V, small.F, small.length)  # loads kernels
    base = _status("VmRSS")
    stages: dict[str, list[int]] = {}

    @contextmanager
    def time(_: Stopwatch, stage: str) -> Iterator[None]:
        Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
        yield
        found = stages.setdefault(stage, [0, 0])
        found[0] = max(found[0], _status("VmHWM") - base)
        found[1] = _status("VmRSS") - base

    Stopwatch.time = time  # type: ignore[method-assign, assignment]
    result = remesh(sample.V, sample.F, sample.length)
    return {
        "faces": len(sample.F),
        "given": sample.V.nbytes + sample.F.nbytes,
        "made": result.V.nbytes + result.F.nbytes,
        "faces after": len(result.F),
        "stages": stages,
    }


def _status(field: str) -> int:
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(field))


def _page(facts: dict[str, str], name: str, found: dict[str, Any]) -> str:
    m, stages = found["faces"], found["stages"]
    rows = [
        [words, f"{stages[stage][0] / m:.0f}", f"{stages[stage][1] / m:.0f}"]
        for stage, words in STAGES.items()
        if stage in stages
    ]
    most = max(peak for peak, _ in stages.values()) / m
    return page(
        "Memory of a call",
        f"Resident memory of one call on {name} ({m:,} faces, {found['faces after']:,} in the result; "
        "default preset, one thread), in bytes per face of the input, on top of the caller's arrays, "
        f"which take {found['given'] / m:.0f}. The peak is {most:.0f}.",
        machine_line(facts),
        table(["stage", "peak", "after its last run"], rows),
        "Splits write the mesh anew, here first with more faces than either end, beside the old one and "
        "the copy from before the sweeps; relaxation has its sums. A result holds the reference with its "
        "tree, from which births and maps are found. A call whose first result has flaws sweeps again, "
        "on copies, and takes about twice as much.",
    )


if __name__ == "__main__":
    main()
