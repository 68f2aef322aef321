"""Feature curves as linked half-edges, and their corners."""

from itertools import pairwise

import numpy as np
import pytest
from helpers import zoo
from helpers.structure import built, links_of, mean_edge_of, next_of

from data.shapes import cad_parts
from remeshvec.core.vocabulary import NONE
from remeshvec.features.corners import find_corners
from remeshvec.features.creases import find_creases
from remeshvec.features.curves import link_chains


def corners_of(V, F, length, angle=None, hard=(), creases=None):
    """Corners of the boundary, of edges named by their vertices, and of creases if asked for."""
    mesh = built(V, F, length=length)
    end = mesh.origin[[next_of(h) for h in range(mesh.origin.size)]]
    edges = {tuple(sorted(edge)) for edge in hard}
    pairs = np.sort([mesh.origin, end], axis=0).T.tolist()
    is_hard = np.array([tuple(pair) in edges for pair in pairs])
    assert 2 * len(edges) == is_hard.sum() + (is_hard & (mesh.twin == NONE)).sum(), "no such edge"
    arrays = mesh.origin, mesh.twin, mesh.vertex_halfedge
    is_feature, _ = find_creases(mesh.X, *arrays, is_hard, creases, mean_edge_of(mesh))
    curves = link_chains(mesh.origin, mesh.twin, is_feature, len(mesh.X))
    found = find_corners(mesh.X, mesh.origin, mesh.twin, curves, angle)
    assert found.shape == (len(mesh.X),) and found.dtype == np.bool_
    return np.flatnonzero(found)


def places(V, found):
    return sorted(map(tuple, np.round(V[found, :2], 12).tolist()))


def line_in_grid(points):
    """Sheet of unit squares, and the edges of a polyline over its vertices, wherever its faces cut."""
    V, F = zoo.arrays(zoo.grid(13, 13)[0], zoo.wrapped_grid(13, 13, False, False))
    index = {tuple(p): i for i, p in enumerate(V[:, :2].astype(int).tolist())}
    path = [tuple(points[0])]
    for goal in points[1:]:
        while path[-1] != tuple(goal):
            path.append(tuple(p + np.sign(q - p) for p, q in zip(path[-1], goal, strict=True)))
    return V, F, [(index[a], index[b]) for a, b in pairwise(path)]


# --- links ---------------------------------------------------------------------------------------


def naive_links(mesh, is_feature):
    """By lists of the feature edges at every vertex."""
    end = [int(mesh.origin[next_of(h)]) for h in range(mesh.origin.size)]
    at = [set() for _ in mesh.X]
    for h in np.flatnonzero(is_feature):
        edge = frozenset((int(mesh.origin[h]), end[h]))
        for v in edge:
            at[v].add(edge)
    links = np.full((2, mesh.origin.size), NONE)
    for h in np.flatnonzero(is_feature):
        for g in np.flatnonzero(is_feature):
            same = {int(mesh.origin[h]), end[h]} == {int(mesh.origin[g]), end[g]}
            if mesh.origin[g] == end[h] and not same and len(at[end[h]]) == 2:
                links[0, h], links[1, g] = g, h
    return links, [len(edges) for edges in at]


def marked(mesh, rng, share, with_boundary):
    """Random edges, on both of their half-edges."""
    is_feature = rng.random(mesh.origin.size) < share
    inside = np.flatnonzero(mesh.twin != NONE)
    is_feature[inside] |= is_feature[mesh.twin[inside]]
    if with_boundary:
        is_feature |= mesh.twin == NONE
    return is_feature


@pytest.mark.parametrize("with_boundary", [True, False])
@pytest.mark.parametrize("name", ["triangle", "square", "grid", "annulus", "torus", "sliver_fan"])
def test_links_are_those_of_the_naive_twin(name, with_boundary):
    mesh = built(*zoo.ZOO[name].make())
    rng = np.random.default_rng(len(name))
    for share in (0.0, 0.05, 0.2, 0.5, 1.0):
        is_feature = marked(mesh, rng, share, with_boundary)
        expected, count = naive_links(mesh, is_feature)
        curves = link_chains(mesh.origin, mesh.twin, is_feature, len(mesh.X))
        assert all(array.dtype == np.int32 for array in curves)
        assert np.array_equal(curves.edges, np.flatnonzero(is_feature))
        assert np.array_equal(links_of(mesh, is_feature), expected)
        assert curves.degree.tolist() == count


def test_links_of_a_closed_crease_run_both_ways():
    mesh = built(*zoo.cone(12), length=1.0)
    arrays = mesh.origin, mesh.twin, mesh.vertex_halfedge
    is_hard = np.zeros(mesh.origin.size, bool)
    is_feature, _ = find_creases(mesh.X, *arrays, is_hard, "auto", mean_edge_of(mesh))
    links = links_of(mesh, is_feature)
    rim = np.flatnonzero(is_feature)
    assert len(rim) == 24
    assert np.array_equal(links[1, links[0, rim]], rim)
    assert np.array_equal(links[0, mesh.twin[rim]], mesh.twin[links[1, rim]])
    for first in (rim[0], mesh.twin[rim[0]]):
        loop, h = [first], links[0, first]
        while h != first:
            loop.append(h)
            h = links[0, h]
        assert len(loop) == 12


# --- corners of loops ----------------------------------------------------------------------------


@pytest.mark.parametrize("length", [0.05, 0.2, 0.7, 3.0, 50.0])
@pytest.mark.parametrize("n", [12, 40, 300])
def test_a_circle_has_no_corners(n, length):
    if length < 2 * np.pi / n:
        pytest.skip("edges longer than the scale: it is a polygon there")
    assert len(corners_of(*zoo.disc(n), length)) == 0


@pytest.mark.parametrize("length", [0.3, 1.9, 2.5])
def test_arcs_that_go_on_turning_are_no_corners(length):
    """Half-circles of radius 1 at the ends of a long strip: over L / 2 they turn by up to 72 degrees."""
    t = np.linspace(-np.pi / 2, np.pi / 2, 41)
    end = np.stack([10 + np.cos(t), np.sin(t)], axis=1)
    side = np.stack([np.linspace(-9.9, 9.9, 200), np.full(200, -1.0)], axis=1)
    assert len(corners_of(*zoo.fan_inside(np.vstack([side, end, -side, -end])), length)) == 0


@pytest.mark.parametrize("length", [0.05, 0.3, 1.0, 2.0, 10.0])
@pytest.mark.parametrize("spacing", [0.04, 0.5, 9.0])
def test_a_rectangle_has_four(spacing, length):
    points = [[0, 0], [3, 0], [3, 2], [0, 2]]
    V, F = zoo.polygon(points, spacing)
    assert places(V, corners_of(V, F, length)) == sorted(map(tuple, points))


@pytest.mark.parametrize("length", [0.05, 0.3, 0.6])
def test_an_l_has_six(length):
    """Convex and concave corners alike."""
    V, F = zoo.polygon(cad_parts.L_SHAPE, 0.1)
    assert places(V, corners_of(V, F, length)) == sorted(map(tuple, cad_parts.L_SHAPE.tolist()))


def test_a_grid_keeps_its_corners_whatever_the_length():
    V, F = zoo.grid()
    for length in (0.1, 1.0, 2.0, 3.0):
        assert places(V, corners_of(V, F, length)) == [(0, 0), (0, 4), (6, 0), (6, 4)]


def test_noise_far_below_the_length_is_no_corner():
    rng = np.random.default_rng(2)
    V, F = zoo.disc(400)
    V[:-1, :2] *= 1 + 0.004 * rng.random((400, 1))
    assert len(corners_of(V, F, 0.3)) == 0


def test_corners_of_several_loops():
    V, F = zoo.joined(zoo.grid(), zoo.disc(40), shift=20.0)
    assert len(corners_of(V, F, 0.8)) == 4


def test_corners_do_not_depend_on_scale_or_place():
    V, F = zoo.polygon(cad_parts.L_SHAPE, 0.1)
    expected = corners_of(V, F, 0.3).tolist()
    assert corners_of(8 * V, F, 2.4).tolist() == expected
    assert corners_of(zoo.rotate(V) + 5, F, 0.3).tolist() == expected


def test_of_close_corners_the_larger_stays():
    """A notch of 0.1 in a side of 2: at a length of 1 one of its four corners, at 0.1 all."""
    notch = [[0, 0], [2, 0], [2, 1], [1.1, 1], [1.1, 0.9], [1, 0.9], [1, 1], [0, 1]]
    V, F = zoo.polygon(notch, 0.02)
    assert len(corners_of(V, F, 0.1)) == 8
    found = places(V, corners_of(V, F, 1.0))
    assert {(0, 0), (2, 0), (2, 1), (0, 1)} <= set(found) and len(found) < 8


def test_strips_of_any_width_keep_their_ends():
    """Both corners while the strip is wider than L / 2; a single tip where it is narrower."""
    V, F = zoo.polygon([[0, 0], [10, 0], [10, 1], [0, 1]], 0.05)
    for length in np.arange(0.35, 6.0, 0.1):
        found = V[corners_of(V, F, length), 0]
        assert sorted(found) == ([0, 0, 10, 10] if length <= 2 else [0, 10])


@pytest.mark.parametrize("seed", range(4))
def test_equal_corners(seed):
    """One reach apart, an eighth of the loop, they all stay; nearer, the smaller index of a pair."""
    rotation = np.random.default_rng(seed).random(3)
    V, F = zoo.polygon([[0, 0], [3, 0], [3, 1], [0, 1]], 1.0)
    assert len(corners_of(zoo.rotate(V, rotation), F, 100.0)) == 4
    V, F = zoo.polygon([[0, 0], [4, 0], [4, 1], [0, 1]], 1.0)
    assert corners_of(zoo.rotate(V, rotation), F, 100.0).tolist() == [0, 4]


@pytest.mark.parametrize("angle", [30.0, 50.0, 70.0])
def test_a_number_is_the_smallest_turn(angle):
    """A hexagon turns by 60 degrees, a square by 90."""
    assert len(corners_of(*zoo.polygon(cad_parts.regular(6), 0.1), 0.3, angle)) == (
        6 if angle < 60 else 0
    )
    assert len(corners_of(*zoo.polygon(cad_parts.regular(4), 0.1), 0.3, angle)) == 4


# --- corners of open curves ----------------------------------------------------------------------


@pytest.mark.parametrize("length", [0.1, 1.0, 3.0, 100.0])
def test_ends_and_sharp_turns_of_open_curves(length):
    """Also of a curve shorter than the length."""
    bend = [(3, 3), (6, 3), (6, 6)]
    V, F, line = line_in_grid(bend)
    rim = [(0, 0), (0, 12), (12, 0), (12, 12)]
    assert places(V, corners_of(V, F, length, hard=line)) == sorted(rim + bend)


@pytest.mark.parametrize("length", [0.1, 1.0, 100.0])
def test_a_sharp_turn_next_to_an_end(length):
    """One edge before the end, and a curve from boundary to boundary."""
    V, F, line = line_in_grid([(2, 5), (2, 6), (8, 6)])
    assert (2, 6) in places(V, corners_of(V, F, length, hard=line))
    V, F, line = line_in_grid([(0, 5), (6, 5), (6, 12)])
    found = places(V, corners_of(V, F, length, hard=line))
    assert found == sorted([(0, 0), (0, 12), (12, 0), (12, 12), (0, 5), (6, 5), (6, 12)])


def test_junctions_are_corners():
    V, F, line = line_in_grid([(2, 2), (9, 2)])
    line += line_in_grid([(5, 2), (5, 8)])[2]
    found = places(V, corners_of(V, F, 1.0, hard=line))
    assert {(2, 2), (9, 2), (5, 2), (5, 8)} <= set(found) and len(found) == 8


@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
@pytest.mark.parametrize("length", [0.1, 0.5, 1.9, 2.5, 100.0])
def test_open_arcs_have_ends_only(share, length):
    """A part of the circle of radius 1 inside a disc of radius 2."""
    n = 64
    circle = cad_parts.regular(n)
    V = np.vstack([2 * circle, circle, [[0, 0]]])
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    rings = [np.stack([i, j, j + n], axis=1), np.stack([i, j + n, i + n], axis=1)]
    F = np.vstack([*rings, zoo.fan(i + n, 2 * n)])
    last = round(share * n)
    line = [(n + k, n + k + 1) for k in range(last)]
    V = np.column_stack([V, np.zeros(len(V))])
    assert corners_of(V, F, length, hard=line).tolist() == [n, n + last]


@pytest.mark.parametrize("length", [0.05, 0.3, 1.0, 5.0])
def test_creases_of_solids(length):
    assert len(corners_of(*zoo.cube(), length, creases="auto")) == 8
    assert len(corners_of(*zoo.l_prism(), length, creases="auto")) == 12
    assert len(corners_of(*cad_parts.plate(32), length, creases="auto")) == 8
    assert len(corners_of(*zoo.closed_cylinder(24, 9), length, creases="auto")) == 0
    assert len(corners_of(*cad_parts.hemisphere(), length, creases="auto")) == 0


def test_a_label_border_is_the_same_from_both_sides():
    """A square of hard edges inside a sheet: four corners in every orientation of the faces."""
    V, F, line = line_in_grid([(3, 3), (8, 3), (8, 8), (3, 8), (3, 3)])
    expected = corners_of(V, F, 2.0, hard=line).tolist()
    assert len(expected) == 8
    for seed in range(4):
        order = np.random.default_rng(seed).permutation(len(F))
        G = np.roll(F[order], seed, axis=1)
        assert corners_of(V, G, 2.0, hard=line).tolist() == expected
        assert corners_of(V, G[:, ::-1], 2.0, hard=line).tolist() == expected
        assert corners_of(cad_parts.turned(V), G, 2.0, hard=line).tolist() == expected


def test_local_lengths_decide():
    """The same zigzag of half units: corners where the length is fine, none where it is coarse."""
    x = np.arange(0, 40.1, 0.5)
    top = np.stack([x[::-1], 8 + 0.25 * (np.arange(len(x)) % 2)], axis=1)
    V, F = zoo.fan_inside(np.vstack([[[0.0, 0.0], [40.0, 0.0]], top]))
    length = np.where(V[:, 0] < 20, 0.1, 6.0)
    found = corners_of(V, F, length, 40.0)
    zigzag = found[V[found, 1] > 7.9]
    assert (V[zigzag, 0] < 20).sum() > 30
    assert ((V[zigzag, 0] > 22) & (V[zigzag, 0] < 39)).sum() == 0


def test_surfaces_without_features_or_area():
    assert len(corners_of(*zoo.torus(), 0.5)) == 0
    V, F = zoo.grid()
    corners_of(0 * V, F, 1.0)
    assert len(corners_of(V * [1, 0, 0], F, 1.0)) >= 2


# --- zigzags ---------------------------------------------------------------------------------------


def stairs(steps, run=1):
    """Points of a line that goes right and up in turns, over a sheet of unit squares."""
    points = [(2, 2)]
    for k in range(steps):
        x, y = points[-1]
        points.append((x + run, y) if k % 2 == 0 else (x, y + 1))
    return points


@pytest.mark.parametrize("run", [1, 2])
def test_zigzags_finer_than_the_length_have_no_corners(run):
    """Steps of one: all of them are corners at a length of 0.5, none at 1.6 and more."""
    points = stairs(7, run)
    V, F, line = line_in_grid(points)
    rim = {(0, 0), (0, 12), (12, 0), (12, 12)}
    for length, expected in ((0.5, 6), (1.6, 0), (2.0, 0), (3.0, 0)):
        found = set(places(V, corners_of(V, F, length, hard=line))) - rim
        assert {points[0], points[-1]} <= found
        assert len(found) == 2 + expected


def test_real_corners_stay_between_zigzags():
    """A diamond of steps keeps its four corners, or at least no others."""
    up, down = [(1, 0), (0, 1)], [(1, 0), (0, -1)]
    point, points = np.array([1, 6]), [(1, 6)]
    for steps in (up * 5, down * 5, [(-x, y) for x, y in down] * 5, [(-x, y) for x, y in up] * 5):
        for step in steps:
            point = point + step
            points.append(tuple(point.tolist()))
    V, F, line = line_in_grid(points)
    found = V[corners_of(V, F, 1.6, hard=line), :2]
    inner = found[((found > 0) & (found < 12)).all(axis=1)]
    tips = np.array([[1, 6], [6, 11], [11, 6], [6, 1]])
    away = np.linalg.norm(inner[:, None] - tips, axis=2)
    assert len(inner) == 4 and (away.min(axis=0) < 1.5).all()


def test_wide_teeth_keep_their_corners():
    """Crenels as wide as the length are no zigzag."""
    points = [(1, 2)]
    for _ in range(5):
        x, y = points[-1]
        points += [(x, y + 1), (x + 1, y + 1), (x + 1, y), (x + 2, y)]
    V, F, line = line_in_grid(points)
    found = set(places(V, corners_of(V, F, 1.0, hard=line)))
    assert set(points[1:-1]) <= found
