"""What the caller holds or draws: fixed vertices and faces, feature edges, labels of faces."""

from itertools import pairwise

import numpy as np
import pytest
from helpers import zoo
from helpers.complexes import curves_of, edges_of, shape
from helpers.invariants import assert_clean, assert_corners, assert_same_graph
from helpers.measures import (
    NEAR,
    ON,
    along,
    bits,
    boundary_edges,
    closest_on,
    diagonal,
    edge_lengths,
    face_areas,
    face_places,
    label_borders,
    lengths_of,
    sag,
    sorted_edges,
    to_segments,
    to_surface,
    unit_normals,
)

from data.shapes.solids import SOLIDS, circle_edges, triangulated, uv_sphere
from remeshvec import remesh

# Moves of a mesh: factor, shift. Far from the origin the core works in a frame of its own, from which
# coordinates come back by rounding, unless they are taken from the input.
MOVES = {
    "here": (1.0, 0.0),
    "far": (1.0, 1e6 + 0.1),
    "third": (1 / 3, 0.0),
    "tiny": (1e-7 / 3, 0.0),
    "huge": (7e5, -0.3),
    "tiny and off": (1e-5 / 7, 0.1),
}


def moved(V, name):
    factor, shift = MOVES[name]
    return V * factor + shift


def assert_held(result, V, vertices):
    """The input vertices are in the output bit for bit, where `vertex_map` says; no other claim fails."""
    where = result.vertex_map[vertices]
    assert (where >= 0).all()
    assert bits(result.V[where]) == bits(V[vertices])
    claimed = np.flatnonzero(result.vertex_map >= 0)
    assert bits(result.V[result.vertex_map[claimed]]) == bits(V[claimed])
    assert len(np.unique(result.vertex_map[claimed])) == len(claimed)
    assert set(result.vertex_map[claimed].tolist()) == set(result.corners.tolist())


def assert_faces_held(result, V, F, faces):
    """The input faces are in the output bit for bit, where `face_map` says, and no others."""
    where = result.face_map[faces]
    assert (where >= 0).all() and len(np.unique(where)) == len(faces)
    assert face_places(result.V, result.F[where]) == face_places(V, F[faces])
    others = np.setdiff1d(np.arange(len(F)), faces)
    assert (result.face_map[others] == -1).all()
    assert_held(result, V, np.unique(F[faces]))


# --- fixed vertices ------------------------------------------------------------------------------


def some_vertices(V, count=15, seed=0):
    """Random ones, and two that share an edge or nearly so."""
    chosen = np.random.default_rng(seed).choice(len(V), count, replace=False)
    beside = np.argsort(np.linalg.norm(V - V[chosen[0]], axis=1))[1]
    return np.unique(np.append(chosen, beside))


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("move", MOVES)
def test_fixed_vertices_stay(move, factor):
    V, F = zoo.perturb(*zoo.icosphere(3), amount=0.03)
    W = moved(V, move)
    L = factor * zoo.mean_edge(W, F)
    vertices = some_vertices(V)
    result = remesh(W, F, L, fixed_vertices=vertices)
    assert_held(result, W, vertices)
    assert shape(result.F) == shape(F)
    assert edge_lengths(*result).mean() == pytest.approx(L, rel=0.15)


@pytest.mark.parametrize("name", ["grid", "tube", "cube", "genus_2"])
def test_fixed_vertices_on_boundaries_and_creases(name):
    V, F = {
        "grid": lambda: zoo.grid(15, 11),
        "tube": lambda: zoo.cylinder(36, 12),
        "cube": lambda: triangulated("cube", "even"),
        "genus_2": lambda: zoo.upsampled(*zoo.genus_2(), n=1, noise=0),
    }[name]()
    vertices = some_vertices(V, count=12, seed=3)
    if name in ("grid", "tube"):
        vertices = np.union1d(vertices, np.unique(boundary_edges(F))[::7])
    result = remesh(V, F, 2.2 * zoo.mean_edge(V, F), fixed_vertices=vertices)
    assert_held(result, V, vertices)
    assert_clean(*result)
    assert shape(result.F) == shape(F)


def test_all_vertices_fixed():
    """Nothing can collapse, edges may still be split and flipped."""
    V, F = zoo.icosphere(2)
    result = remesh(V, F, 3 * zoo.mean_edge(V, F), fixed_vertices=np.arange(len(V)))
    assert_held(result, V, np.arange(len(V)))
    assert len(result.V) == len(V) and shape(result.F) == shape(F)


def test_fixed_vertices_of_float32_meshes():
    V, F = zoo.icosphere(3)
    V = (V * 0.37 + 11.1).astype(np.float32)
    vertices = some_vertices(V)
    result = remesh(V, F, 0.1, fixed_vertices=vertices)
    assert result.V.dtype == np.float32
    assert_held(result, V, vertices)


# --- fixed faces ---------------------------------------------------------------------------------


def cap(V, F, level):
    return np.flatnonzero(V[F].mean(axis=1)[:, 2] > level)


@pytest.mark.parametrize("which", ["cap", "scattered", "one"])
@pytest.mark.parametrize("move", ["here", "far", "tiny"])
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_fixed_faces_stay(which, move, factor):
    V, F = zoo.perturb(*zoo.icosphere(3), amount=0.03)
    faces = {"cap": cap(V, F, 0.7), "scattered": np.arange(0, len(F), 97), "one": np.array([500])}
    W, held = moved(V, move), faces[which]
    L = factor * zoo.mean_edge(W, F)
    result = remesh(W, F, L, fixed_faces=held)
    assert_faces_held(result, W, F, held)
    assert shape(result.F) == shape(F)
    free = np.setdiff1d(np.arange(len(result.F)), result.face_map[held])
    middle = (result.V[result.F[free]].mean(axis=1) - MOVES[move][1]) / MOVES[move][0]
    away = free[middle[:, 2] < 0.2] if which == "cap" else free
    assert edge_lengths(result.V, result.F[away]).mean() == pytest.approx(L, rel=0.2)


def test_fixed_faces_by_number_or_mask():
    V, F = zoo.grid(15, 11)
    faces = np.flatnonzero(V[F][:, :, 0].max(axis=1) <= 3)
    mask = np.isin(np.arange(len(F)), faces)
    one, two = (remesh(V, F, 0.6, fixed_faces=held) for held in (faces[::-1].copy(), mask))
    assert_faces_held(one, V, F, faces)
    assert np.array_equal(one.V, two.V) and np.array_equal(one.F, two.F)
    assert np.array_equal(one.face_map, two.face_map)
    assert zoo.area(*one) == pytest.approx(zoo.area(V, F), rel=1e-9)
    assert (unit_normals(*one)[:, 2] > 0.5).all()


# --- feature edges -------------------------------------------------------------------------------

COLUMNS, ROWS = 15, 11  # vertices of the flat grid


def number(i, j):
    return i * ROWS + j


def line(points):
    """Edges of the grid along a polyline with axis-parallel pieces."""
    edges = []
    for (i, j), (k, h) in pairwise(points):
        steps = max(abs(k - i), abs(h - j))
        di, dj = (k - i) // steps, (h - j) // steps
        edges += [
            (number(i + s * di, j + s * dj), number(i + s * di + di, j + s * dj + dj))
            for s in range(steps)
        ]
    return np.array(edges)


LINES = {
    "across": line([(6, 0), (6, ROWS - 1)]),
    "inside": line([(4, 5), (11, 5)]),
    "hook": line([(3, 0), (3, 6), (9, 6)]),
    "rectangle": line([(3, 3), (11, 3), (11, 8), (3, 8), (3, 3)]),
    "cross": np.vstack([line([(7, 1), (7, 9)]), line([(2, 5), (12, 5)])]),
}


def drawn(result):
    """Feature edges that are no boundary."""
    edges = sorted_edges(result.feature_edges)
    rim = {tuple(edge) for edge in sorted_edges(boundary_edges(result.F)).tolist()}
    return np.array([edge for edge in edges.tolist() if tuple(edge) not in rim]).reshape(-1, 2)


@pytest.mark.parametrize("angle", ["auto", None])
@pytest.mark.parametrize("L", [0.45, 1.7])
@pytest.mark.parametrize("name", LINES)
def test_lines_on_a_plane_stay(name, L, angle):
    V, F = zoo.grid(COLUMNS, ROWS)
    edges = LINES[name]
    result = remesh(V, F, L, feature_edges=edges, feature_angle=angle)
    assert_clean(*result)
    assert shape(result.F) == shape(F)
    found, size = drawn(result), diagonal(V)
    assert len(found), "the line is gone"
    assert to_segments(along(result.V[found]), V[edges]).max() < ON * size
    assert to_segments(along(V[edges]), result.V[found]).max() < ON * size
    assert lengths_of(result.V, found).sum() == pytest.approx(len(edges), rel=1e-9)
    assert_same_graph(result.V, curves_of(found), V, curves_of(edges), size)
    assert lengths_of(result.V, found).max() < 1.5 * L
    turns = {"hook": [(3, 6)], "rectangle": [(3, 3), (11, 3), (11, 8), (3, 8)]}.get(name, [])
    assert_corners(result.V, V[[number(*at) for at in turns]], size)
    if not turns:  # a straight line is resampled
        assert lengths_of(result.V, found).mean() == pytest.approx(L, rel=0.35)


@pytest.mark.parametrize("L", [0.1, 0.3])
@pytest.mark.parametrize("name", ["circle", "meridian"])
def test_lines_on_a_sphere_stay(name, L):
    n, m = 48, 24
    V, F = uv_sphere(n, m)
    edges = circle_edges(n, m, 7)
    if name == "meridian":  # from circle 3 to circle 19
        edges = np.stack([np.arange(3, 19), np.arange(4, 20)], axis=1)
    result = remesh(V, F, L, feature_edges=edges)
    assert shape(result.F) == shape(F)
    found = np.asarray(result.feature_edges)
    radius = np.linalg.norm(V[edges[0, 0], :2]) if name == "circle" else 1.0
    assert to_segments(result.V[np.unique(found)], V[edges]).max() < ON * 4
    chord = sag(1.5 * L, radius) + sag(
        lengths_of(V, edges).max(), radius
    )  # new ones, and those given
    assert to_segments(along(result.V[found]), V[edges]).max() < chord
    assert to_segments(along(V[edges]), result.V[found]).max() < chord
    assert_same_graph(result.V, curves_of(found), V, curves_of(edges), 4)
    assert lengths_of(result.V, found).mean() == pytest.approx(L, rel=0.3)


def test_feature_edges_in_any_order_and_direction():
    V, F = zoo.grid(COLUMNS, ROWS)
    edges = LINES["cross"]
    one = remesh(V, F, 0.7, feature_edges=edges)
    mixed = np.random.default_rng(0).permutation(edges)[:, ::-1]
    two = remesh(V, F, 0.7, feature_edges=np.vstack([mixed, edges[:3]]))
    assert np.array_equal(one.V, two.V) and np.array_equal(one.F, two.F)
    assert np.array_equal(sorted_edges(one.feature_edges), sorted_edges(two.feature_edges))


# --- labels --------------------------------------------------------------------------------------


def plane_labels(name, P):
    """Labels of faces by their centroids in the grid's plane; borders run along grid lines."""
    x, y = P[:, 0], P[:, 1]
    return {
        "halves": np.where(x < 6, 1, 0),
        "quarters": 10 * (x < 6) - 3 * (y < 5),
        "stripes": (x // 3).astype(int),
        "island": np.where((np.abs(x - 7.5) < 3.5) & (np.abs(y - 5) < 3), 2**40, -7),
        "bend": np.where((x < 5) & (y > 4), 5, 6),
        "one": np.full(len(P), 4),
    }[name]


def label_areas(V, F, labels):
    return {v: face_areas(V, F)[labels == v].sum() for v in np.unique(labels).tolist()}


@pytest.mark.parametrize("angle", ["auto", None])
@pytest.mark.parametrize("L", [0.45, 1.7])
@pytest.mark.parametrize("name", ["halves", "quarters", "stripes", "island", "bend", "one"])
def test_labels_of_a_plane_keep_their_areas(name, L, angle):
    V, F = zoo.grid(COLUMNS, ROWS)
    labels = plane_labels(name, V[F].mean(axis=1))
    result = remesh(V, F, L, face_labels=labels, feature_angle=angle)
    V2, F2, found = result.V, result.F, np.asarray(result.face_labels)
    assert_clean(V2, F2)
    assert shape(F2) == shape(F)
    assert found.shape == (len(F2),) and found.dtype.kind in "iu"
    expected, areas = label_areas(V, F, labels), label_areas(V2, F2, found)
    assert areas.keys() == expected.keys()
    for value, area in expected.items():
        assert areas[value] == pytest.approx(area, rel=ON), value
    _, face = closest_on(V2[F2].mean(axis=1), V, F)
    assert np.array_equal(found, labels[face])
    borders = np.vstack([label_borders(F2, found), boundary_edges(F2)])
    assert np.array_equal(sorted_edges(result.feature_edges), sorted_edges(borders))


@pytest.mark.parametrize("L", [0.08, 0.3, 0.7])
def test_labels_hold_a_cube_together(L):
    """One label a facet, no angle: borders of labels are the creases, their junctions the corners."""
    V, F = triangulated("cube", "uneven")
    normals = np.rint(unit_normals(V, F)).astype(int)
    labels = normals @ [1, 2, 3]
    result = remesh(V, F, L, face_labels=labels, feature_angle=None)
    areas = label_areas(result.V, result.F, result.face_labels)
    assert areas == pytest.approx(dict.fromkeys([-3, -2, -1, 1, 2, 3], 1.0), rel=ON)
    assert_corners(result.V, SOLIDS["cube"].corners, 1)
    found = np.rint(unit_normals(result.V, result.F)).astype(int) @ [1, 2, 3]
    assert np.array_equal(found, result.face_labels)


@pytest.mark.parametrize("L", [0.08, 0.2])
def test_labels_of_a_sphere(L):
    """A cap, and a lune that meets it: three labels with junctions."""
    V, F = uv_sphere(60, 30)
    P = V[F].mean(axis=1)
    high, east = P[:, 2] > np.cos(np.pi / 3), P[:, 1] > 0
    labels = np.where(high, 0, np.where(east, 1, 2))
    result = remesh(V, F, L, face_labels=labels)
    assert shape(result.F) == shape(F)
    size = diagonal(V)
    borders, given = label_borders(result.F, result.face_labels), label_borders(F, labels)
    assert np.array_equal(sorted_edges(result.feature_edges), sorted_edges(borders))
    assert to_segments(result.V[np.unique(borders)], V[given]).max() < ON * size
    assert_same_graph(result.V, curves_of(borders), V, curves_of(given), size)
    # Areas change by the chords on the surface (twice their sag, relative) and by those of the border.
    slack = 2 * sag(1.3 * L, 1.0) * 4 * np.pi + 2 * np.pi * sag(1.3 * L, np.sin(np.pi / 3))
    areas = label_areas(result.V, result.F, result.face_labels)
    for value, area in label_areas(V, F, labels).items():
        assert areas[value] == pytest.approx(area, abs=slack / 2), value


def test_labels_of_every_integer_type():
    V, F = zoo.grid(COLUMNS, ROWS)
    labels = plane_labels("quarters", V[F].mean(axis=1))
    expected = remesh(V, F, 0.8, face_labels=labels)
    for dtype in (np.int8, np.int32, np.int64, list):
        given = labels.tolist() if dtype is list else labels.astype(dtype)
        result = remesh(V, F, 0.8, face_labels=given)
        assert np.array_equal(result.face_labels, expected.face_labels)
        assert np.array_equal(result.V, expected.V)


def test_random_labels_are_survived():
    """Borders everywhere: hardly anything may move, and the mesh stays one."""
    V, F = zoo.icosphere(2)
    labels = np.random.default_rng(0).integers(0, 5, len(F))
    for factor in (0.4, 1.0, 3.0):
        result = remesh(V, F, factor * zoo.mean_edge(V, F), face_labels=labels)
        assert shape(result.F) == shape(F)
        assert set(np.unique(result.face_labels)) == set(range(5))
        borders = {tuple(edge) for edge in label_borders(result.F, result.face_labels).tolist()}
        assert borders <= {tuple(edge) for edge in sorted_edges(result.feature_edges).tolist()}
        assert (edges_of(result.F).faces == 2).all()


def test_labels_and_lines_and_points_at_once():
    V, F = zoo.grid(COLUMNS, ROWS)
    labels = plane_labels("halves", V[F].mean(axis=1))
    points = np.array([number(2, 2), number(10, 7), number(6, 5)])
    faces = np.flatnonzero(V[F][:, :, 0].min(axis=1) >= 12)
    result = remesh(
        V, F, 0.6, face_labels=labels, feature_edges=LINES["inside"], fixed_vertices=points,
        fixed_faces=faces, boundary="split",
    )  # fmt: skip
    assert_faces_held(result, V, F, faces)
    assert_held(result, V, np.union1d(points, np.unique(boundary_edges(F))))
    assert label_areas(result.V, result.F, result.face_labels) == pytest.approx(
        label_areas(V, F, labels), rel=ON
    )
    given = np.vstack([LINES["inside"], label_borders(F, labels)])
    assert to_segments(along(V[given]), result.V[drawn(result)]).max() < ON * diagonal(V)
    assert to_surface(result.V, V, F).max() < NEAR
