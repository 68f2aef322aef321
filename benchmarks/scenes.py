"""Pictures of modelling: fair bumps, edits with details, smoothing."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from data.shapes.drawn import bumpy_bar
from remeshvec import EditedSurface, Editor, MultiresolutionEditor, deform, quality, remesh, smooth

from .meshes import load
from .panels import FloatArray, IntArray, Panel, Picture, by_label

QUARTERS = 12  # quarter turns of the bar


def bump() -> Picture:
    """One handle, three orders: the figure of the report."""
    V, F = remesh(*_square(), 0.022)
    away = np.linalg.norm(V[:, :2], axis=1)
    handle, fixed = away < 0.12, away > 0.42
    lift = np.eye(4)
    lift[2, 3] = 0.3
    colours = by_label(np.where(handle[F].all(axis=1), 1, np.where(fixed[F].any(axis=1), -1, 0)))
    names = {1: "membrane, C0", 2: "thin plate, C1", 3: "minimal variation, C2"}
    panels = [
        Panel(f"k={k}: {name}", deform(V, F, handle, fixed, lift, k), F, colours)
        for k, name in names.items()
    ]
    return Picture(panels, view=(20.0, 14.0))


def twist() -> Picture:
    """A bumpy bar turned three times, without and with remeshing."""
    V, F = bumpy_bar()
    handle, fixed = V[:, 0] > 5.1, V[:, 0] < 0.9
    path = [turned((1.0, 0.0, 0.0), 90.0)] * QUARTERS
    panels = [Panel("at rest", V, F, note=_angle(V, F, ~(handle | fixed)))]
    for is_remeshed in (False, True):
        editor = MultiresolutionEditor(V, F, handle, fixed, detail_size=0.6, remesh=is_remeshed)
        surface = editor.move(*path)
        panels.append(_edited(f"three turns, remesh={is_remeshed}", surface))
    middle = surface.V[surface.support].mean(axis=0)
    closer = panels[-1]._replace(caption="its middle", close_up=(middle, 3.0))
    return Picture([*panels, closer], view=(0.0, 12.0), columns=2)


def bend() -> Picture:
    """Displacements alone, and details that turn with their base."""
    V, F = bumpy_bar()
    handle, fixed = V[:, 0] > 5.1, V[:, 0] < 0.9
    T = turned((0.0, 1.0, 0.0), -120.0)
    moved = Editor(V, F, handle, fixed).move(T)
    surface = MultiresolutionEditor(V, F, handle, fixed, detail_size=0.6).move(T)
    panels = [
        Panel("at rest", V, F, note=_angle(V, F, ~(handle | fixed))),
        Panel("Editor", moved, F, note=_angle(moved, F, ~(handle | fixed))),
        _edited("MultiresolutionEditor", surface),
    ]
    return Picture(panels, view=(0.0, 12.0))


def smoothing() -> Picture:
    """Steps of mean curvature flow."""
    sample = load("creature")
    V, F = remesh(sample.V, sample.F, 0.03)
    noise = np.random.default_rng(0).normal(size=V.shape)
    noisy = V + 0.006 * noise
    panels = [Panel("noisy", noisy, F)]
    for step in (0.015**2, 0.06**2):
        W = smooth(noisy, F, step, 3, keep_volume=True)
        panels.append(Panel(f"three steps of {step:.2g}, volume kept", W, F))
    return Picture(panels, view=(20.0, 15.0))


def turned(axis: tuple[float, float, float], degrees: float) -> FloatArray:
    """Turn about an axis through the middle of the bar; (3, 4)."""
    M = Rotation.from_rotvec(np.radians(degrees) * np.array(axis)).as_matrix()
    middle = np.array([3.0, 0.0, 0.0])
    return np.column_stack([M, middle - M @ middle])


def _square() -> tuple[FloatArray, IntArray]:
    V = np.array([[-0.6, -0.6, 0], [0.6, -0.6, 0], [0.6, 0.6, 0], [-0.6, 0.6, 0]], float)
    return V, np.array([[0, 1, 2], [0, 2, 3]])


def _edited(caption: str, surface: EditedSurface) -> Panel:
    return Panel(caption, surface.V, surface.F, note=_angle(surface.V, surface.F, surface.support))


def _angle(V: FloatArray, F: IntArray, support: FloatArray) -> str:
    inner = F[support[F].any(axis=1)]
    return f", angles of at least {quality(V, inner).min_angle:.0f} degrees"
