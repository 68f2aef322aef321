"""Area, volume and gravitational energy of triangle surfaces, with exact first and second derivatives.

With N = (x1 - x0) x (x2 - x0), the doubled area vector of a face:

* area ``|N| / 2``;
* enclosed volume ``x0 . (x1 x x2) / 6``, summed over a closed surface;
* energy of a fluid of unit density in the linear potential ``u = a . x``: by the divergence theorem with
  the field ``a u^2 / (2 |a|^2)``, the integral of u over the volume is the sum of
  ``(N . a) q / (24 |a|^2)`` with ``q = u0^2 + u1^2 + u2^2 + u0 u1 + u1 u2 + u2 u0``, exact on flat faces
  [Brakke 1992, section 3].

Second derivatives are taken along given directions at the vertices: three per vertex for arbitrary
motions, one for normal motions.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..core.vocabulary import FloatArray, IntArray

__all__ = [
    "Potential",
    "areas",
    "double_area_vectors",
    "gradients",
    "hessian",
    "potentials",
    "volumes",
]

Potential = FloatArray  # (3,) gradient a of the fluid's potential energy density, or zeros

# Sign of the second derivative by corners i and j: d2N = x_i' x x_j' if j comes after i.
_SIGN = np.array([[0.0, 1.0, -1.0], [-1.0, 0.0, 1.0], [1.0, -1.0, 0.0]])
_THIRD = ((0, 2, 1), (2, 1, 0), (1, 0, 2))  # the corner that is neither i nor j


def double_area_vectors(T: FloatArray) -> FloatArray:
    """Doubled area vectors (m, 3) of triangles (m, 3, 3)."""
    return np.asarray(np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0]))


def areas(T: FloatArray) -> FloatArray:
    """Areas of triangles (m, 3, 3)."""
    return np.asarray(0.5 * np.linalg.norm(double_area_vectors(T), axis=1))


def volumes(T: FloatArray) -> FloatArray:
    """Signed volumes of the tetrahedra from the origin to triangles (m, 3, 3)."""
    return np.asarray(np.einsum("fx,fx->f", T[:, 0], np.cross(T[:, 1], T[:, 2])) / 6.0)


def potentials(T: FloatArray, a: Potential) -> FloatArray:
    """Contributions of triangles (m, 3, 3) to the integral of ``a . x`` over the volume."""
    if not a.any():
        return np.zeros(len(T))
    u = T @ a
    return np.asarray((double_area_vectors(T) @ a) * _quadratic(u) / (24.0 * (a @ a)))


def gradients(T: FloatArray, a: Potential) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gradients (m, 3, 3) of area, volume and potential with respect to the corners."""
    N, e = double_area_vectors(T), _opposite(T)
    unit = N / np.maximum(np.linalg.norm(N, axis=1), np.finfo(float).tiny)[:, None]
    area = 0.5 * np.cross(e, unit[:, None])
    volume = np.cross(np.roll(T, -1, axis=1), np.roll(T, 1, axis=1)) / 6.0
    potential = np.zeros_like(T)
    if a.any():
        u = T @ a
        # N . a changes by (x' x e) . a = x' . (e x a).
        potential = np.cross(e, a) * _quadratic(u)[:, None, None]
        potential += ((N @ a)[:, None] * (u + u.sum(axis=1)[:, None]))[..., None] * a
        potential /= 24.0 * (a @ a)
    return area, volume, potential


def hessian(
    X: FloatArray,
    F: IntArray,
    directions: FloatArray,
    a: Potential,
    tension: float,
    pressure: FloatArray,
) -> sp.csr_array:
    """Second derivatives of ``tension * area + potential - pressure * volume``.

    Parameters
    ----------
    X : (n, 3) float64
    F : (m, 3) int
    directions : (n, d, 3) float64
        Directions in which each vertex moves.
    a : (3,) float64
    tension : float
    pressure : (m,) float64
        Per face.

    Returns
    -------
    (n d, n d) sparse array
        Symmetric up to rounding.
    """
    T, d = X[F], directions.shape[1]
    D = directions[F]  # (m, 3, d, 3)
    N, e = double_area_vectors(T), _opposite(T)
    size = np.maximum(np.linalg.norm(N, axis=1), np.finfo(float).tiny)
    unit = N / size[:, None]
    dN = np.cross(D, e[:, :, None])
    along = np.einsum("ficx,fx->fic", dN, unit)
    blocks = np.einsum("ficx,fjdx->ficjd", dN, dN) - np.einsum("fic,fjd->ficjd", along, along)
    blocks *= (0.5 * tension / size)[:, None, None, None, None]
    # The terms that are linear in d2N: those of area, volume and potential.
    weight = 0.5 * tension * unit
    gravity = bool(a.any())
    if gravity:
        u = T @ a
        norm = 24.0 * (a @ a)
        weight = weight + (_quadratic(u) / norm)[:, None] * a
        da = D @ a  # (m, 3, d)
        dq = (u + u.sum(axis=1)[:, None])[:, :, None] * da
        dNa = dN @ a
        mixed = np.einsum("fic,fjd->ficjd", dNa, dq)
        blocks += (mixed + mixed.transpose(0, 3, 4, 1, 2)) / norm
        both = np.einsum("fic,fjd->ficjd", da, da) * (1.0 + np.eye(3))[None, :, None, :, None]
        blocks += ((N @ a) / norm)[:, None, None, None, None] * both
    for i in range(3):
        for j in range(3):
            if i != j:
                linear = weight - (pressure / 6.0)[:, None] * T[:, _THIRD[i][j]]
                crossed = np.cross(D[:, i, :, None], D[:, j, None, :])
                blocks[:, i, :, j, :] += _SIGN[i, j] * np.einsum("fcdx,fx->fcd", crossed, linear)
    index = (d * F)[:, :, None] + np.arange(d)
    shape = blocks.shape
    rows = np.broadcast_to(index[:, :, :, None, None], shape).ravel()
    columns = np.broadcast_to(index[:, None, None, :, :], shape).ravel()
    n = d * len(X)
    return sp.csr_array(sp.coo_array((blocks.ravel(), (rows, columns)), (n, n)))


def _opposite(T: FloatArray) -> FloatArray:
    """Edge opposite each corner: from the corner before it to the corner after it."""
    return np.roll(T, -1, axis=1) - np.roll(T, 1, axis=1)


def _quadratic(u: FloatArray) -> FloatArray:
    """Return ``q = u0^2 + u1^2 + u2^2 + u0 u1 + u1 u2 + u2 u0`` per face."""
    return np.asarray(0.5 * ((u**2).sum(axis=1) + u.sum(axis=1) ** 2))
