"""Keep sheets apart that only meet in vertices, before they are welded."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import FROZEN, NONE, Mesh
from ..mesh.blocks import make_blocks
from ..mesh.repair import weld_vertices
from ..operations.split import split_edges
from ..reference.build import FeaturedReference
from ..reference.non_manifold import non_manifold_vertices

__all__ = ["separate_sheets"]


def separate_sheets(mesh: Mesh, featured: FeaturedReference) -> Mesh:
    """Split inner edges that would run beside an edge of another sheet once the sheets are welded."""
    on_non_manifold = non_manifold_vertices(mesh, featured)
    target = weld_vertices(mesh.X[:, :3], on_non_manifold)
    if target is None:
        return mesh
    is_on_seam = np.zeros(len(mesh.X), np.bool_)
    is_on_seam[on_non_manifold] = True
    ends = mesh.origin, mesh.origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    h = np.flatnonzero(
        (is_on_seam[ends[0]] | is_on_seam[ends[1]]) & (mesh.twin < np.arange(len(mesh.twin)))
    )
    a, b = target[ends[0][h]].astype(np.int64), target[ends[1][h]].astype(np.int64)
    keys = np.minimum(a, b) * len(mesh.X) + np.maximum(a, b)
    _, place, count = np.unique(keys, return_inverse=True, return_counts=True)
    # What must stay is as it was in the input, whatever runs beside it.
    doubled = (count[place] > 1) & (mesh.twin[h] != NONE) & (mesh.curve[h] != FROZEN)
    if not doubled.any():
        return mesh
    return split_edges(mesh, make_blocks(mesh), h[doubled].astype(np.int32), False)
