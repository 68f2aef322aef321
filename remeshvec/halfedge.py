"""The half-edge mesh on flat arrays: build from faces, walk, compact, extract.

Half-edge ``h = 3 f + c`` runs from corner ``c`` of face ``f`` to the next corner. The one-ring of
``v`` is walked counter-clockwise from ``vertex_halfedge[v]`` by ``twin[previous(h)]``. For a boundary
vertex the walk starts at the outgoing half-edge without twin and ends at a missing twin, so one loop
serves both kinds; every operation keeps it so in O(1).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._jit import inlined, kernel
from ._types import CURVE, DEAD, INNER, NONE, FloatArray, IndexArray, Mesh

__all__ = ["BuildReport", "build_mesh", "ends_of", "following", "previous"]


@inlined
def following(h):
    """Return the next half-edge of the same face."""
    return h + 1 if np.uint64(h) % np.uint64(3) != np.uint64(2) else h - 2


@inlined
def previous(h):
    """Return the previous half-edge of the same face."""
    return h - 1 if np.uint64(h) % np.uint64(3) != np.uint64(0) else h + 2


def ends_of(origin: IndexArray, h: NDArray[Any]) -> IndexArray:
    """Return the vertices where half-edges start and end, (2, k), from their numbers (k,)."""
    return origin[np.stack([h, h - h % 3 + (h + 1) % 3])]


class BuildReport(NamedTuple):
    """What the build found and cut."""

    non_manifold_edges: int  # more than two faces
    inconsistent_edges: int  # two faces that run the edge in the same direction
    pinched_vertices: int  # vertices that held several fans
    doubled_faces: int  # faces that share two edges with another: same corners, opposite winding


def build_mesh(X: FloatArray, F: IndexArray) -> tuple[Mesh, BuildReport, IndexArray]:
    """Connect faces to a manifold half-edge mesh.

    Edges with more than two faces or two equally directed ones are cut open; a vertex that holds
    several fans becomes one vertex a fan.

    Parameters
    ----------
    X : (n, 4) float64
        Coordinates in the first three columns; every vertex is used by a face.
    F : (m, 3) int32
        Faces without repeated corners or duplicates.

    Returns
    -------
    mesh : Mesh
        Boundary edges are curves, all else is free.
    found : BuildReport
    source : (k,) int32
        Row of ``X`` for every vertex of the mesh.
    """
    n = len(X)
    origin = F.reshape(-1).copy()
    twin = np.empty(origin.size, np.int32)
    non_manifold, inconsistent = _match_twins(origin, twin, n)
    source = np.empty(origin.size, np.int32)
    n_fans = _split_fans(origin, twin, n, source)
    source = source[: n_fans - n]
    X = np.concatenate([X, X[source]]) if len(source) else X
    mesh = Mesh(
        origin,
        twin,
        np.full(origin.size, NONE, np.int32),
        np.arange(len(F), dtype=np.int32),
        np.full(n_fans, DEAD, np.int32),
        np.zeros(n_fans, np.int32),
        X,
        np.zeros(n_fans, np.uint8),
        np.zeros(n_fans, np.int32),
    )
    doubled = _fill_vertices(mesh)
    found = BuildReport(non_manifold, inconsistent, len(np.unique(source)), doubled)
    return mesh, found, np.concatenate([np.arange(n, dtype=np.int32), source])


@kernel
def _match_twins(origin, twin, n):
    """Pair opposite half-edges by chains of the edges seen at one end of each.

    That is the end with fewer edges: the hub of a fan of any size costs linear time in all.
    """
    uses = np.zeros(n, np.int32)
    for h in range(origin.size):
        uses[origin[h]] += 1
    chain = np.full(n, NONE, np.int32)
    after = np.empty(origin.size, np.int32)
    seen = np.empty(origin.size, np.uint8)
    non_manifold = 0
    inconsistent = 0
    for h in range(origin.size):
        v = origin[h]
        w = origin[following(h)]
        if uses[w] < uses[v] or (uses[w] == uses[v] and w < v):
            v, w = w, v
        twin[h] = NONE
        g = np.int64(chain[v])
        while g != NONE and origin[g] != w and origin[following(g)] != w:
            g = np.int64(after[g])
        if g == NONE:
            after[h] = chain[v]
            chain[v] = h
            seen[h] = 1
            continue
        seen[g] = min(seen[g] + 1, 4)
        if seen[g] == 2:
            if origin[g] != origin[h]:
                twin[h] = g
                twin[g] = h
                continue
            inconsistent += 1
        elif seen[g] == 3:
            non_manifold += 1
            if twin[g] != NONE:
                twin[twin[g]] = NONE
                twin[g] = NONE
            else:
                inconsistent -= 1
    return non_manifold, inconsistent


@kernel
def _split_fans(origin, twin, n, source):
    """Give every fan of faces around a vertex a vertex of its own; returns their number."""
    used = np.zeros(n, np.uint8)
    visited = np.zeros(origin.size, np.uint8)
    count = n
    for h in range(origin.size):
        if visited[h]:
            continue
        v = origin[h]
        # Go clockwise to the start of the fan (or once around), then label counter-clockwise.
        start = np.int64(h)
        while twin[start] != NONE:
            start = following(np.int64(twin[start]))
            if start == h:
                break
        new = v
        if used[v]:
            new = count
            source[count - n] = v
            count += 1
        used[v] = 1
        g = start
        while True:
            visited[g] = 1
            origin[g] = new
            t = np.int64(twin[previous(g)])
            if t == NONE or t == start:
                break
            g = t
    return count


@kernel
def _fill_vertices(mesh):
    """Set what follows from origins and twins; boundary edges become curves. Counts doubled faces."""
    doubled = 0
    for v in range(mesh.vertex_halfedge.size):
        mesh.valence_excess[v] = -6
        mesh.kind[v] = INNER
    for h in range(mesh.origin.size):
        v = mesh.origin[h]
        if v < 0:
            continue
        mesh.valence_excess[v] += 1
        if mesh.twin[h] == NONE:
            mesh.vertex_halfedge[v] = h
            mesh.kind[v] = CURVE
            mesh.curve[h] = h
            mesh.valence_excess[v] += 3
        else:
            if mesh.kind[v] == INNER:
                mesh.vertex_halfedge[v] = h
            if mesh.twin[h] // 3 == mesh.twin[following(h)] // 3:
                doubled += 1
    return doubled
