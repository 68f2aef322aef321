"""Dirt in the input: faces and vertices that a manifold mesh cannot have, found and handled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._types import FloatArray

__all__ = ["drop_degenerate_faces", "drop_duplicate_faces", "weld_vertices"]

Faces = NDArray[np.int32]
Indices = NDArray[np.intp]


def drop_degenerate_faces(F: Faces) -> Indices | None:
    """Return the faces with three different corners; None where all have them."""
    bad = (F[:, 0] == F[:, 1]) | (F[:, 1] == F[:, 2]) | (F[:, 2] == F[:, 0])
    return np.flatnonzero(~bad) if bad.any() else None


def drop_duplicate_faces(F: Faces) -> Indices | None:
    """Return the first of all faces with the same corners in any order; None where all differ."""
    _, first = np.unique(np.sort(F, axis=1), axis=0, return_index=True)
    return np.sort(first) if len(first) < len(F) else None


def weld_vertices(V: FloatArray, candidates: NDArray[Any]) -> NDArray[np.int32] | None:
    """Map candidates with the same coordinates to one of them; None where all differ.

    Returns
    -------
    (n,) int32
        New index of every vertex.
    """
    order = candidates[np.lexsort(V[candidates].T)]
    is_new = np.ones(len(order), np.bool_)
    is_new[1:] = (V[order[1:]] != V[order[:-1]]).any(axis=1)
    if is_new.all():
        return None
    target = np.arange(len(V), dtype=np.int32)
    target[order] = order[is_new][np.cumsum(is_new) - 1]
    return target
