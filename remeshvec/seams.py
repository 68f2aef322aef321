"""Seams: where sheets of the surface meet, cut open for the sweeps, and welded at the end."""

from __future__ import annotations

import numpy as np

from ._types import DEAD, NONE, SEAM, IndexArray, Mesh
from .clean import weld_vertices
from .edge_sets import make_blocks
from .halfedge import ends_of
from .operations.split import split_edges
from .polyline import find_siblings
from .reference import Built

__all__ = ["copies_on_seams", "find_seams", "seam_vertices", "separate_sheets"]


def find_seams(mesh: Mesh) -> tuple[IndexArray, IndexArray]:
    """Half-edges on seams that may change, by groups of siblings."""
    h = np.flatnonzero((mesh.curve >= SEAM) & (mesh.origin != DEAD)).astype(np.int32)
    return find_siblings(mesh.X, mesh.origin, h)


def seam_vertices(mesh: Mesh, built: Built) -> IndexArray:
    """Vertices where sheets meet, those of all sheets."""
    if built.on_seam is None:
        return np.empty(0, np.int32)
    h = np.flatnonzero((mesh.twin == NONE) & (mesh.origin != DEAD))
    ends = np.unique(ends_of(mesh.origin, h))
    return ends[built.on_seam[built.reference.origin[mesh.birth[ends]]]]


def copies_on_seams(mesh: Mesh, built: Built) -> tuple[IndexArray, IndexArray] | None:
    """Vertices on seams and a number for the place of each, the same on all sheets; None for none."""
    if built.on_seam is None:
        return None
    v = seam_vertices(mesh, built)
    if not len(v):
        return None
    _, place = np.unique(mesh.X[v, :3] + 0.0, axis=0, return_inverse=True)
    return v, place.reshape(-1).astype(np.int32)


def separate_sheets(mesh: Mesh, built: Built) -> Mesh:
    """Split inner edges that would run beside an edge of another sheet once the sheets are welded."""
    on_seam = seam_vertices(mesh, built)
    target = weld_vertices(mesh.X[:, :3], on_seam)
    if target is None:
        return mesh
    is_on_seam = np.zeros(len(mesh.X), np.bool_)
    is_on_seam[on_seam] = True
    ends = mesh.origin, mesh.origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    h = np.flatnonzero(
        (is_on_seam[ends[0]] | is_on_seam[ends[1]]) & (mesh.twin < np.arange(len(mesh.twin)))
    )
    a, b = target[ends[0][h]].astype(np.int64), target[ends[1][h]].astype(np.int64)
    keys = np.minimum(a, b) * len(mesh.X) + np.maximum(a, b)
    _, place, count = np.unique(keys, return_inverse=True, return_counts=True)
    doubled = (count[place] > 1) & (mesh.twin[h] != NONE)
    if not doubled.any():
        return mesh
    return split_edges(mesh, make_blocks(mesh), h[doubled].astype(np.int32), False)
