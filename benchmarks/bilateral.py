"""Bilateral filtering of normals, as a contender of `denoise`.

Normals are averaged over neighbouring faces, less where they differ by more than ``spread``, and vertices
follow them: Zheng, Fu, Au and Tai, "Bilateral normal filtering for mesh denoising" (2011), section 4.1,
with the vertex updates of Sun et al. (2007).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from remeshvec.mesh.edges import edge_keys, halfedge_ends

from .panels import FloatArray, IntArray


def bilateral(
    V: FloatArray, F: IntArray, spread: float, rounds: int = 10, updates: int = 20
) -> FloatArray:
    """Filter normals in ``rounds``, then move vertices in ``updates``; returns the vertices."""
    normals, areas = face_normals(V, F)
    one, two = _neighbours(F)
    centres = V[F].mean(axis=1)
    away = np.linalg.norm(centres[one] - centres[two], axis=1)
    near = np.exp(-(away**2) / (2 * away.mean() ** 2))
    for _ in range(rounds):
        alike = np.exp(-((normals[one] - normals[two]) ** 2).sum(axis=1) / (2 * spread**2))
        weight = near * alike
        entries = np.concatenate([weight * areas[two], weight * areas[one]])
        rows, columns = np.concatenate([one, two]), np.concatenate([two, one])
        mean = sp.csr_array((entries, (rows, columns)), shape=(len(F), len(F)))
        normals = mean @ normals + areas[:, None] * normals
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return _follow(V, F, normals, updates)


def face_normals(V: FloatArray, F: IntArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals and areas of faces."""
    a, b, c = (V[F[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    size = np.linalg.norm(normals, axis=1)
    return normals / np.maximum(size, 1e-300)[:, None], size / 2


def _neighbours(F: IntArray) -> tuple[IntArray, IntArray]:
    key = edge_keys(halfedge_ends(F), int(F.max()) + 1)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(key[order][1:] == key[order][:-1])
    return order[first] // 3, order[first + 1] // 3


def _follow(V: FloatArray, F: IntArray, normals: FloatArray, updates: int) -> FloatArray:
    x = V.copy()
    uses = np.maximum(np.bincount(F.ravel(), minlength=len(V)), 1)[:, None]
    for _ in range(updates):
        centres, step = x[F].mean(axis=1), np.zeros_like(x)
        for k in range(3):
            height = ((centres - x[F[:, k]]) * normals).sum(axis=1, keepdims=True)
            np.add.at(step, F[:, k], height * normals)
        x += step / uses
    return x
