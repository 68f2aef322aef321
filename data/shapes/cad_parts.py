"""CAD-like parts whose creases are known, clean and noisy; all closed, outward normals."""

from __future__ import annotations

import numpy as np

from . import basic
from .perturb import mean_edge, rotate
from .topology import edge_faces

Arrays = basic.Arrays

L_SHAPE = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], float)


def regular(n: int) -> np.ndarray:
    """Corners of a regular polygon of radius 1."""
    return np.stack([np.cos(basic.turn(n)), np.sin(basic.turn(n))], axis=1)


def rounded(segments: int, radius: float = 0.4) -> np.ndarray:
    """Rectangle of 3 by 2 with rounded corners, the arcs tangential and cut into segments."""
    t = np.linspace(0, np.pi / 2, segments + 1)
    arc = radius * np.stack([np.cos(t), np.sin(t)], axis=1)
    corners = []
    for k, (x, y) in enumerate([(1.5, 1), (-1.5, 1), (-1.5, -1), (1.5, -1)]):
        turned = arc @ np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), k)
        corners.append(turned + np.array([x - np.sign(x) * radius, y - np.sign(y) * radius]))
    return np.vstack(corners)


def prism(P: np.ndarray, height: float = 1.0, tilt=(0.0, 0.0), rows: int = 1) -> Arrays:
    """Prism over a polygon that is seen in full from (0.6, 0.6) or, if convex, from its middle."""
    n = len(P)
    levels = [np.column_stack([P + z * np.asarray(tilt), np.full(n, z)])
              for z in np.linspace(0, height, rows + 1)]  # fmt: skip
    middle = np.array([0.6, 0.6]) if P is L_SHAPE else P.mean(axis=0)
    ends = np.array([[*middle, 0], [*(middle + height * np.asarray(tilt)), height]])
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    F = [basic.fan(i, n * (rows + 1))[:, ::-1], basic.fan(i + n * rows, n * (rows + 1) + 1)]
    for k in range(rows):
        a, b = i + k * n, j + k * n
        F += [np.stack([a, b, b + n], axis=1), np.stack([a, b + n, a + n], axis=1)]
    return basic.arrays(np.vstack([*levels, ends]), np.vstack(F))


def chamfered_block(chamfer: float = 0.12, groove: float = 0.15) -> Arrays:
    """Block of 3 x 2 x 1.2 with two chamfered edges and a groove across the middle of its top."""
    c, g = chamfer, groove
    profile = np.array(
        [[1.5, 0.0], [1.5, 1.2 - c], [1.5 - c, 1.2], [g / 2, 1.2], [g / 2, 1.2 - g],
         [-g / 2, 1.2 - g], [-g / 2, 1.2], [c - 1.5, 1.2], [-1.5, 1.2 - c], [-1.5, 0.0]]
    )  # fmt: skip
    n = len(profile)
    V = np.vstack([np.insert(profile, 1, y, axis=1) for y in (-1.0, 1.0)])
    cap = np.array(  # fans over the two halves of the profile, and the piece below the groove
        [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 9], [9, 4, 5], [9, 5, 6], [9, 6, 7], [9, 7, 8]]
    )
    i = np.arange(n)
    j = (i + 1) % n
    sides = np.concatenate([np.stack([i, i + n, j + n], 1), np.stack([i, j + n, j], 1)])
    return basic.outward(V, np.concatenate([cap, cap[:, ::-1] + n, sides]))


def plate(n: int = 32, height: float = 0.5, m: int = 2) -> Arrays:
    """Square plate of side 4 with a round hole of radius 1; n a multiple of 8."""
    c = np.stack([np.cos(basic.turn(n)), np.sin(basic.turn(n))], axis=1)
    square = 2 * c / np.abs(c).max(axis=1, keepdims=True)
    # Share of the way from the circle to the square, and of the height: bottom, rim, top, hole.
    profile = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]], float)
    steps = np.arange(4 * m) / m
    out, up = (np.interp(steps, np.arange(5), column) for column in profile.T)
    rings = [np.column_stack([c + out * (square - c), np.full(n, up * height)])
             for out, up in zip(out, up, strict=True)]  # fmt: skip
    V = np.stack(rings, axis=1).reshape(-1, 3)
    return basic.outward(V, basic.wrapped_grid(n, 4 * m, True, True))


def hemisphere(n: int = 24, m: int = 6) -> Arrays:
    """Half of the unit sphere, closed by a disc."""
    latitudes = np.linspace(0, np.pi / 2, m + 1)[:-1]
    rings = [(0.5, 0.0), *zip(np.cos(latitudes), np.sin(latitudes), strict=True)]
    t = basic.turn(n)
    V = [np.stack([r * np.cos(t), r * np.sin(t), np.full(n, z)], axis=1) for r, z in rings]
    F, i, j = [], np.arange(n), np.roll(np.arange(n), -1)
    for k in range(len(rings) - 1):
        a, b = i + k * n, j + k * n
        F += [np.stack([a, b, b + n], axis=1), np.stack([a, b + n, a + n], axis=1)]
    poles = n * len(rings)
    F += [basic.fan(i, poles)[:, ::-1], basic.fan(i + n * (len(rings) - 1), poles + 1)]
    V.append(np.array([[0.0, 0, 0], [0, 0, 1]]))
    return basic.outward(*basic.arrays(np.vstack(V), np.vstack(F)))


def diagonal(V: np.ndarray) -> float:
    """Diagonal of the bounding box."""
    return float(np.linalg.norm(np.ptp(V, axis=0)))


def edge_turns(V: np.ndarray, F: np.ndarray) -> dict[tuple[int, int], float]:
    """Turn in degrees across every inner edge, by its sorted vertices."""
    N = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    N = N / np.linalg.norm(N, axis=1, keepdims=True)
    turns = {}
    for edge, faces in edge_faces(F).items():
        if len(faces) == 2:
            one, two = N[faces[0]], N[faces[1]]
            # By sine and cosine: an arc cosine has no digits near 0.
            sine = np.linalg.norm(np.cross(one, two))
            turns[tuple(sorted(edge))] = float(np.degrees(np.arctan2(sine, one @ two)))
    return turns


def creases_of(V: np.ndarray, F: np.ndarray, above: float = 40.0) -> set[tuple[int, int]]:
    """Edges of a clean part that turn by more than its tessellation does."""
    return {edge for edge, turn in edge_turns(V, F).items() if turn > above}


def roughened(V: np.ndarray, F: np.ndarray, noise: float, times: int = 2, seed: int = 0):
    """Cut faces into 4^times irregular ones and add noise; returns V, F and the creases.

    Vertices off the creases move inside their faces, by up to a quarter of their shortest edge in
    each direction, then all of them by `noise` mean edges in each coordinate (one sigma).
    """
    import igl

    for _ in range(times):
        V, F = igl.upsample(V, F)
    creases = creases_of(V, F)
    N = igl.per_vertex_normals(V, F)
    rng = np.random.default_rng(seed)
    shortest = np.full(len(V), np.inf)
    for a, b in zip(F.T, np.roll(F, 1, axis=1).T, strict=True):
        length = np.linalg.norm(V[a] - V[b], axis=1)
        np.minimum.at(shortest, a, length)
        np.minimum.at(shortest, b, length)
    D = rng.uniform(-0.25, 0.25, V.shape) * shortest[:, None]
    D -= (D * N).sum(axis=1, keepdims=True) * N
    D[np.unique(list(creases)).astype(int)] = 0
    return V + D + noise * mean_edge(V, F) * rng.normal(size=V.shape), F, creases


def turned(V: np.ndarray) -> np.ndarray:
    return rotate(V, (0.4, 0.9, -0.3))
