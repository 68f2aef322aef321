"""Faces that lie against the input are found, and the moves that made them taken back."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import blocks_of, built, one_block, tree_of

from remeshvec.operations.turned import find_turned_faces
from remeshvec.operations.unfold import restore_births, undo_folded_edges, undo_turned_faces


def shaken_grid(amount):
    """Flat mesh whose inner vertices moved within the plane; the tree over it, and the old places."""
    V, F = zoo.grid(8, 8)
    mesh = built(V, F)
    tree, before = tree_of(mesh), mesh.X.copy()
    inner = mesh.kind == 0
    inner &= ~np.isin(np.arange(len(V)), mesh.origin[mesh.twin < 0])
    edge = np.linalg.norm(V[F[0, 0]] - V[F[0, 1]])
    moves = np.random.default_rng(1).uniform(-1, 1, (len(V), 2)) * amount * edge
    mesh.X[inner, :2] += moves[inner]
    mesh.X[:, 3] = before[:, 3] = edge
    return mesh, tree, before


def signs(mesh, X):
    F = mesh.origin.reshape(-1, 3)
    return np.array([naive.normal(X[:, :3], f)[2] for f in naive.tuples(F)])


@pytest.mark.parametrize("per_block", [7, 100_000])
@pytest.mark.parametrize("amount", [0.0, 0.9, 1.5])
def test_in_a_plane_they_are_those_of_the_other_sign(amount, per_block, monkeypatch):
    mesh, tree, before = shaken_grid(amount)
    up = np.sign(signs(mesh, before)[0])
    expected = np.flatnonzero(up * signs(mesh, mesh.X) < 0)
    assert (len(expected) > 0) == (amount > 0)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    for parallel in (False, True):
        assert find_turned_faces(mesh, blocks, tree, parallel).tolist() == expected.tolist()


def test_moves_that_turn_faces_are_taken_back_and_no_others():
    mesh, tree, before = shaken_grid(0.9)
    moved = (before != mesh.X).any(axis=1)
    count = undo_turned_faces(mesh, one_block(mesh), before, tree, False)
    assert len(find_turned_faces(mesh, one_block(mesh), tree, False)) == 0
    still = (before != mesh.X).any(axis=1)
    assert 0 < count == moved.sum() - still.sum() < moved.sum()


def test_what_was_turned_before_may_move():
    mesh, tree, _ = shaken_grid(0.9)
    before = mesh.X.copy()
    mesh.X[:, :2] *= 1.001
    assert len(find_turned_faces(mesh, one_block(mesh), tree, False))
    assert undo_turned_faces(mesh, one_block(mesh), before, tree, False) == 0


@pytest.mark.parametrize(("length", "all_turned"), [(1.0, False), (0.1, True)])
def test_a_sheet_that_is_almost_as_close_excuses(length, all_turned):
    """Two sheets .05 apart that look apart; a mesh that looks the other way lies on both."""
    V, F = zoo.grid(6, 6)
    V, F = np.vstack([V, V + np.array([0, 0, 0.05])]), np.vstack([F, F[:, ::-1] + len(V)])
    mesh = built(V, F[:, [0, 2, 1]], length=length)
    turned = find_turned_faces(mesh, one_block(mesh), tree_of(built(V, F)), False)
    assert len(turned) == (len(F) if all_turned else 0)


def test_births_go_back_with_the_vertices():
    V, F = zoo.torus()
    mesh = built(V, F)
    before, births = mesh.X.copy(), mesh.birth.copy()
    v = F[0, 0]
    mesh.X[v, :3], mesh.birth[v] = mesh.X[F[0, 1], :3], 7
    elsewhere = F[-1, 2]
    mesh.X[elsewhere, 0] += 0.01
    mesh.birth[elsewhere] = 8
    n_undone = undo_folded_edges(mesh, one_block(mesh), before, False)
    restore_births(mesh, before, births, n_undone)
    assert mesh.birth[v] == births[v] and mesh.birth[elsewhere] == 8
