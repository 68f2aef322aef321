"""How long edges become: L as a number, an array, a function or `Adaptive`, and what bounds it."""

from __future__ import annotations

import numpy as np

from benchmarks.meshes import load_arrays
from benchmarks.panels import Panel, Picture, by_amount, face_distances
from remeshvec import Adaptive, remesh

from .scene import CREATURE, SHEET, crossing_faces, panel, side_by_side


def L() -> Picture:
    """One length for all edges, and two."""
    V, F = load_arrays("creature")
    return side_by_side([panel(f"L={L}", remesh(V, F, L)) for L in (0.06, 0.15)], CREATURE)


def L_array() -> Picture:
    """Give a length at every vertex, and a function of points."""
    V, F = load_arrays("wavy_sheet")
    away = np.linalg.norm(V[:, :2] - [3.5, 0.8], axis=1)
    panels = [
        panel("L=0.06 + 0.12 * away (an array)", remesh(V, F, 0.06 + 0.12 * away)),
        panel("L=lambda P: 0.06 + 0.05 * P[:, 0]", remesh(V, F, lambda P: 0.06 + 0.05 * P[:, 0])),
    ]
    return side_by_side(panels, SHEET)


def adaptive() -> Picture:
    """Lengths from the curvature."""
    V, F = load_arrays("creature")
    panels = [panel(f"L=Adaptive({t})", remesh(V, F, Adaptive(t))) for t in (0.02, 0.006)]
    return side_by_side(panels, CREATURE)


def gradation() -> Picture:
    """How fast lengths may grow."""
    V, F = load_arrays("wavy_sheet")
    near = np.linalg.norm(V[:, :2] - [3.5, 0.8], axis=1) < 0.1
    L = np.where(near, 0.03, 0.3)
    panels = [panel(f"gradation={ratio}", remesh(V, F, L, gradation=ratio)) for ratio in (1.2, 3.0)]
    return side_by_side(panels, SHEET)


def n_faces() -> Picture:
    """Numbers of faces."""
    V, F = load_arrays("creature")
    panels = [panel(f"n_faces={n}", remesh(V, F, n_faces=n)) for n in (600, 3000)]
    return side_by_side(panels, CREATURE)


def n_vertices() -> Picture:
    """Numbers of vertices."""
    V, F = load_arrays("pretzel")
    results = {n: remesh(V, F, n_vertices=n) for n in (400, 1600)}
    panels = [
        panel(f"n_vertices={n}", result, note=f", {len(result.V):,} vertices")
        for n, result in results.items()
    ]
    return side_by_side(panels, (20.0, 40.0))


def max_deviation() -> Picture:
    """Faces as large as asked for, but where these would leave the input."""
    V, F = load_arrays("creature")
    panels: list[Panel] = []
    for bound in (None, 0.01):
        result = remesh(V, F, 0.16, max_deviation=bound)
        away = face_distances(V, F, result)
        note = f", up to {away.max():.3f} away"
        colours = by_amount(away, 0.03)
        panels.append(panel(f"L=0.16, max_deviation={bound}", result, colours, note))
    return side_by_side(panels, CREATURE)


def clearance() -> Picture:
    """Shorter edges where chords would reach the next sheet."""
    return crossing_faces([{"clearance": share} for share in (None, 0.4)])


PICTURES = (L, L_array, adaptive, gradation, n_faces, n_vertices, max_deviation, clearance)
