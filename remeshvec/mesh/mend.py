"""Mend what has no size: edges shorter than rounding, and faces lower than rounding.

Booleans, repaired T-junctions and marching cubes on grid values leave them. Their directions are noise,
and every phase would fold there. The surface moves by rounding alone. Ends of short edges are welded. A
cap, which is a face whose apex lies on its longest edge, goes, and the other faces on that edge get its
apex. This is also right at edges of more than two faces, and on the boundary.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..core.compiler import inlined, threaded
from ..core.geometry import face_vector, point, squared_length
from ..core.ranges import even_ranges, per_range
from ..core.vocabulary import BoolArray, FloatArray, IndexArray
from .edges import components, used_vertices
from .morton import MeshFrame
from .repair import drop_degenerate_faces, drop_duplicate_faces

__all__ = ["Kept", "Mended", "mend_faces"]

# What is done makes new work now and then, such as vertices in one place that become neighbours.
_ROUNDS = 6

# Caps are dealt with at most this often per cap at first; more is a case that no order solves.
_VISITS_PER_CAP = 30

# Height of a face without a shape, as a share of its longest side.
_FLAT = 1e-6

_SHORT, _LOW = 1, 2

Face = tuple[int, int, int]


class Kept(NamedTuple):
    """What must stay as it is."""

    vertices: BoolArray  # (n,)
    faces: BoolArray  # (m,)


class Mended(NamedTuple):
    """Faces without what has no size, and where they come from."""

    F: IndexArray  # (m, 3)
    source: IndexArray  # (m,) face before, of each
    weights: FloatArray  # (k, 3, 3) corners of the last k faces, in terms of those of their source
    representative: IndexArray  # (n,) vertex that stands for each
    counts: dict[str, int]


def mend_faces(
    V: FloatArray,
    F: IndexArray,
    frame: MeshFrame,
    tolerance: float,
    find_kept: Callable[[], Kept],
    parallel: bool,
) -> Mended | None:
    """Weld the ends of short edges, drop low faces, drop pairs of opposite faces that this makes.

    Parameters
    ----------
    V : (n, 3) float64
    F : (m, 3) int32
        Three different corners each.
    frame : MeshFrame
    tolerance : float
        Length that counts as none, in the frame.
    find_kept : callable
        Returns the vertices and faces that are left as they are; called only where something is found.
    parallel : bool
        Let threads share the work; the result is the same.

    Returns
    -------
    Mended or None
        None where nothing is to be done.
    """
    marks = _mark_faces(V, F, tolerance, parallel, frame)
    if not marks.any():
        return None
    kept = find_kept()
    V = (V - frame.centre) * frame.scale
    now = Mended(F, _numbers(len(F)), np.empty((0, 3, 3)), _numbers(len(V)), {})
    for _ in range(_ROUNDS):
        after = _weld_short_edges(V, now, marks, tolerance, kept)
        after = _drop_caps(V, after, tolerance, kept, parallel)
        if after is now:
            break
        now = after
        marks = _mark_faces(V, now.F, tolerance, parallel)
    if now.F is F or not len(now.F):
        return None
    # A wall thinner than the tolerance goes with its vertices; if one of them must stay, all stays.
    lost = used_vertices(F, len(V)) & ~used_vertices(now.F, len(V)) & kept.vertices
    return None if lost.any() else now


def _numbers(n: int) -> IndexArray:
    return np.arange(n, dtype=np.int32)


def _mark_faces(
    V: FloatArray,
    F: IndexArray,
    tolerance: float,
    parallel: bool,
    frame: MeshFrame | None = None,
) -> np.ndarray:
    """Mark faces with a short edge, and low ones (m,); by default V is in the frame already."""
    marks = np.zeros(len(F), np.uint8)
    centre, scale = (np.zeros(3), 1.0) if frame is None else (frame.centre, frame.scale)
    _mark(
        parallel, even_ranges(len(F), parallel), V, F, centre, scale, tolerance * tolerance, marks
    )
    return marks


def _marks_alone(V: FloatArray, corners: Face, tolerance: float) -> int:
    return int(_mark_faces(V, np.array([corners], np.int32), tolerance, False)[0])


@threaded(per_range)
def _mark(span, cuts, V, F, centre, scale, limit, marks):
    x, y, z = centre[0], centre[1], centre[2]
    for f in range(cuts[span[0]], cuts[span[1]]):
        a, b, c = point(V, F[f, 0]), point(V, F[f, 1]), point(V, F[f, 2])
        p = (a[0] - x) * scale, (a[1] - y) * scale, (a[2] - z) * scale
        q = (b[0] - x) * scale, (b[1] - y) * scale, (b[2] - z) * scale
        r = (c[0] - x) * scale, (c[1] - y) * scale, (c[2] - z) * scale
        marks[f] = _marks_of(p, q, r, limit)


@inlined
def _marks_of(p, q, r, limit):
    """Tell whether a side of a triangle is short, and whether the triangle is low."""
    l0, l1, l2 = squared_length(p, q), squared_length(q, r), squared_length(r, p)
    x, y, z = face_vector(p, q, r)
    low = x * x + y * y + z * z <= limit * max(l0, l1, l2)
    return _SHORT * (min(l0, l1, l2) <= limit) | _LOW * low


def _keep(now: Mended, rows: np.ndarray | None, name: str) -> Mended:
    """Keep some faces, or all, and say why."""
    if rows is None:
        return now
    n_whole = len(now.F) - len(now.weights)
    counts = dict(now.counts)
    counts[name] = counts.get(name, 0) + len(now.F) - len(rows)
    weights = now.weights[rows[rows >= n_whole] - n_whole]
    return now._replace(F=now.F[rows], source=now.source[rows], weights=weights, counts=counts)


# -- short edges ------------------------------------------------------------------------------


def _weld_short_edges(
    V: FloatArray, now: Mended, marks: np.ndarray, tolerance: float, kept: Kept
) -> Mended:
    """Let one vertex stand for all that short edges connect; faces that repeat a corner then go."""
    F = now.F[(marks & _SHORT) != 0]
    if not len(F):
        return now
    ends = np.stack([F.ravel(), F[:, [1, 2, 0]].ravel()])
    ends = ends[:, np.linalg.norm(V[ends[0]] - V[ends[1]], axis=1) <= tolerance]
    target = _targets(V, ends, tolerance, kept)
    while True:
        welded = target[now.F]
        rows = drop_degenerate_faces(welded)
        if rows is None:
            return now
        lost = _lost_corners(V, now.F, rows, target, kept)
        if not len(lost):
            break
        # Each of these faces repeats a corner, so that at least one vertex more is put back.
        back = np.isin(target, lost)
        target[back] = np.flatnonzero(back)
    counts = dict(now.counts)
    n_welded = int(np.count_nonzero(target != np.arange(len(target))))
    counts["short_edges"] = counts.get("short_edges", 0) + n_welded
    now = now._replace(F=welded, representative=target[now.representative], counts=counts)
    now = _keep(now, rows, "collapsed_faces")
    return _keep(now, drop_duplicate_faces(now.F), "duplicate_faces")


def _lost_corners(
    V: FloatArray, F: IndexArray, rows: np.ndarray, target: IndexArray, kept: Kept
) -> IndexArray:
    """Return what the corners became of faces that must not go with those outside these rows.

    A part that would vanish as a whole stays, however small, if it has a shape; so does a vertex that
    is kept. The tip of a spike may go: what its base became is still there.
    """
    shaped = _shaped(V, F, rows)
    welded = target[shaped]
    is_there = np.zeros(len(target), np.bool_)
    is_there[target[F[rows]]] = True
    remains = is_there[welded]
    loses_kept = (kept.vertices[shaped] & ~remains).any(axis=1)
    return welded[~remains.any(axis=1) | loses_kept].ravel()


def _shaped(V: FloatArray, F: IndexArray, rows: np.ndarray) -> IndexArray:
    """Faces other than these that have an area, if a small one."""
    gone = np.ones(len(F), np.bool_)
    gone[rows] = False
    F = F[gone]
    u, w = V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]
    size = np.linalg.norm(np.cross(u, w), axis=1)
    longest = np.maximum((u * u).sum(axis=1), (w * w).sum(axis=1))
    return F[size > _FLAT * longest]


def _targets(V: FloatArray, ends: np.ndarray, tolerance: float, kept: Kept) -> IndexArray:
    """Map the vertices of each cluster of short edges to the first, or to the one that is kept.

    A cluster that reaches farther than two tolerances is a curve or a surface of short edges, not a
    point: of it, only what lies in one place is welded. So are clusters of several kept vertices.
    """
    target = _numbers(len(V))
    for only_zero in (False, True):
        if only_zero:
            ends = ends[:, (V[ends[0]] == V[ends[1]]).all(axis=1)]
        used, local = np.unique(target[ends], return_inverse=True)
        local = local.reshape(2, -1)
        if not len(used):
            break
        count, label = components(len(used), *local)
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        np.minimum.at(low, label, V[used])
        np.maximum.at(high, label, V[used])
        is_point = ((high - low) ** 2).sum(axis=1) <= (2.0 * tolerance) ** 2
        first = np.full(count, len(V))
        np.minimum.at(first, label, used)
        is_kept = kept.vertices[used]
        is_point &= np.bincount(label, is_kept, count) <= 1
        first[label[is_kept]] = used[is_kept]
        chosen = is_point[label]
        target[used[chosen]] = first[label[chosen]]
    return target[target]


# -- caps -------------------------------------------------------------------------------------


def _drop_caps(V: FloatArray, now: Mended, tolerance: float, kept: Kept, parallel: bool) -> Mended:
    """Drop the low faces without a short edge, and give their apexes to the faces beside."""
    caps = np.flatnonzero(_mark_faces(V, now.F, tolerance, parallel) == _LOW)
    if not len(caps):
        return now
    patchwork = _Patchwork(V, now, kept)
    visits = _VISITS_PER_CAP * len(caps)
    queue = deque(caps.tolist())
    n_dropped = 0
    while queue and visits:
        visits -= 1
        f = queue.popleft()
        corners = patchwork.faces.get(f, None if f in patchwork.gone else patchwork.corners(f))
        if corners is None or _marks_alone(V, corners, tolerance) != _LOW:
            continue
        made = patchwork.drop(f, corners)
        if made is not None:
            n_dropped += 1
            queue.extend(made)
    return patchwork.result(now, n_dropped) if n_dropped else now


def _replaced(corners: Face, old: int, new: int) -> Face:
    a, b, c = (new if v == old else v for v in corners)
    return a, b, c


class _Patchwork:
    """Faces that change one after the other: read from the arrays where nothing has changed."""

    def __init__(self, V: FloatArray, now: Mended, kept: Kept) -> None:
        self.V, self.now, self.kept = V, now, kept
        self.faces: dict[int, Face] = {}  # those that were made
        self.gone: set[int] = set()
        self.source: dict[int, tuple[int, FloatArray]] = {}  # face of now.F, and weights
        self.at: dict[int, set[int]] = {}  # faces at a vertex, where they were asked for
        corners = now.F.ravel()
        self.order = np.argsort(corners, kind="stable")
        self.sorted = corners[self.order]
        self.next = len(now.F)

    def corners(self, f: int) -> Face:
        if f in self.faces:
            return self.faces[f]
        a, b, c = self.now.F[f].tolist()
        return a, b, c

    def around(self, v: int) -> set[int]:
        """Faces at a vertex."""
        if v not in self.at:
            low, high = np.searchsorted(self.sorted, [v, v + 1])
            self.at[v] = set((self.order[low:high] // 3).tolist()) - self.gone
        return self.at[v]

    def on(self, a: int, b: int) -> list[int]:
        """Faces on an edge."""
        return sorted(self.around(a) & self.around(b))

    def is_kept(self, f: int) -> bool:
        row = self.source[f][0] if f in self.source else f
        return bool(self.kept.faces[self.now.source[row]])

    def drop(self, f: int, corners: Face) -> list[int] | None:
        """Drop a cap, and cut the other faces on its longest edge at its apex; returns what is made.

        None where that would make an edge of more than two faces, or change what is kept.
        """
        V = self.V
        turns = [corners, corners[1:] + corners[:1], corners[2:] + corners[:2]]
        a, b, apex = max(turns, key=lambda t: float(((V[t[0]] - V[t[1]]) ** 2).sum()))
        others = [g for g in self.on(a, b) if g != f]
        if any(self.is_kept(g) for g in [f, *others]):
            return None
        pieces = []
        for g in others:
            old = self.corners(g)
            if apex in old:  # the same three corners
                return None
            far = next(v for v in old if v not in (a, b))
            halves = [_replaced(old, end, apex) for end in (a, b)]
            cancelled = [self._opposite(half) for half in halves]
            n_on = len(self.on(apex, far))
            if n_on + 2 - 2 * sum(c is not None for c in cancelled) > max(2, n_on):
                return None
            pieces.append((g, old, halves))
        edge = V[b] - V[a]
        share = min(1.0, max(0.0, float((V[apex] - V[a]) @ edge / (edge @ edge))))
        self._remove(f)
        made = []
        for g, old, halves in pieces:
            row, weights = self.source.get(g, (g, np.eye(3)))
            cut = (1.0 - share) * weights[old.index(a)] + share * weights[old.index(b)]
            self._remove(g)
            for end, half in zip((a, b), halves, strict=True):
                opposite = self._opposite(half)
                if opposite is not None:
                    self._remove(opposite)
                    continue
                rows = weights.copy()
                rows[old.index(end)] = cut
                made.append(self._add(half, row, rows))
        return made

    def _opposite(self, corners: Face) -> int | None:
        """Find a face with the same corners in the other order, which may go with it."""
        a, b, c = corners
        for g in sorted(self.around(a) & self.around(b) & self.around(c)):
            if self.corners(g) in ((b, a, c), (a, c, b), (c, b, a)) and not self.is_kept(g):
                return g
        return None

    def _remove(self, f: int) -> None:
        for v in self.corners(f):
            self.around(v).discard(f)
        self.faces.pop(f, None)
        self.gone.add(f)

    def _add(self, corners: Face, row: int, weights: FloatArray) -> int:
        f = self.next
        self.next += 1
        for v in corners:
            self.around(v).add(f)
        self.faces[f] = corners
        self.source[f] = row, weights
        return f

    def result(self, now: Mended, n_dropped: int) -> Mended:
        """Put the faces that are left and those that were made together."""
        left = np.setdiff1d(np.arange(len(now.F)), np.array(sorted(self.gone), np.int64))
        n_whole = len(now.F) - len(now.weights)
        before = now.weights[left[left >= n_whole] - n_whole]
        if not self.faces:
            F, source, weights = now.F[left], now.source[left], before
        else:
            rows = np.array([self.source[f][0] for f in self.faces])
            made = np.stack([self.source[f][1] for f in self.faces])
            cut = rows >= n_whole  # of a face that an earlier round has made
            made[cut] = made[cut] @ now.weights[rows[cut] - n_whole]
            F = np.concatenate([now.F[left], np.array([*self.faces.values()], np.int32)])
            source = np.concatenate([now.source[left], now.source[rows]])
            weights = np.concatenate([before, made])
        counts = now.counts | {"flat_faces": now.counts.get("flat_faces", 0) + n_dropped}
        return now._replace(F=F, source=source, weights=weights, counts=counts)
