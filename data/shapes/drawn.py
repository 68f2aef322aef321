"""Shapes of the pictures that no file in ``data`` has: sheets with drawn lines, soap films, a bar."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Arrays = tuple[FloatArray, IntArray]


def notched_sheet(seed: int = 1) -> Arrays:
    """Wavy sheet whose rim is bent, unevenly cut, and notched: three corners."""
    rng = np.random.default_rng(seed)
    steps = np.exp(rng.normal(0.0, 0.9, 90))
    t = 2 * np.pi * np.cumsum(steps) / steps.sum()
    r = 1.0 + 0.16 * np.cos(3 * t + 0.6) + 0.07 * np.sin(7 * t)
    rim = (r * np.stack([1.35 * np.cos(t), np.sin(t)]))[:, (t < 4.45) | (t > 4.9)].T
    notch = np.searchsorted(t, 4.45)
    rim = np.insert(rim, notch, [-0.05, -0.25], axis=0)
    sides = [rim[k - 1] + np.linspace(0, 1, 8)[1:-1, None] * (rim[k] - rim[k - 1]) for k in
             (notch, notch + 1)]  # fmt: skip
    rim = np.concatenate(
        [rim[:notch], sides[0], rim[notch : notch + 1], sides[1], rim[notch + 1 :]]
    )
    P, F = triangulated(rng.uniform(-1.7, 1.7, (700, 2)), [np.vstack([rim, rim[:1]])])
    F = F[_is_inside(P[F].mean(axis=1), rim)]
    used, F = np.unique(F, return_inverse=True)
    x, y = P[used].T
    z = 0.16 * np.sin(2.2 * x) + 0.12 * np.cos(2.6 * y)
    return np.column_stack([x, y, z]), F.reshape(-1, 3)


def flag(seed: int = 2) -> tuple[FloatArray, IntArray, IntArray]:
    """Wavy rectangle with four labels: a disc, a slanted line, a quarter of a disc; V, F, labels."""
    rng = np.random.default_rng(seed)
    corners = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [0.0, 2.0], [0.0, 0.0]])
    rim = [_between(a, b, 24) for a, b in pairwise(corners)]
    t = np.linspace(0, 2 * np.pi, 49)
    disc = [0.95, 1.0] + 0.58 * np.stack([np.cos(t), np.sin(t)], axis=1)
    line = _between(rim[0][16], rim[2][6], 26)
    t = np.linspace(np.pi / 2, np.pi, 20)
    radius = 3.0 - rim[0][20, 0]
    quarter = [3.0, 0.0] + radius * np.stack([np.cos(t), np.sin(t)], axis=1)
    rim[1] = np.unique(np.vstack([rim[1], quarter[:1]]).round(12), axis=0)
    P, F = triangulated(rng.uniform(0, 1, (500, 2)) * [3, 2], [*rim, disc, line, quarter])
    centres = P[F].mean(axis=1)
    labels = np.zeros(len(F), np.int64)
    along, away = line[-1] - line[0], centres - line[0]
    labels[along[0] * away[:, 1] < along[1] * away[:, 0]] = 2
    labels[np.hypot(*(centres - [0.95, 1.0]).T) < 0.58] = 1
    labels[np.hypot(*(centres - [3.0, 0.0]).T) < radius] = 3
    x, y = P.T
    return np.column_stack([x, y, 0.2 * np.sin(2.0 * x) + 0.1 * np.cos(2.4 * y)]), F, labels


def tiles(seed: int = 3) -> tuple[FloatArray, IntArray, IntArray]:
    """Wavy rectangle with two labels inside: a hexagon and a square; V, F, labels."""
    rng = np.random.default_rng(seed)
    corners = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 1.6], [0.0, 1.6], [0.0, 0.0]])
    rim = [_between(a, b, 20) for a, b in pairwise(corners)]
    middles = np.array([[0.85, 0.8], [2.2, 0.8]])
    inside = []
    for sides, middle in zip((6, 4), middles, strict=True):
        t = 2 * np.pi * np.arange(sides + 1) / sides + 0.3
        tile = middle + 0.58 * np.stack([np.cos(t), np.sin(t)], axis=1)
        inside.append([_between(a, b, 36 // sides) for a, b in pairwise(tile)])
    points = rng.uniform(0, 1, (420, 2)) * [3.0, 1.6]
    P, F = triangulated(points, [*rim, *inside[0], *inside[1]])
    labels = np.zeros(len(F), np.int64)
    for k, lines in enumerate(inside):
        labels[_is_inside(P[F].mean(axis=1), np.vstack([line[:-1] for line in lines]))] = k + 1
    x, y = P.T
    return np.column_stack([x, y, 0.2 * np.sin(2.0 * x) + 0.1 * np.cos(2.4 * y)]), F, labels


def half_discs() -> Arrays:
    """Three half-discs on one line, as where three soap films meet."""
    r, t = np.meshgrid(np.linspace(0, 1, 7), np.linspace(0, np.pi, 25), indexing="ij")
    parts = []
    for angle in 2 * np.pi * np.arange(3) / 3 + 1.13:  # none is seen edge-on
        across = r * np.sin(t)
        parts.append(np.stack([r * np.cos(t), across * np.cos(angle), across * np.sin(angle)], -1))
    return welded(parts)


def double_bubble() -> Arrays:
    """Two equal soap bubbles and the wall between them, which meet at 120 degrees."""
    t = np.linspace(np.pi / 3, np.pi, 15)
    cap = np.stack([np.cos(t) - 0.5, np.sin(t)], axis=1)
    wall = np.stack([np.zeros(7), np.linspace(np.sin(np.pi / 3), 0.0, 7)], axis=1)
    turn = np.linspace(0, 2 * np.pi, 41)
    parts = []
    for profile in (cap, cap * [-1, 1], wall):
        x, r = (a[:, None] for a in profile.T)
        ones = np.ones_like(turn)
        parts.append(np.stack([x * ones, r * np.cos(turn), r * np.sin(turn)], axis=-1))
    return welded(parts)


def welded(parts: list[FloatArray]) -> Arrays:
    """Triangulate grids of points (a, b, 3) and join them where their points are the same."""
    points, faces, count = [], [], 0
    for grid in parts:
        k = np.arange(grid.size // 3).reshape(grid.shape[:2]) + count
        a, b, c, d = (q.ravel() for q in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
        faces += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
        points.append(grid.reshape(-1, 3))
        count += k.size
    V, index = np.unique(np.concatenate(points).round(9) + 0.0, axis=0, return_inverse=True)
    F = index.ravel()[np.concatenate(faces)]
    return V, F[(np.roll(F, 1, axis=1) != F).all(axis=1)]


def triangulated(points: FloatArray, curves: list[FloatArray]) -> Arrays:
    """Triangulate the points (n, 2) and the curves; edges of the curves are edges of the mesh.

    They are, because no other point may stay in a circle around one (Delaunay).
    """
    from scipy.spatial import Delaunay

    ends = np.concatenate([np.stack([c[:-1], c[1:]], axis=1) for c in curves])
    a, b = ends[:, 0], ends[:, 1]
    to_a, to_b = points[:, None] - a, points[:, None] - b
    outside = np.einsum("ijk,ijk->ij", to_a, to_b) > 0.15 * ((b - a) ** 2).sum(axis=1)
    on_curves = np.unique(np.concatenate(curves).round(12), axis=0)
    P = np.vstack([on_curves, points[outside.all(axis=1)]])
    F = Delaunay(P).simplices.astype(np.int64)
    d, e = P[F[:, 1]] - P[F[:, 0]], P[F[:, 2]] - P[F[:, 0]]
    twice = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]
    F[twice < 0] = F[twice < 0][:, [0, 2, 1]]
    return P, F[np.abs(twice) > 1e-12]


def _between(a: FloatArray, b: FloatArray, count: int) -> FloatArray:
    return a + np.linspace(0, 1, count)[:, None] * (b - a)


def _is_inside(P: FloatArray, polygon: FloatArray) -> NDArray[np.bool_]:
    """Whether points lie in a polygon: a ray to the right crosses it an odd number of times."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    x, y = P[:, :1], P[:, 1:]
    spans = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return (spans & (x < cross)).sum(axis=1) % 2 == 1


def bumpy_bar(
    around: int = 48, length: float = 6.0, height: float = 0.06, bumps: int = 8, flat: float = 1.0
) -> tuple[FloatArray, IntArray]:
    """Bar with rounded edges along x, 1 thick, closed, with rows of bumps; its ends are smooth.

    ``around`` is the number of vertices around it, ``bumps`` that of bumps, ``flat`` the length of the
    smooth ends.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, 4001)
    rim = _superellipse(turn)
    arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(rim, axis=0), axis=1)))
    rows = round(length / (arc[-1] / around * np.sqrt(0.75)))
    V = []
    for j in range(rows + 1):
        share = (np.arange(around) + 0.5 * (j % 2)) / around
        x = length * j / rows
        ring = _superellipse(np.interp(share * arc[-1], arc, turn))
        fade = np.clip(min(x - flat, length - flat - x) / 0.3, 0.0, 1.0)
        wave = np.sin(2.0 * np.pi * bumps * share) * np.sin(2.0 * np.pi * bumps * x / arc[-1])
        outwards = ring / np.linalg.norm(ring, axis=1, keepdims=True)
        ring = ring + (height * fade * np.maximum(wave, 0.0))[:, None] * outwards
        V.append(np.column_stack([np.full(around, x), ring]))
    V.append([[0.0, 0.0, 0.0], [length, 0.0, 0.0]])
    i = np.arange(around)
    next_halfedge = (i + 1) % around
    F = []
    for j in range(rows):
        a, b, c, d = around * j + np.array([i, next_halfedge, i + around, next_halfedge + around])
        F += [(a, b, c), (b, d, c)] if j % 2 == 0 else [(a, b, d), (a, d, c)]
    first = np.full(around, around * (rows + 1))
    last = around * rows
    F += [(next_halfedge, i, first), (last + i, last + next_halfedge, first + 1)]
    return np.concatenate(V), np.concatenate([np.column_stack(face) for face in F])


def _superellipse(turn: FloatArray) -> FloatArray:
    """Points of ``y^4 + z^4 = 1/16``."""
    c, s = np.cos(turn), np.sin(turn)
    return np.column_stack([c, s]) * (0.5 / (c**4 + s**4) ** 0.25)[:, None]
