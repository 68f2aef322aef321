"""Checks of a sweep against flaws: folds, faces without area, turned over, or through others.

What an input has of them may stay, or become less.
"""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import CURVE, DEAD, NONE, BoolArray, FloatArray, IndexArray, Mesh, Tree
from ..mesh.blocks import make_blocks
from ..operations.folds import area_vectors, find_flat_faces, find_folds, has_folds
from ..operations.turned import find_turned_faces
from ..reference.crossings import crossing_faces
from .guard import LazyTree, Offenders, lazy_tree, tree_of

__all__ = [
    "CrossingCheck",
    "FoldCheck",
    "TurnedCheck",
    "count_more_crossings",
    "count_new_flaws",
    "find_flaws",
    "has_crossings_where_thin",
    "volume_change",
]

# New flaws within so many target lengths of old ones are the old ones, moved; ...
_NEAR = 1.0
# ... as long as there is not so much more of them in all.
_GROWTH = 1.02

# Volumes below this, in the frame of the mesh, are rounding errors.
_NO_VOLUME = 1e-12


def _ends(mesh: Mesh, h: IndexArray) -> tuple[FloatArray, FloatArray]:
    following = h - h % 3 + (h + 1) % 3
    return mesh.X[mesh.origin[h], :3], mesh.X[mesh.origin[following], :3]


def _corners(mesh: Mesh, faces: IndexArray) -> Offenders:
    vertices = np.unique(mesh.origin.reshape(-1, 3)[faces])
    return Offenders(np.empty((0, 3)), vertices.astype(np.int32))


def _middles(mesh: Mesh, faces: IndexArray) -> FloatArray:
    return np.asarray(mesh.X[mesh.origin.reshape(-1, 3)[faces], :3].mean(axis=1))


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
    """No folds and no faces without area that were not there.

    Parameters
    ----------
    parallel : bool
    tolerated : (k, 3) float64, optional
        Places at which there may be flaws as if there had been some before, however many.
    """

    def __init__(self, parallel: bool, tolerated: FloatArray | None = None) -> None:
        self.parallel = parallel
        self.tolerated = tolerated

    def remember(self, mesh: Mesh, tree: LazyTree) -> None:
        """Note where the mesh is folded, and where faces have no area."""
        vectors = area_vectors(mesh, make_blocks(mesh), self.parallel)
        h = find_folds(mesh, vectors)
        a, b = _ends(mesh, h)
        length = np.linalg.norm(b - a, axis=1)
        # Points along the edges, no farther apart than target lengths.
        steps = np.maximum(1, np.ceil(length / mesh.X[mesh.origin[h], 3])).astype(np.int64)
        edge = np.repeat(np.arange(len(h)), steps)
        place = np.arange(len(edge)) - np.repeat(np.cumsum(steps) - steps, steps)
        share = ((place + 0.5) / steps[edge])[:, None]
        self.folds = self._places(a[edge] + share * (b - a)[edge], float(length.sum()))
        flat = find_flat_faces(mesh, vectors)
        self.flat = self._places(_middles(mesh, flat), float(len(flat)))

    def _places(self, points: FloatArray, amount: float) -> _Places:
        if self.tolerated is None:
            return _Places(points, amount)
        return _Places(np.concatenate([points, self.tolerated]), np.inf)

    def offenders(self, mesh: Mesh, tree: LazyTree) -> Offenders:
        """Corners of the faces at new folded edges, and of new faces without area."""
        vectors = area_vectors(mesh, make_blocks(mesh), self.parallel)
        h = find_folds(mesh, vectors)
        a, b = _ends(mesh, h)
        middle, length = 0.5 * (a + b), np.linalg.norm(b - a, axis=1)
        reach = np.maximum(_NEAR * mesh.X[mesh.origin[h], 3], length)
        is_new = self.folds.new(middle, length, reach)
        flat = find_flat_faces(mesh, vectors)
        points = _middles(mesh, flat)
        reach = _NEAR * mesh.X[mesh.origin[3 * flat], 3]
        is_new_flat = self.flat.new(points, np.ones(len(flat)), reach)
        new = h[is_new]
        faces = np.concatenate([new // 3, mesh.twin[new] // 3, flat[is_new_flat]])
        return _corners(mesh, faces)


class TurnedCheck:
    """No faces turned over against the input that were not.

    Parameters
    ----------
    input_tree : Tree
        Over the faces of the input.
    parallel : bool
    """

    def __init__(self, input_tree: Tree, parallel: bool) -> None:
        self.input_tree = input_tree
        self.parallel = parallel
        self.turned = _Places(np.empty((0, 3)), 0.0)

    def remember(self, mesh: Mesh, tree: LazyTree) -> None:
        """Note which faces are turned over: on noisy inputs splits alone may do it."""
        faces = _turned(mesh, self.input_tree, self.parallel)
        self.turned = _Places(_middles(mesh, faces), float(len(faces)))

    def offenders(self, mesh: Mesh, tree: LazyTree) -> Offenders:
        """Corners of faces that have turned over."""
        faces = _turned(mesh, self.input_tree, self.parallel)
        reach = _NEAR * mesh.X[mesh.origin[3 * faces], 3]
        is_new = self.turned.new(_middles(mesh, faces), np.ones(len(faces)), reach)
        return _corners(mesh, faces[is_new])


def _turned(mesh: Mesh, input_tree: Tree, parallel: bool) -> IndexArray:
    return find_turned_faces(mesh, make_blocks(mesh), input_tree, parallel)


class CrossingCheck:
    """No faces that cross others and did not; faces that share a corner only with ``adjacent``."""

    def __init__(self, parallel: bool, adjacent: bool) -> None:
        self.parallel = parallel
        self.adjacent = adjacent

    def remember_nothing(self) -> None:
        """Let all crossings count as new."""
        self.crossings, self.n_old = _Places(np.empty((0, 3)), 0.0), 0

    def remember(self, mesh: Mesh, tree: LazyTree) -> None:
        """Note where faces cross."""
        _, points, area = self._crossings(mesh, tree)
        self.crossings, self.n_old = _Places(points, float(area.sum())), len(points)

    def offenders(self, mesh: Mesh, tree: LazyTree) -> Offenders:
        """Corners of faces that cross others anew."""
        faces, points, area = self._crossings(mesh, tree)
        reach = _NEAR * mesh.X[mesh.origin[3 * faces], 3]
        return _corners(mesh, faces[self.crossings.new(points, area, reach)])

    def _crossings(self, mesh: Mesh, tree: LazyTree) -> tuple[IndexArray, FloatArray, FloatArray]:
        """Return the faces that cross others, their middles and areas."""
        found = crossing_faces(tree(), self.parallel, self.adjacent)
        corners = tree().corners[found].reshape(-1, 3, 3)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        alive = np.flatnonzero(mesh.origin[::3] != DEAD).astype(np.int32)
        return alive[found], corners.mean(axis=1), 0.5 * np.linalg.norm(normals, axis=1)


def count_new_flaws(
    before: Mesh,
    after: Mesh,
    input_tree: Tree | None,
    crossings: bool,
    parallel: bool,
    tolerated: FloatArray | None = None,
) -> int:
    """Count the vertices at flaws that a mesh has and an earlier one, the input, has not.

    Those tolerated do not count.

    Faces turned over count where the tree over the input is given, crossings only if asked for: to look
    for them takes longer.
    """
    count = 0
    if input_tree is not None:
        count += len(_corners(after, _turned(after, input_tree, parallel)).vertices)
    if has_folds(after, make_blocks(after), parallel):
        check = FoldCheck(parallel, tolerated)
        check.remember(before, lazy_tree(before, parallel))
        count += check.offenders(after, lazy_tree(after, parallel)).size
    return count + (_new_crossings(before, after, True, parallel)[0] if crossings else 0)


def find_flaws(before: Mesh, after: Mesh, parallel: bool) -> IndexArray:
    """Find the vertices at flaws and crossings that a mesh has and an earlier one has not."""
    trees = [lazy_tree(mesh, parallel) for mesh in (before, after)]
    found = []
    for check in (FoldCheck(parallel), CrossingCheck(parallel, False)):
        check.remember(before, trees[0])
        found.append(check.offenders(after, trees[1]).vertices)
    return np.unique(np.concatenate(found))


def has_crossings_where_thin(mesh: Mesh, is_thin: BoolArray | None, parallel: bool) -> bool:
    """Tell whether faces at curves, or born on thin faces, cross others that they share no corner with.

    Chords of curves leave the surface farthest: where walls are thin, faces cross there first. To ask
    about all faces takes a third of a call. ``is_thin`` are (m,) faces of the reference.
    """
    F = mesh.origin.reshape(-1, 3)
    F = F[F[:, 0] != DEAD]
    is_asked = mesh.kind[F] >= CURVE
    if is_thin is not None:
        is_asked |= is_thin[mesh.birth[F] // 3]
    if not is_asked.any():
        return False
    return len(crossing_faces(tree_of(mesh, parallel), parallel, False, is_asked.any(axis=1))) > 0


def volume_change(before: Mesh, after: Mesh) -> float:
    """Share of its volume by which a closed surface has changed; 0 for an open one, or without volume."""
    if (before.twin[before.origin != DEAD] == NONE).any():
        return 0.0
    volume, now = _volume(before), _volume(after)
    return abs(now - volume) / volume if volume > _NO_VOLUME else 0.0


def _volume(mesh: Mesh) -> float:
    F = mesh.origin.reshape(-1, 3)
    a, b, c = (mesh.X[F[F[:, 0] != DEAD, i], :3] for i in range(3))
    return float(np.einsum("ij,ij", a, np.cross(b, c))) / 6.0


def count_more_crossings(before: Mesh, after: Mesh, parallel: bool) -> int:
    """Count new crossings if they are more than the old ones, without those of faces with common corners.

    Where a surface crosses itself as much, a guard against crossings does more harm than good.
    """
    new, old = _new_crossings(before, after, False, parallel)
    return new if new > old else 0


def _new_crossings(before: Mesh, after: Mesh, adjacent: bool, parallel: bool) -> tuple[int, int]:
    """Count the vertices at new crossings, and the faces at old ones if there are new ones."""
    check = CrossingCheck(parallel, adjacent)
    check.remember_nothing()
    tree = lazy_tree(after, parallel)
    if not check.offenders(after, tree).size:
        return 0, 0
    check.remember(before, lazy_tree(before, parallel))
    return check.offenders(after, tree).size, check.n_old
