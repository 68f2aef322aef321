"""Projection and births: vertices end on the input, boundaries on their own loop."""

import igl
import numpy as np
import pytest
import zoo
from structure import assert_valid, built, copied, locate, one_block, project

from remeshvec._types import APEX, BOUNDARY, FIXED, INNER
from remeshvec.operations.project import project_boundary, project_vertices
from remeshvec.prepare import build_reference

MESHES = ["icosphere", "torus", "genus_2", "planar_delaunay", "annulus", "grid", "two_components"]


def moved(name, amount, seed=0):
    """Mesh, its reference, and vertices at random places near it."""
    V, F = zoo.ZOO[name].make()
    mesh = built(V, F, ordered=True)
    reference = build_reference(mesh, zoo.mean_edge(V, F), False)
    mesh.kind[mesh.kind == APEX] = INNER
    noise = np.random.default_rng(seed).normal(size=(len(mesh.X), 3))
    free = mesh.kind != FIXED
    mesh.X[free, :3] += amount * zoo.mean_edge(V, F) * noise[free]
    return mesh, reference


def distance(reference, P):
    F = reference.origin.reshape(-1, 3).astype(np.int64)
    squared, _, points = igl.point_mesh_squared_distance(P, reference.X[:, :3].copy(), F)
    return np.sqrt(squared), points


def places(reference, faces, barycentric):
    F = reference.origin.reshape(-1, 3)
    return np.einsum("nc,ncx->nx", barycentric, reference.X[F[faces], :3])


@pytest.mark.parametrize("amount", [1e-3, 0.3, 3.0])
@pytest.mark.parametrize("name", MESHES)
def test_inner_vertices_go_to_the_closest_point(name, amount):
    mesh, reference = moved(name, amount)
    before = mesh.X[:, :3].copy()
    project(mesh, reference)
    inner = mesh.kind == INNER
    found, _ = distance(reference, mesh.X[inner, :3].copy())
    assert found.max(initial=0) < 1e-12 * np.abs(reference.X).max()
    shortest, _ = distance(reference, before[inner])
    step = np.linalg.norm(mesh.X[inner, :3] - before[inner], axis=1)
    assert step == pytest.approx(shortest, rel=1e-9, abs=1e-13)
    assert_valid(mesh)


@pytest.mark.parametrize("name", ["sliver_fan", "annulus", "grid", "cylinder"])
def test_boundary_vertices_stay_on_the_boundary(name):
    mesh, reference = moved(name, 0.3)
    project(mesh, reference)
    rim = mesh.kind == BOUNDARY
    assert rim.any()
    F = reference.origin.reshape(-1, 3)
    segments = reference.X[igl.boundary_facets(F.astype(np.int64))[0], :3]
    for p in mesh.X[rim, :3]:
        assert min(to_segment(p, *ends) for ends in segments) < 1e-13


def to_segment(p, a, b):
    s = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(p - a - s * (b - a))


def test_fixed_vertices_stay():
    mesh, reference = moved("grid", 0.2)
    mesh.kind[:] = FIXED
    before = copied(mesh)
    project(mesh, reference)
    assert np.array_equal(mesh.X, before.X)


def test_project_boundary_leaves_the_inside_alone():
    mesh, reference = moved("grid", 0.2)
    before = mesh.X.copy()
    project_boundary(mesh, one_block(mesh), reference, False)
    inner = mesh.kind == INNER
    assert np.array_equal(mesh.X[inner], before[inner])
    rim = mesh.kind == BOUNDARY
    assert not (mesh.X[rim] == before[rim]).all(axis=1).any()


@pytest.mark.parametrize("name", MESHES)
def test_births_reproduce_projected_vertices(name):
    mesh, reference = moved(name, 0.3)
    project(mesh, reference)
    before = mesh.X.copy()
    weights = locate(mesh, reference)
    assert np.array_equal(mesh.X, before)
    assert weights.min() >= -1e-15 and weights.sum(axis=1) == pytest.approx(1)
    assert places(reference, mesh.birth // 3, weights) == pytest.approx(before[:, :3], abs=1e-12)


def test_births_of_others_are_the_closest_points():
    mesh, reference = moved("torus", 0.5)
    weights = locate(mesh, reference)
    shortest, _ = distance(reference, mesh.X[:, :3].copy())
    found = np.linalg.norm(places(reference, mesh.birth // 3, weights) - mesh.X[:, :3], axis=1)
    assert found == pytest.approx(shortest, rel=1e-9)


def test_a_second_projection_changes_nothing_but_rounding():
    mesh, reference = moved("genus_3", 0.4)
    project(mesh, reference)
    before = mesh.X.copy()
    project(mesh, reference)
    assert pytest.approx(before, abs=1e-14) == mesh.X


@pytest.mark.parametrize(("trust", "finds_the_top"), [(0.0, True), (0.01, True), (0.1, False)])
def test_trust_is_a_distance(trust, finds_the_top):
    """On the top of a thin sheet, remembered on the bottom: a walk stays there, a search does not."""
    V, F = zoo.thin_sheet(10, thickness=0.02)
    mesh = built(V, F)
    reference = build_reference(mesh, 1.0, False)
    middle = V[F].mean(axis=1)
    bottom = np.abs(middle - [4.5, 4.5, -0.02]).sum(axis=1).argmin()
    v = next(v for v in range(len(V)) if V[v, 2] == 0 and mesh.kind[v] == INNER)
    mesh.X[v, :3] = [4.4, 4.6, 0.0]
    mesh.birth[v] = 3 * bottom
    mesh.kind[np.arange(len(V)) != v] = FIXED
    project_vertices(mesh, one_block(mesh), reference, trust, False)
    assert mesh.X[v, :3] == pytest.approx([4.4, 4.6, 0.0 if finds_the_top else -0.02])
