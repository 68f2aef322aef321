"""From the caller's arrays to a clean, ordered, connected mesh."""

from __future__ import annotations

from collections.abc import Callable
from math import floor, isfinite, log2
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import NONE, FloatArray, IndexArray, Mesh
from ..errors import MeshInputError
from ..mesh.halfedge import build_mesh
from ..mesh.mend import Kept, mend_faces
from ..mesh.morton import MeshFrame, order_mesh, survey
from ..mesh.orient import orient_faces
from ..mesh.repair import count_used, drop_degenerate_faces, drop_duplicate_faces, weld_points
from ..mesh.twins import Defects
from ..mesh.walk import ends_of

__all__ = ["FaceCuts", "Kept", "Prepared", "prepare"]


class FaceCuts(NamedTuple):
    """Faces that are parts of input faces."""

    row: IndexArray  # (m,) row of each face in the weights, ``NONE`` for a whole input face
    weights: FloatArray  # (k, 3, 3) corners, in terms of those of the input face


class Prepared(NamedTuple):
    """A mesh ready for the sweeps, in a frame of its own: ``(V - centre) * scale``."""

    mesh: Mesh
    face_source: NDArray[Any]  # (m,) int, input face of every face
    vertex_source: IndexArray  # (n,) input vertex of every vertex
    representative: IndexArray | None  # (n_in,) the input vertex that stands for each; None: itself
    flipped: NDArray[np.bool_] | None  # (m_in,) input faces whose corners 1 and 2 were swapped
    cuts: FaceCuts | None  # faces that are a part of an input face; None for none
    centre: FloatArray  # (3,)
    scale: float  # power of two
    dirt: dict[str, int]


def prepare(
    V: FloatArray,
    F: NDArray[Any],
    parallel: bool,
    find_kept: Callable[[], Kept] | None = None,
) -> Prepared:
    """Clean, orient, order and connect the input.

    Degenerate and duplicate faces go, and what is smaller than rounding (see `mesh.mend`). Vertices of
    the same place are welded where both lie on a boundary (closed parts that touch stay apart), faces
    are turned to the winding of their neighbours, edges that no manifold has are cut.

    Parameters
    ----------
    V : (n, 3) float64
        Finite where faces use them.
    F : (m, 3) int
        Indices in range.
    parallel : bool
        Let threads share the work; the result is the same.
    find_kept : callable, optional
        Returns the vertices and faces that are left as they are, whatever their size.
    """
    # Kernels would be compiled once more for arrays that are read-only or not aligned.
    V, F = (array if array.flags.behaved else array.copy() for array in (V, F))
    F32, low, high, n_repeated = survey(V, F, parallel)
    frame = _make_frame(low, high)
    faces = _RemainingFaces(F32)
    if n_repeated:
        faces.note("unreferenced_vertices", len(V) - count_used(faces.F, len(V)))
        faces.keep(drop_degenerate_faces(faces.F), "degenerate_faces")
    faces.mend(V, frame, find_kept, parallel)
    mesh = _connect_faces(V, faces, frame, parallel)
    if not n_repeated:
        faces.note("unreferenced_vertices", len(V) - mesh.n_used)
    mesh = _drop_duplicates(mesh, V, faces, frame, parallel)
    representative = _weld_boundary(mesh, V, frame)
    if representative is None:
        representative = faces.representative
    else:
        faces.note("welded_vertices", int((representative != np.arange(len(V))).sum()))
        faces.F = representative[faces.F]
        faces.keep(drop_degenerate_faces(faces.F), "degenerate_faces")
        mesh = _connect_faces(V, faces, frame, parallel)
        mesh = _drop_duplicates(mesh, V, faces, frame, parallel)
        if faces.representative is not None:
            representative = representative[faces.representative]
    flipped = None
    if mesh.found.inconsistent_edges or mesh.found.non_manifold_edges:
        faces.F, turned = orient_faces(faces.F, len(V))
        if turned.any():
            faces.note("flipped_faces", int(turned.sum()))
            flipped = np.zeros(len(F), np.bool_)
            flipped[turned if faces.source is None else faces.source[turned]] = True
            mesh = _connect_faces(V, faces, frame, parallel)
    faces.note("non_manifold_edges", mesh.found.non_manifold_edges)
    faces.note("inconsistent_edges", mesh.found.inconsistent_edges)
    if mesh.found.pinched_vertices:
        faces.note("pinched_vertices", _count_pinched(mesh))
    cuts = faces.cuts(mesh.face_source)
    face_source = mesh.face_source
    if faces.source is not None:
        face_source = faces.source[face_source]
    return Prepared(
        mesh.mesh, face_source, mesh.vertex_source, representative, flipped, cuts, frame.centre,
        frame.scale, faces.dirt,
    )  # fmt: skip


class _RemainingFaces:
    """The faces that are left of the input, and what was found on the way."""

    def __init__(self, F: IndexArray) -> None:
        self.F = F
        self.source: IndexArray | None = None  # (m,) input face of each; None: itself
        self.weights = np.empty(
            (0, 3, 3)
        )  # corners of the last faces, which are parts of input faces
        self.representative: IndexArray | None = (
            None  # (n,) vertex that stands for each; None: itself
        )
        self.dirt: dict[str, int] = {}

    def mend(
        self,
        V: FloatArray,
        frame: MeshFrame,
        find_kept: Callable[[], Kept] | None,
        parallel: bool,
    ) -> None:
        """Do away with what is smaller than rounding."""

        def kept_now() -> Kept:
            if find_kept is None:
                return Kept(np.zeros(len(V), np.bool_), np.zeros(len(self.F), np.bool_))
            kept = find_kept()
            return kept if self.source is None else kept._replace(faces=kept.faces[self.source])

        if not len(self.F):
            return
        tolerance = _size_of_nothing(V, self.F, frame)
        mended = mend_faces(V, self.F, frame, tolerance, kept_now, parallel)
        if mended is None:
            return
        self.F, self.weights = mended.F, mended.weights
        self.source = mended.source if self.source is None else self.source[mended.source]
        self.representative = mended.representative
        for name, count in mended.counts.items():
            self.note(name, count)

    def cuts(self, order: IndexArray) -> FaceCuts | None:
        """Say which faces, in a new order, are parts of input faces."""
        if not len(self.weights):
            return None
        row = np.full(len(self.F), NONE, np.int32)
        row[len(self.F) - len(self.weights) :] = np.arange(len(self.weights))
        return FaceCuts(row[order], self.weights)

    def keep(self, kept: NDArray[np.intp] | None, name: str) -> None:
        """Keep some faces, or all, and say why."""
        if kept is None:
            return
        self.note(name, len(self.F) - len(kept))
        n_whole = len(self.F) - len(self.weights)
        self.weights = self.weights[kept[kept >= n_whole] - n_whole]
        self.F = self.F[kept]
        self.source = kept.astype(np.int32) if self.source is None else self.source[kept]

    def note(self, name: str, count: int) -> None:
        """Count dirt."""
        if count:
            self.dirt[name] = self.dirt.get(name, 0) + count


class _Connected(NamedTuple):
    mesh: Mesh
    face_source: IndexArray
    vertex_source: IndexArray
    n_used: int  # vertices that faces use
    found: Defects


def _connect_faces(
    V: FloatArray, faces: _RemainingFaces, frame: MeshFrame, parallel: bool
) -> _Connected:
    if not len(faces.F):
        raise MeshInputError("no face of F has three different corners")
    ordered = order_mesh(V, faces.F, parallel, frame)
    mesh, found, source = build_mesh(ordered.X, ordered.F, parallel, owned=True)
    vertex_source = ordered.vertex_source
    if len(source) > len(vertex_source):
        vertex_source = vertex_source[source]
    return _Connected(mesh, ordered.face_source, vertex_source, len(ordered.X), found)


def _drop_duplicates(
    connected: _Connected, V: FloatArray, faces: _RemainingFaces, frame: MeshFrame, parallel: bool
) -> _Connected:
    """Drop duplicate faces, if any, and connect the others."""
    found = connected.found
    if not (found.non_manifold_edges or found.inconsistent_edges or found.doubled_faces):
        return connected
    kept = drop_duplicate_faces(faces.F, connected.face_source[_may_be_double(connected.mesh.twin)])
    if kept is None:
        return connected
    faces.keep(kept, "duplicate_faces")
    return _connect_faces(V, faces, frame, parallel)


def _may_be_double(twin: IndexArray) -> NDArray[np.bool_]:
    """Faces without two different neighbours: the edges of duplicates are cut or join the two."""
    a, b, c = (twin.reshape(-1, 3) // 3).T
    most = np.maximum(np.maximum(a, b), c)
    return ((a == most) | (a < 0)) & ((b == most) | (b < 0)) & ((c == most) | (c < 0))


def _weld_boundary(connected: _Connected, V: FloatArray, frame: MeshFrame) -> IndexArray | None:
    """Map vertices of the boundary in one place to one of them; None where there are none."""
    on_boundary = np.flatnonzero(connected.mesh.kind)
    if not len(on_boundary):
        return None
    candidates = np.unique(connected.vertex_source[on_boundary])
    points = (V[candidates] - frame.centre) * frame.scale
    return weld_points(points, candidates, len(V))


def _count_pinched(connected: _Connected) -> int:
    """Count vertices that hold several fans, but for the ends of edges that were cut."""
    mesh, source, found = connected.mesh, connected.vertex_source, connected.found
    pinched = np.unique(source[connected.n_used :])
    if found.non_manifold_edges or found.inconsistent_edges:
        h = np.flatnonzero(mesh.twin == NONE)
        ends = np.sort(source[ends_of(mesh.origin, h)], axis=0)
        edges, count = np.unique(ends, axis=1, return_counts=True)
        pinched = np.setdiff1d(pinched, edges[:, count > 1])
    return len(pinched)


def _size_of_nothing(V: FloatArray, F: IndexArray, frame: MeshFrame) -> float:
    """Length in the frame that counts as none: what single precision leaves of the extent, or less.

    Less on a fine mesh, which is told from the edges of a thousand faces.
    """
    corners = V[F[:: max(1, len(F) // 1000)]] * frame.scale
    edges = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2)
    return min(1e-6, 1e-3 * float(np.mean(edges)))


def _make_frame(low: FloatArray, high: FloatArray) -> MeshFrame:
    """Scale to an extent of 1 to 2 and, far from the origin, centre.

    A power of two changes no bit of a mantissa, so the frame costs no precision; it keeps squares
    of squares of lengths in range for any unit.
    """
    corners = list(zip(low.tolist(), high.tolist(), strict=True))
    extent = max(b - a for a, b in corners)
    if not extent > 0.0:
        raise MeshInputError("all vertices of V lie in one place: there is no surface to remesh")
    if not isfinite(extent):
        raise MeshInputError("the extent of V exceeds the range of float64; scale it down")
    middle = [0.5 * a + 0.5 * b for a, b in corners]
    is_far = max(abs(x) for x in middle) > 4.0 * extent
    centre = np.array(middle) if is_far else np.zeros(3)
    return MeshFrame(low, high, centre, 2.0 ** min(1000, -floor(log2(extent))))
