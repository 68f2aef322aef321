"""Seams: where sheets of the surface meet, cut open for the sweeps, and welded at the end."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import DEAD, NON_MANIFOLD, NONE, IndexArray, Mesh
from ..features.polyline import find_siblings
from ..mesh.walk import ends_of
from .build import FeaturedReference

__all__ = [
    "find_non_manifold_edges",
    "non_manifold_copies",
    "non_manifold_vertices",
]


def find_non_manifold_edges(mesh: Mesh) -> tuple[IndexArray, IndexArray]:
    """Half-edges on seams that may change, by groups of siblings."""
    h = np.flatnonzero((mesh.curve >= NON_MANIFOLD) & (mesh.origin != DEAD)).astype(np.int32)
    return find_siblings(mesh.X, mesh.origin, h)


def non_manifold_vertices(mesh: Mesh, featured: FeaturedReference) -> IndexArray:
    """All copies of the vertices where sheets meet."""
    if featured.on_non_manifold is None:
        return np.empty(0, np.int32)
    h = np.flatnonzero((mesh.twin == NONE) & (mesh.origin != DEAD))
    ends = np.unique(ends_of(mesh.origin, h))
    return ends[featured.on_non_manifold[featured.reference.origin[mesh.birth[ends]]]]


def non_manifold_copies(
    mesh: Mesh, featured: FeaturedReference
) -> tuple[IndexArray, IndexArray] | None:
    """Vertices on seams, and a number per place that is the same on all sheets; None without seams."""
    if featured.on_non_manifold is None:
        return None
    v = non_manifold_vertices(mesh, featured)
    if not len(v):
        return None
    _, place = np.unique(mesh.X[v, :3] + 0.0, axis=0, return_inverse=True)
    return v, place.reshape(-1).astype(np.int32)
