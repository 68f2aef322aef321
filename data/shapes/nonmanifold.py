"""Surfaces with edges of three faces and more, and what is known of them.

`COMPLEXES` are meshes whose sheets meet in junction curves; `Complex` says what a remeshing must keep.
`interfaces` makes the walls between labelled cells, as in foams and multi-material parts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from . import basic
from .solids import welded

Arrays = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Complex:
    """How to make a mesh, and what is true of it.

    Parameters
    ----------
    make : callable
    size : float
        Extent of the smallest sheet; target lengths are given as shares of it.
    curves : dict
        Number of junction curves by their number of sheets.
    junctions : int
        Vertices where junction curves meet or end.
    corners : (k, 3) float
        Sharp corners of sheets and of junction curves.
    euler_numbers : list of int
        Of the patches, sorted.
    loops : int
        Connected pieces of the boundary.
    straight : bool
        All sheets are plane and all their borders straight.
    radius : float
        Smallest radius of what is not straight.
    """

    make: Callable[[], Arrays]
    curves: dict[int, int]
    junctions: int
    corners: np.ndarray
    euler_numbers: list[int]
    loops: int = 0
    straight: bool = True
    radius: float = 1.0
    size: float = 1.0
    closed_curves: int = field(default=0)


# --- makers --------------------------------------------------------------------------------------


def sheet(origin, u, v, n: int, m: int) -> Arrays:
    """Parallelogram of n times m cells, diagonals at random (the same ones every time)."""
    V, F = basic.grid(n + 1, m + 1)
    s, t = V[:, 0] / n, V[:, 1] / m
    return np.asarray(origin, float) + np.outer(s, u) + np.outer(t, v), F


def book(pages: int = 5, n: int = 5) -> Arrays:
    """Pages of width 1 and height 1 on the spine x = y = 0, at uneven angles."""
    angles = basic.turn(pages) + 0.1 * np.sin(np.arange(pages))
    return welded([sheet([0, 0, 0], [np.cos(t), np.sin(t), 0], [0, 0, 1], n, n) for t in angles])


def book_corners(pages: int = 5) -> np.ndarray:
    angles = basic.turn(pages) + 0.1 * np.sin(np.arange(pages))
    rim = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    return np.vstack([[[0, 0, 0], [0, 0, 1]], rim, rim + np.array([0, 0, 1])])


def interfaces(labels, n: int = 4) -> Arrays:
    """Walls between unit cells of different labels (0: outside), each of n times n cells."""
    labels = np.pad(np.atleast_3d(np.array(labels, dtype=int)), 1)
    walls = []
    for axis in range(3):
        shifted = np.roll(labels, -1, axis=axis)
        u, v = np.delete(np.eye(3), axis, axis=0)
        for cell in np.argwhere(labels != shifted):
            if cell[axis] < labels.shape[axis] - 1:
                V, F = sheet(cell + np.eye(3)[axis] - 1, u, v, n, n)
                outward = labels[tuple(cell)] > shifted[tuple(cell)]
                walls.append((V, F if outward == (axis != 1) else F[:, ::-1]))
    return welded(walls)


def cell_corners(labels) -> np.ndarray:
    """Corners of all cells that are not outside: in the shapes here each is a corner of a wall."""
    cells = np.argwhere(np.atleast_3d(np.array(labels, dtype=int)))
    offsets = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1]), axis=-1).reshape(-1, 3)
    return np.unique((cells[:, None] + offsets).reshape(-1, 3), axis=0).astype(float)


def wall_across(n: int = 4) -> Arrays:
    """Square floor; a wall over its middle line, from rim to rim."""
    return welded(
        [
            sheet([-1, -1, 0], [2, 0, 0], [0, 2, 0], 2 * n, 2 * n),
            sheet([0, -1, 0], [0, 2, 0], [0, 0, 1], 2 * n, n),
        ]
    )


def wall_inside(n: int = 4) -> Arrays:
    """Square floor; a wall that stands on it and ends inside."""
    return welded(
        [
            sheet([-1, -1, 0], [2, 0, 0], [0, 2, 0], 2 * n, 2 * n),
            sheet([0, -0.5, 0], [0, 1, 0], [0, 0, 1], n, n),
        ]
    )


def crossing_planes(planes: int = 2, n: int = 3) -> Arrays:
    """Squares of side 2 in two or three coordinate planes; four faces at every common edge."""
    u = np.eye(3)
    pairs = [(1, 2), (0, 1), (0, 2)][:planes]
    return welded([sheet(-u[a] - u[b], 2 * u[a], 2 * u[b], 2 * n, 2 * n) for a, b in pairs])


def crossing_corners(planes: int) -> np.ndarray:
    signs = np.array([(a, b) for a in (-1, 1) for b in (-1, 1)], float)
    zeros = [0, 2, 1][:planes]
    rims = [np.insert(signs, axis, 0.0, axis=1) for axis in zeros]
    ends = np.eye(3) if planes == 3 else np.array([[0, 1.0, 0]])
    return np.vstack([*rims, ends, -ends])


def half_discs(n: int = 24, rings: int = 6) -> Arrays:
    """Three half-discs of radius 1 on the line from (-1, 0, 0) to (1, 0, 0)."""
    r, t = np.meshgrid(
        np.linspace(0, 1, rings + 1)[1:], np.pi * np.arange(n + 1) / n, indexing="ij"
    )
    x, y = (r * np.cos(t)).ravel(), (r * np.sin(t)).ravel()
    y[np.abs(y) < 1e-12] = 0
    F = basic.wrapped_grid(rings, n + 1, False, False)
    middle = np.stack([np.arange(n), np.arange(1, n + 1), np.full(n, len(x))], axis=1)
    x, y, F = np.append(x, 0), np.append(y, 0), np.vstack([F, middle])
    return welded([(np.stack([x, y * np.cos(a), y * np.sin(a)], axis=1), F) for a in basic.turn(3)])


def double_bubble(n: int = 40, m: int = 14) -> Arrays:
    """Two unit spheres whose centres are 1 apart, and the wall in the circle where they meet.

    The three sheets meet at 120 degrees, as soap films do.
    """
    t = np.linspace(np.pi / 3, np.pi, m + 1)
    cap = np.stack([np.cos(t) - 0.5, np.sin(t)], axis=1)
    cap[0], cap[-1] = (0, np.sqrt(0.75)), (-1.5, 0)
    disc = np.stack([np.zeros(m // 2 + 1), np.linspace(np.sqrt(0.75), 0, m // 2 + 1)], axis=1)
    return welded([revolved(P, n) for P in (cap, cap * [-1, 1], disc)])


def revolved(profile: np.ndarray, n: int) -> Arrays:
    """Turn a polyline (x, radius) that ends on the axis around it."""
    x, r = profile[:-1].T
    s = basic.turn(n)
    V = np.stack([np.tile(x, n), np.outer(np.cos(s), r).ravel(), np.outer(np.sin(s), r).ravel()], 1)
    m = len(x)
    F = basic.wrapped_grid(n, m, True, False)
    return np.vstack([V, [[profile[-1, 0], 0, 0]]]), np.vstack(
        [F, basic.fan(np.arange(n) * m + m - 1, n * m)]
    )


TWO_CUBES = [[1], [2]]
FOUR_CUBES = [[1, 2], [3, 4]]
SQUARE_CORNERS = np.array([(a, b, 0) for a in (-1, 1) for b in (-1, 1)], float)

COMPLEXES: dict[str, Complex] = {
    "half_discs": Complex(
        half_discs, {3: 1}, 2, np.array([[-1, 0, 0], [1, 0, 0]], float), [1, 1, 1], loops=1,
        straight=False,
    ),
    "book": Complex(book, {5: 1}, 2, book_corners(), [1] * 5, loops=1),
    "two_cubes": Complex(
        lambda: interfaces(TWO_CUBES), {3: 1}, 0, cell_corners(TWO_CUBES), [1, 1, 1],
        closed_curves=1,
    ),
    "four_cubes": Complex(
        lambda: interfaces(FOUR_CUBES), {3: 4, 4: 1}, 2, cell_corners(FOUR_CUBES), [1] * 8,
    ),
    "wall_across": Complex(
        wall_across, {3: 1}, 2,
        np.vstack([SQUARE_CORNERS, [(0, y, z) for y in (-1, 1) for z in (0, 1)]]), [1, 1, 1],
        loops=1,
    ),
    "wall_inside": Complex(
        wall_inside, {3: 1}, 2,
        np.vstack([SQUARE_CORNERS, [(0, y, z) for y in (-0.5, 0.5) for z in (0, 1)]]), [0, 1],
        loops=2,
    ),
    "two_planes": Complex(
        crossing_planes, {4: 1}, 2, crossing_corners(2), [1] * 4, loops=1
    ),
    "three_planes": Complex(
        lambda: crossing_planes(3), {4: 6}, 7, crossing_corners(3), [1] * 12, loops=1
    ),
    "double_bubble": Complex(
        double_bubble, {3: 1}, 0, np.zeros((0, 3)), [1, 1, 1], straight=False,
        radius=float(np.sqrt(0.75)), closed_curves=1,
    ),
}  # fmt: skip
