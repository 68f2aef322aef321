"""Polygons as triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["fan_triangles"]


def fan_triangles(
    corners: NDArray[Any], sizes: NDArray[Any]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cut polygons into fans of triangles from their first corners, which suits convex ones.

    Parameters
    ----------
    corners : (k,) int
        Vertices of all polygons, one polygon after the other.
    sizes : (m,) int
        Number of corners per polygon; one with fewer than three gives no triangle.

    Returns
    -------
    F : (t, 3) int64
        Triangles, in the order of the polygons.
    polygon : (t,) int64
        The polygon that each triangle is part of.
    """
    count = np.maximum(sizes - 2, 0)
    polygon = np.repeat(np.arange(len(sizes)), count)
    if (sizes == 3).all():
        return corners.reshape(-1, 3).astype(np.int64, copy=False), polygon
    first = (np.cumsum(sizes) - sizes)[polygon]
    step = np.arange(len(polygon)) - (np.cumsum(count) - count)[polygon]
    F = np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=1)
    return F.astype(np.int64, copy=False), polygon
