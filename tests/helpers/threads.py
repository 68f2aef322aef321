"""Run functions at the same time, and loops over pieces on several threads or in any order."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from unittest.mock import patch

import numpy as np

from helpers.processes import PATIENCE
from remeshvec.core import threads as _threads
from remeshvec.core.compiler import decorators


def at_once(*functions) -> list:
    """Run functions in threads that start together; returns their results, or raises the first error."""
    barrier = threading.Barrier(len(functions))

    def run(function):
        barrier.wait(PATIENCE)
        return function()

    executor = ThreadPoolExecutor(len(functions))
    futures = [executor.submit(run, function) for function in functions]
    try:
        return [future.result(PATIENCE) for future in futures]
    finally:
        executor.shutdown(wait=False)


@contextmanager
def on_threads(n: int):
    """Let ``parallel=True`` mean so many threads, whatever the machine has."""
    before = _threads._scope.threads
    with patch.object(_threads, "available_threads", lambda: n):
        _threads._scope.threads = n
        try:
            yield
        finally:
            _threads._scope.threads = before


class Shuffled:
    """Stand-in for `share`: runs pieces alone, in a random order; remembers whose."""

    def __init__(self, seed: int = 0) -> None:
        self.rng = np.random.default_rng(seed)
        self.seen: set[str] = set()

    def __call__(self, run, count, args) -> None:
        self.seen.add(getattr(run, "py_func", run).__name__.removesuffix("_serial"))
        for k in self.rng.permutation(count).tolist():
            run((k, k + 1), *args)


@contextmanager
def shuffled(seed: int = 0):
    """Let ``parallel=True`` mean an order that no thread would take."""
    with patch.object(decorators, "share", Shuffled(seed)) as order:
        yield order
