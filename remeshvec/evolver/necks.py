"""Cut necks: closed curves of three or four edges are split, and both ends capped.

Where a neck thins, remeshing collapses the short edges around it until three are left, which the link
condition keeps from collapsing. There the surface breaks.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from ..core.arguments import number
from ..core.check import as_mask, as_mesh
from ..core.vocabulary import BoolArray, FloatArray, IntArray
from ..mesh.edges import components, edge_keys, halfedge_ends, unique_edges
from .energies import areas

__all__ = ["Cut", "cut_necks"]

Cycle = tuple[int, ...]

# A piece hangs on a neck if its area is at least this many times that of the cap. A smaller piece is the
# base of a cone, or a vertex with three faces.
_SHORTEST_PIECE = 8.0


class Cut(NamedTuple):
    """A surface after its necks were cut.

    Attributes
    ----------
    V, F : (n, 3) float64, (m, 3) int64
    source : (n,) int64
        The vertex of the input that each vertex comes from.
    n_cuts : int
    """

    V: FloatArray
    F: IntArray
    source: IntArray
    n_cuts: int


def cut_necks(V: ArrayLike, F: ArrayLike, held: ArrayLike, perimeter: float = 0.0) -> Cut:
    """Cut every neck of three edges, and those of four that are short.

    Parameters
    ----------
    V : (n, 3) float
    F : (m, 3) int
        A manifold with consistently oriented faces.
    held : (k,) int or (n,) bool
        Vertices that no cut may go through.
    perimeter : float
        Longest perimeter of a neck of four edges, in units of V.

    Returns
    -------
    Cut
        Also a manifold. Each cut adds its vertices and two caps. Without a cut, V and F may be the
        caller's own arrays.

    Raises
    ------
    MeshInputError
        V and F are not a mesh.
    OptionError
        An index is out of range, or the perimeter is negative.
    """
    vertices, faces = as_mesh(V, F)
    is_held = as_mask(held, len(vertices), "held", "vertex")
    longest = number(perimeter, "perimeter", low=0.0, unit="units of V")
    source = np.arange(len(vertices))
    count = 0
    # One at a time: cuts may share edges, and each changes the cycles of the others. Cuts are rare.
    while (cycle := _next_cycle(vertices, faces, is_held[source], longest)) is not None:
        vertices, faces, source = _split(vertices, faces, source, cycle)
        count += 1
    return Cut(vertices, faces, source, count)


def _next_cycle(V: FloatArray, F: IntArray, held: BoolArray, perimeter: float) -> Cycle | None:
    """Return the shortest cycle that is a neck."""
    sizes = []
    for cycle in _cycles(F, held, len(V), 4 if perimeter > 0.0 else 3):
        P = V[list(cycle)]
        size = float(np.linalg.norm(P - np.roll(P, 1, axis=0), axis=1).sum())
        if len(cycle) == 3 or size <= perimeter:
            sizes.append((size, cycle))
    return next((cycle for _, cycle in sorted(sizes) if _is_neck(V, F, cycle)), None)


def _cycles(F: IntArray, held: BoolArray, n: int, longest: int) -> list[Cycle]:
    """Cycles of three edges that are not a face, and of four without a diagonal."""
    edges = unique_edges(F)
    edges = edges[~held[edges].any(axis=1)]
    both = np.concatenate([edges, edges[:, ::-1]])
    near = sp.csr_array((np.ones(len(both), np.int64), (both[:, 0], both[:, 1])), (n, n))
    # The ends of an edge have one common neighbour per face of the edge; each further one closes a
    # cycle of three.
    paths = sp.triu(near @ near, 1).tocoo()
    is_edge = np.isin(paths.row * n + paths.col, edge_keys(edges.T, n))
    closed = is_edge & (paths.data > 2)
    crossed = ~is_edge & (paths.data > 1) & (longest > 3)
    around: dict[int, set[int]] = {}
    for a, b in both.tolist():
        around.setdefault(a, set()).add(b)
    faces = {tuple(face) for face in np.sort(F, axis=1).tolist()} if closed.any() else set()
    cycles: dict[Cycle, Cycle] = {}
    for a, c in zip(paths.row[closed].tolist(), paths.col[closed].tolist(), strict=True):
        for b in around[a] & around[c]:
            key = tuple(sorted((a, b, c)))
            if key not in faces:
                cycles[key] = key
    for a, c in zip(paths.row[crossed].tolist(), paths.col[crossed].tolist(), strict=True):
        between = around[a] & around[c]
        for b in between:
            for d in between - around[b]:
                if b < d:
                    cycles[tuple(sorted((a, b, c, d)))] = (a, b, c, d)
    return list(cycles.values())


def _is_neck(V: FloatArray, F: IntArray, cycle: Cycle) -> bool:
    """Tell whether a large piece hangs on each side, or one on both (a handle)."""
    side = _side(F, cycle)
    if side is None:
        return False
    area = areas(V[F])
    cap = float(areas(V[_fan(cycle)]).sum())
    for seeds in (side, _side(F, cycle[::-1])):
        if seeds is None:
            return False
        reached = _reached(F, seeds, cycle)
        if area[reached].sum() < _SHORTEST_PIECE * cap or reached.sum() < 8:
            return False
    return True


def _reached(F: IntArray, seeds: IntArray, cycle: Cycle) -> BoolArray:
    """Faces that are connected to the seeds across edges that are not on the cycle."""
    ends = halfedge_ends(F)
    start, end = ends
    key = edge_keys(ends, F.max() + 1)
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    on_cycle = np.isin(start, cycle) & np.isin(end, cycle)
    g, h = order[:-1][same], order[1:][same]
    crossing = ~on_cycle[g]
    _, part = components(len(F), g[crossing] // 3, h[crossing] // 3)
    return np.isin(part, part[seeds])


def _side(F: IntArray, cycle: Cycle) -> IntArray | None:
    """Faces around the vertices of a cycle that lie on its left; None if it has no sides.

    At each vertex they are the fan between the outgoing and the incoming edge of the cycle.
    """
    after = {}
    for corner in range(3):
        a, b, c = F[:, corner], F[:, (corner + 1) % 3], F[:, (corner + 2) % 3]
        for v in cycle:
            for f in np.flatnonzero(a == v).tolist():
                after[v, int(b[f])] = (f, int(c[f]))
    faces = []
    for i, v in enumerate(cycle):
        came, goes = cycle[i - 1], cycle[(i + 1) % len(cycle)]
        # Counterclockwise around v, from the outgoing to the incoming edge.
        w, steps = goes, 0
        while w != came:
            if (v, w) not in after or steps > len(after):
                return None  # a boundary lies between
            f, w = after[v, w]
            faces.append(f)
            steps += 1
    return np.unique(faces)


def _split(
    V: FloatArray, F: IntArray, source: IntArray, cycle: Cycle
) -> tuple[FloatArray, IntArray, IntArray]:
    """Give the faces on the left of a cycle their own copies of its vertices, and cap both sides."""
    side, ring = _side(F, cycle), list(cycle)
    copies = len(V) + np.arange(len(ring))
    new = np.arange(len(V))
    new[ring] = copies
    F = F.copy()
    F[side] = new[F[side]]
    # Half-edges of the faces on the left run along the cycle, so those of their cap run against it.
    caps = [_fan(tuple(copies.tolist()[::-1])), _fan(cycle)]
    return np.concatenate([V, V[ring]]), np.concatenate([F, *caps]), np.append(source, source[ring])


def _fan(cycle: Cycle) -> IntArray:
    """Fan of triangles that fills a cycle, from its first vertex."""
    return np.array([(cycle[0], b, c) for b, c in pairwise(cycle[1:])])
