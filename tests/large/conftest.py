from __future__ import annotations

from types import SimpleNamespace

import igl
import numpy as np
import pytest
from helpers import zoo

from remeshvec import quality, remesh_large

PART = 10_000


def noisy(V, F, rng, share=0.15, keep=None):
    """Move vertices at random by a share of the mean edge, but for some."""
    step = share * quality(V, F).edge_mean * rng.uniform(-1.0, 1.0, V.shape)
    if keep is not None:
        step[keep] = 0.0
    return V + step


def ball():
    """A rough sphere, 20,480 faces."""
    V, F = zoo.icosphere(5)
    V = noisy(V, F, np.random.default_rng(1))
    return V / np.linalg.norm(V, axis=1, keepdims=True), F


def box():
    """The cube [0, 1]^3 cut into 24,576 faces, its vertices moved inside its sides."""
    V, F = zoo.cube()
    V = (V - V.min(axis=0)) / np.ptp(V, axis=0)
    while len(F) < 20_000:
        V, F = igl.upsample(V, F)
    rng = np.random.default_rng(2)
    inside = (V > 0.0) & (V < 1.0)
    step = 0.3 * quality(V, F).edge_mean * rng.uniform(-1.0, 1.0, V.shape)
    V = np.where(inside & (inside.sum(axis=1) == 2)[:, None], V + step, V)
    return V, F


def open_pair():
    """Two bumpy sheets of 13,122 faces each, one above the other."""
    x, y = np.meshgrid(np.linspace(0, 1, 82), np.linspace(0, 1, 82), indexing="ij")
    V = np.column_stack(
        [x.ravel(), y.ravel(), 0.02 * np.sin(9 * x.ravel()) * np.cos(7 * y.ravel())]
    )
    i = (np.arange(81)[:, None] * 82 + np.arange(81)).ravel()
    F = np.concatenate([np.column_stack([i, i + 82, i + 83]), np.column_stack([i, i + 83, i + 1])])
    inside = (V[:, :2] > 0).all(axis=1) & (V[:, :2] < 1).all(axis=1)
    V = noisy(V, F, np.random.default_rng(3), 0.2, ~inside)
    return np.concatenate([V, V + np.array([0.3, 0.0, 0.05])]), np.concatenate([F, F + len(V)])


MESHES = {"ball": ball, "box": box, "open_pair": open_pair}


@pytest.fixture(scope="session")
def large(tmp_path_factory):
    """Results in parts, by the name of a mesh; each is made once."""
    known = {}

    def result_of(name):
        if name not in known:
            V, F = MESHES[name]()
            L = 0.9 * quality(V, F).edge_mean
            out = tmp_path_factory.mktemp(name) / "out"
            result = remesh_large((V, F), L, out=out, workers=1, part_faces=PART)
            known[name] = SimpleNamespace(V=V, F=F, L=L, result=result)
        return known[name]

    return result_of
