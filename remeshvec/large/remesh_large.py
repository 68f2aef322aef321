"""`remesh_large`: one surface in parts, by tasks on files."""

from __future__ import annotations

import shutil
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core import arguments
from ..core.check import as_mesh
from ..core.compiler import compile_notice
from ..core.stopwatch import Stopwatch
from ..core.threads import available_threads, thread_scope
from ..core.version import __version__
from ..core.vocabulary import FloatArray, IntArray
from ..errors import OptionError
from ..files.disk import check_writable
from ..input.constraints import make_constraints
from ..input.options import RemeshKeywords, RemeshOptions
from ..input.prepare import prepare
from ..input.recipe import Recipe, make_recipe
from ..pipeline.arrays import read_sizing, remesh_arrays, vertex_dtype
from ..pipeline.job import Job
from ..sweeps.monitor import Monitor
from ..sweeps.work import is_large
from .engine import Client, Engine, check_client
from .index import write_index
from .output import SUFFIXES, arrays_folder, write_arrays, write_mesh_file, write_result
from .partition import expected_work
from .plans import Plan
from .request import enter_scratch, leave_scratch, read_large_options, read_lengths, recipe_of
from .result import LargeResult, open_result
from .rounds import Call, run_rounds_of_parts
from .scratch import read_json
from .source import Source, read_source
from .vocabulary import load_mesh

if TYPE_CHECKING:
    from typing import Unpack

__all__ = ["remesh_large", "remesh_parts", "write_scratch"]

# Parts must be much wider than the bands around their cuts.
_LEAST_PART = 10_000

# Bytes on disk: of the index and of a mesh between two rounds, per face; twice the mesh and what the
# tasks write are there at the same time. Measured: 49 and 46.
_INDEX_BYTES = 50
_MESH_BYTES = 150
_RESULT_BYTES = 75


def remesh_large(
    source: Any,
    L: Any = None,
    *,
    out: Any,
    scratch: Any = None,
    client: Client | None = None,
    workers: int | None = None,
    part_faces: int = 2_000_000,
    resume: bool = True,
    progress: bool = False,
    **options: Unpack[RemeshKeywords],
) -> LargeResult:
    """Remesh one large surface in parts, in several processes or on a cluster.

    The surface is cut into parts, which are remeshed one by one with their borders frozen; what lies
    along the borders is remeshed in further rounds, until no trace of them is left. Creases, curves and
    corners are found once, on the whole surface; every vertex ends on the input, and its birth names
    the input's own face. The result is the same, bit for bit, for any number of workers and threads,
    after a worker has died, and after a call that was interrupted and goes on. It depends on
    ``part_faces``. A surface that fits into one part is remeshed by `remesh`, with its result.

    The input is prepared, and its features are found, in this process, which needs about as much memory
    per face of the input as `remesh` does; the work after that needs memory for a part in each worker.

    Parameters
    ----------
    source : path, or (V, F)
        A mesh file (binary PLY and STL are mapped, not read whole), a folder with ``V.npy`` and
        ``F.npy``, or a pair of arrays, of maps, or of ``.npy`` files.
    L : float, (n,) array or callable, optional
        Target edge length as in `remesh`; 0.9 times the mean edge length by default.
    out : path
        A ``.ply`` or ``.stl`` file to write, beside which a folder ``NAME.arrays`` holds the arrays of
        the result; or that folder alone, any other name. What is there is replaced.
    scratch : path, optional
        Folder for the work, on a disk that all workers see: about 300 bytes per face. By default
        ``NAME.scratch`` beside ``out``. It is removed when the result is written.
    client : object, optional
        Who does the work: a Dask ``Client``, an executor of ``concurrent.futures``, or anything else
        with ``submit(function, *args)`` that returns a future.
    workers : int, optional
        Without a client, number of processes; by default as many as there are cores. With 1 everything
        runs in this process.
    part_faces : int
        Faces in a part, of the surface before and after; at least 10,000. A worker needs about 500
        bytes of memory for each.
    resume : bool
        Whether to go on where a call with the same arguments was interrupted; else it starts again.
    progress : bool
        Show progress on the error stream.
    **options
        Options of `remesh`, except ``n_faces``, ``n_vertices``, ``max_deviation``, ``tol``,
        ``callback``, ``selection``, ``avoid_intersections``, ``project=False`` and ``fit=True``.
        There is no limit ``max_faces`` by default.

    Returns
    -------
    LargeResult
        Unpacks as ``V2, F2``: maps of files.

    Raises
    ------
    MeshInputError
        ``source`` is not a triangle mesh.
    MeshFormatError
        A file cannot be read or written.
    OptionError
        An option cannot work, or not in parts; the disk has too little room; the surface has
        non-manifold edges and does not fit into one part; or ``scratch`` belongs to another call.
    WorkerError
        A worker died several times over the same part, has other versions of the packages, or does not
        see the scratch folder.

    Examples
    --------
    >>> result = remesh_large("scan.ply", 0.1, out="even.ply", workers=2)  # doctest: +SKIP
    >>> for part in result.parts():  # doctest: +SKIP
    ...     print(len(part.F))
    """
    start = perf_counter()
    wanted = read_large_options(dict(options))
    recipe = make_recipe(wanted)
    engine = _engine(client, workers)
    part_faces = arguments.count(part_faces, "part_faces", low=_LEAST_PART)
    resume, progress = arguments.flag(resume, "resume"), arguments.flag(progress, "progress")
    target = _target(out)
    folder = _scratch(scratch, target)
    surface = read_source(source)
    mesh = as_mesh(surface.V, surface.F)
    L = read_lengths(mesh[0], L)
    if expected_work(*mesh, L) <= part_faces:
        del mesh
        _remesh_whole(surface, L, wanted, target)
    else:
        _check_disk(folder, len(mesh[1]), expected_work(*mesh, L))
        enter_scratch(folder, recipe_of(surface, L, wanted, part_faces), resume)
        if not (folder / "index").is_dir():
            write_scratch(mesh, L, wanted, recipe, folder)
        del mesh
        remesh_parts(surface, folder, engine, (wanted, recipe), part_faces, progress, target, start)
        leave_scratch(folder)
    result = open_result(arrays_folder(target), surface.F, len(surface.V))
    if target.suffix.lower() in SUFFIXES:
        write_mesh_file(target, result.V, result.F)
    return result


def _engine(client: Any, workers: Any) -> Engine:
    check_client(client)
    if workers is not None:
        workers = arguments.count(workers, "workers")
    if client is not None and workers is not None:
        raise OptionError("client and workers exclude each other; a client has workers of its own")
    return Engine(workers or available_threads(), client)


def _target(out: Any) -> Path:
    """Check where the result goes."""
    target = Path(arguments.path(out, "out")).absolute()
    folder = arrays_folder(target)
    if folder != target:
        check_writable(target)
    elif target.suffix:
        raise OptionError(
            f"out must be a file with the suffix {' or '.join(SUFFIXES)}, or a folder without one; "
            f"got {target.name}"
        )
    if folder.exists() and not (folder / "report.json").is_file():
        raise OptionError(
            f"{folder} exists and is not the result of an earlier call; choose another"
        )
    if not folder.parent.is_dir():
        raise OptionError(f"out = {target} cannot be written: there is no folder {folder.parent}")
    return target


def _scratch(scratch: Any, target: Path) -> Path:
    if scratch is None:
        return target.with_name(f"{target.name}.scratch")
    return Path(arguments.path(scratch, "scratch")).absolute()


def _check_disk(folder: Path, n_faces: int, work: float) -> None:
    """Refuse a disk without room for the work."""
    needed = int(_INDEX_BYTES * n_faces + (_MESH_BYTES + _RESULT_BYTES) * work)
    there = folder
    while not there.exists():
        there = there.parent
    free = shutil.disk_usage(there).free
    if free < needed and not folder.exists():
        raise OptionError(
            f"the work needs about {needed / 1e9:.3g} GB on the disk of {folder}, which has "
            f"{free / 1e9:.3g} GB left; give another scratch folder"
        )


def _remesh_whole(surface: Source, L: Any, wanted: RemeshOptions, target: Path) -> None:
    """Remesh a surface that is one part."""
    result = remesh_arrays(surface.V, surface.F, L, wanted)
    arrays = {
        "V": result.V,
        "F": result.F,
        "birth_face": result.birth_face,
        "birth_barycentric": result.birth_barycentric,
        "lengths": result.lengths,
    }
    if result.face_labels is not None:
        arrays["face_labels"] = result.face_labels
    report = result.report
    seconds = result.report.seconds["total"]
    rounds = [{"name": "everything", "parts": 1, "faces": len(surface.F), "seconds": seconds}]
    size = {"length": report.target_length, "dirt": report.dirt, "features": report.features}
    write_arrays(
        arrays_folder(target),
        arrays,
        _report(result.V, result.F, size, rounds, seconds),
    )


def write_scratch(
    mesh: tuple[FloatArray, IntArray], L: Any, wanted: RemeshOptions, recipe: Recipe, folder: Path
) -> None:
    """Prepare the surface, and write it as files."""
    V, F = mesh
    sizing, _ = read_sizing(L, wanted)
    constraints = make_constraints(len(V), F, wanted)
    with compile_notice(), thread_scope(recipe.threads) as may_run_parallel:
        find_kept = partial(constraints.kept, len(V))
        prepared = prepare(V, F, may_run_parallel and is_large(len(F)), find_kept)
        monitor = Monitor(Stopwatch())
        job = Job(prepared, constraints, V, sizing, recipe, monitor, may_run_parallel)
        write_index(job, constraints, folder / "index", folder / "mesh-0")


def remesh_parts(
    surface: Source,
    folder: Path,
    engine: Engine,
    options: tuple[RemeshOptions, Recipe],
    part_faces: int,
    progress: bool,
    target: Path,
    start: float,
) -> None:
    """Run the rounds on an index, and write the arrays of the result."""
    wanted, recipe = options
    size = read_json(folder / "index" / "notes.json")
    plan = Plan(folder, part_faces, size["faces"], size["area"])
    call = Call(folder, recipe, size["scale"], wanted.gradation, plan, engine, progress)
    rounds, births = run_rounds_of_parts(call)
    mesh = load_mesh(call.last_mesh)
    if len(mesh.F) > wanted.max_faces:
        raise OptionError(
            f"the result has {len(mesh.F):,} faces, more than max_faces = {wanted.max_faces:,}; raise "
            "L or max_faces"
        )
    report = _report(mesh.X, mesh.F, size, rounds, perf_counter() - start)
    frame = size["scale"], np.array(size["centre"])
    dtypes = vertex_dtype(surface.V), _face_dtype(surface.F, len(mesh.X))
    write_result(folder, mesh, births, frame, dtypes, arrays_folder(target), report)


def _report(
    V: NDArray[Any], F: NDArray[Any], size: dict[str, Any], rounds: list[Any], seconds: float
) -> dict[str, Any]:
    return {
        "target_length": size["length"],
        "vertices": len(V),
        "faces": len(F),
        "rounds": rounds,
        "dirt": size["dirt"],
        "features": size["features"],
        "seconds": seconds,
        "version": __version__,
    }


def _face_dtype(F: NDArray[Any], n: int) -> np.dtype[Any]:
    """Type of the faces: that of the input's, where it reaches."""
    dtype = F.dtype
    return dtype if dtype.kind in "iu" and n - 1 <= np.iinfo(dtype).max else np.dtype(np.int64)
