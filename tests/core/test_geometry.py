"""Formulas against their definitions, and Voronoi areas and cotangents against libigl."""

import igl
import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import built

from remeshvec.core import geometry
from remeshvec.operations import flip_gains

RNG = np.random.default_rng(5)
TRIANGLES = RNG.normal(size=(60, 3, 3))
TRIANGLES[:20, 2] = TRIANGLES[:20, 0] + 0.6 * (TRIANGLES[:20, 1] - TRIANGLES[:20, 0])
TRIANGLES[:20] += 0.05 * RNG.normal(size=(20, 3, 3))  # twenty flat ones, mostly obtuse


def corners(T):
    """Turn the rows into the tuples that kernels take."""
    return [tuple(p) for p in T]


def squared_edges(T):
    """Squared lengths of the edges opposite corners 0, 1, 2, and twice the area."""
    opposite = [float(((T[i - 1] - T[i - 2]) ** 2).sum()) for i in range(3)]
    return *opposite, float(np.linalg.norm(np.cross(T[1] - T[0], T[2] - T[0])))


def test_distance_squared_has_the_same_bits_both_ways():
    X = RNG.normal(size=(2, 4))
    there = geometry.distance_squared(X, 0, 1)
    assert there == geometry.distance_squared(X, 1, 0)
    assert there == pytest.approx(((X[0, :3] - X[1, :3]) ** 2).sum())


def test_face_vector_is_the_cross_product():
    for T in TRIANGLES:
        expected = np.cross(T[1] - T[0], T[2] - T[0])
        assert geometry.face_vector(*corners(T)) == pytest.approx(expected)


@pytest.mark.parametrize("limit", [10.0, 45.0, 89.0])
def test_turn_exceeds_an_angle(limit):
    cosine = np.cos(np.radians(limit))
    for angle in (0.0, limit - 0.01, limit + 0.01, 95.0, 180.0):
        s, c = np.sin(np.radians(angle)), np.cos(np.radians(angle))
        assert geometry.turn_exceeds((0, 0, 3.0), (0.2 * s, 0, 0.2 * c), cosine) == (angle > limit)
    assert geometry.turn_exceeds((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), cosine)


def test_mean_ratio_knows_its_extremes():
    assert geometry.mean_ratio(1.0, 1.0, 1.0, np.sqrt(3) / 2) == pytest.approx(1)
    assert geometry.mean_ratio(1.0, 1.0, 4.0, 0.0) == 0
    assert geometry.mean_ratio(0.0, 0.0, 0.0, 0.0) == 0
    assert geometry.mean_ratio(1.0, 1.0, 2.0, 1.0) == pytest.approx(np.sqrt(3) / 2)
    ratios = [geometry.mean_ratio(*squared_edges(T)) for T in TRIANGLES]
    assert min(ratios) > 0 and max(ratios) < 1


def test_mixed_voronoi_areas_add_up_and_agree_with_libigl():
    obtuse = 0
    for T in TRIANGLES:
        parts = geometry.mixed_voronoi_areas(*squared_edges(T))
        expected = igl.massmatrix(T, np.array([[0, 1, 2]]), igl.MASSMATRIX_TYPE_VORONOI)
        assert parts == pytest.approx(expected.diagonal(), rel=1e-9)
        assert sum(parts) == pytest.approx(squared_edges(T)[3] / 2)
        obtuse += max(squared_edges(T)[:3]) > sum(squared_edges(T)[:3]) / 2
    assert 20 < obtuse < 55  # both branches were taken


@pytest.mark.parametrize("double_area", [0.0, 1e-300])
def test_voronoi_areas_of_a_flat_triangle_are_finite(double_area):
    assert np.isfinite(geometry.mixed_voronoi_areas(1.0, 1.0, 4.0, double_area)).all()
    assert np.isfinite(geometry.mixed_voronoi_areas(0.0, 1.0, 1.0, double_area)).all()


def test_angle_from_cosine_keeps_its_promise():
    x = np.linspace(-1, 1, 2001)
    found = np.array([geometry.angle_from_cosine(c) for c in x])
    assert np.abs(found - np.arccos(x)).max() < 7e-5
    assert geometry.angle_from_cosine(1.0 + 1e-12) == 0.0
    assert geometry.angle_from_cosine(-1.0 - 1e-12) == pytest.approx(np.pi)


def test_cotangents_agree_with_libigl():
    V, F = zoo.perturb(*zoo.torus(), amount=0.15)
    mesh, L = built(V, F), igl.cotmatrix(V, F)
    for h in range(mesh.origin.size):
        a, b = mesh.origin[h], mesh.origin[h // 3 * 3 + (h + 1) % 3]
        sides = (h, int(mesh.twin[h]))
        total = sum(flip_gains._cotangent(mesh, g, flip_gains.dot_opposite(mesh, g)) for g in sides)
        assert total / 2 == pytest.approx(L[a, b], rel=1e-9, abs=1e-12)


# --- closest points ------------------------------------------------------------------------------


def test_closest_on_segment():
    for p, a, b in RNG.normal(size=(200, 3, 3)):
        s, squared = geometry.closest_on_segment(*corners((p, a, b)))
        assert 0 <= s <= 1
        assert a + s * (b - a) == pytest.approx(naive.closest_on_segment(p, a, b))
        assert squared == pytest.approx(((p - a - s * (b - a)) ** 2).sum(), rel=1e-12)
    assert geometry.closest_on_segment((1, 0, 0), (0, 0, 0), (0, 0, 0)) == (0.0, 1.0)


def test_closest_on_triangle_from_everywhere():
    regions = set()
    for T in TRIANGLES:
        for p in RNG.normal(scale=2.0, size=(30, 3)):
            s, t, squared = geometry.closest_on_triangle(tuple(p), *corners(T))
            point = T[0] + s * (T[1] - T[0]) + t * (T[2] - T[0])
            _, distance = naive.closest_on_triangle(p, *T)
            assert squared == pytest.approx(((p - point) ** 2).sum(), rel=1e-9, abs=1e-14)
            assert np.sqrt(squared) == pytest.approx(distance, rel=1e-9)
            weights = np.array([1 - s - t, s, t])
            assert weights.min() >= -1e-15
            regions.add(tuple(weights > 1e-12))
    assert len(regions) == 7  # three corners, three edges, the inside


@pytest.mark.parametrize("height", [0.0, 1e-3, 1e-5, 1e-6, 1e-7, 1e-9, 1e-12])
def test_closest_on_a_needle_misses_by_no_more_than_rounding(height):
    T = np.array([[0, 0, 0], [1.0, 0, 0], [0.7, height, 0]]) @ rotation(3)
    for u in RNG.random((300, 3)):
        target = T[0] + u[0] * (T[1] - T[0]) + (1 - u[0]) * u[1] * (T[2] - T[0])
        p = target + 0.1 * (u[2] < 0.5) * rotation(3)[2]
        _, _, squared = geometry.closest_on_triangle(tuple(p), *corners(T))
        truth = np.linalg.norm(p - target)
        assert np.sqrt(squared) <= truth + 2e-7


def test_closest_on_a_triangle_without_area():
    for T in (
        [[0, 0, 0]] * 3,
        [[0, 0, 0], [1, 0, 0], [0, 0, 0]],
        [[0, 0, 0], [1, 0, 0], [3, 0, 0]],
    ):
        T = np.array(T, dtype=float)
        for p in RNG.normal(scale=2, size=(50, 3)):
            s, t, squared = geometry.closest_on_triangle(tuple(p), *corners(T))
            assert np.isfinite([s, t, squared]).all()
            assert np.sqrt(squared) == pytest.approx(naive.closest_on_triangle(p, *T)[1])


def rotation(seed):
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]


# --- the twins themselves ------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["octahedron", "torus", "planar_delaunay", "sliver_fan"])
def test_naive_voronoi_areas_agree_with_libigl(name):
    V, F = zoo.ZOO[name].make()
    expected = igl.massmatrix(V, F, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    assert naive.voronoi_areas(V, F) == pytest.approx(expected, rel=1e-9)


def test_naive_distance_agrees_with_libigl():
    V, F = zoo.torus(8, 5)
    P = RNG.normal(size=(40, 3))
    squared, _, _ = igl.point_mesh_squared_distance(P, V, F)
    assert [naive.distance_to_mesh(p, V, F) for p in P] == pytest.approx(np.sqrt(squared))
