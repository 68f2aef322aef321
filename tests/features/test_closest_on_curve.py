"""The closest point on a curve of the reference: only near the start, and never past a corner."""

from collections import defaultdict

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import built, ends, featured, next_of

from remeshvec.core.compiler import kernel
from remeshvec.core.geometry import point
from remeshvec.core.vocabulary import FIXED, NONE
from remeshvec.features.curves import link_chains
from remeshvec.features.polyline import Polylines, closest_on_curve, join_edges


@kernel
def query(polylines, start, P, found, parameter, squared):
    for i in range(len(P)):
        h, s, d = closest_on_curve(polylines, start[i], point(P, i))
        found[i], parameter[i], squared[i] = h, s, d


def closest(mesh, beside, start, P):
    """Edges, points and distances."""
    found, s, squared = np.empty(len(P), int), np.empty(len(P)), np.empty(len(P))
    polylines = Polylines(mesh.X, mesh.origin, *beside, np.empty((3, 0)))
    query(polylines, np.asarray(start, np.int64), P, found, s, squared)
    assert s.min() >= 0 and s.max() <= 1
    a = mesh.X[mesh.origin[found], :3]
    b = mesh.X[mesh.origin[[next_of(h) for h in found.tolist()]], :3]
    points = a + s[:, None] * (b - a)
    assert np.linalg.norm(points - P, axis=1) == pytest.approx(np.sqrt(squared), abs=1e-15)
    return found, points, np.sqrt(squared)


def curves(V, F, length=1.0, **wanted):
    """Mesh, who follows whom on its curves, and the names of their edges."""
    mesh = built(V, F)
    reference = featured(mesh, length, **wanted).reference
    beside = reference.curve_row, reference.curve_neighbours
    return mesh, beside, np.unique(mesh.curve[mesh.curve >= 0])


def distance_within_reach(mesh, names, start, p):
    """Distance to all edges of a polyline that begin within three times the distance to the first."""

    def foot(h):
        return np.linalg.norm(p - naive.closest_on_segment(p, *mesh.X[list(ends(mesh, h)), :3]))

    reach, best = 3 * foot(start), foot(start)
    at = defaultdict(set)
    for h in names.tolist():
        for v in ends(mesh, h):
            at[v].add(h)
    for v in ends(mesh, start):
        before, walked = start, 0.0
        while mesh.kind[v] != FIXED and walked <= reach:
            (h,) = at[v] - {before}
            if h == start:
                break
            best = min(best, foot(h))
            (v,) = set(ends(mesh, h)) - {v}
            before, walked = h, walked + naive.edge_length(mesh.X[:, :3], ends(mesh, h))
    return best


@pytest.mark.parametrize("scale", [0.01, 0.3, 2.0])
@pytest.mark.parametrize("name", ["annulus", "sliver_fan", "cylinder", "l_prism", "genus_2"])
def test_the_closest_of_all_edges_within_reach(name, scale):
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), n=1, noise=0.0)
    mesh, beside, names = curves(V, F, zoo.mean_edge(V, F), feature_angle=40.0)
    rng = np.random.default_rng(7)
    start = rng.choice(names, 150)
    P = mesh.X[mesh.origin[start], :3] + scale * rng.normal(size=(150, 3))
    _, _, distance = closest(mesh, beside, start, P)
    expected = [distance_within_reach(mesh, names, h, p) for h, p in zip(start, P, strict=True)]
    assert distance == pytest.approx(expected, rel=1e-12, abs=1e-14)


def test_closest_near_the_start_is_the_closest_of_all():
    mesh, beside, names = curves(*zoo.disc(60))
    rng = np.random.default_rng(0)
    turns = rng.random(200) * 2 * np.pi
    P = np.stack([1.1 * np.cos(turns), 1.1 * np.sin(turns), 0.1 * rng.random(200)], axis=1)
    at = mesh.X[mesh.origin[names], :3]
    nearest = np.linalg.norm(P[:, None] - at, axis=2).argmin(axis=1)
    start = names[(nearest + 3) % len(names)]
    _, _, distance = closest(mesh, beside, start, P)
    segments = mesh.X[:, :3][np.array([ends(mesh, h) for h in names])]
    best = [min(np.linalg.norm(p - naive.closest_on_segment(p, *s)) for s in segments) for p in P]
    assert distance == pytest.approx(best, rel=1e-12)


def test_a_vertex_stays_on_its_own_stretch():
    """A narrow slot: the other side is nearer, but far along the loop."""
    points = [[0, 0], [4, 0], [4, 3], [2.1, 3], [2.1, 1], [1.9, 1], [1.9, 3], [0, 3]]
    mesh, _, names = curves(*zoo.polygon(points, 0.1), 0.2)
    rim = link_chains(mesh.origin, mesh.twin, mesh.twin == NONE, len(mesh.X))
    beside = join_edges(mesh.curve, rim, mesh.origin, np.zeros(len(mesh.X), bool))
    at = mesh.X[mesh.origin[names], :2]
    start = names[np.abs(at - [2.1, 2.5]).sum(axis=1).argmin()]
    P = np.array([[1.97, 2.5, 0.0]])  # past the middle: 0.07 to the other side, 0.13 to its own
    _, points, distance = closest(mesh, beside, [start], P)
    assert points[0] == pytest.approx([2.1, 2.5, 0]) and distance[0] == pytest.approx(0.13)


def test_no_search_goes_past_a_corner():
    """Around the corner it would be closer; there lies another curve."""
    mesh, beside, names = curves(*zoo.polygon([[0, 0], [3, 0], [3, 2], [0, 2]], 0.1), 0.3)
    middle = np.array([mesh.X[list(ends(mesh, h)), :2].mean(axis=0) for h in names])
    start = names[np.abs(middle - [2.85, 0.0]).sum(axis=1).argmin()]
    P = np.array([[3.0, 0.5, 0.0]])
    _, points, distance = closest(mesh, beside, [start], P)
    assert points[0] == pytest.approx([3, 0, 0]) and distance[0] == pytest.approx(0.5)


def test_points_on_the_curve_are_found_exactly():
    mesh, beside, names = curves(*zoo.annulus())
    P = mesh.X[mesh.origin[names], :3].copy()
    _, points, distance = closest(mesh, beside, names, P)
    assert np.array_equal(points, P) and not distance.any()


@pytest.mark.parametrize("n", [1, 2, 3])
def test_the_smallest_loops_end(n):
    """Around a loop of few edges, whose neighbours on both sides are the same."""
    t = zoo.turn(max(n, 2))
    V = np.vstack([np.column_stack([np.cos(t), np.sin(t), 0 * t]), [[0, 0, 1], [0, 0, -1]]])
    mesh = built(V, [[0, 1, len(t)], [1, 0, len(t) + 1]] if n < 3 else [[0, 1, 2]])
    edges = np.flatnonzero(np.isin(mesh.origin, range(n)))[:n] if n < 3 else np.arange(3)
    beside = np.full((2, mesh.origin.size), NONE, np.int32)
    beside[0, edges], beside[1, edges] = np.roll(edges, 1), np.roll(edges, -1)
    P = np.random.default_rng(0).normal(scale=10, size=(20, 3))
    for start in edges:
        row = np.arange(mesh.origin.size, dtype=np.int32)
        found, _, distance = closest(mesh, (row, beside), np.full(20, start), P)
        assert np.isin(found, edges).all() and np.isfinite(distance).all()


def test_without_curves_the_edge_itself_is_searched():
    mesh = built(*zoo.tetrahedron())
    P = np.random.default_rng(0).normal(size=(10, 3))
    none = np.empty(0, np.int32), np.empty((2, 0), np.int32)
    found, points, _ = closest(mesh, none, np.full(10, 4), P)
    assert (found == 4).all()
    expected = [naive.closest_on_segment(p, *mesh.X[list(ends(mesh, 4)), :3]) for p in P]
    assert points == pytest.approx(np.array(expected))
