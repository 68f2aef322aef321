"""Edges of the prepared mesh in terms of the caller's vertices."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import NONE, IndexArray, IntArray
from ..input.constraints import corners_at
from ..input.prepare import Prepared
from ..mesh.edges import edge_keys
from ..mesh.walk import ends_of

__all__ = ["InputNumbers", "feature_edges", "input_numbers", "vertices_of_edges"]


class InputNumbers(NamedTuple):
    """Which vertices and faces of the input those of the prepared mesh are."""

    vertex: IndexArray  # (n,)
    face: NDArray[Any] | None  # (m,) as the next two None where no vertices were welded
    representative: IndexArray | None  # (n_in,)
    F: NDArray[Any] | None  # (m_in, 3)


def input_numbers(prepared: Prepared, F: NDArray[Any]) -> InputNumbers:
    """Take from a prepared mesh, and the input's faces, what the numbers need."""
    if prepared.representative is None:
        return InputNumbers(prepared.vertex_source, None, None, None)
    return InputNumbers(
        prepared.vertex_source, prepared.face_source, prepared.representative, F.astype(np.int32)
    )


def feature_edges(
    origin: IndexArray, halfedges: IndexArray, names: IndexArray, numbers: InputNumbers
) -> IntArray:
    """Return the ends of features, one half-edge for each name; see `vertices_of_edges`."""
    one_of_each = np.unique(names, return_index=True)[1]
    return vertices_of_edges(origin, halfedges[one_of_each], numbers)


def vertices_of_edges(
    origin: IndexArray, halfedges: NDArray[Any], numbers: InputNumbers
) -> IntArray:
    """Return the ends of half-edges as vertices of the input.

    Where vertices of the input were welded, its faces know several numbers for one place: those of the
    face from which the half-edge comes are taken, so that the pair is an edge of the input.

    Parameters
    ----------
    origin : (3 m,) int32
        Of the prepared mesh.
    halfedges : (k,) int
    numbers : InputNumbers

    Returns
    -------
    (j, 2) int64
        Sorted pairs in ascending order, each once.
    """
    ends = numbers.vertex[ends_of(origin, halfedges)].astype(np.int64)
    if numbers.F is not None and numbers.face is not None:
        face = numbers.face[halfedges // 3]
        for row in ends:
            corner = corners_at(numbers.F, face, row, numbers.representative)
            row[:] = np.where(corner == NONE, row, numbers.F.ravel()[corner])
    pairs = np.sort(ends, axis=0)
    keys = edge_keys(pairs, 1 + int(pairs.max(initial=0)))
    return np.ascontiguousarray(pairs[:, np.unique(keys, return_index=True)[1]].T)
