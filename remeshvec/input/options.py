"""Options of a call: presets, what overrides them, and their check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, isfinite, radians
from numbers import Real
from typing import Any

import numpy as np

from ..core.check import positive_count
from ..core.threads import available_threads
from ..errors import OptionError

__all__ = ["PRESETS", "Options", "make_options"]

Schedule = tuple[float, ...]


@dataclass(frozen=True)
class Options:
    """All that steers a call, checked; lengths are factors of the target length."""

    preset: str
    iterations: int  # sweeps
    collapse: Schedule  # edges below are collapsed, a factor a sweep
    split: Schedule  # edges above are split, and no collapse makes longer ones
    foldover: float = 20.0  # degrees a face normal may turn in a collapse
    flip_normal: float = 60.0  # degrees the normals of a quad may differ in a flip
    sliver_check: bool = False  # flips and collapses must not make the worst triangle worse
    quadric_reach: float = 0.5  # how far a collapse may place its vertex from the midpoint
    delaunay_ties: bool = True
    flip_passes: int = 2
    stiffness: float = 60.0  # hold of curved ridges on their vertices while relaxing
    last_relaxations: int = 4  # relaxations in the last sweep, one before
    project: bool = True
    projected_sweeps: int = 8  # the last sweeps, which project
    untangle_rounds: int = 4
    untangle_angle: float = 41.5  # degrees; triangles below it are untangled
    fit_rounds: int = 0
    tol: float | None = None  # stop where a sweep changes less
    max_deviation: float | None = None  # distance from the input, in its units
    threads: int = 1

    @property
    def foldover_cosine(self) -> float:
        """Cosine of `foldover`."""
        return cos(radians(self.foldover))


# Tight thresholds first, relaxed later, give even edges without oscillation; the schedule is stretched
# over the sweeps. Sweeps even out areas and let vertices slide off ridges, which the stiffness
# prevents. `docs/ablation.md` has what each is worth on meshes that these constants were not chosen on;
# the last digits are worth nothing.
_DEFAULT = Options(
    preset="default",
    iterations=12,
    collapse=(0.9, 0.9, 0.88, 0.87, 0.86, 0.84, 0.82, 0.8),
    split=(1.25, 1.25, 1.27, 1.28, 1.29, 1.3, 1.32, 4 / 3),
)

PRESETS: dict[str, Options] = {
    # Botsch and Kobbelt [2004, section 4], as published.
    "fast": Options(
        preset="fast",
        iterations=5,
        collapse=(0.8,),
        split=(4 / 3,),
        quadric_reach=0.0,
        delaunay_ties=False,
        flip_passes=1,
        stiffness=0.0,
        last_relaxations=1,
        untangle_rounds=0,
    ),
    "default": _DEFAULT,
    "fine": replace(
        _DEFAULT,
        preset="fine",
        iterations=16,
        last_relaxations=6,
        fit_rounds=2,
    ),
}


def make_options(preset: str, overrides: dict[str, Any]) -> Options:
    """Check the caller's overrides (None: as the preset says) and put them over a preset.

    Raises
    ------
    OptionError
        An unknown preset, or a value that cannot work.
    """
    if not isinstance(preset, str) or preset not in PRESETS:
        raise OptionError(f"preset must be one of {', '.join(PRESETS)}; got {preset!r}")
    options = PRESETS[preset]
    given = {name: value for name, value in overrides.items() if value is not None}
    iterations = given.pop("iterations", None)
    if iterations is not None:
        iterations = positive_count(iterations, "iterations")
    else:
        iterations = options.iterations
    changes: dict[str, Any] = {
        "iterations": iterations,
        "collapse": _schedule(
            "collapse", given.pop("collapse", None), options.collapse, iterations
        ),
        "split": _schedule("split", given.pop("split", None), options.split, iterations),
        "threads": _threads(given.pop("threads", None)),
    }
    if "foldover" in given:
        changes["foldover"] = _acute_angle("foldover", given.pop("foldover"))
    if "untangle_angle" in given:
        changes["untangle_angle"] = _acute_angle("untangle_angle", given.pop("untangle_angle"))
        changes["untangle_rounds"] = options.untangle_rounds or _DEFAULT.untangle_rounds
    if "tol" in given:
        changes["tol"] = _unit_share("tol", given.pop("tol"))
    if "max_deviation" in given:
        changes["max_deviation"] = _distance("max_deviation", given.pop("max_deviation"))
    for name in ("sliver_check", "project"):
        if name in given:
            changes[name] = _flag(name, given.pop(name))
    if "fit" in given:
        changes["fit_rounds"] = (options.fit_rounds or 2) if _flag("fit", given.pop("fit")) else 0
    assert not given, f"unchecked options: {sorted(given)}"
    if changes.get("project") is False:
        changes["fit_rounds"] = 0
    result = replace(options, **changes)
    for sweep, (low, high) in enumerate(zip(result.collapse, result.split, strict=True)):
        if low >= high:
            raise OptionError(
                f"collapse must be below split; in sweep {sweep} they are {low:g} and {high:g}"
            )
    return result


def _schedule(name: str, given: Any, preset: Schedule, sweeps: int) -> Schedule:
    """One factor a sweep: a number is constant, a sequence is stretched over the sweeps."""
    if given is None and len(preset) in (1, sweeps):
        return preset * (sweeps // len(preset))
    values = preset if given is None else given
    if not isinstance(values, Sequence | np.ndarray) or isinstance(values, str):
        values = (values,)
    try:
        known = np.array([float(value) for value in values])
    except (TypeError, ValueError):
        known = np.array([np.nan])
    if not len(known) or not (np.isfinite(known).all() and (known >= 0.0).all()):
        raise OptionError(
            f"{name} must be a factor of the length, at least 0, or a sequence of them; got {given!r}"
        )
    at = np.linspace(0.0, len(known) - 1.0, sweeps) if sweeps > 1 else [len(known) - 1.0]
    return tuple(float(x) for x in np.interp(at, np.arange(len(known)), known))


def _threads(given: Any) -> int:
    return available_threads() if given is None else positive_count(given, "threads")


def _acute_angle(name: str, value: Any) -> float:
    try:
        angle = float(value)
    except (TypeError, ValueError):
        angle = float("nan")
    if not (isfinite(angle) and 0.0 < angle < 90.0):
        raise OptionError(f"{name} must be an angle in degrees between 0 and 90; got {value!r}")
    return angle


def _unit_share(name: str, value: Any) -> float:
    if not _is_number(value) or not 0.0 <= value <= 1.0:
        raise OptionError(f"{name} must be a share between 0 and 1; got {value!r}")
    return float(value)


def _distance(name: str, value: Any) -> float:
    if not _is_number(value) or not value > 0.0:
        raise OptionError(f"{name} must be a positive distance in the units of V; got {value!r}")
    return float(value)


def _is_number(value: Any) -> bool:
    is_real = isinstance(value, Real) and not isinstance(value, bool | np.bool_)
    return is_real and isfinite(value)


def _flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise OptionError(f"{name} must be True or False; got {value!r}")
    return bool(value)
