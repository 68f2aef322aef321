"""Repairs are taken where they help: the better of two versions of every connected region."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import FloatArray, IntArray
from ..mesh.edges import components
from .geometry import smallest_angle_cosines
from .scratch import Arrays

__all__ = ["better_regions"]


def better_regions(old: Arrays, new: Arrays, X: FloatArray) -> Arrays:
    """Return the new faces of a part, but the old ones of regions whose worst angle would fall.

    Parameters
    ----------
    old, new : dict
        Two results of `changed_faces` for the same piece. Their regions have the same rims.
    X : (n, 4) float64
        Vertices of the whole mesh, for those of the rims.
    """
    parts = old, new
    rims = [_rims(part["F"]) for part in parts]
    worst = [_worst(part, rim, X) for part, rim in zip(parts, rims, strict=True)]
    keys, was, is_now = _at_same_rims(*worst)
    falls = keys[is_now > was]  # a larger cosine is a smaller angle
    if not len(falls):
        return new
    kept = np.isin(rims[0], falls), ~np.isin(rims[1], falls)
    F = [part["F"][rows] for part, rows in zip(parts, kept, strict=True)]
    F[1] = np.where(F[1] < 0, F[1], F[1] + len(old["X"]))
    joined = {
        name: np.concatenate([part[name][rows] for part, rows in zip(parts, kept, strict=True)])
        for name in ("curve", "source")
    }
    of_vertices = {name: np.concatenate([old[name], new[name]]) for name in ("X", "kind", "birth")}
    return {"F": np.concatenate(F), **joined, **of_vertices}


def _rims(F: IntArray) -> IntArray:
    """Name the region of every face by its smallest number, which is that of a vertex on its rim.

    Regions without a rim get the same number, 0: whole components of the surface.
    """
    numbers, corners = np.unique(F, return_inverse=True)
    corners = corners.reshape(-1, 3)
    n, label = components(len(numbers), corners[:, [0, 1]].ravel(), corners[:, [1, 2]].ravel())
    smallest = np.zeros(n, np.int64)
    np.minimum.at(smallest, label, numbers)
    return smallest[label[corners[:, 0]]]


def _worst(part: Arrays, rims: IntArray, X: FloatArray) -> tuple[IntArray, FloatArray]:
    """Regions, in ascending order, and the cosine of the smallest angle in each."""
    F = part["F"]
    points = np.empty((len(F), 3, 3))
    known = F < 0
    points[known] = X[-1 - F[known], :3]
    points[~known] = part["X"][F[~known], :3]
    cosines = smallest_angle_cosines(points)
    regions, place = np.unique(rims, return_inverse=True)
    worst = np.full(len(regions), -1.0)
    np.maximum.at(worst, place.reshape(-1), cosines)
    return regions, worst


def _at_same_rims(
    old: tuple[IntArray, FloatArray], new: tuple[IntArray, FloatArray]
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Regions that both versions have, with rims, and what is known of each."""
    regions = np.intersect1d(old[0], new[0])
    regions = regions[regions < 0]
    return (
        regions,
        old[1][np.searchsorted(old[0], regions)],
        new[1][np.searchsorted(new[0], regions)],
    )
