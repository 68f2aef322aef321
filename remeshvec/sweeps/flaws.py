"""Checks of a sweep against flaws: folds, faces without area, and faces that cross others.

What an input has of them may stay, or become less.
"""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import DEAD, BoolArray, FloatArray, IndexArray, Mesh, Tree
from ..reference.crossings import crossing_faces
from .guard import Offenders, tree_of

__all__ = ["CrossingCheck", "FoldCheck", "count_new_flaws"]

# Cosine of a turn of 150 degrees, from which on an edge counts as folded.
_FOLDED = -0.8660254037844387

# Faces with less than this share of the mean area have none.
_NO_AREA = 1e-12

# New flaws within so many target lengths of old ones are the old ones, moved; ...
_NEAR = 1.0
# ... as long as there is not so much more of them in all.
_GROWTH = 1.02


def _normals(mesh: Mesh) -> FloatArray:
    """Area vectors of all faces (m, 3); nothing for removed ones."""
    F = mesh.origin.reshape(-1, 3)
    a, b, c = (mesh.X[F[:, i], :3] for i in range(3))
    n = np.cross(b - a, c - a)
    n[F[:, 0] == DEAD] = 0.0
    return np.asarray(n)


def _folded_edges(mesh: Mesh, normals: FloatArray) -> IndexArray:
    """Half-edges, one per edge, where the surface turns by more than 150 degrees."""
    h = np.flatnonzero((mesh.twin > np.arange(len(mesh.twin))) & (mesh.origin != DEAD))
    n, m = normals[h // 3], normals[mesh.twin[h] // 3]
    dot = np.einsum("ij,ij->i", n, m)
    far = dot < 0.0
    h, n, m, dot = h[far], n[far], m[far], dot[far]
    size = np.linalg.norm(n, axis=1) * np.linalg.norm(m, axis=1)
    return h[dot < _FOLDED * size].astype(np.int32)


def _ends(mesh: Mesh, h: IndexArray) -> tuple[FloatArray, FloatArray]:
    following = h - h % 3 + (h + 1) % 3
    return mesh.X[mesh.origin[h], :3], mesh.X[mesh.origin[following], :3]


def _corners(mesh: Mesh, faces: IndexArray) -> Offenders:
    vertices = np.unique(mesh.origin.reshape(-1, 3)[faces])
    return Offenders(np.empty((0, 3)), vertices.astype(np.int32))


class _Places:
    """Places of old flaws, and how much there was of them."""

    def __init__(self, points: FloatArray, amount: float) -> None:
        self.tree = None
        self.amount = amount
        if len(points):
            from scipy.spatial import cKDTree

            self.tree = cKDTree(points)

    def new(self, points: FloatArray, amounts: FloatArray, reach: FloatArray) -> BoolArray:
        """Which flaws are new ones: all, where there is more of them than before, beside old ones."""
        if self.tree is None or not len(points):
            return np.ones(len(points), np.bool_)
        near = self.tree.query(points)[0] <= reach
        if amounts[near].sum() > _GROWTH * self.amount:
            near[:] = False
        return ~near


class FoldCheck:
    """No folds and no faces without area that were not there."""

    def remember_nothing(self) -> None:
        """Let all flaws count as new."""
        self.folds = self.flat = _Places(np.empty((0, 3)), 0.0)

    def remember(self, mesh: Mesh, tree: Tree) -> None:
        """Note where the mesh is folded, and where faces have no area."""
        normals = _normals(mesh)
        h = _folded_edges(mesh, normals)
        a, b = _ends(mesh, h)
        length = np.linalg.norm(b - a, axis=1)
        # Points along the edges, no farther apart than target lengths.
        steps = np.maximum(1, np.ceil(length / mesh.X[mesh.origin[h], 3])).astype(np.int64)
        edge = np.repeat(np.arange(len(h)), steps)
        place = np.arange(len(edge)) - np.repeat(np.cumsum(steps) - steps, steps)
        share = ((place + 0.5) / steps[edge])[:, None]
        self.folds = _Places(a[edge] + share * (b - a)[edge], float(length.sum()))
        flat = self._flat_faces(mesh, normals)
        self.flat = _Places(self._middles(mesh, flat), float(len(flat)))

    def offenders(self, mesh: Mesh, tree: Tree) -> Offenders:
        """Corners of the faces at new folded edges, and of new faces without area."""
        normals = _normals(mesh)
        h = _folded_edges(mesh, normals)
        a, b = _ends(mesh, h)
        middle, length = 0.5 * (a + b), np.linalg.norm(b - a, axis=1)
        reach = np.maximum(_NEAR * mesh.X[mesh.origin[h], 3], length)
        is_new = self.folds.new(middle, length, reach)
        flat = self._flat_faces(mesh, normals)
        points = self._middles(mesh, flat)
        reach = _NEAR * mesh.X[mesh.origin[3 * flat], 3]
        is_new_flat = self.flat.new(points, np.ones(len(flat)), reach)
        new = h[is_new]
        faces = np.concatenate([new // 3, mesh.twin[new] // 3, flat[is_new_flat]])
        return _corners(mesh, faces)

    @staticmethod
    def _flat_faces(mesh: Mesh, normals: FloatArray) -> IndexArray:
        alive = mesh.origin[::3] != DEAD
        size = np.linalg.norm(normals, axis=1)
        return np.flatnonzero(alive & ~(size > _NO_AREA * size[alive].mean())).astype(np.int32)

    @staticmethod
    def _middles(mesh: Mesh, faces: IndexArray) -> FloatArray:
        return np.asarray(mesh.X[mesh.origin.reshape(-1, 3)[faces], :3].mean(axis=1))


class CrossingCheck:
    """No faces that cross others and did not."""

    def __init__(self, parallel: bool) -> None:
        self.parallel = parallel

    def remember_nothing(self) -> None:
        """Let all crossings count as new."""
        self.crossings = _Places(np.empty((0, 3)), 0.0)

    def remember(self, mesh: Mesh, tree: Tree) -> None:
        """Note where faces cross."""
        _, points, area = self._crossings(mesh, tree)
        self.crossings = _Places(points, float(area.sum()))

    def offenders(self, mesh: Mesh, tree: Tree) -> Offenders:
        """Corners of faces that cross others anew."""
        faces, points, area = self._crossings(mesh, tree)
        reach = _NEAR * mesh.X[mesh.origin[3 * faces], 3]
        return _corners(mesh, faces[self.crossings.new(points, area, reach)])

    def _crossings(self, mesh: Mesh, tree: Tree) -> tuple[IndexArray, FloatArray, FloatArray]:
        """Return the faces that cross others, their middles and areas."""
        found = crossing_faces(tree, self.parallel)
        corners = tree.corners[found].reshape(-1, 3, 3)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        alive = np.flatnonzero(mesh.origin[::3] != DEAD).astype(np.int32)
        return alive[found], corners.mean(axis=1), 0.5 * np.linalg.norm(normals, axis=1)


def count_new_flaws(before: Mesh, after: Mesh, parallel: bool | None) -> int:
    """Count the folds and faces without area that a mesh has and an earlier one has not.

    And the faces that cross others, unless ``parallel`` is None: to look for them takes longer.
    """
    checks: list[FoldCheck | CrossingCheck] = [FoldCheck()]
    if parallel is not None:
        checks.append(CrossingCheck(parallel))
    count = 0
    for check in checks:
        # Almost always there is nothing, whatever was there before.
        check.remember_nothing()
        if check.offenders(after, _tree_for(check, after)).size:
            check.remember(before, _tree_for(check, before))
            count += check.offenders(after, _tree_for(check, after)).size
    return count


def _tree_for(check: FoldCheck | CrossingCheck, mesh: Mesh) -> Tree:
    """Build the tree over a mesh that a check of crossings asks for."""
    if isinstance(check, CrossingCheck):
        return tree_of(mesh, check.parallel)
    nothing = np.empty((0, 3))
    return Tree(nothing, *(np.empty(0, np.int32),) * 2, nothing, np.empty(0, np.int64))
