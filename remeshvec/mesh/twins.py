"""Which half-edges are twins: faces in, pairs and all that follows for vertices out.

Half-edges are matched at the vertex that they leave, each vertex by itself: its neighbours are marked
with the half-edges that come from there, and looked up by those that lead there. The search for each
half-edge among those of one end took 3 times as long, in branches that nobody can predict.
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

# Corners before a range of faces, among which the latest vertex is looked for.
_LATEST = 1000

# What marks on the neighbours of a vertex mean: how many half-edges lead there and come from there, ...
_SAME_WAY = 2
_PAIR = 5
_COUNTED = 16  # added to that: the edge is in the tally
_FROM_FACE = 32  # ... or, added to this, the half-edge whose face comes from there

# Columns of the tally of a range, the first as in `Defects`; vertices that have no single ring.
_NON_MANIFOLD, _INCONSISTENT, _PINCHED, _DOUBLED, _OTHERS = range(5)


class Defects(NamedTuple):
    """What the build found and cut."""

    non_manifold_edges: int  # more than two faces
    inconsistent_edges: int  # two faces that run the edge in the same direction
    pinched_vertices: int  # vertices that held several fans
    doubled_faces: int  # faces that share two edges with another: same corners, opposite winding


class Matched(NamedTuple):
    """Half-edges in pairs, and what follows for vertices whose faces form one fan."""

    twin: IndexArray  # (3 m,)
    curve: IndexArray  # (3 m,) boundary edges are curves
    vertex_halfedge: IndexArray  # (n,)
    valence_excess: IndexArray  # (n,)
    kind: NDArray[np.uint8]  # (n,) INNER, CURVE on the boundary, or PINCHED
    found: Defects


def match_halfedges(origin: IndexArray, n: int, parallel: bool, by_winding: bool = True) -> Matched:
    """Pair the half-edges of edges that have two.

    Parameters
    ----------
    origin : (3 m,) int32
        Corners of faces, three different ones each.
    n : int
        Number of vertices.
    parallel : bool
        Let threads share the work; the result is the same.
    by_winding : bool
        Whether half-edges that run the same way are left alone. If not, only ``twin`` and ``found``
        mean something.
    """
    faces = even_ranges(origin.size // 3, parallel)
    vertices = _vertex_ranges(origin, n, faces)
    after, twin, curve = (np.empty(origin.size, np.int32) for _ in range(3))
    first, valence_excess = np.empty(n, np.int32), np.empty(n, np.int32)
    kind = np.empty(n, np.uint8)
    # A row a thread, of which it touches the share around its own vertices.
    rows = np.zeros((len(faces) - 1, n), np.int32)
    tally = np.zeros((len(faces) - 1, 5), np.int64)
    left = np.empty(len(faces) - 1, np.int64)
    _chain(parallel, faces, vertices, origin, after, curve, first, left)
    if len(left) > 1:
        _chain_left(left, origin, after, first)
    _match_rings(parallel, vertices, origin, after, rows, twin, first, valence_excess, kind, tally)
    if tally[:, _OTHERS].any():
        others = np.flatnonzero(kind == PINCHED)
        _match_fans(
            parallel, even_ranges(len(others), parallel), others, by_winding, origin, after, rows, twin,
            curve, first, valence_excess, kind, tally,
        )  # fmt: skip
    found = Defects(*tally[:, :_OTHERS].sum(axis=0).tolist())
    return Matched(twin, curve, first, valence_excess, kind, found)


def _vertex_ranges(origin: IndexArray, n: int, faces: IntArray) -> IntArray:
    """Vertices that belong to ranges of faces: those used there first, if numbered by first use.

    Otherwise any ranges serve, if less well.
    """
    ranges = np.zeros(len(faces), np.int64)
    for k in range(1, len(faces) - 1):
        end = 3 * faces[k]
        ranges[k] = max(ranges[k - 1], 1 + origin[max(0, end - _LATEST) : end].max(initial=-1))
    ranges[-1] = n
    return ranges


@threaded(per_range)
def _chain(span, faces, vertices, origin, after, curve, first, left):
    """Chain the half-edges that leave each vertex, ``first[v]``, ``after[h]`` and so on.

    Every range of faces does so for its own vertices, and chains the others, few, in ``left``.
    """
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
def _chain_left(left, origin, after, first):
    for k in range(left.size):
        h = left[k]
        while h != NONE:
            v, then = origin[h], np.int64(after[h])
            after[h] = first[v]
            first[v] = h
            h = then


@threaded(per_range)
def _match_rings(span, vertices, origin, after, rows, twin, first, valence_excess, kind, tally):
    """Pair half-edges around vertices with a single ring of faces; mark the others as pinched."""
    for k in range(span[0], span[1]):
        marks = rows[k]
        for v in range(vertices[k], vertices[k + 1]):
            start = np.int64(first[v])
            if start == NONE:  # no face uses it
                valence_excess[v] = -6
                kind[v] = INNER
                continue
            # Each neighbour leads to the half-edge whose face has it on the other side.
            size, last = 0, start
            h = start
            while h != NONE:
                marks[origin[previous_halfedge(h)]] = h + 1
                size += 1
                last = max(last, h)
                h = np.int64(after[h])
            # Around the vertex, clockwise. Where this takes up all marks, no edge has other faces.
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
                _clear_marks(start, origin, after, marks)
                kind[v] = PINCHED
                tally[k, _OTHERS] += 1


@inlined
def _clear_marks(start, origin, after, marks):
    h = start
    while h != NONE:
        marks[origin[next_halfedge(h)]] = 0
        marks[origin[previous_halfedge(h)]] = 0
        h = np.int64(after[h])


@threaded(per_range)
def _match_fans(
    span, cuts, vertices, by_winding, origin, after, rows, twin, curve, first, valence_excess, kind,
    tally,
):  # fmt: skip
    """Pair half-edges around vertices on the boundary, with several fans, or with edges to be cut."""
    for k in range(span[0], span[1]):
        marks = rows[k]
        for i in range(cuts[k], cuts[k + 1]):
            v = vertices[i]
            start = np.int64(first[v])
            _count_uses(k, v, start, origin, after, marks, tally)
            _pair_half_edges(start, by_winding, origin, after, marks, twin, curve)
            _clear_marks(start, origin, after, marks)
            if by_winding:
                _close_fan(k, v, start, after, twin, first, valence_excess, kind, tally)


@inlined
def _count_uses(k, v, start, origin, after, marks, tally):
    """Mark neighbours with the uses of the edges to them, and count those to be cut.

    A mark is the number of half-edges that lead there plus 4 times that of those from there, up to
    3 each. Edges count at the end with the smaller number.
    """
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
def _pair_half_edges(start, by_winding, origin, after, marks, twin, curve):
    """Set the twins of the half-edges that leave a vertex."""
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
            curve[h] = h
        elif mark < 0:
            twin[h] = -1 - mark
            twin[-1 - mark] = h
        elif (mark & (_COUNTED - 1)) == _SAME_WAY:
            marks[w] = -1 - h
        h = np.int64(after[h])


@inlined
def _close_fan(k, v, start, after, twin, first, valence_excess, kind, tally):
    """Set what follows for a vertex from its twins, unless it has several fans."""
    size, n_ends, end, last = 0, 0, start, start
    # All places that a clockwise step leads from or to: of one open fan this leaves the start.
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
        first[v] = end
        valence_excess[v] = size - 3
        kind[v] = CURVE
    else:
        first[v] = last
        valence_excess[v] = size - 6
        kind[v] = INNER
        if size == 2:
            tally[k, _DOUBLED] += 2
