"""Times of single phases: ``pytest benchmarks``.

A phase is timed on what the default preset hands to its first call, serially, from a fresh copy each
round.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from remeshvec import remesh

from .meshes import DATA, load

pytest.importorskip("pytest_benchmark", reason="pip install remeshvec[test]")

PHASES = {
    "split": "split_long_edges",
    "collapse": "collapse_short_edges",
    "flip": "flip_edges",
    "slide": "slide_vertices",
    "relax": "relax_vertices",
    "project": "project_vertices",
    "unfold": "undo_folds",
}
ROUNDS = 20

# The module that calls the phases.
MODULE = import_module("remeshvec.sweeps.phases")


@pytest.mark.parametrize("mesh", DATA)
@pytest.mark.parametrize("phase", PHASES)
def test_phase(benchmark: Any, phase: str, mesh: str) -> None:
    """One call of a phase."""
    benchmark.group = phase
    arguments = first_arguments(mesh, phase)
    function = getattr(MODULE, PHASES[phase])
    function(*copied(arguments))  # warm
    benchmark.pedantic(function, setup=lambda: (copied(arguments), {}), rounds=ROUNDS)


@cache
def first_arguments(mesh: str, phase: str) -> tuple[Any, ...]:
    """Record the arguments of a phase's first call inside ``remesh``."""
    sample = load(mesh)
    seen: list[tuple[Any, ...]] = []
    with patch.object(MODULE, PHASES[phase], _recording(getattr(MODULE, PHASES[phase]), seen)):
        remesh(sample.V, sample.F, sample.length, threads=1)
    return seen[0]


def _recording(function: Callable[..., Any], seen: list[tuple[Any, ...]]) -> Callable[..., Any]:
    def recorded(*arguments: Any, **options: Any) -> Any:
        if not seen and not options:
            seen.append(copied(arguments))
        return function(*arguments, **options)

    return recorded


def copied(value: Any) -> Any:
    """Copy the arrays in nested tuples; phases work in place."""
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, tuple):
        parts = [copied(part) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value
