"""Parts of a mesh: boxes of even weight, or connected components; and what each task sees around them.

Parts depend on the mesh, the target lengths and ``part_faces`` alone, never on the number of workers
or the memory: otherwise they would change the result.
"""

from __future__ import annotations

from math import ceil, cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import (
    DEFAULT_LENGTH_FACTOR,
    EQUILATERAL_AREA,
    BoolArray,
    FloatArray,
    IndexArray,
    IntArray,
)
from ..mesh.edges import components
from .vocabulary import Parts, SurfaceMesh, group_rows

__all__ = [
    "border_of",
    "centroids_of",
    "cut_into_boxes",
    "expected_work",
    "face_weights",
    "group_components",
    "make_parts",
    "near",
    "near_faces",
]

_AT_ONCE = 1 << 20  # rows in memory at a time

# Radians between the frames of two rounds, about two axes: no multiple is near a quarter turn.
_TURN = 0.6


def centroids_of(mesh: SurfaceMesh) -> FloatArray:
    """Centroids (m, 3) of the faces."""
    centroids = np.empty((len(mesh.F), 3))
    for rows in _chunks(len(mesh.F)):
        centroids[rows] = mesh.X[mesh.F[rows]][:, :, :3].mean(axis=1)
    return centroids


def face_weights(mesh: SurfaceMesh, n_reference: int, area: float) -> FloatArray:
    """Work that a face stands for, in faces: itself, what it will be cut into, the reference below it.

    Parameters
    ----------
    mesh : SurfaceMesh
    n_reference : int
        Faces of the reference.
    area : float
        Its area.
    """
    weights = np.empty(len(mesh.F))
    for rows in _chunks(len(mesh.F)):
        corners = mesh.X[mesh.F[rows]]
        a, b, c = corners[:, 0, :3], corners[:, 1, :3], corners[:, 2, :3]
        own = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        wanted = EQUILATERAL_AREA * corners[:, :, 3].mean(axis=1) ** 2
        weights[rows] = np.maximum(1.0, np.maximum(own / wanted, own * (n_reference / area)))
    return weights


def expected_work(V: FloatArray, F: IntArray, L: Any) -> float:
    """Work of a surface in faces, its own or those that it will be cut into, before it is prepared.

    Parameters
    ----------
    V : (n, 3) float64
    F : (m, 3) int64
    L : None, float or (n,) float64
    """
    total = 0.0
    L = default_length(V, F) if L is None else L
    for rows in _chunks(len(F)):
        a, b, c = (V[F[rows, i]] for i in range(3))
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        wanted = L[F[rows]].mean(axis=1) if isinstance(L, np.ndarray) else float(L)
        total += float(np.maximum(1.0, area / (EQUILATERAL_AREA * wanted**2)).sum())
    return total


def default_length(V: FloatArray, F: IntArray) -> float:
    """About the length that is taken where none is named; edges inside count twice."""
    total = sum(
        float(np.linalg.norm(V[F[rows, i]] - V[F[rows, (i + 1) % 3]], axis=1).sum())
        for rows in _chunks(len(F))
        for i in range(3)
    )
    return DEFAULT_LENGTH_FACTOR * total / (3 * len(F))


def cut_into_boxes(
    points: FloatArray, weights: FloatArray, most: float, turn: int
) -> tuple[NDArray[np.int32], int]:
    """Give every point the number of its part, so that no part weighs much more than ``most``.

    Recursive coordinate bisection across the longest side, in a frame of its own for every ``turn``:
    cuts of one round cross those of the next.
    """
    part = np.zeros(len(points), np.int32)
    count = max(1, ceil(float(weights.sum()) / most))
    if count > 1:
        turned = points @ _frame(turn)
        _bisect(turned, weights, np.arange(len(points)), 0, count, part)
    return part, count


def _bisect(
    points: FloatArray, weights: FloatArray, rows: IntArray, first: int, count: int, part: Any
) -> None:
    """Give the parts from ``first`` on to some of the points."""
    if count == 1 or not len(rows):
        part[rows] = first
        return
    axis = int(np.argmax(np.ptp(points[rows], axis=0)))
    rows = rows[np.argsort(points[rows, axis], kind="stable")]
    before = np.cumsum(weights[rows])
    lower = count // 2
    middle = int(np.searchsorted(before, before[-1] * (lower / count)))
    _bisect(points, weights, rows[:middle], first, lower, part)
    _bisect(points, weights, rows[middle:], first + lower, count - lower, part)


def _frame(turn: int) -> FloatArray:
    """Rotation about the z axis, then about the x axis."""
    c, s = cos(_TURN * turn), sin(_TURN * turn)
    about_z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    return np.asarray(about_z @ about_x)


def group_components(
    F: IndexArray, faces: IntArray, weights: FloatArray, most: float
) -> tuple[NDArray[np.int32], int]:
    """Give faces the number of a part made of whole components, which are joined by shared vertices.

    Small components fill a part up to ``most``; one that is larger is a part of its own.
    """
    vertices, corners = np.unique(F[faces], return_inverse=True)
    corners = corners.reshape(-1, 3)
    n, label = components(len(vertices), corners[:, [0, 1]].ravel(), corners[:, [1, 2]].ravel())
    component = label[corners[:, 0]]
    # In the order of their first faces, which lie along a curve: neighbours share a part.
    first = np.full(n, len(faces))
    np.minimum.at(first, component, np.arange(len(faces)))
    order = np.argsort(first, kind="stable")
    weight = np.bincount(component, weights[faces], n)[order]
    part_of = np.empty(n, np.int32)
    filled, part = 0.0, -1
    for place, w in zip(order.tolist(), weight.tolist(), strict=True):
        if part < 0 or filled + w > most:
            part, filled = part + 1, 0.0
        part_of[place] = part
        filled += w
    return part_of[component], part + 1


def make_parts(F: IndexArray, part: NDArray[np.int32], count: int, n: int) -> Parts:
    """List the faces of every part, and the ring of faces around each.

    Parameters
    ----------
    F : (m, 3) int32
    part : (m,) int32
        Part of every face; -1 for faces that stay.
    count : int
        Number of parts.
    n : int
        Number of vertices.
    """
    core, core_start = group_rows(part, count)
    border = border_of(F, part, n)
    faces = np.concatenate([rows.start + np.flatnonzero(border[F[rows]].any(axis=1))
                            for rows in _chunks(len(F))])  # fmt: skip
    owner = part[faces]
    # Pairs of a border vertex and a part that has faces there.
    vertex = F[faces].ravel().astype(np.int64)
    at = border[vertex] & (np.repeat(owner, 3) >= 0)
    pairs = np.unique(vertex[at] * count + np.repeat(owner, 3)[at])
    # Faces at such a vertex that are not the part's own are seen by it.
    starts = np.searchsorted(pairs, np.arange(n + 1) * count)
    seen = []
    for corner in range(3):
        v = F[faces, corner].astype(np.int64)
        k = starts[v + 1] - starts[v]
        face, first = np.repeat(faces, k), np.repeat(starts[v], k)
        offset = np.arange(len(face)) - np.repeat(np.cumsum(k) - k, k)
        seen.append((pairs[first + offset] % count, face))
    who, face = (np.concatenate([pair[i] for pair in seen]) for i in (0, 1))
    other = who != part[face]
    ring = np.unique(who[other] * len(F) + face[other])
    ring_part, ring = ring // len(F), ring % len(F)
    ring_start = np.searchsorted(ring_part, np.arange(count + 1))
    shared = pairs // count
    shared = np.unique(shared[1:][shared[1:] == shared[:-1]])
    none = np.zeros(count + 1, np.int64)
    return Parts(core, core_start, ring, ring_start, np.empty(0, np.int64), none, shared)


def border_of(F: IndexArray, part: NDArray[np.int32], n: int) -> BoolArray:
    """Mark vertices whose faces do not all belong to the same part."""
    low, high = np.full(n, np.iinfo(np.int32).max), np.full(n, -2)
    for rows in _chunks(len(F)):
        for corner in range(3):
            np.minimum.at(low, F[rows, corner], part[rows])
            np.maximum.at(high, F[rows, corner], part[rows])
    return high > low


def near(points: FloatArray, to: FloatArray, reach: float, lengths: FloatArray) -> BoolArray:
    """Mark the points that lie within so many of their own target lengths of others."""
    from scipy.spatial import cKDTree

    found = np.zeros(len(points), np.bool_)
    if not len(to):
        return found
    tree = cKDTree(to)
    for rows in _chunks(len(points)):
        limit = reach * lengths[rows]
        distance, _ = tree.query(points[rows], distance_upper_bound=float(limit.max()))
        found[rows] = distance <= limit
    return found


def near_faces(mesh: SurfaceMesh, centroids: FloatArray, to: FloatArray, reach: float) -> BoolArray:
    """Mark the faces whose centroid lies within so many target lengths of some points."""
    lengths = np.empty(len(mesh.F))
    for rows in _chunks(len(mesh.F)):
        lengths[rows] = mesh.X[mesh.F[rows], 3].mean(axis=1)
    return near(centroids, to, reach, lengths)


def _chunks(n: int) -> list[slice]:
    """Cut rows into ranges that fit into memory."""
    return [slice(k, min(k + _AT_ONCE, n)) for k in range(0, n, _AT_ONCE)]
