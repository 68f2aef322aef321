"""Small meshes that every property can be tried on: clean ones, open ones, and all kinds of dirt."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .topology import volume

Arrays = tuple[np.ndarray, np.ndarray]


def arrays(V, F) -> Arrays:
    """Turn lists into float64 and int64 arrays."""
    return np.array(V, dtype=float).reshape(-1, 3), np.array(F, dtype=np.int64).reshape(-1, 3)


def triangle() -> Arrays:
    return arrays([[0, 0, 0], [1, 0, 0], [0.5, 0.8, 0]], [[0, 1, 2]])


def square() -> Arrays:
    return arrays([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])


def tetrahedron() -> Arrays:
    V = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    return arrays(V, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


def octahedron() -> Arrays:
    V = np.vstack([np.eye(3), -np.eye(3)])
    top = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]]
    return arrays(V, top + [[b, a, 5] for a, b, _ in top])


def icosahedron() -> Arrays:
    import igl

    return outward(*igl.icosahedron())


def icosphere(n: int = 2) -> Arrays:
    """Unit sphere, 20 * 4^n faces."""
    import igl

    V, F = icosahedron()
    for _ in range(n):
        V, F = igl.upsample(V, F)
        V /= np.linalg.norm(V, axis=1, keepdims=True)
    return V, F


def wrapped_grid(n: int, m: int, wrap_n: bool, wrap_m: bool) -> np.ndarray:
    """Faces of an n times m grid of vertices, closed up in one or both directions."""
    i, j = np.meshgrid(np.arange(n - (not wrap_n)), np.arange(m - (not wrap_m)), indexing="ij")
    i, j = i.ravel(), j.ravel()
    k, h = (i + 1) % n, (j + 1) % m
    a, b, c, d = i * m + j, k * m + j, k * m + h, i * m + h
    return np.vstack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def torus(n: int = 16, m: int = 8, radius: float = 0.4) -> Arrays:
    """Ring of radius 1, tube of the given radius."""
    s, t = np.meshgrid(turn(n), turn(m), indexing="ij")
    r = 1 + radius * np.cos(t)
    V = np.stack([r * np.cos(s), r * np.sin(s), radius * np.sin(t)], axis=-1).reshape(-1, 3)
    return outward(V, wrapped_grid(n, m, True, True))


def turn(n: int) -> np.ndarray:
    """Angles of n points on a circle."""
    return 2 * np.pi * np.arange(n) / n


def grid(n: int = 7, m: int = 5, seed: int = 0) -> Arrays:
    """Flat open rectangle of n times m vertices, unit spacing, random diagonals, normals +z."""
    F = wrapped_grid(n, m, False, False)
    k = np.random.default_rng(seed).random(len(F) // 2) < 0.5
    lower, upper = F[: len(F) // 2].copy(), F[len(F) // 2 :].copy()
    lower[k, 2], upper[k, 0] = upper[k, 2], lower[k, 1]
    x, y = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    return arrays(np.stack([x, y, 0 * x], axis=-1), np.vstack([lower, upper]))


def annulus(n: int = 16, m: int = 4) -> Arrays:
    """Flat ring, radii 1 to 2."""
    t, r = np.meshgrid(turn(n), np.linspace(2, 1, m), indexing="ij")
    V = np.stack([r * np.cos(t), r * np.sin(t), 0 * t], axis=-1).reshape(-1, 3)
    return arrays(V, wrapped_grid(n, m, True, False))


def cylinder(n: int = 12, m: int = 5) -> Arrays:
    """Open tube of radius 1 along z, height 2."""
    t, z = np.meshgrid(turn(n), np.linspace(0, 2, m), indexing="ij")
    V = np.stack([np.cos(t), np.sin(t), z], axis=-1).reshape(-1, 3)
    return arrays(V, wrapped_grid(n, m, True, False))


def closed_cylinder(n: int = 12, m: int = 5) -> Arrays:
    V, F = cylinder(n, m)
    low, high = np.arange(n) * m, np.arange(n) * m + m - 1
    caps = [fan(low, len(V))[:, ::-1], fan(high, len(V) + 1)]
    return np.vstack([V, [[0, 0, 0], [0, 0, 2]]]), np.vstack([F, *caps])


def fan(rim: np.ndarray, centre: int) -> np.ndarray:
    """Faces that join a closed polyline to one vertex."""
    return np.stack([rim, np.roll(rim, -1), np.full(len(rim), centre)], axis=1)


def cone(n: int = 16) -> Arrays:
    """Closed cone of radius 1 and height 1.5."""
    return bipyramid(n, top=1.5, bottom=0.0)


def bipyramid(n: int = 50, top: float = 0.1, bottom: float = -0.1) -> Arrays:
    """Two tips of valence n over one rim."""
    V = np.stack([np.cos(turn(n)), np.sin(turn(n)), np.zeros(n)], axis=1)
    F = np.vstack([fan(np.arange(n), n), fan(np.arange(n), n + 1)[:, ::-1]])
    return np.vstack([V, [[0, 0, top], [0, 0, bottom]]]), F


def sliver_fan(n: int = 50) -> Arrays:
    """Flat disc squeezed to a tenth, one inner vertex of valence n."""
    V = np.stack([np.cos(turn(n)), 0.1 * np.sin(turn(n)), np.zeros(n)], axis=1)
    return np.vstack([V, [[0.3, 0, 0]]]), fan(np.arange(n), n)


def disc(n: int, radius: float = 1.0) -> Arrays:
    """Flat disc, a fan of n faces."""
    return fan_inside(radius * np.stack([np.cos(turn(n)), np.sin(turn(n))], axis=1))


def polygon(points, spacing: float) -> Arrays:
    """Flat disc inside a polygon, each side cut into equal edges of about a spacing."""
    P = np.array(points, float)
    rim = []
    for a, b in zip(P, np.roll(P, -1, axis=0), strict=True):
        n = max(1, round(np.linalg.norm(b - a) / spacing))
        rim += [a + (b - a) * i / n for i in range(n)]
    return fan_inside(np.array(rim))


def fan_inside(rim: np.ndarray) -> Arrays:
    """Join a plane rim (n, 2) to one vertex: to (0.7, 0.7) if it lies in the first quadrant."""
    middle = [0.7, 0.7] if rim.min() >= 0 else rim.mean(axis=0)
    V = np.vstack([rim, middle])
    return np.column_stack([V, np.zeros(len(V))]), fan(np.arange(len(rim)), len(rim))


def l_prism() -> Arrays:
    """Prism over an L: planar faces, convex and concave creases."""
    base = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]
    caps = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]])
    a, b = np.arange(6), np.roll(np.arange(6), -1)
    V = np.vstack([np.column_stack([base, np.full(6, z)]) for z in (0, 1.5)])
    walls = [np.stack([a, b, b + 6], axis=1), np.stack([a, b + 6, a + 6], axis=1)]
    return arrays(V, np.vstack([caps[:, ::-1], caps + 6, *walls]))


def moebius(n: int = 20, m: int = 4) -> Arrays:
    """Moebius strip: no orientation fits."""
    s, w = np.meshgrid(turn(n), np.linspace(-0.4, 0.4, m), indexing="ij")
    r = 1 + w * np.cos(s / 2)
    V = np.stack([r * np.cos(s), r * np.sin(s), w * np.sin(s / 2)], axis=-1).reshape(-1, 3)
    F = wrapped_grid(n, m, True, False)
    last = (F // m == n - 1).any(axis=1)[:, None] & (m > F)  # across the seam: other side
    return V, np.where(last, m - 1 - F, F)


def outward(V: np.ndarray, F: np.ndarray) -> Arrays:
    """Turn all faces where the enclosed volume is negative."""
    return V, F if volume(V, F) > 0 else F[:, ::-1].copy()


def voxels(solid) -> Arrays:
    """Surface of the unit cubes where `solid` (a 2D or 3D array) is true, outward normals."""
    solid = np.pad(np.atleast_3d(np.array(solid, dtype=bool)), 1)
    index: dict[tuple[int, ...], int] = {}
    faces = []
    for cell in np.argwhere(solid):
        for axis in range(3):
            for step in (0, 1):
                across = cell.copy()
                across[axis] += 2 * step - 1
                if solid[tuple(across)]:
                    continue
                quad = []
                for q in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    offset = np.insert(q, axis, step)
                    quad.append(index.setdefault(tuple(cell - 1 + offset), len(index)))
                quad = quad if (step == 1) == (axis != 1) else quad[::-1]
                faces += [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
    return arrays(list(index), faces)


def cube() -> Arrays:
    return voxels([[1]])


def genus_2() -> Arrays:
    return voxels([[1, 1, 1, 1, 1], [1, 0, 1, 0, 1], [1, 1, 1, 1, 1]])


def genus_3() -> Arrays:
    return voxels([[1, 1, 1, 1, 1, 1, 1], [1, 0, 1, 0, 1, 0, 1], [1, 1, 1, 1, 1, 1, 1]])


def two_cubes_on_an_edge() -> Arrays:
    return voxels([[1, 0], [0, 1]])


def two_components() -> Arrays:
    return joined(tetrahedron(), octahedron(), shift=4.0)


def joined(one: Arrays, two: Arrays, shift: float) -> Arrays:
    """Put two meshes into one, the second moved along x."""
    return np.vstack([one[0], two[0] + [shift, 0, 0]]), np.vstack([one[1], two[1] + len(one[0])])


def bowtie() -> Arrays:
    """Two triangles with one common vertex."""
    V = [[0, 0, 0], [1, -0.5, 0], [1, 0.5, 0], [-1, 0.5, 0], [-1, -0.5, 0]]
    return arrays(V, [[0, 1, 2], [0, 3, 4]])


def pinched_tetrahedra() -> Arrays:
    """Two closed tetrahedra with one common vertex."""
    V, F = joined(tetrahedron(), (-tetrahedron()[0], tetrahedron()[1][:, ::-1]), shift=2.0)
    V[4:] += [0, 2, 2]  # vertex 4 = -vertex 0 + (2, 2, 2) now lies on vertex 0
    F[F == 4] = 0
    return np.delete(V, 4, axis=0), np.where(F > 4, F - 1, F)


def three_half_discs(n: int = 6) -> Arrays:
    """Three half-discs on one line of two edges: non-manifold edges, as where soap films meet."""
    V, F = [[0, 0, 0], [1, 0, 0], [-1, 0, 0]], []
    t = np.pi * np.arange(1, n) / n
    for angle in turn(3):
        rim = [1, *range(len(V), len(V) + n - 1), 2]
        y, z = np.sin(t) * np.cos(angle), np.sin(t) * np.sin(angle)
        V += np.stack([np.cos(t), y, z], axis=1).tolist()
        F += [[0, a, b] for a, b in pairwise(rim)]
    return arrays(V, F)


def inconsistent_winding() -> Arrays:
    V, F = grid()
    F[::3] = F[::3, ::-1]
    return V, F


def duplicate_face() -> Arrays:
    V, F = tetrahedron()
    return V, np.vstack([F, F[0, [1, 2, 0]]])


def repeated_index() -> Arrays:
    V, F = square()
    return V, np.vstack([F, [[0, 0, 1], [2, 2, 2]]])


def flat_cap() -> Arrays:
    """Square with a face of no area along its diagonal."""
    V, _ = square()
    return arrays([*V, [0.5, 0.5, 0]], [[0, 1, 2], [0, 2, 4], [0, 4, 3], [4, 2, 3]])


def coincident_vertices() -> Arrays:
    """Like `flat_cap`, but two vertices of the flat faces are at the same place."""
    V, F = flat_cap()
    V[4] = V[0]
    return V, F


def unreferenced_vertices() -> Arrays:
    """Octahedron between vertices that no face uses, one of them far away."""
    V, F = octahedron()
    V = np.vstack([[[9e3, 0, 0]], V[:3], [[0, 0, 0]], V[3:], [[1, 1, 1]]])
    return V, np.where(F < 3, F + 1, F + 2)


def thin_sheet(n: int = 10, thickness: float = 0.02) -> Arrays:
    """Two square grids of unit spacing, back to back, joined by a rim."""
    import igl

    V, F = grid(n, n)
    rim = np.asarray(igl.boundary_loop(F))
    a, b = rim, np.roll(rim, -1)
    walls = [np.stack([b, a, a + len(V)], axis=1), np.stack([b, a + len(V), b + len(V)], axis=1)]
    return np.vstack([V, V - [0, 0, thickness]]), np.vstack([F, F[:, ::-1] + len(V), *walls])


def planar_delaunay(n: int = 120, seed: int = 0) -> Arrays:
    """Delaunay triangulation of random points and the corners of the unit square."""
    from scipy.spatial import Delaunay

    P = np.random.default_rng(seed).random((n, 2))
    P = np.vstack([P, [[0, 0], [1, 0], [1, 1], [0, 1]]])
    F = Delaunay(P).simplices.astype(np.int64)
    d1, d2 = P[F[:, 1]] - P[F[:, 0]], P[F[:, 2]] - P[F[:, 0]]
    clockwise = d1[:, 0] * d2[:, 1] < d1[:, 1] * d2[:, 0]
    F[clockwise] = F[clockwise, ::-1]
    return np.column_stack([P, np.zeros(len(P))]), F
