"""Surfaces on which remeshers fold: needles beside what must stay, walls thinner than chords bulge."""

from __future__ import annotations

import numpy as np

from .basic import Arrays

__all__ = ["coin", "needle_strip", "thin_ring", "three_sheets"]


def needle_strip(columns: int, width: float) -> Arrays:
    """Return a flat strip of length 1, much wider than long: needles side by side."""
    x, o, i = np.linspace(0, 1, columns), np.zeros(columns), np.arange(columns - 1)
    V = np.r_[np.c_[x, o, o], np.c_[x, o + width, o]]
    return V, np.vstack([np.c_[i, i + 1, i + columns + 1], np.c_[i, i + columns + 1, i + columns]])


def _circle(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t, i = 2 * np.pi * np.arange(n) / n, np.arange(n)
    return np.c_[np.cos(t), np.sin(t)], i, (i + 1) % n


def thin_ring(wall: float, n: int = 100) -> Arrays:
    """Return a closed tube of radius and height 1 with a thin wall: four circular creases."""
    P, i, j = _circle(n)
    V = np.vstack([np.c_[r * P, np.full(n, h)] for h in (0.0, 1.0) for r in (1, 1 - wall)])
    F = []
    for a, b in [(0, 2), (3, 1), (2, 3), (1, 0)]:
        F += [np.c_[a * n + i, a * n + j, b * n + j], np.c_[a * n + i, b * n + j, b * n + i]]
    return V, np.vstack(F)


def coin(n: int, height: float = 0.1) -> Arrays:
    """Return a flat closed cylinder of radius 1 whose rims have far shorter edges than its height."""
    P, i, j = _circle(n)
    V = np.vstack([np.c_[P, np.full(n, h)] for h in (0.0, height)] + [[(0, 0, 0), (0, 0, height)]])
    low, high = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    walls = [np.c_[i, j, j + n], np.c_[i, j + n, i + n]]
    return V, np.vstack([*walls, np.c_[j, i, low], np.c_[i + n, j + n, high]])


def three_sheets() -> Arrays:
    """Return three sheets of a few large faces that meet on one edge."""
    V = [(3, 2, 0), (3, 2, 1), (3, 2, 2), (3, 3, 1), (3, 3, 2), (3, 3, 3), (4, 3, 1), (4, 3, 2)]
    V += [(4, 3, 3), (4, 3, 4), (4, 4, 3)]
    F = [(1, 3, 0), (4, 3, 1), (3, 4, 7), (3, 7, 6), (3, 6, 1), (2, 7, 4), (5, 9, 8), (7, 10, 8)]
    return np.array(V, float), np.array([*F, (7, 8, 4)])
