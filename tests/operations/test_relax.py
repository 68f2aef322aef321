"""Relaxation against the formula, areas against libigl, and what must not move."""

import igl
import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import assert_valid, blocks_of, built, faces_of, one_block

from remeshvec.core.geometry import SHARP
from remeshvec.core.vocabulary import CURVE, FIXED, HELD, NONE, PINNED
from remeshvec.mesh.blocks import make_candidates, stages
from remeshvec.operations import relax
from remeshvec.operations.relax import relax_vertices


def relaxed(V, F, stiffness=0.0, length=1.0):
    mesh = built(V, F, length=length)
    relax_vertices(mesh, one_block(mesh), stiffness, False)
    assert_valid(mesh)
    return mesh.X[:, :3].copy()


def bumpy(name):
    return zoo.perturb(*zoo.ZOO[name].make(), amount=0.08, seed=3)


MESHES = [
    "icosphere",
    "torus",
    "planar_delaunay",
    "annulus",
    "cylinder",
    "genus_2",
    "two_components",
]


@pytest.mark.parametrize("name", MESHES)
def test_one_step_of_the_published_formula(name):
    V, F = bumpy(name)
    assert relaxed(V, F) == pytest.approx(naive.relaxed(V, F), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", MESHES)
def test_weights_are_areas_over_squared_lengths(name):
    V, F = bumpy(name)
    lengths = np.exp(np.random.default_rng(5).normal(scale=0.4, size=len(V)))
    found = relaxed(V, F, length=lengths)
    assert found == pytest.approx(naive.relaxed(V, F, lengths=lengths), rel=1e-9, abs=1e-12)
    assert not np.allclose(found, naive.relaxed(V, F), atol=1e-3)
    # What counts is how lengths compare, not how large they are.
    assert relaxed(V, F, length=8 * lengths) == pytest.approx(found, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("stiffness", [20.0, 80.0])
@pytest.mark.parametrize("name", ["icosphere", "torus", "cylinder", "genus_2"])
def test_stiffness(name, stiffness):
    V, F = bumpy(name)
    found = relaxed(V, F, stiffness)
    expected = naive.relaxed(V, F, stiffness=stiffness)
    assert found == pytest.approx(expected, rel=1e-7, abs=1e-10)
    free = np.linalg.norm(naive.relaxed(V, F) - V, axis=1)
    held = np.linalg.norm(found - V, axis=1)
    assert (held <= free + 1e-12).all() and held.sum() < 0.99 * free.sum()


def test_stiffness_lets_vertices_slide_along_a_ridge():
    """Roof over the x axis, its ridge vertices unevenly spaced: they move along, not off."""
    V, F = zoo.grid(9, 3)
    V[:, 1] -= 1
    V[:, 2] = -np.abs(V[:, 1])
    ridge = (V[:, 1] == 0) & (V[:, 0] > 0) & (V[:, 0] < 8)
    V[ridge, 0] += np.random.default_rng(0).uniform(-0.3, 0.3, ridge.sum())
    stiff, soft = relaxed(V, F, 80.0), relaxed(V, F)
    assert np.abs(stiff[ridge, 0] - V[ridge, 0]).max() > 0.1
    assert np.abs(stiff[ridge, 1]).max() < 0.2 * np.abs(soft[ridge, 1]).max()


@pytest.mark.parametrize("per_block", [9, 100_000])
@pytest.mark.parametrize("name", MESHES)
def test_areas_are_mixed_voronoi_areas(name, per_block, monkeypatch):
    mesh = built(*bumpy(name), ordered=True)
    V, F = mesh.X[:, :3].copy(), faces_of(mesh).astype(np.int64)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    weighted, across = np.empty((len(V), 4)), make_candidates(blocks.face)
    relax._sum_areas(False, mesh, blocks, weighted, across)
    for stage in stages(blocks)[1:]:
        relax._sum_areas_across(False, mesh, blocks, stage, weighted, across)
    areas = weighted[:, 3].copy()
    expected = igl.massmatrix(V, F, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    assert areas == pytest.approx(expected, rel=1e-9)
    assert areas.sum() == pytest.approx(zoo.area(V, F))
    relax._weight(False, mesh, blocks, weighted)
    on_boundary = mesh.twin[mesh.vertex_halfedge] == NONE
    assert np.array_equal(weighted[:, 3], np.where(on_boundary, 2 * areas, areas))  # lengths are 1
    assert np.array_equal(weighted[:, :3], weighted[:, 3:] * V)


@pytest.mark.parametrize("name", ["planar_delaunay", "annulus"])
def test_flat_meshes_stay_flat(name):
    V, F = zoo.ZOO[name].make()
    V = zoo.rotate(V)
    flat = np.linalg.svd(V - V.mean(axis=0))[2][2]
    for stiffness in (0.0, 80.0):
        W = relaxed(V, F, stiffness)
        assert not np.array_equal(W, V)
        assert (W - V.mean(axis=0)) @ flat == pytest.approx(0, abs=1e-13)


@pytest.mark.parametrize("kind", [HELD, CURVE, PINNED, FIXED])
def test_only_inner_vertices_move(kind):
    V, F = zoo.perturb(*zoo.grid(), amount=0.1)
    rim = built(V, F).kind == CURVE
    still = np.flatnonzero(~rim)[::3]
    mesh = built(V, F)
    mesh.kind[still] = kind
    relax_vertices(mesh, one_block(mesh), 0.0, False)
    assert mesh.X[:, :3] == pytest.approx(naive.relaxed(V, F, still=still), rel=1e-9, abs=1e-12)
    stays = (mesh.X[:, :3] == V).all(axis=1)
    assert np.array_equal(stays, rim | np.isin(np.arange(len(V)), still))


def test_lengths_are_not_touched():
    mesh = built(*zoo.perturb(*zoo.torus(), amount=0.1))
    mesh.X[:, 3] = lengths = np.random.default_rng(0).uniform(0.5, 2, len(mesh.X))
    relax_vertices(mesh, one_block(mesh), 20.0, False)
    assert np.array_equal(mesh.X[:, 3], lengths)


@pytest.mark.parametrize("height", [0.2, 1.0, 3.0, 8.0])
def test_sharp_vertices_stay(height):
    """Where the normals cancel any tangent plane would be noise: the tip of a steep cone."""
    V, F = zoo.bipyramid(20, top=height, bottom=-height)
    V[:, :2] += [0.1, 0.05] * (V[:, 2:] == 0)  # so that there is somewhere to go
    tip = int(np.argmax(V[:, 2]))
    around = [naive.normal(V, f) for f in naive.tuples(F) if tip in f]
    share = np.linalg.norm(sum(around)) / sum(np.linalg.norm(n) for n in around)
    W = relaxed(V, F)
    assert np.array_equal(W[tip], V[tip]) == (share <= SHARP)


def test_degenerate_rings_stay_finite():
    for name in ("flat_cap", "coincident_vertices"):
        V, F = zoo.ZOO[name].make()
        for stiffness in (0.0, 80.0):
            assert np.isfinite(relaxed(V, F, stiffness)).all()


def test_areas_become_even():
    V, F = zoo.upsampled(*zoo.icosphere(2), noise=0.3)
    spread = lambda W: np.std(naive.voronoi_areas(W, F)) / np.mean(naive.voronoi_areas(W, F))  # noqa: E731
    mesh = built(V, F)
    for _ in range(10):
        relax_vertices(mesh, one_block(mesh), 0.0, False)
    assert spread(mesh.X[:, :3]) < 0.6 * spread(V)


@pytest.mark.parametrize("name", ["torus", "annulus"])
@pytest.mark.parametrize("per_block", [5, 30, 1000])
def test_blocks_agree_to_rounding(per_block, name, monkeypatch):
    """The order of a sum may depend on the blocks, whose number depends on the size only."""
    V, F = bumpy(name)
    mesh = built(V, F, ordered=True)
    same = built(V, F, ordered=True)
    mesh.X[:, 3] = same.X[:, 3] = np.random.default_rng(1).uniform(0.5, 2, len(V))
    relax_vertices(mesh, one_block(mesh), 20.0, False)
    relax_vertices(same, blocks_of(same, per_block, monkeypatch), 20.0, False)
    assert pytest.approx(same.X, rel=1e-12, abs=1e-14) == mesh.X
