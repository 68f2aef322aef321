"""Unfolding: moves that turned faces beside curves over are taken back, and no others."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import assert_valid, blocks_of, built, copied, featured, one_block

from remeshvec.core.vocabulary import CURVE, FIXED, HELD, INNER
from remeshvec.operations.relax import relax_vertices
from remeshvec.operations.unfold import undo_folded_edges, undo_folds


def turned(V, W, F, degrees=60.0):
    """Faces that turned by more than an angle, or lost their area."""
    normals = ([naive.normal(X[:, :3], f) for f in naive.tuples(F)] for X in (V, W))
    return {
        f
        for f, n, m in zip(naive.tuples(F), *normals, strict=True)
        if n.any() and (not m.any() or np.degrees(naive.angle(np.zeros(3), n, m)) > degrees)
    }


def undone(mesh, before):
    """What is expected, by rounds: of folded faces at curves, all inner vertices go back."""
    X, F = mesh.X.copy(), mesh.origin.reshape(-1, 3)
    while True:
        folded = [f for f in turned(before, X, F) if max(mesh.kind[list(f)]) >= CURVE]
        back = {v for f in folded for v in f if mesh.kind[v] == INNER}
        back = [v for v in back if not np.array_equal(X[v, :3], before[v, :3])]
        if not back:
            return X
        X[back, :3] = before[back, :3]


def shaken(name, amount, seed=0, **features):
    """Mesh with marked features, where it was, and its vertices moved at random."""
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), n=1, noise=0.1, seed=seed)
    mesh = built(V, F, ordered=True)
    featured(mesh, zoo.mean_edge(V, F), **features)
    before = mesh.X.copy()
    free = mesh.kind < FIXED
    noise = np.random.default_rng(seed).normal(size=mesh.X[:, :3].shape)
    mesh.X[free, :3] += amount * zoo.mean_edge(V, F) * noise[free]
    return mesh, before


@pytest.mark.parametrize("amount", [0.3, 0.5, 1.0])
@pytest.mark.parametrize("per_block", [7, 100_000])
@pytest.mark.parametrize("name", ["grid", "annulus", "cube", "genus_2"])
def test_rounds_end_where_those_of_the_twin_do(name, amount, per_block, monkeypatch):
    mesh, before = shaken(name, amount, feature_angle=40.0)
    start = mesh.X.copy()
    expected = undone(mesh, before)
    count = undo_folds(mesh, blocks_of(mesh, per_block, monkeypatch), before, False)
    assert np.array_equal(mesh.X, expected)
    assert count == (start[:, :3] != expected[:, :3]).any(axis=1).sum() > 0
    assert_valid(mesh)


def test_faces_away_from_curves_may_fold():
    """Undoing them would keep the folds of the input."""
    mesh, before = shaken("torus", 1.0)
    assert len(turned(before, mesh.X, mesh.origin.reshape(-1, 3))) > 20
    moved = copied(mesh)
    assert undo_folds(mesh, one_block(mesh), before, False) == 0
    assert np.array_equal(mesh.X, moved.X)


def test_nothing_folded_nothing_undone():
    mesh, before = shaken("grid", 0.01)
    moved = mesh.X.copy()
    assert undo_folds(mesh, one_block(mesh), before, False) == 0
    assert np.array_equal(mesh.X, moved)


@pytest.mark.parametrize("kind", [HELD, CURVE, FIXED])
def test_only_inner_vertices_go_back(kind):
    """The others are where they belong; lengths stay too."""
    mesh, before = shaken("grid", 1.0)
    inner = np.flatnonzero(mesh.kind == INNER)
    mesh.kind[inner[::2]] = kind
    mesh.X[:, 3] += 1
    moved = mesh.X.copy()
    undo_folds(mesh, one_block(mesh), before, False)
    back = (mesh.X[:, :3] != moved[:, :3]).any(axis=1)
    assert back.any() and (mesh.kind[back] == INNER).all()
    assert np.array_equal(mesh.X[back, :3], before[back, :3])
    assert np.array_equal(mesh.X[:, 3], moved[:, 3])


def test_faces_without_area_before_do_not_count():
    V, F = zoo.flat_cap()
    mesh = built(V, F)
    before = mesh.X.copy()
    before[:, :3] = 0.0
    assert undo_folds(mesh, one_block(mesh), before, False) == 0
    assert np.array_equal(mesh.X[:, :3], V)


def chevron():
    """One inner vertex in an arrow head whose middle lies outside: below vertex 1."""
    V = np.array([[-3, -2, 0], [0, 0, 0], [3, -2, 0], [0, 1, 0], [0, 0.5, 0]], float)
    return V, zoo.fan(np.array([0, 1, 2, 3]), 4)


def test_no_fold_beside_a_concave_boundary():
    V, F = chevron()
    mesh = built(V, F)
    mesh.kind[:4] = FIXED
    before = mesh.X.copy()
    relax_vertices(mesh, one_block(mesh), 0.0, False)
    assert mesh.X[4, 1] < 0 and len(turned(before, mesh.X, F)) == 2
    assert undo_folds(mesh, one_block(mesh), before, False) == 1
    assert np.array_equal(mesh.X, before)


def corner_of_an_l(seed):
    """Square, and a feature curve in it that turns once: an L on one side, a square on the other."""
    V, F = zoo.upsampled(*zoo.grid(9, 9, seed), n=1, noise=0.0)
    at = {tuple(p): v for v, p in enumerate(V[:, :2].tolist())}
    steps = np.arange(0, 4, 0.5)
    path = [(4.0, y) for y in steps] + [(4.0 - x, 4.0) for x in steps] + [(0.0, 4.0)]
    path = np.array([at[p] for p in path])
    free = np.setdiff1d(np.arange(len(V)), path)
    free = free[(V[free, :2] > 0).all(axis=1) & (V[free, :2] < 8).all(axis=1)]
    V[free, :2] += np.random.default_rng(seed).uniform(-0.1, 0.1, (len(free), 2))
    return V, F, np.stack([path[:-1], path[1:]], axis=1), at[4.0, 4.0]


@pytest.mark.parametrize("slope", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("seed", range(1))
@pytest.mark.parametrize("side", ["inside", "outside"])
def test_no_fold_beside_a_corner_of_a_curve(seed, side, slope):
    """Lengths that grow away from it pull vertices towards it, on the concave side over it.

    Two vertices that move at once fold a face that either alone would not.
    """
    V, F, edges, corner = corner_of_an_l(seed)
    mesh = built(V, F)
    featured(mesh, feature_edges=edges, fixed_vertices=[corner, edges[0, 0], edges[-1, -1]])
    away = np.linalg.norm(V[:, :2] - ([0, 0] if side == "inside" else [8, 8]), axis=1)
    mesh.X[:, 3] = 1 + slope * away
    for _ in range(20):
        before = mesh.X.copy()
        relax_vertices(mesh, one_block(mesh), 0.0, False)
        undo_folds(mesh, one_block(mesh), before, False)
        folded = turned(before, mesh.X, F)
        assert not [f for f in folded if mesh.kind[list(f)].max() >= CURVE]
    assert zoo.area(mesh.X[:, :3], F) == pytest.approx(64)
    assert np.array_equal(mesh.X[corner, :3], V[corner])
    assert np.linalg.norm(mesh.X[:, :3] - V, axis=1).max() > 0.1


def folded_edges(X, F):
    """Pairs of faces at edges that turn by more than 150 degrees."""
    beside = {}
    for k, f in enumerate(naive.tuples(F)):
        for i in range(3):
            beside.setdefault(frozenset((f[i], f[i - 1])), []).append(k)
    normals = [naive.normal(X[:, :3], f) for f in naive.tuples(F)]
    return {
        tuple(pair)
        for pair in beside.values()
        if len(pair) == 2 and naive.is_folded(normals[pair[0]], normals[pair[1]])
    }


@pytest.mark.parametrize("amount", [0.3, 0.6])
@pytest.mark.parametrize("per_block", [7, 100_000])
@pytest.mark.parametrize("name", ["torus", "annulus", "cube", "genus_2"])
def test_folded_edges_are_undone_as_by_the_twin(name, amount, per_block, monkeypatch):
    """By rounds: of edges that are folded and were not, the inner vertices of both faces go back."""
    mesh, before = shaken(name, amount, feature_angle=40.0)
    start, F = mesh.X.copy(), mesh.origin.reshape(-1, 3)
    old, X = folded_edges(before, F), mesh.X.copy()
    assert folded_edges(X, F) - old
    while True:
        new = folded_edges(X, F) - old
        back = {int(v) for pair in new for v in F[list(pair)].ravel() if mesh.kind[v] == INNER}
        back = [v for v in back if not np.array_equal(X[v, :3], before[v, :3])]
        if not back:
            break
        X[back, :3] = before[back, :3]
    count = undo_folded_edges(mesh, blocks_of(mesh, per_block, monkeypatch), before, False)
    assert np.array_equal(mesh.X, X)
    assert count == (start[:, :3] != X[:, :3]).any(axis=1).sum() > 0
    assert_valid(mesh)


def test_old_folds_may_move():
    """A fold of the input does not keep its vertices from moving."""
    V, F = zoo.torus()
    V[::7] += 0.8 * np.random.default_rng(0).normal(size=V[::7].shape)
    mesh = built(V, F)
    before = mesh.X.copy()
    old = folded_edges(before, mesh.origin.reshape(-1, 3))
    mesh.X[:, :3] *= 1.01
    assert old and undo_folded_edges(mesh, one_block(mesh), before, False) == 0


def test_faces_that_lose_their_area_go_back():
    V, F = zoo.torus()
    mesh = built(V, F)
    before = mesh.X.copy()
    mesh.X[F[0, 0], :3] = mesh.X[F[0, 1], :3]
    assert undo_folded_edges(mesh, one_block(mesh), before, False) == 1
    assert np.array_equal(mesh.X, before)
