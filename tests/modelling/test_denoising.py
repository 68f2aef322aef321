"""Denoising keeps volumes and thin parts; smoothers tell of what they leave alone."""

import warnings

import numpy as np
import pytest
from helpers import zoo

from remeshvec import RemeshWarning, denoise, quality, smooth

OCTAHEDRON = (
    np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1.0]]),
    np.array(
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    ),
)


def sphere(level=4):
    V, F = zoo.icosphere(level)
    return V / np.linalg.norm(V, axis=1)[:, None], F


def noisy(V, size, seed=0):
    return V + size * np.random.default_rng(seed).normal(size=V.shape)


def soup_of(V, F):
    return V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)


def with_island(V, F, size):
    island, faces = OCTAHEDRON
    return np.vstack([V, size * island + 5.0]), np.vstack([F, faces + len(V)])


def boundary_of(F):
    edges = np.sort(np.vstack([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(edges[count == 1])


def test_noise_goes_and_the_volume_stays_without_a_correction():
    V, F = sphere()
    N = noisy(V, 0.02)
    W = denoise(N, F)
    assert np.linalg.norm(W, axis=1).std() < 0.3 * np.linalg.norm(N, axis=1).std()
    assert quality(W, F).volume == pytest.approx(quality(N, F).volume, rel=2e-3)
    flow = smooth(N, F, iterations=10)
    assert abs(quality(flow, F).volume / quality(N, F).volume - 1) > 0.05


def test_thin_handles_survive():
    """A ring of twelve edges around: three steps of the flow leave a thread."""
    V, F = zoo.torus(60, 12)
    before = quality(V, F).volume
    assert quality(denoise(V, F), F).volume > 0.9 * before
    assert quality(smooth(V, F, iterations=3), F).volume < 0.3 * before


def test_the_filter_is_the_formula():
    """One iteration on a small mesh, vertex by vertex."""
    V, F = zoo.icosphere(1)
    x = noisy(V, 0.1)
    expected = x.copy()
    for weight in (0.5, 1 / (0.02 - 2)):
        before = expected.copy()
        for v in range(len(V)):
            ring = np.setdiff1d(F[np.isin(F, v).any(axis=1)], [v])
            expected[v] += weight * (before[ring].mean(axis=0) - before[v])
    assert denoise(x, F, 1) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("method", [denoise, smooth])
def test_small_components_stay_and_are_reported(method):
    V, F = with_island(*sphere(3), 1e-9)
    with pytest.warns(RemeshWarning, match="1 of 2 components .*6 vertices, the first is 642"):
        W = method(V, F)
    assert np.array_equal(W[-6:], V[-6:])
    assert np.abs(W[:-6] - V[:-6]).max() > 1e-6
    alone = method(V[:-6], F[:-8])
    assert W[:-6] == pytest.approx(alone, abs=1e-12 if method is denoise else 1e-3)


def test_components_that_vanish_later_come_back_as_they_were():
    V, F = with_island(*sphere(3), 0.1)
    for step, options in ((0.02, {}), (0.2, {"keep_volume": True})):
        with pytest.warns(RemeshWarning, match="too small"):
            W = smooth(V, F, step, 4, **options)
        assert np.array_equal(W[-6:], V[-6:])


def test_nothing_is_said_where_nothing_vanishes():
    V, F = sphere(3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        denoise(V, F)
        smooth(V, F, iterations=2)


@pytest.mark.parametrize("method", [denoise, smooth])
def test_a_soup_is_smoothed_as_the_surface_it_is(method):
    V, F = sphere(2)
    V = noisy(V, 0.02)
    joined, soup = method(V, F), method(*soup_of(V, F))
    assert soup == pytest.approx(joined[F].reshape(-1, 3), abs=1e-12)
    assert np.abs(soup - soup_of(V, F)[0]).max() > 0.01


@pytest.mark.parametrize("method", [denoise, smooth])
def test_a_soup_that_only_nearly_meets_is_not_silently_unchanged(method):
    V, F = soup_of(*sphere(1))
    with pytest.warns(RemeshWarning, match="no vertex moves"):
        W = method(noisy(V, 1e-9), F)
    assert np.array_equal(W, noisy(V, 1e-9))


def test_faces_without_area_do_not_end_the_flow():
    V, F = sphere(3)
    V[F[0, 1]] = 0.5 * (V[F[0, 0]] + V[F[0, 2]])  # flat, or nearly so
    W = smooth(noisy(V, 0.0), F, iterations=3)
    assert np.isfinite(W).all()
    V[F[0, 1]] = V[F[0, 0]]
    W = smooth(V, F, iterations=3)
    assert np.isfinite(W).all() and np.abs(W - V).max() < 0.5


def test_what_is_fixed_stays():
    V, F = zoo.upsampled(*zoo.annulus(24, 5), noise=0.0)
    V[:, 2] = 0.3 * np.sin(4 * V[:, 0])
    before = V.copy()
    W = denoise(V, F)
    inner = np.setdiff1d(np.arange(len(V)), boundary_of(F))[7]
    assert not np.array_equal(W[inner], V[inner])
    held = denoise(V, F, fixed=[inner])
    assert np.array_equal(held[inner], V[inner])
    assert np.array_equal(W[boundary_of(F)], V[boundary_of(F)])
    assert np.abs(denoise(V, F, boundary="free") - V)[boundary_of(F)].max() > 1e-3
    assert np.array_equal(V, before)
