"""Raw surfaces, as scanners and segmented images give them: noise, islands, handles and holes.

Fields are sampled on a grid of voxels and cut by marching cubes. Needs NumPy, SciPy and libigl.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import igl
import numpy as np
from numpy.typing import NDArray

from .basic import Arrays
from .sculpted import creature_field

Floats = NDArray[np.float64]

LOW, HIGH = np.array([-1.75, -0.6, -0.25]), np.array([1.4, 0.75, 1.95])  # around the creature
COARSE = 0.045  # spacing at which the creature is computed; between, it is interpolated


class Dirt(NamedTuple):
    """How much of what a scan has."""

    islands: int
    handles: int
    holes: int
    noise: float  # standard deviation of the surface, in voxels


ACCEPTANCE = Dirt(islands=1500, handles=40, holes=60, noise=0.4)


def scan(voxel: float = 0.0113, dirt: Dirt = ACCEPTANCE, seed: int = 0) -> Arrays:
    """Noisy scan of the creature; V and F of 300,000 faces by default."""
    rng = np.random.default_rng(seed)
    field = creature_on_grid(voxel)
    clean = field.copy()
    field += _smooth_noise(field.shape, dirt.noise, rng)
    for centre in _places(np.abs(clean) < 0.5, dirt.handles, rng):
        _add_ring(field, clean, centre)
    for centre in _places(clean > 6.0, dirt.islands, rng):
        _add_ball(field, centre, rng.uniform(1.0, 2.2))
    V, F = marching_cubes(field)
    return LOW + voxel * V, _with_holes(V, F, clean, dirt.holes, rng)


def mask_surface(voxel: float = 0.04) -> Arrays:
    """Surface of the creature as a mask of voxels: terraces, V and F."""
    V, F = marching_cubes(np.where(creature_on_grid(voxel) < 0.0, -1.0, 1.0))
    return LOW + voxel * V, F


def creature_on_grid(voxel: float) -> Floats:
    """Distance to the creature on a grid, in voxels, negative inside."""
    from scipy.ndimage import map_coordinates

    fine = np.meshgrid(*((axis - axis[0]) / COARSE for axis in _axes(voxel)), indexing="ij")
    return np.asarray(map_coordinates(_coarse_field(), fine, order=3, mode="nearest")) / voxel


@cache
def _coarse_field() -> Floats:
    axes = _axes(COARSE)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return creature_field(points).reshape([len(axis) for axis in axes])


def marching_cubes(field: Floats) -> Arrays:
    """Cut a field at 0, with normals towards positive values; in voxels."""
    shape = field.shape
    grid = np.stack(np.meshgrid(*map(np.arange, shape[::-1]), indexing="ij"), axis=-1)
    points = grid.reshape(-1, 3)[:, ::-1].astype(float)  # the first axis runs fastest
    values = field.transpose(2, 1, 0).ravel()
    V, F, _ = igl.marching_cubes(values, np.ascontiguousarray(points), *shape, 0.0)
    a, b, c = (V[F[:, k]] for k in range(3))
    inside_out = np.einsum("fi,fi->", a, np.cross(b, c)) < 0.0
    return V, np.asarray(F[:, ::-1] if inside_out else F, np.int64)


def _axes(spacing: float) -> list[Floats]:
    return [np.arange(a, b + spacing, spacing) for a, b in zip(LOW, HIGH, strict=True)]


def _smooth_noise(shape: tuple[int, ...], size: float, rng: np.random.Generator) -> Floats:
    from scipy.ndimage import gaussian_filter

    noise = gaussian_filter(rng.normal(size=shape), 0.7)
    return size * noise / noise.std()


def _places(mask: NDArray[np.bool_], count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Random voxels of a mask, away from the ends of the grid, (count, 3)."""
    inner = np.zeros_like(mask)
    inner[6:-6, 6:-6, 6:-6] = mask[6:-6, 6:-6, 6:-6]
    found = np.argwhere(inner)
    return found[rng.choice(len(found), count, replace=False)]


def _around(centre: NDArray[np.intp], reach: int) -> tuple[tuple[slice, ...], Floats]:
    """Slices of a cube around a voxel, and the steps (3, ...) from the voxel to those in it."""
    step = np.arange(-reach, reach + 1.0)
    cube = tuple(slice(int(c) - reach, int(c) + reach + 1) for c in centre)
    return cube, np.stack(np.meshgrid(step, step, step, indexing="ij"))


def _add_ball(field: Floats, centre: NDArray[np.intp], radius: float) -> None:
    cube, step = _around(centre, 4)
    field[cube] = np.minimum(field[cube], np.linalg.norm(step, axis=0) - radius)


def _add_ring(field: Floats, clean: Floats, centre: NDArray[np.intp]) -> None:
    """Add a ring that stands half out of the surface: a handle."""
    cube, step = _around(centre, 6)
    normal = np.array([np.gradient(clean[cube])[k][6, 6, 6] for k in range(3)])
    normal /= np.linalg.norm(normal)
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= np.linalg.norm(across)
    height = np.tensordot(across, step, 1)
    away = np.sqrt(np.maximum((step**2).sum(axis=0) - height**2, 0.0))
    field[cube] = np.minimum(field[cube], np.hypot(away - 3.6, height) - 1.3)


def _with_holes(
    V: Floats, F: NDArray[np.int64], clean: Floats, count: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Remove the faces within 2 to 6 voxels of random places on the surface."""
    from scipy.spatial import cKDTree

    tree = cKDTree(V[F].mean(axis=1))
    places = _places(np.abs(clean) < 0.5, count, rng)
    lost = np.zeros(len(F), np.bool_)
    for rows in tree.query_ball_point(places, rng.uniform(2.0, 6.0, count)):
        lost[rows] = True
    return F[~lost]
