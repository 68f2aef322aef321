"""Folds are mended where they are; only what cannot be mended is swept again with a guard."""

import numpy as np
import pytest
from helpers import zoo
from helpers.structure import built

import remeshvec.sweeps.care as care
from remeshvec import remesh
from remeshvec.core.vocabulary import HALTED, HELD, NONE, PINNED
from remeshvec.sweeps.holding import hold, let_go, rings_around


def lens(thickness, seed):
    """Thin closed lens with a sharp rim that is no crease: its turns are spread over small faces."""
    V, F = zoo.icosphere(4)
    V = V * [1.0, 0.6, thickness]
    noise = np.random.default_rng(seed).standard_normal(V.shape)
    return V + 0.01 * thickness * noise, F


@pytest.fixture
def guards(monkeypatch):
    """The checks of all guards that were asked for."""
    asked = []
    make = care.HoldingGuard
    monkeypatch.setattr(
        care,
        "HoldingGuard",
        lambda checks, parallel: asked.append(checks) or make(checks, parallel),
    )
    return asked


MENDED = [(0.05, 0, 0.12, "default"), (0.05, 2, 0.12, "default")]


@pytest.mark.parametrize(("thickness", "seed", "L", "preset"), MENDED)
def test_a_few_folds_are_mended_without_a_guard(thickness, seed, L, preset, guards, monkeypatch):
    V, F = lens(thickness, seed)
    result = remesh(V, F, L, preset=preset)
    assert not guards
    assert not len(result.report.defects.folds)
    monkeypatch.setattr(care.Sweeper, "_may_mend", lambda *_: False)
    remesh(V, F, L, preset=preset)
    assert guards


def test_mending_is_local(monkeypatch):
    thickness, seed, L, _ = MENDED[0]
    V, F = lens(thickness, seed)
    mended = remesh(V, F, L)
    monkeypatch.setattr(care.Sweeper, "_with_care", lambda self, best, *_: best)
    plain = remesh(V, F, L)
    assert len(plain.report.defects.folds)
    old, new = ({tuple(v) for v in r.V.tolist()} for r in (plain, mended))
    assert 0.1 * len(old) < len(old & new) < len(old)
    assert mended.report.sweeps == plain.report.sweeps


def test_births_are_where_mended_vertices_lie():
    V, F = lens(*MENDED[0][:2])
    result = remesh(V, F, MENDED[0][2])
    at = np.einsum("kc,kcx->kx", result.birth_barycentric, V[F[result.birth_face]])
    assert np.abs(at - result.V).max() < 1e-9


@pytest.mark.parametrize("preset", ["fast", "default"])
def test_what_cannot_be_mended_is_guarded(preset, guards):
    result = remesh(*lens(0.02, 0), 0.2, preset=preset)
    assert guards
    assert not len(result.report.defects.folds)


def test_rings():
    V, F = zoo.grid(8, 8)
    mesh = built(V, F)
    assert np.flatnonzero(rings_around(mesh, [40], 0)).tolist() == [40]
    around = set(F[(F == 40).any(axis=1)].ravel().tolist())
    assert set(np.flatnonzero(rings_around(mesh, [40], 1)).tolist()) == around


def test_what_is_held_is_let_go():
    mesh = built(*zoo.grid(8, 8))
    mesh.kind[30] = HELD
    before = mesh.copy()
    held = hold(mesh, np.arange(len(mesh.X)) < 50)
    assert (mesh.kind[held] != before.kind[held]).all() and not held[30]
    assert set(mesh.kind[:50].tolist()) <= {HELD, PINNED, 4} and HALTED in mesh.curve
    assert (mesh.kind[50:] == before.kind[50:]).all()
    let_go(mesh, held)
    for one, two in zip(mesh, before, strict=True):
        assert np.array_equal(one, two)


def test_only_edges_between_held_vertices_are_halted():
    mesh = built(*zoo.grid(8, 8))
    is_held = np.arange(len(mesh.X)) < 50
    hold(mesh, is_held)
    start, end = mesh.origin, mesh.origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    inner = mesh.twin != NONE
    assert np.array_equal(mesh.curve[inner] == HALTED, (is_held[start] & is_held[end])[inner])
