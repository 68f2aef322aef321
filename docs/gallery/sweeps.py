"""How the sweeps work: presets, thresholds, guards, projection."""

from __future__ import annotations

from typing import Any

from benchmarks.meshes import load_arrays
from benchmarks.panels import Panel, Picture, by_amount, distances, face_distances
from remeshvec import remesh

from .scene import (
    CREATURE,
    SHEET,
    by_angle,
    by_length,
    crossing_faces,
    panel,
    side_by_side,
    smallest_angles,
)


def preset() -> Picture:
    """Compare the presets: small angles in colour above, distance from the input below."""
    V, F = load_arrays("creature")
    results = {name: remesh(V, F, 0.09, preset=name) for name in ("fast", "default", "fine")}
    panels = []
    for name in ("fast", "default"):
        sharp = smallest_angles(*results[name]) < 48.0
        note = f", {100 * sharp.mean():.0f} % with angles below 48°"
        colours = by_angle(results[name], 40.0, 48.0)
        panels.append(panel(f"preset={name!r}", results[name], colours, note))
    for name in ("default", "fine"):
        panels.append(_distance_panel(f"preset={name!r}", V, F, results[name]))
    return side_by_side(panels, CREATURE)


def iterations() -> Picture:
    """One sweep and all of them; faces with edges out of the band in colour."""
    return _lengths([{"iterations": n} for n in (1, 12)])


def split() -> Picture:
    """Edges are split above 4/3 or 2 lengths; faces with edges out of the band in colour."""
    return _lengths([{"split": 4 / 3}, {"split": 2.0}])


def collapse() -> Picture:
    """Edges are collapsed below 4/5 or 2/5 lengths; faces with edges out of the band in colour."""
    return _lengths([{"collapse": 0.8}, {"collapse": 0.4}])


def foldover() -> Picture:
    """How far a normal may turn in a collapse; faces with edges out of the band in colour."""
    return _lengths([{"foldover": 3.0}, {"foldover": 20.0}])


def sliver_check() -> Picture:
    """Refuse slivers, which keeps bad input bad; faces with edges out of the band in colour."""
    return _lengths([{"sliver_check": False}, {"sliver_check": True}])


def project() -> Picture:
    """Vertices on the input, or where they drift to; their distance from it in colour."""
    V, F = load_arrays("creature")
    panels = []
    for choice in (True, False):
        result = remesh(V, F, 0.09, project=choice)
        away = distances(result.V, V, F)
        colours = by_amount(away[result.F].mean(axis=1), 0.01)
        note = f", vertices up to {away.max():.3f} away"
        panels.append(panel(f"project={choice}", result, colours, note))
    return side_by_side(panels, CREATURE)


def untangle_angle() -> Picture:
    """Improve bad triangles at the end, or not; faces with small angles in colour."""
    V, F = load_arrays("wavy_sheet")
    panels = []
    for angle in (1.0, 43.8):
        result = remesh(V, F, 0.4, untangle_angle=angle)
        note = f", angles from {result.report.quality_after.min_angle:.0f}°"
        panels.append(panel(f"untangle_angle={angle:g}", result, by_angle(result, 40, 43.8), note))
    return side_by_side(panels, SHEET)


def fit() -> Picture:
    """Let faces straddle the input; their distance from it in colour."""
    V, F = load_arrays("creature")
    panels = [
        _distance_panel(f"fit={choice}", V, F, remesh(V, F, 0.09, fit=choice))
        for choice in (False, True)
    ]
    return side_by_side(panels, CREATURE)


def avoid_intersections() -> Picture:
    """A hollow ball whose wall is thinner than a chord bulges; faces that cross others in colour.

    Edges of the length asked for, in both: shorter ones would not cross.
    """
    choices: list[dict[str, Any]] = [
        {"avoid_intersections": avoid, "clearance": None} for avoid in (False, True)
    ]
    return crossing_faces(choices)


def _lengths(choices: list[dict[str, Any]]) -> Picture:
    V, F = load_arrays("creature")
    panels = []
    for choice in choices:
        result = remesh(V, F, 0.09, **choice)
        panels.append(panel(_say(choice), result, by_length(result)))
    return side_by_side(panels, CREATURE)


def _distance_panel(caption: str, V: Any, F: Any, result: Any) -> Panel:
    away = face_distances(V, F, result)
    note = f", {away.mean():.4f} away in the mean"
    return panel(caption, result, by_amount(away, 0.015), note)


def _say(choice: dict[str, Any]) -> str:
    return ", ".join(
        f"{k}={v:.3g}" if isinstance(v, float) else f"{k}={v!r}" for k, v in choice.items()
    )


PICTURES = (
    preset, iterations, split, collapse, foldover, sliver_check, project, untangle_angle, fit,
    avoid_intersections,
)  # fmt: skip
