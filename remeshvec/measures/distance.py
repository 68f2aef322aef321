"""Distance between two surfaces: Hausdorff, RMS and mean, from samples."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.arguments import count
from ..core.check import as_mesh
from ..core.vocabulary import FloatArray, IntArray
from ..errors import OptionError
from ..interop.given import MeshObject, is_whole, whole_arrays

__all__ = ["SurfaceDistance", "surface_distance"]


# The additive recurrence with the plastic number: the least discrepancy known for a plane sequence
# that needs no length beforehand and no random state (M. Roberts, "R2", 2018).
PLASTIC_NUMBER = 1.32471795724474602596


@dataclass(frozen=True)
class SurfaceDistance:
    """Distances between two surfaces from samples; see `surface_distance` for what is sampled.

    `1_to_2` goes from samples of the first surface to their closest points on the second.  The
    figures without a direction are the larger of the two directions.
    """

    hausdorff: float
    rms: float
    mean: float
    max_1_to_2: float
    max_2_to_1: float
    rms_1_to_2: float
    rms_2_to_1: float
    mean_1_to_2: float
    mean_2_to_1: float
    diagonal: float  # of the first surface's bounding box
    hausdorff_relative: float  # hausdorff / diagonal, a fraction
    rms_relative: float  # rms / diagonal, a fraction

    def to_dict(self) -> dict[str, float]:
        """Return all distances as a JSON-ready dict."""
        return asdict(self)

    def __str__(self) -> str:
        return (
            f"Hausdorff {self.hausdorff:.4g} ({100 * self.hausdorff_relative:.3g} % of the "
            f"diagonal), RMS {self.rms:.4g} ({100 * self.rms_relative:.3g} %)"
        )


def surface_distance(
    V1: ArrayLike | MeshObject,
    F1: Any = None,
    V2: Any = None,
    F2: Any = None,
    *,
    samples: int = 100_000,
) -> SurfaceDistance:
    """Measure how far two surfaces are apart, in both directions.

    The samples are all vertices that a face uses, and `samples` points on the faces, spread evenly over
    the area by a low-discrepancy sequence.  The distance of each sample to the other surface is exact
    (libigl's closest point).  The maxima run over all samples and are therefore lower bounds of the
    true one-sided distances, which exceed them by at most the distance from a surface point to the
    nearest sample.  RMS and mean run over the points on the faces, so they are integrals over the
    area; for a surface without area they run over its vertices.  No random numbers are used: the
    same input gives the same result.

    Parameters
    ----------
    V1, F1 : (n, 3) float, (m, 3) int
        First surface; its bounding box gives `diagonal`. Or one whole mesh, as for `remesh`, or a
        result: ``surface_distance(mesh, result)``.
    V2, F2 : (k, 3) float, (l, 3) int
        Second surface; or one whole mesh.
    samples : int
        Points on the faces of each surface.

    Returns
    -------
    SurfaceDistance
        One-sided and two-sided distances.

    Raises
    ------
    MeshInputError
        One of the meshes cannot be a triangle mesh.
    OptionError
        `samples` is less than 1.
    """
    samples = count(samples, "samples")
    V1, F1, V2, F2 = _two_meshes([V1, F1, V2, F2])
    first, second = as_mesh(V1, F1, ("V1", "F1")), as_mesh(V2, F2, ("V2", "F2"))
    max_12, rms_12, mean_12 = _one_sided(*first, *second, samples)
    max_21, rms_21, mean_21 = _one_sided(*second, *first, samples)
    diagonal = float(np.linalg.norm(np.ptp(first[0][np.unique(first[1])], axis=0)))
    hausdorff, rms = max(max_12, max_21), max(rms_12, rms_21)
    return SurfaceDistance(
        hausdorff=hausdorff,
        rms=rms,
        mean=max(mean_12, mean_21),
        max_1_to_2=max_12,
        max_2_to_1=max_21,
        rms_1_to_2=rms_12,
        rms_2_to_1=rms_21,
        mean_1_to_2=mean_12,
        mean_2_to_1=mean_21,
        diagonal=diagonal,
        hausdorff_relative=hausdorff / diagonal if diagonal else 0.0,
        rms_relative=rms / diagonal if diagonal else 0.0,
    )


def _two_meshes(given: list[Any]) -> list[Any]:
    """Put the arrays of whole meshes into the places of meshes; what follows them moves along."""
    arrays: list[Any] = []
    while given and len(arrays) < 4:
        first, *given = given
        arrays += whole_arrays(first) if len(arrays) % 2 == 0 and is_whole(first) else [first]
    if any(x is not None for x in given):
        raise OptionError("surface_distance takes two meshes; more was given")
    return arrays


def _one_sided(
    V1: FloatArray, F1: IntArray, V2: FloatArray, F2: IntArray, samples: int
) -> tuple[float, float, float]:
    """Largest, root mean square and mean distance from samples of surface 1 to surface 2."""
    corners = V1[np.unique(F1)]
    inside = _points_on_faces(V1, F1, samples)
    at_corners = _distances(corners, V2, F2)
    at_inside = _distances(inside, V2, F2) if len(inside) else at_corners
    largest = max(at_corners.max(), at_inside.max())
    return float(largest), float(np.sqrt(np.mean(at_inside**2))), float(at_inside.mean())


def _distances(P: FloatArray, V: FloatArray, F: IntArray) -> FloatArray:
    import igl

    return np.sqrt(igl.point_mesh_squared_distance(P, V, F)[0])


def _points_on_faces(V: FloatArray, F: IntArray, samples: int) -> FloatArray:
    """Spread points evenly over the area: stratified along the faces, R2 inside each face."""
    a, b, c = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    cumulated = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    if not cumulated[-1] > 0:
        return np.zeros((0, 3))
    k = np.arange(samples)
    f = np.searchsorted(cumulated, (k + 0.5) / samples * cumulated[-1], side="right")
    u, w = (0.5 + k / PLASTIC_NUMBER) % 1, (0.5 + k / PLASTIC_NUMBER**2) % 1
    beyond = u + w > 1
    u, w = np.where(beyond, 1 - u, u), np.where(beyond, 1 - w, w)
    return a[f] + u[:, None] * (b - a)[f] + w[:, None] * (c - a)[f]
