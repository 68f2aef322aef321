"""Implicit fairing: the exact step on a sphere, any step length, volumes, what stays."""

import warnings

import numpy as np
import pytest
from helpers import zoo

from remeshvec import MeshInputError, OptionError, RemeshWarning, smooth
from remeshvec.modelling.smoothing import _volume


def sphere(level=4, radius=2.0):
    V, F = zoo.icosphere(level)
    return radius * V / np.linalg.norm(V, axis=1)[:, None], F


def test_a_sphere_shrinks_as_it_must():
    """``x' (1 + 2 t / R^2) = x``, since the Laplacian of x is -2 x / R^2."""
    V, F = sphere()
    radius = 2.0
    for steps, t in ((1, 0.3), (3, 0.3)):
        expected = radius
        for _ in range(steps):
            expected /= 1 + 2 * t / expected**2
        W = smooth(V, F, t, steps)
        assert np.linalg.norm(W, axis=1) == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("step", [1e-6, 1.0, 1e8])
def test_any_step_is_stable(step):
    V, F = zoo.upsampled(*zoo.genus_2(), noise=0.3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RemeshWarning)  # at 1e8 all of it vanishes, and stays
        W = smooth(V, F, step)
    assert np.isfinite(W).all()
    assert np.abs(W - V.mean(axis=0)).max() <= np.ptp(V)
    if step < 1e-3:
        assert np.abs(W - V).max() < 1e-3


def test_noise_goes_and_volume_stays():
    V, F = sphere()
    noisy = V * (1 + 0.02 * np.random.default_rng(0).normal(size=(len(V), 1)))
    for kept in (False, True):
        W = smooth(noisy, F, iterations=3, keep_volume=kept)
        assert np.linalg.norm(W, axis=1).std() < 0.2 * np.linalg.norm(noisy, axis=1).std()
        share = _volume(W, F) / _volume(noisy, F)
        assert share == pytest.approx(1, abs=1e-12) if kept else share < 0.995


def test_volumes_of_components_stay_each():
    one, two = sphere(3, 1.0), sphere(3, 0.3)
    V, F = zoo.joined(one, two, shift=4.0)
    F[len(one[1]) :] = F[len(one[1]) :, ::-1]  # inside out
    W = smooth(V, F, 0.02, 4, keep_volume=True)
    for faces in (F[: len(one[1])], F[len(one[1]) :]):
        assert _volume(W, faces) == pytest.approx(_volume(V, faces), rel=1e-12)
        assert W[np.unique(faces)].mean(axis=0) == pytest.approx(
            V[np.unique(faces)].mean(axis=0), abs=1e-3
        )


def test_what_stays():
    V, F = zoo.upsampled(*zoo.annulus(24, 5), noise=0.0)
    V[:, 2] = 0.3 * np.sin(4 * V[:, 0])
    before = V.copy()
    rim = np.isin(np.round(np.linalg.norm(V[:, :2], axis=1), 2), [1.0, 2.0])
    assert rim.sum() > 40
    W = smooth(V, F, 0.1)
    edges = np.sort(np.vstack([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    boundary = np.unique(edges[count == 1])
    assert np.array_equal(W[boundary], V[boundary])
    assert np.abs(W - V).max() > 0.05
    free = smooth(V, F, 0.1, boundary="free")
    assert np.abs(free - V)[boundary].max() > 0.05
    held = smooth(V, F, 0.1, boundary="free", fixed=[0, 9])
    assert np.array_equal(held[[0, 9]], V[[0, 9]])
    assert np.array_equal(V, before)


def test_the_default_step_is_the_squared_mean_edge():
    V, F = zoo.torus(24, 12)
    T = V[F]
    mean = np.linalg.norm(T - np.roll(T, 1, axis=1), axis=2).mean()
    assert np.array_equal(smooth(V, F), smooth(V, F, mean**2))
    assert smooth(1e-3 * V, F) == pytest.approx(1e-3 * smooth(V, F), abs=1e-12)


def test_flat_parts_stay_flat():
    V, F = zoo.upsampled(*zoo.grid(9, 9), noise=0.0)
    W = smooth(V, F, 2.0, 5)
    assert W[:, 2] == pytest.approx(0, abs=1e-13)


def test_bad_input():
    V, F = zoo.torus(12, 6)
    for options in (
        {"step": 0}, {"step": -1.0}, {"step": np.nan}, {"step": "a"}, {"step": True},
        {"iterations": 0}, {"boundary": "split"}, {"fixed": [-1]}, {"area": "x"},
        {"keep_volume": True, "fixed": [0]},
    ):  # fmt: skip
        with pytest.raises(OptionError):
            smooth(V, F, **options)
    with pytest.raises(MeshInputError, match="closed"):
        smooth(*zoo.grid(5, 5), keep_volume=True, boundary="free")
    with pytest.raises(MeshInputError, match="winding"):
        G = F.copy()
        G[3] = G[3, ::-1]
        smooth(V, G, keep_volume=True)
