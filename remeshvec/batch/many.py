"""`remesh_many`: any number of meshes, one after another or in several processes."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sized
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core import arguments
from ..core.threads import available_threads
from ..errors import BatchError, OptionError
from ..files.mesh_files import MeshFile, read_mesh
from ..input.options import OPTION_NAMES, RemeshKeywords
from ..output.result import RemeshResult
from ..pipeline.job import Lengths
from ..pipeline.remesh import remesh
from ..processes.pool import Outcome, run_here, run_in_processes
from .progress import bar

if TYPE_CHECKING:
    from typing import Unpack

__all__ = ["BatchItem", "one_line", "remesh_many", "warm_up"]


@dataclass
class BatchItem:
    """Result or error of one item of a batch.

    Attributes
    ----------
    index : int
        Number of the item, counted from 0.
    name : str
        Path of the item, or a description.
    result : RemeshResult, or None after an error
        The return value of `remesh`.
    error : Exception, or None
        An error of `remesh` or `read_mesh`, or a `WorkerError`.
    seconds : float
        Time in the worker process, including reading.
    """

    index: int
    name: str
    result: Any = field(repr=False)
    error: Exception | None
    seconds: float


def remesh_many(
    items: Iterable[Any],
    L: Lengths | None = None,
    *,
    workers: int | None = None,
    on_error: str = "raise",
    ordered: bool = True,
    progress: bool = False,
    timeout: float | None = None,
    **options: Unpack[RemeshKeywords],
) -> Iterator[BatchItem]:
    """Remesh many meshes, in several processes.

    Every result is the same, bit for bit, as that of a separate call. Items are taken when they are
    needed and results are not kept, so a generator can give any number of them. The processes end with
    the iterator, also after ``close()`` or an interrupt.

    Parameters
    ----------
    items : iterable
        Meshes: ``(V, F)``, the path of a file, a result of `read_mesh` or `remesh`, or any other object
        that `remesh` accepts.
    L : float, (n,) array, callable or Adaptive, optional
        Target edge length for all items, as in `remesh`.
    workers : int, optional
        Number of processes; by default as many as there are cores. With 1, everything runs in this
        process. Each process uses its part of the cores for large meshes.
    on_error : {"raise", "collect"}
        ``"raise"``: an item that fails for any reason ends the batch with an exception, even if its
        process dies. ``"collect"``: it becomes a `BatchItem` with an ``error``, and the
        batch goes on.
    ordered : bool
        Whether results come in the order of the items, or in the order of completion.
    progress : bool
        Show progress on the error stream: a bar if the package rich is installed, lines otherwise.
    timeout : float, optional
        Seconds that one item may take. After that, its process is ended and the item fails. With a
        timeout, even ``workers=1`` uses a process.
    **options
        Options of `remesh`. Functions among them (``L``, ``callback``) run in the workers; those that a
        worker cannot import by name need the package cloudpickle.

    Yields
    ------
    BatchItem
        One per item.

    Raises
    ------
    BatchError
        An item failed with ``on_error="raise"``; the message names it. Raised from the item's error.
    OptionError
        An argument is invalid, or cannot be sent to other processes.
    WorkerError
        A process cannot be started.

    Examples
    --------
    >>> for item in remesh_many(paths, 0.1, on_error="collect"):  # doctest: +SKIP
    ...     print(item.name, item.error or len(item.result.F))
    """
    arguments.choice(on_error, "on_error", ("raise", "collect"))
    ordered, progress = arguments.flag(ordered, "ordered"), arguments.flag(progress, "progress")
    if workers is not None:
        workers = arguments.count(workers, "workers")
    if timeout is not None:
        timeout = arguments.number(timeout, "timeout", above=0.0, unit="seconds")
    _check_names(options)
    meshes = _iterator(items)
    total = len(items) if isinstance(items, Sized) else None
    workers = workers or available_threads()
    is_here = workers == 1 and timeout is None
    if total:
        workers = min(workers, total)  # so that few large meshes get all cores
    crew = _Crew(workers, is_here, ordered, timeout)
    done = _with_names(meshes, {"L": L, **options}, crew)
    if on_error == "raise":
        done = _raising(done)
    return bar(done, total, lambda item: item.error is not None) if progress else done


class _Crew(NamedTuple):
    """The processes that do the work, and their options."""

    workers: int
    is_here: bool  # in this process alone
    ordered: bool
    timeout: float | None


def _iterator(items: Any) -> Iterator[Any]:
    """Iterate over many meshes, and refuse a single one."""
    if isinstance(items, str | bytes | os.PathLike | MeshFile | RemeshResult):
        raise OptionError("items must be many meshes; put a single one into a list: [mesh]")
    try:
        return iter(items)
    except TypeError:
        raise OptionError(
            f"items must be an iterable of meshes; got an object of type {type(items).__name__}"
        ) from None


def _check_names(options: Iterable[str]) -> None:
    """Refuse options that do not exist, which would fail for every item."""
    unknown = sorted(set(options) - set(OPTION_NAMES))
    if unknown:
        raise OptionError(f"there is no option {', '.join(unknown)}")


def _with_names(items: Iterator[Any], options: dict[str, Any], crew: _Crew) -> Iterator[BatchItem]:
    """Remesh, and put back the names and arrays that the workers did not need.

    Items are copied: they wait for their worker while the caller makes the next one, perhaps in the same
    arrays.
    """
    held: dict[int, tuple[str, Any]] = {}  # name and arrays of the items in progress

    def tasks() -> Iterator[Any]:
        for index, item in enumerate(items):
            mesh = _mesh_of(item)
            name, arrays = _item_name(item), None
            del item
            if _is_vertex_face_pair(mesh) and not crew.is_here:
                mesh = arrays = tuple(x.copy() if isinstance(x, np.ndarray) else x for x in mesh)
            held[index] = name, arrays
            yield mesh

    for outcome in _item_outcomes(tasks(), options, crew):
        name, arrays = held.pop(outcome.number)
        index, result, error, seconds = outcome
        del outcome
        if arrays is not None and isinstance(result, RemeshResult):
            result.report = replace(result.report, before=arrays)
        yield BatchItem(index, name, result, error, seconds)
        del result, arrays


def _item_outcomes(tasks: Iterator[Any], options: dict[str, Any], crew: _Crew) -> Iterator[Outcome]:
    if crew.is_here:
        return run_here(_remesh_here, tasks, options)
    return run_in_processes(
        _remesh_there, tasks, options, crew.workers, crew.ordered, crew.timeout,
        None if crew.timeout is None else warm_up,
    )  # fmt: skip


def warm_up() -> None:
    """Load kernels, or compile them, so that no item's timeout includes this time."""
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    remesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], faces, 0.3)


def _raising(done: Iterator[BatchItem]) -> Iterator[BatchItem]:
    try:
        for item in done:
            if item.error is not None:
                raise BatchError(item.index, item.name, one_line(item.error)) from item.error
            yield item
    finally:
        done.close()  # type: ignore[attr-defined]  # now, since the caller may keep the exception


def _mesh_of(item: Any) -> Any:
    """Return ``(V, F)``, a path, or an object that `remesh` has to read."""
    if isinstance(item, MeshFile | RemeshResult):
        return item.V, item.F
    if isinstance(item, list) and len(item) == 2:
        return tuple(item)
    return os.fspath(item) if isinstance(item, os.PathLike) else item


def _is_vertex_face_pair(mesh: Any) -> bool:
    return isinstance(mesh, tuple) and len(mesh) == 2


def _item_name(item: Any) -> str:
    if isinstance(item, str | os.PathLike):
        return os.fsdecode(item)
    mesh = _mesh_of(item)
    if not _is_vertex_face_pair(mesh):
        return f"an object of type {type(item).__name__}"
    try:
        return f"{len(mesh[0]):,} vertices, {len(mesh[1]):,} faces"
    except TypeError:
        return "a pair of objects that are not arrays"


def _remesh_here(mesh: Any, options: dict[str, Any]) -> Any:
    """Remesh one item of any kind."""
    if isinstance(mesh, str):
        mesh = read_mesh(mesh)[:2]
    if _is_vertex_face_pair(mesh):
        return remesh(*mesh, **options)
    call: Any = remesh
    return call(mesh, **options)


def _remesh_there(mesh: Any, options: dict[str, Any]) -> Any:
    """Remesh one item; do not send arrays of the caller back to it."""
    result = _remesh_here(mesh, options)
    if _is_vertex_face_pair(mesh) and isinstance(result, RemeshResult):
        result.report = replace(result.report, before=((), ()))
    return result


def one_line(error: Exception) -> str:
    """Return the type and the message of an error in one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
