"""Meshes on which remeshers fold: needles beside what must stay, walls thinner than a chord bulges."""

import numpy as np
import pytest
from helpers import zoo

from remeshvec import remesh
from remeshvec.input.prepare import prepare
from remeshvec.reference.crossings import crossing_faces
from remeshvec.sweeps.guard import tree_of


def strip(columns, width):
    """A flat strip of length 1, much wider than long: needles side by side."""
    x, o, i = np.linspace(0, 1, columns), np.zeros(columns), np.arange(columns - 1)
    V = np.r_[np.c_[x, o, o], np.c_[x, o + width, o]]
    return V, np.vstack([np.c_[i, i + 1, i + columns + 1], np.c_[i, i + columns + 1, i + columns]])


def thin_ring(wall, n=100):
    """A closed tube of radius 1 with a thin wall: four circular creases."""
    t, i = 2 * np.pi * np.arange(n) / n, np.arange(n)
    j, P, z = (i + 1) % n, np.c_[np.cos(t), np.sin(t)], np.zeros(n)
    V = np.vstack([np.c_[r * P, z + h] for h in (0, 1) for r in (1, 1 - wall)])
    F = []
    for a, b in [(0, 2), (3, 1), (2, 3), (1, 0)]:
        F += [
            np.c_[a * n + i, a * n + j, b * n + j],
            np.c_[a * n + i, b * n + j, b * n + i],
        ]
    return V, np.vstack(F)


def junction():
    """Three sheets of a few large faces on one edge, of which three faces must stay."""
    V = [(3, 2, 0), (3, 2, 1), (3, 2, 2), (3, 3, 1), (3, 3, 2), (3, 3, 3), (4, 3, 1), (4, 3, 2)]
    V += [(4, 3, 3), (4, 3, 4), (4, 4, 3)]
    F = [(1, 3, 0), (4, 3, 1), (3, 4, 7), (3, 7, 6), (3, 6, 1), (2, 7, 4), (5, 9, 8), (7, 10, 8)]
    return np.array(V, float), np.array([*F, (7, 8, 4)])


def normals(V, F):
    return np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])


def crossing(V, F):
    mesh = prepare(V, np.asarray(F, np.int64), False).mesh
    return len(crossing_faces(tree_of(mesh, False), False))


@pytest.mark.parametrize(
    ("columns", "width", "options"),
    [
        (59, 39.28, {"L": 0.25, "fixed_faces": [20]}),
        (59, 39.28, {"L": 1.0, "fixed_faces": [5, 20, 40, 77, 100]}),
        (39, 18.0, {"L": 0.949, "sliver_check": True, "iterations": 1}),
        (39, 18.0, {"L": 0.949, "sliver_check": True, "preset": "fast"}),
    ],
)
def test_needles_beside_what_stays_do_not_turn_over(columns, width, options):
    V, F = strip(columns, width)
    result = remesh(V, F, **options)
    assert normals(*result)[:, 2].min() > 0
    assert zoo.area(*result) == pytest.approx(width)


def test_a_junction_with_faces_that_stay_comes_to_rest():
    sizes = []
    for iterations in (4, 8, 12):
        result = remesh(*junction(), 0.19, fixed_faces=[3, 6, 7], iterations=iterations)
        edges = np.linalg.norm(result.V[result.F] - result.V[result.F[:, [1, 2, 0]]], axis=2)
        assert edges.min() > 0.05 * 0.19
        sizes.append(len(result.F))
    assert max(sizes) < 1.25 * min(sizes) < 200


@pytest.mark.parametrize("n", [500, 2000])
def test_rims_far_finer_than_the_length_are_thinned(n):
    """All faces beside such a rim are flat; so they may stay, or it could never be thinned."""
    t, i = 2 * np.pi * np.arange(n) / n, np.arange(n)
    j, P, o = (i + 1) % n, np.c_[np.cos(t), np.sin(t)], np.zeros(n)
    V = np.vstack([np.c_[P, o], np.c_[P, o + 0.1], [(0, 0, 0), (0, 0, 0.1)]])
    walls = np.c_[i, j, j + n], np.c_[i, j + n, i + n]
    F = np.vstack([*walls, np.c_[j, i, i * 0 + 2 * n], np.c_[i + n, j + n, i * 0 + 2 * n + 1]])
    result = remesh(V, F, 0.3)
    assert 36 < len(result.feature_edges) < 60
    assert len(result.F) < 400
    assert result.report.quality_after.min_angle > 10


@pytest.mark.parametrize("wall", [0.006, 0.002])
def test_a_thin_ring_does_not_turn_inside_out(wall):
    V, F = thin_ring(wall)
    result = remesh(V, F, 0.3)
    assert crossing(*result) == 0
    assert zoo.volume(*result) == pytest.approx(zoo.volume(V, F), rel=0.1)
