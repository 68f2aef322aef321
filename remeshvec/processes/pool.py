"""A pool of worker processes; a worker that dies fails only its current task.

The workers are plain processes with pipes. `concurrent.futures` gives up all tasks when one process dies.
Processes of `multiprocessing` run the caller's script again, which then needs a guard. Here every worker
has a thread in the parent, which hands it the next task as soon as it has answered, so it works on while
the caller does something else.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from time import monotonic, perf_counter
from typing import Any, BinaryIO

from ..core.threads import available_threads
from ..errors import OptionError, WorkerError
from .tasks import AHEAD, Outcome, collect, packed, packed_setup
from .worker import END_PATIENCE, receive, send

__all__ = ["StandingWorker", "run_in_processes", "start_process"]

_STARTS = 3  # attempts to start a worker
_IDLE = 30.0  # seconds after which a standing worker is let go

_START = (
    "import pickle, sys; sys.path[:] = pickle.load(sys.stdin.buffer); "
    "from remeshvec.processes.worker import serve; serve()"
)


def run_in_processes(
    function: Callable[..., Any],
    tasks: Iterable[Any],
    common: Any,
    workers: int,
    ordered: bool = True,
    timeout: float | None = None,
    warm_up: Callable[[], None] | None = None,
) -> Iterator[Outcome]:
    """Call ``function(task, common)`` for every task, in worker processes.

    Parameters
    ----------
    function : callable
        A function of a module; the workers import it by name.
    tasks : iterable
        Tasks, taken when they are needed: at most ``AHEAD * workers`` before the outcome of the first of
        them is asked for.
    common : object
        Second argument of all calls, sent once to every worker.
    workers : int
        Number of processes; each may use its part of the cores.
    ordered : bool
        Whether outcomes come in the order of the tasks.
    timeout : float, optional
        Seconds after which a task fails and its worker is ended.
    warm_up : callable, optional
        Called by every worker before its first task; the timeout does not include it.

    Yields
    ------
    Outcome

    Raises
    ------
    OptionError
        ``common`` cannot be sent to the workers.
    WorkerError
        A worker cannot be started.
    """
    pool = _Pool(packed_setup(function, common, warm_up), workers, timeout)
    try:
        yield from collect(pool, iter(tasks), ordered)
    finally:
        pool.stop()


class StandingWorker:
    """Calls ``function(task, None)`` in a worker process that stays for the next call.

    The first call waits about 0.6 s for the process to start, later ones a millisecond; it leaves when
    nothing has been asked of it for 30 s. Calls from several threads take turns.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._forget()
        if hasattr(os, "register_at_fork"):  # the pipes belong to the parent
            os.register_at_fork(after_in_child=self._forget)

    def _forget(self) -> None:
        self._lock = threading.Lock()
        self._pool: _Pool | None = None
        self._timer: threading.Timer | None = None

    def __call__(self, task: Any, timeout: float) -> Any:
        """Return what the function returns, or raise what it raises.

        Raises
        ------
        WorkerError
            The process died, or was ended after ``timeout`` seconds.
        """
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
            if self._pool is None:
                self._pool = _Pool(packed_setup(self._function, None, None), 1, timeout)
            self._pool.timeout = timeout
            try:
                self._pool.hand(0, task)
                outcome = self._pool.answer()
            except BaseException:  # the answer would be taken for that of the next call
                self._end()
                raise
            self._timer = threading.Timer(_IDLE, self.stop)
            self._timer.daemon = True
            self._timer.start()
        if outcome.error is not None:
            raise outcome.error
        return outcome.value

    def stop(self) -> None:
        """End the process; the next call starts another one."""
        with self._lock:
            self._end()

    def _end(self) -> None:
        if self._pool is not None:
            self._pool.stop()
            self._pool = None


class _Pool:
    """The workers, and the threads that feed them."""

    def __init__(self, setup: bytes, count: int, timeout: float | None) -> None:
        self.setup, self.timeout = setup, timeout
        self.room = AHEAD * count
        self.tasks: queue.SimpleQueue[tuple[int, Any] | None] = queue.SimpleQueue()
        self.workers: set[_Worker] = set()
        self.threads = max(1, available_threads() // count)
        self.folder = os.getcwd()  # where relative paths start, also for workers started later
        self._answers: queue.SimpleQueue[Outcome | Exception] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._stopping = False
        self._feeders = [
            threading.Thread(target=self._feed, daemon=True, name="remeshvec feeder")
            for _ in range(count)
        ]
        for feeder in self._feeders:
            feeder.start()

    def hand(self, number: int, task: Any) -> None:
        """Let the next worker that is free do a task."""
        self.tasks.put((number, task))

    def answer(self) -> Outcome:
        """Return the next outcome, in any order."""
        answer = None
        while answer is None:
            try:  # with a timeout: outside Unix, an interrupt does not end a wait
                answer = self._answers.get(timeout=1.0)
            except queue.Empty:
                continue
        if isinstance(answer, Exception):
            raise answer
        return answer

    def stop(self) -> None:
        """End all workers, busy or not, and wait for them."""
        with self._lock:
            self._stopping = True
            workers = list(self.workers)
        for worker in workers:
            worker.end_soon()
        for _ in self._feeders:
            self.tasks.put(None)
        deadline = monotonic() + END_PATIENCE
        for worker in workers:
            worker.end(deadline - monotonic())
        for feeder in self._feeders:
            feeder.join(1.0)

    def _feed(self) -> None:
        """Hand tasks to one worker, and replace it when it dies."""
        worker = None
        try:
            while not self._stopping and (task := self.tasks.get()) is not None:
                if worker is None:
                    worker = self._started()
                outcome = self._outcome(worker, *task)
                task = None
                if not worker.is_alive:
                    self._let_go(worker)
                    worker = None
                self._answers.put(outcome)
                del outcome
        except OSError as error:  # no more processes, or no memory for one
            self._answers.put(WorkerError(f"no worker process can be started: {error}"))
        except Exception as error:
            self._answers.put(error)
        finally:
            if worker is not None:
                worker.end_soon()
                self._let_go(worker)

    def _outcome(self, worker: _Worker, index: int, task: Any) -> Outcome:
        start = perf_counter()
        try:
            message = packed(task)
        except WorkerError as error:
            return Outcome(index, None, error, 0.0)
        try:
            return Outcome(index, *pickle.loads(worker.ask(message, self.timeout)))
        except WorkerError as error:
            return Outcome(index, None, error, perf_counter() - start)
        except Exception as error:
            reason = f"its result cannot be received from the worker process: {error}"
            return Outcome(index, None, WorkerError(reason), perf_counter() - start)

    def _started(self) -> _Worker:
        """Start a worker; try again if it dies at once, for want of memory perhaps."""
        for left in reversed(range(_STARTS)):
            with self._lock:
                if self._stopping:
                    raise WorkerError("the batch was stopped")
                worker = _Worker(self.threads, self.folder)
                self.workers.add(worker)
            try:
                refusal = pickle.loads(worker.ask(self.setup))
            except WorkerError as error:
                self._let_go(worker)
                if not left:
                    raise WorkerError(f"no worker process can be started: {error}") from error
            else:
                if refusal is None:
                    return worker
                self._let_go(worker)
                break
        raise OptionError(
            f"worker processes cannot use an option ({refusal}); functions must be in a module that "
            "they can import, or need the package cloudpickle; workers=1 sends nothing"
        )

    def _let_go(self, worker: _Worker) -> None:
        worker.end()
        worker.close()
        with self._lock:
            self.workers.discard(worker)


def start_process(threads: int, folder: str) -> subprocess.Popen[bytes]:
    """Start the process of a worker."""
    return subprocess.Popen(
        [sys.executable, "-c", _START],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=folder,
        env={**os.environ, "NUMBA_NUM_THREADS": str(threads)},
        start_new_session=True,  # Ctrl-C reaches the parent only, which then ends the workers
    )


class _Worker:
    """A process, and the pipes to and from it."""

    def __init__(self, threads: int, folder: str) -> None:
        self._process = start_process(threads, folder)
        assert self._process.stdin is not None and self._process.stdout is not None
        self._to: BinaryIO = self._process.stdin  # type: ignore[assignment]
        self._from: BinaryIO = self._process.stdout  # type: ignore[assignment]
        self.is_alive = True
        path = [os.path.abspath(entry) for entry in sys.path]  # "" means the current folder
        try:
            self._to.write(pickle.dumps(path))
        except OSError:
            self.is_alive = False

    def ask(self, message: bytes, timeout: float | None = None) -> bytes:
        """Send a message and wait for the answer.

        Raises
        ------
        WorkerError
            There is no answer: the process died, or was ended because it took too long.
        """
        late = threading.Event()
        timer = threading.Timer(min(timeout or 0.0, threading.TIMEOUT_MAX), self._give_up, [late])
        if timeout is not None:
            timer.daemon = True
            timer.start()
        try:
            send(self._to, message)
            answer = receive(self._from)
        except (OSError, ValueError, EOFError) as error:
            self.is_alive = False
            self.end()
            if late.is_set():
                raise WorkerError(f"it took longer than the timeout of {timeout:g} s") from None
            raise WorkerError(f"its worker process died ({self._how()})") from error
        finally:
            timer.cancel()
        return answer

    def end_soon(self) -> None:
        """Ask the process to end; it removes half-written files first."""
        self.is_alive = False
        self._process.terminate()

    def end(self, patience: float = END_PATIENCE) -> None:
        """Wait for the process to end, and kill it if it does not."""
        try:
            self._process.wait(max(0.0, patience))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def close(self) -> None:
        """Close the pipes; call this on the thread that uses them."""
        for pipe in (self._to, self._from):
            with suppress(OSError):  # unsent data has no reader any more
                pipe.close()

    def _give_up(self, late: threading.Event) -> None:
        late.set()
        self.end_soon()
        self.end()

    def _how(self) -> str:
        code = self._process.returncode
        if code >= 0:
            return f"exit code {code}"
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        return f"{name}, perhaps for want of memory" if name == "SIGKILL" else name
