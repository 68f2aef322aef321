"""Measures of faces that rounds decide on."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import FloatArray

__all__ = ["smallest_angle_cosines"]


def smallest_angle_cosines(corners: FloatArray) -> FloatArray:
    """Cosines of the smallest angles of triangles (m, 3, 3), which lie opposite the shortest sides.

    1 where a triangle has no area because two corners are one.
    """
    sides = np.sort(np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2), axis=1)
    a, b, c = sides.T
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num((b * b + c * c - a * a) / (2.0 * b * c), nan=1.0)
