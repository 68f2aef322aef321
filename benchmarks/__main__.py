"""Speed and memory, ours and the peers': measured part by part, into pages and plots.

``python -m benchmarks`` runs all parts, the most important first; ``python -m benchmarks targets``
those that the table of targets needs; ``python -m benchmarks samples threads`` some. Whatever was
measured before stays in ``benchmarks.json``, with its own date, and the pages are written from that
file after every part: a run can be stopped and gone on with (``--missing``).
"""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from time import monotonic

from .contenders import CONTENDERS
from .meshes import ROOT
from .pages import write_pages
from .parts import PARTS, Run, run_part
from .results import merge
from .tables import DOCS

QUICK_FOLDER = ROOT / "build" / "benchmarks"

# Kernels are compiled before anything is measured: compiling takes memory, too.
COMPILE = """
from benchmarks.contenders import RECIPES
from benchmarks.meshes import load
from remeshvec import remesh
sample = load("creature-x9")
for options in RECIPES.values():
    for threads in (1, None):
        remesh(sample.V, sample.F, sample.length, threads=threads, **options)
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run what is asked for."""
    arguments = _parse(argv)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # clears workers and files away
    folder = arguments.output or (QUICK_FOLDER if arguments.quick else DOCS)
    if arguments.merge:
        merge(folder, json.loads(arguments.merge.read_text(encoding="utf-8")))
    failed = [] if arguments.merge or arguments.pages else _measure(arguments, folder)
    write_pages(folder)
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def _measure(arguments: argparse.Namespace, folder: Path) -> list[str]:
    """Run the parts; returns those that failed, which do not stop the others."""
    for package in sorted({c.package for c in CONTENDERS.values() if not c.is_installed}):
        print(f"{package} is not installed and left out", file=sys.stderr)
    subprocess.run([sys.executable, "-c", COMPILE], cwd=ROOT, check=False)
    deadline = monotonic() + 60.0 * arguments.minutes
    run = Run(
        folder,
        arguments.meshes,
        arguments.contenders,
        arguments.repeat,
        arguments.limit,
        arguments.budget,
        deadline,
        arguments.missing,
        arguments.quick,
    )
    failed = []
    for name in _wanted(arguments.parts):
        if monotonic() > deadline:
            print(f"no time left for {name}", file=sys.stderr)
            continue
        started = monotonic()
        try:
            run_part(name, run)
        except Exception:
            traceback.print_exc()
            failed.append(name)
        print(f"{name}: {monotonic() - started:.0f} s", file=sys.stderr)
        write_pages(folder)
    return failed


def _wanted(names: Sequence[str]) -> list[str]:
    if not names:
        return list(PARTS)
    for_targets = [name for name, part in PARTS.items() if part.for_targets]
    chosen = {*names, *(for_targets if "targets" in names else [])}
    return [name for name in PARTS if name in chosen]


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    listed = "\n".join(
        f"  {name:10}{part.about} (about {part.minutes:g} min)" for name, part in PARTS.items()
    )
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description=f"{__doc__}\nParts:\n{listed}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("parts", nargs="*", metavar="PART", help="these parts; targets: those of the targets")
    add("--quick", action="store_true", help="small meshes, two turns, into build/benchmarks")
    add("--meshes", nargs="+", default=(), metavar="NAME", help="these meshes only")
    add("--contenders", nargs="+", default=(), metavar="NAME", help="these contenders only")
    add("--repeat", type=int, help="turns of each contender")
    add("--limit", type=float, help="seconds that a call may take")
    add("--budget", type=float, help="seconds of a contender after which it takes no further turn")
    add("--minutes", type=float, default=float("inf"), help="start nothing after so long")
    add("--missing", action="store_true", help="only what is not in the results yet")
    add("--pages", action="store_true", help="measure nothing, write the pages again")
    add("--merge", type=Path, metavar="FILE", help="take over the results of another machine")
    add("--output", type=Path, help="folder of the results (default: docs)")
    arguments = parser.parse_args(argv)
    unknown = set(arguments.parts) - {*PARTS, "targets"}
    if unknown:
        parser.error(f"no part {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}, targets")
    return arguments


if __name__ == "__main__":
    sys.exit(main())
