"""Surfaces of masks of voxels, as segmented images give them: terraced, however smooth the object was."""

from __future__ import annotations

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from .basic import Arrays

Mask = NDArray[np.bool_]

# Ways to cut off the corners of a tetrahedron if so many are inside: edges from inside to outside.
_CUTS = {
    1: [[(0, 1), (0, 2), (0, 3)]],
    2: [[(0, 2), (0, 3), (1, 3)], [(0, 2), (1, 3), (1, 2)]],
    3: [[(0, 3), (1, 3), (2, 3)]],
}


def grid(n: int) -> NDArray[np.float64]:
    """Middles of n x n x n voxels around the origin, (3, n, n, n)."""
    x = np.arange(n) - (n - 1) / 2
    return np.stack(np.meshgrid(x, x, x, indexing="ij"))


def ball(radius: float) -> Mask:
    """Mask of a ball."""
    return (grid(2 * int(radius) + 4) ** 2).sum(axis=0) < radius**2


def ball_and_block() -> Mask:
    """Mask of a ball beside a block whose faces span many voxels."""
    x, y, z = grid(36)
    block = (abs(x + 8) < 7) & (abs(y) < 9) & (abs(z) < 7)
    return np.asarray(block | ((x - 9) ** 2 + y**2 + z**2 < 7.5**2))


def level_surface(mask: Mask) -> Arrays:
    """Surface halfway between the voxels inside and outside of a mask, closed, normals outwards.

    Every cube of eight voxels is cut into six tetrahedra along its diagonal, and each of these where its
    corners differ. The mask must not reach the end of its array.
    """
    number = np.arange(mask.size).reshape(mask.shape)
    start = number[:-1, :-1, :-1].reshape(-1, 1)
    steps = np.array([number[1, 0, 0], number[0, 1, 0], number[0, 0, 1]])
    ways = [np.append(0, np.cumsum(steps[list(order)])) for order in permutations(range(3))]
    T = np.vstack([start + way for way in ways])
    inside = mask.ravel()
    T = np.take_along_axis(T, np.argsort(~inside[T], axis=1, kind="stable"), axis=1)
    count = inside[T].sum(axis=1)
    cut = [T[count == n][:, way] for n, several in _CUTS.items() for way in several]
    edges = np.sort(np.vstack(cut).reshape(-1, 2), axis=1)
    edges, F = np.unique(edges, axis=0, return_inverse=True)
    P = np.stack(np.unravel_index(np.arange(mask.size), mask.shape), axis=1).astype(float)
    V, F = P[edges].mean(axis=1), F.reshape(-1, 3)
    a, b = np.moveaxis(np.vstack(cut), -1, 0)
    out = (P[b] - P[a]).sum(axis=1)
    normals = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    back = (normals * out).sum(axis=1) < 0
    F[back] = F[back][:, ::-1]
    return V, F


def painted_sheet(n: int = 30) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Flat sheet of n x n pixels with a disc and a slanted bar painted on it; V, F, labels."""
    x, y = (k.ravel() for k in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    i = np.flatnonzero((x < n) & (y < n))
    right, up = i + n + 1, i + 1
    F = np.concatenate([np.stack([i, right, right + 1], 1), np.stack([i, right + 1, up], 1)])
    px, py = x[i] + 0.5, y[i] + 0.5
    labels = np.zeros(len(i), np.int64)
    labels[abs((py - 0.7 * n) - 0.28 * (px - 0.5 * n)) < 0.09 * n] = 2
    labels[np.hypot(px - 0.36 * n, py - 0.3 * n) < 0.22 * n] = 1
    return np.stack([x, y, 0 * x], axis=1).astype(float), F, np.tile(labels, 2)
