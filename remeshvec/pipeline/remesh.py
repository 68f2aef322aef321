"""Isotropic remeshing [Botsch and Kobbelt 2004]: one call, start to end."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal, TypedDict, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike

from ..core.check import as_mesh, positive_count
from ..core.compiler import compile_notice
from ..core.lazy import Lazy, LazyRecipe
from ..core.stopwatch import Stopwatch
from ..core.threads import thread_scope
from ..errors import OptionError
from ..input.constraints import make_constraints
from ..input.options import make_options
from ..input.prepare import prepare
from ..interop.mesh_data import MeshData, carry
from ..interop.objects import is_mesh_object, read_object
from ..output.births import corner_births, face_births, images, vertex_births
from ..output.extract import extract, locate
from ..output.report import Report
from ..output.result import RemeshResult
from ..output.transfer import is_tensor, like, to_numpy
from ..sizing.adaptive import Adaptive
from ..sizing.target_lengths import check_gradation
from ..sweeps.sweeps import Callback, Sweeps
from .job import Job, Lengths, Sizing, meet_count

__all__ = ["RemeshOptions", "remesh"]

MAX_FACES = 50_000_000

M = TypeVar("M")


class RemeshOptions(TypedDict, total=False):
    """The keywords of `remesh`."""

    preset: str
    iterations: int | None
    tol: float | None
    split: float | Sequence[float] | None
    collapse: float | Sequence[float] | None
    foldover: float | None
    sliver_check: bool | None
    project: bool | None
    untangle_angle: float | None
    fit: bool | None
    feature_angle: float | str | None
    feature_edges: ArrayLike | None
    fixed_vertices: ArrayLike | None
    fixed_faces: ArrayLike | str | None
    face_labels: ArrayLike | str | None
    preserve: Any
    selection: ArrayLike | str | None
    boundary: str
    gradation: float
    n_faces: int | None
    n_vertices: int | None
    max_deviation: float | None
    threads: int | None
    max_faces: int
    callback: Callback | None


if TYPE_CHECKING:
    from typing import Unpack


@overload
def remesh(
    V: ArrayLike, F: ArrayLike, L: Lengths | None = None, **options: Unpack[RemeshOptions]
) -> RemeshResult: ...


@overload
def remesh(
    V: M,
    F: Lengths | str | None = None,
    L: Lengths | str | None = None,
    *,
    return_result: Literal[True],
    **options: Unpack[RemeshOptions],
) -> tuple[M, RemeshResult]: ...


@overload
def remesh(
    V: M,
    F: Lengths | str | None = None,
    L: Lengths | str | None = None,
    **options: Unpack[RemeshOptions],
) -> M: ...


def remesh(
    V: Any,
    F: Any = None,
    L: Any = None,
    *,
    preset: str = "default",
    iterations: int | None = None,
    tol: float | None = None,
    split: float | Sequence[float] | None = None,
    collapse: float | Sequence[float] | None = None,
    foldover: float | None = None,
    sliver_check: bool | None = None,
    project: bool | None = None,
    untangle_angle: float | None = None,
    fit: bool | None = None,
    feature_angle: float | str | None = "auto",
    feature_edges: ArrayLike | None = None,
    fixed_vertices: ArrayLike | None = None,
    fixed_faces: ArrayLike | str | None = None,
    face_labels: ArrayLike | str | None = None,
    preserve: Any = None,
    selection: ArrayLike | str | None = None,
    boundary: str = "free",
    gradation: float = 1.5,
    n_faces: int | None = None,
    n_vertices: int | None = None,
    max_deviation: float | None = None,
    threads: int | None = None,
    max_faces: int = MAX_FACES,
    callback: Callback | None = None,
    return_result: bool = False,
) -> Any:
    """Remesh a surface to well-shaped triangles with edges of length ``L``.

    Every sweep splits long edges, collapses short ones, flips edges towards valence 6 and relaxes
    vertices in their tangent planes; the last sweeps project vertices onto the input. Creases,
    boundaries and other curves keep their place: their vertices slide along them, their corners stay.
    The result is the same, bit for bit, on any number of threads.

    Parameters
    ----------
    V : (n, 3) float or int, or a mesh
        Vertices; any array-like, never modified. Or a whole mesh, with ``L`` after it: a pair ``(V, F)``,
        a ``trimesh.Trimesh``, ``pyvista.PolyData``, ``meshio.Mesh`` or ``open3d.geometry.TriangleMesh``.
        Objects come back as objects of the same type, with colours, texture coordinates, fields and
        groups; seams of textures and borders of groups are kept. Tensors of PyTorch come back as such.
    F : (m, 3) int
        Triangles as 0-based indices; any array-like, never modified. Boundaries, several components
        and any genus are welcome, edges of three faces and more too: sheets share their vertices on
        such edges before and after. Degenerate, duplicate and unreferenced elements, inconsistent
        winding and pinched vertices are handled and listed in ``report.dirt``.
    L : float, (n,) array, callable or Adaptive, optional
        Target edge length in the units of ``V``: for all edges, at each input vertex, as a function of
        points (k, 3), or from the curvature. 0.9 times the mean edge length by default. For objects, this
        and the options that take data on faces may name data that the object carries.
    preset : {"default", "fast", "fine"}
        ``"default"``: twelve sweeps with loosening thresholds, vertices on the input. ``"fast"``: the
        published algorithm, five sweeps. ``"fine"``: sixteen sweeps and the fit.
    iterations : int, optional
        Sweeps at most; threshold schedules are stretched over them.
    tol : float, optional
        Stop after a sweep that changed less than this share of the edges and moved vertices by less
        than ``tol * L`` (root mean square). By default all sweeps are run.
    split, collapse : float or sequence of float, optional
        Edges longer than ``split * L`` are split, shorter than ``collapse * L`` collapsed; a sequence
        gives one factor a sweep. 4/3 and 4/5 in the paper.
    foldover : float, optional
        Degrees that a face normal may turn in a collapse; 20 by default.
    sliver_check : bool, optional
        Refuse collapses and flips that make the worst triangle around them worse. Off by default: it
        keeps bad input bad.
    project : bool, optional
        Whether vertices end on the input surface; True by default. ``False`` is the algorithm as
        published, which lets them drift.
    untangle_angle : float, optional
        Degrees; triangles with a smaller angle are improved at the end. 41.5 by default; the preset
        ``"fast"`` does so only if asked.
    fit : bool, optional
        Let vertices leave the input by up to 0.2 L so that faces straddle it: less RMS
        distance. On in ``"fine"``.
    feature_angle : "auto", float or None
        Which creases to keep. ``"auto"``: those that turn more than their surroundings at the scale of
        ``L``, so that a part keeps its edges and a scan does not freeze its noise. Degrees: all edges
        whose faces turn by more. None: no creases.
    feature_edges : (k, 2) int, optional
        Edges of the input, as vertices, to keep as creases.
    fixed_vertices : (k,) int, optional
        Input vertices that stay, bit for bit; ``vertex_map`` tells where they went.
    fixed_faces : (k,) int or (m,) bool, optional
        Input faces that stay, bit for bit; ``face_map`` tells where they went.
    face_labels : (m,) int, optional
        Borders between labels are kept as creases, and every new face gets its label.
    preserve : (m, 3, ...) or (m,) array, or a list of such arrays, optional
        Data on corners of faces, as texture coordinates are, or on faces. Edges across which they differ
        are kept as creases, so that no new face mixes two charts; `RemeshResult.transfer` brings them
        over. Numbers that differ by less than 1e-6 of their range count as equal.
    selection : (k,) int or (m,) bool, optional
        Input faces to remesh. All others stay, and come first in the result, in their order.
    boundary : {"free", "split", "fixed"}
        ``"free"``: boundary vertices slide along the boundary of the input, corners stay. ``"split"``:
        boundary vertices of the input stay, long edges between them are split. ``"fixed"``: boundary
        edges stay.
    gradation : float
        Largest ratio of the target lengths at the ends of an edge, where ``L`` varies.
    n_faces, n_vertices : int, optional
        Number of faces or vertices instead of ``L``, met within 2 % where the shape allows it;
        ``report.stop`` says where it does not.
    max_deviation : float, optional
        Largest distance between input and result, both ways, in the units of ``V``. Edges become
        shorter than ``L`` where that needs it. See ``report.deviation`` for what was measured.
    threads : int, optional
        Threads to use at most; all by default. Meshes below 50,000 faces use one.
    max_faces : int
        An ``L`` that would give more faces than this is refused before any work.
    callback : callable, optional
        Called as ``callback(sweep, phase, count)`` after each phase; returning False ends the call
        with the mesh as it is then.
    return_result : bool
        With a mesh object, return a pair of the new object and the `RemeshResult`.

    Returns
    -------
    RemeshResult
        Unpacks as ``V2, F2``; holds births, labels, features, maps and a report too, and transfers data.
        For a mesh object an object of its type.

    Raises
    ------
    MeshInputError
        The arrays cannot be a triangle mesh.
    OptionError
        An option cannot work.

    References
    ----------
    Botsch and Kobbelt, A Remeshing Approach to Multiresolution Modeling, SGP 2004, section 4.
    """
    how: dict[str, Any] = {
        "iterations": iterations,
        "tol": tol,
        "split": split,
        "collapse": collapse,
        "foldover": foldover,
        "sliver_check": sliver_check,
        "project": project,
        "untangle_angle": untangle_angle,
        "fit": fit,
        "max_deviation": max_deviation,
        "threads": threads,
    }
    wishes: dict[str, Any] = {
        "feature_angle": feature_angle,
        "boundary": boundary,
        "feature_edges": feature_edges,
        "fixed_vertices": fixed_vertices,
        "fixed_faces": fixed_faces,
        "face_labels": face_labels,
        "preserve": preserve,
        "selection": selection,
    }
    rest: dict[str, Any] = {
        "preset": preset,
        "gradation": gradation,
        "n_faces": n_faces,
        "n_vertices": n_vertices,
        "max_faces": max_faces,
        "callback": callback,
    }
    if not _are_arrays(V, F):
        return _remesh_object(V, *_only_length(F, L), {**how, **wishes, **rest}, return_result)
    if return_result:
        raise OptionError("return_result goes with mesh objects; arrays give the result anyway")
    arrays = to_numpy(V) if is_tensor(V) else V, to_numpy(F) if is_tensor(F) else F
    result = _remesh_arrays(*arrays, L, how, wishes, **rest)
    if is_tensor(V) or is_tensor(F):
        result.V, result.F = like(V, result.V), like(F, result.F)
    return result


def _remesh_arrays(
    V: Any,
    F: Any,
    L: Any,
    how: dict[str, Any],
    wishes: dict[str, Any],
    *,
    preset: str,
    gradation: float,
    n_faces: int | None,
    n_vertices: int | None,
    max_faces: int,
    callback: Callback | None,
) -> RemeshResult:
    """Remesh arrays: check, prepare, sweep, extract."""
    watch = Stopwatch()
    options = make_options(preset, how)
    count = _wanted_count(L, n_faces, n_vertices)
    sizing = Sizing(L, check_gradation(gradation), positive_count(max_faces, "max_faces"))
    if callback is not None and not callable(callback):
        raise OptionError(f"callback must be callable; got {callback!r}")
    with watch.time("check"):
        vertices, faces = as_mesh(V, F)
        constraints = make_constraints(len(vertices), faces, **wishes)
    with compile_notice(), thread_scope(options.threads) as may_run:
        sweeps = Sweeps(options, watch, may_run, callback)
        with watch.time("build"):
            prepared = prepare(vertices, faces, sweeps.is_parallel(len(faces)))
        job = Job(prepared, constraints, vertices, sizing, sweeps)
        del prepared  # it holds the mesh of the input
        done = job.run_once() if count is None else meet_count(job, *count)
        parallel = sweeps.is_parallel(len(done.mesh.origin) // 3)
        barycentric = None
        if options.project or options.fit_rounds:
            with watch.time("locate"):
                barycentric = locate(
                    done.mesh, done.featured.reference, not options.fit_rounds, parallel
                )
        with watch.time("extract"):
            out = extract(
                done.mesh,
                done.is_compact,
                barycentric,
                job.prepared,
                done.featured,
                constraints,
                vertices,
                (len(faces), np.asarray(F).dtype),
                options.threads if parallel else 1,
            )
            V2 = out.V.astype(_vertex_dtype(V), copy=False)
    report = Report(
        done.length, options, sweeps.counts, watch.stop(), sweeps.stop, job.prepared.dirt,
        done.featured.counts, sweeps.deviation, before=(V, F), after=(V2, out.F),
    )  # fmt: skip
    return RemeshResult(
        V2, out.F, report, out.face_labels, out.lengths,
        LazyRecipe(partial(vertex_births, out.provenance)),
        LazyRecipe(partial(face_births, out.provenance)),
        LazyRecipe(partial(corner_births, out.provenance)),
        LazyRecipe(partial(images, out.provenance)),
        Lazy(out.vertex_map), Lazy(out.face_map), Lazy(out.feature_edges), Lazy(out.corners),
    )  # fmt: skip


def _are_arrays(V: Any, F: Any) -> bool:
    """Tell two arrays from a mesh and, perhaps, a length."""
    is_length = F is None or isinstance(F, Real | str | Adaptive) or callable(F)
    is_array = hasattr(V, "__array__") or isinstance(V, tuple | list)
    return not (is_mesh_object(V) or _is_pair(V) or (is_length and not is_array))


def _is_pair(V: Any) -> bool:
    """Tell the arrays of a whole mesh from two vertices."""
    if not isinstance(V, tuple | list) or len(V) != 2:
        return False
    try:
        return all(np.ndim(to_numpy(x)) == 2 for x in V)
    except ValueError:  # rows of unequal length
        return False


def _only_length(F: Any, L: Any) -> tuple[Any]:
    """Return the length, which may stand in the place of the faces."""
    if F is not None and L is not None:
        raise OptionError("a mesh object is followed by the length alone")
    return (L if F is None else F,)


def _remesh_object(mesh: Any, L: Any, options: Any, return_result: bool) -> Any:
    """Remesh an object, and let the new one carry the same data."""
    if _is_pair(mesh):
        if return_result:
            raise OptionError("return_result goes with mesh objects; arrays give the result anyway")
        return remesh(mesh[0], mesh[1], L, **options)
    data = read_object(mesh)
    for name in ("fixed_faces", "face_labels", "selection"):
        if isinstance(options[name], str):
            options[name] = _named(data, options[name], name)
    requested = options["preserve"]
    several = (
        requested
        if isinstance(requested, list | tuple)
        else []
        if requested is None
        else [requested]
    )
    found = [_named(data, x, "preserve") if isinstance(x, str) else x for x in several]
    options["preserve"] = data.preserved(found)
    if isinstance(L, str):
        if L not in data.on_vertices:
            raise OptionError(
                f"there are no data {L!r} on vertices; {_named_data(data.on_vertices)}"
            )
        L = data.on_vertices[L]
    result = remesh(data.V, data.F, L, **options)
    assert data.wrap is not None
    out = data.wrap(carry(data, result))
    return (out, result) if return_result else out


def _named(data: MeshData, name: str, option: str) -> Any:
    known = {
        **data.on_faces,
        **(data.on_corners | data.on_vertices if option == "preserve" else {}),
    }
    if name not in known:
        raise OptionError(f"{option}: there are no data {name!r}; {_named_data(known)}")
    return data.find(name)


def _named_data(data: dict[str, Any]) -> str:
    return "there are " + ", ".join(map(repr, data)) if data else "the mesh carries none"


def _wanted_count(L: Any, n_faces: Any, n_vertices: Any) -> tuple[str, int] | None:
    """Return what to count and how many are wanted, None for a length."""
    given = {"L": L, "n_faces": n_faces, "n_vertices": n_vertices}
    named = [name for name, value in given.items() if value is not None]
    if len(named) > 1:
        raise OptionError(f"{' and '.join(named)} exclude each other; give one of them")
    if n_faces is not None:
        return "faces", positive_count(n_faces, "n_faces")
    return None if n_vertices is None else ("vertices", positive_count(n_vertices, "n_vertices"))


def _vertex_dtype(V: ArrayLike) -> np.dtype[Any]:
    """Return the caller's dtype; coordinates that were whole numbers come back as float64."""
    dtype = np.asarray(V).dtype
    return dtype if dtype.kind == "f" else np.dtype(np.float64)
