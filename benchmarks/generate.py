"""Irregular meshes of any size: a small mesh, cut finer and perturbed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Share of the way from the flat face to the planes at its corners [Boubekeur and Alexa 2008]. Left
# flat, the faces of the small mesh would be facets of the large one, and their edges creases that a
# remesher that keeps creases would keep: 11 % of all edges at 16 times the faces, now 1 %.
ROUND = 0.75

# Of a step in each direction of a face, in lengths of its small edges. Up to a quarter no face turns
# over, however thin it is: the steps of two corners differ by half an edge at most.
NOISE = 0.25


class Edges(NamedTuple):
    """The edges of a mesh, each once."""

    ends: IntArray  # (e, 2), the smaller first
    of_face: IntArray  # (m, 3), from corner c to corner c + 1
    is_reversed: NDArray[np.bool_]  # (m, 3), whether the face runs along it from the larger end


def cut_finer(V: FloatArray, F: IntArray, n: int, seed: int = 0) -> tuple[FloatArray, IntArray]:
    """Cut every face into ``n * n``, and move the new vertices at random.

    They move within their face, or along their edge, and on thin faces less far across than along;
    then towards the planes at the corners, which rounds the surface. Without the noise most vertices
    would have six equal faces around them, and a remesher little to do. Needs little memory beside
    the result.
    """
    import igl

    V, F = np.asarray(V, float), np.asarray(F, np.int64)
    N = np.nan_to_num(igl.per_vertex_normals(V, F))
    rng = np.random.default_rng(seed)
    edges = _edges(F)
    rows = np.array([(i, j) for i in range(n + 1) for j in range(n + 1 - i)])
    weights = np.column_stack([n - rows.sum(axis=1), rows])  # of the three corners, times n
    on_edges = _points_on_edges(V, N, edges.ends, n, rng)
    inside = _points_in_faces(V, N, F, weights[(weights > 0).all(axis=1)], n, rng)
    index = _indices(F, edges, weights, n, len(V))
    del edges
    return np.concatenate([V, on_edges, inside]), index[:, _small_faces(n)].reshape(-1, 3)


def _edges(F: IntArray) -> Edges:
    pairs = np.stack([F, np.roll(F, -1, axis=1)], axis=-1)
    ends, which = np.unique(np.sort(pairs.reshape(-1, 2), axis=1), axis=0, return_inverse=True)
    return Edges(ends, which.reshape(F.shape), pairs[..., 0] > pairs[..., 1])


def _points_on_edges(
    V: FloatArray, N: FloatArray, ends: IntArray, n: int, rng: np.random.Generator
) -> FloatArray:
    """Points ``1 .. n - 1`` of every edge, counted from its smaller end."""
    points = np.empty((len(ends), n - 1, 3))
    for k in range(1, n):  # not all at once: that takes several times the memory
        t = (k + rng.uniform(-NOISE, NOISE, len(ends))) / n
        points[:, k - 1] = _rounded(V, N, ends, np.stack([1 - t, t]))
    return points.reshape(-1, 3)


def _points_in_faces(
    V: FloatArray,
    N: FloatArray,
    F: IntArray,
    weights: IntArray,
    n: int,
    rng: np.random.Generator,
) -> FloatArray:
    """One point a face for every row of weights; face by face."""
    points = np.empty((len(F), len(weights), 3))
    for k, (_, i, j) in enumerate(weights):
        s, t = (np.array([[i], [j]]) + rng.uniform(-NOISE, NOISE, (2, len(F)))) / n
        points[:, k] = _rounded(V, N, F, np.stack([1 - s - t, s, t]))
    return points.reshape(-1, 3)


def _rounded(V: FloatArray, N: FloatArray, corners: IntArray, weights: FloatArray) -> FloatArray:
    """Points with these weights of their corners (k, c); weights (c, k)."""
    flat = sum(w[:, None] * V[v] for w, v in zip(weights, corners.T, strict=True))
    heights = np.stack([((flat - V[v]) * N[v]).sum(axis=1) for v in corners.T])
    down = sum((w * h)[:, None] * N[v] for w, h, v in zip(weights, heights, corners.T, strict=True))
    return np.asarray(flat - ROUND * down)


def _indices(F: IntArray, edges: Edges, weights: IntArray, n: int, vertices: int) -> IntArray:
    """Vertex of the result at every lattice point of every face."""
    index = np.empty((len(F), len(weights)), np.int64)
    is_inner = (weights > 0).all(axis=1)
    first_inside = vertices + len(edges.ends) * (n - 1)
    index[:, is_inner] = first_inside + np.arange(len(F) * is_inner.sum()).reshape(len(F), -1)
    for corner in range(3):
        index[:, weights[:, corner] == n] = F[:, corner, None]
        after = (corner + 1) % 3
        on_edge = (weights[:, corner] > 0) & (weights[:, after] > 0) & ~is_inner
        steps = weights[on_edge, after]  # from this corner to the next
        steps = np.where(edges.is_reversed[:, corner, None], n - steps, steps)
        index[:, on_edge] = vertices + edges.of_face[:, corner, None] * (n - 1) + steps - 1
    return index


def _small_faces(n: int) -> IntArray:
    """Lattice points at the corners of the small faces, (n * n, 3)."""
    first = np.cumsum([0, *range(n + 1, 0, -1)])  # of the row i
    upward = [
        (first[i] + j, first[i + 1] + j, first[i] + j + 1) for i in range(n) for j in range(n - i)
    ]
    downward = [
        (first[i] + j + 1, first[i + 1] + j, first[i + 1] + j + 1)
        for i in range(n - 1)
        for j in range(n - 1 - i)
    ]
    return np.array(upward + downward)
