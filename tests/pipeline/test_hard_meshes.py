"""Meshes on which remeshers fold: needles beside what must stay, walls thinner than a chord bulges."""

import numpy as np
import pytest
from helpers import zoo

from data.shapes.hard import coin, needle_strip, thin_ring, three_sheets
from remeshvec import remesh
from remeshvec.input.prepare import prepare
from remeshvec.reference.crossings import crossing_faces
from remeshvec.sweeps.guard import tree_of


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
    V, F = needle_strip(columns, width)
    result = remesh(V, F, **options)
    assert normals(*result)[:, 2].min() > 0
    assert zoo.area(*result) == pytest.approx(width)


def test_a_junction_with_faces_that_stay_comes_to_rest():
    sizes = []
    for iterations in (4, 8, 12):
        result = remesh(*three_sheets(), 0.19, fixed_faces=[3, 6, 7], iterations=iterations)
        edges = np.linalg.norm(result.V[result.F] - result.V[result.F[:, [1, 2, 0]]], axis=2)
        assert edges.min() > 0.05 * 0.19
        sizes.append(len(result.F))
    assert max(sizes) < 1.25 * min(sizes) < 200


@pytest.mark.parametrize("n", [500, 2000])
def test_rims_far_finer_than_the_length_are_thinned(n):
    """All faces beside such a rim are flat; so they may stay, or it could never be thinned."""
    V, F = coin(n)
    result = remesh(V, F, 0.3)
    assert 36 < len(result.feature_edges) < 60
    assert len(result.F) < 400
    assert result.report.quality_after.min_angle > 10


@pytest.mark.parametrize("options", [{}, {"avoid_intersections": True}])
@pytest.mark.parametrize("wall", [0.006, 0.002])
def test_a_thin_ring_does_not_turn_inside_out(wall, options):
    """Its rims are closer than their chords bulge: faces at creases are looked at in every call."""
    V, F = thin_ring(wall)
    result = remesh(V, F, 0.3, **options)
    assert crossing(*result) == 0
    assert not len(result.report.find_defects(check_intersections=True).crossing)
    assert zoo.volume(*result) == pytest.approx(zoo.volume(V, F), rel=0.3)


@pytest.mark.parametrize("height", [0.8, 3.0, 10.0])
def test_cones_keep_their_tips(height):
    """They were let go for the last phase, which cut off up to 1.4 L."""
    V, F = zoo.bipyramid(24, top=height, bottom=0.0)
    result = remesh(V, F, 0.2)
    assert (V[24] == result.V).all(axis=1).any()
    assert not result.report.defects.folds.size
    at_tip = result.V[result.F[(result.V[result.F] == V[24]).all(axis=2).any(axis=1)]]
    assert 3 <= len(at_tip) <= 5


SQUARE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float), [(0, 1, 2), (0, 2, 3)]


@pytest.mark.parametrize(("L", "least"), [(0.1, 10), (0.03, 8)])
def test_inside_long_rims_faces_come_to_the_length(L, least):
    """The sides stay; a square of two faces came back as it was."""
    result = remesh(*SQUARE, L, boundary="fixed")
    edges = result.V[result.F] - result.V[result.F[:, [1, 2, 0]]]
    inside = np.abs(result.V[result.F].mean(axis=1)[:, :2] - 0.5).max(axis=1) < 0.15
    assert inside.any()
    assert np.median(np.linalg.norm(edges, axis=2)[inside]) < 1.35 * L
    assert result.report.quality_after.min_angle > least
    assert zoo.area(*result) == pytest.approx(1.0)


def test_a_narrow_face_that_stays_does_not_coarsen_its_surroundings():
    """Its long edges ask for long ones along themselves only, not around a tube."""
    t, i = 2 * np.pi * np.arange(48) / 48, np.arange(48)
    j, P = (i + 1) % 48, np.c_[np.cos(t), np.sin(t)]
    V = np.vstack([np.c_[P, 0 * t], np.c_[P, 0 * t + 20.0]])
    F = np.vstack([np.c_[i, j, j + 48], np.c_[i, j + 48, i + 48]])
    result = remesh(V, F, 0.5, fixed_faces=[7])
    assert zoo.area(*result) > 0.99 * zoo.area(V, F)
    assert 1000 < len(result.F) < 3000
