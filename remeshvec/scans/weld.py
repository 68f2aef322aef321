"""Boundary vertices that lie in one place, or close to each other, become one."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import FloatArray, IntArray
from ..mesh.edges import components, halfedge_ends
from ..mesh.repair import weld_vertices
from ..mesh.singles import single_halfedges

__all__ = ["weld_boundary"]


def weld_boundary(V: FloatArray, F: IntArray, reach: float) -> IntArray:
    """Return for every vertex (n,) the first of those of the boundary that are joined with it.

    Vertices within ``reach`` are joined, and so are those of a chain of such steps. Grids, as in
    ``remove_duplicate_vertices`` of libigl, miss pairs on both sides of a line of the grid.
    """
    rim = np.unique(halfedge_ends(F)[:, single_halfedges(F, len(V))])
    target = np.arange(len(V))
    if not len(rim):
        return target
    if reach == 0.0:
        found = weld_vertices(V, rim)
        return target if found is None else found.astype(np.int64)
    from scipy.spatial import cKDTree

    pairs = cKDTree(V[rim]).query_pairs(reach, output_type="ndarray")
    _, label = components(len(rim), *pairs.T)
    first = np.unique(label, return_index=True)[1]
    target[rim] = rim[first[label]]
    return target
