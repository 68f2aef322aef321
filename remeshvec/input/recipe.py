"""The recipe of a call: presets, what options override in them, and their check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, radians
from typing import Any, NamedTuple

import numpy as np

from ..core.arguments import choice, count, flag, number
from ..core.threads import available_threads
from ..errors import OptionError
from .options import CLEARANCE, RemeshOptions

__all__ = ["PRESETS", "Recipe", "make_recipe"]

Schedule = tuple[float, ...]


class Rounds(NamedTuple):
    """Lloyd rounds, one after the other.

    A high gain with some momentum is the fastest way to a mesh that is even nearby. A small gain with a
    momentum near 1 shakes the mesh: defects of the valences meet and vanish, as in annealing.
    """

    number: int  # at most
    gain: float = 3.0  # share of the way to the centroid that is added to the velocity
    momentum: float = 0.85  # share of the velocity that stays
    trade_angle: float = 25.0  # degrees by which opposite angles must outweigh a step of valence
    stiffness: float = 600.0  # hold of curved ridges on their vertices
    patience: int = 0  # rounds to go on without more even areas; 0: all rounds are run


@dataclass(frozen=True)
class Recipe:
    """All that steers the sweeps and what follows them; lengths are factors of the target length."""

    preset: str
    iterations: int  # sweeps
    collapse: Schedule  # edges below are collapsed, one factor per sweep
    split: Schedule  # edges above are split, and no collapse makes longer ones
    foldover: float = 20.0  # degrees a face normal may turn in a collapse
    flip_normal: float = 60.0  # degrees the normals of a quad may differ in a flip
    sliver_check: bool = False  # flips and collapses must not make the worst triangle worse
    quadric_reach: float = 0.5  # how far a collapse may place its vertex from the midpoint
    delaunay_ties: bool = True  # flips that keep valence restore Delaunay
    flip_passes: int = 2
    stiffness: float = 60.0  # hold of curved ridges on their vertices while relaxing
    last_relaxations: int = 0  # relaxations in the last sweep, one before
    project: bool = True
    projected_sweeps: int = 8  # the last sweeps, which project
    rounds: tuple[Rounds, ...] = (Rounds(20),)  # after the sweeps
    untangle_rounds: int = 4
    untangle_angle: float = 43.8  # degrees; triangles below it are untangled
    fit_rounds: int = 0
    tol: float | None = None  # stop where a sweep changes less
    max_deviation: float | None = None  # distance from the input, in its units
    clearance: float | None = CLEARANCE  # share of the gap to the next sheet that chords may take
    avoid_intersections: bool = False  # no face may cross another that did not
    threads: int = 1

    @property
    def foldover_cosine(self) -> float:
        """Cosine of `foldover`."""
        return cos(radians(self.foldover))


# Tight thresholds first, relaxed later, give even edges without oscillation; the schedule is stretched
# over the sweeps. Sweeps even out areas and let vertices slide off ridges, which the stiffness
# prevents. `docs/ablation.md` has what each is worth on meshes that these constants were not chosen on;
# the last digits are worth nothing.
_DEFAULT = Recipe(
    preset="default",
    iterations=8,
    collapse=(0.9, 0.9, 0.88, 0.87, 0.86, 0.84, 0.82, 0.8),
    split=(1.25, 1.25, 1.27, 1.28, 1.29, 1.3, 1.32, 4 / 3),
)

PRESETS: dict[str, Recipe] = {
    # Botsch and Kobbelt [2004, section 4], as published.
    "fast": Recipe(
        preset="fast",
        iterations=5,
        collapse=(0.8,),
        split=(4 / 3,),
        quadric_reach=0.0,
        delaunay_ties=False,
        flip_passes=1,
        stiffness=0.0,
        last_relaxations=1,
        rounds=(),
        untangle_rounds=0,
    ),
    "default": _DEFAULT,
    "even": replace(
        _DEFAULT,
        preset="even",
        rounds=(
            Rounds(460, gain=0.5, momentum=0.998, trade_angle=10.0, stiffness=1200.0, patience=80),
            Rounds(40, trade_angle=10.0, patience=10),
        ),
        untangle_rounds=8,
        untangle_angle=44.1,
    ),
    "fine": replace(
        _DEFAULT,
        preset="fine",
        iterations=16,
        fit_rounds=2,
    ),
}


def make_recipe(options: RemeshOptions) -> Recipe:
    """Put the caller's options over a preset, and check both.

    Raises
    ------
    OptionError
        An unknown preset, or a value that cannot work.
    """
    base = PRESETS[choice(options.preset, "preset", PRESETS)]
    given = {name: value for name, value in vars(options).items() if value is not None}
    iterations = count(given.get("iterations", base.iterations), "iterations")
    changes: dict[str, Any] = {
        "iterations": iterations,
        "collapse": _schedule("collapse", options.collapse, base.collapse, iterations),
        "split": _schedule("split", options.split, base.split, iterations),
        "threads": count(given.get("threads", available_threads()), "threads"),
    }
    if options.clearance is None:  # differs from the default
        changes["clearance"] = None
    for name, check in _CHECKS.items():
        if name in given:
            changes[name] = check(given[name], name)
    if "untangle_angle" in given:
        changes["untangle_rounds"] = base.untangle_rounds or _DEFAULT.untangle_rounds
    if "fit" in given:
        changes["fit_rounds"] = (base.fit_rounds or 2) if flag(given["fit"], "fit") else 0
    if changes.get("project") is False:
        changes["fit_rounds"] = 0
    recipe = replace(base, **changes)
    _check_order(recipe)
    return recipe


def _angle(value: Any, name: str) -> float:
    return number(value, name, above=0.0, below=90.0, unit="degrees")


_CHECKS = {
    "foldover": _angle,
    "untangle_angle": _angle,
    "tol": lambda value, name: number(value, name, low=0.0, high=1.0),
    "max_deviation": lambda value, name: number(value, name, above=0.0, unit="units of V"),
    "clearance": lambda value, name: number(value, name, above=0.0, high=1.0),
    "sliver_check": flag,
    "project": flag,
    "avoid_intersections": flag,
}


def _schedule(name: str, given: Any, preset: Schedule, sweeps: int) -> Schedule:
    """One factor per sweep: a number is constant, a sequence is stretched over the sweeps."""
    if given is None and len(preset) in (1, sweeps):
        return preset * (sweeps // len(preset))
    values = preset if given is None else given
    if not isinstance(values, Sequence | np.ndarray) or isinstance(values, str):
        values = (values,)
    try:
        known = np.array([number(value, name, low=0.0) for value in values])
    except OptionError:
        known = np.empty(0)
    if not len(known):
        raise OptionError(
            f"{name} must be a factor of the length, at least 0, or a sequence of them; got {given!r}"
        )
    at = np.linspace(0.0, len(known) - 1.0, sweeps) if sweeps > 1 else [len(known) - 1.0]
    return tuple(float(x) for x in np.interp(at, np.arange(len(known)), known))


def _check_order(recipe: Recipe) -> None:
    """Refuse thresholds between which no edge could stay."""
    for sweep, (low, high) in enumerate(zip(recipe.collapse, recipe.split, strict=True)):
        if low >= high:
            raise OptionError(
                f"collapse must be below split; in sweep {sweep} they are {low:g} and {high:g}"
            )
