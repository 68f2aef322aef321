"""Who does the tasks: this process, worker processes of the package, or a client with ``submit``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from secrets import token_hex
from typing import Any, Protocol

from ..errors import OptionError, RemeshvecError, WorkerError
from ..processes.pool import run_in_processes
from ..processes.tasks import Outcome, run_here
from .tasks import Task, run_task

__all__ = ["Client", "Engine", "Future", "check_client"]

# Times that a task is given to a worker whose process dies.
_TRIES = 3


class Future(Protocol):
    """What ``submit`` returns."""

    def result(self) -> Any:
        """Wait for the value of the call, or raise its error."""


class Client(Protocol):
    """A Dask ``Client``, an executor of ``concurrent.futures``, or the like."""

    def submit(self, function: Any, *args: Any) -> Future:
        """Let somebody call a function."""


class Engine:
    """Runs the tasks of a round, in any order and place; the results are in their files.

    Parameters
    ----------
    workers : int
        Processes of the package, 1 for this one; not used with a client.
    client : Client, optional
    """

    def __init__(self, workers: int, client: Client | None) -> None:
        self.workers = workers
        self.client = client

    def run(self, tasks: Sequence[Task]) -> Iterator[Task]:
        """Yield tasks as they are done.

        Raises
        ------
        WorkerError
            A worker process died several times over the same task, or cannot take part.
        """
        if self.client is not None:
            yield from self._run_there(self.client, tasks)
            return
        for attempt in range(_TRIES):
            left = []
            for outcome in self._outcomes(tasks):
                task = tasks[outcome.number]
                if outcome.error is None:
                    yield task
                elif _may_be_repeated(outcome.error) and attempt + 1 < _TRIES:
                    left.append(task)
                else:
                    raise outcome.error
            if not left:
                return
            tasks = left

    def _outcomes(self, tasks: Sequence[Task]) -> Iterator[Outcome]:
        if self.workers == 1:
            return run_here(run_task, tasks, None)
        workers = min(self.workers, len(tasks))
        return run_in_processes(run_task, tasks, None, workers, ordered=False)

    def _run_there(self, client: Client, tasks: Sequence[Task]) -> Iterator[Task]:
        """Hand all tasks to a client, which may finish them in any order."""
        # Dask answers a call that it remembers from memory; the files may have gone since.
        once = token_hex(8)
        futures = [client.submit(run_task, task, once) for task in tasks]
        try:
            for task, future in zip(tasks, futures, strict=True):
                _wait_for(task, future)
                yield task
        finally:
            for future in futures:
                cancel = getattr(future, "cancel", None)
                if cancel is not None:  # those that are done take no notice
                    cancel()


def _wait_for(task: Task, future: Future) -> None:
    """Wait for a task; errors that are not the package's own name it."""
    try:
        future.result()
    except RemeshvecError:
        raise
    except Exception as error:
        name = type(error).__name__
        raise WorkerError(f"{task.round}, part {task.part}: {name}: {error}") from error


def _may_be_repeated(error: Exception) -> bool:
    """Tell whether an error says that a process died, not that the task cannot be done."""
    return isinstance(error, WorkerError) and "died" in str(error)


def check_client(client: Any) -> Any:
    """Refuse a client without ``submit``."""
    if client is not None and not callable(getattr(client, "submit", None)):
        raise OptionError(
            "client must have a method submit(function, *args) that returns a future, as a Dask "
            f"Client and the executors of concurrent.futures have; got {type(client).__name__}"
        )
    return client
