"""Topology in NumPy, for edges with any number of faces: fans, patches, junctions.

`shape` gives what `structure.shape_of` gives, about fifty times faster; the two are compared on the
zoo.  A patch is a set of faces joined through edges of two faces, a fan the same around a vertex, a
junction a vertex where curves of edges meet or end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


class Edges(NamedTuple):
    """Undirected edges of a mesh: their ends, how many faces each has, and each half-edge's edge."""

    ends: np.ndarray  # (k, 2) smaller index first
    faces: np.ndarray  # (k,)
    of: np.ndarray  # (3 m,) half-edge 3 f + c runs from corner c to the next


class Curves(NamedTuple):
    """A graph of edges: junction vertices, and the curves between them."""

    junctions: np.ndarray  # vertices where not exactly two edges of one kind meet
    curves: list[tuple[int, ...]]  # (kind, junction, junction), or (kind,) for a closed one; sorted


def edges_of(F) -> Edges:
    """Return the edges of the faces."""
    F = np.asarray(F, dtype=np.int64)
    both = np.sort(np.stack([F, np.roll(F, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    size = int(F.max()) + 1
    keys, of, count = np.unique(both @ [size, 1], return_inverse=True, return_counts=True)
    return Edges(np.stack([keys // size, keys % size], axis=1), count, of.reshape(-1))


def edges_with(F, faces: int) -> np.ndarray:
    """Edges that have so many faces (1: the boundary), (k, 2)."""
    edges = edges_of(F)
    return edges.ends[edges.faces == faces]


def junction_edges(F) -> np.ndarray:
    """Edges of three faces or more, (k, 2)."""
    edges = edges_of(F)
    return edges.ends[edges.faces > 2]


def opposite_pairs(F) -> tuple[np.ndarray, np.ndarray]:
    """The two half-edges of every edge of two faces."""
    edges = edges_of(F)
    order = np.argsort(edges.of, kind="stable")
    start = np.cumsum(edges.faces) - edges.faces
    first = start[edges.faces == 2]
    return order[first], order[first + 1]


def grouped(n: int, a, b) -> tuple[int, np.ndarray]:
    """Connected components of n nodes joined by links a-b: their number, and that of every node."""
    a, b = np.asarray(a, dtype=np.int64), np.asarray(b, dtype=np.int64)
    links = coo_matrix((np.ones(len(a), np.int8), (a, b)), shape=(n, n))
    count, label = connected_components(links, directed=False)
    return int(count), label


def next_halfedge(h):
    return np.where(h % 3 == 2, h - 2, h + 1)


def fans(F) -> tuple[int, np.ndarray]:
    """Number of fans, and the fan of every corner (3 m,)."""
    F = np.asarray(F, dtype=np.int64)
    h, g = opposite_pairs(F)
    origin = F.ravel()
    opposite = origin[h] != origin[g]  # else the two faces run the edge the same way
    tail, head = np.where(opposite, next_halfedge(g), g), np.where(opposite, g, next_halfedge(g))
    return grouped(3 * len(F), np.append(h, next_halfedge(h)), np.append(tail, head))


def patches(F) -> tuple[int, np.ndarray]:
    """Number of patches, and the patch of every face (m,)."""
    h, g = opposite_pairs(F)
    return grouped(len(F), h // 3, g // 3)


def patch_euler_numbers(F) -> list[int]:
    """Euler number of every patch, taken out of the complex; sorted."""
    count, patch = patches(F)
    n_fans, fan = fans(F)
    _, first_corner = np.unique(fan, return_index=True)
    edges = edges_of(F)
    shared = edges.faces[edges.of] == 2
    halves = np.repeat(patch, 3)
    numbers = np.bincount(halves[first_corner], minlength=count).astype(float)
    numbers -= np.bincount(halves, weights=np.where(shared, 0.5, 1.0), minlength=count)
    numbers += np.bincount(patch, minlength=count)
    assert n_fans == len(first_corner)
    return sorted(int(number) for number in numbers)


def orientable_patches(F) -> int:
    """Count the patches whose faces can all be turned to agree with their neighbours."""
    F = np.asarray(F, dtype=np.int64)
    h, g = opposite_pairs(F)
    m, origin = len(F), F.ravel()
    agree = origin[h] != origin[g]
    up, other = np.where(agree, g // 3, g // 3 + m), np.where(agree, g // 3 + m, g // 3)
    _, side = grouped(2 * m, np.append(h // 3, h // 3 + m), np.append(up, other))
    _, patch = patches(F)
    one_sided = np.unique(patch[side[:m] == side[m:]])
    return int(patch.max()) + 1 - len(one_sided)


def boundary_loop_count(F) -> int:
    """Boundary loops, pinched vertices parted."""
    edges = edges_of(F)
    n_fans, fan = fans(F)
    h = np.flatnonzero(edges.faces[edges.of] == 1)
    ends = np.append(fan[h], fan[next_halfedge(h)])
    _, loop = grouped(n_fans, fan[h], fan[next_halfedge(h)])
    return len(np.unique(loop[ends]))


def shape(F) -> dict[str, object]:
    """What no remeshing may change; the same answer as `structure.shape_of` (for manifold edges)."""
    F = np.asarray(F, dtype=np.int64)
    good = F[(np.roll(F, 1, axis=1) != F).all(axis=1)]
    edges = edges_of(good)
    used = len(np.unique(good))
    components, _ = grouped(len(good) + len(edges.ends), *face_edges(good, edges))
    directed = good.ravel() * (int(good.max()) + 1) + np.roll(good, -1, axis=1).ravel()
    return {
        "euler": used - len(edges.ends) + len(good),
        "components": components,
        "loops": boundary_loop_count(good),
        "oriented": len(np.unique(directed)) == len(directed),
        "manifold": bool((edges.faces <= 2).all()) and fans(good)[0] == used,
        "duplicate faces": len(good) - len(np.unique(np.sort(good, axis=1), axis=0)),
        "proper": len(good) == len(F),
    }


def face_edges(F, edges: Edges) -> tuple[np.ndarray, np.ndarray]:
    """Links between faces and (behind them in the count) edges."""
    return np.repeat(np.arange(len(F)), 3), len(F) + edges.of


def pinched_count(F) -> int:
    """Fans that a vertex has beyond the first, over all vertices."""
    return fans(F)[0] - len(np.unique(F))


def curves_of(edges, kinds=None) -> Curves:
    """Junctions and curves of a set of edges; `kinds` parts edges that must not join (sheets)."""
    edges = np.asarray(edges, dtype=np.int64).reshape(-1, 2)
    kinds = np.ones(len(edges), np.int64) if kinds is None else np.asarray(kinds)
    if not len(edges):
        return Curves(np.zeros(0, np.int64), [])
    vertices, ends = np.unique(edges, return_inverse=True)
    ends = ends.reshape(-1, 2)
    degree = np.bincount(ends.ravel())
    low, high = np.full(len(vertices), kinds.max()), np.full(len(vertices), kinds.min())
    np.minimum.at(low, ends, kinds[:, None])
    np.maximum.at(high, ends, kinds[:, None])
    passes = (degree == 2) & (low == high)
    # Edges that share a vertex which is no junction belong to one curve.
    edge, end = np.nonzero(passes[ends])
    at = ends[edge, end]
    order = np.argsort(at, kind="stable")
    count, curve = grouped(len(edges), edge[order[0::2]], edge[order[1::2]])
    stops: list[list[int]] = [[] for _ in range(count)]
    for k, side in zip(*np.nonzero(~passes[ends]), strict=True):
        stops[curve[k]].append(int(vertices[ends[k, side]]))
    kind = np.zeros(count, np.int64)
    kind[curve] = kinds
    curves = [(int(q), *sorted(stop)) for q, stop in zip(kind, stops, strict=True)]
    return Curves(vertices[~passes], sorted(curves))


def junctions_of(F) -> Curves:
    """Junction vertices and curves of the edges of three faces or more, by the number of sheets."""
    edges = edges_of(F)
    many = edges.faces > 2
    return curves_of(edges.ends[many], edges.faces[many])


def renumbered(curves: Curves, new: dict[int, int]) -> list[tuple[int, ...]]:
    """The curves with other names of the junctions."""
    return sorted((kind, *sorted(new[v] for v in ends)) for kind, *ends in curves.curves)
