"""Projection and births: vertices end on the input, in their patch or on their own curve."""

import igl
import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import (
    assert_on_reference,
    assert_valid,
    built,
    chains_of,
    copied,
    locate,
    one_block,
    project,
    referenced,
)

from remeshvec.core.vocabulary import CURVE, DEAD, FIXED, HELD, INNER, NONE
from remeshvec.operations.project import project_curves, project_vertices, read_lengths

MESHES = ["icosphere", "torus", "genus_2", "planar_delaunay", "annulus", "grid", "two_components"]
CREASED = ["cube", "genus_2", "l_prism", "closed_cylinder", "cone"]


def moved(name, amount, seed=0, upsample=0, **features):
    """Mesh, its reference, and vertices at random places near it."""
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), n=upsample, noise=0.0)
    mesh = built(V, F, ordered=True)
    reference = referenced(mesh, zoo.mean_edge(V, F), **features)
    tips = np.flatnonzero(mesh.kind == HELD)
    mesh.kind[tips] = INNER
    mesh.valence_excess[tips] = np.bincount(mesh.origin)[tips] - 6
    noise = np.random.default_rng(seed).normal(size=(len(mesh.X), 3))
    free = mesh.kind != FIXED
    mesh.X[free, :3] += amount * zoo.mean_edge(V, F) * noise[free]
    return mesh, reference


def distance(reference, P, faces=slice(None)):
    F = reference.origin.reshape(-1, 3)[faces].astype(np.int64)
    squared, _, points = igl.point_mesh_squared_distance(P, reference.X[:, :3].copy(), F)
    return np.sqrt(squared), points


def places(reference, faces, barycentric):
    F = reference.origin.reshape(-1, 3)
    return np.einsum("nc,ncx->nx", barycentric, reference.X[F[faces], :3])


def distance_within(reference, mesh, v):
    """Distance of a vertex to the faces of its patch that do not look away from its ring."""
    F = reference.origin.reshape(-1, 3)
    ring = [f for f in mesh.origin.reshape(-1, 3).tolist() if v in f]
    looks = sum(naive.normal(mesh.X[:, :3], f) for f in ring)
    a, b, c = np.moveaxis(reference.X[F, :3], 1, 0)
    allowed = np.cross(b - a, c - a) @ looks >= 0
    allowed &= reference.tree.patch == reference.tree.patch[mesh.birth[v] // 3]
    if not allowed.any():
        return np.inf
    return distance(reference, mesh.X[v : v + 1, :3].copy(), allowed)[0][0]


def assert_closest(mesh, reference, before, rel=1e-9):
    """Inner vertices went to where the walk ended, or to a closer face that may be searched."""
    walked = copied(before)
    project_vertices(walked, one_block(walked), reference, np.inf, False)
    for v in np.flatnonzero(mesh.kind == INNER):
        by_walk = np.linalg.norm(walked.X[v, :3] - before.X[v, :3])
        step = np.linalg.norm(mesh.X[v, :3] - before.X[v, :3])
        shortest = distance_within(reference, before, v)
        assert step == pytest.approx(min(by_walk, shortest), rel=rel, abs=1e-13)


@pytest.mark.parametrize("amount", [1e-3, 0.3, 3.0])
@pytest.mark.parametrize("name", MESHES)
def test_inner_vertices_go_to_the_closest_point(name, amount):
    mesh, reference = moved(name, amount)
    before = copied(mesh)
    project(mesh, reference)
    inner = mesh.kind == INNER
    found, _ = distance(reference, mesh.X[inner, :3].copy())
    assert found.max(initial=0) < 1e-12 * np.abs(reference.X).max()
    assert_closest(mesh, reference, before)
    assert_valid(mesh)
    if amount < 0.1:  # all look the right way
        shortest, _ = distance(reference, before.X[inner, :3].copy())
        step = np.linalg.norm((mesh.X - before.X)[inner, :3], axis=1)
        assert step == pytest.approx(shortest, rel=1e-9, abs=1e-13)


@pytest.mark.parametrize("name", ["sliver_fan", "annulus", "grid", "cylinder"])
def test_boundary_vertices_stay_on_the_boundary(name):
    mesh, reference = moved(name, 0.3)
    project(mesh, reference)
    rim = mesh.kind == CURVE
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


def test_project_curves_leaves_the_inside_alone():
    mesh, reference = moved("grid", 0.2, feature_edges=[[2, 3]])
    before = copied(mesh)
    project_curves(mesh, one_block(mesh), reference, False)
    inner = mesh.kind != CURVE
    assert np.array_equal(mesh.X[inner], before.X[inner])
    assert np.array_equal(mesh.birth[inner], before.birth[inner])
    rim = mesh.kind == CURVE
    assert not (mesh.X[rim, :3] == before.X[rim, :3]).all(axis=1).any()


def test_without_curves_there_is_nothing_to_project():
    mesh, reference = moved("torus", 0.2)
    before = mesh.X.copy()
    project_curves(mesh, one_block(mesh), reference, False)
    assert np.array_equal(mesh.X, before)


@pytest.mark.parametrize("name", MESHES)
def test_births_reproduce_projected_vertices(name):
    mesh, reference = moved(name, 0.3)
    project(mesh, reference)
    before = mesh.X.copy()
    weights = locate(mesh, reference)
    assert np.array_equal(mesh.X, before)
    assert weights.min() >= -1e-15 and weights.sum(axis=1) == pytest.approx(1)
    assert places(reference, mesh.birth // 3, weights) == pytest.approx(before[:, :3], abs=1e-12)


@pytest.mark.parametrize("amount", [1e-3, 0.5, 3.0])
@pytest.mark.parametrize("name", MESHES)
def test_births_of_others_are_the_closest_points(name, amount):
    """Of their part of the surface, whichever way the faces look."""
    mesh, reference = moved(name, amount)
    patch = reference.tree.patch
    own = patch[mesh.birth // 3]
    weights = locate(mesh, reference)
    found = np.linalg.norm(places(reference, mesh.birth // 3, weights) - mesh.X[:, :3], axis=1)
    for k in range(patch.max() + 1):
        mine = (own == k) & (mesh.kind == INNER)
        shortest, _ = distance(reference, mesh.X[mine, :3].copy(), patch == k)
        assert found[mine] == pytest.approx(shortest, rel=1e-9, abs=1e-13)
    assert np.array_equal(patch[mesh.birth // 3], own)


def test_a_second_projection_changes_nothing_but_rounding():
    mesh, reference = moved("genus_3", 0.4)
    project(mesh, reference)
    before = mesh.X.copy()
    project(mesh, reference)
    assert pytest.approx(before, abs=1e-14) == mesh.X


# --- features ------------------------------------------------------------------------------------


@pytest.mark.parametrize("amount", [0.1, 1.0])
@pytest.mark.parametrize("name", CREASED)
def test_vertices_stay_in_their_patch_and_on_their_curve(name, amount):
    """However far away they were, and although the faces next door are closer."""
    mesh, reference = moved(name, amount, upsample=2, feature_angle=40.0)
    patch, chain = reference.tree.patch, chains_of(reference)
    assert patch.max() > 0 and (mesh.kind == CURVE).any()
    inner, on_curve = mesh.kind == INNER, mesh.kind == CURVE
    before = copied(mesh)
    elsewhere, _ = distance(reference, mesh.X[inner, :3].copy())
    project(mesh, reference)
    assert_closest(mesh, reference, before)
    step = np.linalg.norm((mesh.X - before.X)[inner, :3], axis=1)
    assert (step > elsewhere * (1 + 1e-9)).any() or amount < 1
    weights = locate(mesh, reference)
    for now in (mesh.birth[inner], before.birth[inner]):
        assert np.array_equal(patch[now // 3], patch[before.birth[inner] // 3])
    assert np.array_equal(chain[mesh.birth[on_curve]], chain[before.birth[on_curve]])
    at = places(reference, mesh.birth // 3, weights)
    assert at == pytest.approx(mesh.X[:, :3], abs=1e-12)
    assert_on_reference(mesh, reference)
    assert_valid(mesh)


@pytest.mark.parametrize("name", CREASED)
def test_curves_are_projected_onto_their_own_edges(name):
    """All edges of a polyline looked at: the closest that is not too far along it."""
    mesh, reference = moved(name, 0.3, upsample=2, feature_angle=40.0)
    before = mesh.X.copy()
    chain = chains_of(reference)
    births = mesh.birth.copy()
    project_curves(mesh, one_block(mesh), reference, False)
    end = reference.origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    for v in np.flatnonzero(mesh.kind == CURVE):
        edges = np.flatnonzero((chain == chain[births[v]]) & (reference.tree.twin == NONE))
        ends = reference.X[:, :3][np.stack([reference.origin[edges], end[edges]])]
        assert min(to_segment(mesh.X[v, :3], a, b) for a, b in np.moveaxis(ends, 1, 0)) < 1e-13
        start = reference.X[:, :3][[reference.origin[births[v]], end[births[v]]]]
        step = np.linalg.norm((mesh.X - before)[v, :3])
        assert step <= to_segment(before[v, :3], *start) + 1e-13


def on_a_sheet(length=1.0):
    """Thin sheet from z = -0.02 to 0, one free vertex of its upper side, faces below the middle."""
    V, F = zoo.thin_sheet(10, thickness=0.02)
    mesh = built(V, F)
    reference = referenced(mesh, length)
    v = next(v for v in range(len(V)) if V[v, 2] == 0 and mesh.kind[v] == INNER)
    mesh.kind[np.arange(len(V)) != v] = FIXED
    below = np.abs(V[F].mean(axis=1) - [4.5, 4.5, -0.02]).sum(axis=1).argmin()
    above = np.abs(V[F].mean(axis=1) - [4.5, 4.5, 0.0]).sum(axis=1).argmin()
    return mesh, reference, v, below, above


@pytest.mark.parametrize("length", [1.0, 0.25])
@pytest.mark.parametrize(("trust", "finds_the_top"), [(0.0, True), (0.01, True), (0.1, False)])
def test_trust_is_a_share_of_the_length(trust, finds_the_top, length):
    """On the top of a thin sheet, remembered on the bottom: a walk stays there, a search does not."""
    mesh, reference, v, below, _ = on_a_sheet(length)
    mesh.X[v, :3] = [4.4, 4.6, 0.0]
    mesh.birth[v] = 3 * below
    project_vertices(mesh, one_block(mesh), reference, trust / length, False)
    assert mesh.X[v, :3] == pytest.approx([4.4, 4.6, 0.0 if finds_the_top else -0.02])


@pytest.mark.parametrize(("z", "by_distance"), [(-0.015, -0.02), (-0.03, -0.02), (0.01, 0.0)])
def test_a_search_refuses_faces_that_look_away(z, by_distance):
    """A vertex of the upper side stays there, also where the lower side is closer."""
    mesh, reference, v, _, above = on_a_sheet()
    mesh.X[v, :3] = [4.4, 4.6, z]
    mesh.birth[v] = 3 * above
    elsewhere = copied(mesh)
    weights = locate(elsewhere, reference)
    at = places(reference, elsewhere.birth[v : v + 1] // 3, weights[v : v + 1])[0]
    assert at == pytest.approx([4.4, 4.6, by_distance])
    project_vertices(mesh, one_block(mesh), reference, 0.0, False)
    assert mesh.X[v, :3] == pytest.approx([4.4, 4.6, 0.0], abs=1e-15)


def test_a_search_begun_on_a_face_that_looks_away_keeps_it_for_want_of_a_better():
    """The ring may be folded over: then no face of the input looks its way."""
    V, F = zoo.grid()
    mesh = built(V, F)
    reference = referenced(mesh, 1.0)
    v = int(np.flatnonzero(mesh.kind == INNER)[0])
    ring = np.unique(F[(v == F).any(axis=1)])
    mesh.X[ring, :2] = 2 * V[v, :2] - V[ring, :2][:, ::-1] + [0, 5]  # mirrored, and far away
    mesh.kind[np.arange(len(V)) != v] = FIXED
    before = mesh.X[v, :3].copy()
    project_vertices(mesh, one_block(mesh), reference, 0.0, False)
    assert np.isfinite(mesh.X[v]).all() and not np.array_equal(mesh.X[v, :3], before)
    assert distance(reference, mesh.X[v : v + 1, :3].copy())[0] < 1e-13


# --- lengths -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["grid", "planar_delaunay", "annulus"])
def test_lengths_are_those_of_the_place(name):
    """A linear function is interpolated exactly, inside and along curves; fixed vertices keep theirs."""
    V, F = zoo.ZOO[name].make()
    mesh = built(V, F, ordered=True)
    linear = lambda X: 3 + 0.3 * X[:, 0] - 0.2 * X[:, 1]  # noqa: E731
    reference = referenced(mesh, linear(mesh.X))
    noise = np.random.default_rng(1).normal(size=mesh.X.shape)
    free = mesh.kind != FIXED
    mesh.X[free, :3] += 0.4 * zoo.mean_edge(V, F) * noise[free, :3]
    project(mesh, reference)
    mesh.X[:, 3] = -1.0
    before = mesh.X[:, :3].copy()
    read_lengths(mesh, one_block(mesh), reference, False)
    assert np.array_equal(mesh.X[:, :3], before)
    assert mesh.X[free, 3] == pytest.approx(linear(mesh.X)[free], rel=1e-12)
    assert (mesh.X[~free, 3] == -1.0).all()


def test_lengths_jump_where_patches_meet():
    """Not across: on each side of a crease the lengths of this side are read."""
    mesh, reference = moved("cube", 0.3, upsample=3, feature_angle=40.0)
    patch = reference.tree.patch
    F = reference.origin.reshape(-1, 3)
    lengths = np.ones(len(reference.X))
    inside = np.setdiff1d(F[patch == 0], F[patch != 0])
    lengths[inside] = 100.0
    reference.X[:, 3] = lengths
    before = patch[mesh.birth // 3]
    read_lengths(mesh, one_block(mesh), reference, False)
    others = (mesh.kind == INNER) & (before != 0)
    assert (mesh.X[others, 3] == 1.0).all()
    here = mesh.X[(mesh.kind == INNER) & (before == 0), 3]
    assert here.min() >= 1.0 and (here > 10.0).mean() > 0.7  # a few lie next to the crease
    assert mesh.X[mesh.kind == CURVE, 3] == pytest.approx(1.0)


def test_removed_vertices_are_left_alone():
    mesh, reference = moved("torus", 0.1)
    F = mesh.origin.reshape(-1, 3)
    v = int(F[0, 0])
    mesh.vertex_halfedge[v] = DEAD
    before = mesh.X[v].copy()
    project(mesh, reference)
    read_lengths(mesh, one_block(mesh), reference, False)
    assert np.array_equal(mesh.X[v], before)
