"""Plain Python threads that share the pieces of a loop.

Kernels release the GIL, so plain Python threads run them in parallel, with one build of each kernel.
Numba's own parallel loops would need a second build. Two Python threads cannot enter them at once, nor
can a forked child, and at the end of every loop they wait for all their threads: for milliseconds if
another process holds a core. Here any thread that is awake takes the next piece.
"""

from __future__ import annotations

import itertools
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from queue import SimpleQueue
from typing import Any

import numba

__all__ = ["available_threads", "numba_version", "share", "thread_scope", "uninterrupted"]

numba_version: str = numba.__version__

_PIECES = 16  # per thread: the others take the pieces of one that is held up


class _Helpers:
    """Threads that wait for work, shared by all calls of this process."""

    def __init__(self) -> None:
        self.jobs: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self.count = 0
        self.lock = threading.Lock()

    def ask(self, job: Callable[[], None], count: int, most: int) -> None:
        """Let up to ``count`` threads do a job; start new ones until there are ``most``."""
        with self.lock:
            while self.count < most:
                self.count += 1  # before the start: an interrupt may come during it
                try:
                    threading.Thread(target=self._work, daemon=True, name="remeshvec").start()
                except RuntimeError:  # the system refuses more threads; the caller does the work
                    self.count -= 1
                    break
        for _ in range(min(count, self.count)):
            self.jobs.put(job)

    def _work(self) -> None:
        while True:
            self.jobs.get()()


class _Job:
    """The pieces of one loop, taken one after another by all threads."""

    def __init__(self, run: Callable[..., None], count: int, pieces: int, args: Any) -> None:
        self.run, self.count, self.pieces, self.args = run, count, pieces, args
        self.next = itertools.count().__next__  # atomic
        self.finished: SimpleQueue[int | BaseException] = SimpleQueue()  # pieces per helper

    def take(self) -> int:
        """Run pieces until none is left; return how many."""
        taken = 0
        while (i := self.next()) < self.pieces:
            self._run(i)
            taken += 1
        return taken

    def help(self) -> None:
        """Run pieces on a helper thread, and report their number or the error."""
        try:
            taken = self.take()
        except BaseException as error:
            self.finished.put(error)
        else:
            if taken:
                self.finished.put(taken)

    def _run(self, i: int) -> None:
        span = i * self.count // self.pieces, (i + 1) * self.count // self.pieces
        self.run(span, *self.args)


def share(run: Callable[..., None], count: int, args: Any) -> None:
    """Run all pieces of a loop on the threads that this call may use now.

    Parameters
    ----------
    run : callable
        Called as ``run((first, last), *args)`` for ranges of ``range(count)``.
    count : int
    args : tuple
    """
    calls = max(1, _calls)
    threads = min(_scope.threads, available_threads() // calls)
    if threads < 2:
        run((0, count), *args)
        return
    job = _Job(run, count, min(count, _PIECES * threads), args)
    helpers = min(threads, job.pieces) - 1
    _helpers.ask(job.help, helpers, min(helpers * calls, available_threads() - 1))
    try:
        left = job.pieces - job.take()
        while left:
            done = job.finished.get()
            if isinstance(done, BaseException):
                raise done
            left -= done
    except BaseException:
        job.pieces = 0  # no helper begins another one
        raise


def uninterrupted(run: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    """Call a function on a thread of its own, where no `KeyboardInterrupt` reaches it.

    An interrupt of the caller leaves the function to end by itself. Numba cannot be interrupted: it
    would keep its lock, and other threads would wait for ever.
    """
    if threading.current_thread() is not threading.main_thread():
        return run(*args, **kwargs)
    done: SimpleQueue[tuple[Any, BaseException | None]] = SimpleQueue()

    def work() -> None:
        try:
            done.put((run(*args, **kwargs), None))
        except BaseException as error:
            done.put((None, error))

    threading.Thread(target=work, name="remeshvec compiles").start()
    value, error = done.get()
    if error is not None:
        raise error
    return value


class _Scope(threading.local):
    """The number of threads that the call on this Python thread wants, itself included."""

    threads = 1


_helpers = _Helpers()
_scope = _Scope()
_calls = 0  # running in this process
_calls_lock = threading.Lock()


def _after_fork() -> None:
    """Start anew: a forked child has only its own thread."""
    global _helpers, _calls, _calls_lock
    _helpers = _Helpers()
    _calls = 0
    _calls_lock = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def available_threads() -> int:
    """Return the most threads that a call may use (Numba's limit, which follows the CPU mask)."""
    return int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]


@contextmanager
def thread_scope(threads: int) -> Iterator[bool]:
    """Ask for threads for one call; yield whether it may use more than one.

    Calls that run at the same time share the available threads; every loop divides them anew.
    """
    global _calls
    wanted = min(threads, available_threads())
    before = _scope.threads
    _scope.threads = wanted
    with _calls_lock:
        _calls += 1
    try:
        yield wanted > 1
    finally:
        _scope.threads = before
        with _calls_lock:
            _calls = max(0, _calls - 1)  # a child that was forked inside a call starts from 0
