"""Contenders in processes of their own, one mesh each.

So a peer that hangs or crashes loses only its own row, the peak memory of a process is that of one
contender on one mesh, and "one core" means one core: the process is bound to it from its start,
whatever thread pools the libraries inside have (trueform's pool works even with
``parallel=False``).
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, NamedTuple

import numpy as np

from .contenders import Contender
from .meshes import Sample
from .peers import Arrays, InFile

START_SECONDS = 120.0  # for the imports of a process
TURN_SECONDS = 0.05  # a turn repeats short calls for so long


class Failed(Exception):
    """A contender gave no result; the message says why."""


class First(NamedTuple):
    """The first call of a process."""

    seconds: float
    bytes_before: int  # peak memory of the process with its libraries and the mesh
    bytes_peak: int
    digest: str  # of all that the call returns; empty for peers


class Turn(NamedTuple):
    """One turn of a contender: means over its calls."""

    seconds: float
    cpu_seconds: float | None  # summed over the cores; unknown of an executable


class Worker:
    """A process that runs one contender on one mesh; the folder holds the mesh."""

    def __init__(self, contender: Contender, folder: Path, length: float) -> None:
        self.contender = contender
        self._folder = folder
        self._length = length
        self._process: Any = None
        self._connection: Any = None

    def first(self, limit: float | None) -> tuple[First, Arrays]:
        """Start the process and run once, which compiles and loads what is needed.

        Raises
        ------
        Failed
            An error, a crash, or no result within ``limit`` seconds.
        """
        self._start()
        self._send("first")
        first, path = self._answer(limit)
        with np.load(path) as result:
            arrays = result["V"], result["F"]
        path.unlink()
        return first, arrays

    def turn(self, limit: float | None) -> Turn:
        """Run and time; raises as `first` does."""
        self._send("turn")
        return self._answer(limit)

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
            target=_serve, args=(theirs, self.contender, self._folder, self._length), daemon=True
        )
        with _held_on_one_core(not self.contender.all_cores):
            self._process.start()
        theirs.close()
        self._answer(START_SECONDS)

    def _send(self, task: str) -> None:
        try:
            self._connection.send(task)
        except OSError:
            self._fail("it ended by itself")

    def _answer(self, limit: float | None) -> Any:
        try:
            if not self._connection.poll(limit):
                self._fail(f"no result within {limit:g} s")
            ok, value = self._connection.recv()
        except (EOFError, OSError):
            self._process.join()
            self._fail(f"it crashed (exit code {self._process.exitcode})")
        if not ok:
            self._fail(value)
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


def save_mesh(folder: Path, sample: Sample) -> None:
    """Write the arrays where workers look for them."""
    folder.mkdir(parents=True, exist_ok=True)
    np.save(folder / "V.npy", sample.V)
    np.save(folder / "F.npy", sample.F)


# --- in the process of the contender -------------------------------------------------------------


def _serve(connection: Connection, contender: Contender, folder: Path, length: float) -> None:
    """Answer every task with (True, result) or (False, reason)."""
    warnings.simplefilter("ignore")
    tempfile.tempdir = str(folder)
    if not contender.is_executable:
        import_module(contender.package)
    mesh = np.load(folder / "V.npy"), np.load(folder / "F.npy"), length
    connection.send((True, None))
    while True:
        task = connection.recv()
        try:
            answer = _first(contender, mesh, folder) if task == "first" else _timed(contender, mesh)
            connection.send((True, answer))
        except Exception as error:
            connection.send((False, " ".join(f"{type(error).__name__}: {error}".split())))


def _first(contender: Contender, mesh: Any, folder: Path) -> tuple[First, Path]:
    before = peak_bytes(contender.is_executable)
    start = perf_counter()
    result = contender(*mesh)
    seconds = perf_counter() - start
    peak = peak_bytes(contender.is_executable)
    if isinstance(result, InFile):
        seconds, result = result.seconds, result.read()
    V, F = result
    path = folder / f"result-{os.getpid()}.npz"
    np.savez(path, V=V, F=F)
    return First(seconds, before, peak, digest(result) if contender.is_ours else ""), path


def _timed(contender: Contender, mesh: Any) -> Turn:
    calls, own, start, cpu_start = 0, 0.0, perf_counter(), process_time()
    while calls == 0 or perf_counter() - start < TURN_SECONDS:
        result = contender(*mesh)
        own += result.seconds if isinstance(result, InFile) else 0.0
        calls += 1
    if own > 0.0:
        return Turn(own / calls, None)
    return Turn((perf_counter() - start) / calls, (process_time() - cpu_start) / calls)


def peak_bytes(of_children: bool = False) -> int:
    """Most memory that this process, or the largest of its children, has held; 0 if unknown."""
    try:
        import resource
    except ImportError:
        return 0
    unit = 1 if sys.platform == "darwin" else 1024
    if of_children:
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * unit
        return peak if peak > 1.1 * peak_bytes() else 0  # it counts this process until it starts
    return _high_water_mark() or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def _high_water_mark() -> int:
    """Peak as Linux knows it; ``ru_maxrss`` is there at least what the parent process had."""
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        return 0
    found = re.search(r"VmHWM:\s*(\d+) kB", status)
    return 1024 * int(found[1]) if found else 0


def digest(result: Any) -> str:
    """Hash all that a call of ours returns, but for its times."""
    sha = hashlib.sha256(repr((result.report.sweeps, result.report.dirt)).encode())
    for array in (result.V, result.F, result.birth_face, result.birth_barycentric):
        sha.update(f"{array.dtype}{array.shape}".encode())
        sha.update(array.tobytes())
    return sha.hexdigest()
