"""Where a surface may go: what leaves has no equilibrium."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.vocabulary import FloatArray, IntArray
from .problem import CapillaryProblem

__all__ = ["Room", "find_lost", "found_lost", "room_of", "size_of"]

# How far from the middle of the wires and the surface a vertex may come, in sizes of the problem.
_REACH = 4.0


class Room(NamedTuple):
    """A box around the surface from which no part of a minimum is expected to be absent."""

    centre: FloatArray  # (3,)
    reach: float


def _box(problem: CapillaryProblem) -> tuple[FloatArray, FloatArray]:
    """Corners of the box around the faces; a point where there are none."""
    V = problem.V[problem.F].reshape(-1, 3) if len(problem.F) else np.zeros((1, 3))
    return V.min(axis=0), V.max(axis=0)


def size_of(problem: CapillaryProblem) -> float:
    """Diagonal of the surface, plus the diameter of a ball with the volumes of all bodies."""
    low, high = _box(problem)
    ball = 2.0 * float((0.75 / np.pi * np.abs(problem.targets).sum()) ** (1.0 / 3.0))
    return float(np.linalg.norm(high - low)) + ball


def room_of(problem: CapillaryProblem) -> Room:
    """Return the room of a surface as it is now."""
    low, high = _box(problem)
    return Room(0.5 * (low + high), _REACH * size_of(problem))


def find_lost(problem: CapillaryProblem, room: Room) -> IntArray:
    """Return the components that have left, as `CapillaryProblem.components` numbers them."""
    is_outside = np.asarray((np.abs(problem.V - room.centre) > room.reach).any(axis=1))
    is_lost = is_outside[problem.F].any(axis=1)
    if not is_lost.any():
        return np.empty(0, np.int64)
    _, part = problem.components()
    return np.unique(part[is_lost])


def found_lost(problem: CapillaryProblem, room: Room) -> str:
    """Return why a surface has no equilibrium, or nothing."""
    lost = find_lost(problem, room)
    if not len(lost):
        return ""
    count, part = problem.components()
    faces = int((part == lost[0]).sum())
    which = f"component {lost[0]} of {count}, with {faces:,} faces,"
    load = "its own tension"
    if problem.density and problem.gravity.any():
        weight = abs(problem.density) * float(np.linalg.norm(problem.gravity))
        load = f"gravity (density x gravity = {weight:g})"
    elif len(problem.targets):
        load = f"the volume {float(problem.targets.sum()) + problem.volume_offset:g}"
    return f"no equilibrium: {which} moves on and on under {load}"
