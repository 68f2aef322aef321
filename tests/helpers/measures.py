"""Measures that the tests of the controls share: samples, distances, crease and boundary edges."""

from __future__ import annotations

import igl
import numpy as np

from helpers.complexes import edges_of, edges_with

ON = 1e-9  # of the diagonal: what lies on a straight line or a plane but for rounding
NEAR = 1e-6  # of the diagonal: on the input


def diagonal(V) -> float:
    """Length of the bounding box's diagonal."""
    return float(np.linalg.norm(np.ptp(np.asarray(V), axis=0)))


def bits(V) -> list[bytes]:
    """Coordinates as bytes, one entry a row: equal only where every bit is (but for zeros' signs)."""
    return [row.tobytes() for row in np.ascontiguousarray(V) + np.zeros(1, np.asarray(V).dtype)]


def face_vectors(V, F) -> np.ndarray:
    """Normals of twice the faces' areas, (m, 3)."""
    a, b, c = np.moveaxis(np.asarray(V, dtype=float)[np.asarray(F)], 1, 0)
    return np.cross(b - a, c - a)


def face_areas(V, F) -> np.ndarray:
    return np.linalg.norm(face_vectors(V, F), axis=1) / 2


def unit_normals(V, F) -> np.ndarray:
    N = face_vectors(V, F)
    return N / np.maximum(np.linalg.norm(N, axis=1, keepdims=True), 1e-300)


def lengths_of(V, edges) -> np.ndarray:
    """Lengths of edges given by their ends."""
    V = np.asarray(V, dtype=float)
    return np.linalg.norm(V[edges[:, 0]] - V[edges[:, 1]], axis=1)


def all_edges(F) -> np.ndarray:
    return edges_of(F).ends


def edge_lengths(V, F) -> np.ndarray:
    return lengths_of(V, all_edges(F))


def face_points(V, F, per_face: int = 3, seed: int = 0) -> np.ndarray:
    """Points strictly inside the faces: the centroid, then random ones; (m, per_face, 3)."""
    weights = np.random.default_rng(seed).dirichlet([1, 1, 1], (len(F), per_face))
    weights[:, 0] = 1 / 3
    return np.einsum("fkc,fcx->fkx", weights, np.asarray(V, dtype=float)[np.asarray(F)])


def surface_samples(V, F) -> np.ndarray:
    """Vertices, edge midpoints, face centroids and two random points a face, (k, 3)."""
    V = np.asarray(V, dtype=float)
    middles = V[all_edges(F)].mean(axis=1)
    return np.concatenate([V[np.unique(F)], middles, face_points(V, F).reshape(-1, 3)])


def to_surface(P, V, F) -> np.ndarray:
    """Distance of points to a surface."""
    return closest_on(P, V, F)[0]


def closest_on(P, V, F) -> tuple[np.ndarray, np.ndarray]:
    """Distance of points to a surface, and the face where the closest point lies."""
    squared, face, _ = igl.point_mesh_squared_distance(
        np.ascontiguousarray(P, dtype=float),
        np.ascontiguousarray(V, dtype=float),
        np.ascontiguousarray(F, dtype=np.int64),
    )
    return np.sqrt(squared), face


def to_segments(P, segments) -> np.ndarray:
    """Distance of points to the nearest of some segments (k, 2, 3)."""
    P, segments = np.asarray(P, dtype=float).reshape(-1, 3), np.asarray(segments, dtype=float)
    best = np.full(len(P), np.inf)
    for a, b in segments:
        d = b - a
        t = np.clip((P - a) @ d / (d @ d), 0, 1)
        np.minimum(best, np.linalg.norm(P - a - t[:, None] * d, axis=1), out=best)
    return best


def along(segments, n: int = 7) -> np.ndarray:
    """Points along segments, ends included, (k n, 3)."""
    segments = np.asarray(segments, dtype=float).reshape(-1, 2, 3)
    t = np.linspace(0, 1, n)[None, :, None]
    return (segments[:, :1] * (1 - t) + segments[:, 1:] * t).reshape(-1, 3)


def nearest(P, Q) -> tuple[np.ndarray, np.ndarray]:
    """For points P the distance to the nearest of Q, and which one it is."""
    from scipy.spatial import cKDTree

    return cKDTree(np.asarray(Q, dtype=float)).query(np.asarray(P, dtype=float))


def boundary_edges(F) -> np.ndarray:
    """Edges of one face, (k, 2)."""
    return edges_with(F, 1)


def edge_places(V, edges) -> set[frozenset[bytes]]:
    """Edges as sets of the bits of their ends' coordinates, so that numbering does not matter."""
    return {frozenset(bits(V[list(edge)])) for edge in np.asarray(edges).reshape(-1, 2).tolist()}


def face_places(V, F) -> list[tuple[bytes, ...]]:
    """Faces as the bits of their corners, turned so that the smallest comes first."""
    faces = []
    for rows in np.asarray(V)[np.asarray(F)]:
        corners = bits(rows)
        first = corners.index(min(corners))
        faces.append((*corners[first:], *corners[:first]))
    return faces


def sorted_edges(edges) -> np.ndarray:
    """Edges with the smaller index first, in lexicographic order, each once."""
    return np.unique(np.sort(np.asarray(edges, dtype=np.int64).reshape(-1, 2), axis=1), axis=0)


def label_borders(F, labels) -> np.ndarray:
    """Edges between faces of different labels, (k, 2)."""
    edges = edges_of(F)
    values = np.repeat(np.unique(labels, return_inverse=True)[1].reshape(-1), 3)
    low = np.full(len(edges.ends), values.max())
    high = np.zeros(len(edges.ends), values.dtype)
    np.minimum.at(low, edges.of, values)
    np.maximum.at(high, edges.of, values)
    return edges.ends[low < high]


def sag(length: float, radius: float) -> float:
    """How far a chord is from its arc; where it is longer than the circle is wide, the radius."""
    half = 0.5 * length
    return radius - np.sqrt(max(radius**2 - half**2, 0.0)) if half < radius else radius
