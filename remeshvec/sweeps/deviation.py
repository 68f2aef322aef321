"""The check of `max_deviation`: samples of the new mesh must lie near the input, and the other way."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import (
    DEAD,
    HELD,
    NONE,
    FloatArray,
    IndexArray,
    Mesh,
    Tree,
)
from ..reference.build import FeaturedReference
from ..reference.bvh import closest_faces
from .guard import LazyTree, Offenders, tree_of

__all__ = [
    "DeviationCheck",
    "measure_deviation",
    "sample_mesh",
    "shortened_lengths",
]


def _grid(steps: int) -> FloatArray:
    """Barycentric weights of samples of a face, on a grid of so many steps along every side."""
    weights = [[i, j, steps - i - j] for i in range(steps + 1) for j in range(steps + 1 - i)]
    return np.array(weights, float) / steps


_GRID = _grid(5)
_MIDDLE = np.array([[0.4, 0.4, 0.2]])  # one of them, near the centroid

# For lengths that are corrected: no corners, which lie on the input.
_COARSE = _grid(3)
_COARSE = _COARSE[_COARSE.max(axis=1) < 1.0]

# Samples must keep this share of the distance: between them it may be a little more.
_SAMPLED_SHARE = 0.8


# Vertices of the input that are farther from the mesh than so many tolerances: a tip was lost.
_LOST = 2.0


def sample_mesh(
    X: FloatArray, F: IndexArray, grid: FloatArray = _GRID
) -> tuple[FloatArray, IndexArray]:
    """Sample every face of a mesh, at 21 points: its corners, four on each side and six inside.

    ``grid`` holds the barycentric weights of other points (k, 3).

    Returns
    -------
    points : (k m, 3) float64
        Those of a face together.
    face : (k m,) int32
    """
    points = np.einsum("kc,mcx->mkx", grid, X[F, :3]).reshape(-1, 3)
    return points, np.repeat(np.arange(len(F), dtype=np.int32), len(grid))


class DeviationCheck:
    """Samples of both surfaces that lie too far from the other one.

    Parameters
    ----------
    featured : FeaturedReference
    distance : float
        Largest deviation, in the frame of the meshes.
    parallel : bool
    """

    def __init__(self, featured: FeaturedReference, distance: float, parallel: bool) -> None:
        self.reference = featured.reference
        self.distance = distance
        self.parallel = parallel
        F = self.reference.origin.reshape(-1, 3)
        self.samples, _ = sample_mesh(self.reference.X, F)

    def remember(self, mesh: Mesh, tree: LazyTree) -> None:
        """Nothing: a mesh is compared with the input."""

    def distances(
        self, mesh: Mesh, tree: LazyTree, trust: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distances of samples: of the mesh from the input, and of the input from the mesh.

        Returns
        -------
        points : (k, 3) float64
            Samples of the mesh.
        to_input : (k,) float64
            Within ``trust`` an upper bound; likewise the next.
        from_input : (j,) float64
            For `samples`.
        """
        alive = mesh.origin[::3] != DEAD
        F = mesh.origin.reshape(-1, 3)[alive]
        points, face = sample_mesh(mesh.X, F)
        hint = _hints(mesh, F, mesh.source[alive])[face]
        _, to_input = closest_faces(self.reference.tree, points, hint, trust, self.parallel)
        anywhere = np.full(len(self.samples), NONE, np.int32)
        _, from_input = closest_faces(tree(), self.samples, anywhere, trust, self.parallel)
        return points, to_input, from_input

    def offenders(self, mesh: Mesh, tree: LazyTree) -> Offenders:
        """Return the samples of either surface that lie too far from the other."""
        limit = _SAMPLED_SHARE * self.distance
        points, to_input, from_input = self.distances(mesh, tree, limit)
        far = np.concatenate([points[to_input > limit], self.samples[from_input > limit]])
        return Offenders(far, np.empty(0, np.int32))


def measure_deviation(mesh: Mesh, featured: FeaturedReference, parallel: bool) -> dict[str, float]:
    """Largest distance of a sample, each way."""
    reference = featured.reference
    alive = mesh.origin[::3] != DEAD
    F, G = mesh.origin.reshape(-1, 3)[alive], reference.origin.reshape(-1, 3)
    hint = _hints(mesh, F, mesh.source[alive])
    anywhere = np.full(len(G), NONE, np.int32)
    tree = tree_of(mesh, parallel)
    return {
        "to_input": _largest_distance(reference.tree, mesh.X, F, hint, parallel),
        "from_input": _largest_distance(tree, reference.X, G, anywhere, parallel),
    }


def _largest_distance(
    tree: Tree, X: FloatArray, F: IndexArray, hint: IndexArray, parallel: bool
) -> float:
    """Largest distance of the samples of faces from a surface.

    One sample per face says which faces may have a farther one: distances of two points differ by no
    more than theirs from each other. Of those the ones nearer than the farthest so far need no search.
    """
    middle, _ = sample_mesh(X, F, _MIDDLE)
    _, distance = closest_faces(tree, middle, hint, 0.0, parallel)
    worst = float(distance.max())
    reach = np.linalg.norm(X[F, :3] - middle[:, None], axis=2).max(axis=1)
    far = np.flatnonzero(distance + reach > worst)
    points, face = sample_mesh(X, F[far])
    _, distance = closest_faces(tree, points, hint[far][face], worst, parallel)
    return max(worst, float(distance.max(initial=0.0)))


def _worst_distances(
    mesh: Mesh, featured: FeaturedReference, trust: float, parallel: bool
) -> FloatArray:
    """Largest distance of a sample of each face of a compact mesh from the input."""
    F = mesh.origin.reshape(-1, 3)
    points, face = sample_mesh(mesh.X, F, _COARSE)
    hint = _hints(mesh, F, mesh.source)[face]
    _, distance = closest_faces(featured.reference.tree, points, hint, trust, parallel)
    return distance.reshape(len(F), -1).max(axis=1)


def shortened_lengths(
    mesh: Mesh, featured: FeaturedReference, tolerance: float, parallel: bool
) -> FloatArray:
    """Target lengths at the vertices of the input, shorter where the surfaces are too far apart.

    That is where faces of the mesh are off by more than a tolerance, or vertices of the input by more
    than two: there a tip was lost. The error goes with the square of the length; a length falls by no
    more than 0.7 at a time.
    """
    worst = _worst_distances(mesh, featured, tolerance, parallel)
    X = featured.reference.X
    anywhere = np.full(len(X), NONE, np.int32)
    tree = tree_of(mesh, parallel)
    face, distance = closest_faces(tree, X[:, :3], anywhere, tolerance, parallel)
    lost = np.where(distance > _LOST * tolerance, distance, 0.0)
    share = tolerance / np.maximum(np.maximum(worst[face], lost), tolerance)
    return np.asarray(X[:, 3] * np.maximum(np.sqrt(share), 0.7))


def _hints(mesh: Mesh, F: IndexArray, source: IndexArray) -> IndexArray:
    """Faces of the reference to start at: where an inner corner was born, or any of the patch."""
    hint = source.copy()
    for corner in range(3):
        v = F[:, corner]
        hint = np.where(mesh.kind[v] <= HELD, mesh.birth[v] // 3, hint)
    return hint.astype(np.int32)
