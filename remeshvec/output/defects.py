"""What is wrong with a mesh: folds, slivers, faces without area, turned over, or through others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.shown import one_line
from ..core.vocabulary import FloatArray, IntArray
from ..mesh.edges import edge_keys, halfedge_ends
from ..mesh.morton import order_mesh
from ..reference.bvh import build_tree
from ..reference.crossings import crossing_faces

__all__ = ["Defects", "find_defects"]

# Degrees by which the surface turns at a fold, and of the smallest angle of a sliver.
_FOLD = 150.0
_SLIVER = 5.0

# Faces with less than this share of the mean area have none.
_NO_AREA = 1e-12


@dataclass(frozen=True, repr=False, eq=False)
class Defects:
    """Faces of a mesh that are not as they should be, by their indices.

    Attributes
    ----------
    folds : (k, 2) int
        Faces on both sides of each edge where the surface turns by more than 150 degrees.
    slivers : (k,) int
        Faces with an angle below 5 degrees.
    zero_area : (k,) int
        Faces with less than 1e-12 of the mean area.
    turned : (k,) int
        Faces that look against the input below them.
    crossing : (k,) int, or None
        Faces that cross other faces; None where nobody looked.
    """

    folds: IntArray
    slivers: IntArray
    zero_area: IntArray
    turned: IntArray
    crossing: IntArray | None = None

    def to_dict(self) -> dict[str, int | None]:
        """Return how many there are of each kind; JSON-ready."""
        return {name: None if value is None else len(value) for name, value in vars(self).items()}

    def __bool__(self) -> bool:
        return any(self.to_dict().values())

    def __str__(self) -> str:
        names = {"zero_area": "faces without area", "turned": "faces turned over"}
        names["crossing"] = "faces that cross others"
        found = [f"{n} {names.get(name, name)}" for name, n in self.to_dict().items() if n]
        return ", ".join(found) or "none"

    def __repr__(self) -> str:
        return one_line("Defects", str(self))


def find_defects(
    V: ArrayLike, F: ArrayLike, turned: Callable[[], IntArray], check_intersections: bool
) -> Defects:
    """Look at every face of a mesh.

    Parameters
    ----------
    V : (n, 3) float
    F : (m, 3) int
    turned : callable
        Finds the faces that look against the input.
    check_intersections : bool
        Whether to look for faces that cross others, which takes longer.
    """
    points, faces = np.asarray(V, np.float64), np.asarray(F, np.int64)
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1)
    return Defects(
        folds=_folds(faces, normals, size),
        slivers=np.flatnonzero(_smallest_angles(corners, size) < np.radians(_SLIVER)),
        zero_area=np.flatnonzero(~(size > _NO_AREA * size.mean())),
        turned=turned(),
        crossing=_crossing(points, faces) if check_intersections else None,
    )


def _folds(F: IntArray, normals: FloatArray, size: FloatArray) -> IntArray:
    """Pairs of faces at edges of two faces that turn too far, in the order of the edges' ends."""
    ends = halfedge_ends(F)
    keys = edge_keys(ends, int(F.max()) + 1)
    order = np.argsort(keys, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(keys[order]) > 0))
    first = first[np.diff(first, append=len(order)) == 2]
    h, g = order[first], order[first + 1]
    a, b = h // 3, g // 3
    dot = np.einsum("ij,ij->i", normals[a], normals[b])
    dot = np.where(ends[0][h] == ends[0][g], -dot, dot)  # windings that do not agree
    folded = dot < np.cos(np.radians(_FOLD)) * size[a] * size[b]
    return np.stack([a[folded], b[folded]], axis=1)


def _smallest_angles(corners: FloatArray, size: FloatArray) -> FloatArray:
    """Smallest angle of every face: opposite the shortest side, between the other two."""
    sides = corners - np.roll(corners, -1, axis=1)
    squared = np.sort((sides * sides).sum(axis=2), axis=1)
    between = 0.5 * (squared[:, 1] + squared[:, 2] - squared[:, 0])
    return np.asarray(np.arctan2(size, between))


def _crossing(V: FloatArray, F: IntArray) -> IntArray:
    """Faces that cross others, looked for where neighbours follow each other."""
    used = V[F].reshape(-1, 3)
    centre, extent = used.mean(axis=0), np.ptp(used, axis=0).max() or 1.0
    ordered = order_mesh((V - centre) / extent, F.astype(np.int32), False)
    nothing: NDArray[Any] = np.full(F.size, -1, np.int32)
    patch = np.zeros(len(F), np.int32)
    tree = build_tree(ordered.X[:, :3].copy(), ordered.F, nothing, patch, False)
    return np.sort(ordered.face_source[crossing_faces(tree, False)]).astype(np.int64)
