"""Films and drops with known answers, before they are minimised."""

from __future__ import annotations

import numpy as np

from .basic import Arrays, cylinder


def catenoid(half: float, n: int = 64) -> Arrays:
    """Cylinder between two rings of radius 1 with n vertices, at heights ``-half`` and ``half``."""
    V, F = cylinder(n, 1 + 2 * round(half * n / (2 * np.pi)))
    V[:, 2] = (V[:, 2] - 1) * half
    return V, F


def catenoid_area(half: float) -> float:
    """Area of the stable minimal surface between these rings."""
    a = 1.0
    for _ in range(5000):
        a = 1 / np.cosh(half / a)
    return float(np.pi * a * a * (np.sinh(2 * half / a) + 2 * half / a))


def cone(n: int, height: float) -> Arrays:
    """Cone on a disc of radius 1: a drop before it is minimised."""
    t = 2 * np.pi * np.arange(n) / n
    V = np.vstack([np.column_stack([np.cos(t), np.sin(t), 0 * t]), [[0, 0, height]]])
    return V, np.column_stack([np.arange(n), (np.arange(n) + 1) % n, np.full(n, n)])
