"""Vertices and polygons, which every parser returns, and their checks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.vocabulary import FloatArray, IntArray
from ..mesh.polygons import fan_triangles

__all__ = ["PolygonMesh", "Triangles", "check_polygons", "triangulated"]


class PolygonMesh(NamedTuple):
    """Vertices and polygons of a file.

    Parameters
    ----------
    V : (n, 3) float64
    corners : (k,) int64
        Vertices of all polygons, polygon after polygon, 0-based.
    sizes : (m,) int64
        Number of corners per polygon.
    notices : list of str
        Changes that the reader made.
    """

    V: FloatArray
    corners: IntArray
    sizes: IntArray
    notices: list[str]


class Triangles(NamedTuple):
    """Polygons cut into triangles.

    Parameters
    ----------
    F : (t, 3) int64
    polygon : (t,) int64
        The polygon that each triangle is part of.
    notices : list of str
    """

    F: IntArray
    polygon: IntArray
    notices: list[str]


def check_polygons(mesh: PolygonMesh) -> None:
    """Refuse arrays that are not a mesh.

    Raises
    ------
    ValueError
        There are no faces or no vertices, a coordinate is not finite, or a face has fewer than three
        corners or names a vertex that does not exist.
    """
    V, corners, sizes, _ = mesh
    if len(sizes) == 0:
        raise ValueError("it has no faces")
    if len(V) == 0:
        raise ValueError("it has no vertices")
    if not np.isfinite(V).all():
        bad = int(np.flatnonzero(~np.isfinite(V).all(axis=1))[0])
        raise ValueError(f"vertex {bad} (counted from 0) is not finite")
    if sizes.min() < 3:
        raise ValueError(f"face {sizes.argmin()} (counted from 0) has fewer than 3 corners")
    if corners.min() < 0 or corners.max() >= len(V):
        wrong = int(np.flatnonzero((corners < 0) | (corners >= len(V)))[0])
        bad = int(np.searchsorted(np.cumsum(sizes), wrong, side="right"))
        raise ValueError(
            f"face {bad} (counted from 0) names a vertex outside the {len(V):,} there are"
        )


def triangulated(mesh: PolygonMesh) -> Triangles:
    """Cut the polygons of a checked mesh into triangles, with a notice if there are any."""
    F, polygon = fan_triangles(mesh.corners, mesh.sizes)
    notices = list(mesh.notices)
    if len(F) > len(mesh.sizes):
        notices.append(f"polygons were cut: {len(mesh.sizes):,} faces became {len(F):,} triangles")
    return Triangles(F, polygon, notices)
