"""One call on arrays, start to end: check, prepare, sweep, extract."""

from __future__ import annotations

import warnings
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.arguments import count, function
from ..core.check import as_mesh
from ..core.compiler import compile_notice
from ..core.lazy import Lazy, LazyRecipe
from ..core.stopwatch import Stopwatch
from ..core.threads import thread_scope
from ..core.vocabulary import LARGEST_MESH
from ..errors import MeshInputError, OptionError, RemeshWarning
from ..input.constraints import Constraints, make_constraints
from ..input.options import RemeshOptions
from ..input.prepare import prepare
from ..input.recipe import Recipe, make_recipe
from ..output.births import corner_births, face_births, images, turned_faces, vertex_births
from ..output.extract import Output, extract, locate
from ..output.report import Report
from ..output.result import RemeshResult
from ..sizing.target_lengths import check_gradation
from ..sweeps.monitor import Monitor
from ..sweeps.work import is_large
from .job import Job, Remeshed, Sizing, meet_count

__all__ = ["read_sizing", "remesh_arrays", "vertex_dtype"]


def remesh_arrays(V: Any, F: Any, L: Any, options: RemeshOptions) -> RemeshResult:
    """Remesh arrays."""
    watch = Stopwatch()
    recipe = make_recipe(options)
    sizing, wanted = read_sizing(L, options)
    with watch.time("check"):
        vertices, faces = as_mesh(V, F)
        _check_number(len(vertices), len(faces))
        constraints = make_constraints(len(vertices), faces, options)
    with compile_notice(), thread_scope(recipe.threads) as may_run_parallel:
        with watch.time("build"):
            prepared = prepare(
                vertices,
                faces,
                may_run_parallel and is_large(len(faces)),
                partial(constraints.kept, len(vertices)),
            )
        monitor = Monitor(watch, options.callback)
        job = Job(prepared, constraints, vertices, sizing, recipe, monitor, may_run_parallel)
        del prepared  # it holds the mesh of the input
        done = job.run_once() if wanted is None else meet_count(job, *wanted)
        if wanted is None:
            _check_max_faces(done.count("faces"), sizing.max_faces, done.length)
        out = _extract(job, done, constraints, len(faces), np.asarray(F).dtype)
        with watch.time("extract"):
            V2 = out.V.astype(vertex_dtype(V), copy=False)
    with watch.time("extract"):
        before = _kept(V, vertices), faces.astype(np.int32)
    report = Report(
        done.length, recipe, done.counts, watch.stop(), done.stop, job.prepared.dirt,
        done.featured.counts, done.deviation, done.clearance, before=before, after=(V2, out.F),
        turned=LazyRecipe(partial(turned_faces, out.provenance)),
    )  # fmt: skip
    if done.missed and recipe.max_deviation is not None:
        warnings.warn(
            f"{done.missed}; a shorter L, more sweeps (iterations) or a larger bound may help",
            RemeshWarning,
            stacklevel=3,
        )
    return _result(V2, out, report)


def read_sizing(L: Any, options: RemeshOptions) -> tuple[Sizing, tuple[str, int] | None]:
    """Check the callback and what is said about sizes; a number of faces or vertices comes beside it."""
    if options.callback is not None:
        function(options.callback, "callback")
    wanted = _wanted_count(L, options)
    gradation = check_gradation(options.gradation)
    max_faces = count(options.max_faces, "max_faces", high=LARGEST_MESH)
    return Sizing(L, gradation, max_faces), wanted


def _check_number(n: int, m: int) -> None:
    """Refuse meshes whose half-edges have no room in 32 bits."""
    if m > LARGEST_MESH or n > 3 * LARGEST_MESH:
        raise MeshInputError(
            f"V, F have {n:,} vertices and {m:,} faces; at most {3 * LARGEST_MESH:,} and "
            f"{LARGEST_MESH:,} fit into 32-bit indices: cut the mesh into parts"
        )


def _check_max_faces(n_faces: int, max_faces: int, length: float) -> None:
    if n_faces > max_faces:
        raise OptionError(
            f"L = {length:g} gave {n_faces:,} faces, more than max_faces = {max_faces:,}: long thin "
            "faces, small parts, or faces and edges that must stay, need more than the area; raise L "
            "or max_faces"
        )


def _extract(
    job: Job, done: Remeshed, constraints: Constraints, n_faces: int, dtype: np.dtype[Any]
) -> Output:
    """Turn the last mesh into the arrays of a result."""
    recipe, watch = job.recipe, job.monitor.watch
    parallel = job.may_run_parallel and is_large(len(done.mesh.origin) // 3)
    barycentric = None
    if _ends_on_input(recipe):
        with watch.time("locate"):
            barycentric = locate(done.mesh, done.featured.reference, done.is_on_input, parallel)
    with watch.time("extract"):
        return extract(
            done.mesh,
            done.is_compact,
            barycentric,
            job.prepared,
            done.featured,
            constraints,
            job.V,
            (n_faces, dtype),
            recipe.threads if parallel else 1,
        )


def _ends_on_input(recipe: Recipe) -> bool:
    """Tell whether births are found at the end of the call, next to where vertices were projected."""
    return recipe.project or recipe.fit_rounds > 0


def _result(V: Any, out: Output, report: Report) -> RemeshResult:
    """Put the result together; what few callers ask for is left as a recipe."""
    provenance = out.provenance
    return RemeshResult(
        V, out.F, report, out.face_labels, out.lengths,
        LazyRecipe(partial(vertex_births, provenance)),
        LazyRecipe(partial(face_births, provenance)),
        LazyRecipe(partial(corner_births, provenance)),
        LazyRecipe(partial(images, provenance)),
        Lazy(out.vertex_map), Lazy(out.face_map), Lazy(out.feature_edges),
        Lazy(out.input_feature_edges), Lazy(out.corners),
    )  # fmt: skip


def _wanted_count(L: Any, options: RemeshOptions) -> tuple[str, int] | None:
    """Return what to count and how many are wanted, None for a length."""
    counts = {"n_faces": options.n_faces, "n_vertices": options.n_vertices}
    given = {name: value for name, value in {"L": L, **counts}.items() if value is not None}
    if len(given) > 1:
        raise OptionError(f"{' and '.join(given)} exclude each other; give one of them")
    for name, value in counts.items():
        if value is not None:
            return name.removeprefix("n_"), count(value, name)
    return None


def _kept(given: Any, checked: NDArray[Any]) -> NDArray[Any]:
    """Return an array that the caller cannot change: results read the input long after the call."""
    return checked.copy() if np.may_share_memory(np.asarray(given), checked) else checked


def vertex_dtype(V: ArrayLike) -> np.dtype[Any]:
    """Return the caller's dtype; coordinates that were whole numbers come back as float64."""
    dtype = np.asarray(V).dtype
    return dtype if dtype.kind == "f" else np.dtype(np.float64)
