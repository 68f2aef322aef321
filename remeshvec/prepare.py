"""From the caller's arrays to a clean, ordered, connected mesh."""

from __future__ import annotations

from math import floor, log2
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._types import NONE, FloatArray, IndexArray, Mesh
from .clean import drop_degenerate_faces, drop_duplicate_faces, weld_vertices
from .errors import MeshInputError
from .halfedge import BuildReport, build_mesh, ends_of
from .order import order_mesh
from .orient import orient_faces

__all__ = ["Prepared", "prepare"]


class Prepared(NamedTuple):
    """A mesh ready for the sweeps, in a frame of its own: ``(V - centre) * scale``."""

    mesh: Mesh
    face_source: NDArray[np.intp]  # (m,) input face of every face
    vertex_source: IndexArray  # (n,) input vertex of every vertex
    same: IndexArray | None  # (n_in,) the input vertex that stands for each; None: itself
    flipped: NDArray[np.bool_] | None  # (m_in,) input faces whose corners 1 and 2 were swapped
    centre: FloatArray  # (3,)
    scale: float  # power of two
    dirt: dict[str, int]


def prepare(V: FloatArray, F: NDArray[np.int64], parallel: bool) -> Prepared:
    """Clean, orient, order and connect the input.

    Degenerate and duplicate faces go, vertices of the same place are welded where both lie on a
    boundary (closed parts that touch stay apart), faces are turned to the winding of their
    neighbours, edges that no manifold has are cut.
    """
    dirt: dict[str, int] = {}
    used = np.zeros(len(V), np.bool_)
    used[F.ravel()] = True
    _note(dirt, "unreferenced_vertices", len(V) - int(used.sum()))
    V, centre, scale = _to_frame(V, V if used.all() else V[used])
    if not used.all():
        V[~used] = V[used][0]  # they may lie anywhere and would spoil the order of the others
    F32 = F.astype(np.int32)
    source = np.arange(len(F))
    F32, source = _filter(F32, source, drop_degenerate_faces(F32), dirt, "degenerate_faces")
    connected = _connect(V, F32, parallel)
    found = connected.found
    if found.non_manifold_edges or found.inconsistent_edges or found.doubled_faces:
        kept = drop_duplicate_faces(F32)
        if kept is not None:
            F32, source = _filter(F32, source, kept, dirt, "duplicate_faces")
            connected = _connect(V, F32, parallel)
    on_boundary = np.unique(connected.mesh.origin[connected.mesh.twin == NONE])
    same = None
    if len(on_boundary):
        same = weld_vertices(V, np.unique(connected.vertex_source[on_boundary]))
    if same is not None:
        _note(dirt, "welded_vertices", int((same != np.arange(len(V))).sum()))
        F32 = same[F32]
        F32, source = _filter(F32, source, drop_degenerate_faces(F32), dirt, "degenerate_faces")
        F32, source = _filter(F32, source, drop_duplicate_faces(F32), dirt, "duplicate_faces")
        connected = _connect(V, F32, parallel)
    flipped = None
    if connected.found.inconsistent_edges or connected.found.non_manifold_edges:
        F32, turned = orient_faces(F32, len(V))
        if turned.any():
            _note(dirt, "flipped_faces", int(turned.sum()))
            flipped = np.zeros(len(F), np.bool_)
            flipped[source[turned]] = True
            connected = _connect(V, F32, parallel)
    _note(dirt, "non_manifold_edges", connected.found.non_manifold_edges)
    _note(dirt, "inconsistent_edges", connected.found.inconsistent_edges)
    if connected.found.pinched_vertices:
        _note(dirt, "pinched_vertices", _count_pinched(connected))
    return Prepared(
        connected.mesh, source[connected.face_source], connected.vertex_source, same, flipped,
        centre, scale, dirt,
    )  # fmt: skip


class _Connected(NamedTuple):
    mesh: Mesh
    face_source: IndexArray
    vertex_source: IndexArray
    found: BuildReport


def _connect(V: FloatArray, F: NDArray[np.int32], parallel: bool) -> _Connected:
    if not len(F):
        raise MeshInputError("no face of F has three different corners")
    ordered = order_mesh(V, F, parallel)
    mesh, found, source = build_mesh(ordered.X, ordered.F)
    return _Connected(mesh, ordered.face_source, ordered.vertex_source[source], found)


def _count_pinched(connected: _Connected) -> int:
    """Count vertices that hold several fans, but for the ends of edges that were cut."""
    mesh, source = connected.mesh, connected.vertex_source
    h = np.flatnonzero(mesh.twin == NONE)
    ends = source[ends_of(mesh.origin, h)]
    edges, count = np.unique(np.sort(ends, axis=0), axis=1, return_counts=True)
    vertices, fans = np.unique(source, return_counts=True)
    return len(np.setdiff1d(vertices[fans > 1], edges[:, count > 1]))


def _filter(
    F: NDArray[np.int32],
    source: NDArray[np.intp],
    kept: NDArray[np.intp] | None,
    dirt: dict[str, int],
    name: str,
) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
    if kept is None:
        return F, source
    _note(dirt, name, len(F) - len(kept))
    return F[kept], source[kept]


def _note(dirt: dict[str, int], name: str, count: int) -> None:
    if count:
        dirt[name] = dirt.get(name, 0) + count


def _to_frame(V: FloatArray, used: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Scale to an extent of 1 to 2 and, far from the origin, centre.

    A power of two changes no bit of a mantissa, so the frame costs no precision; it keeps squares
    of squares of lengths in range for any unit.
    """
    low, high = used.min(axis=0), used.max(axis=0)
    with np.errstate(over="ignore"):
        extent = float((high - low).max())
    if not extent > 0.0:
        raise MeshInputError("all vertices of V lie in one place: there is no surface to remesh")
    if not np.isfinite(extent):
        raise MeshInputError("the extent of V exceeds the range of float64; scale it down")
    middle = 0.5 * low + 0.5 * high
    centre = middle if np.abs(middle).max() > 4.0 * extent else np.zeros(3)
    scale = 2.0 ** min(1000, -floor(log2(extent)))
    with np.errstate(invalid="ignore", over="ignore"):  # vertices that no face uses may be anything
        return np.ascontiguousarray((V - centre) * scale), centre, scale
