"""Pictures of creases that are kept, in red, for ``docs/creases.md``; see `benchmarks.pictures`."""

from __future__ import annotations

from typing import Any

import numpy as np

from data.shapes import cad_parts, voxels
from data.shapes.perturb import perturb
from remeshvec import find_creases, remesh

from .meshes import load
from .panels import KEPT, FloatArray, IntArray, Panel, Picture, by_label


def creases_part() -> Picture:
    """A machine part: its edges are kept, the facets of its holes are not."""
    bracket = load("bracket")
    return Picture(_before_and_after(bracket.V, bracket.F, 3.0), view=(35.0, 30.0))


def creases_mask() -> Picture:
    """A mask of voxels: no terrace is kept, but the edges of a block are."""
    V, F = voxels.level_surface(voxels.ball_and_block())
    return Picture(_before_and_after(V, F, 2.0), view=(25.0, 25.0))


def creases_scan() -> Picture:
    """A noisy sculpture: nothing is kept."""
    creature = load("creature")
    V, F = perturb(creature.V, creature.F, 0.08)
    return Picture(_before_and_after(V, F, 0.05), view=(20.0, 15.0))


def creases_chamfer() -> Picture:
    """A block with chamfers and a groove narrower than the length: both of their creases are kept."""
    V, F = cad_parts.chamfered_block()
    return Picture(_before_and_after(V, F, 0.3), view=(35.0, 25.0))


def creases_labels() -> Picture:
    """Labels of pixels: their borders come out smooth, corners stay."""
    V, F, labels = voxels.painted_sheet()
    panels = [Panel("face_labels of the input", V, F, by_label(labels))]
    result = remesh(V, F, 2.0, face_labels=labels)
    panels.append(_kept(f"remeshed, L = {2.0:g}", result, by_label(result.face_labels)))
    return Picture([panel._replace(ink=KEPT) for panel in panels], view=(0.0, 89.0), columns=2)


def _before_and_after(V: FloatArray, F: IntArray, length: float) -> list[Panel]:
    """Show what a plain angle keeps, what the rule keeps, and the mesh made with the latter."""
    plain = find_creases(V, F, length, feature_angle=30.0)
    creases = find_creases(V, F, length)
    panels = [
        Panel("turns of more than 30°", V, F, lines=plain, note=f", {len(plain):,} edges"),
        Panel("find_creases", V, F, lines=creases, note=f", {len(creases):,} edges"),
        _kept(f"remeshed, L = {length:g}", remesh(V, F, length)),
    ]
    return [panel._replace(ink=KEPT) for panel in panels]


def _kept(caption: str, result: Any, colours: Any = None) -> Panel:
    angle = result.report.quality_after.min_angle
    return Panel(
        caption,
        result.V,
        result.F,
        colours,
        lines=result.feature_edges,
        dots=result.corners,
        note=f", smallest angle {np.floor(angle):.0f}°",
    )


PICTURES = (creases_part, creases_mask, creases_scan, creases_chamfer, creases_labels)
