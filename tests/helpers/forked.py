"""Worker processes that are forks of the process of the tests, which has loaded the library already.

A worker of the library starts from nothing: importing it and loading its kernels costs 2.6 s of a core,
which tests of what a batch does with its workers need not pay for each of them.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import numba
import pytest

from remeshvec.batch.many import warm_up
from remeshvec.processes import pool
from remeshvec.processes.worker import serve

_MOST_FILES = 1024  # that the tests have open


class Fork:
    """Stand-in for the `Popen` of a worker."""

    def __init__(self, threads: int, folder: str) -> None:
        to_read, to_write = os.pipe()
        from_read, from_write = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            try:
                _become_worker(to_read, from_write, threads, folder)
            finally:
                os._exit(1)
        os.close(to_read)
        os.close(from_write)
        self.stdin, self.stdout = os.fdopen(to_write, "wb"), os.fdopen(from_read, "rb")
        self.returncode: int | None = None
        self._lock = threading.Lock()

    def poll(self) -> int | None:
        with self._lock:
            if self.returncode is None:
                pid, status = os.waitpid(self.pid, os.WNOHANG)
                if pid:
                    self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int | None:
        end = None if timeout is None else time.monotonic() + timeout
        while self.poll() is None:
            if end is not None and time.monotonic() >= end:
                raise subprocess.TimeoutExpired("a worker", timeout or 0.0)
            time.sleep(0.002)
        return self.returncode

    def terminate(self) -> None:
        self._send(signal.SIGTERM)

    def kill(self) -> None:
        self._send(signal.SIGKILL)

    def _send(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)


def _become_worker(source: int, target: int, threads: int, folder: str) -> None:
    """Do in a child what the interpreter of a worker does."""
    os.setsid()
    os.chdir(folder)
    os.dup2(source, 0)
    os.dup2(target, 1)
    os.closerange(3, _MOST_FILES)  # pipes of other workers, who could not see their end
    numba.config.NUMBA_NUM_THREADS = threads
    sys.stdin = os.fdopen(0)
    sys.path[:] = pickle.load(sys.stdin.buffer)
    serve()


@pytest.fixture
def real_workers():
    """Ask for workers as the library starts them."""


@pytest.fixture
def quick_workers(request, monkeypatch):
    """Let workers be forks, where there are any, except for tests with `real_workers`."""
    if hasattr(os, "fork") and "real_workers" not in request.fixturenames:
        warm_up()
        monkeypatch.setattr(pool, "start_process", Fork)
