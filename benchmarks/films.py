"""Pictures of capillary surfaces: a cube, a catenoid, and fluid on three wires."""

from __future__ import annotations

import json
from functools import cache

import numpy as np

from data.shapes import films
from remeshvec.evolver import CapillaryProblem, Evolution, Frame, evolve

from .meshes import ROOT
from .panels import Panel, Picture, borders

RINGS = ROOT.parent / "shared" / "data" / "flotation" / "three_rings.json"
REFINED = (16.0, 8.0, 4.0)


def cube() -> Picture:
    """A cube of fluid becomes a sphere."""
    V = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    F = np.array([[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
                  [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]])  # fmt: skip
    done = evolve(CapillaryProblem(V, F, volume=1.0), [0.3, 0.15, 0.08], frames=True)
    first = Panel("start", V, F, note=f", energy {CapillaryProblem(V, F).area():.4f}")
    return Picture([first, *_panels(done, [0, len(done.frames) - 1])], view=(25.0, 20.0))


def catenoid() -> Picture:
    """Rings just too far apart: the film snaps into two discs."""
    done = evolve(CapillaryProblem(*films.catenoid(0.67)), [0.1], sweeps=100, frames=True)
    events = [frame.event for frame in done.frames]
    at = [events.index("cut") - k for k in (6, 3, 1)] + [events.index("cut"), len(events) - 1]
    return Picture(_panels(done, [0, *at]), view=(20.0, 12.0))


def rings() -> Picture:
    """Fluid on three wires: all of it, and a small volume without and with remeshing."""
    panels = []
    for volume, remeshing in (
        ("volume_full", True),
        ("volume_small", False),
        ("volume_small", True),
    ):
        done = fluid(volume, remeshing)
        name = {"volume_full": "full volume", "volume_small": "small volume"}[volume]
        panels += _panels(done, [-1], f"{name}, remeshing={remeshing}")
    return Picture(panels, view=(0.0, 55.0))


def splitting() -> Picture:
    """How the small volume splits."""
    done = fluid("volume_small", True)
    events = [frame.event for frame in done.frames]
    cut = events.index("cut")
    return Picture(_panels(done, [0, cut // 2, cut - 2, cut, cut + 2, -1]), view=(0.0, 55.0))


@cache
def fluid(volume: str, remeshing: bool) -> Evolution:
    """Evolve the report's problem; without remeshing on its triangles, each cut into 16."""
    problem = rings_problem(volume, 0 if remeshing else 2)
    return evolve(problem, REFINED, remeshing=remeshing, frames=True)


def rings_problem(volume: str, refined: int = 0) -> CapillaryProblem:
    """Fluid held by three wires; `volume` is "volume_full" or "volume_small"."""
    import igl

    if not RINGS.exists():
        raise SystemExit(f"{RINGS.name} is not here")
    data = json.loads(RINGS.read_text(encoding="utf-8"))
    V, F = np.array(data["vertices"], float), np.array(data["faces"], np.int64)
    for _ in range(refined):
        V, F = igl.upsample(V, F)
    return CapillaryProblem(
        V, F,  # all wires are boundaries
        volume=data[volume], volume_offset=data["cap_volume"], energy_offset=data["cap_area"],
    )  # fmt: skip


def _panels(done: Evolution, at: list[int], caption: str = "") -> list[Panel]:
    panels = []
    for k in at:
        frame: Frame = done.frames[k]
        text = caption or f"{'end' if frame.event == 'newton' else f'sweep {k + 1}'}"
        note = (
            f", energy {frame.energy:,.4g}, {frame.components} part{'s' * (frame.components > 1)}"
        )
        panels.append(Panel(text, frame.V, frame.F, lines=borders(frame.F), note=note))
    return panels
