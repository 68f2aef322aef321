"""From the last mesh to the caller's arrays: units, sheets welded, held faces first, maps and labels.

What few callers read is left to functions of few arrays, which `report.Late` calls when asked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._jit import compile_notice
from ._threads import thread_scope
from ._types import FIXED, FROZEN, NONE, Blocks, FloatArray, IndexArray, Mesh
from .clean import weld_vertices
from .constraints import Constraints, edge_keys
from .edge_sets import make_blocks
from .halfedge import ends_of
from .operations.project import Reference, locate_vertices
from .prepare import Prepared
from .reference import Built
from .seams import seam_vertices

__all__ = ["Output", "extract", "locate"]

IntArray = NDArray[np.int64]

# Vertices that are not on the input are looked for in the whole of their patch where a walk ends
# farther from them than this share of the mean target length.
_TRUST = 0.05


@dataclass(frozen=True)
class Output:
    """The arrays of a `RemeshResult`, see there, and functions that return the others."""

    V: NDArray[Any]
    F: NDArray[Any]
    face_labels: NDArray[Any] | None
    births: Callable[[], tuple[IntArray, FloatArray]]
    vertex_map: Callable[[], IntArray]
    face_map: Callable[[], IntArray]
    feature_edges: Callable[[], IntArray]
    corners: Callable[[], IntArray]
    lengths: FloatArray


def locate(
    mesh: Mesh, blocks: Blocks, reference: Reference, on_input: bool, parallel: bool
) -> FloatArray:
    """Find where on the reference the vertices of a compact mesh lie; sets ``mesh.birth``.

    Returns
    -------
    (n, 3) float64
        Weights of the corners of the face of ``mesh.birth``. Vertices that are not ``on_input`` are
        looked for beyond where a walk leads.
    """
    trust = np.inf if on_input else _TRUST * float(mesh.X[:, 3].mean())
    return locate_vertices(mesh, blocks, reference, trust, parallel)


def extract(
    mesh: Mesh,
    barycentric: FloatArray | None,
    prepared: Prepared,
    built: Built,
    constraints: Constraints,
    V: FloatArray,
    n_faces: int,
    threads: int,
) -> Output:
    """Turn a compact mesh into the caller's arrays.

    Parameters
    ----------
    mesh : Mesh
    barycentric : (n, 3) float64, optional
        Where on the face of ``mesh.birth`` each vertex lies; None to find out when asked.
    prepared, built, constraints
    V : (n_in, 3) float64
        The caller's vertices: fixed ones are copied from there, bit for bit.
    n_faces : int
        Faces of the input.
    threads : int
        Threads to use at most by what is left until asked for.
    """
    fixed = np.flatnonzero(mesh.kind == FIXED)
    born_at = prepared.vertex_source[built.reference.origin[mesh.birth[fixed]]]
    points = mesh.X[:, :3] / prepared.scale
    points += prepared.centre
    points[fixed] = V[born_at]
    lengths = mesh.X[:, 3] / prepared.scale
    F: NDArray[Any] = mesh.origin.reshape(-1, 3)
    ends: NDArray[Any] = _curve_ends(mesh, built)
    kept = None
    welded = _weld(mesh, built)
    if welded is not None:
        kept, new = welded
        points, lengths, F, ends, fixed = points[kept], lengths[kept], new[F], new[ends], new[fixed]
    labels, face_map = None, (np.empty(0, np.int64), np.empty(0, np.int64))
    if built.held is not None or constraints.labels is not None:
        source = prepared.face_source[mesh.source]
        if built.held is not None:
            held = built.held[mesh.source]
            if constraints.unselected is not None:
                first = constraints.unselected[source] & held
                order = np.lexsort((np.where(first, source, 0), ~first))
                F, source, held = F[order], source[order], held[order]
            face_map = source[held], np.flatnonzero(held)
        if constraints.labels is not None:
            labels = constraints.labels[source]
    if barycentric is None:
        where = partial(
            _locate_late, _vertices_of(mesh), make_blocks(mesh), built.reference, threads
        )
    else:
        where = partial(_known, mesh.birth, barycentric)
    return Output(
        points,
        F,
        labels,
        partial(_births, where, kept, prepared.face_source, prepared.flipped),
        partial(_spread, len(V), born_at, fixed, prepared.same),
        partial(_spread, n_faces, *face_map),
        partial(_feature_edges, ends),
        partial(np.unique, fixed),
        lengths,
    )


def _weld(mesh: Mesh, built: Built) -> tuple[NDArray[np.intp], IntArray] | None:
    """Vertices that stay, and the new number of each: sheets share theirs again. None: all stay."""
    if built.on_seam is None:
        return None
    target = weld_vertices(mesh.X[:, :3], seam_vertices(mesh, built))
    if target is None:
        return None
    kept = np.flatnonzero(target == np.arange(len(target)))
    new = np.full(len(target), -1, np.int64)
    new[kept] = np.arange(len(kept))
    return kept, new[target]


def _curve_ends(mesh: Mesh, built: Built) -> NDArray[Any]:
    """Return the ends (2, k) of edges on curves; of the frozen ones those that were features."""
    h = np.flatnonzero(mesh.curve != NONE)
    h = h[mesh.twin[h] < h]
    ends = ends_of(mesh.origin, h)
    is_frozen = mesh.curve[h] == FROZEN
    if is_frozen.any():
        origin = built.reference.origin
        known = edge_keys(ends_of(origin, built.features), len(built.reference.X))
        is_feature = np.isin(edge_keys(origin[mesh.birth[ends]], len(built.reference.X)), known)
        is_feature &= (mesh.kind[ends] == FIXED).all(axis=0)
        ends = ends[:, ~is_frozen | is_feature]
    return ends


# -- what is left until asked for -------------------------------------------------------------


def _births(
    where: Callable[[], tuple[IndexArray, FloatArray]],
    kept: NDArray[np.intp] | None,
    face_source: NDArray[Any],
    flipped: NDArray[np.bool_] | None,
) -> tuple[IntArray, FloatArray]:
    """Faces of the input, and weights of their corners, from those of the reference."""
    birth, barycentric = where()
    if kept is not None:
        birth, barycentric = birth[kept], barycentric[kept]
    face = face_source[birth // 3].astype(np.int64)
    if flipped is not None:
        is_flipped = flipped[face]
        barycentric[is_flipped] = barycentric[is_flipped][:, [0, 2, 1]]
    return face, barycentric


def _known(birth: IndexArray, barycentric: FloatArray) -> tuple[IndexArray, FloatArray]:
    return birth, barycentric


def _locate_late(
    vertices: Mesh, blocks: Blocks, reference: Reference, threads: int
) -> tuple[IndexArray, FloatArray]:
    """Look for vertices that were not projected, after the call that made them."""
    with compile_notice(), thread_scope(threads) as may_run:
        reference.surface.parallel = may_run
        barycentric = locate(vertices, blocks, reference, False, may_run)
    return vertices.birth, barycentric


def _vertices_of(mesh: Mesh) -> Mesh:
    """Leave out the arrays of the faces, so that they need not be kept."""
    nothing = np.empty(0, np.int32)
    return mesh._replace(
        origin=nothing, twin=nothing, curve=nothing, source=nothing, valence_excess=nothing
    )


def _spread(n: int, at: NDArray[Any], values: NDArray[Any], same: Any = None) -> IntArray:
    """Array of n numbers, -1 but where given; ``same`` names the element that stands for each."""
    spread = np.full(n, -1, np.int64)
    spread[at] = values
    return spread if same is None else spread[same]


def _feature_edges(ends: NDArray[Any]) -> IntArray:
    """Edges from their ends (2, k), each once, in order."""
    if not ends.size:
        return np.empty((0, 2), np.int64)
    return np.unique(np.sort(ends.astype(np.int64), axis=0), axis=1).T.copy()
