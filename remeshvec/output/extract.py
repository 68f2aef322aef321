"""From the last mesh to the caller's arrays: units, sheets welded, held faces first, maps and labels.

What few callers read is left to functions of few arrays, which `report.Lazy` calls when asked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import compile_notice, threaded
from ..core.lazy import Lazy
from ..core.ranges import even_ranges, per_range
from ..core.threads import thread_scope
from ..core.vocabulary import (
    DEAD,
    FIXED,
    FROZEN,
    NONE,
    Blocks,
    FloatArray,
    IndexArray,
    IntArray,
    Mesh,
)
from ..input.constraints import Constraints
from ..input.prepare import Prepared
from ..mesh.blocks import make_blocks
from ..mesh.edges import edge_keys
from ..mesh.repair import weld_vertices
from ..mesh.walk import ends_of
from ..operations.project import locate_vertices
from ..reference.build import FeaturedReference
from ..reference.bvh import WALK_TRUST
from ..reference.non_manifold import non_manifold_vertices
from ..reference.surface import Reference
from .input_edges import feature_edges, input_numbers
from .records import Births, Provenance

__all__ = ["Output", "extract", "locate"]


# Vertices that are on the input are found within this distance, in a frame of an extent of 1 to 2.
_ON_INPUT = 1e-10


@dataclass(frozen=True)
class Output:
    """The arrays of a `RemeshResult`, see there, and functions that return the others."""

    V: NDArray[Any]
    F: NDArray[Any]
    face_labels: NDArray[Any] | None
    provenance: Provenance
    vertex_map: Callable[[], IntArray]
    face_map: Callable[[], IntArray]
    feature_edges: Callable[[], IntArray]
    input_feature_edges: Callable[[], IntArray]
    corners: Callable[[], IntArray]
    lengths: FloatArray


def locate(mesh: Mesh, reference: Reference, on_input: bool, parallel: bool) -> FloatArray:
    """Find where on the reference the vertices of a compact mesh lie; sets ``mesh.birth``.

    Returns
    -------
    (n, 3) float64
        Weights of the corners of the face of ``mesh.birth``. Vertices that are not ``on_input`` are
        looked for beyond where a walk leads.
    """
    trust = np.inf if on_input else WALK_TRUST * float(mesh.X[:, 3].mean())
    near = _ON_INPUT if on_input else None
    return locate_vertices(mesh, make_blocks(mesh), reference, trust, parallel, near)


def extract(
    mesh: Mesh,
    is_compact: bool,
    barycentric: FloatArray | None,
    prepared: Prepared,
    featured: FeaturedReference,
    constraints: Constraints,
    V: FloatArray,
    shapes: tuple[int, np.dtype[Any]],
    threads: int,
) -> Output:
    """Turn a mesh into the caller's arrays.

    Parameters
    ----------
    mesh : Mesh
    is_compact : bool
        Whether no face and no vertex of it has been removed; there are no seams where some were.
    barycentric : (n, 3) float64, optional
        Where on the face of ``mesh.birth`` each vertex lies; None to find out when asked.
    prepared, built, constraints
    V : (n_in, 3) float64
        The caller's vertices: fixed ones are copied from there, bit for bit.
    shapes : int, dtype
        Faces of the input, and their type: that of the output's too, where it reaches.
    threads : int
        Threads to use at most, also by what is left until asked for.
    """
    n_faces, dtype = shapes
    numbers = _weld_sheets(mesh, featured) if is_compact else _number_alive(mesh, threads > 1)
    F, points, lengths = _write_result(mesh, numbers, prepared, dtype, threads > 1)
    fixed = np.flatnonzero((mesh.kind == FIXED) & (mesh.vertex_halfedge != DEAD))
    born_at = prepared.vertex_source[featured.reference.origin[mesh.birth[fixed]]]
    ends = _curve_ends(mesh, featured)
    if numbers.new.size:
        fixed, ends = numbers.new[fixed].astype(np.int64), numbers.new[ends]
    points[fixed] = V[born_at]
    order, labels, face_map = None, None, (np.empty(0, np.int64), np.empty(0, np.int64))
    if featured.held is not None or constraints.labels is not None:
        born_in = mesh.source[numbers.faces] if numbers.faces.size else mesh.source
        source = prepared.face_source[born_in]
        if featured.held is not None:
            held = featured.held[born_in]
            if constraints.unselected is not None:
                first = constraints.unselected[source] & held
                order = np.lexsort((np.where(first, source, 0), ~first))
                F, source, held = F[order], source[order], held[order]
            face_map = source[held], np.flatnonzero(held)
        if constraints.labels is not None:
            labels = constraints.labels[source]
    rows = numbers.faces if numbers.faces.size else np.arange(len(F), dtype=np.int32)
    return Output(
        points,
        F,
        labels,
        _provenance(
            mesh,
            barycentric,
            rows if order is None else rows[order],
            numbers.vertices,
            prepared,
            featured,
            len(V),
            WALK_TRUST * prepared.scale * float(lengths.mean()),
            threads,
        ),
        partial(_spread_to_input, len(V), born_at, fixed, prepared.representative),
        partial(_spread_to_input, n_faces, *face_map),
        partial(_sorted_pairs, ends),
        partial(
            feature_edges,
            featured.reference.origin,
            featured.features,
            featured.names,
            input_numbers(prepared, constraints.F),
        ),
        partial(np.unique, fixed),
        lengths,
    )


# -- new numbers ------------------------------------------------------------------------------


class _Numbers(NamedTuple):
    """Which faces and vertices stay, in their new order; nothing where all do."""

    faces: IndexArray
    vertices: IndexArray
    new: IndexArray  # new number of every vertex


_NOTHING = np.empty(0, np.int32)


def _number_alive(mesh: Mesh, parallel: bool) -> _Numbers:
    """Leave removed faces and vertices out; vertices follow the half-edges that own them."""
    lengths = (mesh.origin.size // 3, len(mesh.X), len(mesh.X))
    numbers = _Numbers(*(np.empty(size, np.int32) for size in lengths))
    cuts = even_ranges(len(numbers.faces), parallel)
    sizes = np.zeros((len(cuts) - 1, 2), np.int64)
    starts = np.zeros_like(sizes)
    if len(sizes) > 1:
        _list_alive(parallel, cuts, mesh, False, starts, sizes, numbers)
        np.cumsum(sizes[:-1], axis=0, out=starts[1:])
    _list_alive(parallel, cuts, mesh, True, starts, sizes, numbers)
    m, n = sizes.sum(axis=0).tolist()
    return _Numbers(numbers.faces[:m], numbers.vertices[:n], numbers.new)


@threaded(per_range)
def _list_alive(span, cuts, mesh, is_filling, starts, sizes, numbers):
    """List faces and vertices by ranges of all faces, or only count them."""
    for k in range(span[0], span[1]):
        n_faces = starts[k, 0]
        n_vertices = starts[k, 1]
        for f in range(cuts[k], cuts[k + 1]):
            if mesh.origin[3 * f] == DEAD:
                continue
            if is_filling:
                numbers.faces[n_faces] = f
            n_faces += 1
            for h in range(3 * f, 3 * f + 3):
                v = mesh.origin[h]
                if mesh.vertex_halfedge[v] == h:
                    if is_filling:
                        numbers.vertices[n_vertices] = v
                        numbers.new[v] = n_vertices
                    n_vertices += 1
        sizes[k, 0] = n_faces - starts[k, 0]
        sizes[k, 1] = n_vertices - starts[k, 1]


def _weld_sheets(mesh: Mesh, featured: FeaturedReference) -> _Numbers:
    """Let the sheets of a compact mesh share their vertices again."""
    target = None
    if featured.on_non_manifold is not None:
        target = weld_vertices(mesh.X[:, :3], non_manifold_vertices(mesh, featured))
    if target is not None:
        _part_corners(mesh.origin.reshape(-1, 3), target)
    if target is None:
        return _Numbers(_NOTHING, _NOTHING, _NOTHING)
    vertices = np.flatnonzero(target == np.arange(len(target))).astype(np.int32)
    new = np.empty(len(target), np.int32)
    new[vertices] = np.arange(len(vertices), dtype=np.int32)
    return _Numbers(_NOTHING, vertices, new[target])


def _part_corners(F: NDArray[Any], target: NDArray[Any]) -> None:
    """Leave apart what lies in one place but belongs to one face, which would lose its corners."""
    while True:
        a, b, c = target[F].T
        is_torn = (a == b) | (b == c) | (c == a)
        if not is_torn.any():
            return
        corners = F[is_torn]
        target[corners] = corners


def _write_result(
    mesh: Mesh, numbers: _Numbers, prepared: Prepared, dtype: np.dtype[Any], parallel: bool
) -> tuple[NDArray[Any], FloatArray, FloatArray]:
    """Write faces, vertices and lengths in the units of the caller."""
    m = numbers.faces.size or mesh.origin.size // 3
    n = numbers.vertices.size or len(mesh.X)
    if dtype.kind not in "iu" or n - 1 > np.iinfo(dtype).max:
        dtype = np.dtype(np.int64)
    F = np.empty((m, 3), dtype if dtype in (np.int32, np.int64) else np.int64)
    points, lengths = np.empty((n, 3)), np.empty(n)
    cuts = even_ranges(m, parallel)
    vertex_cuts = even_ranges(n, parallel)
    _fill(
        parallel,
        cuts,
        vertex_cuts,
        mesh,
        numbers,
        prepared.scale,
        prepared.centre,
        F,
        points,
        lengths,
    )
    return F.astype(dtype, copy=False), points, lengths


@threaded(per_range)
def _fill(span, cuts, vertex_cuts, mesh, numbers, scale, centre, F, points, lengths):
    for i in range(cuts[span[0]], cuts[span[1]]):
        f = numbers.faces[i] if numbers.faces.size else i
        for c in range(3):
            v = mesh.origin[3 * f + c]
            F[i, c] = numbers.new[v] if numbers.new.size else v
    for i in range(vertex_cuts[span[0]], vertex_cuts[span[1]]):
        v = numbers.vertices[i] if numbers.vertices.size else i
        for c in range(3):
            points[i, c] = mesh.X[v, c] / scale + centre[c]
        lengths[i] = mesh.X[v, 3] / scale


def _curve_ends(mesh: Mesh, featured: FeaturedReference) -> NDArray[Any]:
    """Return the ends (2, k) of edges on curves; of the frozen ones those that were features."""
    if not featured.has_curves and featured.held is None:
        return np.empty((2, 0), np.int32)
    h = np.flatnonzero(mesh.curve != NONE)
    h = h[(mesh.twin[h] < h) & (mesh.origin[h] != DEAD)]
    ends = ends_of(mesh.origin, h)
    is_frozen = mesh.curve[h] == FROZEN
    if is_frozen.any():
        origin, n = featured.reference.origin, len(featured.reference.X)
        known = edge_keys(ends_of(origin, featured.features), n)
        is_feature = np.isin(edge_keys(origin[mesh.birth[ends]], n), known)
        is_feature &= (mesh.kind[ends] == FIXED).all(axis=0)
        ends = ends[:, ~is_frozen | is_feature]
    return ends


# -- what is left until asked for -------------------------------------------------------------


def _provenance(
    mesh: Mesh,
    barycentric: FloatArray | None,
    rows: IndexArray,
    vertices: IndexArray,
    prepared: Prepared,
    featured: FeaturedReference,
    n_in: int,
    trust: float,
    threads: int,
) -> Provenance:
    """Keep what tells later where things lie on the input."""
    reference = featured.reference._replace(arcs=np.empty((3, 0)))
    if barycentric is None:
        bare, blocks = _without_faces(mesh), make_blocks(mesh)
        where = Lazy(partial(_locate_late, bare, blocks, reference, trust, threads))
    else:
        where = Lazy(partial(_known_births, mesh.birth, barycentric))
    return Provenance(
        mesh._replace(valence_excess=_NOTHING, vertex_halfedge=_NOTHING),
        where,
        rows,
        vertices,
        reference,
        featured.features,
        featured.names,
        prepared.face_source,
        prepared.vertex_source,
        prepared.flipped,
        prepared.cuts,
        prepared.representative,
        n_in,
        trust,
        threads,
    )


def _known_births(birth: IndexArray, barycentric: FloatArray) -> Births:
    return birth, barycentric


def _locate_late(
    mesh: Mesh, blocks: Blocks, reference: Reference, trust: float, threads: int
) -> Births:
    """Look for vertices that were not projected, after the call that made them."""
    with compile_notice(), thread_scope(threads) as may_run:
        reference.surface.parallel = may_run
        barycentric = locate_vertices(mesh, blocks, reference, trust, may_run)
    return mesh.birth, barycentric


def _without_faces(mesh: Mesh) -> Mesh:
    """Leave out the arrays of the faces, so that they need not be kept."""
    nothing = np.empty(0, np.int32)
    return mesh._replace(
        origin=nothing, twin=nothing, curve=nothing, source=nothing, valence_excess=nothing
    )


def _spread_to_input(
    n: int, at: NDArray[Any], values: NDArray[Any], representative: Any = None
) -> IntArray:
    """Array of n numbers, -1 but where given; ``representative`` names the one for each."""
    spread = np.full(n, -1, np.int64)
    spread[at] = values
    return spread if representative is None else spread[representative]


def _sorted_pairs(ends: NDArray[Any]) -> IntArray:
    """Edges from their ends (2, k), each once, in order."""
    if not ends.size:
        return np.empty((0, 2), np.int64)
    return np.unique(np.sort(ends.astype(np.int64), axis=0), axis=1).T.copy()
