"""Energy, volumes and their derivatives for a whole problem, at any positions of its vertices.

These functions check nothing, because the minimisers call them for every trial step. The methods of
`CapillaryProblem` check their arguments.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from ..core.vocabulary import FloatArray, IntArray
from .energies import areas, gradients, hessian, potentials, volumes

if TYPE_CHECKING:
    from .problem import CapillaryProblem

__all__ = ["Forces", "body_volumes_at", "energy_at", "forces_at", "hessian_at"]


@dataclass(frozen=True)
class Forces:
    """First derivatives at all vertices.

    Attributes
    ----------
    energy : (n, 3) float64
        Gradient of the energy.
    volume : (g, n, 3) float64
        Gradient of the volume of every body.
    """

    energy: FloatArray
    volume: FloatArray


def energy_at(problem: CapillaryProblem, X: FloatArray) -> float:
    """Energy with vertices at X, offset included."""
    T = X[problem.F]
    total = problem.tension * areas(T).sum() + potentials(T, problem.potential).sum()
    return float(total) + problem.energy_offset


def body_volumes_at(problem: CapillaryProblem, X: FloatArray) -> FloatArray:
    """Volume (g,) of the faces of every body with a prescribed one, with vertices at X."""
    count = len(problem.targets)
    found = np.bincount(problem.body, volumes(X[problem.F]), count)
    return np.asarray(found[:count], np.float64)


def forces_at(problem: CapillaryProblem, X: FloatArray) -> Forces:
    """Gradients of energy and volumes with vertices at X."""
    area, volume, potential = gradients(X[problem.F], problem.potential)
    n, F, body = len(problem.V), problem.F, problem.body
    energy = _at_vertices(F, problem.tension * area + potential, n)
    each = np.stack(
        [_at_vertices(F[body == g], volume[body == g], n) for g in range(len(problem.targets))]
        or [np.empty((0, n, 3))]
    ).reshape(-1, n, 3)
    return Forces(energy, each)


def hessian_at(
    problem: CapillaryProblem, X: FloatArray, directions: FloatArray, pressure: FloatArray
) -> sp.csr_array:
    """Second derivatives of ``energy - pressure . volumes`` along directions (n, d, 3), at X."""
    each = np.append(pressure, 0.0)[np.minimum(problem.body, len(pressure))]
    return hessian(X, problem.F, directions, problem.potential, problem.tension, each)


def _at_vertices(F: IntArray, corners: FloatArray, n: int) -> FloatArray:
    """Add up vectors (m, 3, 3) of corners at their vertices."""
    index = F.ravel()
    flat = corners.reshape(-1, 3)
    return np.stack([np.bincount(index, flat[:, c], n) for c in range(3)], axis=1)
