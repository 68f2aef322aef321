"""What happened in a call: options, counts, seconds, quality; and values that are made when asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from numpy.typing import ArrayLike

from ..core.arguments import flag
from ..core.shown import html_table, one_line
from ..core.vocabulary import IntArray
from ..input.recipe import Recipe
from ..measures.quality import quality
from ..measures.record import HIGHLIGHTS, Quality, side_by_side
from .defects import Defects, find_defects

__all__ = [
    "Report",
]


@dataclass(repr=False, eq=False)
class Report:
    """What happened in a call; ``print`` shows it as a table.

    Attributes
    ----------
    target_length : float
        L, in the units of the input.
    options : Recipe
        The options in force: the preset with what was changed in it.
    sweeps : list of dict
        Counts of edges split, collapsed and flipped, one dict a sweep.
    seconds : dict
        Seconds by phase, and "total".
    stop : str
        Why the sweeps ended.
    dirt : dict
        What was wrong with the input, and how often; empty for a clean mesh.
    features : dict
        Creases of the input that are kept: "crease_edges", "chains", "corners", and how many edges the
        rule of ``feature_angle="auto"`` dropped: "dropped_noise" (it does not
        stand out), "dropped_echo" (the turn repeats beside it), "dropped_terrace" (a step of voxels),
        "dropped_short" (its chain is short or unsure), "dropped_crowded" (a surer crease is too close).
    deviation : dict
        With ``max_deviation`` or an adaptive length, the largest distance found: "to_input" from
        samples of the result (21 a face, on a grid) to the input, and "from_input" from such samples of
        the input to the result. With ``max_deviation`` no sample exceeds 0.8 times the bound; what lies
        between samples is not looked at.
    clearance : dict
        What was done where faces came to cross or to fold because sheets are near; empty if nothing. At
        how many "vertices" of the input lengths are shorter, to which share of what was asked for they
        fall ("shortest"), and how many edges were found to be creases besides ("new_crease_edges").
    """

    target_length: float
    options: Recipe
    sweeps: list[dict[str, int]]
    seconds: dict[str, float]
    stop: str
    dirt: dict[str, int]
    features: dict[str, int]
    deviation: dict[str, float]
    clearance: dict[str, float]
    before: tuple[ArrayLike, ArrayLike]
    after: tuple[ArrayLike, ArrayLike]
    turned: Callable[[], IntArray]

    def __repr__(self) -> str:
        return one_line("Report", *self.facts())

    def __str__(self) -> str:
        lines = [f"note: {name.replace('_', ' ')}: {count:,}" for name, count in self.dirt.items()]
        kept = {name.replace("_", " "): count for name, count in self.features.items() if count}
        if kept:
            lines.append("features: " + ", ".join(f"{name} {n:,}" for name, n in kept.items()))
        for way, distance in self.deviation.items():
            lines.append(f"deviation {way.replace('_', ' ')}: {distance:.4g}")
        lines += [self._course(), "", side_by_side(self.quality_before, self.quality_after)]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        before, after = self.quality_before.rows(), self.quality_after.rows()
        rows = [
            (label, old, new)
            for (label, old), (_, new) in zip(before, after, strict=True)
            if label in HIGHLIGHTS
        ]
        return html_table(rows, ("", "before", "after"), self._course())

    def facts(self) -> tuple[str, ...]:
        """Return what happened in a few words each, without measuring anything."""
        before, after = len(self.before[1]), len(self.after[1])  # type: ignore[arg-type]
        return (
            f"{before:,} faces -> {after:,}",
            f"L = {self.target_length:.4g}",
            f"preset {self.preset}",
            self.stop,
        )

    def _course(self) -> str:
        return (
            f"target length {self.target_length:.4g}, preset {self.preset}, "
            f"{len(self.sweeps)} sweeps in {self.seconds['total']:.2f} s; {self.stop}"
        )

    @property
    def preset(self) -> str:
        """Name of the preset that the call started from."""
        return self.options.preset

    @cached_property
    def quality_before(self) -> Quality:
        """Quality of the input; computed when first asked for."""
        return quality(*self.before, L=self.target_length)

    @cached_property
    def quality_after(self) -> Quality:
        """Quality of the output; computed when first asked for, from the arrays of the result."""
        return quality(*self.after, L=self.target_length)

    @cached_property
    def defects(self) -> Defects:
        """What is wrong with the result, but for intersections; found when first asked for."""
        return self.find_defects()

    def find_defects(self, check_intersections: bool = False) -> Defects:
        """Look for folds, slivers, and faces without area or turned over against the input.

        Parameters
        ----------
        check_intersections : bool
            Whether to look for faces that cross others too.

        Raises
        ------
        OptionError
            ``check_intersections`` is not a boolean.
        """
        check = flag(check_intersections, "check_intersections")
        return find_defects(*self.after, self.turned, check)

    def to_dict(self) -> dict[str, Any]:
        """Return everything as a JSON-ready dict."""
        return {
            "target_length": self.target_length,
            "preset": self.preset,
            "options": dict(vars(self.options)),
            "sweeps": self.sweeps,
            "seconds": self.seconds,
            "stop": self.stop,
            "dirt": self.dirt,
            "features": self.features,
            "deviation": self.deviation,
            "clearance": self.clearance,
            "defects": self.defects.to_dict(),
            "quality_before": self.quality_before.to_dict(),
            "quality_after": self.quality_after.to_dict(),
        }
