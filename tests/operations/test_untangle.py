"""The finishing: untangle improves the worst angles, fit brings faces to both sides of the input."""

import igl
import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import (
    assert_on_reference,
    assert_same_bits,
    assert_valid,
    blocks_of,
    built,
    copied,
    faces_of,
    one_block,
    referenced,
)

from remeshvec.core.vocabulary import FIXED, INNER
from remeshvec.operations.fit import fit_vertices
from remeshvec.operations.untangle import untangle_vertices

MESHES = ["icosphere", "torus", "planar_delaunay", "annulus", "genus_2"]


def rough(name, noise=0.3):
    """Mesh with bad angles whose vertices lie on its reference."""
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), noise=0.0)
    mesh = built(V, F, ordered=True)
    reference = referenced(mesh, zoo.mean_edge(V, F))
    W, _ = zoo.upsampled(mesh.X[:, :3].copy(), faces_of(mesh).astype(np.int64), n=0, noise=noise)
    mesh.X[:, :3] = W
    return mesh, reference


def smallest_angles(mesh):
    return np.degrees(igl.internal_angles(mesh.X[:, :3].copy(), faces_of(mesh).astype(int))).min(
        axis=1
    )


def untangled(mesh, reference, degrees, on_surface=False, rounds=1):
    cosine = np.cos(np.radians(degrees))
    blocks = one_block(mesh)
    return untangle_vertices(mesh, blocks, reference.tree, on_surface, cosine, rounds, False)


@pytest.mark.parametrize("on_surface", [False, True])
@pytest.mark.parametrize("name", MESHES)
def test_untangling_improves_the_worst_angles(name, on_surface):
    mesh, reference = rough(name)
    before = smallest_angles(mesh)
    moved = untangled(mesh, reference, 35.0, on_surface)
    after = smallest_angles(mesh)
    assert moved > 0
    assert after.min() >= before.min()
    assert (after < 30).sum() < (before < 30).sum()
    assert_valid(mesh)


@pytest.mark.parametrize("name", MESHES)
def test_each_move_improves_its_ring(name):
    """One vertex at a time: the smallest angle around it grows, and no face turns over."""
    mesh, reference = rough(name)
    V, F = mesh.X[:, :3].copy(), faces_of(mesh)
    bad = [v for v in range(len(V)) if mesh.kind[v] == INNER and ring_angle(V, F, v) < 35][:15]
    assert bad
    for v in bad:
        alone, _ = rough(name)
        alone.kind[np.arange(len(V)) != v] = FIXED
        moved = untangled(alone, reference, 35.0)
        W = alone.X[:, :3]
        assert np.array_equal(np.delete(W, v, axis=0), np.delete(V, v, axis=0))
        assert bool(moved) == (not np.array_equal(W[v], V[v]))
        assert not moved or ring_angle(W, F, v) > ring_angle(V, F, v)
        for f in F[(v == F).any(axis=1)].tolist():
            assert naive.normal(V, f) @ naive.normal(W, f) > 0


def ring_angle(V, F, v):
    around = F[(v == F).any(axis=1)].astype(np.int64)
    return np.degrees(igl.internal_angles(np.ascontiguousarray(V), around)).min()


def test_good_rings_and_boundaries_are_left_alone():
    mesh, reference = rough("planar_delaunay")
    V, F = mesh.X[:, :3].copy(), faces_of(mesh)
    untangled(mesh, reference, 20.0)
    moved = np.flatnonzero((mesh.X[:, :3] != V).any(axis=1))
    assert len(moved) and (mesh.kind[moved] == INNER).all()
    still = [v for v in range(len(V)) if mesh.kind[v] == INNER and ring_angle(V, F, v) > 20.01]
    # A ring that became bad by a neighbour's move is looked at in the next round.
    assert not set(still) & set(moved.tolist())


def test_vertices_stay_on_the_surface_if_told_to():
    mesh, reference = rough("torus", noise=0.0)
    V = mesh.X[:, :3].copy()
    assert untangled(mesh, reference, 44.0, on_surface=True) > 0
    F = faces_of(mesh).astype(np.int64)
    squared, _, _ = igl.point_mesh_squared_distance(mesh.X[:, :3].copy(), V, F)
    assert np.sqrt(squared).max() < 1e-13


@pytest.mark.parametrize("on_surface", [False, True])
@pytest.mark.parametrize("per_block", [30, 10**6])
@pytest.mark.parametrize("name", MESHES)
def test_rounds_are_those_of_calls_that_look_everywhere(name, per_block, on_surface, monkeypatch):
    """A ring that has not changed and was not improved would not be the next time."""
    mesh, reference = rough(name)
    one, two = copied(mesh), copied(mesh)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    arguments = (blocks, reference.tree, on_surface, np.cos(np.radians(38.0)))
    found = untangle_vertices(one, *arguments, 4, False)
    moves = [untangle_vertices(two, *arguments, 1, False) for _ in range(4)]
    assert found == sum(moves) and moves[1] > 0
    assert_same_bits(one, two)


def test_no_round_no_move():
    mesh, reference = rough("torus")
    before = mesh.X.copy()
    assert untangled(mesh, reference, 60.0, rounds=0) == 0
    assert np.array_equal(mesh.X, before)


def test_nothing_to_do():
    mesh, reference = rough("icosphere", noise=0.0)
    before = mesh.X.copy()
    assert untangled(mesh, reference, 10.0) == 0
    assert np.array_equal(mesh.X, before)


@pytest.mark.parametrize("name", ["cube", "closed_cylinder", "l_prism"])
def test_curves_stay_and_patches_are_kept(name):
    """Vertices beside a crease are improved in their own patch."""
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), n=2, noise=0.0)
    mesh = built(V, F, ordered=True)
    reference = referenced(mesh, zoo.mean_edge(V, F), feature_angle=40.0)
    W, _ = zoo.upsampled(mesh.X[:, :3].copy(), faces_of(mesh).astype(np.int64), n=0, noise=0.3)
    inner = mesh.kind == INNER
    mesh.X[inner, :3] = W[inner]
    before = mesh.X.copy()
    assert untangled(mesh, reference, 40.0, on_surface=True) > 0
    moved = (before != mesh.X).any(axis=1)
    assert (mesh.kind[moved] == INNER).all()
    assert_on_reference(mesh, reference)
    assert_valid(mesh)


# --- fit -----------------------------------------------------------------------------------------


def coarse_on_fine():
    """Icosphere of 320 faces whose reference is one of 20,480."""
    fine = built(*zoo.icosphere(5), ordered=True)
    reference = referenced(fine, 0.1)
    mesh = built(*zoo.icosphere(2), ordered=True)
    return mesh, reference


def test_fit_brings_faces_to_both_sides():
    mesh, reference = coarse_on_fine()
    F = faces_of(mesh)
    volumes = [zoo.volume(mesh.X[:, :3], F)]
    for _ in range(2):
        fit_vertices(mesh, one_block(mesh), reference.tree, 0.2, False)
        volumes.append(zoo.volume(mesh.X[:, :3], F))
    truth = zoo.volume(*zoo.icosphere(5))
    errors = np.abs(np.array(volumes) - truth)
    assert errors[0] > 2 * errors[1] > 0 and errors[1] > errors[2]
    radius = np.linalg.norm(mesh.X[:, :3], axis=1)
    assert radius.min() > 1 and radius.max() < 1.05


def test_fit_moves_by_no_more_than_its_reach_and_along_normals():
    mesh, reference = coarse_on_fine()
    V = mesh.X[:, :3].copy()
    fit_vertices(mesh, one_block(mesh), reference.tree, 0.002, False)
    step = mesh.X[:, :3] - V
    assert np.linalg.norm(step, axis=1) == pytest.approx(0.002)
    assert (step * V).sum(axis=1) == pytest.approx(0.002, rel=1e-2)


def test_fit_reaches_as_far_as_the_lengths_say():
    mesh, reference = coarse_on_fine()
    mesh.X[:, 3] = lengths = np.random.default_rng(0).uniform(0.5, 2.0, len(mesh.X))
    V = mesh.X[:, :3].copy()
    fit_vertices(mesh, one_block(mesh), reference.tree, 0.002, False)
    assert np.linalg.norm(mesh.X[:, :3] - V, axis=1) == pytest.approx(0.002 * lengths)
    assert np.array_equal(mesh.X[:, 3], lengths)


def test_fit_leaves_boundaries_and_perfect_meshes_alone():
    mesh, reference = rough("grid", noise=0.2)
    before = mesh.X.copy()
    fit_vertices(mesh, one_block(mesh), reference.tree, 1.0, False)
    assert pytest.approx(before, abs=1e-14) == mesh.X
    assert np.array_equal(mesh.X[mesh.kind != INNER], before[mesh.kind != INNER])
