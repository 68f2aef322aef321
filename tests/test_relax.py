"""Relaxation against the formula, areas against libigl, and what must not move."""

import igl
import naive
import numpy as np
import pytest
import zoo
from structure import assert_valid, blocks_of, built, one_block

from remeshvec._types import BOUNDARY, FIXED
from remeshvec.geometry import SHARP
from remeshvec.operations.relax import RelaxOptions, relax_vertices

PUBLISHED = RelaxOptions(stiffness=0.0, slide=False)


def relaxed(V, F, options=PUBLISHED):
    mesh = built(V, F)
    relax_vertices(mesh, one_block(mesh), options, False)
    assert_valid(mesh)
    return mesh.X[:, :3].copy(), mesh


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
    assert relaxed(V, F)[0] == pytest.approx(naive.relaxed(V, F), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("stiffness", [20.0, 80.0])
@pytest.mark.parametrize("name", ["icosphere", "torus", "cylinder", "genus_2"])
def test_stiffness(name, stiffness):
    V, F = bumpy(name)
    found, _ = relaxed(V, F, PUBLISHED._replace(stiffness=stiffness))
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
    stiff, _ = relaxed(V, F, PUBLISHED._replace(stiffness=80.0))
    soft, _ = relaxed(V, F)
    assert np.abs(stiff[ridge, 0] - V[ridge, 0]).max() > 0.1
    assert np.abs(stiff[ridge, 1]).max() < 0.2 * np.abs(soft[ridge, 1]).max()


@pytest.mark.parametrize("name", MESHES)
def test_areas_are_mixed_voronoi_areas(name):
    V, F = bumpy(name)
    _, mesh = relaxed(V, F)
    expected = igl.massmatrix(V, F, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    assert mesh.X[:, 3] == pytest.approx(expected, rel=1e-9)
    assert mesh.X[:, 3].sum() == pytest.approx(zoo.area(V, F))


@pytest.mark.parametrize("name", ["planar_delaunay", "annulus"])
def test_flat_meshes_stay_flat(name):
    V, F = zoo.ZOO[name].make()
    V = zoo.rotate(V)
    flat = np.linalg.svd(V - V.mean(axis=0))[2][2]
    for options in (PUBLISHED, RelaxOptions(80.0, True)):
        W, _ = relaxed(V, F, options)
        assert not np.array_equal(W, V)
        assert (W - V.mean(axis=0)) @ flat == pytest.approx(0, abs=1e-13)


def test_fixed_and_boundary_vertices():
    V, F = zoo.perturb(*zoo.grid(), amount=0.1)
    rim = built(V, F).kind == BOUNDARY
    W, _ = relaxed(V, F)
    assert np.array_equal(W[rim], V[rim]) and not (W[~rim] == V[~rim]).any()
    mesh = built(V, F)
    mesh.kind[:] = FIXED
    relax_vertices(mesh, one_block(mesh), PUBLISHED._replace(slide=True), False)
    assert np.array_equal(mesh.X[:, :3], V)


@pytest.mark.parametrize("name", ["grid", "annulus", "planar_delaunay", "cylinder"])
def test_boundary_vertices_slide_along_their_chord(name):
    V, F = bumpy(name)
    found, _ = relaxed(V, F, PUBLISHED._replace(slide=True))
    assert found == pytest.approx(naive.relaxed(V, F, slide=True), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("height", [0.2, 1.0, 3.0, 8.0])
def test_sharp_vertices_stay(height):
    """Where the normals cancel any tangent plane would be noise: the tip of a steep cone."""
    V, F = zoo.bipyramid(20, top=height, bottom=-height)
    V[:, :2] += [0.1, 0.05] * (V[:, 2:] == 0)  # so that there is somewhere to go
    tip = int(np.argmax(V[:, 2]))
    around = [naive.normal(V, f) for f in naive.tuples(F) if tip in f]
    share = np.linalg.norm(sum(around)) / sum(np.linalg.norm(n) for n in around)
    W, _ = relaxed(V, F)
    assert np.array_equal(W[tip], V[tip]) == (share <= SHARP)


def test_degenerate_rings_stay_finite():
    for name in ("flat_cap", "coincident_vertices"):
        V, F = zoo.ZOO[name].make()
        for options in (PUBLISHED, RelaxOptions(80.0, True)):
            assert np.isfinite(relaxed(V, F, options)[0]).all()


def test_areas_become_even():
    V, F = zoo.upsampled(*zoo.icosphere(2), noise=0.3)
    spread = lambda W: np.std(naive.voronoi_areas(W, F)) / np.mean(naive.voronoi_areas(W, F))  # noqa: E731
    mesh = built(V, F)
    for _ in range(10):
        relax_vertices(mesh, one_block(mesh), PUBLISHED, False)
    assert spread(mesh.X[:, :3]) < 0.6 * spread(V)


@pytest.mark.parametrize("per_block", [5, 30, 1000])
def test_blocks_agree_to_rounding(per_block, monkeypatch):
    """The order of a sum may depend on the blocks, whose number depends on the size only."""
    V, F = bumpy("torus")
    mesh = built(V, F, ordered=True)
    same = built(V, F, ordered=True)
    options = RelaxOptions(20.0, True)
    relax_vertices(mesh, one_block(mesh), options, False)
    relax_vertices(same, blocks_of(same, per_block, monkeypatch), options, False)
    assert pytest.approx(same.X, rel=1e-12, abs=1e-14) == mesh.X
