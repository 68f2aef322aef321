"""Minimise the energy of a capillary surface at prescribed volumes: a flow, and Newton's method.

Both work with the Lagrangian, which is energy minus pressure times volume. Every step ends with restored
volumes, so that the energies of a history can be compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from ..core.arguments import asks_to_stop, choice, count, function, number
from ..core.vocabulary import FloatArray, IntArray
from ..modelling.solver import LaplacianSolver
from .energies import double_area_vectors
from .forces import Forces, body_volumes_at, energy_at, forces_at, hessian_at
from .problem import CapillaryProblem, as_problem, with_surface

__all__ = [
    "METHODS",
    "Minimum",
    "StepCallback",
    "measured",
    "minimize",
    "unmoved",
    "with_restored_volumes",
]

METHODS = ("flow", "newton")
StepCallback = Callable[[int, CapillaryProblem, float, float], object]

# The most steps, unless the caller gives a number.
_MOST_STEPS = {"flow": 200, "newton": 50}

# A step is halved this many times at most before it counts as impossible.
_HALVINGS = 12

# Corrections of the volume after a step, each of which squares the error.
_VOLUME_CORRECTIONS = 20
_VOLUME_ERROR = 1e-12  # relative

# Added to the diagonal of the stiffness matrix, relative to it. It holds components without fixed
# vertices in place, including those that shrink to nothing.
_GAUGE = 1e-6

# Half the cotangent of 1.1 degrees: faces with a smaller angle have a metric that is noise.
_SLIVER = 25.0

# Shifts of a Hessian that is not positive where it must be: the first, the factor from one to the next,
# and how many are tried.
_FIRST_SHIFT, _SHIFT_FACTOR, _SHIFTS = 1e-3, 8.0, 14


@dataclass
class Minimum:
    """Result of a minimisation.

    Attributes
    ----------
    problem : CapillaryProblem
        The problem with the surface at the end.
    energy, area, volume : float
        Offsets included.
    pressure : (g,) float64
        Pressure per body: the Lagrange multiplier of its volume, which is the derivative of the least
        energy with respect to that volume.
    residual : float
        Root mean square of the normal force density (energy gradient minus pressure) on free vertices,
        times the square root of the area, over the tension; dimensionless.
    converged : bool
        Whether the residual is below the tolerance.
    stop : str
        Reason for the end.
    history : list of dict
        "energy" and "residual" after every step.
    """

    problem: CapillaryProblem
    energy: float
    area: float
    volume: float
    pressure: FloatArray
    residual: float
    converged: bool
    stop: str
    history: list[dict[str, float]] = field(default_factory=list)

    @property
    def V(self) -> FloatArray:
        """Vertices (n, 3)."""
        return self.problem.V

    @property
    def F(self) -> IntArray:
        """Faces (m, 3)."""
        return self.problem.F


def minimize(
    problem: CapillaryProblem,
    method: Literal["flow", "newton"] = "flow",
    *,
    tol: float = 1e-6,
    steps: int | None = None,
    callback: StepCallback | None = None,
) -> Minimum:
    """Move the free vertices to the least energy; the triangles stay the same.

    Parameters
    ----------
    problem : CapillaryProblem
        Not changed.
    method : {"flow", "newton"}
        "flow": descent with the cotangent Laplacian as the metric [Pinkall and Polthier 1993, section
        4]. It works from any start and converges linearly. "newton": one degree of freedom per vertex,
        along its normal. The Hessian of the Lagrangian, bordered by the volumes, is shifted until its
        inertia shows that it is positive on all motions that keep the volumes; near a minimum it
        converges quadratically. Neither improves the triangles: `evolve` remeshes in between.
    tol : float
        Residual at which to stop; see `Minimum`.
    steps : int, optional
        The most steps; by default 200 for the flow and 50 for Newton's method.
    callback : callable, optional
        Called as ``callback(step, problem, energy, residual)`` after every step; if it returns False, the
        minimisation ends.

    Returns
    -------
    Minimum

    Raises
    ------
    OptionError
        The method is unknown, a number is out of range, or an argument has the wrong type.
    """
    as_problem(problem)
    tolerance = number(tol, "tol", above=0.0)
    advance = {"flow": _flow_step, "newton": _newton_step}[choice(method, "method", METHODS)]
    most = _MOST_STEPS[method] if steps is None else count(steps, "steps")
    if callback is not None:
        function(callback, "callback")
    if not len(problem.F):
        return unmoved(problem, "nothing is left")
    if not problem.free.any():
        return unmoved(problem, "all is fixed")
    return _descend(with_restored_volumes(problem), advance, most, tolerance, callback)


def _descend(
    now: CapillaryProblem,
    advance: Callable[[CapillaryProblem, Forces, FloatArray], FloatArray | None],
    most: int,
    tolerance: float,
    callback: StepCallback | None,
) -> Minimum:
    """Take steps until there is a reason to stop."""
    history: list[dict[str, float]] = []
    pressure, residual = _balance(now, now.forces())
    stop = "all steps done"
    for step in range(most):
        if residual <= tolerance:
            stop = "converged"
            break
        moved = advance(now, now.forces(), pressure)
        if moved is None:
            stop = "no step lowers the energy"
            break
        now = with_surface(now, moved)
        pressure, residual = _balance(now, now.forces())
        history.append({"energy": now.energy(), "residual": residual})
        if callback is not None and asks_to_stop(callback(step, now, now.energy(), residual)):
            stop = "cancelled"
            break
    else:
        stop = "converged" if residual <= tolerance else stop
    return _minimum(now, pressure, residual, tolerance, stop, history)


def measured(problem: CapillaryProblem, tolerance: float, stop: str) -> Minimum:
    """Return the result for a surface as it is, with its pressures and its residual."""
    pressure, residual = _balance(problem, problem.forces())
    return _minimum(problem, pressure, residual, tolerance, stop, [])


def unmoved(problem: CapillaryProblem, stop: str) -> Minimum:
    """Return the result for a surface that cannot move: no vertex is free, or no face is left."""
    return _minimum(problem, np.zeros(len(problem.targets)), 0.0, 0.0, stop, [])


def _minimum(
    now: CapillaryProblem,
    pressure: FloatArray,
    residual: float,
    tolerance: float,
    stop: str,
    history: list[dict[str, float]],
) -> Minimum:
    return Minimum(
        now,
        now.energy(),
        now.area(),
        now.total_volume(),
        pressure,
        residual,
        residual <= tolerance,
        stop,
        history,
    )


# --- forces and volumes --------------------------------------------------------------------------


def _normals(problem: CapillaryProblem) -> tuple[FloatArray, FloatArray]:
    """Return unit normals (n, 3) and areas (n,) of vertices, from the faces around them."""
    T = problem.V[problem.F]
    N = double_area_vectors(T) / 6.0
    index = problem.F.ravel()
    each = np.repeat(N, 3, axis=0)
    total = np.stack([np.bincount(index, each[:, c], len(problem.V)) for c in range(3)], axis=1)
    size = np.linalg.norm(total, axis=1)
    area = np.bincount(index, np.repeat(np.linalg.norm(N, axis=1), 3), len(problem.V))
    unit = total / np.maximum(size, np.finfo(float).tiny)[:, None]
    return np.asarray(unit), np.asarray(area, np.float64)


def _balance(problem: CapillaryProblem, forces: Forces) -> tuple[FloatArray, float]:
    """Return the pressures that balance the forces best, and the residual; see `Minimum`."""
    normal, area = _normals(problem)
    free = np.flatnonzero(problem.free & (area > 0.0))
    weight = 1.0 / np.sqrt(area[free])
    force = np.einsum("nx,nx->n", forces.energy, normal)[free] * weight
    volume = np.einsum("gnx,nx->gn", forces.volume, normal)[:, free]
    held = np.column_stack([volume.T, _gauge(problem, normal, area, free)]) * weight[:, None]
    multiplier = np.linalg.lstsq(held, force, rcond=None)[0]
    rest = force - held @ multiplier
    scale = problem.tension / np.sqrt(problem.area())
    residual = float(np.sqrt((rest**2).sum() / area[free].sum())) / scale
    return multiplier[: len(volume)], residual


def with_restored_volumes(problem: CapillaryProblem) -> CapillaryProblem:
    """Return the problem with its vertices moved along normals until every body has its volume."""
    return with_surface(problem, _corrected(problem, problem.V, problem.forces().volume))


def _corrected(problem: CapillaryProblem, X: FloatArray, directions: FloatArray) -> FloatArray:
    """Restore the volumes by moving along one field (g, n, 3) per body."""
    if not len(problem.targets):
        return X
    free = problem.free[None, :, None]
    along = np.where(free, directions, 0.0)
    scale = np.maximum(np.abs(problem.targets), np.abs(body_volumes_at(problem, X))).max()
    for _ in range(_VOLUME_CORRECTIONS):
        error = problem.targets - body_volumes_at(problem, X)
        if np.abs(error).max() <= _VOLUME_ERROR * scale:
            break
        gain = np.einsum("gnx,hnx->gh", forces_at(problem, X).volume, along)
        X = X + np.einsum("h,hnx->nx", np.linalg.lstsq(gain, error, rcond=None)[0], along)
    return X


def _searched(
    problem: CapillaryProblem, step: FloatArray, directions: FloatArray, slack: float
) -> FloatArray | None:
    """Return the vertices after the first halved step that lowers the energy, volumes restored."""
    before = problem.energy()
    size = 1.0
    for _ in range(_HALVINGS):
        X = _corrected(problem, problem.V + size * step, directions)
        energy = energy_at(problem, X)
        if np.isfinite(energy) and energy <= before + slack * abs(before):
            return X
        size *= 0.5
    return None


# --- flow ----------------------------------------------------------------------------------------


def _flow_step(problem: CapillaryProblem, forces: Forces, _: FloatArray) -> FloatArray | None:
    """Step along the gradient, in the metric of the stiffness matrix of the surface."""
    K = _stiffness(problem)
    K = K + _GAUGE * sp.diags_array(K.diagonal())
    solver = LaplacianSolver(problem.tension * K, problem.fixed)
    sides = [forces.energy, *forces.volume]
    solved = np.split(solver.solve(np.concatenate(sides, axis=1)), len(sides), axis=1)
    down, lift = solved[0], np.array(solved[1:]).reshape(-1, *problem.V.shape)
    gain = np.einsum("gnx,hnx->gh", forces.volume, lift)
    rate = np.einsum("gnx,nx->g", forces.volume, down)
    pressure = np.linalg.lstsq(gain, rate, rcond=None)[0] if len(gain) else rate
    step = -down + np.einsum("h,hnx->nx", pressure, lift)
    return _searched(problem, step, lift, 0.0)


def _stiffness(problem: CapillaryProblem) -> sp.csc_array:
    """Stiffness matrix of the surface; slivers count as equilateral."""
    import igl

    n, F = len(problem.V), problem.F
    with np.errstate(all="ignore"):
        weight = igl.cotmatrix_entries(problem.V, F)  # half cotangents of the corners
    weight[~(np.abs(weight) < _SLIVER).all(axis=1)] = 0.5 / np.sqrt(3.0)
    i, j = F[:, [1, 2, 0]].ravel(), F[:, [2, 0, 1]].ravel()
    off = sp.coo_array((-weight.ravel(), (i, j)), (n, n)).tocsc()
    off = off + off.T
    return sp.csc_array(off - sp.diags_array(off.sum(axis=1)))


# --- Newton --------------------------------------------------------------------------------------


def _newton_step(
    problem: CapillaryProblem, forces: Forces, pressure: FloatArray
) -> FloatArray | None:
    """Step along the normals to the stationary point of the quadratic model of the Lagrangian."""
    normal, area = _normals(problem)
    free = np.flatnonzero(problem.free & (area > 0.0))
    H = hessian_at(problem, problem.V, normal[:, None], pressure)[free][:, free]
    H = sp.csc_array((H + H.T) * 0.5)
    force = np.einsum("nx,nx->n", forces.energy, normal)[free]
    G = np.einsum("gnx,nx->gn", forces.volume, normal)[:, free].T
    gauge = _gauge(problem, normal, area, free)
    border = np.concatenate([G, gauge], axis=1)
    missing = np.concatenate([problem.targets - problem.body_volumes(), np.zeros(gauge.shape[1])])
    u = _constrained(H, sp.diags_array(area[free]), border, -force, missing, problem)
    if u is None:
        return None
    step = np.zeros_like(problem.V)
    step[free] = u[:, None] * normal[free]
    # Near the minimum, energies differ only by rounding; there the full step is taken without a search.
    small = np.abs(u).max() < 1e-5 * np.sqrt(area.sum())
    return _searched(problem, step, forces.volume, 1e-13 if small else 0.0)


def _gauge(
    problem: CapillaryProblem, normal: FloatArray, area: FloatArray, free: NDArray[np.intp]
) -> FloatArray:
    """Return the translations (k, 3 c) of the c components that no fixed vertex holds."""
    _, part = problem.components()
    held = np.unique(part[problem.fixed[problem.F].any(axis=1)])
    columns = []
    for name in np.setdiff1d(part, held):
        mine = np.zeros(len(problem.V))
        mine[problem.F[part == name]] = 1.0
        columns.append((normal * (mine * area)[:, None])[free])
    return np.concatenate(columns, axis=1) if columns else np.empty((len(free), 0))


def _constrained(
    H: sp.csc_array,
    M: sp.dia_array,
    border: FloatArray,
    right: FloatArray,
    missing: FloatArray,
    problem: CapillaryProblem,
) -> FloatArray | None:
    """Solve the bordered system, with H shifted until it is positive where the border vanishes.

    H is positive there if and only if the bordered matrix has exactly as many negative eigenvalues as the
    border has columns. They are counted in the factor of H and in its Schur complement.
    """
    scale = problem.tension / problem.area()
    shift = 0.0
    for k in range(_SHIFTS):
        factor, negative = _factored(sp.csc_array(H + shift * M))
        if factor is not None:
            solved = factor(np.column_stack([right, border]))
            u, lifted = solved[:, 0], solved[:, 1:]
            schur = border.T @ lifted
            if negative + int((np.linalg.eigvalsh(-0.5 * (schur + schur.T)) < 0.0).sum()) == len(
                schur
            ):
                if not len(schur):
                    return np.asarray(u)
                multiplier = np.linalg.solve(schur, missing - border.T @ u)
                return np.asarray(u + lifted @ multiplier)
        shift = scale * _FIRST_SHIFT * _SHIFT_FACTOR**k
    return None


def _factored(A: sp.csc_array) -> tuple[Callable[[FloatArray], FloatArray] | None, int]:
    """Factor a symmetric matrix with pivots on its diagonal, and count its negative eigenvalues."""
    try:
        factor = splu(A, "MMD_AT_PLUS_A", 0.0, options={"SymmetricMode": True})
    except RuntimeError:
        return None, 0
    if not np.array_equal(factor.perm_r, factor.perm_c):
        return None, 0  # a pivot of zero
    return factor.solve, int((factor.U.diagonal() < 0.0).sum())
