"""Tasks and what comes of them, whoever does the work: this process, others, or a cluster."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, Protocol

from ..errors import OptionError, WorkerError
from .worker import attempt

__all__ = ["AHEAD", "Crew", "Outcome", "collect", "packed", "packed_setup", "run_here"]

# Tasks per worker that are taken but not yet handed on: one at work, and some that wait for the worker
# or, where outcomes keep their order, for an earlier task. Sizes of meshes differ by a factor of twenty.
AHEAD = 4


class Outcome(NamedTuple):
    """Value or error of one task."""

    number: int  # of the task, counted from 0
    value: Any  # None where there is an error
    error: Exception | None
    seconds: float


class Crew(Protocol):
    """Those who do the work."""

    @property
    def room(self) -> int:
        """How many tasks may be on their way."""

    def hand(self, number: int, task: Any) -> None:
        """Take a task, which is sent or copied before the caller may change it."""

    def answer(self) -> Outcome:
        """Wait for the next outcome, in any order."""


def run_here(function: Callable[..., Any], tasks: Iterable[Any], common: Any) -> Iterator[Outcome]:
    """Do tasks one by one in this process; take each task only when its outcome is asked for."""
    for index, task in enumerate(tasks):
        outcome = Outcome(index, *attempt(function, task, common))
        task = None  # an error keeps the frames that led to it, with their variables
        yield outcome
        del outcome


def collect(crew: Crew, tasks: Iterator[Any], ordered: bool) -> Iterator[Outcome]:
    """Keep a crew busy, and yield outcomes in order or as they come."""
    waiting: dict[int, Outcome] = {}
    given = done = 0  # tasks handed out, outcomes yielded
    more = True
    while True:
        while more and given - done < crew.room:
            try:
                task = next(tasks)
            except StopIteration:
                more = False
                break
            crew.hand(given, task)
            given += 1
            task = None  # do not keep the caller's arrays alive
        if done == given:
            return
        while not (done in waiting if ordered else waiting):
            outcome = crew.answer()
            waiting[outcome.number] = outcome
        outcome = waiting.pop(done if ordered else next(iter(waiting)))
        done += 1
        yield outcome


def packed(task: Any) -> bytes:
    """Return the message that brings a task to a worker.

    Raises
    ------
    WorkerError
        The task cannot be sent.
    """
    try:
        return pickle.dumps(task, 5)
    except Exception as error:
        raise WorkerError(
            f"it cannot be sent to a worker process ({error}); workers=1 sends nothing"
        ) from error


def packed_setup(*parts: Any) -> bytes:
    """Return the message that tells workers what to do with all tasks.

    Raises
    ------
    OptionError
        A part cannot be sent.
    """
    try:
        content = pickle.dumps(parts, 5)
        if b"__main__" not in content:
            return content
    except Exception as error:
        content = None
        problem = error
    content = _with_cloudpickle(parts) or content
    if content is None:
        raise OptionError(
            f"an option cannot be sent to worker processes ({problem}); the package cloudpickle can send "
            "functions, and workers=1 sends nothing"
        ) from problem
    return content


def _with_cloudpickle(value: Any) -> bytes | None:
    """Pickle also functions of scripts and lambdas, if cloudpickle is installed; None if that fails."""
    try:
        import cloudpickle
    except ImportError:
        return None
    try:
        return cloudpickle.dumps(value)
    except Exception:
        return None
