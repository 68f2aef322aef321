"""Boundary loops of the reference: links, corners, and the closest point of a vertex's own stretch."""

import numpy as np
import pytest
import zoo
from structure import built

from remeshvec._jit import kernel
from remeshvec._types import NONE
from remeshvec.boundary import closest_on_boundary, link_boundary
from remeshvec.features import apexes, boundary_corners


def corners_of(V, F, length):
    mesh = built(V, F)
    return boundary_corners(mesh, link_boundary(mesh), length)


def polygon(points, spacing):
    """Flat disc inside a polygon, its sides cut to equal edges of about a spacing."""
    P = np.array(points, float)
    rim = []
    for a, b in zip(P, np.roll(P, -1, axis=0), strict=True):
        n = max(1, round(np.linalg.norm(b - a) / spacing))
        rim += [a + (b - a) * i / n for i in range(n)]
    rim = np.array(rim)
    V = np.vstack([rim, rim.mean(axis=0)])
    return np.column_stack([V, np.zeros(len(V))]), zoo.fan(np.arange(len(rim)), len(rim))


def disc(n, radius=1.0):
    V = np.column_stack([radius * np.cos(zoo.turn(n)), radius * np.sin(zoo.turn(n)), np.zeros(n)])
    return np.vstack([V, [[0, 0, 0]]]), zoo.fan(np.arange(n), n)


# --- links ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["triangle", "annulus", "planar_delaunay", "sliver_fan"])
def test_links_are_loops_both_ways(name):
    mesh = built(*zoo.ZOO[name].make())
    links = link_boundary(mesh)
    open_ones = np.flatnonzero(mesh.twin == NONE)
    assert links.shape == (2, mesh.origin.size)
    assert (links[:, mesh.twin != NONE] == NONE).all()
    assert np.array_equal(links[1, links[0, open_ones]], open_ones)
    end = mesh.origin[np.where(open_ones % 3 == 2, open_ones - 2, open_ones + 1)]
    assert np.array_equal(mesh.origin[links[0, open_ones]], end)


def test_closed_meshes_have_no_links():
    assert link_boundary(built(*zoo.torus())).shape == (2, 0)
    assert len(corners_of(*zoo.torus(), 0.5)) == 0


# --- corners -------------------------------------------------------------------------------------


@pytest.mark.parametrize("length", [0.05, 0.2, 0.7, 3.0, 50.0])
@pytest.mark.parametrize("n", [12, 40, 300])
def test_a_circle_has_no_corners(n, length):
    V, F = disc(n)
    if length < 2 * np.pi / n:
        pytest.skip("edges longer than the scale: it is a polygon there")
    assert len(corners_of(V, F, length)) == 0


@pytest.mark.parametrize("length", [0.3, 1.9, 2.5])
def test_arcs_that_go_on_turning_are_no_corners(length):
    """Half-circles of radius 1 at the ends of a long strip: over L / 2 they turn by up to 72 degrees."""
    t = np.linspace(-np.pi / 2, np.pi / 2, 41)
    end = np.stack([10 + np.cos(t), np.sin(t)], axis=1)
    side = np.stack([np.linspace(-9.9, 9.9, 200), np.full(200, -1.0)], axis=1)
    rim = np.vstack([side, end, -side, -end])
    V = np.vstack([np.column_stack([rim, np.zeros(len(rim))]), [[0, 0, 0]]])
    assert len(corners_of(V, zoo.fan(np.arange(len(rim)), len(rim)), length)) == 0


@pytest.mark.parametrize("length", [0.05, 0.3, 1.0, 2.0, 10.0])
@pytest.mark.parametrize("spacing", [0.04, 0.5, 9.0])
def test_a_rectangle_has_four(spacing, length):
    points = [[0, 0], [3, 0], [3, 2], [0, 2]]
    V, F = polygon(points, spacing)
    found = V[corners_of(V, F, length), :2]
    assert sorted(map(tuple, found.tolist())) == sorted(
        map(tuple, np.array(points, float).tolist())
    )


@pytest.mark.parametrize("length", [0.05, 0.3, 0.6])
def test_an_l_has_six(length):
    """Convex and concave corners alike."""
    points = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]
    V, F = polygon(points, 0.1)
    V[-1, :2] = 0.7  # the fan's centre must see all of it
    found = V[corners_of(V, F, length), :2]
    assert sorted(map(tuple, found.tolist())) == sorted(
        map(tuple, np.array(points, float).tolist())
    )


def test_a_grid_keeps_its_corners_whatever_the_length():
    V, F = zoo.grid()
    for length in (0.1, 1.0, 2.0, 3.0):
        found = V[corners_of(V, F, length), :2]
        assert sorted(map(tuple, found.tolist())) == [(0, 0), (0, 4), (6, 0), (6, 4)]


def test_noise_far_below_the_length_is_no_corner():
    rng = np.random.default_rng(2)
    V, F = disc(400)
    V[:-1, :2] *= 1 + 0.004 * rng.random((400, 1))
    assert len(corners_of(V, F, 0.3)) == 0


def test_corners_of_several_loops():
    V, F = zoo.joined(zoo.grid(), disc(40), shift=20.0)
    assert len(corners_of(V, F, 0.8)) == 4


def test_corners_do_not_depend_on_scale_or_place():
    V, F = polygon([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], 0.1)
    V[-1, :2] = 0.7
    expected = set(corners_of(V, F, 0.3).tolist())
    assert set(corners_of(8 * V, F, 2.4).tolist()) == expected
    assert set(corners_of(zoo.rotate(V) + 5, F, 0.3).tolist()) == expected


# --- apexes --------------------------------------------------------------------------------------


def test_apexes_are_tips():
    V, F = zoo.bipyramid(24, top=4.0, bottom=-0.2)
    assert apexes(built(V, F), 0.5).tolist() == [24]
    assert len(apexes(built(*zoo.icosphere()), 0.1)) == 0
    assert len(apexes(built(*zoo.cube()), 0.1)) == 0  # a defect of 90 degrees


def test_apexes_keep_apart():
    V, F = zoo.tetrahedron()  # four defects of 180 degrees, edges of 2.83
    assert sorted(apexes(built(V, F), 2.0).tolist()) == [0, 1, 2, 3]
    assert apexes(built(V, F), 3.0).tolist() == [0]


def test_boundary_corners_are_no_apexes():
    assert len(apexes(built(*zoo.grid()), 0.1)) == 0


# --- closest point -------------------------------------------------------------------------------


@kernel
def query(X, origin, links, start, P, found, parameter, squared):
    for i in range(len(P)):
        h, s, d = closest_on_boundary(X, origin, links, start[i], P[i, 0], P[i, 1], P[i, 2])
        found[i], parameter[i], squared[i] = h, s, d


def closest(mesh, start, P):
    found, s, squared = np.empty(len(P), int), np.empty(len(P)), np.empty(len(P))
    query(
        mesh.X, mesh.origin, link_boundary(mesh), np.asarray(start, np.int64), P, found, s, squared
    )
    a = mesh.X[mesh.origin[found], :3]
    b = mesh.X[mesh.origin[np.where(found % 3 == 2, found - 2, found + 1)], :3]
    return a + s[:, None] * (b - a), np.sqrt(squared)


def test_closest_near_the_start_is_the_closest_of_all():
    mesh = built(*disc(60))
    open_ones = np.flatnonzero(mesh.twin == NONE)
    rng = np.random.default_rng(0)
    turns = rng.random(200) * 2 * np.pi
    P = np.stack([1.1 * np.cos(turns), 1.1 * np.sin(turns), 0.1 * rng.random(200)], axis=1)
    at = mesh.X[mesh.origin[open_ones], :3]
    nearest = np.linalg.norm(P[:, None] - at, axis=2).argmin(axis=1)
    start = open_ones[(nearest + 3) % len(open_ones)]
    points, distance = closest(mesh, start, P)
    assert np.linalg.norm(points - P, axis=1) == pytest.approx(distance)
    samples = sample_loop(mesh, open_ones)
    best = np.linalg.norm(P[:, None] - samples, axis=2).min(axis=1)
    assert (distance <= best + 1e-12).all()


def sample_loop(mesh, open_ones):
    a = mesh.X[mesh.origin[open_ones], :3]
    b = mesh.X[mesh.origin[np.where(open_ones % 3 == 2, open_ones - 2, open_ones + 1)], :3]
    return (a[:, None] + np.linspace(0, 1, 21)[:, None] * (b - a)[:, None]).reshape(-1, 3)


def test_a_vertex_stays_on_its_own_stretch():
    """A narrow slot: the other side is nearer, but far along the loop."""
    points = [[0, 0], [4, 0], [4, 3], [2.1, 3], [2.1, 1], [1.9, 1], [1.9, 3], [0, 3]]
    V, F = polygon(points, 0.1)
    mesh = built(V, F)
    open_ones = np.flatnonzero(mesh.twin == NONE)
    at = mesh.X[mesh.origin[open_ones], :2]
    start = open_ones[np.abs(at - [2.1, 2.5]).sum(axis=1).argmin()]
    P = np.array([[1.97, 2.5, 0.0]])  # past the middle: 0.07 to the other side, 0.13 to its own
    points, distance = closest(mesh, [start], P)
    assert points[0] == pytest.approx([2.1, 2.5, 0]) and distance[0] == pytest.approx(0.13)


def test_points_on_the_loop_are_found_exactly():
    mesh = built(*zoo.annulus())
    open_ones = np.flatnonzero(mesh.twin == NONE)
    P = mesh.X[mesh.origin[open_ones], :3].copy()
    points, distance = closest(mesh, open_ones, P)
    assert np.array_equal(points, P) and not distance.any()
