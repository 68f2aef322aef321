"""The same mesh turned, scaled or moved gives the same result, turned, scaled or moved."""

import numpy as np
import pytest
from helpers import zoo

from remeshvec import remesh

NAMES = ["torus", "planar_delaunay", "annulus", "genus_2", "icosphere"]


def mesh(name):
    """Perturbed, so that no two lengths tie."""
    return zoo.perturb(*zoo.ZOO[name].make(), amount=0.03, seed=7)


@pytest.mark.parametrize("preset", ["fast", "default", "fine"])
@pytest.mark.parametrize("exponent", [-20, -1, 3, 40])
def test_powers_of_two_are_exact(exponent, preset):
    for name in NAMES[:3]:
        V, F = mesh(name)
        L = 0.8 * zoo.mean_edge(V, F)
        one = remesh(V, F, L, preset=preset)
        two = remesh(V * 2.0**exponent, F, L * 2.0**exponent, preset=preset)
        assert np.array_equal(two.V, one.V * 2.0**exponent)
        assert np.array_equal(two.F, one.F)
        assert np.array_equal(two.birth_face, one.birth_face)
        assert np.array_equal(two.birth_barycentric, one.birth_barycentric)


def assert_alike(one, two, V, W, F, L):
    """Rounding may decide a flip; sizes, areas and shapes agree."""
    assert len(two.F) == pytest.approx(len(one.F), rel=0.08)
    assert zoo.area(*two) == pytest.approx(zoo.area(*one), rel=0.03)
    assert zoo.euler_number(two.F) == zoo.euler_number(one.F)
    a, b = one.report.quality_after, two.report.quality_after
    assert b.edge_mean == pytest.approx(a.edge_mean, rel=0.05)
    assert b.edge_cv == pytest.approx(a.edge_cv, abs=0.05)


@pytest.mark.parametrize("name", NAMES)
def test_rotations(name):
    """Morton order turns with nothing, so the order of work differs and the result is alike only."""
    V, F = mesh(name)
    L = 0.5 * zoo.mean_edge(V, F)
    W = zoo.rotate(V)
    one, two = remesh(V, F, L), remesh(W, F, L)
    assert_alike(one, two, V, W, F, L)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("factor", [3.0, 1 / 7])
def test_other_scales(name, factor):
    V, F = mesh(name)
    L = 0.5 * zoo.mean_edge(V, F)
    one, two = remesh(V, F, L), remesh(V * factor, F, L * factor)
    assert len(two.F) == pytest.approx(len(one.F), rel=0.08)
    assert zoo.area(*two) == pytest.approx(factor**2 * zoo.area(*one), rel=0.03)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("by", [1e3, 1e6, 1e9])
def test_far_from_the_origin(name, by):
    V, F = mesh(name)
    L = 0.5 * zoo.mean_edge(V, F)
    offset = by * np.array([1.0, -2.0, 0.5])
    one, two = remesh(V, F, L), remesh(V + offset, F, L)
    assert len(two.F) == pytest.approx(len(one.F), rel=0.08)
    assert zoo.area(two.V - offset, two.F) == pytest.approx(zoo.area(*one), rel=0.03)
    precision = np.spacing(2 * by)
    born = np.einsum("nc,ncx->nx", two.birth_barycentric, (V + offset)[F[two.birth_face]])
    assert np.abs(born - two.V).max() < 8 * precision


def test_moves_by_powers_of_two_are_exact_where_no_bit_is_lost():
    """Integers on a grid of 2^-10: sums with 2^20 are exact, so the frames hold the same numbers."""
    V, F = mesh("torus")
    V = np.round(V * 2**10) / 2**10
    near, far = V + 2.0**8, V + 2.0**20
    one, two = remesh(near, F, 0.3), remesh(far, F, 0.3)
    assert np.array_equal(one.F, two.F)
    assert pytest.approx(one.V - 2.0**8, abs=1e-9) == two.V - 2.0**20


def test_the_order_of_faces_hardly_matters():
    V, F = mesh("torus")
    shuffle = np.random.default_rng(0).permutation(len(F))
    one, two = remesh(V, F, 0.2), remesh(V, F[shuffle], 0.2)
    assert np.array_equal(one.V, two.V) and np.array_equal(one.F, two.F)


def test_the_numbers_of_vertices_do_not_matter():
    V, F = mesh("planar_delaunay")
    new = np.random.default_rng(1).permutation(len(V))
    W = np.empty_like(V)
    W[new] = V
    one, two = remesh(V, F, 0.1), remesh(W, new[F], 0.1)
    assert np.array_equal(one.V, two.V) and np.array_equal(one.F, two.F)


def test_mirror_images_have_the_same_quality():
    V, F = mesh("genus_2")
    one, two = remesh(V, F, 0.4), remesh(V * [-1, 1, 1], F[:, ::-1], 0.4)
    assert zoo.area(*two) == pytest.approx(zoo.area(*one), rel=0.03)
    assert zoo.volume(*two) == pytest.approx(zoo.volume(*one), rel=0.03)
