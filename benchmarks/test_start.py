"""Times of fresh processes: import, first call, later call; ``-m slow`` compiles everything anew."""

from __future__ import annotations

from pathlib import Path
from statistics import median
from typing import Any

import pytest

from .meshes import load
from .start import Child, run_child, save

pytest.importorskip("pytest_benchmark", reason="pip install remeshvec[test]")

MESHES = ("creature", "creature-x9")


@pytest.mark.parametrize("mesh", MESHES)
def test_warm_start(benchmark: Any, mesh: str, tmp_path: Path) -> None:
    """A process that finds the compiled kernels."""
    file = save(load(mesh), tmp_path)
    run_child(file)  # compiles where that was not done yet
    time_children(benchmark, "warm start", file, None, rounds=3)


@pytest.mark.slow
@pytest.mark.parametrize("mesh", MESHES)
def test_cold_start(benchmark: Any, mesh: str, tmp_path: Path) -> None:
    """A process that has to compile them."""
    file = save(load(mesh), tmp_path)
    time_children(benchmark, "cold start", file, tmp_path / "cache", rounds=1)


def time_children(benchmark: Any, group: str, file: Path, cache: Path | None, rounds: int) -> None:
    """Time whole processes; what their parts took is noted beside."""
    benchmark.group = group
    children: list[Child] = []
    benchmark.pedantic(lambda: children.append(run_child(file, cache)), rounds=rounds)
    for key in ("import", "first", "later"):
        benchmark.extra_info[key] = median(child[key] for child in children)
