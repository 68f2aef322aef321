"""Contenders in processes of their own.

So a peer that hangs or crashes costs its own row only, and "one core" means one core: the process is
bound to it from its start, whatever thread pools the libraries inside have (trueform's pool works
even with ``parallel=False``).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection
from time import perf_counter, process_time
from typing import Any, NamedTuple

from .contenders import CONTENDERS, Arrays, Contender
from .meshes import Sample

START_SECONDS = 120.0  # for the imports of a process
TURN_SECONDS = 0.05  # a turn repeats short calls for so long


class Failed(Exception):
    """A contender gave no result; the message says why."""


class Turn(NamedTuple):
    """One turn of a contender: means over its calls."""

    seconds: float
    cpu_seconds: float  # summed over the cores


class Worker:
    """A process that runs one contender on one mesh after the other."""

    def __init__(self, contender: Contender) -> None:
        self.contender = contender
        self._process: Any = None
        self._connection: Any = None

    def warm_up(self, sample: Sample, limit: float | None) -> Arrays:
        """Hand over a mesh and run once, which compiles and loads what is needed.

        Raises
        ------
        Failed
            An error, a crash, or no result within ``limit`` seconds.
        """
        if self._process is None:
            self._start()
        return self._ask((sample.V, sample.F, sample.length), limit)

    def turn(self, limit: float | None) -> Turn:
        """Run and time the last mesh; raises as `warm_up` does."""
        return self._ask(None, limit)

    def stop(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._connection.close()
            self._process = None

    def _start(self) -> None:
        context = get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(
            target=_serve, args=(theirs, self.contender.name), daemon=True
        )
        with _held_on_one_core(not self.contender.all_cores):
            self._process.start()
        theirs.close()
        self._answer(START_SECONDS)

    def _ask(self, task: Any, limit: float | None) -> Any:
        try:
            self._connection.send(task)
        except OSError:
            self._fail("it ended by itself")
        return self._answer(limit)

    def _answer(self, limit: float | None) -> Any:
        try:
            if not self._connection.poll(limit):
                self._fail(f"no result within {limit:g} s")
            ok, value = self._connection.recv()
        except (EOFError, OSError):
            self._process.join()
            self._fail(f"it crashed (exit code {self._process.exitcode})")
        if not ok:
            raise Failed(value)
        return value

    def _fail(self, reason: str) -> None:
        self.stop()
        raise Failed(reason)


@contextmanager
def _held_on_one_core(wanted: bool) -> Iterator[None]:
    """Let processes that start inside inherit a mask of one core, where the system has masks."""
    if not wanted or not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def _serve(connection: Connection, name: str) -> None:
    """Child: answer every task with (True, result) or (False, reason)."""
    contender = CONTENDERS[name]
    import_module(contender.package)
    connection.send((True, None))
    mesh: Any = None
    while True:
        task = connection.recv()
        try:
            if task is not None:
                mesh = task
                result: Any = contender.call(*mesh)
            else:
                result = _timed(contender, mesh)
            connection.send((True, result))
        except Exception as error:
            connection.send((False, " ".join(f"{type(error).__name__}: {error}".split())))


def _timed(contender: Contender, mesh: Any) -> Turn:
    calls, start, cpu_start = 0, perf_counter(), process_time()
    while calls == 0 or perf_counter() - start < TURN_SECONDS:
        contender.call(*mesh)
        calls += 1
    return Turn((perf_counter() - start) / calls, (process_time() - cpu_start) / calls)
