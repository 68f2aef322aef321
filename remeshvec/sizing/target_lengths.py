"""Target lengths on the mesh, from what the caller asks for, and a check of what they would make."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, NamedTuple

import numpy as np

from ..core.arguments import number
from ..core.compiler import threaded
from ..core.geometry import area_vector, distance_squared
from ..core.vocabulary import (
    DEAD,
    DEFAULT_LENGTH_FACTOR,
    EQUILATERAL_AREA,
    FROZEN,
    BoolArray,
    FloatArray,
    IndexArray,
    Mesh,
)
from ..errors import MeshInputError, OptionError
from ..features.creases import find_creases
from ..input.constraints import ConstraintMasks
from ..input.prepare import Prepared
from ..mesh.walk import ends_of
from .adaptive import Adaptive, adaptive_lengths, expected_faces, target_lengths
from .gradation import limit_gradation

__all__ = [
    "MeshSize",
    "adaptive_limits",
    "bound_gradation",
    "check_gradation",
    "limited_lengths",
    "mesh_size",
    "set_lengths",
]

# Longest target length in the frame of `Prepared`, where the mesh has an extent below 2: longer ones
# mean the same, and their squares might overflow.
_LONGEST = 1e6


# Edges spread around their target, and errors go with their square. Of the faces made for this share of
# the tolerance about two in a hundred exceed it, and are split at the end.
_ADAPTIVE_SHARE = 0.9

# Where no face may exceed the distance even on the way.
_DEVIATION_SHARE = 0.5


# Faces in a piece of a loop.
_FACES_PER_PIECE = 32768

# Rounds over all edges that bound the growth of lengths; each reaches one edge further.
_GRADATION_ROUNDS = 32


class MeshSize(NamedTuple):
    """Size of a mesh, in the frame of `Prepared`."""

    area: float
    mean_edge: float
    coordinate: float  # how far from the origin of the input it lies


def mesh_size(prepared: Prepared, parallel: bool = False) -> MeshSize:
    """Measure a prepared mesh; notes its faces without area.

    Sums are taken by pieces of many faces, which threads share.

    Raises
    ------
    MeshInputError
        No face has an area.
    """
    mesh = prepared.mesh
    sums = np.empty((_per_piece(mesh), 4))
    _sum_sizes(parallel, mesh, sums)
    area, edges, n_edges, flat = (sum(column) for column in sums.T.tolist())
    if flat:
        prepared.dirt["zero_area_faces"] = int(flat)
    if not area > 0.0:
        raise MeshInputError("all faces of F have no area: there is no surface to remesh")
    far = float(np.abs(prepared.centre).max()) * prepared.scale + 1.0
    return MeshSize(area, edges / n_edges, far)


def bound_gradation(
    mesh: Mesh, gradation: float, copies: tuple[IndexArray, IndexArray] | None = None
) -> None:
    """Lower target lengths until the ratio along every edge is within bounds.

    ``copies`` are vertices on non-manifold edges and their places, see `non_manifold_copies`: those in
    one place get the same length, or the sheets would part.

    They are on the surface of the input already; an edge may take a short cut there. At edges that
    must stay lengths are what these ask for, on all sheets: were one of them shorter, the splits
    beside such an edge would never end.
    """
    h = np.flatnonzero(mesh.origin != DEAD)
    a, b = ends_of(mesh.origin, h)
    frozen = np.zeros(len(mesh.X), np.bool_)
    frozen[a[mesh.curve[h] == FROZEN]] = True
    frozen[b[mesh.curve[h] == FROZEN]] = True
    if copies is not None:
        copies = _free_copies(frozen, *copies)
    free = ~(frozen[a] | frozen[b])
    a, b = a[free], b[free]
    lengths = mesh.X[:, 3]
    for _ in range(_GRADATION_ROUNDS):
        steep = lengths[a] > gradation * lengths[b]
        back = lengths[b] > gradation * lengths[a]
        if not (steep.any() or back.any()):
            break
        np.minimum.at(lengths, a[steep], gradation * lengths[b[steep]])
        np.minimum.at(lengths, b[back], gradation * lengths[a[back]])
        if copies is not None:
            v, place = copies
            shared = np.full(int(place.max()) + 1, np.inf)
            np.minimum.at(shared, place, lengths[v])
            lengths[v] = shared[place]


def _free_copies(
    frozen: BoolArray, v: IndexArray, place: IndexArray
) -> tuple[IndexArray, IndexArray] | None:
    """Mark all copies of marked vertices; returns the others, None for none."""
    is_frozen = np.zeros(int(place.max()) + 1, np.bool_)
    is_frozen[place[frozen[v]]] = True
    frozen[v] |= is_frozen[place]
    free = ~is_frozen[place]
    return (v[free], place[free]) if free.any() else None


def check_gradation(value: Any) -> float:
    """Check the bound for the ratio of neighbouring lengths."""
    return number(value, "gradation", above=1.0)


def set_lengths(
    prepared: Prepared,
    measures: MeshSize,
    V: FloatArray,
    L: Any,
    marks: ConstraintMasks,
    feature_angle: float | str | None,
    gradation: float,
    max_faces: int,
    max_deviation: float | None = None,
) -> float:
    """Write target lengths to the last column of ``X``; returns the length of the mean new face.

    Parameters
    ----------
    prepared : Prepared
    measures : Measures
    V : (n, 3) float64
        The caller's vertices.
    L : None, number, array, callable or Adaptive
        In the units of ``V``.
    marks : Marks
        What must stay: lengths from curvature are not smoothed over hard edges.
    feature_angle : float, "auto" or None
    gradation : float
    max_faces : int
    max_deviation : float, optional
        Lengths are cut to what the curvature needs to stay this near, but not below the input's own
        edges.

    Raises
    ------
    OptionError
        No positive lengths, more than ``max_faces`` faces, or lengths below the precision of the
        coordinates.
    """
    X = prepared.mesh.X
    if isinstance(L, Adaptive):
        lengths = _adaptive(prepared, measures, L, marks.hard, feature_angle, _ADAPTIVE_SHARE)
    else:
        requested = (
            target_lengths(V, L)
            if L is not None
            else DEFAULT_LENGTH_FACTOR * measures.mean_edge / prepared.scale
        )
        if not isinstance(requested, np.ndarray) and max_deviation is None:
            return _set_one(
                prepared, measures, float(_in_range(requested * prepared.scale)), max_faces
            )
        if not isinstance(requested, np.ndarray):
            requested = np.full(len(V), requested)
        lengths = _in_range(requested[prepared.vertex_source] * prepared.scale)
    if max_deviation is not None:
        lengths = _near_input(prepared, measures, lengths, max_deviation, marks.hard, feature_angle)
    lengths = limited_lengths(prepared, lengths, gradation)
    X[:, 3] = lengths
    expected = expected_faces(X, prepared.mesh.origin, lengths)
    shortest, longest = float(lengths.min()), float(lengths.max())
    _check_output(prepared, measures, shortest, longest, expected, max_faces)
    return shortest if shortest == longest else sqrt(measures.area / (expected * EQUILATERAL_AREA))


def _set_one(prepared: Prepared, measures: MeshSize, length: float, max_faces: int) -> float:
    """Set the same length everywhere."""
    prepared.mesh.X[:, 3] = length
    face = EQUILATERAL_AREA * length * length
    expected = measures.area / face if face > 0.0 else inf
    _check_output(prepared, measures, length, length, expected, max_faces)
    return length


def _near_input(
    prepared: Prepared,
    measures: MeshSize,
    lengths: FloatArray,
    distance: float,
    hard: BoolArray,
    feature_angle: float | str | None,
) -> FloatArray:
    """Cut lengths to those whose chords stay near, and to no less than half the input's own edges."""
    mesh = prepared.mesh
    own = np.zeros(len(mesh.X))
    count = np.zeros(len(mesh.X))
    ends = mesh.origin, mesh.origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    edge = np.linalg.norm(mesh.X[ends[0], :3] - mesh.X[ends[1], :3], axis=1)
    for end in ends:
        own += np.bincount(end, edge, len(own))
        count += np.bincount(end, minlength=len(own))
    own /= np.maximum(count, 1)
    spec = Adaptive(distance, 1e-3 * distance, max(float(lengths.max()), distance) / prepared.scale)
    curved = _adaptive(prepared, measures, spec, hard, feature_angle, _DEVIATION_SHARE)
    return np.minimum(lengths, np.maximum(curved, 0.5 * own))


def _in_range(lengths: Any) -> Any:
    """Cut lengths off that are longer than any mesh, or that have underflown to zero."""
    return np.clip(lengths, 5e-324, _LONGEST)


def adaptive_limits(prepared: Prepared, spec: Adaptive) -> tuple[float, float]:
    """Shortest and longest length, in the frame of the mesh."""
    extent = float(np.ptp(prepared.mesh.X[:, :3], axis=0).max())
    shortest, longest = spec.limits(extent / prepared.scale)
    return shortest * prepared.scale, longest * prepared.scale


def _adaptive(
    prepared: Prepared,
    measures: MeshSize,
    spec: Adaptive,
    hard: BoolArray,
    feature_angle: float | str | None,
    share: float,
) -> FloatArray:
    """Lengths from curvature for a share of the tolerance."""
    mesh = prepared.mesh
    shortest, longest = adaptive_limits(prepared, spec)
    # Creases are sought at the scale of the input's edges: the lengths follow from them.
    mesh.X[:, 3] = min(max(measures.mean_edge, shortest), longest)
    arrays = (mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge)
    is_feature, _ = find_creases(*arrays, hard, feature_angle, measures.mean_edge)
    tolerance = share * spec.tolerance * prepared.scale
    return adaptive_lengths(*arrays, is_feature, tolerance, shortest, longest)


def limited_lengths(prepared: Prepared, lengths: FloatArray, gradation: float) -> FloatArray:
    """Bound the growth of lengths, also from sheet to sheet where they meet."""
    mesh, source = prepared.mesh, prepared.vertex_source
    if lengths.max() == lengths.min():
        return lengths
    copies = len(source) > len(np.unique(source))
    arrays = (mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge)
    for _ in range(16):
        lengths = limit_gradation(*arrays, lengths, gradation)
        if not copies:
            break
        shared = np.full(int(source.max()) + 1, np.inf)
        np.minimum.at(shared, source, lengths)
        before, lengths = lengths, shared[source]
        if (before == lengths).all():
            break
    return lengths


def _check_output(
    prepared: Prepared,
    measures: MeshSize,
    shortest: float,
    longest: float,
    expected: float,
    max_faces: int,
) -> None:
    scale = prepared.scale
    what = f"L = {shortest / scale:g}"
    if longest > shortest:
        what = f"L from {shortest / scale:g} to {longest / scale:g}"
    if not expected <= max_faces:
        raise OptionError(
            f"{what} would give about {expected:.3g} faces, more than "
            f"max_faces = {max_faces:,}; the mean edge of the input is "
            f"{measures.mean_edge / scale:g}"
        )
    if shortest < 1e3 * np.finfo(float).eps * measures.coordinate:
        raise OptionError(
            f"{what} is below the precision of coordinates near "
            f"{measures.coordinate / scale:g}; move the mesh to the origin"
        )


def _per_piece(mesh: Mesh, *_: Any) -> int:
    return -(-mesh.origin.size // (3 * _FACES_PER_PIECE))


@threaded(_per_piece)
def _sum_sizes(span, mesh, sums):
    """Area, length of all edges, their number, number of faces without area, by pieces.

    All sides are measured and half of them dropped: which one no processor can predict.
    """
    X = mesh.X
    n_faces = mesh.origin.size // 3
    for k in range(span[0], span[1]):
        area = 0.0
        edges = 0.0
        count = 0
        flat = 0
        for f in range(_FACES_PER_PIECE * k, min(_FACES_PER_PIECE * k + _FACES_PER_PIECE, n_faces)):
            a = mesh.origin[3 * f]
            b = mesh.origin[3 * f + 1]
            c = mesh.origin[3 * f + 2]
            nx, ny, nz = area_vector(X, a, b, c)
            face_area = 0.5 * sqrt(nx * nx + ny * ny + nz * nz)
            area += face_area
            flat += face_area == 0.0
            ab = np.int64(mesh.twin[3 * f] < 3 * f)
            bc = np.int64(mesh.twin[3 * f + 1] < 3 * f + 1)
            ca = np.int64(mesh.twin[3 * f + 2] < 3 * f + 2)
            edges += sqrt(distance_squared(X, a, b)) * ab
            edges += sqrt(distance_squared(X, b, c)) * bc
            edges += sqrt(distance_squared(X, c, a)) * ca
            count += ab + bc + ca
        sums[k, 0] = area
        sums[k, 1] = edges
        sums[k, 2] = count
        sums[k, 3] = flat
