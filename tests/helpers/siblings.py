"""Siblings, the copies of a non-manifold edge on the sheets of a mesh cut open there."""

from __future__ import annotations

import numpy as np

from helpers.structure import cut_open, ends, featured
from remeshvec.core.vocabulary import DEAD, NON_MANIFOLD, Mesh
from remeshvec.features.polyline import find_siblings
from remeshvec.reference.surface import Reference


def opened(V, F, length: float, **wanted) -> tuple[Mesh, Reference]:
    """Cut a mesh open at its non-manifold edges; returns it with its reference, see `featured`."""
    mesh, source = cut_open(V, F)
    return mesh, featured(mesh, length, vertex_source=source, **wanted).reference


def siblings_of(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Half-edges on non-manifold edges grouped by place: members, and where each group begins."""
    return find_siblings(mesh.X, mesh.origin, non_manifold_halfedges(mesh))


def non_manifold_halfedges(mesh: Mesh) -> np.ndarray:
    """Live half-edges that lie on non-manifold edges."""
    return np.flatnonzero((mesh.curve >= NON_MANIFOLD) & (mesh.origin != DEAD)).astype(np.int32)


def sheets_at_places(mesh: Mesh) -> dict[tuple, int]:
    """Count the half-edges of every non-manifold edge, by its place, and check that none is alone."""
    found: dict[tuple, int] = {}
    for h in non_manifold_halfedges(mesh).tolist():
        edge = tuple(tuple(mesh.X[v, :3].tolist()) for v in sibling_ends(mesh, h))
        found[edge] = found.get(edge, 0) + 1
    assert min(found.values(), default=2) > 1, "a sheet came off"
    return found


def sibling_ends(mesh: Mesh, h: int) -> list[int]:
    """Ends of a half-edge in the order of their places, which is the same for all its siblings."""
    return sorted(ends(mesh, h), key=lambda v: mesh.X[v, :3].tolist())
