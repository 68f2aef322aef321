"""Parts of a motion: a share w of an affine map, from 0 (none of it) to 1 (all of it)."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import FloatArray, IntArray

__all__ = ["part_of_motion", "rotations_between"]

# Below this angle in radians, the axis of a screw is too far away to turn about.
_NO_TURN = 1e-6


def part_of_motion(
    affine: FloatArray, centre: FloatArray, points: FloatArray, w: FloatArray
) -> FloatArray:
    """Move every point by its own share of an affine map.

    The map is a stretch about ``centre``, then a rotation (polar decomposition), then a translation. The
    rigid part is a screw motion: a point moves along the share w of its helix. The stretch is
    interpolated linearly.

    Parameters
    ----------
    affine : (3, 4) float
        For column vectors.
    centre : (3,) float
    points : (n, 3) float
    w : (n,) float

    Returns
    -------
    (n, 3) float64
    """
    from scipy.spatial.transform import Rotation

    U, sizes, Wt = np.linalg.svd(affine[:, :3])
    sign = np.sign(np.linalg.det(U @ Wt)) or 1.0
    rotation = (U * [1.0, 1.0, sign]) @ Wt
    stretch = (Wt.T * (sizes * [1.0, 1.0, sign])) @ Wt
    away = points - centre
    away = away + w[:, None] * (away @ (stretch - np.eye(3)).T)
    omega = Rotation.from_matrix(rotation).as_rotvec()
    angle = float(np.linalg.norm(omega))
    shift = affine[:, :3] @ centre + affine[:, 3] - centre
    turns = Rotation.from_rotvec(w[:, None] * omega)
    if angle < _NO_TURN:
        return np.asarray(centre + turns.apply(away) + w[:, None] * shift)
    # The part of the shift across the axis makes the turn one about another point.
    axis = omega / angle
    along = axis * (axis @ shift)
    across = shift - along
    pivot = 0.5 * (across + np.cross(axis, across) / np.tan(0.5 * angle))
    return np.asarray(centre + pivot + turns.apply(away - pivot) + w[:, None] * along)


def rotations_between(P: FloatArray, Q: FloatArray, F: IntArray) -> FloatArray:
    """Rotation (n, 3, 3) per vertex from P to Q: the one nearest to the mean gradient around it.

    The gradient of a face takes its unit normal in P to that in Q. Gradients are weighted by the areas of
    the faces in P.
    """
    before, area = _frames(P, F)
    after, _ = _frames(Q, F)
    good = area > 1e-12 * area.max(initial=0.0)
    gradient = np.zeros_like(before)
    solved = np.linalg.solve(before[good].swapaxes(1, 2), after[good].swapaxes(1, 2))
    gradient[good] = solved.swapaxes(1, 2) * area[good, None, None]
    total = np.zeros((len(P), 3, 3))
    for c in range(3):
        np.add.at(total, F[:, c], gradient)
    U, _, Wt = np.linalg.svd(total)
    U[:, :, 2] *= np.sign(np.linalg.det(U @ Wt))[:, None]
    return np.asarray(U @ Wt)


def _frames(X: FloatArray, F: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return two edges and the unit normal per face as columns, and twice its area."""
    a, b = X[F[:, 1]] - X[F[:, 0]], X[F[:, 2]] - X[F[:, 0]]
    normal = np.cross(a, b)
    area = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(area, np.finfo(float).tiny)[:, None]
    return np.stack([a, b, normal], axis=2), area
