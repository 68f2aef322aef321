"""Hold parts of a mesh for a while: their vertices stay in place, their edges stay as they are."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import (
    CURVE,
    DEAD,
    HALTED,
    HELD,
    INNER,
    NONE,
    PINNED,
    BoolArray,
    IndexArray,
    Mesh,
)

__all__ = ["hold", "let_go", "rings_around"]


def rings_around(mesh: Mesh, vertices: IndexArray, rings: int) -> BoolArray:
    """Mark vertices and so many rings of faces around them, on all sheets that meet there."""
    is_marked = np.zeros(len(mesh.X), np.bool_)
    is_marked[vertices] = True
    F = mesh.origin.reshape(-1, 3)
    F = F[F[:, 0] != DEAD]
    for _ in range(rings):
        is_marked[F[is_marked[F].any(axis=1)]] = True
    _agree_across_sheets(mesh, is_marked)
    return is_marked


def hold(mesh: Mesh, is_held: BoolArray) -> BoolArray:
    """Hold vertices that may move, and the edges between any that are held; returns which are new."""
    inner, on_curve = is_held & (mesh.kind == INNER), is_held & (mesh.kind == CURVE)
    mesh.kind[inner], mesh.kind[on_curve] = HELD, PINNED
    at = is_held[mesh.origin] & (mesh.origin != DEAD)
    ends = at & at.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    mesh.curve[ends & (mesh.curve == NONE)] = HALTED
    return np.asarray(inner | on_curve)


def let_go(mesh: Mesh, held: BoolArray) -> None:
    """Let go of vertices that `hold` named, as far as the mesh still has them, and of all edges."""
    mesh.kind[held & (mesh.kind == HELD)] = INNER
    mesh.kind[held & (mesh.kind == PINNED)] = CURVE
    mesh.curve[mesh.curve == HALTED] = NONE


def _agree_across_sheets(mesh: Mesh, is_marked: BoolArray) -> None:
    """Mark all vertices that lie where a marked one lies on a boundary: sheets may share it."""
    h = np.flatnonzero((mesh.twin == NONE) & (mesh.origin != DEAD))
    border = np.unique(mesh.origin[h])
    if len(border):
        _, place = np.unique(mesh.X[border, :3], axis=0, return_inverse=True)
        marked = np.zeros(len(border), np.bool_)
        marked[place.reshape(-1)[is_marked[border]]] = True
        is_marked[border] = marked[place.reshape(-1)]
