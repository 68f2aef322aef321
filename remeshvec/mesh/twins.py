"""Pair half-edges that are twins, and derive what follows from the pairs for the vertices.

Half-edges are matched at the vertex that they leave, each vertex by itself: the half-edges that come from
a neighbour leave a mark there, and those that lead to it look the mark up. To search for each half-edge
among those at one of its ends took 3 times as long, in branches that cannot be predicted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, kernel, threaded
from ..core.ranges import even_ranges, per_range
from ..core.vocabulary import CURVE, INNER, NONE, IndexArray, IntArray
from .walk import next_halfedge, previous_halfedge

__all__ = [
    "PINCHED",
    "Defects",
    "Matched",
    "match_halfedges",
]

# Kind of vertices whose faces form several fans, until these are split.
PINCHED = 255

# The latest vertex is looked for among so many corners before a range of faces.
_LATEST = 1000

# Marks on the neighbours of a vertex: 1 per half-edge that leads there and 4 per half-edge that comes
# from there, ...
_SAME_WAY = 2
_PAIR = 5
_COUNTED = 16  # added to the mark of an edge that is in the tally
_FROM_FACE = 32  # ... or this plus the half-edge whose face comes from there

# Columns of the tally of a range: those of `Defects`, and vertices without a single closed ring.
_NON_MANIFOLD, _INCONSISTENT, _PINCHED, _DOUBLED, _OTHERS = range(5)


class Defects(NamedTuple):
    """Counts of the defects that the build found and cut."""

    non_manifold_edges: int  # more than two faces
    inconsistent_edges: int  # two faces that run the edge in the same direction
    pinched_vertices: int  # vertices with several fans
    doubled_faces: (
        int  # faces that share two edges with another one: same corners, opposite winding
    )


class Matched(NamedTuple):
    """Half-edges in pairs, and the arrays that follow for vertices whose faces form one fan."""

    twin: IndexArray  # (3 m,)
    curve: IndexArray  # (3 m,) boundary edges are curves
    vertex_halfedge: IndexArray  # (n,)
    valence_excess: IndexArray  # (n,)
    kind: NDArray[np.uint8]  # (n,) INNER, CURVE on the boundary, or PINCHED
    found: Defects


class _Chains(NamedTuple):
    """Half-edges, chained by the vertex that they leave, and the arrays that the matching fills."""

    origin: IndexArray  # (3 m,)
    after: IndexArray  # (3 m,) the next one that leaves the same vertex
    first: IndexArray  # (n,) where the chain starts; once matched, `Mesh.vertex_halfedge`
    twin: IndexArray  # (3 m,)
    curve: IndexArray  # (3 m,)
    valence_excess: IndexArray  # (n,)
    kind: NDArray[np.uint8]  # (n,)


def match_halfedges(origin: IndexArray, n: int, parallel: bool, by_winding: bool = True) -> Matched:
    """Pair the half-edges of edges that have two.

    Parameters
    ----------
    origin : (3 m,) int32
        Corners of the faces, three different ones each.
    n : int
        Number of vertices.
    parallel : bool
        Let threads share the work; the result is the same.
    by_winding : bool
        Whether half-edges that run the same way stay single. If not, they are paired too, and only
        ``twin`` and ``found`` are valid.
    """
    faces = even_ranges(origin.size // 3, parallel)
    vertices = _vertex_ranges(origin, n, faces)
    after, twin, curve = (np.empty(origin.size, np.int32) for _ in range(3))
    first, valence_excess = np.empty(n, np.int32), np.empty(n, np.int32)
    kind = np.empty(n, np.uint8)
    chains = _Chains(origin, after, first, twin, curve, valence_excess, kind)
    # One row per range, which touches only the entries near its own vertices.
    rows = np.zeros((len(faces) - 1, n), np.int32)
    tally = np.zeros((len(faces) - 1, 5), np.int64)
    left = np.empty(len(faces) - 1, np.int64)
    _chain(parallel, faces, vertices, chains, left)
    if len(left) > 1:
        _chain_left(left, chains)
    _match_rings(parallel, vertices, chains, rows, tally)
    if tally[:, _OTHERS].any():
        others = np.flatnonzero(kind == PINCHED)
        cuts = even_ranges(len(others), parallel)
        _match_fans(parallel, cuts, others, by_winding, chains, rows, tally)
    found = Defects(*tally[:, :_OTHERS].sum(axis=0).tolist())
    return Matched(twin, curve, first, valence_excess, kind, found)


def _vertex_ranges(origin: IndexArray, n: int, faces: IntArray) -> IntArray:
    """Cut the vertices into ranges that belong to the ranges of faces.

    If vertices are numbered by first use, each belongs to the range that uses it first. Otherwise the
    ranges are valid too, but more half-edges lead out of them.
    """
    ranges = np.zeros(len(faces), np.int64)
    for k in range(1, len(faces) - 1):
        end = 3 * faces[k]
        ranges[k] = max(ranges[k - 1], 1 + origin[max(0, end - _LATEST) : end].max(initial=-1))
    ranges[-1] = n
    return ranges


@threaded(per_range)
def _chain(span, faces, vertices, chains, left):
    """Chain the half-edges that leave each vertex.

    Every range of faces does so for its own vertices. The few others form one chain that starts at
    ``left``.
    """
    origin, after, first, curve = chains.origin, chains.after, chains.first, chains.curve
    for k in range(span[0], span[1]):
        low, count = vertices[k], np.uint64(vertices[k + 1] - vertices[k])
        for v in range(vertices[k], vertices[k + 1]):
            first[v] = NONE
        for h in range(3 * faces[k], 3 * faces[k + 1]):
            curve[h] = NONE
        rest = np.int64(NONE)
        for h in range(3 * faces[k], 3 * faces[k + 1]):
            v = np.int64(origin[h])
            if np.uint64(v - low) < count:
                after[h] = first[v]
                first[v] = h
            else:
                after[h] = rest
                rest = np.int64(h)
        left[k] = rest


@kernel
def _chain_left(left, chains):
    """Add the half-edges that are left over to the chains of their vertices."""
    origin, after, first = chains.origin, chains.after, chains.first
    for k in range(left.size):
        h = left[k]
        while h != NONE:
            v, then = origin[h], np.int64(after[h])
            after[h] = first[v]
            first[v] = h
            h = then


@threaded(per_range)
def _match_rings(span, vertices, chains, rows, tally):
    """Pair half-edges around vertices with a single ring of faces; mark the others as pinched."""
    origin, after, first, twin = chains.origin, chains.after, chains.first, chains.twin
    valence_excess, kind = chains.valence_excess, chains.kind
    for k in range(span[0], span[1]):
        marks = rows[k]
        for v in range(vertices[k], vertices[k + 1]):
            start = np.int64(first[v])
            if start == NONE:  # no face uses it
                valence_excess[v] = -6
                kind[v] = INNER
                continue
            # The mark of a neighbour is the half-edge whose face has it on the other side.
            size, last = 0, start
            h = start
            while h != NONE:
                marks[origin[previous_halfedge(h)]] = h + 1
                size += 1
                last = max(last, h)
                h = np.int64(after[h])
            # Clockwise around the vertex. If this uses all marks, no edge has further faces.
            h = start
            steps = 0
            while True:
                w = origin[next_halfedge(h)]
                g = np.int64(marks[w]) - 1
                if g == NONE:
                    break
                marks[w] = 0
                twin[h] = previous_halfedge(g)
                steps += 1
                h = g
                if h == start:
                    break
            if g != NONE and steps == size:
                first[v] = last
                valence_excess[v] = size - 6
                kind[v] = INNER
                if size == 2:
                    tally[k, _DOUBLED] += 2
            else:
                _clear_marks(chains, start, marks)
                kind[v] = PINCHED
                tally[k, _OTHERS] += 1


@inlined
def _clear_marks(chains, start, marks):
    origin, after = chains.origin, chains.after
    h = start
    while h != NONE:
        marks[origin[next_halfedge(h)]] = 0
        marks[origin[previous_halfedge(h)]] = 0
        h = np.int64(after[h])


@threaded(per_range)
def _match_fans(span, cuts, vertices, by_winding, chains, rows, tally):
    """Pair half-edges around vertices on the boundary, with several fans, or with edges to cut."""
    for k in range(span[0], span[1]):
        marks = rows[k]
        for i in range(cuts[k], cuts[k + 1]):
            v = vertices[i]
            start = np.int64(chains.first[v])
            _count_uses(chains, v, start, marks, tally, k)
            _pair_half_edges(chains, start, by_winding, marks)
            _clear_marks(chains, start, marks)
            if by_winding:
                _close_fan(chains, v, start, tally, k)


@inlined
def _count_uses(chains, v, start, marks, tally, k):
    """Mark each neighbour with the uses of the edge to it, and count the edges to cut.

    A mark is the number of half-edges that lead there plus 4 times the number of those that come from
    there, each up to 3. An edge is counted at its end with the smaller number.
    """
    origin, after = chains.origin, chains.after
    h = start
    while h != NONE:
        w, u = origin[next_halfedge(h)], origin[previous_halfedge(h)]
        marks[w] += (marks[w] & 3) < 3
        marks[u] += 4 * ((marks[u] >> 2) < 3)
        h = np.int64(after[h])
    h = start
    while h != NONE:
        for w in (origin[next_halfedge(h)], origin[previous_halfedge(h)]):
            mark = marks[w]
            if v < w and mark < _COUNTED:
                there, back = mark & 3, mark >> 2
                if there + back > 2 or (there != 1 and back != 1):
                    tally[k, _NON_MANIFOLD if there + back > 2 else _INCONSISTENT] += 1
                    marks[w] += _COUNTED
        h = np.int64(after[h])


@inlined
def _pair_half_edges(chains, start, by_winding, marks):
    """Set the twins of the half-edges that leave a vertex."""
    origin, after, twin = chains.origin, chains.after, chains.twin
    h = start
    while h != NONE:
        u = origin[previous_halfedge(h)]
        if marks[u] == _PAIR:
            marks[u] = _FROM_FACE + h
        h = np.int64(after[h])
    h = start
    while h != NONE:
        w = origin[next_halfedge(h)]
        mark = np.int64(marks[w])
        twin[h] = NONE
        if mark >= _FROM_FACE:
            twin[h] = previous_halfedge(mark - _FROM_FACE)
        elif by_winding:
            chains.curve[h] = h
        elif mark < 0:
            twin[h] = -1 - mark
            twin[-1 - mark] = h
        elif (mark & (_COUNTED - 1)) == _SAME_WAY:
            marks[w] = -1 - h
        h = np.int64(after[h])


@inlined
def _close_fan(chains, v, start, tally, k):
    """Set the first half-edge, valence and kind of a vertex, unless it has several fans."""
    after, twin = chains.after, chains.twin
    size, n_ends, end, last = 0, 0, start, start
    # Exclusive or of all half-edges that clockwise steps lead from or to: in one open fan only the start
    # remains.
    both = np.int64(0)
    h = start
    while h != NONE:
        size += 1
        last = max(last, h)
        both ^= h
        if twin[h] == NONE:
            n_ends += 1
            end = h
        else:
            both ^= next_halfedge(np.int64(twin[h]))
        h = np.int64(after[h])
    start = both if n_ends == 1 else start
    steps = 0
    h = start
    while n_ends <= 1 and (h != start or steps == 0):
        steps += 1
        if twin[h] == NONE:
            break
        h = next_halfedge(np.int64(twin[h]))
    if steps < size:
        tally[k, _PINCHED] += 1
    elif n_ends == 1:
        chains.first[v] = end
        chains.valence_excess[v] = size - 3
        chains.kind[v] = CURVE
    else:
        chains.first[v] = last
        chains.valence_excess[v] = size - 6
        chains.kind[v] = INNER
        if size == 2:
            tally[k, _DOUBLED] += 2
