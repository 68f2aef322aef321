"""Peak memory beside the times of ``pytest benchmarks``: a table of its own at the end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from .contenders import Contender, ours
from .meshes import Sample
from .workers import Worker, save_mesh

MEMORY = pytest.StashKey[dict[str, tuple[int, int]]]()


@pytest.fixture
def peak_memory(request: pytest.FixtureRequest, benchmark: Any, tmp_path: Path) -> Any:
    """Measure a call in a fresh process, and note it."""

    def measure(sample: Sample, options: dict[str, Any]) -> None:
        save_mesh(tmp_path, sample)
        contender = Contender("", "remeshvec", ours, "", "", options, options.get("threads") != 1)
        worker = Worker(contender, tmp_path, sample.length)
        try:
            first, _ = worker.first(limit=None)
        finally:
            worker.stop()
        benchmark.extra_info["peak_bytes"] = first.bytes_peak
        benchmark.extra_info["peak_bytes_before_the_call"] = first.bytes_before
        notes = request.config.stash.setdefault(MEMORY, {})
        notes[request.node.name] = first.bytes_before, first.bytes_peak

    return measure


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Show the table."""
    notes = config.stash.get(MEMORY, {})
    if not notes:
        return
    terminalreporter.section("peak memory of fresh processes, MB (before the call, with the mesh)")
    width = max(map(len, notes))
    for name, (before, peak) in notes.items():
        terminalreporter.write_line(f"{name:{width}}{peak / 1e6:10,.0f} ({before / 1e6:,.0f})")
