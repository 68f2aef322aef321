"""Collapses on and beside curves: what may vanish, and what is left of the curves."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.collapses import LOOSE, survivor_of
from helpers.structure import (
    assert_on_reference,
    assert_same_bits,
    assert_valid,
    blocks_of,
    built,
    copied,
    curve_edges,
    draw,
    faces_of,
    featured,
    half_edge,
    next_of,
    one_block,
    shape_of,
)

from remeshvec.core.vocabulary import (
    CURVE,
    DEAD,
    FIXED,
    FROZEN,
    HALTED,
    HELD,
    INNER,
    NON_MANIFOLD,
    NONE,
    PINNED,
)
from remeshvec.operations.collapse import (
    collapse_short_edges,
)
from remeshvec.operations.outcomes import COLLAPSED, KEPT_CURVE


def pulled(mesh, a, b, length=1e-3):
    """Move b towards a in the mesh, so that their edge is the only short one."""
    step = mesh.X[b, :3] - mesh.X[a, :3]
    mesh.X[b, :3] = mesh.X[a, :3] + length * step / np.linalg.norm(step)


def collapse(mesh, limits=LOOSE):
    return collapse_short_edges(mesh, one_block(mesh), limits, False)


def at(i, j):
    """Vertex of the grid of 9 x 8."""
    return 8 * i + j


def crossed():
    """Grid with two curves that cross, one with a loose end, and two that close, one around a face."""
    V, F = zoo.grid(9, 8)
    mesh = built(V, F)
    across = [at(i, 3) for i in range(1, 9)]
    along = [at(4, j) for j in range(8)]
    loop = [at(1, 5), at(2, 5), at(2, 6), at(1, 6), at(1, 5)]
    a, b, c = next(f for f in F.tolist() if (V[f] >= [6, 5, 0]).all() and (V[f] <= [7, 6, 0]).all())
    draw(mesh, across, along, loop, [a, b, c, a])
    return mesh


def may_collapse(mesh, a, b):
    """Rule of curves: the edge of a vertex that may vanish, whose faces lose one curve at most."""
    curves, F = curve_edges(mesh), faces_of(mesh)
    low = min(mesh.kind[a], mesh.kind[b])
    edge = frozenset((a, b))
    find_tips = [(set(f) - edge).pop() for f in F.tolist() if edge <= set(f)]
    if low == INNER:
        return True
    if low != CURVE or curves.get(edge, NONE) < 0:
        return False
    if any({frozenset((a, c)), frozenset((b, c))} <= set(curves) for c in find_tips):
        return False
    rim = naive.boundary_edges(F)
    return (
        edge not in rim or not {frozenset((a, find_tips[0])), frozenset((b, find_tips[0]))} <= rim
    )


def expected_curves(mesh, survivor, removed):
    """Curves after a collapse; where two edges become one it is on a curve if either was."""
    found = {}
    for edge, name in curve_edges(mesh).items():
        moved = frozenset(survivor if v == removed else v for v in edge)
        if len(moved) == 2:
            found.setdefault(moved, set()).add(name)
    return found


# --- one collapse --------------------------------------------------------------------------------


def test_every_edge_in_turn():
    """Refused or done as the rules say; the flags of vanished edges merge to both sides of the new."""
    whole = crossed()
    seen = {}
    for a, b in sorted(map(sorted, naive.edges(faces_of(whole)))):
        mesh = copied(whole)
        pulled(mesh, a, b)
        before = copied(mesh)
        tally = collapse(mesh)
        assert tally.sum() == 1
        assert_valid(mesh)
        allowed = may_collapse(before, a, b)
        assert bool(tally[KEPT_CURVE]) == (not allowed), (a, b)
        kinds = tuple(sorted((int(before.kind[a]), int(before.kind[b]))))
        on_curve = frozenset((a, b)) in curve_edges(before)
        seen.setdefault((kinds, on_curve), set()).add(allowed)
        if not tally[COLLAPSED]:
            assert_same_bits(mesh, before)
            continue
        survivor = survivor_of(mesh, a, b)
        removed = a + b - survivor
        assert before.kind[survivor] >= before.kind[removed]
        assert mesh.kind[survivor] == before.kind[survivor]
        if before.kind[survivor] > before.kind[removed]:
            assert np.array_equal(mesh.X[survivor], before.X[survivor])
        expected = expected_curves(before, survivor, removed)
        found = curve_edges(mesh)
        assert set(found) == set(expected)
        assert all(name in expected[edge] for edge, name in found.items())
        assert shape_of(faces_of(mesh)) == shape_of(faces_of(before))
    assert seen[(INNER, INNER), False] == {True}
    assert seen[(INNER, CURVE), False] == {True}
    assert seen[(INNER, FIXED), False] == {True}
    assert seen[(CURVE, CURVE), False] == {False}  # two curves, or two parts of one, would meet
    assert seen[(CURVE, CURVE), True] == {True, False}  # around a face it stays
    assert seen[(CURVE, FIXED), True] == {True}
    assert seen[(CURVE, FIXED), False] == {False}


def test_a_curve_vertex_never_leaves_its_curve():
    """An inner neighbour comes to it; beside it, along the curve, the two meet in the middle."""
    mesh = crossed()
    on_curve, inner = at(6, 3), at(6, 4)
    pulled(mesh, on_curve, inner, 1e-3)
    place = mesh.X[on_curve].copy()
    assert collapse(mesh)[COLLAPSED] == 1
    assert mesh.vertex_halfedge[inner] == DEAD and np.array_equal(mesh.X[on_curve], place)
    mesh = crossed()
    a, b = at(6, 3), at(7, 3)
    pulled(mesh, a, b)
    middle = (mesh.X[a, :3] + mesh.X[b, :3]) / 2
    assert collapse(mesh)[COLLAPSED] == 1
    survivor = survivor_of(mesh, a, b)
    assert np.array_equal(mesh.X[survivor, :3], middle) and mesh.kind[survivor] == CURVE


def test_quadric_points_are_for_inner_vertices():
    """Those of a curve stay on it, however far the planes of both rings pull."""
    mesh = crossed()
    mesh.X[:, 2] = 0.3 * np.sin(mesh.X[:, 0]) * mesh.X[:, 1]
    a, b = at(6, 3), at(7, 3)
    pulled(mesh, a, b)
    middle = (mesh.X[a, :3] + mesh.X[b, :3]) / 2
    assert collapse(mesh, LOOSE._replace(quadric_reach=3.0))[COLLAPSED] == 1
    survivor = survivor_of(mesh, a, b)
    assert np.array_equal(mesh.X[survivor, :3], middle)


@pytest.mark.parametrize("kind", [HELD, PINNED, FIXED])
def test_held_vertices_stay_and_swallow(kind):
    """Corners, and what the sweeps hold: a neighbour may vanish, on their own curve if it is on one."""
    for other, along in ((at(6, 4), False), (at(7, 3), True)):
        held = at(6, 3)
        for first in (held, other):
            mesh = crossed()
            mesh.kind[held] = kind
            if kind == HELD:
                for edge in ((at(5, 3), held), (held, at(7, 3))):  # an inner vertex off all curves
                    h = half_edge(mesh, *edge)
                    mesh.curve[[h, mesh.twin[h]]] = NONE
            pulled(mesh, first, other if first == held else held)
            place = mesh.X[held].copy()
            tally = collapse(mesh)
            if along and kind == HELD:
                assert tally[KEPT_CURVE] == 1
            else:
                assert tally[COLLAPSED] == 1 and mesh.vertex_halfedge[other] == DEAD
            assert mesh.kind[held] == kind and np.array_equal(mesh.X[held], place)


@pytest.mark.parametrize("flag", [FROZEN, HALTED, 5 + NON_MANIFOLD])
def test_frozen_edges_and_seams_do_not_collapse(flag):
    """Seams do in a pass of their own."""
    mesh = crossed()
    h = half_edge(mesh, at(6, 3), at(7, 3))
    mesh.curve[[h, mesh.twin[h]]] = flag
    pulled(mesh, at(6, 3), at(7, 3))
    before = copied(mesh)
    assert collapse(mesh)[KEPT_CURVE] == 1
    assert_same_bits(mesh, before)


@pytest.mark.parametrize("flag", [NONE, 7, 7 + NON_MANIFOLD, FROZEN, HALTED])
@pytest.mark.parametrize("which", ["next_halfedge", "previous_halfedge"])
def test_the_flag_of_either_vanished_edge_is_on_both_sides_of_the_new(which, flag):
    mesh = built(*zoo.grid(9, 8))
    a, b = at(4, 4), at(5, 4)
    h = half_edge(mesh, a, b)
    apex = int(mesh.origin[next_of(next_of(h))])
    end = b if which == "next_halfedge" else a
    g = half_edge(mesh, end, apex)
    mesh.curve[[g, mesh.twin[g]]] = flag
    if flag != NONE:
        mesh.kind[[end, apex]] = FIXED
    pulled(mesh, a, b)
    assert collapse(mesh)[COLLAPSED] == 1
    survivor = survivor_of(mesh, a, b)
    joined = half_edge(mesh, survivor, apex)
    assert mesh.curve[joined] == mesh.curve[mesh.twin[joined]] == flag
    assert np.isin(mesh.curve[(mesh.origin != DEAD) & (mesh.twin != NONE)], [NONE, flag]).all()


def test_births_of_merged_vertices_are_the_smaller_edge():
    """The same for all sheets that share the curve, whichever end survives there."""
    for births in ((11, 40), (40, 11)):
        mesh = crossed()
        a, b = at(6, 3), at(7, 3)
        mesh.birth[[a, b]] = births
        pulled(mesh, a, b)
        assert collapse(mesh)[COLLAPSED] == 1
        survivor = survivor_of(mesh, a, b)
        assert mesh.birth[survivor] == 11
    mesh = crossed()
    corner, other = at(4, 3), at(5, 3)
    mesh.birth[[corner, other]] = [40, 11]
    pulled(mesh, corner, other)
    assert collapse(mesh)[COLLAPSED] == 1 and mesh.birth[corner] == 40


def test_lengths_are_those_of_the_place():
    for kinds, expected in (((INNER, INNER), 1.5), ((INNER, CURVE), 2.0), ((CURVE, INNER), 1.0)):
        mesh = built(*zoo.grid(9, 8))
        a, b = at(4, 4), at(5, 4)
        mesh.kind[[a, b]] = kinds
        mesh.X[[a, b], 3] = [1.0, 2.0]
        pulled(mesh, a, b)
        assert collapse(mesh)[COLLAPSED] == 1
        assert mesh.X[survivor_of(mesh, a, b), 3] == expected


def test_what_is_short_depends_on_the_lengths_at_the_ends():
    """Below a factor of their harmonic mean."""
    V, F = zoo.perturb(*zoo.icosphere(2), amount=0.1)
    lengths = np.random.default_rng(0).uniform(0.5, 1.5, len(V)) * zoo.mean_edge(V, F)
    short = []
    for a, b in map(sorted, naive.edges(F)):
        mean = 2 / (1 / lengths[a] + 1 / lengths[b])
        if naive.edge_length(V, (a, b)) < 0.9 * mean:
            short.append((a, b))
    mesh = built(V, F, length=lengths)
    mesh.kind[:] = FIXED
    tally = collapse(mesh, LOOSE._replace(shortest=0.9))
    assert tally[KEPT_CURVE] == tally.sum() == len(short)
    assert 20 < len(short) < len(naive.edges(F)) - 20


# --- many collapses ------------------------------------------------------------------------------


@pytest.mark.parametrize("per_block", [9, 100_000])
@pytest.mark.parametrize(
    "name", ["cube", "genus_2", "l_prism", "closed_cylinder", "annulus", "cone"]
)
def test_corners_and_curves_survive_everything(name, per_block, monkeypatch):
    """All that can go goes: every curve is left, with its ends, and births that lie on it."""
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), n=2, noise=0.1)
    mesh = built(V, F, ordered=True)
    reference = featured(mesh, 100.0, feature_angle=40.0).reference
    before = copied(mesh)
    corners = np.flatnonzero(mesh.kind == FIXED)
    limits = LOOSE._replace(shortest=1.0)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    for _ in range(4):
        collapse_short_edges(mesh, blocks, limits, False)
        assert_valid(mesh)
        assert_on_reference(mesh, reference)
    assert shape_of(faces_of(mesh)) == shape_of(F)
    assert (mesh.vertex_halfedge[corners] != DEAD).all()
    assert np.array_equal(mesh.X[corners], before.X[corners])
    assert graph(mesh, corners) == graph(before, corners)
    assert len(faces_of(mesh)) < 0.7 * len(F)


def graph(mesh, corners):
    """Curves between corners, and the number of closed ones: what is left after vertices between."""
    curves = [set(edge) for edge in curve_edges(mesh)]
    around = {}
    for edge in curves:
        for v in edge:
            around.setdefault(v, []).append(edge)
    ends, left = [], {frozenset(edge) for edge in curves}
    for corner in corners.tolist():
        for edge in around.get(corner, []):
            v, last = corner, edge
            if frozenset(edge) not in left:
                continue
            while True:
                left.discard(frozenset(last))
                (v,) = last - {v}
                if v in set(corners.tolist()):
                    break
                last = next(e for e in around[v] if frozenset(e) in left)
            ends.append(tuple(sorted((corner, v))))
    closed = 0
    while left:
        closed += 1
        todo = [left.pop()]
        while todo:
            edge = todo.pop()
            beside = {e for e in left if e & edge}
            left -= beside
            todo += beside
    return sorted(ends), closed
