"""Solids with known corners, creases and surfaces, triangulated in several ways.

`SOLIDS` are bodies with planar facets; `triangulated` makes meshes of them.  `plate` is a part with
planes, cylinders and a fillet.  `uv_sphere` has circles of edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import igl
import numpy as np
from scipy.spatial import Delaunay

from . import basic
from .perturb import rotate

Arrays = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Solid:
    """A body with planar facets.

    Parameters
    ----------
    corners : (k, 3) float
    facets : tuple of tuples of int
        Corners of every facet, counter-clockwise from outside; the first one sees all others.
    """

    corners: np.ndarray
    facets: tuple[tuple[int, ...], ...]

    @property
    def creases(self) -> np.ndarray:
        """Straight creases, (k, 2, 3)."""
        loops = [list(pairwise([*facet, facet[0]])) for facet in self.facets]
        edges = {(min(e), max(e)) for loop in loops for e in loop}
        return self.corners[np.array(sorted(edges))]

    @property
    def diagonal(self) -> float:
        return float(np.linalg.norm(np.ptp(self.corners, axis=0)))


def prism(base, height: float, lean=(0.0, 0.0)) -> Solid:
    """Prism over a polygon (counter-clockwise, its first corner sees all others), maybe leaning."""
    base = np.asarray(base, dtype=float)
    k = len(base)
    low = np.column_stack([base, np.zeros(k)])
    top = tuple(range(k, 2 * k))
    walls = [(i, (i + 1) % k, (i + 1) % k + k, i + k) for i in range(k)]
    bottom = (0, *range(k - 1, 0, -1))
    return Solid(np.vstack([low, low + np.array([*lean, height])]), (bottom, top, *walls))


def regular(k: int, radius: float = 1.0) -> np.ndarray:
    """Corners of a regular polygon."""
    return radius * np.stack([np.cos(basic.turn(k)), np.sin(basic.turn(k))], axis=1)


def turned(solid: Solid, rotation=(0.3, -1.1, 0.7)) -> Solid:
    """The same body in general position: no face along an axis, no round coordinate."""
    return Solid(rotate(solid.corners, rotation), solid.facets)


def of_mesh(V: np.ndarray, F: np.ndarray) -> Solid:
    """Solid whose facets are triangles."""
    return Solid(V, tuple(tuple(f) for f in F.tolist()))


SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
L_BASE = [[1, 1], [1, 2], [0, 2], [0, 0], [2, 0], [2, 1]]

SOLIDS: dict[str, Solid] = {
    "cube": prism(SQUARE, 1.0),
    "triangle_prism": turned(prism(regular(3), 1.2)),
    "pentagon_prism": turned(prism(regular(5), 1.5)),
    "l_prism": prism(L_BASE, 1.5),
    "leaning_prism": turned(prism(SQUARE, 1.0, lean=(0.45, 0.2)), (0.8, 0.1, -0.4)),
    "tetrahedron": of_mesh(*basic.tetrahedron()),
    "octahedron": turned(of_mesh(*basic.octahedron())),
}


# --- triangulations of a solid -------------------------------------------------------------------

FORMS = ("bare", "even", "shaken", "uneven")


@cache
def triangulated(name: str, form: str) -> Arrays:
    """A mesh of one of the solids (shared between tests: not to be written to).

    ``bare``: as few triangles as there can be.  ``even``: those, each cut into 64.  ``shaken``: these
    with noise along planes and creases.  ``uneven``: Delaunay triangles of points at random, other
    random points on the creases.
    """
    solid = SOLIDS[name]
    if form == "uneven":
        V, F = uneven(solid, spacing=0.07 * solid.diagonal)
    else:
        V, F = bare(solid)
        for _ in range(0 if form == "bare" else 3):
            V, F = igl.upsample(V, F)
        if form == "shaken":
            V = shaken(V, F, solid)
    V.setflags(write=False)
    F.setflags(write=False)
    return V, F


def bare(solid: Solid) -> Arrays:
    """Every facet as a fan around its first corner."""
    fans = [(a, b, c) for a, *others in solid.facets for b, c in pairwise(others)]
    return basic.arrays(solid.corners, fans)


def shaken(V: np.ndarray, F: np.ndarray, solid: Solid, amount: float = 0.18) -> np.ndarray:
    """Move vertices at random within their facets and along their creases; corners stay.

    With 0.18 of the shortest edge in both directions no face of an upsampled solid turns over.
    """
    rng = np.random.default_rng(5)
    step = amount * np.linalg.norm(V[F] - V[F[:, [1, 2, 0]]], axis=2).min()
    normals = unique_normals(V, F)
    moved = V.copy()
    for v, planes in enumerate(normals):
        if len(planes) == 1:
            d = rng.uniform(-step, step, 3)
            moved[v] += d - planes[0] * (planes[0] @ d)
        elif len(planes) == 2:
            d = np.cross(planes[0], planes[1])
            moved[v] += rng.uniform(-step, step) * d / np.linalg.norm(d)
    at_corner = np.linalg.norm(V[:, None] - solid.corners, axis=2).min(axis=1) < 1e-12
    moved[at_corner] = V[at_corner]
    return moved


def unique_normals(V: np.ndarray, F: np.ndarray) -> list[list[np.ndarray]]:
    """The different normals (by more than about a degree) of the faces at every vertex."""
    N = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    N /= np.linalg.norm(N, axis=1, keepdims=True)
    found: list[list[np.ndarray]] = [[] for _ in V]
    for f, normal in zip(F, N, strict=True):
        for v in f:
            if all(normal @ other < 1 - 1e-4 for other in found[v]):
                found[v].append(normal)
    return found


def uneven(solid: Solid, spacing: float, seed: int = 3) -> Arrays:
    """Random points on creases, shared by both facets, and in the facets."""
    rng = np.random.default_rng(seed)
    pieces, inner = [], {}
    for facet in solid.facets:
        sides = list(pairwise([*facet, facet[0]]))
        for a, b in sides:
            A, B = solid.corners[a], solid.corners[b]
            k = max(2, round(float(np.linalg.norm(B - A)) / spacing))
            t = (np.arange(1, k) + rng.uniform(-0.2, 0.2, k - 1)) / k
            inner[a, b] = inner[b, a][::-1] if (b, a) in inner else A + t[:, None] * (B - A)
        rim = np.vstack([np.vstack([solid.corners[[a]], inner[a, b]]) for a, b in sides])
        e1 = solid.corners[facet[1]] - solid.corners[facet[0]]
        e1 /= np.linalg.norm(e1)
        axes = np.stack([e1, np.cross(facet_normal(solid, facet), e1)])
        P, F = region([(rim - rim[0]) @ axes.T], spacing, seed=int(rng.integers(1 << 30)))
        V = rim[0] + P @ axes
        V[: len(rim)] = rim  # the same bits in both facets
        pieces.append((V, F))
    return welded(pieces)


def facet_normal(solid: Solid, facet: tuple[int, ...]) -> np.ndarray:
    a, b, c = solid.corners[list(facet[:3])]
    N = np.cross(b - a, c - a)
    return N / np.linalg.norm(N)


def welded(pieces: list[Arrays]) -> Arrays:
    """Join meshes, vertices of the same place (to 1e-10) into one."""
    V = np.vstack([piece[0] for piece in pieces])
    shifts = np.cumsum([0, *[len(piece[0]) for piece in pieces[:-1]]])
    F = np.vstack([piece[1] + shift for piece, shift in zip(pieces, shifts, strict=True)])
    _, first, new = np.unique(np.round(V, 10) + 0.0, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return V[first[order]], rank[new.reshape(-1)][F]


# --- plane regions -------------------------------------------------------------------------------


def region(loops: list[np.ndarray], spacing: float, seed: int = 0) -> Arrays:
    """Triangulate what lies inside closed polygons (even-odd): points (k, 2), faces (m, 3).

    The polygons' points come first, and their edges are edges of the result, because no other point
    lies in the circle over one.
    """
    rim = np.vstack(loops)
    ends = np.vstack([np.roll(loop, -1, axis=0) for loop in loops])
    low, high = rim.min(axis=0), rim.max(axis=0)
    axes = [np.arange(a + spacing / 2, b, spacing) for a, b in zip(low, high, strict=True)]
    inner = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    inner += np.random.default_rng(seed).uniform(-0.35, 0.35, inner.shape) * spacing
    middle, radius = (rim + ends) / 2, np.linalg.norm(ends - rim, axis=1) / 2
    gap = np.linalg.norm(inner[:, None] - middle, axis=2) - 1.15 * radius
    near_rim = np.linalg.norm(inner[:, None] - rim, axis=2).min(axis=1) < 0.4 * spacing
    inner = inner[(gap > 0).all(axis=1) & ~near_rim & is_inside(inner, rim, ends)]
    P = np.vstack([rim, inner])
    F = Delaunay(P).simplices.astype(np.int64)
    F = F[is_inside(P[F].mean(axis=1), rim, ends)]
    d, e = P[F[:, 1]] - P[F[:, 0]], P[F[:, 2]] - P[F[:, 0]]
    double_area = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]
    F[double_area < 0] = F[double_area < 0, ::-1]
    return P, F[np.abs(double_area) > 1e-9 * spacing**2]


def is_inside(P: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Whether a ray from each point crosses the edges a-b an odd number of times."""
    x, y = P[:, 0, None], P[:, 1, None]
    straddles = (a[:, 1] > y) != (b[:, 1] > y)
    slope = np.divide(
        b[:, 0] - a[:, 0], b[:, 1] - a[:, 1], out=np.zeros(len(a)), where=b[:, 1] != a[:, 1]
    )
    return (straddles & (x < a[:, 0] + (y - a[:, 1]) * slope)).sum(axis=1) % 2 == 1


# --- a part with holes, a boss and a fillet ------------------------------------------------------

HOLE, BOSS, FILLET = 0.8, 0.9, 0.5  # radii
HOLE_AT, BOSS_AT = (1.6, 2.0), (4.1, 2.0)
SEGMENTS = 32  # of the circles: facets turn by 11.25 degrees, as those of the fillet do
LENGTH, WIDTH, HEIGHT, BOSS_HEIGHT = 6.0, 4.0, 1.0, 2.0
STEP = 0.25


@dataclass(frozen=True)
class Part:
    """A part of planes and cylinders."""

    V: np.ndarray
    F: np.ndarray
    corners: np.ndarray  # (k, 3)
    straight: np.ndarray  # (k, 2, 3) straight creases
    curved: np.ndarray  # (k, 2, 3) segments of round creases
    tangent: np.ndarray  # (k, 3) where straight creases turn into round ones, without a corner
    radii: tuple[float, ...]  # of all that is curved
    curved_areas: tuple[float, ...]  # of the cylinders with these radii


@cache
def plate() -> Part:
    """Plate 6 x 4 x 1 with a through hole, a boss, and one of the upper edges rounded.

    The end face x = 6 is half as high, the fillet meets it and the top without a crease.
    """
    top_end, side_end = LENGTH - FILLET, HEIGHT - FILLET
    x, y, z = steps(0, top_end), steps(0, WIDTH), steps(0, HEIGHT)
    beyond, low = steps(top_end, LENGTH), steps(0, side_end)
    t = np.linspace(0, np.pi / 2, SEGMENTS // 4 + 1)
    arc = np.stack([top_end + FILLET * np.cos(t), side_end + FILLET * np.sin(t)], axis=1)
    arc[0], arc[-1] = (LENGTH, side_end), (top_end, HEIGHT)
    hole, boss = circle(HOLE_AT, HOLE), circle(BOSS_AT, BOSS)
    long = np.append(x, beyond[1:])
    side = chain(
        [(u, 0) for u in long], [(LENGTH, h) for h in low], arc, [(u, 1) for u in x[::-1]],
        [(0, h) for h in z[::-1]],
    )  # fmt: skip
    pieces = [
        plane([box(long, y), hole], lambda p: (p[0], p[1], 0.0), flip=True),
        plane([box(x, y), hole, boss], lambda p: (p[0], p[1], HEIGHT)),
        plane([boss], lambda p: (p[0], p[1], BOSS_HEIGHT)),
        plane([side], lambda p: (p[0], 0.0, p[1])),
        plane([side], lambda p: (p[0], WIDTH, p[1]), flip=True),
        plane([box(y, z)], lambda p: (0.0, p[0], p[1]), flip=True),
        plane([box(y, low)], lambda p: (LENGTH, p[0], p[1])),
        wall(closed(hole), z, flip=True),
        wall(closed(boss), steps(HEIGHT, BOSS_HEIGHT)),
        fillet(arc, y),
    ]
    V, F = welded(pieces)
    at = [(0, 0, 0), (6, 0, 0), (6, 4, 0), (0, 4, 0), (0, 0, 1), (0, 4, 1)]
    ends = [
        ((0, 0, 0), (6, 0, 0)), ((0, 4, 0), (6, 4, 0)), ((0, 0, 0), (0, 4, 0)),
        ((6, 0, 0), (6, 4, 0)), ((0, 0, 1), (0, 4, 1)), ((0, 0, 0), (0, 0, 1)),
        ((0, 4, 0), (0, 4, 1)), ((6, 0, 0), (6, 0, 0.5)), ((6, 4, 0), (6, 4, 0.5)),
        ((0, 0, 1), (5.5, 0, 1)), ((0, 4, 1), (5.5, 4, 1)),
    ]  # fmt: skip
    rings = [(hole, 0.0), (hole, HEIGHT), (boss, HEIGHT), (boss, BOSS_HEIGHT)]
    curves = [np.column_stack([closed(P), np.full(len(P) + 1, h)]) for P, h in rings]
    curves += [np.insert(arc, 1, level, axis=1) for level in (0.0, WIDTH)]
    areas = (2 * np.pi * HOLE, 2 * np.pi * BOSS, np.pi / 2 * FILLET * WIDTH)
    return Part(
        V, F, np.array(at, float), np.array(ends, float),
        np.vstack([np.stack([P[:-1], P[1:]], axis=1) for P in curves]),
        np.array([(6, 0, 0.5), (5.5, 0, 1), (6, 4, 0.5), (5.5, 4, 1)]),
        (HOLE, BOSS, FILLET), areas,
    )  # fmt: skip


def steps(a: float, b: float) -> np.ndarray:
    return np.linspace(a, b, round((b - a) / STEP) + 1)


def circle(middle: tuple[float, float], radius: float) -> np.ndarray:
    return np.array(middle) + regular(SEGMENTS, radius)


def closed(P: np.ndarray) -> np.ndarray:
    return np.vstack([P, P[:1]])


def chain(*parts) -> np.ndarray:
    """Join polylines, each starting where the last one ended, to a closed polygon."""
    return np.vstack([np.asarray(part, dtype=float)[:-1] for part in parts])


def box(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Points around a rectangle."""
    return chain(
        [(a, v[0]) for a in u], [(u[-1], b) for b in v], [(a, v[-1]) for a in u[::-1]],
        [(u[0], b) for b in v[::-1]],
    )  # fmt: skip


def plane(loops: list[np.ndarray], lift, flip: bool = False) -> Arrays:
    P, F = region(loops, STEP)
    return np.array([lift(p) for p in P.tolist()]), F[:, ::-1] if flip else F


def wall(rim: np.ndarray, levels: np.ndarray, flip: bool = False) -> Arrays:
    """Upright wall over a polyline that goes around its solid counter-clockwise."""
    V = np.array([(*p, h) for p in rim.tolist() for h in levels.tolist()])
    F = basic.wrapped_grid(len(rim), len(levels), False, False)
    return V, F[:, ::-1] if flip else F


def fillet(arc: np.ndarray, levels: np.ndarray) -> Arrays:
    V = np.array([(p[0], y, p[1]) for p in arc.tolist() for y in levels.tolist()])
    return V, basic.wrapped_grid(len(arc), len(levels), False, False)[:, ::-1]


# --- round things --------------------------------------------------------------------------------


def uv_sphere(n: int = 48, m: int = 24) -> Arrays:
    """Unit sphere with m - 1 circles of n edges each; vertex i (m - 1) + j lies on circle j."""
    s, t = np.meshgrid(basic.turn(n), np.pi * np.arange(1, m) / m, indexing="ij")
    V = np.stack([np.sin(t) * np.cos(s), np.sin(t) * np.sin(s), np.cos(t)], axis=-1).reshape(-1, 3)
    F = basic.wrapped_grid(n, m - 1, True, False)
    north, south = np.arange(n) * (m - 1), np.arange(n) * (m - 1) + m - 2
    F = np.vstack([F, basic.fan(north, n * (m - 1))[:, ::-1], basic.fan(south, n * (m - 1) + 1)])
    return basic.outward(np.vstack([V, [[0, 0, 1], [0, 0, -1]]]), F)


def circle_edges(n: int, m: int, j: int) -> np.ndarray:
    """Edges of circle j of `uv_sphere`."""
    ring = np.arange(n) * (m - 1) + j
    return np.stack([ring, np.roll(ring, -1)], axis=1)
