"""Times of whole calls: ``pytest benchmarks``, and ``-m slow`` for a million faces and more.

Not every mesh with every option: one thing at a time varies around the default call. Peak memory is
measured in fresh processes where a mesh is large enough for it to say something.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from remeshvec import remesh

from .meshes import LENGTH_FACTOR, load, small_meshes

pytest.importorskip("pytest_benchmark", reason="pip install remeshvec[test]")

OPTIONS: dict[str, dict[str, Any]] = {
    "default": {},
    "default-no-projection": {"project": False},
    "default-no-features": {"feature_angle": None},
    "default-features-30-degrees": {"feature_angle": 30.0},
    "fast": {"preset": "fast"},
    "fast-no-projection": {"preset": "fast", "project": False},
    "fine": {"preset": "fine"},
}
MAIN = ("default", "fast-no-projection")
MADE = {"10k": "creature", "100k": "creature-x9", "1M": "creature-x100", "4M": "creature-x400"}
LENGTHS = (0.5, LENGTH_FACTOR, 2.0)
ROUNDS = {"10k": 5, "100k": 5, "1M": 3, "4M": 1}  # of small meshes: 5


class Case(NamedTuple):
    """One call."""

    mesh: str
    factor: float  # L / mean edge length
    options: str
    all_threads: bool = False

    def __str__(self) -> str:
        threads = "all-threads" if self.all_threads else "1-thread"
        return f"{self.mesh}-L{self.factor:g}-{self.options}-{threads}"


def small_cases() -> list[Case]:
    """Every small mesh with all options; some with other lengths."""
    cases = [Case(mesh, LENGTH_FACTOR, options) for mesh in small_meshes() for options in OPTIONS]
    finer = [name for name in small_meshes() if name in ("cat", "iphi_bad10k", "wavy_sheet")]
    return cases + [Case(m, f, options) for m in finer for f in (0.5, 2.0) for options in MAIN]


def made_cases(*sizes: str) -> list[Case]:
    """Generated meshes: every length, on one thread and on all."""
    return [
        Case(size, factor, options, all_threads)
        for size in sizes
        for factor in LENGTHS
        for options in MAIN
        for all_threads in (False, True)
    ]


@pytest.mark.parametrize("case", small_cases(), ids=str)
def test_call(benchmark: Any, case: Case) -> None:
    """A mesh of ``data`` or of the report."""
    time_call(benchmark, case)


@pytest.mark.parametrize("case", made_cases("10k", "100k"), ids=str)
def test_made(benchmark: Any, case: Case, peak_memory: Callable[..., None]) -> None:
    """A generated mesh."""
    time_call(benchmark, case)
    if case.mesh == "100k":
        note_memory(case, peak_memory)


@pytest.mark.slow
@pytest.mark.parametrize("case", made_cases("1M", "4M"), ids=str)
def test_made_large(benchmark: Any, case: Case, peak_memory: Callable[..., None]) -> None:
    """A generated mesh of a million faces or more."""
    time_call(benchmark, case)
    note_memory(case, peak_memory)


def time_call(benchmark: Any, case: Case) -> None:
    """Warm up, time, and note the number of faces."""
    sample = load(_name(case))
    benchmark.group = f"{case.mesh}, L = {case.factor:g} x mean edge"
    result = benchmark.pedantic(
        remesh,
        args=(sample.V, sample.F, sample.length),
        kwargs=_options(case),
        rounds=ROUNDS.get(case.mesh, 5),
        warmup_rounds=1,
    )
    assert len(result.F) > 0
    benchmark.extra_info["faces"] = [len(sample.F), len(result.F)]


def note_memory(case: Case, peak_memory: Callable[..., None]) -> None:
    """Run again in a fresh process."""
    peak_memory(load(_name(case)), _options(case))


def _name(case: Case) -> str:
    return f"{MADE.get(case.mesh, case.mesh)}@{case.factor:g}"


def _options(case: Case) -> dict[str, Any]:
    return {**OPTIONS[case.options], "threads": None if case.all_threads else 1}
