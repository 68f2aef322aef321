"""Corners, creases and planes of solids survive at every length, and round shapes get no creases."""

import numpy as np
import pytest
from helpers import zoo
from helpers.complexes import curves_of, shape
from helpers.invariants import assert_clean, assert_corners, assert_creases, assert_solid_kept
from helpers.measures import (
    NEAR,
    ON,
    along,
    boundary_edges,
    closest_on,
    diagonal,
    edge_lengths,
    face_areas,
    lengths_of,
    nearest,
    sag,
    sorted_edges,
    surface_samples,
    to_segments,
    to_surface,
    unit_normals,
)

from data.shapes.solids import FORMS, SOLIDS, Solid, closed, plate, regular, triangulated, uv_sphere
from remeshvec import remesh

# Edges of up to 4/3 L are left alone, and relaxing stretches some: chords are shorter than 1.5 L.
LONGEST = 1.5


def assert_even(V, F, L):
    """The mean edge is near L: features are not kept by leaving everything as it was."""
    mean = edge_lengths(V, F).mean()
    assert mean == pytest.approx(L, rel=0.15)


def assert_coarse(V, F, L):
    """Not many more faces than equilateral ones; creases that L does not divide cost some."""
    faces, ideal = len(F), face_areas(V, F).sum() / (np.sqrt(3) / 4 * L**2)
    assert faces < 3 * ideal + 20


def assert_creases_are_resampled(V, edges, creases, L):
    lengths = lengths_of(V, edges)
    assert lengths.max() < LONGEST * L
    if np.linalg.norm(creases[:, 1] - creases[:, 0], axis=1).min() > 4 * L:
        assert 0.7 * L < lengths.mean() < 1.3 * L


def assert_kept(result, solid: Solid, L):
    """All that is asked of a solid, and that the result says so."""
    assert_solid_kept(solid, result.V, result.F, result.feature_edges)
    assert_creases_are_resampled(result.V, result.feature_edges, solid.creases, L)
    assert_corners(result.V[result.corners], solid.corners, solid.diagonal)


# --- solids --------------------------------------------------------------------------------------


@pytest.mark.parametrize("factor", [0.05, 0.1])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", SOLIDS)
def test_defaults_keep_solids(name, form, factor):
    V, F = triangulated(name, form)
    L = factor * SOLIDS[name].diagonal
    result = remesh(V, F, L)
    assert_kept(result, SOLIDS[name], L)
    assert_even(result.V, result.F, L)


@pytest.mark.parametrize("iterations", [3, 5, 10])
@pytest.mark.parametrize("factor", [0.05, 0.1])
@pytest.mark.parametrize("name", SOLIDS)
def test_an_angle_keeps_solids(name, factor, iterations):
    """Three of the four forms each, in turn."""
    L = factor * SOLIDS[name].diagonal
    skipped = FORMS[(list(SOLIDS).index(name) + iterations) % 4]
    for form in (form for form in FORMS if form != skipped):
        V, F = triangulated(name, form)
        result = remesh(V, F, L, feature_angle=20, iterations=iterations)
        assert_kept(result, SOLIDS[name], L)
        assert_even(result.V, result.F, L)


@pytest.mark.parametrize("iterations", [3, 5, 10])
@pytest.mark.parametrize("factor", [0.2, 0.4])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", SOLIDS)
def test_an_angle_keeps_solids_at_coarse_lengths(name, form, factor, iterations):
    """Where a facet is hardly wider than L."""
    V, F = triangulated(name, form)
    L = factor * SOLIDS[name].diagonal
    result = remesh(V, F, L, feature_angle=20, iterations=iterations)
    assert_kept(result, SOLIDS[name], L)
    assert_coarse(result.V, result.F, L)


@pytest.mark.parametrize("preset", ["fast", "fine"])
@pytest.mark.parametrize("name", SOLIDS)
def test_presets_keep_solids(name, preset):
    V, F = triangulated(name, "uneven")
    L = 0.08 * SOLIDS[name].diagonal
    assert_kept(remesh(V, F, L, preset=preset), SOLIDS[name], L)


@pytest.mark.parametrize("move", ["far", "small", "large"])
def test_solids_anywhere_and_in_any_unit(move):
    """Rounding of far coordinates is all that is lost."""
    V, F = triangulated("l_prism", "shaken")
    solid = SOLIDS["l_prism"]
    change = {"far": (1.0, 1e5 + 0.1), "small": (1e-7 / 3, 0.0), "large": (7e8, 0.0)}[move]
    W = V * change[0] + change[1]
    L = 0.1 * solid.diagonal * change[0]
    result = remesh(W, F, L)
    back = (result.V - change[1]) / change[0]
    edges = result.feature_edges
    if move == "far":  # 1e5 has 1e-11 left
        assert shape(result.F) == shape(F)
        assert_corners(back, solid.corners, solid.diagonal)
        assert_creases(back, edges, solid.creases, solid.diagonal)
    else:
        assert_solid_kept(solid, back, result.F, edges)


# --- a part with curved creases ------------------------------------------------------------------


def assert_part_kept(result, part, L):
    size = diagonal(part.V)
    V, F = result.V, result.F
    assert_clean(V, F)
    assert shape(F) == shape(part.F)
    assert_corners(V, part.corners, size)
    # Vertices lie on the input, edges and faces are chords of what is round.
    assert to_surface(V, part.V, part.F).max() < NEAR * size
    chord = max(sag(LONGEST * L, radius) for radius in part.radii)
    assert to_surface(surface_samples(V, F), part.V, part.F).max() < chord
    assert_part_creases(result, part, L, chord, size)
    assert_planes(V, F, L, size)
    error = sum(
        area * sag(LONGEST * L, radius)
        for area, radius in zip(part.curved_areas, part.radii, strict=True)
    )
    assert abs(zoo.volume(V, F) - zoo.volume(part.V, part.F)) < error


def assert_part_creases(result, part, L, chord, size):
    V, edges = result.V, result.feature_edges
    segments = V[edges]
    creases = np.vstack([part.straight, part.curved])
    assert to_segments(V[np.unique(edges)], creases).max() < NEAR * size
    assert to_segments(along(segments), creases).max() < chord
    assert to_segments(along(part.curved), segments).max() < chord
    # A chord may reach over from an arc, which takes off the end of the straight piece beside it.
    P = along(part.straight, n=60)
    P = P[nearest(P, part.tangent)[0] > LONGEST * L]
    assert len(P) and to_segments(P, segments).max() < ON * size


def assert_planes(V, F, L, size):
    """Faces whose corners lie in one of the planes have its normal; the end has its area."""
    planes = [(0, 0.0, -1), (1, 0.0, -1), (1, 4.0, 1), (2, 0.0, -1), (2, 1.0, 1), (2, 2.0, 1)]
    if L < 0.4:  # the strip below the fillet, 0.5 high and without a crease above it
        planes.append((0, 6.0, 1))
    corners, N, areas = V[F], unit_normals(V, F), face_areas(V, F)
    for axis, level, sign in planes:
        inside = (np.abs(corners[:, :, axis] - level) < ON * size).all(axis=1)
        assert inside.any(), (axis, level)
        assert (sign * N[inside, axis] > 1 - 1e-9).all(), (axis, level)
        if axis == 0 and level == 0:  # 4 x 1, all borders straight
            assert areas[inside].sum() == pytest.approx(4.0, rel=1e-9)


@pytest.mark.parametrize("factor", [0.05, 0.1])
def test_defaults_keep_the_part(factor):
    part = plate()
    L = factor * diagonal(part.V)
    result = remesh(part.V, part.F, L)
    assert_part_kept(result, part, L)
    if factor == 0.05:
        assert_even(result.V, result.F, L)


@pytest.mark.parametrize("iterations", [3, 5, 10])
@pytest.mark.parametrize("factor", [0.05, 0.1, 0.2, 0.4])
def test_an_angle_keeps_the_part(factor, iterations):
    part = plate()
    L = factor * diagonal(part.V)
    result = remesh(part.V, part.F, L, feature_angle=20, iterations=iterations)
    assert_part_kept(result, part, L)
    if factor > 0.1:
        assert_coarse(result.V, result.F, L)


def test_round_creases_have_no_corners():
    """A closed cylinder: two circles, nothing else."""
    V, F = zoo.closed_cylinder(60, 15)
    result = remesh(V, F, 0.2)
    rims = [np.column_stack([closed(regular(60)), np.full(61, z)]) for z in (0.0, 2.0)]
    creases = np.vstack([np.stack([P[:-1], P[1:]], axis=1) for P in rims])
    assert curves_of(result.feature_edges).curves == [(1,), (1,)]
    assert to_segments(result.V[result.feature_edges.ravel()], creases).max() < ON * 4
    assert to_segments(along(creases), result.V[result.feature_edges]).max() < sag(0.3, 1.0)
    assert len(result.corners) == 0
    assert lengths_of(result.V, result.feature_edges).mean() == pytest.approx(0.2, rel=0.25)


def test_the_tip_of_a_cone_stays():
    V, F = zoo.cone(40)
    result = remesh(V, F, 0.2)
    assert_corners(result.V, V[[40]], diagonal(V))
    assert shape(result.F) == shape(F)
    heights = result.V[result.feature_edges.ravel(), 2]
    assert len(heights) and np.abs(heights).max() < ON * diagonal(V)


def test_bracket():
    """A part in mm, its thirteen planes triangulated by slivers."""
    V, F = zoo.read(zoo.DATA / "bracket.obj")
    size = diagonal(V)
    result = remesh(V, F, 0.04 * size)
    assert shape(result.F) == shape(F)
    blocks = np.array([(80, 0, 0), (80, 50, 0), (80, 0, 8), (80, 50, 8), (0, 0, 0), (0, 50, 0)])
    assert_corners(result.V, blocks, size)
    ends = [((80, 0, 0), (80, 50, 0)), ((80, 0, 8), (80, 50, 8)), ((80, 0, 0), (80, 0, 8))]
    ends += [((0, 0, 0), (0, 50, 0)), ((0, 0, 0), (80, 0, 0)), ((0, 50, 0), (80, 50, 0))]
    straight = np.array(ends, float)
    assert to_segments(along(straight, n=50), result.V[result.feature_edges]).max() < ON * size
    away = to_surface(result.V, V, F)
    assert away.max() < NEAR * size
    assert zoo.volume(result.V, result.F) == pytest.approx(zoo.volume(V, F), rel=0.01)


# --- what is no crease ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["sphere", "torus", "tube", "saddle"])
def test_round_shapes_have_no_creases(name):
    V, F = {
        "sphere": lambda: uv_sphere(40, 20),
        "torus": lambda: zoo.torus(48, 20),
        "tube": lambda: zoo.cylinder(40, 10),
        "saddle": saddle,
    }[name]()
    result = remesh(V, F, 1.2 * zoo.mean_edge(V, F))
    expected = sorted_edges(boundary_edges(result.F))
    assert np.array_equal(sorted_edges(result.feature_edges), expected)
    assert (len(expected) > 0) == (name in ("tube", "saddle"))


def saddle():
    V, F = zoo.grid(15, 15)
    V = (V - 7) / 7
    V[:, 2] = V[:, 0] * V[:, 1]
    return V, F


def test_a_number_is_a_plain_threshold():
    """Edges of an octahedron turn by 70.5 degrees."""
    V, F = triangulated("octahedron", "even")
    L = 0.1 * SOLIDS["octahedron"].diagonal
    assert len(remesh(V, F, L, feature_angle=72).feature_edges) == 0
    kept = remesh(V, F, L, feature_angle=69)
    solid = SOLIDS["octahedron"]
    assert_creases(kept.V, kept.feature_edges, solid.creases, solid.diagonal)


def test_none_is_off():
    V, F = triangulated("cube", "even")
    result = remesh(V, F, 0.1, feature_angle=None)
    assert len(result.feature_edges) == 0
    V, F = zoo.grid()
    result = remesh(V, F, 0.7, feature_angle=None)
    edges = sorted_edges(result.feature_edges)
    assert np.array_equal(edges, sorted_edges(boundary_edges(result.F)))


# --- what is reported ----------------------------------------------------------------------------


def test_features_are_counted():
    V, F = triangulated("cube", "even")
    features = remesh(V, F, 0.15).report.features
    assert features["crease_edges"] == 12 * 8 and features["corners"] == 8
    assert 1 <= features["chains"] <= 12
    smooth = remesh(*zoo.torus(48, 20), 0.2).report.features
    assert not any(smooth.get(name, 0) for name in ("crease_edges", "chains", "corners"))


def test_maps_and_fields_of_a_result():
    V, F = triangulated("cube", "even")
    result = remesh(V, F, 0.15)
    assert result.face_labels is None
    assert result.vertex_map.shape == (len(V),) and result.face_map.shape == (len(F),)
    held = np.flatnonzero(result.vertex_map >= 0)
    away, _ = nearest(V[held], SOLIDS["cube"].corners)
    assert len(held) == 8 and away.max() == 0
    assert np.array_equal(result.V[result.vertex_map[held]], V[held])
    assert set(result.vertex_map[held].tolist()) == set(result.corners.tolist())
    assert (result.vertex_map[np.setdiff1d(np.arange(len(V)), held)] == -1).all()
    assert (result.face_map == -1).all()
    assert result.lengths.shape == (len(result.V),)
    assert result.lengths == pytest.approx(0.15, rel=1e-12)
    edges = sorted_edges(result.feature_edges)
    assert result.feature_edges.shape == edges.shape == (len(edges), 2)
    _, face = closest_on(result.V[result.F].mean(axis=1), V, F)
    assert len(np.unique(face)) > len(F) / 10
