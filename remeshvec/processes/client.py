"""Tasks through a client: one of dask.distributed, or an executor of any kind.

What goes out and what comes back are the messages of the package's own workers, as bytes: an error of a
task is a value, and what a future raises is an error of the engine.
"""

from __future__ import annotations

import os
import pickle
import queue
import secrets
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from time import monotonic
from typing import Any

from ..core.threads import available_threads
from ..core.version import __version__
from ..errors import OptionError, RemeshvecError, WorkerError
from .tasks import AHEAD, Outcome, collect, packed, packed_setup
from .worker import answer

__all__ = ["check_client", "check_workers", "connected", "run_on_client"]

_CONNECT = "30s"  # a scheduler that does not answer so long is not there
_LOOK = 1.0  # seconds between two looks at the number of workers, which come and go

Versions = dict[str, str]


def check_client(client: Any) -> None:
    """Refuse what takes no tasks.

    Raises
    ------
    OptionError
    """
    if not callable(getattr(client, "submit", None)):
        raise OptionError(
            "client must be a dask.distributed.Client or have a method `submit`, as executors do; got an "
            f"object of type {type(client).__name__}"
        )
    if getattr(client, "asynchronous", False):
        raise OptionError("client is asynchronous; give one made with asynchronous=False")


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """Connect with the scheduler of a Dask cluster.

    Raises
    ------
    OptionError
        The package distributed is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise OptionError(
            "a scheduler needs the package distributed (pip install 'remeshvec[cluster]')"
        ) from None
    try:
        client = Client(address, timeout=_CONNECT)
    except (OSError, ValueError, TypeError) as error:
        said = " ".join(str(error).split())
        raise OptionError(f"no Dask scheduler answers at {address}: {said}") from error
    with client:
        yield client


def run_on_client(
    function: Callable[..., Any],
    tasks: Iterable[Any],
    common: Any,
    client: Any,
    workers: int | None = None,
    ordered: bool = True,
) -> Iterator[Outcome]:
    """Call ``function(task, common)`` for every task, where a client lets it run.

    Parameters
    ----------
    function : callable
        A function of a module; the workers import it by name.
    tasks : iterable
        Tasks, taken when they are needed: at most `AHEAD` per worker are on their way.
    common : object
        Second argument of all calls.
    client : object
        Has ``submit(function, *args)``, whose future has ``result()``.
    workers : int, optional
        Number of workers to keep busy. By default as many as the threads of a Dask cluster, and
        otherwise as there are cores.
    ordered : bool
        Whether outcomes come in the order of the tasks.

    Yields
    ------
    Outcome

    Raises
    ------
    OptionError
        ``common`` cannot be sent.
    WorkerError
        A worker has other versions of the packages that decide the result, or the client has ended.
    """
    crew = _ClientCrew(client, packed_setup(function, common), workers)
    try:
        yield from collect(crew, iter(tasks), ordered)
    finally:
        crew.stop()


class _ClientCrew:
    """The tasks that a client has been given."""

    def __init__(self, client: Any, setup: bytes, workers: int | None) -> None:
        self._client, self._setup, self._workers = client, setup, workers
        self._name = f"remeshvec-{secrets.token_hex(4)}"
        self._futures: dict[int, Any] = {}
        self._ready: queue.SimpleQueue[int | Outcome] = queue.SimpleQueue()
        self._looked, self._room = -_LOOK, AHEAD

    @property
    def room(self) -> int:
        """How many tasks may be on their way; more when workers have come."""
        now = monotonic()
        if now - self._looked >= _LOOK:
            self._looked = now
            self._room = AHEAD * max(1, self._workers or _count_workers(self._client))
        return self._room

    def hand(self, number: int, task: Any) -> None:
        """Submit a task."""
        try:
            message = packed(task)
        except WorkerError as error:
            self._ready.put(Outcome(number, None, error, 0.0))
            return
        # Under a key of its own: by default Dask hands out the result of an earlier task like this one.
        key = {"key": f"{self._name}-{number}"} if _is_dask(self._client) else {}
        try:
            future = self._client.submit(work, self._setup, _versions(), message, **key)
        except Exception as error:
            raise WorkerError(f"the client takes no more tasks ({_said(error)})") from error
        self._futures[number] = future
        if hasattr(future, "add_done_callback"):
            future.add_done_callback(lambda _: self._ready.put(number))
        else:  # its turn comes in the order of the tasks
            self._ready.put(number)

    def answer(self) -> Outcome:
        """Return the next outcome, in any order."""
        ready = self._next()
        if isinstance(ready, Outcome):
            return ready
        future = self._futures.pop(ready)
        try:
            return Outcome(ready, *pickle.loads(future.result()))
        except RemeshvecError:  # not of the task, but of all
            raise
        except CancelledError as error:
            raise WorkerError(f"the client has dropped its tasks ({_said(error)})") from error
        except Exception as error:
            return Outcome(ready, None, WorkerError(_loss(error)), 0.0)

    def _next(self) -> int | Outcome:
        while True:
            with suppress(queue.Empty):  # an interrupt ends no wait outside Unix
                return self._ready.get(timeout=1.0)

    def stop(self) -> None:
        """Withdraw what is not done yet; what workers have begun they bring to its end."""
        for future in self._futures.values():
            with suppress(Exception):  # the client may have ended, or knows no way back
                future.cancel()
        self._futures.clear()


def work(setup: bytes, versions: Versions, message: bytes) -> bytes:
    """Do one task, on a worker.

    Raises
    ------
    WorkerError
        Versions differ from those of the caller.
    OptionError
        Something that all tasks need cannot be loaded here.
    """
    differs = _difference(_versions(), versions)
    if differs:
        raise WorkerError(f"a worker cannot be used: {differs}")
    try:
        function, common = pickle.loads(setup)
    except Exception as error:
        raise OptionError(
            f"workers cannot use an option ({_said(error)}); functions must be in a module that they can "
            "import, or need the package cloudpickle"
        ) from None
    return answer(function, message, common)


# -- before the first task ------------------------------------------------------------------------


def check_workers(client: Any, folder: str | None = None, files: Sequence[str] = ()) -> None:
    """Refuse workers of a Dask cluster that would give other results, or do not see the caller's files.

    Waits for the first worker: one that a queue has yet to start.

    Workers of other clients are not asked beforehand: they cannot be addressed one by one. Those, and
    workers that come later, compare their versions with every task.

    Parameters
    ----------
    client : object
    folder : str, optional
        A folder that all must share: a file that is made in it, for the moment, must be seen.
    files : sequence of str
        Full paths of other files that all must see.

    Raises
    ------
    WorkerError
        In one line: which worker differs, and in what.
    """
    if not _is_dask(client):
        return
    client.wait_for_workers(1)
    with _probe(folder) as made:
        found = client.run(_state, [*made, *files], on_error="return")
        here = _state([*made, *files])
    wrong = {worker: _why_not(state, here) for worker, state in sorted(found.items())}
    wrong = {worker: why for worker, why in wrong.items() if why}
    if wrong:
        worker, why = next(iter(wrong.items()))
        raise WorkerError(f"{len(wrong)} of {len(found)} workers cannot be used; {worker}: {why}")


@contextmanager
def _probe(folder: str | None) -> Iterator[list[str]]:
    """Make a file that no machine has but those that share the folder."""
    if folder is None:
        yield []
        return
    path = Path(folder, f".{secrets.token_hex(8)}.probe").absolute()
    try:
        path.touch()
    except OSError as error:
        raise WorkerError(f"cannot write to {folder}: {error.strerror}") from error
    try:
        yield [str(path)]
    finally:
        path.unlink(missing_ok=True)


def _state(paths: Sequence[str]) -> tuple[Versions, list[str]]:
    """Return the versions here, and which of the paths are not seen from here."""
    return _versions(), [path for path in paths if not os.path.exists(path)]


def _why_not(state: Any, here: tuple[Versions, list[str]]) -> str:
    """Say what is wrong with a worker, in one line; nothing if all is well."""
    if isinstance(state, Exception):  # it has no such package, or a version without this
        return f"it cannot use remeshvec {__version__} ({_said(state)})"
    versions, unseen = state
    reasons = [_difference(versions, here[0])]
    reasons += [f"it does not see {os.path.dirname(p)}, which must be shared" for p in unseen[:1]]
    return "; ".join(filter(None, reasons))


def _versions() -> Versions:
    """Versions of what decides the bits of a result."""
    others = {name: import_module(name).__version__ for name in ("numpy", "numba")}
    return {"remeshvec": __version__, **others}


def _difference(there: Versions, here: Versions) -> str:
    return ", ".join(
        f"it has {name} {there.get(name, 'not')}, and here is {version}"
        for name, version in here.items()
        if there.get(name) != version
    )


# -- what differs between clients -----------------------------------------------------------------


def _is_dask(client: Any) -> bool:
    return hasattr(client, "scheduler_info")


def _count_workers(client: Any) -> int:
    """Return how many tasks run at a time."""
    return sum(client.nthreads().values()) if _is_dask(client) else available_threads()


def _loss(error: Exception) -> str:
    """Say why a task has no outcome."""
    deaths = getattr(error, "allowed_failures", None)  # of a KilledWorker
    if deaths is not None:
        return f"its worker process died, {deaths + 1} times in a row, perhaps for want of memory"
    return f"it was lost with its worker ({_said(error)})"


def _said(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
