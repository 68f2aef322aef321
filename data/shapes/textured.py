"""Surfaces with texture coordinates on corners, cut along seams."""

import numpy as np


def grid(nu, nv, closed_u, closed_v):
    """Vertices and faces of a grid, closed or not; texture coordinates (m, 3, 2) in the unit square."""
    nodes_u, nodes_v = nu + (not closed_u), nv + (not closed_v)
    i, j = np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij")
    i, j = i.ravel(), j.ravel()
    quads = np.stack([[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]])  # (4, 2, q)
    tris = np.concatenate([quads[[0, 1, 2]], quads[[0, 2, 3]]], axis=2).transpose(2, 0, 1)
    uv = tris / np.array([nu, nv])
    F = (tris[..., 0] % nodes_u) * nodes_v + tris[..., 1] % nodes_v
    u, v = np.meshgrid(np.arange(nodes_u) / nu, np.arange(nodes_v) / nv, indexing="ij")
    return np.stack([u.ravel(), v.ravel()], axis=1), F, uv


def cylinder(nu=24, nv=10, height=3.0):
    """An open tube with a seam from end to end: one chart, both of whose sides meet."""
    p, F, uv = grid(nu, nv, True, False)
    a = 2 * np.pi * p[:, 0]
    return np.stack([np.cos(a), np.sin(a), height * p[:, 1]], axis=1), F, uv


def torus(nu=40, nv=16):
    """Two seams that cross in one vertex, and one chart."""
    p, F, uv = grid(nu, nv, True, True)
    a, b = 2 * np.pi * p.T
    r = 2.0 + 0.7 * np.cos(b)
    return np.stack([r * np.cos(a), r * np.sin(a), 0.7 * np.sin(b)], axis=1), F, uv


def cube(n=6):
    """Six charts with gaps between them, three by two."""
    p, square, uv = grid(n, n, False, False)
    V, F, UV = [], [], []
    for k in range(6):
        axis, side = k // 2, k % 2
        x = np.insert(2 * p - 1, axis, 2.0 * side - 1, axis=1)
        ahead = np.cross(x[square[0, 1]] - x[square[0, 0]], x[square[0, 2]] - x[square[0, 0]])
        flip = ahead[axis] * (2 * side - 1) < 0
        F.append((square[:, ::-1] if flip else square) + len(p) * k)
        tile = (uv[:, ::-1] if flip else uv) * 0.9 + 0.05
        UV.append((tile + np.array([k % 3, k // 3])) / [3, 2])
        V.append(x)
    V, F, UV = np.concatenate(V), np.concatenate(F), np.concatenate(UV)
    _, first, same = np.unique(V.round(9), axis=0, return_index=True, return_inverse=True)
    return V[first], same.reshape(-1)[F], UV


def slit(n=12):
    """A flat square with a cut in its middle: a seam that ends inside on both sides, and jumps there."""
    p, F, uv = grid(n, n, False, False)
    V = np.column_stack([p, np.zeros(len(p))])
    values = uv.copy()
    middle = V[F].mean(axis=1)
    above = (middle[:, 1] > 0.5)[:, None] & np.isclose(uv[..., 1], 0.5)
    inside = (uv[..., 0] > 0.25 + 1e-9) & (uv[..., 0] < 0.75 - 1e-9)
    values[above & inside] += [0.0, 0.01]
    return V, F, values


CUTS, TWIST = np.radians([0.0, 12.0, 24.0]), 1.2


def star(rings=10):
    """A disc with three cuts from its centre that turn with the radius, and end before the rim.

    The data are the number of the sector between two cuts, up to where they end. Returns the sector of
    points too.
    """
    angles = np.radians([0, 12, 24, *range(40, 360, 20)])
    radii = np.arange(1, rings + 1) / rings
    turned = angles[None, :] + TWIST * radii[:, None]
    ring = np.stack([np.cos(turned), np.sin(turned)], axis=2) * radii[:, None, None]
    V = np.concatenate([np.zeros((1, 2)), ring.reshape(-1, 2)])
    m = len(angles)
    k, after = np.arange(m), (np.arange(m) + 1) % m
    F = [np.stack([0 * k, 1 + k, 1 + after], axis=1)]
    for r in range(rings - 1):
        a, b = 1 + m * r + k, 1 + m * r + after
        F += [np.stack([a, a + m, b + m], axis=1), np.stack([a, b + m, b], axis=1)]
    V, F = np.column_stack([V, np.zeros(len(V))]), np.concatenate(F)

    def sector(points):
        r = np.linalg.norm(points, axis=-1)
        angle = (np.arctan2(points[..., 1], points[..., 0]) - TWIST * r) % (2 * np.pi)
        return np.searchsorted(CUTS, angle).astype(float)

    fades = np.clip((0.75 - np.linalg.norm(V[F], axis=2)) / 0.2, 0, 1)
    return V, F, sector(V[F].mean(axis=1))[:, None] * fades, sector


def split_at_seams(V, F, uv):
    """The same with a vertex for every texture coordinate, as most file formats have it."""
    keys = np.concatenate([F.reshape(-1, 1), np.rint(uv.reshape(-1, 2) * 1e9)], axis=1)
    _, first, corner = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return V[F.ravel()[first]], corner.reshape(F.shape), uv.reshape(-1, 2)[first]
