"""Curves of the reference: names, siblings, who follows whom, and arc lengths."""

from collections import defaultdict
from itertools import pairwise

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import built, cut_open, draw, ends, featured, links_of, next_of, place

from data.shapes import nonmanifold
from remeshvec.core.compiler import kernel
from remeshvec.core.vocabulary import FIXED, NON_MANIFOLD, NONE
from remeshvec.features.curves import link_chains
from remeshvec.features.polyline import (
    Polylines,
    find_siblings,
    join_edges,
    measure_arcs,
    move_on_curve,
    name_edges,
)

CREASED = [
    "cube",
    "l_prism",
    "genus_2",
    "closed_cylinder",
    "cylinder",
    "annulus",
    "grid",
    "triangle",
]
CUT = ["half_discs", "two_cubes", "book", "wall_inside", "two_planes", "three_planes", "four_cubes"]


def features_of(name):
    """Mesh with all its curves marked, and which half-edges these are."""
    if name in zoo.ZOO:
        mesh = built(*zoo.ZOO[name].make())
        featured(mesh, feature_angle=40.0)
    else:
        mesh, source = cut_open(*nonmanifold.COMPLEXES[name].make())
        featured(mesh, vertex_source=source, feature_angle=40.0)
    return mesh, mesh.curve != NONE


def curves_of(mesh, is_feature):
    return link_chains(mesh.origin, mesh.twin, is_feature, len(mesh.X))


def names_of(mesh, is_feature):
    """Names at half-edges, and the names."""
    edges = np.flatnonzero(is_feature).astype(np.int32)
    found = np.empty(mesh.origin.size, np.int32)
    return found, name_edges(mesh.twin, edges, *siblings_of(mesh), found)


def siblings_of(mesh):
    return find_siblings(mesh.X, mesh.origin, np.flatnonzero(mesh.twin == NONE).astype(np.int32))


# --- links ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["triangle", "annulus", "planar_delaunay", "sliver_fan"])
def test_links_are_loops_both_ways(name):
    mesh = built(*zoo.ZOO[name].make())
    open_ones = np.flatnonzero(mesh.twin == NONE)
    links = links_of(mesh, mesh.twin == NONE)
    assert links.shape == (2, mesh.origin.size)
    assert (links[:, mesh.twin != NONE] == NONE).all()
    assert np.array_equal(links[1, links[0, open_ones]], open_ones)
    end = mesh.origin[[next_of(h) for h in open_ones.tolist()]]
    assert np.array_equal(mesh.origin[links[0, open_ones]], end)


def test_closed_meshes_without_creases_have_no_links():
    mesh = built(*zoo.torus())
    links = links_of(mesh, mesh.twin == NONE)
    assert (links == NONE).all()


@pytest.mark.parametrize("name", CREASED)
def test_links_join_where_two_edges_meet(name):
    """Every edge, in both directions: what comes next is the only other edge there, or nothing."""
    mesh, is_feature = features_of(name)
    links = links_of(mesh, is_feature)
    edges = {frozenset(ends(mesh, h)) for h in np.flatnonzero(is_feature)}
    at = defaultdict(set)
    for edge in edges:
        for v in edge:
            at[v].add(edge)
    count = link_chains(mesh.origin, mesh.twin, is_feature, len(mesh.X)).degree
    assert count.tolist() == [len(at[v]) for v in range(len(mesh.X))]
    for h in np.flatnonzero(is_feature):
        a, b = ends(mesh, h)
        others = at[b] - {frozenset((a, b))}
        after = links[0, h]
        assert (after != NONE) == (len(others) == 1)
        if after != NONE:
            assert frozenset(ends(mesh, after)) in others and mesh.origin[after] == b
            assert links[1, after] == h
    assert (links[:, ~is_feature] == NONE).all()


# --- siblings and names --------------------------------------------------------------------------


@pytest.mark.parametrize("name", CUT)
def test_siblings_lie_in_the_same_place(name):
    mesh, _ = features_of(name)
    candidates = np.flatnonzero(mesh.twin == NONE).astype(np.int32)
    expected = defaultdict(list)
    for h in candidates.tolist():
        expected[place(mesh, h)].append(h)
    expected = {tuple(sorted(group)) for group in expected.values() if len(group) > 1}
    shuffled = np.random.default_rng(0).permutation(candidates)
    for given in (candidates, shuffled):
        members, group = find_siblings(mesh.X, mesh.origin, given)
        assert members.dtype == group.dtype == np.int32
        found = [tuple(members[i:j].tolist()) for i, j in pairwise(group)]
        assert len(found) == len(set(found)) and set(found) == expected
        assert group[0] == 0 and group[-1] == len(members)


def test_no_siblings():
    none = np.empty(0, np.int32)
    for mesh in (built(*zoo.torus()), built(*zoo.grid())):
        members, group = siblings_of(mesh)
        assert members.size == 0 and group.tolist() == [0]
    members, group = find_siblings(mesh.X, mesh.origin, none)
    assert members.size == 0 and group.tolist() == [0]


def test_siblings_do_not_mind_the_sign_of_zero_nor_the_target_length():
    V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, 0], [1, -0.0, -0.0], [0, -1, 0.0]])
    mesh = built(V, [[0, 1, 2], [4, 3, 5]])
    mesh.X[:, 3] = np.arange(1, 7)
    members, group = siblings_of(mesh)
    assert members.tolist() == [0, 3] and group.tolist() == [0, 2]
    mesh.X[4, 0] += 1e-16
    assert siblings_of(mesh)[0].tolist() == [0, 3]  # 1 + 1e-16 is 1
    mesh.X[4, 0] = np.nextafter(1, 2)
    assert siblings_of(mesh)[0].size == 0


def test_edges_of_no_length_are_siblings_of_each_other_only():
    """Three faces that repeat a place: nothing else is as long as no edge at all."""
    V = np.repeat(np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3.0]]), 3, axis=0)
    mesh = built(V, [[0, 1, 3], [2, 6, 7], [8, 9, 10]])
    members, group = siblings_of(mesh)
    found = [members[i:j].tolist() for i, j in pairwise(group)]
    assert sorted(found) == [[1, 2], [3, 5], [6, 8]]


@pytest.mark.parametrize("name", CREASED + CUT)
def test_an_edge_has_one_name_on_all_its_sides(name):
    mesh, is_feature = features_of(name)
    found, names = names_of(mesh, is_feature)
    assert np.array_equal(names, np.unique(found[is_feature]))
    assert found.dtype == np.int32 and (found[~is_feature] == NONE).all()
    sides = defaultdict(list)
    for h in np.flatnonzero(is_feature).tolist():
        sides[place(mesh, h)].append(h)
    for half_edges in sides.values():
        assert found[half_edges].tolist() == [min(half_edges)] * len(half_edges)
    # What the marks in the mesh say, but for those that stay.
    moving = mesh.curve >= 0
    assert np.array_equal(mesh.curve[moving] & (NON_MANIFOLD - 1), found[moving])
    assert (mesh.curve >= NON_MANIFOLD).sum() == len(siblings_of(mesh)[0])


# --- who follows whom ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "cornered"),
    [(name, c) for name in CREASED for c in (False, True)] + [(name, True) for name in CUT],
)
def test_neighbours_share_an_end_that_is_no_corner(name, cornered):
    mesh, is_feature = features_of(name)
    names, edges = names_of(mesh, is_feature)
    corner = (mesh.kind == FIXED) & cornered
    row, neighbours = join_edges(names, curves_of(mesh, is_feature), mesh.origin, corner)
    assert neighbours.shape == (2, 1 + len(edges)) and neighbours.dtype == row.dtype == np.int32
    beside = neighbours[:, row]
    assert (np.delete(beside, edges, axis=1) == NONE).all()
    at = defaultdict(set)  # on the sheet of the name: names at every vertex
    for h in np.flatnonzero(is_feature).tolist():
        for v in ends(mesh, h):
            at[v].add(int(names[h]))
    for h in edges.tolist():
        for side, v in enumerate(ends(mesh, h)):
            others = at[v] - {h}
            goes_on = len(others) == 1 and not corner[v]
            assert beside[side, h] == (others.pop() if goes_on else NONE)


def test_without_curves_nobody_has_neighbours():
    mesh = built(*zoo.torus())
    none = np.zeros(mesh.origin.size, bool)
    names, edges = names_of(mesh, none)
    assert (names == NONE).all() and not len(edges)
    corner = np.zeros(len(mesh.X), bool)
    row, neighbours = join_edges(names, curves_of(mesh, none), mesh.origin, corner)
    assert row.shape == (0,) and neighbours.shape == (2, 0)
    assert measure_arcs(mesh.X, mesh.origin, edges, row, neighbours).shape == (3, 0)


# --- arcs ----------------------------------------------------------------------------------------


def arcs_of(mesh):
    """Names, who follows whom, and arc lengths of a mesh with marked features."""
    is_feature = mesh.curve != NONE
    names, edges = names_of(mesh, is_feature)
    is_fixed = mesh.kind == FIXED
    row, neighbours = join_edges(names, curves_of(mesh, is_feature), mesh.origin, is_fixed)
    return edges, Polylines(
        mesh.X, mesh.origin, row, neighbours,
        measure_arcs(mesh.X, mesh.origin, edges, row, neighbours),
    )  # fmt: skip


def by_half_edge(polylines):
    """Who follows whom, and arc lengths, for all half-edges."""
    return polylines.neighbours[:, polylines.row], polylines.arcs[:, polylines.row]


def chains(edges, beside):
    """Sets of edges that hang together."""
    todo = set(edges.tolist())
    while todo:
        chain, stack = set(), [todo.pop()]
        while stack:
            h = stack.pop()
            chain.add(h)
            stack += [int(g) for g in beside[:, h] if g != NONE and int(g) not in chain]
        todo -= chain
        yield sorted(chain)


@pytest.mark.parametrize("name", CREASED + CUT)
def test_arcs_go_on_from_edge_to_edge(name):
    """From zero to the length of the curve, without a jump; closed ones meet their beginning."""
    mesh, _ = features_of(name)
    edges, polylines = arcs_of(mesh)
    assert polylines.arcs.shape == (3, 1 + len(edges))
    beside, arcs = by_half_edge(polylines)
    assert not np.delete(arcs, edges, axis=1).any()
    length = {h: naive.edge_length(mesh.X[:, :3], ends(mesh, h)) for h in edges.tolist()}
    for chain in chains(edges, beside):
        total = sum(length[h] for h in chain)
        is_open = (beside[:, chain] == NONE).any()
        assert arcs[2, chain] == pytest.approx(-total if is_open else total)
        spans = np.sort(arcs[:2, chain], axis=0)
        assert spans[1] - spans[0] == pytest.approx([length[h] for h in chain])
        spans = spans[:, np.argsort(spans[0])]
        assert spans[0, 0] == 0 and np.array_equal(spans[0, 1:], spans[1, :-1])
        joints = defaultdict(set)  # arc lengths by place
        for h in chain:
            for v, arc in zip(ends(mesh, h), arcs[:2, h], strict=True):
                joints[(mesh.X[v, :3] + 0.0).tobytes()].add(float(arc))
        doubled = [found for found in joints.values() if len(found) > 1]
        assert len(doubled) <= 1 and all(
            found == {0.0, abs(arcs[2, chain[0]])} for found in doubled
        )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("k", range(1, 5))
def test_arcs_over_an_edge_of_no_length(k, seed):
    """Two vertices of a line in the same place: the line goes on all the same."""
    V, F = zoo.grid(7, 3, seed)
    F = F[np.random.default_rng(seed).permutation(len(F))]
    V[3 * k + 4] = V[3 * k + 1]  # of 1, 4, 7, 10, ... on the middle line
    mesh = built(V, F)
    line = np.arange(1, 21, 3)
    featured(mesh, 1.0, feature_edges=np.stack([line[:-1], line[1:]], axis=1))
    edges, polylines = arcs_of(mesh)
    _, arcs = by_half_edge(polylines)
    found = {frozenset(ends(mesh, h)): np.sort(arcs[:2, h]).tolist() for h in edges.tolist()}
    spans = [found[frozenset(edge)] for edge in pairwise(line.tolist())]
    steps = [naive.edge_length(V, edge) for edge in pairwise(line)]
    assert sorted(high - low for low, high in spans) == pytest.approx(sorted(steps))
    assert max(high for _, high in spans) == pytest.approx(sum(steps))
    here = next(h for h in edges.tolist() if set(ends(mesh, h)) == {1, 4})
    assert len(found) == 16 + 6
    assert abs(arcs[2, here]) == pytest.approx(sum(steps))


def test_arcs_around_a_loop_with_an_edge_of_no_length():
    for seed in range(20):
        V, F = zoo.grid(7, 7, seed)
        F = F[np.random.default_rng(seed).permutation(len(F))]
        loop = [16, 23, 30, 31, 32, 25, 18, 17, 16]
        V[30] = V[23]
        mesh = built(V, F)
        draw(mesh, loop)
        edges, polylines = arcs_of(mesh)
        _, arcs = by_half_edge(polylines)
        edges = [h for h in edges.tolist() if set(ends(mesh, h)) <= set(loop)]
        length = [naive.edge_length(V, ends(mesh, h)) for h in edges]
        assert abs(arcs[1, edges] - arcs[0, edges]) == pytest.approx(length)
        assert arcs[2, edges] == pytest.approx(sum(length))


@kernel
def walk(polylines, edge, arc, found, parameter):
    for i in range(len(edge)):
        found[i], parameter[i] = move_on_curve(polylines, edge[i], arc[i])


@pytest.mark.parametrize("name", [*CREASED, "half_discs", "two_cubes", "double_bubble"])
def test_moves_end_at_the_arc_length(name):
    """From any edge of a curve; past its ends they stop there, around a closed one they go on."""
    mesh, _ = features_of(name)
    edges, polylines = arcs_of(mesh)
    beside, arcs = by_half_edge(polylines)
    rng = np.random.default_rng(0)
    start = rng.choice(edges, 300).astype(np.int64)
    total = np.abs(arcs[2, start])
    closed = arcs[2, start] > 0
    wanted = rng.uniform(-0.9, 1.9, 300) * total
    found, s = np.empty(300, np.int64), np.empty(300)
    walk(polylines, start, wanted, found, s)
    at = arcs[0, found] + s * (arcs[1, found] - arcs[0, found])
    expected = np.where(closed, wanted % total, np.clip(wanted, 0, total))
    away = np.abs(at - expected)
    assert np.where(closed, np.minimum(away, total - away), away).max() < 1e-12
    assert s.min() >= 0 and s.max() <= 1
    chain = {h: k for k, one in enumerate(chains(edges, beside)) for h in one}
    assert [chain[h] for h in found.tolist()] == [chain[h] for h in start.tolist()]
