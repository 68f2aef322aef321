"""Splits along and beside curves: flags on both halves, frozen edges, siblings, births of midpoints."""

from itertools import pairwise

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.siblings import opened, sheets_at_places, sibling_ends, siblings_of
from helpers.structure import (
    assert_on_reference,
    assert_valid,
    blocks_of,
    built,
    curve_edges,
    draw,
    ends,
    faces_of,
    featured,
    half_edge,
    one_block,
    packed,
    place,
    shape_of,
)

from data.shapes import nonmanifold
from remeshvec.core.vocabulary import (
    CURVE,
    FIXED,
    FROZEN,
    HALTED,
    HELD,
    INNER,
    NON_MANIFOLD,
    NONE,
    PINNED,
)
from remeshvec.operations.split import MAX_ROUNDS, compact, split_edges, split_long_edges

ROWS = 5  # vertices of a column of `zoo.grid()`, which has 7 of them


def crossed(seed=0):
    """Bumpy grid with two curves that cross and one that closes, over 8 x 7 cells."""
    V, F = zoo.perturb(*zoo.grid(9, 8, seed), amount=0.1, seed=seed)
    at = lambda i, j: 8 * i + j  # noqa: E731
    mesh = built(V, F)
    across = [at(i, 3) for i in range(1, 8)]
    along = [at(4, j) for j in range(8)]
    loop = [at(1, 5), at(2, 5), at(2, 6), at(1, 6), at(1, 5)]
    draw(mesh, across, along, loop)
    return mesh


def on_segment(p, a, b):
    return np.linalg.norm(p - naive.closest_on_segment(p, a, b))


def split(mesh, factor, siblings=None):
    """One round, without the room that it leaves free."""
    refined, count = split_long_edges(mesh, one_block(mesh), factor, False, siblings)
    return packed(refined), count


def rounds(mesh, factor, siblings=None):
    for _ in range(MAX_ROUNDS):
        given = None if siblings is None else siblings(mesh)
        mesh, count = split_long_edges(mesh, one_block(mesh), factor, False, given)
        assert_valid(mesh, slits=siblings is not None)
        if not count:
            return packed(mesh)
    raise AssertionError("never ends")


# --- flags ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("per_block", [9, 100_000])
@pytest.mark.parametrize("factor", [0.3, 0.9, 1.2])
def test_both_halves_stay_on_the_curve_and_nothing_else_gets_there(factor, per_block, monkeypatch):
    mesh = crossed()
    V = mesh.X[:, :3]
    before = {name: sorted(edge) for edge, name in curve_edges(mesh).items()}
    refined, count = split_long_edges(mesh, blocks_of(mesh, per_block, monkeypatch), factor, False)
    assert count > 5
    assert_valid(refined)
    refined = packed(refined)
    found = dict.fromkeys(before, 0.0)
    for edge, name in curve_edges(refined).items():
        a, b = V[before[name]]
        ends = refined.X[sorted(edge), :3]
        assert max(on_segment(p, a, b) for p in ends) < 1e-13
        found[name] += np.linalg.norm(ends[0] - ends[1])
    for name, edge in before.items():
        assert found[name] == pytest.approx(np.linalg.norm(V[edge[0]] - V[edge[1]]))
    new = np.array([tuple(p) not in set(map(tuple, V.tolist())) for p in refined.X[:, :3].tolist()])
    on_curve = np.isin(np.arange(len(new)), [v for edge in curve_edges(refined) for v in edge])
    assert (refined.kind[new & on_curve] == CURVE).all() and (new & on_curve).any()
    assert (refined.kind[new & ~on_curve] == INNER).all() and (new & ~on_curve).any()
    assert np.bincount(refined.kind).sum() - np.bincount(mesh.kind).sum() == count


def test_old_vertices_keep_their_kinds():
    mesh = crossed()
    kinds = [INNER, HELD, CURVE, PINNED, FIXED]
    mesh.kind[:] = np.random.default_rng(0).choice(kinds, len(mesh.kind))
    before = {tuple(p): k for p, k in zip(mesh.X[:, :3].tolist(), mesh.kind, strict=True)}
    refined, _ = split(mesh, 0.7)
    kept = {tuple(p): k for p, k in zip(refined.X[:, :3].tolist(), refined.kind, strict=True)}
    assert {p: kept[p] for p in before} == before


def test_faces_keep_their_source():
    mesh = crossed()
    refined, _ = split(mesh, 0.5)
    V, F = mesh.X[:, :3], faces_of(mesh)
    assert np.array_equal(np.unique(refined.source), np.arange(len(F)))
    for f, g in zip(faces_of(refined), refined.source, strict=True):
        middle = refined.X[f, :3].mean(axis=0)
        assert naive.closest_on_triangle(middle, *V[F[g]])[1] < 1e-13


def test_compaction_keeps_curves_and_sources():
    mesh = crossed()
    packed = compact(mesh, one_block(mesh), False)
    assert sorted(curve_edges(packed).values()) == sorted(curve_edges(mesh).values())
    assert np.array_equal(packed.source, mesh.source) and np.array_equal(packed.curve, mesh.curve)


@pytest.mark.parametrize("factor", [0.4, 0.9])
def test_midpoints_have_the_mean_length(factor):
    mesh = crossed()
    mesh.X[:, 3] = 1 + 0.1 * mesh.X[:, 0]
    refined, count = split(mesh, factor)
    assert count and refined.X[:, 3] == pytest.approx(1 + 0.1 * refined.X[:, 0])


def test_what_is_long_depends_on_the_lengths_at_the_ends():
    V, F = zoo.perturb(*zoo.grid(), amount=0.05)
    mesh = built(V, F)
    mesh.X[:, 3] = lengths = np.random.default_rng(0).uniform(0.5, 1.5, len(V))
    refined, _ = split(mesh, 1.1)
    new = {tuple(p) for p in refined.X[:, :3].tolist()} - {tuple(p) for p in V.tolist()}
    limit = {e: 1.1 * naive.middle_length(*lengths[list(e)]) for e in naive.edges(F)}
    expected = [sorted(e) for e in naive.edges(F) if naive.edge_length(V, e) > limit[e]]
    assert 10 < len(expected) < len(limit)
    assert new == {tuple(((V[a] + V[b]) * 0.5).tolist()) for a, b in expected}


# --- frozen edges --------------------------------------------------------------------------------


@pytest.mark.parametrize("flag", [FROZEN, HALTED])
@pytest.mark.parametrize("factor", [0.45, 0.9])
def test_frozen_edges_are_never_split(factor, flag):
    mesh = crossed()
    frozen = [half_edge(mesh, 8 * i + 1, 8 * i + 2) for i in (1, 2, 3, 5, 6, 7)]
    frozen += [half_edge(mesh, 8 * 4 + j, 8 * 4 + j + 1) for j in range(3)]  # along a curve
    for h in frozen:
        mesh.curve[h] = flag
        mesh.curve[mesh.twin[h]] = flag
        mesh.kind[list(ends(mesh, h))] = FIXED
    places = {place(mesh, h) for h in frozen}
    refined, count = split(mesh, factor)
    assert count
    assert_valid(refined)
    still = np.flatnonzero(refined.curve == flag)
    assert len(still) == 2 * len(frozen) and {place(refined, h) for h in still} == places
    # All others are as they would be: faces are high enough to have all their long edges split.
    frozen = {frozenset(ends(mesh, h)) for h in frozen}
    V, F = mesh.X[:, :3], faces_of(mesh)
    assert count == len(naive.asked_splits(V, F, factor) - frozen) < len(naive.edges(F))


def test_a_low_face_beside_a_frozen_edge_splits_its_longest_other_one():
    V = np.array([[0, 0, 0], [4, 0, 0], [1.9, 0.05, 0], [2, -3, 0]])
    for frozen, expected in ((False, (0, 1)), (True, (1, 2))):
        mesh = built(V, [[0, 1, 2], [1, 0, 3]], length=1.0)
        mesh.X[3, 3] = 1e9  # the other face wants nothing of its own
        h = half_edge(mesh, 0, 1)
        if frozen:
            mesh.curve[[h, mesh.twin[h]]] = FROZEN
            mesh.kind[[0, 1]] = FIXED
        refined, count = split(mesh, 1.0)
        assert count == 1
        middle = V[list(expected)].mean(axis=0)
        assert np.abs(refined.X[:, :3] - middle).sum(axis=1).min() == 0


def test_rounds_end_beside_frozen_edges():
    """With lengths beside them that reach theirs, which `build_reference` sees to."""
    V, F = zoo.grid()
    mesh = built(V, F)
    reference = featured(mesh, 0.15, fixed_faces=[5, 6, 20]).reference
    mesh = rounds(mesh, 4 / 3)
    assert (mesh.curve == FROZEN).any()
    assert_on_reference(mesh, reference)
    assert zoo.area(mesh.X[:, :3], faces_of(mesh)) == pytest.approx(24)


def test_told_to_any_edge_is_split():
    mesh = crossed()
    edges = np.array([half_edge(mesh, 9, 10), half_edge(mesh, 27, 35)], np.int32)
    middles = {tuple(sum(mesh.X[list(ends(mesh, h)), :3]) / 2) for h in edges}
    refined = split_edges(mesh, one_block(mesh), edges, False)
    assert_valid(refined)
    new = set(map(tuple, refined.X[:, :3].tolist())) - set(map(tuple, mesh.X[:, :3].tolist()))
    assert new == middles
    assert shape_of(faces_of(refined)) == shape_of(faces_of(mesh))


# --- siblings ------------------------------------------------------------------------------------


def two_sheets(reach=0.1):
    """Two faces on one edge of length 2; the first is a needle with longer sides, the second is not."""
    P = np.array([[0, 0, 0], [2, 0, 0], [2.0 + reach, 0.02, 0], [0, 0, 0], [2, 0, 0], [1, 0, 2]])
    mesh = built(P, [[0, 1, 2], [4, 3, 5]])
    mesh.curve[[0, 3]] = NON_MANIFOLD
    return mesh


def test_siblings_are_split_together():
    """On its own the needle would have its longest side split, and the seam would open."""
    siblings = np.array([0, 3], np.int32), np.array([0, 2], np.int32)
    mesh = two_sheets()
    alone, count = split(mesh, 1.0)
    assert sum(1 for p in alone.X[:, :3].tolist() if p == [1, 0, 0]) == 1
    refined, more = split(mesh, 1.0, siblings)
    assert more == count + 1
    assert_valid(refined, slits=True)
    middle = np.flatnonzero((refined.X[:, :3] == [1, 0, 0]).all(axis=1))
    assert len(middle) == 2 and (refined.kind[middle] == CURVE).all()
    assert (refined.curve >= NON_MANIFOLD).sum() == 4 and len(siblings_of(refined)[0]) == 4


def test_siblings_that_nobody_wants_split_stay():
    siblings = np.array([0, 3], np.int32), np.array([0, 2], np.int32)
    mesh = two_sheets()
    same, count = split_long_edges(mesh, one_block(mesh), 50.0, False, siblings)
    assert same is mesh and not count


@pytest.mark.parametrize("factor", [0.1, 0.25])
@pytest.mark.parametrize("name", nonmanifold.COMPLEXES)
def test_seams_stay_closed(name, factor):
    """All sheets have the same points on a seam, bit by bit, and are on the same curves."""
    known = nonmanifold.COMPLEXES[name]
    mesh, reference = opened(*known.make(), factor * known.size, feature_angle=40.0)
    sheets = sheets_at_places(mesh)
    mesh = rounds(mesh, 1.2, siblings_of)
    found = sheets_at_places(mesh)
    assert len(found) > len(sheets) or factor > 0.2
    lengths = dict.fromkeys(sheets.values(), 0.0)
    for edge, count in found.items():
        lengths[count] += np.linalg.norm(np.subtract(*edge))
    for count in lengths:
        old = sum(np.linalg.norm(np.subtract(*edge)) for edge, k in sheets.items() if k == count)
        assert lengths[count] == pytest.approx(old, rel=1e-9)
    members, group = siblings_of(mesh)
    for i, j in pairwise(group):
        assert len(set((mesh.curve[members[i:j]]).tolist())) == 1
        for end in range(2):
            at = [sibling_ends(mesh, h)[end] for h in members[i:j].tolist()]
            assert (
                len({(int(mesh.kind[v]), int(mesh.birth[v]), mesh.X[v, 3]) for v in at}) == 1
                or (mesh.kind[at] == FIXED).all()
            )
    assert_on_reference(mesh, reference)


# --- births --------------------------------------------------------------------------------------


def bent(kinds, births, curve=NONE):
    """Edge 0-1 of two faces; what is born in its middle."""
    V = np.array([[0, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0]], float)
    mesh = built(V, [[0, 1, 2], [1, 0, 3]])
    mesh.kind[[0, 1]] = kinds
    mesh.birth[[0, 1]] = births
    mesh.source[:] = [20, 30]
    h = half_edge(mesh, 0, 1)
    mesh.curve[[h, mesh.twin[h]]] = curve
    refined, count = split(mesh, 1.9)
    assert count == 1
    (v,) = np.flatnonzero((refined.X[:, :3] == [1, 0, 0]).all(axis=1))
    return int(refined.kind[v]), int(refined.birth[v])


@pytest.mark.parametrize(
    ("kinds", "births", "expected"),
    [
        ((INNER, INNER), (5, 8), {5, 8}),
        ((HELD, INNER), (5, 8), {5, 8}),
        ((INNER, CURVE), (5, 8), {5}),
        ((CURVE, INNER), (5, 8), {8}),
        ((HELD, FIXED), (5, 8), {5}),
        ((PINNED, INNER), (5, 8), {8}),
        # Both on curves: their births may be faces of other patches. The face is in the right one.
        ((CURVE, CURVE), (5, 8), {60, 90}),
        ((FIXED, CURVE), (5, 8), {60, 90}),
        ((FIXED, FIXED), (5, 8), {60, 90}),
    ],
)
def test_births_across_a_patch(kinds, births, expected):
    kind, birth = bent(kinds, births)
    assert kind == INNER and birth in expected


@pytest.mark.parametrize("curve", [7, 7 + NON_MANIFOLD])
@pytest.mark.parametrize(
    ("kinds", "births", "expected"),
    [
        ((CURVE, CURVE), (5, 8), 5),
        ((CURVE, CURVE), (8, 5), 5),
        ((PINNED, CURVE), (8, 5), 5),
        ((CURVE, FIXED), (8, 5), 8),
        ((FIXED, PINNED), (5, 8), 8),
        # Fixed vertices are born as corners of faces, not on curves: the edge tells.
        ((FIXED, FIXED), (5, 8), 7),
    ],
)
def test_births_along_a_curve(kinds, births, expected, curve):
    assert bent(kinds, births, curve) == (CURVE, expected)


@pytest.mark.parametrize(
    "name", ["cube", "genus_2", "l_prism", "closed_cylinder", "annulus", "grid"]
)
def test_births_lie_on_the_own_curve_and_in_the_own_patch(name):
    V, F = zoo.ZOO[name].make()
    mesh = built(V, F, ordered=True)
    reference = featured(mesh, 0.4 * zoo.mean_edge(V, F), feature_angle=40.0).reference
    mesh = rounds(mesh, 1.1)
    assert (mesh.kind == INNER).any() and (mesh.kind == CURVE).any()
    assert_on_reference(mesh, reference)
