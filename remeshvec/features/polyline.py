"""Feature curves of the reference surface as polylines: which edges follow each other, closest point.

Every edge of a curve goes by one name, the smallest of its half-edges (of all sheets that share it), so
that its two sides, and all sheets, look for a point in the same way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.compiler import inlined, kernel
from ..core.geometry import closest_on_segment, distance_squared, point
from ..core.vocabulary import NONE, BoolArray, FloatArray, IndexArray
from ..mesh.walk import end_of, ends_of, next_halfedge
from .curves import Curves

__all__ = [
    "Polylines",
    "closest_on_curve",
    "find_siblings",
    "join_edges",
    "measure_arcs",
    "move_on_curve",
    "name_edges",
]


class Polylines(NamedTuple):
    """The polylines of all feature curves, indexed by the names of their edges.

    Parameters
    ----------
    X : (n, 3) or (n, 4) float64
        Vertices of the reference surface.
    origin : (3 m,) int32
    row : (3 m,) int32
        Which column of the others belongs to a half-edge: 0 to all that are no names.
    neighbours : (2, 1 + j) int32
        See `join_edges`.
    arcs : (3, 1 + j) float64
        See `measure_arcs`.
    """

    X: FloatArray
    origin: IndexArray
    row: IndexArray
    neighbours: IndexArray
    arcs: FloatArray


def name_edges(
    twin: IndexArray, edges: IndexArray, members: IndexArray, group: IndexArray, name: IndexArray
) -> IndexArray:
    """Give every edge on a curve one name.

    Parameters
    ----------
    twin : (3 m,) int32
    edges : (k,) int32
        Half-edges on curves, in ascending order.
    members, group : int32
        Siblings, see `find_siblings`.
    name : (3 m,) int32
        Written: the smallest half-edge of the edge, ``NONE`` off curves.

    Returns
    -------
    (j,) int32
        The names, in ascending order.
    """
    name.fill(NONE)
    other = twin[edges]
    name[edges] = np.where(other == NONE, edges, np.minimum(edges, other))
    if len(members):
        smallest = np.minimum.reduceat(members, group[:-1])
        name[members] = np.repeat(smallest, np.diff(group))
    return edges[name[edges] == edges]


def join_edges(
    name: IndexArray, curves: Curves, origin: IndexArray, is_corner: BoolArray
) -> tuple[IndexArray, IndexArray]:
    """Join the edges of curves to polylines that end at corners.

    What is known of the edges lies together, in the order of their names: a column for every half-edge
    took a sixth of the memory of a call.

    Parameters
    ----------
    name : (3 m,) int32
        See `name_edges`.
    curves : Curves
    origin : (3 m,) int32
    is_corner : (n,) bool

    Returns
    -------
    row : (3 m,) int32
        See `Polylines`; (0,) where there are no curves.
    neighbours : (2, 1 + j) int32
        The names of the neighbours at the start and the end of every edge, ``NONE`` at corners; (2, 0)
        where there are no curves.
    """
    if not len(curves.edges):
        return np.empty(0, np.int32), np.empty((2, 0), np.int32)
    names = name[curves.edges]
    named = np.flatnonzero(names == curves.edges)
    edges = curves.edges[named]
    row = np.zeros(len(name), np.int32)
    row[edges] = np.arange(1, 1 + len(edges))
    neighbours = np.full((2, 1 + len(edges)), NONE, np.int32)
    ends = is_corner[ends_of(origin, edges)]
    for side, others in enumerate((curves.before, curves.after)):
        neighbour = others[named]
        is_open = (neighbour == NONE) | ends[side]
        neighbours[side, 1:] = np.where(is_open, NONE, names[neighbour])
    return row, neighbours


def measure_arcs(
    X: FloatArray, origin: IndexArray, edges: IndexArray, row: IndexArray, neighbours: IndexArray
) -> FloatArray:
    """Measure how far along its curve every edge lies.

    Parameters
    ----------
    X : (n, 3) or (n, 4) float64
    origin : (3 m,) int32
    edges : (j,) int32
        The names, in ascending order.
    row, neighbours : int32
        See `join_edges`.

    Returns
    -------
    arcs : (3, 1 + j) float64
        Arc length at the start of every edge and at its end, and that of the whole curve, negative for
        one that ends at corners; (3, 0) where there are no curves.
    """
    arcs = np.zeros((3, neighbours.shape[1]))
    if len(edges):
        is_end = (neighbours[:, 1:] == NONE).any(axis=0)
        # Curves with ends first, from one of them; what is left is closed.
        seeds = np.concatenate([edges[is_end], edges[~is_end]])
        _measure_arcs(X, origin, row, neighbours, seeds, arcs)
    return arcs


@kernel
def _measure_arcs(X, origin, row, neighbours, seeds, arcs):
    path = np.empty(seeds.size, np.int64)
    for seed in seeds:
        here = row[seed]
        if arcs[2, here] != 0.0:
            continue
        is_open = neighbours[0, here] == NONE or neighbours[1, here] == NONE
        # The end of the edge by which the walk comes in.
        end = 0 if neighbours[0, here] == NONE or not is_open else 1
        h = np.int64(seed)
        total = 0.0
        count = 0
        while count < path.size:
            here = row[h]
            path[count] = here
            count += 1
            a = origin[h]
            b = origin[next_halfedge(h)]
            arcs[end, here] = total
            total += np.sqrt(distance_squared(X, a, b))
            arcs[1 - end, here] = total
            after = np.int64(neighbours[1 - end, here])
            if after == NONE or after == seed:
                break
            there = row[after]
            if neighbours[0, there] != neighbours[1, there]:
                end = 0 if neighbours[0, there] == h else 1
            else:  # two edges between the same ends
                end = 0 if _shares(X, origin[after], b if end == 0 else a) else 1
            h = after
        for i in range(count):
            arcs[2, path[i]] = -total if is_open else total


@inlined
def _shares(X, v, w):
    """Tell whether two vertices lie in the same place: sheets have copies of their own."""
    return X[v, 0] == X[w, 0] and X[v, 1] == X[w, 1] and X[v, 2] == X[w, 2]


def find_siblings(
    X: FloatArray, origin: IndexArray, candidates: IndexArray
) -> tuple[IndexArray, IndexArray]:
    """Group half-edges whose two ends lie in the same places, bit for bit.

    Parameters
    ----------
    X : (n, 3) or (n, 4) float64
    origin : (3 m,) int32
    candidates : (k,) int32
        Half-edges.

    Returns
    -------
    members : (j,) int32
        Half-edges that have siblings, those of a group together and in ascending order.
    group : (g + 1,) int32
        Where the groups start.
    """
    members, group = np.empty(0, np.int32), np.zeros(1, np.int32)
    if not len(candidates):
        return members, group
    ends = ends_of(origin, candidates)
    if not _may_share(X, ends):
        return members, group
    vertices, place = np.unique(ends, return_inverse=True)
    place = place.reshape(2, -1)
    _, same = np.unique(X[vertices, :3] + 0.0, axis=0, return_inverse=True)  # no -0.0
    key = np.sort(same.reshape(-1)[place], axis=0)
    order = np.lexsort((candidates, key[1], key[0]))
    key = key[:, order]
    starts = np.flatnonzero(np.r_[True, (key[:, 1:] != key[:, :-1]).any(axis=0)])
    sizes = np.diff(np.r_[starts, len(order)])
    is_shared = np.repeat(sizes > 1, sizes)
    group = np.r_[0, np.cumsum(sizes[sizes > 1])].astype(np.int32)
    return candidates[order][is_shared].astype(np.int32), group


def _may_share(X: FloatArray, ends: IndexArray) -> bool:
    """Tell whether two edges may have their ends (2, k) in the same places: by the sum of both.

    Most open meshes have no siblings, and this is an eighth of the work.
    """
    x, y, z = (X[ends[0], :3] + X[ends[1], :3]).T
    key = np.sort(x + 2.0**0.5 * y + 3.0**0.5 * z)
    return bool((key[1:] == key[:-1]).any())


@inlined
def closest_on_curve(polylines, start, p):
    """Find the point of a curve closest to ``p`` near edge ``start``: edge, parameter, squared distance.

    The search covers the edges within three times the distance to ``start`` along the curve, on both
    sides, so that a vertex stays on its own stretch where another comes close.
    """
    X, origin, row, neighbours, _ = polylines
    a, b = origin[start], end_of(origin, start)
    best = start
    s, distance = closest_on_segment(p, point(X, a), point(X, b))
    reach = 3.0 * np.sqrt(distance)
    for side in range(2 if row.size > 0 else 0):
        before = start
        h = neighbours[side, row[start]]
        walked = 0.0
        for _ in range(row.size):
            if walked > reach or h == start or h == NONE:
                break
            a, b = origin[h], end_of(origin, h)
            r, d = closest_on_segment(p, point(X, a), point(X, b))
            if d < distance:
                best, s, distance = h, r, d
            walked += np.sqrt(
                (X[a, 0] - X[b, 0]) ** 2 + (X[a, 1] - X[b, 1]) ** 2 + (X[a, 2] - X[b, 2]) ** 2
            )
            here = row[h]
            after = neighbours[0, here]
            if after == before:
                after = neighbours[1, here]
            before, h = h, after
    return best, s, distance


@inlined
def move_on_curve(polylines, edge, arc):
    """Go along a curve from an edge to an arc length; returns the edge and the parameter there."""
    _, _, row, neighbours, arcs = polylines
    h = edge
    here = row[h]
    total = arcs[2, here]
    if total < 0.0:
        arc = min(max(arc, 0.0), -total)
    elif arc < 0.0:
        arc += total
    elif arc > total:
        arc -= total
    for _ in range(row.size):
        low = min(arcs[0, here], arcs[1, here])
        high = max(arcs[0, here], arcs[1, here])
        if low <= arc <= high:
            break
        # Towards the arc; on a closed curve the shorter way around.
        ahead = arc > high
        if total > 0.0 and abs(arc - 0.5 * (low + high)) > 0.5 * total:
            ahead = not ahead
        end = 1 if (arcs[1, here] > arcs[0, here]) == ahead else 0
        after = neighbours[end, here]
        if after == NONE:
            break
        h, here = after, row[after]
    length = arcs[1, here] - arcs[0, here]
    s = (arc - arcs[0, here]) / length if length != 0.0 else 0.0
    return h, min(max(s, 0.0), 1.0)
