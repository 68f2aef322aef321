"""Kinds of random meshes: `KINDS` maps a name to a function of a random generator that returns V, F.

Each kind is one way in which real meshes are bad, of 1 to about 2,000 faces.  `distorted` then moves,
scales, tears and shuffles any of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from data.shapes import basic, cad_parts, nonmanifold
from data.shapes.basic import Arrays, arrays
from data.shapes.perturb import mean_edge, perturb, rotate, upsampled

CLOSED: tuple[Callable[[], Arrays], ...] = (
    basic.tetrahedron,
    basic.octahedron,
    basic.icosahedron,
    basic.icosphere,
    basic.torus,
    basic.closed_cylinder,
    basic.cone,
    basic.cube,
    basic.l_prism,
    basic.genus_2,
    basic.bipyramid,
)
OPEN: tuple[Callable[[], Arrays], ...] = (
    basic.square,
    basic.grid,
    basic.annulus,
    basic.cylinder,
    basic.sliver_fan,
    basic.planar_delaunay,
)
TIDY = CLOSED + OPEN


def pick(rng: Generator, makers: tuple[Callable[[], Arrays], ...] = TIDY) -> Arrays:
    """One of the shapes, sometimes cut finer and shaken."""
    V, F = makers[rng.integers(len(makers))]()
    if len(F) < 400 and rng.random() < 0.5:
        V, F = upsampled(V, F, noise=float(rng.uniform(0, 0.4)), seed=int(rng.integers(1 << 30)))
    return V, F


def log_uniform(rng: Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def size(rng: Generator, low: int, high: int) -> int:
    """Whole numbers, small ones more often."""
    return round(log_uniform(rng, low, high))


def put_together(parts: list[Arrays]) -> Arrays:
    starts = np.cumsum([0] + [len(V) for V, _ in parts])
    faces = [F + start for (_, F), start in zip(parts, starts, strict=False)]
    return np.vstack([V for V, _ in parts]), np.vstack(faces)


# --- one function per kind -----------------------------------------------------------------------


def soup(rng: Generator) -> Arrays:
    """Faces between random vertices: edges of any number of faces, everything crosses."""
    n = size(rng, 4, 200)
    return rng.normal(size=(n, 3)), rng.integers(n, size=(size(rng, 2, 300), 3))


def loose_triangles(rng: Generator) -> Arrays:
    """Faces that share nothing, as in a file of triangles that were never joined."""
    m = size(rng, 1, 300)
    middle = rng.normal(size=(m, 1, 3))
    V = middle + log_uniform(rng, 0.01, 1) * rng.normal(size=(m, 3, 3))
    return V.reshape(-1, 3), np.arange(3 * m).reshape(m, 3)


def noisy_delaunay(rng: Generator) -> Arrays:
    """Random points in a square, lifted at random: from terrain to needles on end."""
    V, F = basic.planar_delaunay(size(rng, 4, 900), int(rng.integers(1 << 30)))
    V[:, 2] = log_uniform(rng, 1e-3, 1) * rng.normal(size=len(V))
    return V, F


def flipped_windings(rng: Generator) -> Arrays:
    """An orientable shape whose faces face this way and that."""
    V, F = pick(rng)
    flip = rng.random(len(F)) < rng.uniform(0, 1)
    return V, np.where(flip[:, None], F[:, ::-1], F)


def glued_complex(rng: Generator) -> Arrays:
    """Sheets that meet in edges of three faces and more."""
    choice = rng.integers(4)
    if choice == 0:
        return nonmanifold.book(int(rng.integers(3, 9)), int(rng.integers(1, 7)))
    if choice == 1:
        labels = rng.integers(3, size=tuple(rng.integers(1, 4, size=3)))
        labels.flat[0] = 1
        return nonmanifold.interfaces(labels, int(rng.integers(1, 4)))
    if choice == 2:
        return nonmanifold.double_bubble(size(rng, 8, 40), size(rng, 4, 14))
    parts = [pick(rng) for _ in range(2)]  # joined along an edge of each
    (V, F), (W, G) = parts
    a, b = F[rng.integers(len(F)), :2]
    c, d = G[rng.integers(len(G)), :2]
    names = len(V) + np.arange(len(W))
    names[c], names[d] = a, b
    return np.vstack([V, W + (V[a] - W[c])]), np.vstack([F, names[G]])


def big_fan(rng: Generator) -> Arrays:
    """One vertex of up to 5,000 neighbours: flat, a cone, or a wavy disc."""
    n = 5000 if rng.random() < 0.1 else size(rng, 3, 1500)
    t = basic.turn(n)
    wave = rng.choice([0.0, 0.07, 0.5]) * np.cos(3 * t)
    rim = np.column_stack([np.cos(t), np.sin(t), wave])
    tip = [0.0, 0.0, rng.choice([0.0, 0.3, 3.0])]
    return np.vstack([rim, [tip]]), basic.fan(np.arange(n), n)


def needles(rng: Generator) -> Arrays:
    """A strip whose faces are up to a million times longer than wide."""
    columns, aspect = size(rng, 2, 120), log_uniform(rng, 1, 1e6)
    i = np.arange(columns - 1)
    x = np.sort(rng.random(columns)) if rng.random() < 0.3 else np.linspace(0, 1, columns)
    height = aspect / (columns - 1)
    V = np.vstack([np.column_stack([x, 0 * x + y, 0 * x]) for y in (0, height)])
    F = np.vstack(
        [
            np.column_stack([i, i + 1, i + columns + 1]),
            np.column_stack([i, i + columns + 1, i + columns]),
        ]
    )
    return V, F


def voxel_surface(rng: Generator) -> Arrays:
    """Cubes at random, which meet in edges and corners, or a smooth body of cubes."""
    n = int(rng.integers(1, 8))
    if rng.random() < 0.5:
        solid = rng.random((n, n, n)) < rng.uniform(0.1, 0.9)
    else:
        x = np.linspace(-1, 1, n + 2)
        solid = x[:, None, None] ** 2 + x[:, None] ** 2 + x**2 < rng.uniform(0.3, 1.5)
    solid.flat[0] = True
    return basic.voxels(solid)


def tiny_components(rng: Generator) -> Arrays:
    """Up to a thousand small closed or open parts, far from each other or not."""
    V, F = TIDY[rng.integers(3)]() if rng.random() < 0.6 else basic.square()
    n = size(rng, 2, 4000 // len(F))
    middle = rng.normal(size=(n, 1, 3)) * log_uniform(rng, 1, 1000)
    stretch = np.exp(rng.normal(size=(n, 1, 1)) * rng.uniform(0, 2))
    faces = F[None] + len(V) * np.arange(n)[:, None, None]
    return (middle + stretch * V).reshape(-1, 3), faces.reshape(-1, 3)


def sphere_rags(rng: Generator) -> Arrays:
    """Some faces of a sphere: rags that hang together by single vertices."""
    V, F = basic.icosphere(int(rng.integers(1, 4)))
    chosen = rng.random(len(F)) < rng.uniform(0.1, 0.95)
    chosen[rng.integers(len(F))] = True
    return V, F[chosen]


def doubled_faces(rng: Generator) -> Arrays:
    """Faces that come twice, the same way or the other way round."""
    V, F = pick(rng)
    again = F[rng.random(len(F)) < rng.uniform(0, 1)]
    opposite = rng.random(len(again)) < rng.choice([0.0, 0.5, 1.0])
    return V, np.vstack([F, np.where(opposite[:, None], again[:, ::-1], again)])


def flat_faces(rng: Generator) -> Arrays:
    """Caps, flaps and points: faces without area between others, as booleans leave them."""
    V, F = pick(rng)
    points, faces = V.tolist(), F.tolist()
    for f in rng.choice(len(F), min(len(F), size(rng, 1, 20)), replace=False):
        a, b, c = (int(v) for v in np.roll(F[f], rng.integers(3)))
        m, at = len(points), rng.choice([0.0, 0.3, 0.5, 1.0])
        points.append(((1 - at) * np.array(V[a]) + at * np.array(V[b])).tolist())
        way = rng.integers(3)
        if way == 0:  # the face is cut in two, and a cap ties its edge to the next face
            faces[f] = [a, m, c]
            faces += [[m, b, c], [a, b, m]]
        elif way == 1:  # a flap on the edge
            faces.append([a, b, m])
        else:  # a flap of two faces
            faces += [[a, b, m], [b, a, m]]
    return arrays(points, faces)


def t_junctions(rng: Generator) -> Arrays:
    """Faces cut on one side of an edge only."""
    V, F = pick(rng)
    points, faces = V.tolist(), F.tolist()
    for f in rng.choice(len(F), min(len(F), size(rng, 1, 30)), replace=False):
        a, b, c = (int(v) for v in F[f])
        points.append((0.5 * (V[a] + V[b])).tolist())
        faces[f] = [a, len(points) - 1, c]
        faces.append([len(points) - 1, b, c])
    return arrays(points, faces)


def pinched(rng: Generator) -> Arrays:
    """Vertices that are one and should be two."""
    V, F = put_together([pick(rng), pick(rng)]) if rng.random() < 0.5 else pick(rng)
    names = np.arange(len(V))
    for _ in range(size(rng, 1, 8)):
        a, b = rng.integers(len(V), size=2)
        names[a] = names[b]
    return V, names[F]


def nested_and_crossing(rng: Generator) -> Arrays:
    """Closed parts inside each other, or through each other."""
    parts = []
    for _ in range(int(rng.integers(2, 4))):
        V, F = pick(rng, CLOSED)
        V = rotate(V, rng.normal(size=3)) * log_uniform(rng, 0.3, 2) + 0.4 * rng.normal(size=3)
        parts.append((V, F if rng.random() < 0.8 else F[:, ::-1]))
    return put_together(parts)


def thin_walls(rng: Generator) -> Arrays:
    """Plates and tubes much thinner than their faces are long."""
    thickness = log_uniform(rng, 1e-5, 0.3)
    if rng.random() < 0.5:
        return basic.thin_sheet(int(rng.integers(2, 15)), thickness)
    n, height = size(rng, 8, 150), log_uniform(rng, 0.05, 4)
    t, i = basic.turn(n), np.arange(n)
    j, P = (i + 1) % n, np.column_stack([np.cos(t), np.sin(t)])
    rings = [
        np.column_stack([r * P, 0 * t + h]) for h in (0.0, height) for r in (1.0, 1.0 - thickness)
    ]
    faces = []
    for a, b in ((0, 2), (3, 1), (2, 3), (1, 0)):
        faces += [
            np.column_stack([a * n + i, a * n + j, b * n + j]),
            np.column_stack([a * n + i, b * n + j, b * n + i]),
        ]
    return np.vstack(rings), np.vstack(faces)


def coincident(rng: Generator) -> Arrays:
    """A mesh torn along some edges, with two vertices in each place; or all faces apart."""
    V, F = pick(rng)
    corners = np.arange(3 * len(F))
    torn = rng.random(3 * len(F)) < rng.choice([0.02, 0.3, 1.0])
    names = F.ravel().copy()
    names[torn] = len(V) + corners[torn]
    return np.vstack([V, V[F.ravel()]]), names.reshape(-1, 3)


def one_sided(rng: Generator) -> Arrays:
    """Moebius strips and Klein bottles."""
    n, m = int(rng.integers(5, 40)), int(rng.integers(2, 8))
    if rng.random() < 0.5:
        return basic.moebius(n, m)
    n, m = max(n, 6), max(m, 5)
    u, v = (x.ravel() for x in np.meshgrid(basic.turn(n), basic.turn(m), indexing="ij"))
    r = 2 + np.cos(u / 2) * np.sin(v) - np.sin(u / 2) * np.sin(2 * v)
    z = np.sin(u / 2) * np.sin(v) + np.cos(u / 2) * np.sin(2 * v)
    faces = []
    for i in range(n):
        for j in range(m):
            # The last row meets the first one the other way round.
            ends = [(k % n, (-q if k == n else q) % m) for k, q in ((i, j), (i + 1, j))]
            ends += [(k % n, (-q if k == n else q) % m) for k, q in ((i + 1, j + 1), (i, j + 1))]
            a, b, c, d = (k * m + q for k, q in ends)
            faces += [[a, b, c], [a, c, d]]
    return arrays(np.column_stack([r * np.cos(u), r * np.sin(u), z]), faces)


def one_triangle(rng: Generator) -> Arrays:
    """One face: any, a needle, a cap, or two of them back to back."""
    V = rng.normal(size=(3, 3))
    way = rng.integers(4)
    if way == 1:
        V[1] = V[0] + log_uniform(rng, 1e-9, 0.1) * (V[1] - V[0])
    if way == 2:
        V[2] = 0.5 * (V[0] + V[1]) + log_uniform(rng, 1e-9, 0.1) * (V[2] - V[0])
    return arrays(V, [[0, 1, 2], [2, 1, 0]] if way == 3 else [[0, 1, 2]])


def fine_rims(rng: Generator) -> Arrays:
    """Coins, cones and spikes: rims much finer than the faces beside them are long."""
    n, height = size(rng, 8, 500), log_uniform(rng, 0.02, 10)
    t, i = basic.turn(n), np.arange(n)
    j = (i + 1) % n
    rim = np.column_stack([np.cos(t), np.sin(t), 0 * t])
    if rng.random() < 0.5:
        V = np.vstack([rim, [[0, 0, height], [0, 0, 0]]])
        return V, np.vstack(
            [np.column_stack([i, j, 0 * i + n]), np.column_stack([j, i, 0 * i + n + 1])]
        )
    V = np.vstack([rim, rim + np.array([0, 0, height])])
    walls = [np.column_stack([i, j, j + n]), np.column_stack([i, j + n, i + n])]
    cap = np.column_stack([0 * i[1:-1], i[1:-1], i[1:-1] + 1])
    return V, np.vstack([*walls, cap[:, ::-1], cap + n])


def part(rng: Generator) -> Arrays:
    """Parts with creases of few, long faces."""
    way = rng.integers(3)
    if way == 0:
        return cad_parts.plate(size(rng, 6, 64), log_uniform(rng, 0.05, 2), int(rng.integers(1, 4)))
    if way == 1:
        outline = cad_parts.rounded(size(rng, 2, 16))
        return cad_parts.prism(outline, log_uniform(rng, 0.05, 5), rows=int(rng.integers(1, 4)))
    return cad_parts.hemisphere(size(rng, 6, 40), size(rng, 3, 10))


def shaken(rng: Generator) -> Arrays:
    """Any tidy shape, its vertices moved at random until faces fold."""
    V, F = pick(rng)
    return perturb(V, F, log_uniform(rng, 0.01, 0.5), int(rng.integers(1 << 30)))


def tidy(rng: Generator) -> Arrays:
    """Nothing wrong at all."""
    return pick(rng)


KINDS: dict[str, Callable[[Generator], Arrays]] = {
    make.__name__: make
    for make in (
        soup,
        loose_triangles,
        noisy_delaunay,
        flipped_windings,
        glued_complex,
        big_fan,
        needles,
        voxel_surface,
        tiny_components,
        sphere_rags,
        doubled_faces,
        flat_faces,
        t_junctions,
        pinched,
        nested_and_crossing,
        thin_walls,
        coincident,
        one_sided,
        one_triangle,
        fine_rims,
        part,
        shaken,
        tidy,
    )
}


# --- what may happen to any of them --------------------------------------------------------------


def distorted(rng: Generator, V: np.ndarray, F: np.ndarray) -> Arrays:
    """Sometimes stretched, torn, shuffled, scaled, moved far away, or with vertices of no face."""
    chance = rng.random(8)
    if chance[0] < 0.1:
        V = V * np.exp(rng.normal(size=3) * 2)
    if chance[1] < 0.1:
        V = rotate(V, rng.normal(size=3))
    if chance[2] < 0.05 and len(F) > 3:
        F = F[np.sort(rng.choice(len(F), size(rng, 1, len(F)), replace=False))]
    if chance[3] < 0.05:
        V = V + 0.3 * mean_edge(V, F) * rng.normal(size=V.shape)
    if chance[4] < 0.15:
        order, turned = rng.permutation(len(V)), rng.integers(3, size=len(F))
        V, F = V[np.argsort(order)], order[F]
        F = np.take_along_axis(F, (np.arange(3) + turned[:, None]) % 3, axis=1)
        F = F[rng.permutation(len(F))]
    if chance[5] < 0.05:
        V = np.vstack([V, 1e3 * rng.normal(size=(3, 3))])
    if chance[6] < 0.15:
        V = V * 10.0 ** int(rng.integers(-12, 13))
    if chance[7] < 0.1:
        extent = np.ptp(V, axis=0).max()
        V = V + rng.normal(size=3) * extent * log_uniform(rng, 1, 1e9)
    return np.ascontiguousarray(V), np.ascontiguousarray(F, dtype=np.int64)
