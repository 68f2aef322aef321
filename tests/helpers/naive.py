"""Slow, obvious twins of the kernels: faces as lists of tuples, plain loops, formulas as in the paper."""

from __future__ import annotations

from collections import defaultdict
from itertools import combinations

import numpy as np

from remeshvec.core.geometry import SHARP

Face = tuple[int, int, int]


def tuples(F) -> list[Face]:
    return [tuple(int(v) for v in f) for f in np.asarray(F)]


# --- connectivity --------------------------------------------------------------------------------


def twins(F) -> list[int]:
    """Opposite half-edge of every half-edge of an oriented manifold, -1 on the boundary."""
    where = {}
    for f, corners in enumerate(tuples(F)):
        for c in range(3):
            where[corners[c], corners[(c + 1) % 3]] = 3 * f + c
    return [where.get((b, a), -1) for a, b in where]


def neighbours(F) -> dict[int, set[int]]:
    """Map every vertex to the vertices of its one-ring."""
    ring = defaultdict(set)
    for f in tuples(F):
        for v in f:
            ring[v].update(set(f) - {v})
    return dict(ring)


def boundary_edges(F) -> set[frozenset[int]]:
    uses = defaultdict(int)
    for f in tuples(F):
        for pair in combinations(f, 2):
            uses[frozenset(pair)] += 1
    return {edge for edge, count in uses.items() if count == 1}


def edges(F) -> set[frozenset[int]]:
    return {frozenset(pair) for f in tuples(F) for pair in combinations(f, 2)}


def ideal_valence(F) -> dict[int, int]:
    rim = {v for edge in boundary_edges(F) for v in edge}
    return {v: 4 if v in rim else 6 for v in neighbours(F)}


def long_edges(V, F, limit: float) -> set[frozenset[int]]:
    return {e for e in edges(F) if edge_length(V, e) > limit}


def asked_splits(V, F, limit: float) -> set[frozenset[int]]:
    """Edges that one round splits: the long ones of every face, of a low face the longest one only."""
    result = set()
    for f in tuples(F):
        sides = sorted((frozenset(p) for p in combinations(f, 2)), key=lambda e: edge_length(V, e))
        long = [e for e in sides if edge_length(V, e) > limit]
        height = np.linalg.norm(normal(V, f)) / edge_length(V, sides[-1])
        result.update(long if height >= limit / 2 else long[-1:])
    return result


def short_edges(V, F, limit: float) -> set[frozenset[int]]:
    return {e for e in edges(F) if edge_length(V, e) < limit}


def middle_length(s, t):
    """Close to the logarithmic mean of two target lengths."""
    return (0.5 * (s + t) + 2 * np.sqrt(s * t)) / 3


def edge_length(V, edge) -> float:
    a, b = edge
    return float(np.linalg.norm(V[a] - V[b]))


# --- topology of a collapse ----------------------------------------------------------------------


def link_condition(F, a: int, b: int) -> bool:
    """link(a) and link(b) meet in link(ab), all closed at the boundary by one vertex at infinity.

    [Dey et al. 1999]: links as sets of vertices and edges.
    """
    infinity = -1
    closed = tuples(F) + [(*edge, infinity) for edge in map(tuple, boundary_edges(F))]
    common = link(closed, {a}) & link(closed, {b})
    return common == link(closed, {a, b})


def link(faces, simplex: set[int]) -> set[frozenset[int]]:
    """Vertices and edges that complete a simplex to a face (or to an edge of one)."""
    found = set()
    for f in faces:
        if simplex <= set(f):
            rest = set(f) - simplex
            found.update(frozenset(s) for k in (1, 2) for s in combinations(rest, k))
    return found


def collapse(F, a: int, b: int) -> list[Face]:
    """Faces after b has become a, whatever comes of it."""
    moved = [tuple(a if v == b else v for v in f) for f in tuples(F)]
    return [f for f in moved if len(set(f)) == 3]


def flip(F, a: int, b: int) -> list[Face]:
    """Faces after edge a-b has become the other diagonal of its quad, whatever comes of it."""
    quad = [f for f in tuples(F) if {a, b} <= set(f)]
    first = next(f for f in quad if runs(f, a, b))
    second = next(f for f in quad if runs(f, b, a))
    c, d = (next(v for v in f if v not in (a, b)) for f in (first, second))
    return [f for f in tuples(F) if f not in quad] + [(a, d, c), (b, c, d)]


def runs(f: Face, a: int, b: int) -> bool:
    """Whether a face runs from a straight to b."""
    return (a, b) in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0]))


def split(V, F, a: int, b: int):
    """Vertices and faces after edge a-b got a midpoint."""
    new = len(V)
    result = []
    for f in tuples(F):
        if {a, b} <= set(f):
            result.append(tuple(new if v == b else v for v in f))
            result.append(tuple(new if v == a else v for v in f))
        else:
            result.append(f)
    return np.vstack([V, (V[a] + V[b]) / 2]), result


def valence_gain(F, a: int, b: int) -> int:
    """Fall of the summed distance from the ideal valences when a-b is flipped."""
    ring, ideal = neighbours(F), ideal_valence(F)
    quad = {v for f in tuples(F) if {a, b} <= set(f) for v in f}
    before = sum(abs(len(ring[v]) - ideal[v]) for v in quad)
    after = sum(abs(len(ring[v]) + (-1 if v in (a, b) else 1) - ideal[v]) for v in quad)
    return before - after


def violates_delaunay(V, F, a: int, b: int) -> bool:
    """Whether the angles opposite a-b sum to more than pi."""
    find_tips = [(set(f) - {a, b}).pop() for f in tuples(F) if {a, b} <= set(f)]
    return sum(angle(V[c], V[a], V[b]) for c in find_tips) > np.pi + 1e-9


def excess(V, F, a: int, b: int) -> float:
    """Degrees by which the angles opposite a-b sum to more than a half turn."""
    apexes = [(set(f) - {a, b}).pop() for f in tuples(F) if {a, b} <= set(f)]
    return float(np.degrees(sum(angle(V[c], V[a], V[b]) for c in apexes)) - 180)


def is_folded(u, w) -> bool:
    """Whether two area vectors differ by more than 150 degrees."""
    return u @ w < 0 and (u @ w) ** 2 > 0.75 * (u @ u) * (w @ w)


# --- formulas ------------------------------------------------------------------------------------


def angle(at, one, two) -> float:
    """Angle at a point between the directions to two others."""
    u, w = one - at, two - at
    return float(np.arctan2(np.linalg.norm(np.cross(u, w)), u @ w))


def normal(V, f: Face) -> np.ndarray:
    """Twice the area times the unit normal."""
    a, b, c = (V[v] for v in f)
    return np.cross(b - a, c - a)


def voronoi_areas(V, F) -> np.ndarray:
    """Mixed Voronoi area of every vertex [Meyer et al. 2003, figure 4]."""
    areas = np.zeros(len(V))
    for f in tuples(F):
        angles = [angle(V[f[c]], V[f[c - 2]], V[f[c - 1]]) for c in range(3)]
        whole = np.linalg.norm(normal(V, f)) / 2
        for c in range(3):
            a, b, d = f[c], f[c - 2], f[c - 1]
            if max(angles) > np.pi / 2:
                areas[a] += whole / (2 if angles[c] > np.pi / 2 else 4)
            else:
                areas[a] += (
                    ((V[a] - V[b]) @ (V[a] - V[b])) / np.tan(angles[c - 1])
                    + ((V[a] - V[d]) @ (V[a] - V[d])) / np.tan(angles[c - 2])
                ) / 8
    return areas


def relaxed(V, F, *, stiffness=0.0, lengths=None, still=()) -> np.ndarray:
    """Every inner vertex moved at once: ``p += (I - n n^T)(g - p)``.

    Vertices of the boundary stay, and their weights count twice; so do those of curves, but once.
    """
    lengths = np.ones(len(V)) if lengths is None else lengths
    ring, weights = neighbours(F), voronoi_areas(V, F) / lengths**2
    rim = {v for edge in boundary_edges(F) for v in edge}
    weights[sorted(rim)] *= 2
    result = V.copy()
    for v in set(ring) - rim - set(still):
        g = sum(weights[w] * V[w] for w in ring[v]) / sum(weights[w] for w in ring[v])
        result[v] += tangential(V, F, v, g - V[v], stiffness)
    return result


def centroid_steps(V, F, lengths=None) -> np.ndarray:
    """From every vertex to the centroid of its Voronoi cell, clipped where a triangle is obtuse.

    Half cell by half cell: corner, midpoint of a side, circumcentre. Where lengths are given, each has
    the density that `lloyd` says.
    """
    moments, weights = np.zeros((len(V), 3)), np.zeros(len(V))
    for f in tuples(F):
        centre = circumcentre(*(V[v] for v in f))
        for a, b, c in ((f[i], f[i - j], f[i + j - 3]) for i in range(3) for j in (1, 2)):
            middle = (V[a] + V[b]) / 2
            weight = np.linalg.norm(np.cross(middle - V[a], centre - V[a])) / 2
            if lengths is not None:
                weight *= (0.551 * lengths[a] + 0.321 * lengths[b] + 0.128 * lengths[c]) ** -4
            moments[a] += weight * (V[a] + middle + centre) / 3
            weights[a] += weight
    return moments / weights[:, None] - V


def circumcentre(a, b, c) -> np.ndarray:
    """Centre of the circle through three points; in an obtuse triangle, middle of the longest side."""
    for p, q, r in ((a, b, c), (b, c, a), (c, a, b)):
        if (q - p) @ (r - p) <= 0:
            return (q + r) / 2
    # As far from a as from b and from c, and in their plane.
    n = np.cross(b - a, c - a)
    rows = np.stack([b - a, c - a, n])
    return a + np.linalg.solve(rows, [(b - a) @ (b - a) / 2, (c - a) @ (c - a) / 2, 0.0])


def tangential(V, F, v: int, step, stiffness: float) -> np.ndarray:
    around = [f for f in tuples(F) if v in f]
    vectors = [normal(V, f) for f in around]
    norms = [np.linalg.norm(n) for n in vectors]
    n = sum(vectors)
    if np.linalg.norm(n) <= SHARP * sum(norms):  # no tangent plane: it stays
        return np.zeros(3)
    n = n / np.linalg.norm(n)
    flat = np.eye(3) - np.outer(n, n)
    step = flat @ step
    tensor = sum(np.outer(u, u) / s for u, s in zip(vectors, norms, strict=True)) / sum(norms)
    tensor = flat @ tensor @ flat
    if np.trace(tensor) < 1e-3:  # flat to two degrees
        return step
    return np.linalg.solve(np.eye(3) + stiffness * tensor @ tensor, step)


def closest_on_triangle(p, a, b, c) -> tuple[np.ndarray, float]:
    """Closest point and its distance: the foot in the plane if inside, else the best on the edges."""
    u, w = b - a, c - a
    if np.linalg.norm(np.cross(u, w)) > 0:
        (s, t), *_ = np.linalg.lstsq(np.stack([u, w], axis=1), p - a, rcond=None)
        if s >= 0 and t >= 0 and s + t <= 1:
            foot = a + s * u + t * w
            return foot, float(np.linalg.norm(p - foot))
    feet = [closest_on_segment(p, *ends) for ends in ((a, b), (b, c), (c, a))]
    foot = min(feet, key=lambda q: np.linalg.norm(p - q))
    return foot, float(np.linalg.norm(p - foot))


def closest_on_segment(p, a, b) -> np.ndarray:
    squared = (b - a) @ (b - a)
    s = min(max((p - a) @ (b - a) / squared, 0.0), 1.0) if squared > 0 else 0.0
    return a + s * (b - a)


def distance_to_mesh(p, V, F) -> float:
    return min(closest_on_triangle(p, *V[list(f)])[1] for f in tuples(F))


def path_lengths(tree, start, goal, at, frm, detour, most):
    """Length of the path from a point over faces to the face of another; closest face on short paths.

    From every face paths go on through the point of each edge that is closest to the middle between where
    they came in and the goal. They compare in single precision; of equals the first found goes first.
    """
    reach = detour * np.linalg.norm(frm - at)
    waiting, seen = [(0.0, start, frm)], {start}
    best = (np.inf, start)
    while waiting:
        length, face, entry = waiting.pop(
            min(range(len(waiting)), key=lambda k: np.float32(waiting[k][0]))
        )
        if face == goal:
            return length + np.linalg.norm(entry - at), best[1]
        corners = tree.corners[face].reshape(3, 3)
        if length <= reach:
            distance = closest_on_triangle(at, *corners)[1]
            best = min(best, (distance, face), key=lambda pair: pair[0])
        for e in range(3):
            twin = tree.twin[3 * face + e]
            if twin >= 0 and twin // 3 not in seen and len(seen) < most:
                seen.add(twin // 3)
                a, b = corners[e], corners[(e + 1) % 3]
                middle = (entry + at) / 2
                along = (middle - a) @ (b - a) / ((b - a) @ (b - a))
                point = a + np.clip(along, 0, 1) * (b - a)
                waiting.append((length + np.linalg.norm(point - entry), twin // 3, point))
    return np.inf, best[1]
