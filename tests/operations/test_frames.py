"""Frames: a step through a frame is the step of a relaxation, and zero where nothing may move."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import blocks_of, built, one_block

from remeshvec.core.vocabulary import CURVE, FIXED, HELD, INNER, PINNED
from remeshvec.operations.frames import FRAME_SIZE, measure_frames


def framed(mesh, blocks, stiffness):
    """Frames as matrices (n, 3, 3)."""
    frames = np.full((len(mesh.X), FRAME_SIZE), np.nan)
    measure_frames(mesh, blocks, stiffness, frames, False)
    xx, xy, xz, yy, yz, zz = frames.T
    return np.stack([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)


@pytest.mark.parametrize("per_block", [9, 100_000])
@pytest.mark.parametrize("stiffness", [0.0, 60.0, 1000.0])
@pytest.mark.parametrize("name", ["icosphere", "torus", "cylinder", "genus_2", "annulus"])
def test_steps_are_those_of_the_twin(name, stiffness, per_block, monkeypatch):
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.08, seed=3)
    mesh = built(V, F, ordered=True)
    V, F = mesh.X[:, :3], mesh.origin.reshape(-1, 3)
    frames = framed(mesh, blocks_of(mesh, per_block, monkeypatch), stiffness)
    steps = np.random.default_rng(0).normal(size=V.shape)
    for v in np.flatnonzero(mesh.kind == INNER)[:40]:
        expected = naive.tangential(V, F, v, steps[v], stiffness)
        assert frames[v] @ steps[v] == pytest.approx(expected, rel=1e-7, abs=1e-10)


@pytest.mark.parametrize("kind", [HELD, CURVE, PINNED, FIXED])
def test_only_inner_vertices_have_a_frame(kind):
    V, F = zoo.perturb(*zoo.torus(), amount=0.1)
    mesh = built(V, F)
    still = np.arange(len(V)) % 3 == 0
    mesh.kind[still] = kind
    frames = framed(mesh, one_block(mesh), 400.0)
    assert not frames[still].any() and frames[~still].any(axis=(1, 2)).all()


def test_degenerate_rings_stay_finite():
    for name in ("flat_cap", "coincident_vertices"):
        V, F = zoo.ZOO[name].make()
        mesh = built(V, F)
        assert np.isfinite(framed(mesh, one_block(mesh), 400.0)).all()
