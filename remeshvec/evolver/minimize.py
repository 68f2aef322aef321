"""Minimise the energy of a capillary surface at prescribed volumes: a flow, and Newton's method.

Both work with the Lagrangian, which is energy minus pressure times volume. Every step ends with restored
volumes, so that the energies of a history can be compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ..core.arguments import asks_to_stop, choice, count, function, number
from ..core.vocabulary import FloatArray, IntArray
from .problem import CapillaryProblem, as_problem, check_held, with_surface
from .room import found_lost, room_of
from .steps import METHODS, Advance, advance_by, balance, with_restored_volumes

__all__ = ["Minimum", "StepCallback", "measured", "minimize", "unmoved"]

StepCallback = Callable[[int, CapillaryProblem, float, float], object]

# The most steps, unless the caller gives a number.
_MOST_STEPS = {"auto": 200, "flow": 200, "newton": 50}


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
        Root mean square of the force density (energy gradient minus pressure) on free vertices, in all
        directions that do not only slide them within the surface, times the square root of the area, over
        the tension; dimensionless. No force is larger than this times tension and square root of area.
    converged : bool
        Whether the residual is below the tolerance.
    stop : str
        Reason for the end. "no equilibrium: ..." if a component moves away for ever, with its load.
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
    method: Literal["auto", "flow", "newton"] = "flow",
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
    method : {"auto", "flow", "newton"}
        "auto": the flow until steps of Newton's method at least halve the residual, then those.
        "flow": descent with the cotangent Laplacian as the metric [Pinkall and Polthier 1993, section
        4]. It works from any start and converges linearly. "newton": one degree of freedom per vertex,
        along its normal; two across lines where sheets meet, three where such lines do. The Hessian of
        the Lagrangian, bordered by the volumes, is shifted until its inertia shows that it is positive
        on all motions that keep the volumes; near a minimum it converges quadratically. None improves
        the triangles: `evolve` remeshes in between.
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
        The method is unknown, a number is out of range, an argument has the wrong type, or nothing holds
        the surface.
    """
    check_held(as_problem(problem))
    tolerance = number(tol, "tol", above=0.0)
    advance = advance_by(choice(method, "method", METHODS))
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
    advance: Advance,
    most: int,
    tolerance: float,
    callback: StepCallback | None,
) -> Minimum:
    """Take steps until there is a reason to stop."""
    history: list[dict[str, float]] = []
    pressure, residual = balance(now, now.forces())
    stop, room = "all steps done", room_of(now)
    for step in range(most):
        if residual <= tolerance:
            stop = "converged"
            break
        moved = advance(now, now.forces(), pressure)
        if moved is None:
            stop = "no step lowers the energy"
            break
        now = with_surface(now, moved)
        pressure, residual = balance(now, now.forces())
        history.append({"energy": now.energy(), "residual": residual})
        lost = found_lost(now, room)
        if lost:
            stop = lost
            break
        if callback is not None and asks_to_stop(callback(step, now, now.energy(), residual)):
            stop = "cancelled"
            break
    else:
        stop = "converged" if residual <= tolerance else stop
    return _minimum(now, pressure, residual, tolerance, stop, history)


def measured(problem: CapillaryProblem, tolerance: float, stop: str) -> Minimum:
    """Return the result for a surface as it is, with its pressures and its residual."""
    pressure, residual = balance(problem, problem.forces())
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
