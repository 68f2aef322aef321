"""From the caller's arrays to what the sweeps need: a clean, ordered mesh and the reference surface."""

from __future__ import annotations

from math import floor, isfinite, log2, sqrt
from numbers import Real
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import kernel
from ._types import APEX, FIXED, NONE, FloatArray, Mesh
from .boundary import link_boundary
from .bvh import build_tree
from .clean import drop_degenerate_faces, drop_duplicate_faces, weld_vertices
from .errors import MeshInputError, OptionError
from .features import apexes, boundary_corners
from .geometry import distance_squared, face_vector
from .halfedge import BuildReport, build_mesh, following
from .operations.project import Reference
from .order import Ordered, order_mesh

__all__ = ["Prepared", "build_reference", "choose_length", "prepare"]


# Longest target length in the frame of `Prepared`, where the mesh has an extent below 2: longer ones
# mean the same, and their squares might overflow.
_LONGEST = 1e6


class Prepared(NamedTuple):
    """A mesh ready for the sweeps, in a frame of its own: ``(V - centre) * scale``."""

    mesh: Mesh
    face_source: NDArray[np.intp]  # (m,) input face of every face
    centre: FloatArray  # (3,)
    scale: float  # power of two
    dirt: dict[str, int]


def prepare(V: FloatArray, F: NDArray[np.int64], parallel: bool) -> Prepared:
    """Clean, order and connect the input.

    Degenerate and duplicate faces go, vertices of the same place are welded where both lie on a
    boundary (closed parts that touch stay apart), edges that no manifold has are cut.
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
    ordered, mesh, found = _connect(V, F32, parallel)
    if found.non_manifold_edges or found.inconsistent_edges or found.doubled_faces:
        kept = drop_duplicate_faces(F32)
        if kept is not None:
            F32, source = _filter(F32, source, kept, dirt, "duplicate_faces")
            ordered, mesh, found = _connect(V, F32, parallel)
    on_boundary = np.unique(mesh.origin[mesh.twin == NONE])
    on_boundary = on_boundary[on_boundary < len(ordered.vertex_source)]
    target = weld_vertices(V, ordered.vertex_source[on_boundary]) if len(on_boundary) else None
    if target is not None:
        _note(dirt, "welded_vertices", int((target != np.arange(len(V))).sum()))
        F32 = target[F32]
        F32, source = _filter(F32, source, drop_degenerate_faces(F32), dirt, "degenerate_faces")
        F32, source = _filter(F32, source, drop_duplicate_faces(F32), dirt, "duplicate_faces")
        ordered, mesh, found = _connect(V, F32, parallel)
    for name in ("non_manifold_edges", "inconsistent_edges", "pinched_vertices"):
        _note(dirt, name, getattr(found, name))
    mesh.birth[:] = mesh.vertex_halfedge
    return Prepared(mesh, source[ordered.face_source], centre, scale, dirt)


def choose_length(prepared: Prepared, L: float | None, max_faces: int) -> float:
    """Target length in the prepared frame, checked against what it would make of the mesh.

    Raises
    ------
    OptionError
        ``L`` is no positive number, or would give more than ``max_faces`` faces, or is below the
        precision of the coordinates.
    """
    area, mean_edge, flat = _measure(prepared.mesh)
    _note(prepared.dirt, "zero_area_faces", flat)
    if not area > 0.0:
        raise MeshInputError("all faces of F have no area: there is no surface to remesh")
    length = 0.9 * mean_edge if L is None else _positive(L) * prepared.scale
    if length == 0.0:
        length = 5e-324  # refused below; a product that underflows is no longer zero
    expected = area / length / length / (sqrt(3.0) / 4.0)
    if not expected <= max_faces:
        raise OptionError(
            f"L = {length / prepared.scale:g} would give about {expected:.3g} faces, more than "
            f"max_faces = {max_faces:,}; the mean edge of the input is "
            f"{mean_edge / prepared.scale:g}"
        )
    coordinate = float(np.abs(prepared.centre).max()) * prepared.scale + 1.0
    if length < 1e3 * np.finfo(float).eps * coordinate:
        raise OptionError(
            f"L = {length / prepared.scale:g} is below the precision of coordinates near "
            f"{coordinate / prepared.scale:g}; move the mesh to the origin"
        )
    return min(length, _LONGEST)


def build_reference(mesh: Mesh, length: float, parallel: bool) -> Reference:
    """Build the surface to project on, from a mesh before its first sweep; fixes corners and apexes."""
    X = mesh.X.copy()
    origin = mesh.origin.copy()
    links = link_boundary(mesh)
    tips = apexes(mesh, length)
    mesh.kind[boundary_corners(mesh, links, length)] = FIXED
    mesh.kind[tips] = APEX
    tree = build_tree(X, origin.reshape(-1, 3), mesh.twin.copy(), parallel)
    return Reference(tree, X, origin, links)


def _connect(
    V: FloatArray, F: NDArray[np.int32], parallel: bool
) -> tuple[Ordered, Mesh, BuildReport]:
    if not len(F):
        raise MeshInputError("no face of F has three different corners")
    ordered = order_mesh(V, F, parallel)
    mesh, found = build_mesh(ordered.X, ordered.F)
    return ordered, mesh, found


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


def _positive(L: float) -> float:
    is_number = isinstance(L, Real) and not isinstance(L, bool | np.bool_)
    if not is_number or not isfinite(L) or not L > 0.0:
        raise OptionError(f"L must be a positive length in the units of V; got {L!r}")
    return float(L)


@kernel
def _measure(mesh):
    """Total area, mean edge length, number of faces without area."""
    X = mesh.X
    area = 0.0
    edges = 0.0
    count = 0
    flat = 0
    for f in range(mesh.origin.size // 3):
        a = mesh.origin[3 * f]
        b = mesh.origin[3 * f + 1]
        c = mesh.origin[3 * f + 2]
        nx, ny, nz = face_vector(
            X[a, 0], X[a, 1], X[a, 2], X[b, 0], X[b, 1], X[b, 2], X[c, 0], X[c, 1], X[c, 2]
        )
        face_area = 0.5 * np.sqrt(nx * nx + ny * ny + nz * nz)
        area += face_area
        if face_area == 0.0:
            flat += 1
        for h in range(3 * f, 3 * f + 3):
            if mesh.twin[h] < h:
                edges += np.sqrt(
                    distance_squared(X, mesh.origin[h], mesh.origin[following(np.int64(h))])
                )
                count += 1
    return area, edges / count, flat
