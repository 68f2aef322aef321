"""What the scripts of the gallery share: views, panels, colours that measure faces."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.panels import FloatArray, IntArray, Panel, Picture, by_amount
from data.shapes.basic import icosphere
from remeshvec import remesh

CREATURE = (20.0, 15.0)  # views: degrees to the right of the front, upwards
BRACKET = (35.0, 30.0)
SHEET = (0.0, 55.0)
WIDTH = 900  # pixels of a picture


def side_by_side(panels: list[Panel], view: tuple[float, float], columns: int = 2) -> Picture:
    """Panels of one picture."""
    return Picture(panels, view, columns, WIDTH)


def panel(caption: str, result: Any, colours: Any = None, note: str = "", **more: Any) -> Panel:
    """Show a result with its feature edges, and without dots unless they are given."""
    return Panel(caption, result.V, result.F, colours, result.feature_edges, note=note, **more)


def smallest_angles(V: FloatArray, F: IntArray) -> FloatArray:
    """Degrees, one a face."""
    a, b, c = np.moveaxis(lengths(V, F), 1, 0)
    cosines = [(x**2 + y**2 - z**2) / (2 * x * y) for x, y, z in ((a, b, c), (b, c, a), (c, a, b))]
    return np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))).min(axis=0)


def lengths(V: FloatArray, F: IntArray) -> FloatArray:
    """Lengths of the edges of every face, (m, 3)."""
    return np.linalg.norm(V[F] - V[np.roll(F, 1, axis=1)], axis=2)


def crossing_faces(choices: list[dict[str, Any]]) -> Picture:
    """Show a hollow ball whose wall is thinner than a chord bulges, with faces that cross in colour."""
    outside, F = icosphere(4)
    V, F = np.vstack([outside, 0.988 * outside]), np.vstack([F, F[:, ::-1] + len(outside)])
    panels = []
    for choice in choices:
        result = remesh(V, F, 0.3, **choice)
        crossing = result.report.find_defects(check_intersections=True).crossing
        amount = np.zeros(len(result.F))
        amount[crossing] = 1.0
        caption = ", ".join(f"{name}={value}" for name, value in choice.items())
        note = f", {len(crossing)} of them cross others"
        panels.append(panel(caption, result, by_amount(amount, 1.0), note))
    return side_by_side(panels, (20.0, 35.0))


def by_angle(result: Any, worst: float = 36.0, good: float = 46.0) -> Any:
    """Colour faces whose smallest angle is small: full colour at ``worst`` degrees."""
    return by_amount(np.maximum(good - smallest_angles(result.V, result.F), 0.0), good - worst)


def by_length(result: Any, low: float = 0.8, high: float = 4 / 3) -> Any:
    """Colour faces with an edge below ``low * L`` or above ``high * L``: full colour at twice as far."""
    ratio = np.log(lengths(result.V, result.F) / result.report.target_length)
    outside = np.maximum(ratio - np.log(high), np.log(low) - ratio).max(axis=1)
    return by_amount(np.maximum(outside, 0.0), 0.25)
