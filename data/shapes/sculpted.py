"""The shapes behind the meshes in this folder: implicit surfaces, sheets, rings, a vase.

Needs NumPy and libigl.  Everything random is seeded.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import igl
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mesh = tuple[Floats, Ints]
Field = Callable[[Floats], Floats]  # (n, 3) points -> (n,) signed distance, negative inside


# --- implicit shapes -----------------------------------------------------------------------------


def round_cone(P: Floats, a: Floats, b: Floats, r_a: float, r_b: float) -> Floats:
    """Distance to the segment a-b thickened by radii that change linearly (a near distance)."""
    t = np.clip((P - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(P - a - t[:, None] * (b - a), axis=1) - (r_a + t * (r_b - r_a))


def smooth_union(distances: list[Floats], width: float) -> Floats:
    """Soft minimum: shapes melt into each other over about `width`."""
    D = np.stack(distances)
    low = D.min(axis=0)
    return low - width * np.log(np.exp((low - D) / width).sum(axis=0))


def limb(*stations: tuple[float, float, float, float]) -> list[tuple[Floats, Floats, float, float]]:
    """Turn stations (x, y, z, radius) along a limb into round cones."""
    return [(np.array(a[:3]), np.array(b[:3]), a[3], b[3]) for a, b in pairwise(stations)]


def mirrored(cones: list[tuple[Floats, Floats, float, float]]) -> list:
    """Return the cones and their mirror images in the plane y = 0."""
    flip = np.array([1.0, -1.0, 1.0])
    return cones + [(a * flip, b * flip, r, s) for a, b, r, s in cones]


CREATURE = [
    *limb((-0.42, 0, 0.56, 0.25), (0.0, 0, 0.6, 0.27), (0.36, 0, 0.64, 0.27)),  # body
    *limb((0.42, 0, 0.72, 0.2), (0.66, 0, 1.02, 0.15), (0.74, 0, 1.2, 0.17)),  # neck
    *limb((0.76, 0, 1.25, 0.2), (1.1, 0, 1.17, 0.115)),  # head
    *limb(
        *[(-0.55, 0, 0.55, 0.19), (-0.85, 0.04, 0.42, 0.14), (-1.14, 0.16, 0.36, 0.1)],
        *[(-1.38, 0.3, 0.45, 0.075), (-1.5, 0.38, 0.64, 0.06), (-1.47, 0.38, 0.82, 0.045)],
    ),  # tail
    *mirrored(limb((0.34, 0.16, 0.52, 0.16), (0.36, 0.25, 0.3, 0.105), (0.34, 0.27, 0.08, 0.095))),
    *mirrored(limb((0.35, 0.27, 0.08, 0.095), (0.47, 0.3, 0.07, 0.075))),  # fore paws
    *mirrored(limb((-0.4, 0.17, 0.5, 0.19), (-0.34, 0.28, 0.28, 0.125), (-0.46, 0.3, 0.08, 0.1))),
    *mirrored(limb((-0.45, 0.3, 0.08, 0.1), (-0.31, 0.33, 0.07, 0.08))),  # hind paws
    *mirrored(limb((0.68, 0.1, 1.38, 0.085), (0.56, 0.2, 1.56, 0.075), (0.45, 0.27, 1.74, 0.035))),
    *mirrored(limb((0.93, 0.12, 1.3, 0.075), (0.94, 0.125, 1.305, 0.07))),  # eyes
]


def creature_field(P: Floats) -> Floats:
    """Four legs, a tail, a long neck and ears."""
    return smooth_union([round_cone(P, *cone) for cone in CREATURE], 0.035)


def pretzel_field(P: Floats) -> Floats:
    """Three tori whose rings overlap, melted into one body of genus 3."""
    distances = []
    for angle in 2 * np.pi * np.arange(3) / 3:
        x, y = P[:, 0] - 0.86 * np.cos(angle), P[:, 1] - 0.86 * np.sin(angle)
        distances.append(np.hypot(np.hypot(x, y) - 0.72, P[:, 2]) - 0.24)
    return smooth_union(distances, 0.05)


def marching_cubes(field: Field, low: list[float], high: list[float], step: float) -> Mesh:
    """Triangulate the zero set, outward normals."""
    counts = [round((b - a) / step) + 1 for a, b in zip(low, high, strict=True)]
    axes = [a + step * np.arange(n) for a, n in zip(low, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).transpose(2, 1, 0, 3).reshape(-1, 3)
    values = field(grid)
    # A value near zero puts several vertices into one grid corner, which the digits then merge.
    values = np.where(np.abs(values) < 0.02 * step, 0.02 * step, values)
    V, F, _ = igl.marching_cubes(values, grid, *counts, 0.0)
    return outward(V, F)


def gradient(field: Field, P: Floats) -> Floats:
    """Return the unit gradient by central differences."""
    h = 1e-4
    G = np.stack([field(P + h * axis) - field(P - h * axis) for axis in np.eye(3)], axis=1)
    return G / np.linalg.norm(G, axis=1, keepdims=True)


def onto(field: Field, P: Floats) -> Floats:
    """Walk to the zero set along the gradient."""
    for _ in range(4):
        P = P - field(P)[:, None] * gradient(field, P)
    return P


# --- bad triangles -------------------------------------------------------------------------------


def normals(V: Floats, F: Ints) -> Floats:
    """Return the unit normals of the faces (zero where there is no area)."""
    N = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    return N / np.maximum(np.linalg.norm(N, axis=1, keepdims=True), 1e-300)


def shake(V: Floats, F: Ints, field: Field, amount: float, rng: np.random.Generator) -> Floats:
    """Move vertices at random within the surface; moves that would fold a face are undone."""
    ring = igl.average_onto_vertices(V, F, igl.edge_lengths(V, F).mean(axis=1))[:, None]
    N = gradient(field, V)
    D = rng.normal(size=V.shape) * amount * ring
    moved = onto(field, V + D - (D * N).sum(axis=1, keepdims=True) * N)
    for _ in range(50):
        facing = (normals(moved, F) * gradient(field, moved[F].mean(axis=1))).sum(axis=1)
        back = np.unique(F[facing < 0.85])
        back = back[(moved[back] != V[back]).any(axis=1)]
        if len(back) == 0:
            break
        moved[back] = V[back]
    return moved


def flip_at_random(V: Floats, F: Ints, share: float, rng: np.random.Generator) -> Ints:
    """Flip a share of the edges where the quad is nearly flat and convex."""
    F = F.copy()
    half_edge = {(int(f[c]), int(f[(c + 1) % 3])): i for i, f in enumerate(F) for c in range(3)}
    edges = [edge for edge in sorted(half_edge) if edge[0] < edge[1]]
    for k in rng.permutation(len(edges))[: int(share * len(edges))]:
        a, b = edges[k]
        if (a, b) not in half_edge or (b, a) not in half_edge:
            continue
        left, right = half_edge[a, b], half_edge[b, a]
        c, d = int(F[left].sum()) - a - b, int(F[right].sum()) - a - b
        if (c, d) in half_edge or (d, c) in half_edge:
            continue
        new = np.array([[a, d, c], [d, b, c]])
        if (normals(V, new) @ normals(V, F[[left, right]]).T).min() < 0.93:
            continue
        F[left], F[right] = new
        del half_edge[a, b], half_edge[b, a]
        half_edge.update({(d, c): left, (c, a): left, (a, d): left})
        half_edge.update({(c, d): right, (d, b): right, (b, c): right})
    return F


def outward(V: Floats, F: Ints) -> Mesh:
    """Turn all faces where the enclosed volume is negative."""
    volume = np.einsum("fi,fi->", V[F[:, 0]], np.cross(V[F[:, 1]], V[F[:, 2]]))
    return V, F if volume > 0 else F[:, ::-1].copy()


# --- the meshes ----------------------------------------------------------------------------------


def creature() -> Mesh:
    """Organic shape, badly triangulated: uneven sizes, needles, caps, wild valences."""
    rng = np.random.default_rng(2004)
    V, F = marching_cubes(creature_field, [-1.75, -0.6, -0.15], [1.4, 0.75, 1.95], 0.021)
    V, F, _, _ = igl.qslim(V, F, 10_400)
    V = onto(creature_field, V)
    for share in (0.3, 0.3, 0.3, 0.2):
        V = shake(V, F, creature_field, 0.4, rng)
        F = flip_at_random(V, F, share, rng)
    return outward(V, F)


def pretzel() -> Mesh:
    """Genus 3, as marching cubes leaves it."""
    return marching_cubes(pretzel_field, [-2.0, -2.0, -0.4], [2.0, 2.0, 0.4], 0.0877)


def wavy_sheet() -> Mesh:
    """Open sheet with an outer boundary and three round holes, stretched and jittered."""
    rng = np.random.default_rng(3)
    n_x, n_y = 84, 48
    x, y = np.meshgrid(np.linspace(0, 7, n_x), np.linspace(0, 4, n_y), indexing="ij")
    P = np.stack([x.ravel(), y.ravel()], axis=1)
    F = diagonals(n_x, n_y, rng)
    on_rim = (P[:, 0] % 7 == 0) | (P[:, 1] % 4 == 0)
    P += np.where(on_rim[:, None], 0, rng.uniform(-0.028, 0.028, P.shape))
    for centre, radius in [([1.4, 1.3], 0.55), ([3.5, 2.6], 0.75), ([5.7, 1.5], 0.6)]:
        away = np.linalg.norm(P - centre, axis=1)
        F = F[(away[F] > radius).all(axis=1)]
        rim = np.unique(igl.boundary_facets(F)[0])
        rim = rim[away[rim] < 1.3 * radius]
        P[rim] = centre + (P[rim] - centre) * (radius / away[rim])[:, None]
    P, F, _, _ = igl.remove_unreferenced(np.column_stack([P, np.zeros(len(P))]), F)
    x, y = P[:, 0], P[:, 1] + 0.25 * np.sin(0.9 * P[:, 0])
    x = x + 0.35 * np.sin(2 * np.pi * x / 7)  # wide and narrow columns
    return np.column_stack([x, y, 0.3 * np.sin(1.7 * x) + 0.16 * np.cos(2.3 * y + x)]), F


def linked_rings() -> Mesh:
    """Two linked tori, one component each, with long triangles that twist around the ring."""
    parts = [ring(120, 14, 0.3, 1.2), ring(36, 40, 0.26, -0.5)]
    V1, V2 = parts[0][0], parts[1][0][:, [0, 2, 1]] * [1, -1, 1] + [1.0, 0, 0]
    return np.vstack([V1, V2]), np.vstack([parts[0][1], parts[1][1] + len(V1)])


def thin_sheet() -> Mesh:
    """Two parallel curved sides, a fifth of an edge apart, joined by a rim."""
    rng = np.random.default_rng(7)
    n = 36
    s = np.linspace(-1, 1, n)
    x, y = (a.ravel() for a in np.meshgrid(s, s, indexing="ij"))
    on_rim = (np.abs(x) == 1) | (np.abs(y) == 1)
    half = 0.1 * 1.13 * (s[1] - s[0])  # 1.13: mean edge of the sheet over the spacing
    sides, faces = [], []
    for sign in (1, -1):
        shift = np.where(on_rim, 0, rng.uniform(-0.3, 0.3, (2, n * n)) * (s[1] - s[0]))
        u, v = x + shift[0], y + shift[1]
        slope = np.stack([-0.7 * u, 0.5 * v, np.ones(n * n)], axis=1)
        point = np.stack([u, v, 0.35 * u**2 - 0.25 * v**2], axis=1)
        sides.append(point + sign * half * slope / np.linalg.norm(slope, axis=1, keepdims=True))
        faces.append(diagonals(n, n, rng)[:, ::sign])
    rim = igl.boundary_loop(faces[0])
    a, b = rim, np.roll(rim, -1)
    low_a, low_b = a + n * n, b + n * n
    walls = [np.stack([b, a, low_a], axis=1), np.stack([b, low_a, low_b], axis=1)]
    return np.vstack(sides), np.vstack([faces[0], faces[1] + n * n, *walls])


def diagonals(n_x: int, n_y: int, rng: np.random.Generator) -> Ints:
    """Triangulate a grid of n_x times n_y points with random diagonals, normals along +z."""
    i = np.arange(n_x * n_y).reshape(n_x, n_y)
    a, b, c, d = (q.ravel() for q in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    turn = rng.random(len(a)) < 0.5
    first = np.where(turn, [a, b, c], [a, b, d]).T
    second = np.where(turn, [a, c, d], [b, c, d]).T
    return np.vstack([first, second])


def ring(n: int, m: int, radius: float, twist: float) -> Mesh:
    """Torus of `n` rings of `m` points; `twist` turns the quads (radians a sixth of the way)."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    t = 2 * np.pi * i / n
    w = 2 * np.pi * j / m + twist * np.sin(6 * t)
    r = 1 + radius * np.cos(w)
    V = np.stack([r * np.cos(t), r * np.sin(t), radius * np.sin(w)], axis=1)
    i2, j2 = (i + 1) % n, (j + 1) % m
    a, b, c, d = i * m + j, i2 * m + j, i2 * m + j2, i * m + j2
    return outward(V, np.vstack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))


# --- vase ----------------------------------------------------------------------------------------

VASE_AROUND, VASE_UP = 36, 44


def vase() -> tuple[Floats, Ints, Floats]:
    """Make an open vase with a texture wrapped around it once, coordinates (m, 3, 2) on corners.

    Rows crowd at the foot, columns are uneven, diagonals random: as modellers leave surfaces of
    revolution. Every vertex lies on the surface at its texture coordinates.
    """
    rng = np.random.default_rng(11)
    i, j = np.meshgrid(np.arange(VASE_AROUND + 1), np.arange(VASE_UP + 1), indexing="ij")
    u, v = i / VASE_AROUND, (j / VASE_UP) ** 1.5
    u = u + 0.012 * np.sin(6 * np.pi * u)
    inner = (i > 0) & (i < VASE_AROUND) & (j > 0) & (j < VASE_UP)
    u = u + np.where(inner, rng.uniform(-0.25, 0.25, u.shape) / VASE_AROUND, 0)
    v = v + np.where(
        inner, rng.uniform(-0.3, 0.3, v.shape) * 1.5 * np.sqrt(j / VASE_UP) / VASE_UP, 0
    )
    faces = []
    for a in range(VASE_AROUND):
        for b in range(VASE_UP):
            p, q, r, s = (a, b), (a + 1, b), (a + 1, b + 1), (a, b + 1)
            faces += [(p, q, r), (p, r, s)] if rng.random() < 0.5 else [(p, q, s), (q, r, s)]
    at = np.array(faces)  # (m, 3, 2): column and row of every corner
    uv = np.stack([u[at[..., 0], at[..., 1]], v[at[..., 0], at[..., 1]]], axis=-1)
    F = (at[..., 0] % VASE_AROUND) * (VASE_UP + 1) + at[..., 1]
    u, v = u[:-1].ravel(), v[:-1].ravel()
    radius = (
        0.55
        + 0.4 * np.sin(np.pi * (1.15 * v - 0.1)) ** 2
        - 0.25 * v
        + 0.5 * np.maximum(v - 0.85, 0)
    )
    angle = 2 * np.pi * u
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 2.2 * v], axis=1), F, uv


def vase_texture(width: int = 256, height: int = 256) -> tuple[Ints, Ints]:
    """Painted bands: colours (height, width) as places in a palette (k, 3), top row first."""
    palette = np.array([[194, 91, 52], [32, 28, 30], [238, 222, 190], [126, 44, 30]])
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height)
    zigzag = abs((16 * x) % 2 - 1)
    image = np.zeros((height, width), np.int64)
    image[(y < 0.08) | (y > 0.93)] = 1
    image[(y > 0.12) & (y < 0.15) | (y > 0.85) & (y < 0.88)] = 3
    image[(y > 0.2) & (y < 0.32) & (y < 0.2 + 0.12 * zigzag)] = 1
    squares = (np.floor(16 * x) + np.floor(16 * y)) % 2 == 0
    image[(y > 0.375) & (y < 0.625)] = 2
    image[(y > 0.375) & (y < 0.625) & squares] = 1
    dots = np.hypot((12 * x) % 1 - 0.5, (12 * (y - 0.66)) % 1 - 0.5) < 0.32
    image[(y > 0.66) & (y < 0.66 + 1 / 6) & dots] = 2
    return image, palette
