"""What was measured: parts of entries, each with the machine and the date it comes from.

``benchmarks.json`` holds ``{part: {entry: {"measured": facts, ...}}}``. A part that is run again
replaces the entries that it measures, and leaves the others.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .contenders import CONTENDERS
from .meshes import ROOT
from .tables import machine, machine_line, write_page

FILE = "benchmarks.json"

Entry = dict[str, Any]
Results = dict[str, dict[str, Entry]]


def read_results(folder: Path) -> Results:
    """Read what has been measured so far."""
    path = folder / FILE
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write_results(folder: Path, results: Results) -> None:
    """Write all, whole or not at all."""
    write_page(folder, FILE, json.dumps(results, indent=1) + "\n")


def record(folder: Path, part: str, key: str, entry: Entry) -> None:
    """Add or replace an entry in the file."""
    merge(folder, {part: {key: {**entry, "measured": facts()}}})


def merge(folder: Path, newer: Results) -> None:
    """Add or replace the entries of other results."""
    results = read_results(folder)
    for part, entries in newer.items():
        results.setdefault(part, {}).update(entries)
    write_results(folder, results)


def facts() -> dict[str, str]:
    """Machine, date and versions, of the peers and of ourselves."""
    packages = {
        c.package
        for c in CONTENDERS.values()
        if c.is_installed and not (c.is_ours or c.is_executable)
    }
    return {**machine(sorted(packages)), "remeshvec": _revision()}


def _revision() -> str:
    """Version, and the commit where there is one; a plus marks changes to the package since."""
    version = CONTENDERS["remeshvec default"].version
    commit = _git("rev-parse", "--short", "HEAD")
    changed = "+" if commit and _git("status", "--porcelain", "remeshvec") else ""
    return f"{version} ({commit}{changed})" if commit else version


def _git(*arguments: str) -> str:
    try:
        done = subprocess.run(
            ["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
        )
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def measured_lines(entries: Iterable[Entry]) -> str:
    """Say on what and when entries were measured: once for all that agree."""
    said: dict[tuple[tuple[str, str], ...], list[str]] = {}
    for entry in entries:
        known = dict(entry["measured"])
        load = known.pop("load average before", "")
        said.setdefault(tuple(known.items()), []).append(load)
    lines = []
    for known, loads in said.items():
        span = loads[0] if len(set(loads)) == 1 else f"{min(loads)} to {max(loads)}"
        lines.append(machine_line({**dict(known), "load average before": span}))
    return "\n\n".join(lines)
