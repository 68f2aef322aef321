"""`remesh_many`: any number of meshes, one after another, in several processes, or on a cluster."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Sized
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core import arguments
from ..core.threads import available_threads
from ..errors import BatchError, OptionError
from ..files.disk import FilePath
from ..files.mesh_files import MeshFile
from ..input.options import OPTION_NAMES, RemeshKeywords
from ..output.light import LIGHT_SUFFIX, LightResult
from ..output.result import RemeshResult
from ..pipeline.job import Lengths
from ..pipeline.remesh import remesh
from ..processes.client import check_client, check_workers, run_on_client
from ..processes.pool import run_in_processes
from ..processes.tasks import Outcome, run_here
from .one_item import StoredItem, as_mesh, is_pair, remesh_any, remesh_to_file
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
    result : RemeshResult, or None after an error or with ``store``
        The return value of `remesh`.
    error : Exception, or None
        An error of `remesh` or `read_mesh`, or a `WorkerError`.
    seconds : float
        Time in the worker process, including reading.
    path : str, or None
        With ``store``, the file that holds the result; `LightResult.load` reads it.
    """

    index: int
    name: str
    result: Any = field(repr=False)
    error: Exception | None
    seconds: float
    path: str | None = None


def remesh_many(
    items: Iterable[Any],
    L: Lengths | None = None,
    *,
    workers: int | None = None,
    on_error: str = "raise",
    ordered: bool = True,
    progress: bool = False,
    timeout: float | None = None,
    client: Any = None,
    store: FilePath | None = None,
    **options: Unpack[RemeshKeywords],
) -> Iterator[BatchItem]:
    """Remesh many meshes, in several processes or on a cluster.

    Every result is the same, bit for bit, as that of a separate call. Items are taken when they are
    needed and results are not kept, so a generator can give any number of them. The processes end with
    the iterator, also after ``close()`` or an interrupt; those of a ``client`` are left to it.

    Parameters
    ----------
    items : iterable
        Meshes: ``(V, F)``, the path of a file, a result of `read_mesh` or `remesh`, or any other object
        that `remesh` accepts.
    L : float, (n,) array, callable or Adaptive, optional
        Target edge length for all items, as in `remesh`.
    workers : int, optional
        Number of processes; by default as many as there are cores. With 1, everything runs in this
        process. Each process uses its part of the cores for large meshes. With a ``client``, the number
        of workers to keep busy: at most four items for each are on their way. By default the number of
        threads of a Dask cluster, also while it grows.
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
        timeout, even ``workers=1`` uses a process. A client has no way to end a task, so the two exclude
        each other.
    client : dask.distributed.Client or executor, optional
        Does the work instead of processes of this call: anything with ``submit(function, *args)`` whose
        future has ``result()``. Its workers need the same versions of remeshvec, NumPy and Numba, and
        see the files that items name.
    store : str or path, optional
        Folder that is made where it is missing. Workers write each result into a file of its own, as
        `LightResult.save` does, named by the item's number; items come with a ``path`` in the place of a
        ``result``.
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
        A process cannot be started. With a client: workers have other versions, do not see ``store``, or
        the client has ended.

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
    if client is not None:
        check_client(client)
        if timeout is not None:
            raise OptionError("timeout and client exclude each other: a client cannot end a task")
    _check_names(options)
    meshes = _iterator(items)
    total = len(items) if isinstance(items, Sized) else None
    crew = _Crew(workers, total, ordered, timeout, client)
    done = _with_names(meshes, {"L": L, **options}, crew, _made_folder(store))
    if on_error == "raise":
        done = _raising(done)
    return bar(done, total, lambda item: item.error is not None) if progress else done


class _Crew(NamedTuple):
    """Who does the work, and how."""

    workers: int | None  # as the caller says
    total: int | None  # items, where their number is known
    ordered: bool
    timeout: float | None
    client: Any

    @property
    def processes(self) -> int:
        """Number of processes; few large meshes get all cores."""
        return min(self.workers or available_threads(), self.total or sys.maxsize)

    @property
    def is_here(self) -> bool:
        """Whether all runs in this process alone."""
        wanted = self.workers or available_threads()
        return wanted == 1 and self.timeout is None and self.client is None


def _made_folder(store: FilePath | None) -> str | None:
    """Return the full path of a folder, which is there."""
    if store is None:
        return None
    folder = os.path.abspath(arguments.path(store, "store"))
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise OptionError(f"store: no folder {folder} can be made ({error.strerror})") from error
    return folder


def _iterator(items: Any) -> Iterator[Any]:
    """Iterate over many meshes, and refuse a single one."""
    if isinstance(items, str | bytes | os.PathLike | MeshFile | RemeshResult | LightResult):
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


def _with_names(
    items: Iterator[Any], options: dict[str, Any], crew: _Crew, store: str | None
) -> Iterator[BatchItem]:
    """Remesh, and put back the names and arrays that the workers did not need.

    Items are copied: they wait for their worker while the caller makes the next one, perhaps in the same
    arrays.
    """
    held: dict[int, tuple[str, Any]] = {}  # name and arrays of the items in progress

    def tasks() -> Iterator[Any]:
        for index, item in enumerate(items):
            mesh = as_mesh(item)
            name, arrays = _item_name(item), None
            del item
            if is_pair(mesh) and not crew.is_here:
                mesh = arrays = tuple(x.copy() if isinstance(x, np.ndarray) else x for x in mesh)
            if isinstance(mesh, str) and crew.client is not None:
                mesh = os.path.abspath(mesh)  # workers start elsewhere
            held[index] = name, arrays if store is None else None
            yield mesh if store is None else StoredItem(mesh, _file_name(store, index, mesh))

    for outcome in _item_outcomes(tasks(), options, crew, store):
        name, arrays = held.pop(outcome.number)
        index, result, error, seconds = outcome
        del outcome
        if arrays is not None and isinstance(result, RemeshResult):
            result.report = replace(result.report, before=arrays)
        if store is None:
            yield BatchItem(index, name, result, error, seconds)
        else:
            yield BatchItem(index, name, None, error, seconds, path=result)
        del result, arrays


def _file_name(store: str, index: int, mesh: Any) -> str:
    """Name a result by the number of its item, and by its file for those who read it."""
    stem = Path(mesh).stem if isinstance(mesh, str) else "mesh"
    return os.path.join(store, f"{index:06}-{stem}{LIGHT_SUFFIX}")


def _item_outcomes(
    tasks: Iterator[Any], options: dict[str, Any], crew: _Crew, store: str | None
) -> Iterator[Outcome]:
    """Let the crew work; without a store, results come back."""
    if crew.is_here:
        return run_here(remesh_any if store is None else remesh_to_file, tasks, options)
    function: Any = _remesh_there if store is None else remesh_to_file
    if crew.client is not None:
        check_workers(crew.client, store)
        return run_on_client(function, tasks, options, crew.client, crew.workers, crew.ordered)
    return run_in_processes(
        function, tasks, options, crew.processes, crew.ordered, crew.timeout,
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


def _item_name(item: Any) -> str:
    if isinstance(item, str | os.PathLike):
        return os.fsdecode(item)
    mesh = as_mesh(item)
    if not is_pair(mesh):
        return f"an object of type {type(item).__name__}"
    try:
        return f"{len(mesh[0]):,} vertices, {len(mesh[1]):,} faces"
    except TypeError:
        return "a pair of objects that are not arrays"


def _remesh_there(mesh: Any, options: dict[str, Any]) -> Any:
    """Remesh one item; do not send arrays of the caller back to it."""
    result = remesh_any(mesh, options)
    if is_pair(mesh) and isinstance(result, RemeshResult):
        result.report = replace(result.report, before=((), ()))
    return result


def one_line(error: Exception) -> str:
    """Return the type and the message of an error in one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
