"""Steps towards least energy: along a flow, by Newton's method, or by whichever gets on.

Every step ends with restored volumes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ..core.vocabulary import FloatArray
from ..modelling.solver import LaplacianSolver
from .forces import Forces, body_volumes_at, energy_at, forces_at, hessian_at
from .motions import Motions, find_motions
from .problem import CapillaryProblem, with_surface
from .room import size_of

__all__ = ["METHODS", "Advance", "advance_by", "balance", "with_restored_volumes"]

METHODS = ("auto", "flow", "newton")
Advance = Callable[[CapillaryProblem, Forces, FloatArray], FloatArray | None]

# Steps of the flow before Newton's method is tried, doubled with each refusal up to the second number;
# a step of Newton's method must bring the residual down to this share.
_FIRST_FLOW, _LONGEST_FLOW, _NEWTON_SHARE = 4, 32, 0.5

# No vertex moves farther in a step, in sizes of the problem: what has no equilibrium leaves step by step.
_LONGEST_STEP = 0.25

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


# --- forces and volumes --------------------------------------------------------------------------


def balance(problem: CapillaryProblem, forces: Forces) -> tuple[FloatArray, float]:
    """Return the pressures that balance the forces best, and the residual; see `Minimum`."""
    motions = find_motions(problem)
    weight = 1.0 / np.sqrt(motions.area)
    force = motions.along(forces.energy) * weight
    volume = motions.along(forces.volume)
    held = np.column_stack([volume.T, _gauge(problem, motions)]) * weight[:, None]
    multiplier = np.linalg.lstsq(held, force, rcond=None)[0]
    rest = force - held @ multiplier
    scale = problem.tension / np.sqrt(problem.area())
    residual = float(np.sqrt((rest**2).sum() / motions.area.sum())) / scale
    return np.asarray(multiplier[: len(volume)], np.float64), residual


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
    longest = float(np.linalg.norm(step, axis=1).max(initial=0.0))
    size = min(1.0, _LONGEST_STEP * size_of(problem) / max(longest, np.finfo(float).tiny))
    for _ in range(_HALVINGS):
        X = _corrected(problem, problem.V + size * step, directions)
        energy = energy_at(problem, X)
        if np.isfinite(energy) and energy <= before + slack * abs(before):
            return X
        size *= 0.5
    return None


# --- both ----------------------------------------------------------------------------------------


def advance_by(method: str) -> Advance:
    """Return what takes the steps of one of the ``METHODS``."""
    ways: dict[str, Advance] = {"auto": _Auto(), "flow": _flow_step, "newton": _newton_step}
    return ways[method]


class _Auto:
    """The flow while Newton's method does not get on, then Newton's method."""

    def __init__(self) -> None:
        self.n_flow = self.wait = _FIRST_FLOW

    def __call__(
        self, problem: CapillaryProblem, forces: Forces, pressure: FloatArray
    ) -> FloatArray | None:
        """Take a step of either."""
        if self.n_flow == 0:
            moved = _newton_step(problem, forces, pressure)
            if moved is not None and _gets_on(problem, moved):
                return moved
            self.wait = min(2 * self.wait, _LONGEST_FLOW)
            self.n_flow = self.wait
        self.n_flow -= 1
        moved = _flow_step(problem, forces, pressure)
        return _newton_step(problem, forces, pressure) if moved is None else moved


def _gets_on(problem: CapillaryProblem, moved: FloatArray) -> bool:
    """Tell whether a step brings the residual down enough."""
    after = with_surface(problem, moved)
    _, before = balance(problem, problem.forces())
    return balance(after, after.forces())[1] <= _NEWTON_SHARE * before


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
    """Step to the stationary point of the quadratic model of the Lagrangian."""
    motions = find_motions(problem)
    H = _hessian_along(problem, motions, pressure)
    force, G = motions.along(forces.energy), motions.along(forces.volume).T
    gauge = _gauge(problem, motions)
    border = np.concatenate([G, gauge], axis=1)
    missing = np.concatenate([problem.targets - problem.body_volumes(), np.zeros(gauge.shape[1])])
    u = _constrained(H, sp.diags_array(motions.area), border, -force, missing, problem)
    if u is None:
        return None
    # Near the minimum, energies differ only by rounding; there the full step is taken without a search.
    small = np.abs(u).max() < 1e-5 * np.sqrt(motions.area.sum())
    return _searched(problem, motions.spread(u), forces.volume, 1e-13 if small else 0.0)


def _hessian_along(
    problem: CapillaryProblem, motions: Motions, pressure: FloatArray
) -> sp.csc_array:
    """Second derivatives (k, k) of the Lagrangian along the motions."""
    if motions.is_normal:  # a ninth of the work
        H = hessian_at(problem, problem.V, motions.normal[:, None], pressure)
        H = H[motions.vertex][:, motions.vertex]
    else:
        space = np.broadcast_to(np.eye(3), (len(problem.V), 3, 3))
        k = len(motions.vertex)
        rows = 3 * motions.vertex[:, None] + np.arange(3)
        entries = motions.direction.ravel(), (rows.ravel(), np.repeat(np.arange(k), 3))
        P = sp.csr_array(sp.coo_array(entries, (3 * len(problem.V), k)))
        H = P.T @ hessian_at(problem, problem.V, space, pressure) @ P
    return sp.csc_array((H + H.T) * 0.5)


def _gauge(problem: CapillaryProblem, motions: Motions) -> FloatArray:
    """Return the translations (k, 3 c) of the c components that no fixed vertex holds."""
    _, part = problem.components()
    held = np.unique(part[problem.fixed[problem.F].any(axis=1)])
    columns = []
    for name in np.setdiff1d(part, held):
        mine = np.zeros(len(problem.V))
        mine[problem.F[part == name]] = 1.0
        columns.append(motions.direction * (mine[motions.vertex] * motions.area)[:, None])
    return np.concatenate(columns, axis=1) if columns else np.empty((len(motions.vertex), 0))


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
