"""Pages: Markdown tables, and what machine and versions they come from."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterable, Sequence
from datetime import date
from importlib.metadata import version
from pathlib import Path

from .meshes import ROOT

DOCS = ROOT / "docs"


def table(head: Sequence[str], rows: Iterable[Sequence[str]], text_columns: int = 1) -> str:
    """Lay out a Markdown table; all columns but the first ones hold numbers."""
    rule = ["---"] * text_columns + ["--:"] * (len(head) - text_columns)
    return "\n".join("| " + " | ".join(line) + " |" for line in (head, rule, *rows))


def page(title: str, *parts: str) -> str:
    """Join paragraphs and tables under a title."""
    return "\n\n".join((f"# {title}", *(part for part in parts if part))) + "\n"


def write_page(folder: Path, name: str, text: str) -> None:
    """Write a page, whole or not at all, and say where."""
    folder.mkdir(parents=True, exist_ok=True)
    unfinished = folder / f".{name}.part"
    unfinished.write_text(text, encoding="utf-8")
    unfinished.replace(folder / name)
    print(f"wrote {folder.name}/{name}", file=sys.stderr)


def milliseconds(seconds: float) -> str:
    """Format with three digits or more."""
    ms = 1e3 * seconds
    return f"{ms:,.0f}" if ms >= 100 else f"{ms:.1f}" if ms >= 10 else f"{ms:.2f}"


def usable_cores() -> int:
    """Count the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def machine(packages: Iterable[str] = ()) -> dict[str, str]:
    """Say on what a page's figures were measured, and when."""
    names = ("numpy", "numba", "libigl", *packages)
    return {
        "date": date.today().isoformat(),
        "processor": _processor(),
        "cores": str(usable_cores()),
        "system": platform.system(),
        "load average before": _load(),
        "Python": platform.python_version(),
        **{name: version(name) for name in names},
    }


def machine_line(facts: dict[str, str]) -> str:
    """Put the facts of `machine` into one line."""
    return "Measured on: " + ", ".join(f"{key} {value}" for key, value in facts.items()) + "."


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def _load() -> str:
    return f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"
