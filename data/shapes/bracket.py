"""The bracket of this folder: a CAD part with faces triangulated as CAD tessellators do it.

Needs NumPy and libigl.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import igl
import numpy as np

from .sculpted import Floats, Mesh, outward


def bracket() -> Mesh:
    """L-bracket with three holes, a fillet and a round end, tessellated like CAD output (mm)."""
    solid = Solid()
    box = np.array([[0.0, 0], [80, 0], [80, 50], [0, 50]])
    base_holes = [circle(58, 13, 6, 40), circle(58, 37, 6, 40)]
    eye, fillet = circle(25, 35, 12, 56), circle(14, 14, 6, 12, 1, 0.25)
    end = circle(25, 35, 25, 48, 0, 0.5)
    tab = np.array([[0.0, 0], [50, 0]])

    def level(z: float) -> Callable[[Floats], Floats]:
        return lambda P: np.column_stack([P, np.full(len(P), z)])

    def wall(x: float) -> Callable[[Floats], Floats]:
        return lambda P: np.column_stack([np.full(len(P), x), P])

    def side(y: float) -> Callable[[Floats], Floats]:
        return lambda P: np.column_stack([P[:, 0], np.full(len(P), y), P[:, 1]])

    profile = np.vstack([[[0, 0], [80, 0], [80, 8]], fillet[::-1], [[8, 35], [0, 35]]])
    solid.planar(level(0), [box, *base_holes])
    solid.planar(level(8), [np.maximum(box, [14, 0]), *base_holes])
    solid.planar(wall(0), [np.vstack([tab, end]), eye])
    solid.planar(wall(8), [np.vstack([tab + np.array([0, 14]), end]), eye])
    solid.planar(wall(80), [np.array([[0.0, 0], [50, 0], [50, 8], [0, 8]])])
    solid.planar(side(0), [profile])
    solid.planar(side(50), [profile])
    for hole in base_holes:
        solid.strip(level(8)(hole), level(0)(hole), closed=True)
    solid.strip(wall(8)(eye), wall(0)(eye), closed=True)
    solid.strip(wall(0)(end), wall(8)(end), closed=False)
    solid.strip(side(50)(fillet), side(0)(fillet), closed=False)
    return solid.mesh()


def circle(
    x: float, y: float, radius: float, n: int, start: float = 0.0, turn: float = 1
) -> Floats:
    """Points on an arc, counter-clockwise; a full turn leaves the last point out."""
    t = np.pi * (start + 2 * turn * np.arange(n + (turn < 1)) / n)
    return np.stack([x + radius * np.cos(t), y + radius * np.sin(t)], axis=1)


class Solid:
    """Collects planar faces and ruled strips; equal points become one vertex."""

    def __init__(self) -> None:
        self.index: dict[tuple[float, ...], int] = {}
        self.faces: list[list[int]] = []

    def vertex(self, point: Floats) -> int:
        """Return the index of a point, added if it is new."""
        return self.index.setdefault(tuple(np.round(point, 6) + 0.0), len(self.index))

    def planar(self, frame: Callable[[Floats], Floats], loops: list[Floats]) -> None:
        """Add a plane polygon with holes; `frame` takes its 2D points to space."""
        P = np.concatenate(loops)
        at = np.cumsum([0, *map(len, loops)])
        parts = [list(range(a, b)) for a, b in pairwise(at)]
        parts = [parts[0], *(part[::-1] for part in parts[1:])]
        ids = [self.vertex(p) for p in frame(P)]
        self.faces += [[ids[v] for v in t] for t in clip_ears(P, parts)]

    def strip(self, A: Floats, B: Floats, closed: bool) -> None:
        """Add the ruled surface between two polylines of equal length."""
        a, b = [self.vertex(p) for p in A], [self.vertex(p) for p in B]
        for k in range(len(a) - (not closed)):
            n = (k + 1) % len(a)
            self.faces += [[a[k], a[n], b[n]], [a[k], b[n], b[k]]]

    def mesh(self) -> Mesh:
        """Return the vertices and the faces, turned outward."""
        F, _ = igl.bfs_orient(np.array(self.faces, dtype=np.int64))
        return outward(np.array(list(self.index)), F)


def clip_ears(P: Floats, loops: list[list[int]]) -> list[tuple[int, int, int]]:
    """Triangulate a plane polygon with holes, regardless of shape: this makes fans of long triangles."""
    polygon, triangles = bridged(P, loops), []
    k = 0
    for _ in range(len(polygon) ** 2):
        if len(polygon) == 3:
            break
        k %= len(polygon)
        i, j, h = polygon[k - 1], polygon[k], polygon[(k + 1) % len(polygon)]
        others = [v for v in polygon if v not in (i, j, h)]
        blocked = any(
            min(area2(P[i], P[j], P[v]), area2(P[j], P[h], P[v]), area2(P[h], P[i], P[v])) >= 0
            for v in others
        )
        if area2(P[i], P[j], P[h]) > 1e-9 and not blocked:
            triangles.append((i, j, h))
            del polygon[k]
        else:
            k += 1
    return [*triangles, (polygon[0], polygon[1], polygon[2])]


def bridged(P: Floats, loops: list[list[int]]) -> list[int]:
    """Join the outer loop (counter-clockwise) and the holes (clockwise) into one polygon."""
    polygon = loops[0]
    ends = np.array(
        [(a, b) for loop in loops for a, b in zip(loop, loop[1:] + loop[:1], strict=True)]
    )
    for hole in loops[1:]:
        pairs = sorted(
            (float(np.linalg.norm(P[i] - P[h])), p, q)
            for p, i in enumerate(polygon)
            for q, h in enumerate(hole)
        )
        p, q = next(
            (p, q)
            for _, p, q in pairs
            if not crosses(P[polygon[p]], P[hole[q]], P[ends[:, 0]], P[ends[:, 1]])
        )
        polygon = polygon[: p + 1] + hole[q:] + hole[: q + 1] + polygon[p:]
    return polygon


def crosses(p: Floats, q: Floats, P: Floats, Q: Floats) -> bool:
    """Whether segment p-q properly crosses one of the segments P-Q."""
    return any(
        area2(p, q, a) * area2(p, q, b) < 0 and area2(a, b, p) * area2(a, b, q) < 0
        for a, b in zip(P, Q, strict=True)
    )


def area2(a: Floats, b: Floats, c: Floats) -> float:
    """Twice the signed area of a plane triangle."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
