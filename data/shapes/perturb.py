"""Seeded changes to small meshes; all return new arrays."""

from __future__ import annotations

import numpy as np

Arrays = tuple[np.ndarray, np.ndarray]


def mean_edge(V: np.ndarray, F: np.ndarray) -> float:
    """Mean over the corners of the faces."""
    return float(np.linalg.norm(V[F] - V[F[:, [1, 2, 0]]], axis=2).mean())


def perturb(V: np.ndarray, F: np.ndarray, amount: float = 0.2, seed: int = 0) -> Arrays:
    """Move every vertex at random, by `amount` mean edges in each coordinate (one sigma)."""
    noise = np.random.default_rng(seed).normal(size=V.shape)
    return V + amount * mean_edge(V, F) * noise, F.copy()


def upsampled(
    V: np.ndarray, F: np.ndarray, n: int = 1, noise: float = 0.25, seed: int = 0
) -> Arrays:
    """Cut every face into 4^n, then move inner vertices at random in their tangent planes.

    `noise` is in mean edges of the result, the largest step in each direction.
    """
    import igl

    E = np.vstack([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    # libigl writes out of bounds where two faces run an edge the same way.
    assert len(np.unique(E, axis=0)) == len(E), "only oriented manifolds can be upsampled"
    for _ in range(n):
        V, F = igl.upsample(V, F)
    N = np.nan_to_num(igl.per_vertex_normals(V, F))
    D = np.random.default_rng(seed).uniform(-noise, noise, V.shape) * mean_edge(V, F)
    D -= (D * N).sum(axis=1, keepdims=True) * N
    D[np.unique(igl.boundary_facets(F)[0])] = 0
    return V + D, F


def rotate(V: np.ndarray, rotation=(0.3, -1.1, 0.7)) -> np.ndarray:
    """Rotate by a rotation vector (axis times angle in radians)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(rotation).apply(V)


def scale(V: np.ndarray, factor: float) -> np.ndarray:
    """Scale about the origin."""
    return V * factor


def translate(V: np.ndarray, by=(1e3, -2e3, 5e2)) -> np.ndarray:
    """Move."""
    return V + np.asarray(by, dtype=float)
