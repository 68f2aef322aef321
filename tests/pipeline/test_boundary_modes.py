"""What happens to the boundary: "free" resamples it, "split" only adds to it, "fixed" leaves it."""

import numpy as np
import pytest
from helpers import zoo
from helpers.complexes import curves_of, shape
from helpers.invariants import assert_clean, assert_corners
from helpers.measures import (
    ON,
    along,
    bits,
    boundary_edges,
    diagonal,
    edge_lengths,
    edge_places,
    lengths_of,
    nearest,
    sag,
    sorted_edges,
    to_segments,
    to_surface,
    unit_normals,
)

from data.shapes.solids import regular
from remeshvec import remesh

MODES = ("free", "split", "fixed")
SIDES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]], float)
SQUARE = np.stack([SIDES[:-1], SIDES[1:]], axis=1)

# Open meshes of all kinds: many and few boundary vertices, several loops, corners, round rims.
OPEN = {
    "square": zoo.square,
    "delaunay": lambda: zoo.planar_delaunay(150),
    "grid": lambda: zoo.grid(13, 9),
    "annulus": lambda: zoo.annulus(40, 6),
    "tube": lambda: zoo.cylinder(36, 9),
    "triangle": zoo.triangle,
    "strip": lambda: zoo.grid(30, 2),
    "bent": lambda: bent(*zoo.grid(13, 9)),
}


def bent(V, F):
    """A sheet rolled by a third of a turn, its rim no plane curve."""
    t = V[:, 0] / 6
    return np.stack([6 * np.sin(t), V[:, 1] + 0.3 * np.sin(V[:, 0]), 6 * np.cos(t)], axis=1), F


def segments_of(V, F):
    return V[boundary_edges(F)]


def same_on_boundary(one, two):
    """The same boundary edges, as pairs of places to the last bit."""
    (V1, F1), (V2, F2) = one, two
    return edge_places(V1, boundary_edges(F1)) == edge_places(V2, boundary_edges(F2))


# --- a square of two triangles -------------------------------------------------------------------


@pytest.mark.parametrize("L", [0.05, 0.11, 0.3])
@pytest.mark.parametrize("mode", ["free", "split"])
def test_two_triangles_become_a_square(mode, L):
    V, F = zoo.square()
    result = remesh(V, F, L, boundary=mode)
    V2, F2 = result
    assert_clean(V2, F2)
    assert shape(F2) == shape(F)
    assert_corners(V2, V, 1)
    assert zoo.area(V2, F2) == pytest.approx(1, rel=1e-12)
    assert (V2[:, 2] == 0).all() and (unit_normals(V2, F2)[:, 2] > 0.5).all()
    rim = boundary_edges(F2)
    assert to_segments(V2[rim.ravel()], SQUARE).max() < ON
    # Sides of 1 take whole numbers of edges: 0.3 gives thirds or quarters.
    assert edge_lengths(V2, F2).mean() == pytest.approx(L, rel=0.15)
    assert lengths_of(V2, rim).mean() == pytest.approx(L, rel=0.3)
    assert lengths_of(V2, rim).max() < 1.5 * L and lengths_of(V2, rim).min() > 0.4 * L
    assert np.array_equal(sorted_edges(result.feature_edges), sorted_edges(rim))


def test_two_triangles_with_a_fixed_rim():
    """Four boundary edges far too long stay; inside, edges are as short as these allow."""
    V, F = zoo.square()
    result = remesh(V, F, 0.1, boundary="fixed")
    assert same_on_boundary(result, (V, F))
    assert shape(result.F) == shape(F)
    assert zoo.area(*result) == pytest.approx(1, rel=1e-12)
    assert (unit_normals(*result)[:, 2] > 0.5).all()


# --- each mode on all open meshes ----------------------------------------------------------------


def remeshed(name, factor, boundary):
    """Remesh an open mesh; its topology must stay. Returns V, F, the length and the result."""
    V, F = OPEN[name]()
    L = factor * zoo.mean_edge(V, F)
    result = remesh(V, F, L, boundary=boundary)
    assert_clean(*result)
    assert shape(result.F) == shape(F)
    return V, F, L, result


@pytest.mark.parametrize("factor", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("name", OPEN)
def test_free_slides_along_the_boundary(name, factor):
    V, F, L, result = remeshed(name, factor, "free")
    size = diagonal(V)
    rim = result.V[np.unique(boundary_edges(result.F))]
    assert to_segments(rim, segments_of(V, F)).max() < ON * size
    assert to_surface(result.V, V, F).max() < ON * size
    assert same_on_boundary(result, remesh(V, F, L)), "it is the default"


@pytest.mark.parametrize("factor", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("name", OPEN)
def test_split_keeps_every_boundary_vertex(name, factor):
    V, F, L, result = remeshed(name, factor, "split")
    given, edges = np.unique(boundary_edges(F)), boundary_edges(result.F)
    found = np.unique(edges)
    assert set(bits(V[given])) <= set(bits(result.V[found]))
    assert (result.vertex_map[given] >= 0).all()
    assert bits(result.V[result.vertex_map[given]]) == bits(V[given])
    assert set(result.vertex_map[given].tolist()) <= set(found.tolist())
    # The other boundary vertices lie on the input's boundary edges, and every edge on one of them.
    assert to_segments(along(result.V[edges]), segments_of(V, F)).max() < ON * diagonal(V)
    assert len(edges) >= len(boundary_edges(F))
    assert lengths_of(result.V, edges).max() < 1.5 * L
    longest = lengths_of(V, boundary_edges(F)).max()
    if longest < L:
        assert same_on_boundary(result, (V, F)), "no edge had to be split"
    if longest > 2 * L:
        assert len(edges) > len(boundary_edges(F))


@pytest.mark.parametrize("factor", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("name", OPEN)
def test_fixed_leaves_the_boundary(name, factor):
    V, F, _, result = remeshed(name, factor, "fixed")
    assert same_on_boundary(result, (V, F))
    given = np.unique(boundary_edges(F))
    assert bits(result.V[result.vertex_map[given]]) == bits(V[given])
    assert to_surface(result.V, V, F).max() < ON * diagonal(V)


@pytest.mark.parametrize("preset", ["fast", "fine"])
@pytest.mark.parametrize("mode", ["split", "fixed"])
def test_presets_hold_the_boundary(mode, preset):
    V, F = OPEN["bent"]()
    result = remesh(V, F, 0.6, boundary=mode, preset=preset)
    given = np.unique(boundary_edges(F))
    assert set(bits(V[given])) <= set(bits(result.V))
    assert bits(result.V[result.vertex_map[given]]) == bits(V[given])
    assert same_on_boundary(result, (V, F)) or mode == "split"


@pytest.mark.parametrize("move", [(1.0, 1e6 + 0.1), (1 / 3, 0.0), (1e-6 / 7, 0.7)])
@pytest.mark.parametrize("mode", ["split", "fixed"])
def test_held_boundaries_are_exact_in_any_unit(mode, move):
    V, F = zoo.planar_delaunay(150)
    W = V * move[0] + move[1]
    L = 0.07 * np.ptp(W[:, 0])
    result = remesh(W, F, L, boundary=mode)
    given = np.unique(boundary_edges(F))
    assert bits(result.V[result.vertex_map[given]]) == bits(W[given])
    if mode == "fixed":
        assert same_on_boundary(result, (W, F))


# --- round rims ----------------------------------------------------------------------------------


@pytest.mark.parametrize("L", [0.08, 0.16, 0.3])
def test_a_disc_keeps_its_area(L):
    """Chords of length l take off l^2 pi / 6 of a unit disc; edges are shorter than 1.3 L on average."""
    V, F = disc(120)
    result = remesh(V, F, L, boundary="free")
    assert shape(result.F) == shape(F)
    lost = zoo.area(V, F) - zoo.area(*result)
    assert -1e-9 < lost < np.pi / 6 * (1.3 * L) ** 2
    rim = lengths_of(result.V, boundary_edges(result.F))
    assert rim.mean() == pytest.approx(L, rel=0.2)
    assert rim.max() < 1.6 * L
    middles = result.V[boundary_edges(result.F)].mean(axis=1)
    assert np.linalg.norm(middles, axis=1).min() > 1 - sag(1.6 * L, 1.0)


def disc(n):
    from data.shapes.solids import region

    P, F = region([regular(n)], 0.1)
    return np.column_stack([P, np.zeros(len(P))]), F


@pytest.mark.parametrize("L", [0.1, 0.25])
def test_an_annulus_keeps_both_circles(L):
    V, F = zoo.annulus(120, 12)
    result = remesh(V, F, L, boundary="free")
    assert shape(result.F) == shape(F)
    edges = boundary_edges(result.F)
    middles = np.linalg.norm(result.V[edges].mean(axis=1), axis=1)
    inner = middles < 1.5
    for radius, which in ((1.0, inner), (2.0, ~inner)):
        assert curves_of(edges[which]).curves == [(1,)]
        assert middles[which].min() > radius - sag(1.6 * L, radius)
        assert middles[which].max() < radius + 1e-12
    # The outer circle loses what the inner one gains, but for the number of edges.
    assert zoo.area(*result) == pytest.approx(zoo.area(V, F), abs=np.pi / 6 * (1.3 * L) ** 2)
    assert len(result.corners) == 0


# --- with a length that varies -------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
def test_boundary_modes_with_varying_lengths(mode):
    """Fine at the left, coarse at the right: boundary edges follow where they may."""
    V, F = zoo.grid(41, 21)
    V = V / 20
    L = 0.04 + 0.08 * V[:, 0]
    result = remesh(V, F, L, boundary=mode)
    assert_clean(*result)
    assert shape(result.F) == shape(F)
    assert zoo.area(*result) == pytest.approx(2, rel=1e-9)
    assert_corners(result.V, [[0, 0, 0], [2, 0, 0], [0, 1, 0], [2, 1, 0]], 2)
    edges = boundary_edges(result.F)
    if mode == "fixed":
        assert same_on_boundary(result, (V, F))
    if mode == "split":
        given = np.unique(boundary_edges(F))
        assert bits(result.V[result.vertex_map[given]]) == bits(V[given])
    if mode == "free":
        middles, lengths = result.V[edges].mean(axis=1), lengths_of(result.V, edges)
        ratio = lengths / (0.04 + 0.08 * middles[:, 0])
        assert ratio.mean() == pytest.approx(1, abs=0.25)
        assert ratio.min() > 0.4 and ratio.max() < 1.8
        away, _ = nearest(result.V[np.unique(edges)], V[np.unique(boundary_edges(F))])
        assert away.max() > 0.1 * L.min(), "nothing slid"
