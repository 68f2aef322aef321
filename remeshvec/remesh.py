"""Isotropic remeshing [Botsch and Kobbelt 2004]: the sweep and its phases, start to end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import cos, radians
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._check import as_mesh, positive_count
from ._jit import compile_notice, thread_scope
from ._types import APEX, INNER, Blocks, FloatArray, Mesh
from .edge_sets import make_blocks
from .errors import OptionError
from .operations.collapse import CollapseLimits, collapse_short_edges
from .operations.fit import fit_vertices
from .operations.flip import FlipLimits, flip_edges
from .operations.project import Reference, locate_vertices, project_boundary, project_vertices
from .operations.relax import RelaxOptions, relax_vertices
from .operations.split import MAX_ROUNDS, compact, split_long_edges
from .operations.untangle import untangle_vertices
from .options import Options, make_options
from .prepare import Prepared, build_reference, choose_length, prepare
from .report import RemeshResult, Report, Stopwatch

__all__ = ["remesh"]

Callback = Callable[[int, str, int], Any]

# Below this a parallel region costs more than it saves when another process holds a core.
_PARALLEL_FACES = 50_000

# Between sweeps, vertices that a walk brings this close to the input, as a share of L, are not checked
# against the whole of it.
_TRUST = 0.05

MAX_FACES = 50_000_000


def remesh(
    V: ArrayLike,
    F: ArrayLike,
    L: float | None = None,
    *,
    preset: str = "default",
    iterations: int | None = None,
    split: float | Sequence[float] | None = None,
    collapse: float | Sequence[float] | None = None,
    foldover: float | None = None,
    sliver_check: bool | None = None,
    project: bool | None = None,
    untangle_angle: float | None = None,
    fit: bool | None = None,
    threads: int | None = None,
    max_faces: int = MAX_FACES,
    callback: Callback | None = None,
) -> RemeshResult:
    """Remesh a surface to well-shaped triangles with edges of length ``L``.

    Every sweep splits long edges, collapses short ones, flips edges towards valence 6 and relaxes
    vertices in their tangent planes; the last sweeps project vertices onto the input. The result is
    the same, bit for bit, on any number of threads.

    Parameters
    ----------
    V : (n, 3) float or int
        Vertices; any array-like, never modified.
    F : (m, 3) int
        Triangles as 0-based indices; any array-like, never modified. Boundaries, several components
        and any genus are welcome; degenerate, duplicate and unreferenced elements, non-manifold
        edges and inconsistent winding are handled and listed in ``report.dirt``.
    L : float, optional
        Target edge length in the units of ``V``; 0.9 times the mean edge length by default.
    preset : {"default", "fast", "fine"}
        ``"default"``: twelve sweeps with loosening thresholds, vertices on the input. ``"fast"``: the
        published algorithm, five sweeps. ``"fine"``: sixteen sweeps and the fit.
    iterations : int, optional
        Sweeps; threshold schedules are stretched over them.
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
        Degrees; triangles with a smaller angle are improved at the end. 41.5 by default, except for the
        preset ``"fast"``, which does not.
    fit : bool, optional
        Let vertices leave the input by up to 0.2 L so that faces straddle it: less RMS
        distance. On in ``"fine"``.
    threads : int, optional
        Threads to use at most; all by default. Meshes below 50,000 faces use one.
    max_faces : int
        An ``L`` that would give more faces than this is refused before any work.
    callback : callable, optional
        Called as ``callback(sweep, phase, count)`` after each phase; returning False ends the call
        with the mesh as it is then.

    Returns
    -------
    RemeshResult
        Unpacks as ``V2, F2``; holds birth faces, barycentric coordinates and a report too.

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
    watch = Stopwatch()
    options = make_options(
        preset,
        {
            "iterations": iterations,
            "split": split,
            "collapse": collapse,
            "foldover": foldover,
            "sliver_check": sliver_check,
            "project": project,
            "untangle_angle": untangle_angle,
            "fit": fit,
            "threads": threads,
        },
    )
    max_faces = positive_count(max_faces, "max_faces")
    if callback is not None and not callable(callback):
        raise OptionError(f"callback must be callable; got {callback!r}")
    with watch.time("check"):
        vertices, faces = as_mesh(V, F)
    with compile_notice(), thread_scope(options.threads) as may_run:
        run = _Run(options, watch, may_run, callback)
        with watch.time("build"):
            prepared = prepare(vertices, faces, run.is_parallel(len(faces)))
            length = choose_length(prepared, L, max_faces)
        with watch.time("reference"):
            reference = build_reference(prepared.mesh, length, run.is_parallel(len(faces)))
        mesh = run.sweep_all(prepared.mesh, reference, length)
        mesh, barycentric = run.finish(mesh, reference, length)
    with watch.time("extract"):
        V2, F2 = _extract(mesh, prepared, np.asarray(V).dtype, np.asarray(F).dtype)
        birth = prepared.face_source[mesh.birth // 3].astype(np.int64)
    report = Report(
        length / prepared.scale, options, run.sweeps, watch.stop(), run.stop, prepared.dirt,
        before=(V, F), after=(V2, F2),
    )  # fmt: skip
    return RemeshResult(V2, F2, birth, barycentric, report)


def _extract(
    mesh: Mesh, prepared: Prepared, vertex_dtype: np.dtype[Any], face_dtype: np.dtype[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Arrays in the caller's units and dtypes.

    Integer coordinates come back as float64, indices too many for the caller's dtype as int64.
    """
    V = mesh.X[:, :3] / prepared.scale + prepared.centre
    F = mesh.origin.reshape(-1, 3)
    if face_dtype.kind not in "iu" or len(V) - 1 > np.iinfo(face_dtype).max:
        face_dtype = np.dtype(np.int64)
    return V.astype(vertex_dtype if vertex_dtype.kind == "f" else np.float64), F.astype(face_dtype)


class _Run:
    """The sweeps of one call: options in, counts and seconds out."""

    def __init__(
        self, options: Options, watch: Stopwatch, may_run: bool, callback: Callback | None
    ) -> None:
        self.options = options
        self.watch = watch
        self.may_run = may_run
        self.callback = callback
        self.sweeps: list[dict[str, int]] = []
        self.stop = "all sweeps done"

    def is_parallel(self, n_faces: int) -> bool:
        """Tell whether a mesh of so many faces is worth more than one thread."""
        return self.may_run and n_faces >= _PARALLEL_FACES

    def sweep_all(self, mesh: Mesh, reference: Reference, length: float) -> Mesh:
        """Run all sweeps, or until the callback ends them."""
        blocks = make_blocks(mesh)
        for sweep in range(self.options.iterations):
            self.sweeps.append({})
            mesh, blocks = self._split(mesh, blocks, self.options.split[sweep] * length)
            if not self._is_cancelled(sweep, "split"):
                self._improve(mesh, blocks, reference, length, sweep)
            if self.stop == "cancelled":
                break
        return mesh

    def _split(self, mesh: Mesh, blocks: Blocks, longest: float) -> tuple[Mesh, Blocks]:
        """Split by rounds until no edge is too long."""
        count = 0
        with self.watch.time("split"):
            for _ in range(MAX_ROUNDS):
                parallel = self.is_parallel(mesh.origin.size // 3)
                mesh, n_split = split_long_edges(mesh, blocks, longest, parallel)
                if not n_split:
                    break
                blocks = make_blocks(mesh)
                count += n_split
        self.sweeps[-1]["split"] = count
        return mesh, blocks

    def _improve(
        self, mesh: Mesh, blocks: Blocks, reference: Reference, length: float, sweep: int
    ) -> None:
        """Run the phases that change the mesh in place."""
        options = self.options
        left = options.iterations - sweep
        parallel = self.is_parallel(mesh.origin.size // 3)
        limits = CollapseLimits(
            options.collapse[sweep] * length,
            options.split[sweep] * length,
            options.foldover_cosine,
            options.quadric_reach * length,
            options.sliver_check,
        )
        with self.watch.time("collapse"):
            tally = collapse_short_edges(mesh, blocks, limits, parallel)
            self.sweeps[-1]["collapse"] = int(tally[0])
        if self._is_cancelled(sweep, "collapse"):
            return
        flips = FlipLimits(
            cos(radians(options.flip_normal)), options.delaunay_ties, options.sliver_check
        )
        with self.watch.time("flip"):
            for _ in range(options.flip_passes):
                tally = flip_edges(mesh, blocks, flips, parallel)
                self.sweeps[-1]["flip"] = self.sweeps[-1].get("flip", 0) + int(tally[0])
        if self._is_cancelled(sweep, "flip"):
            return
        relax = RelaxOptions(options.stiffness, options.project)
        with self.watch.time("relax"):
            for _ in range(options.last_relaxations if left == 1 else 1):
                relax_vertices(mesh, blocks, relax, parallel)
        with self.watch.time("project"):
            if options.project and left <= options.projected_sweeps:
                project_vertices(mesh, blocks, reference, _TRUST * length, parallel)
            elif options.project:
                project_boundary(mesh, blocks, reference, parallel)
        self._is_cancelled(sweep, "relax")

    def finish(self, mesh: Mesh, reference: Reference, length: float) -> tuple[Mesh, FloatArray]:
        """Untangle, fit, and find where on the input every vertex lies."""
        options = self.options
        parallel = self.is_parallel(mesh.origin.size // 3)
        with self.watch.time("extract"):
            mesh = compact(mesh, make_blocks(mesh), parallel)
            blocks = make_blocks(mesh)
            mesh.kind[mesh.kind == APEX] = INNER
        with self.watch.time("finish"):
            if options.project:
                project_vertices(mesh, blocks, reference, 0.0, parallel)
            cosine = cos(radians(options.untangle_angle))
            for _ in range(options.untangle_rounds):
                untangle_vertices(mesh, blocks, reference.tree, options.project, cosine, parallel)
            for _ in range(options.fit_rounds):
                fit_vertices(mesh, blocks, reference.tree, 0.2 * length, parallel)
        with self.watch.time("locate"):
            is_on_input = options.project and not options.fit_rounds
            trust = np.inf if is_on_input else _TRUST * length
            barycentric = locate_vertices(mesh, blocks, reference, trust, parallel)
        return mesh, barycentric

    def _is_cancelled(self, sweep: int, phase: str) -> bool:
        if self.callback is None:
            return False
        if self.callback(sweep, phase, self.sweeps[-1].get(phase, 0)) is False:
            self.stop = "cancelled"
        return self.stop == "cancelled"
