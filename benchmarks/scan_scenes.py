"""Pictures of scans and masks on their way to an even surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from data.shapes.scans import Dirt, mask_surface, scan
from remeshvec import denoise, quality, remesh, repair

from .panels import FloatArray, IntArray, Panel, Picture, by_label

VIEW = (20.0, 15.0)


def scan_steps() -> Picture:
    """A raw scan, repaired, without its noise, and remeshed."""
    V, F = scan(0.032, Dirt(islands=150, handles=0, holes=8, noise=0.4), seed=3)
    body = repair(V, F, keep_largest=True, fill_holes=100)
    filled = by_label(np.where(body.face_source < 0, 1, 0))
    calm = denoise(body.V, body.F)
    result = remesh(calm, body.F, 0.04)
    panels = [
        Panel("scan", V, F, note=f", {quality(V, F).components} components"),
        Panel("repair", body.V, body.F, filled, note=", filled holes in colour"),
        Panel("denoise", calm, body.F, filled, note=_narrow(calm, body.F)),
        Panel("remesh", result.V, result.F, note=_narrow(result.V, result.F)),
    ]
    return Picture(panels, VIEW, columns=2)


def scan_mask() -> Picture:
    """A mask of voxels, without and with its steps removed."""
    V, F = mask_surface(0.045)
    raw, calm = remesh(V, F, 0.045), remesh(denoise(V, F), F, 0.045)
    panels = [
        Panel("surface of a mask", V, F, note=_narrow(V, F)),
        Panel("remesh alone", raw.V, raw.F, note=_narrow(raw.V, raw.F)),
        Panel("denoise and remesh", calm.V, calm.F, note=_narrow(calm.V, calm.F)),
    ]
    return Picture(panels, VIEW)


def _narrow(V: FloatArray, F: IntArray) -> str:
    return f", 1 % of angles below {quality(V, F).min_angle_p1:.0f} degrees"


PICTURES: tuple[Callable[[], Picture], ...] = (scan_steps, scan_mask)
