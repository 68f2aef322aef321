"""Build the half-edge mesh on flat arrays from faces.

Half-edge ``h = 3 f + c`` runs from corner ``c`` of face ``f`` to the next corner. The one-ring of
``v`` is walked counter-clockwise from ``vertex_halfedge[v]`` with `next_spoke`. At a boundary vertex the
walk starts at the outgoing half-edge without twin and ends at a missing twin, so one loop serves both
kinds of vertices. Every operation keeps this invariant in O(1).
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import kernel
from ..core.vocabulary import CURVE, INNER, NONE, FloatArray, IndexArray, Mesh
from .twins import PINCHED, Defects, match_halfedges
from .walk import next_halfedge, next_spoke

__all__ = ["build_mesh"]


def build_mesh(
    X: FloatArray, F: IndexArray, parallel: bool = False, owned: bool = False
) -> tuple[Mesh, Defects, IndexArray]:
    """Connect faces to a manifold half-edge mesh.

    Edges with more than two faces, or with two that run them in the same direction, are cut open. A
    vertex that holds several fans becomes one vertex per fan.

    Parameters
    ----------
    X : (n, 4) float64
        Coordinates in the first three columns; every vertex is used by a face.
    F : (m, 3) int32
        Faces without repeated corners or duplicates.
    parallel : bool
        Let threads share the work; the result is the same.
    owned : bool
        Whether the mesh may keep ``F``, and change it.

    Returns
    -------
    mesh : Mesh
        Boundary edges are curves; all other edges are free.
    found : Defects
    source : (k,) int32
        Row of ``X`` for every vertex of the mesh.
    """
    n = len(X)
    origin = F.reshape(-1) if owned else F.reshape(-1).copy()
    matched = match_halfedges(origin, n, parallel)
    mesh = Mesh(
        origin,
        matched.twin,
        matched.curve,
        np.arange(len(F), dtype=np.int32),
        matched.vertex_halfedge,
        matched.valence_excess,
        X,
        matched.kind,
        np.zeros(n, np.int32),
    )
    found = matched.found
    source = np.arange(n, dtype=np.int32)
    if found.pinched_vertices:
        mesh, copies, doubled = _split_pinched(mesh)
        source = np.concatenate([source, copies])
        found = found._replace(doubled_faces=found.doubled_faces + doubled)
    return mesh, found, source


def _split_pinched(mesh: Mesh) -> tuple[Mesh, IndexArray, int]:
    """Give every fan at a pinched vertex a vertex of its own.

    Returns the mesh, the vertices that the new ones are copies of, and the number of corners in fans of
    two faces.
    """
    n = len(mesh.kind)
    corners = np.flatnonzero((mesh.kind == PINCHED)[mesh.origin])
    source = np.empty(len(corners), np.int32)
    roomy = mesh._replace(
        vertex_halfedge=np.concatenate([mesh.vertex_halfedge, source]),
        valence_excess=np.concatenate([mesh.valence_excess, source]),
        kind=np.concatenate([mesh.kind, np.zeros(len(corners), np.uint8)]),
    )
    visited = np.zeros(mesh.origin.size, np.bool_)
    count, doubled = _split_fans(roomy, n, corners, visited, source)
    source = source[: count - n]
    split = mesh._replace(
        vertex_halfedge=roomy.vertex_halfedge[:count],
        valence_excess=roomy.valence_excess[:count],
        X=np.concatenate([mesh.X, mesh.X[source]]),
        kind=roomy.kind[:count],
        birth=np.zeros(count, np.int32),
    )
    return split, source, int(doubled)


@kernel
def _split_fans(mesh, n, corners, visited, source):
    """Give numbers to all fans, in the order of ``corners``; the first fan of a vertex keeps its number.

    ``mesh`` has room for new vertices behind the first ``n``.
    """
    origin, twin, kind = mesh.origin, mesh.twin, mesh.kind
    count = n
    doubled = 0
    for h in corners:
        if visited[h]:
            continue
        v = np.int64(origin[h])
        # Go clockwise to the start of the fan (or once around), then label counter-clockwise.
        start = np.int64(h)
        while twin[start] != NONE:
            start = next_halfedge(np.int64(twin[start]))
            if start == h:
                break
        new = v
        if kind[v] != PINCHED:
            new = count
            source[count - n] = v
            count += 1
        size, last = 0, start
        g = start
        while True:
            visited[g] = True
            origin[g] = new
            size += 1
            last = max(last, g)
            g = next_spoke(twin, g)
            if g == NONE or g == start:
                break
        is_open = twin[start] == NONE
        mesh.vertex_halfedge[new] = start if is_open else last
        mesh.valence_excess[new] = size - (3 if is_open else 6)
        kind[new] = CURVE if is_open else INNER
        doubled += 2 * (size == 2 and not is_open)
    return count, doubled
