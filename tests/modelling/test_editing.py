"""Editors: exact handles, linear in the handle, factored once, smooth across the borders."""

import numpy as np
import pytest
from helpers import zoo
from scipy.spatial.transform import Rotation

from remeshvec import Editor, OptionError, SingularSystemError, deform
from remeshvec.modelling.fairing import Polyharmonic


@pytest.fixture(scope="module")
def tube():
    V, F = zoo.upsampled(*zoo.cylinder(16, 9), n=1, noise=0.2)
    V = V * [1, 1, 3]
    return V, F, V[:, 2] > 5, V[:, 2] < 1


def rigid(turn=(0.3, 0.2, -0.4), shift=(0.5, -0.2, 0.7)):
    return np.column_stack([Rotation.from_rotvec(turn).as_matrix(), shift])


@pytest.mark.parametrize("k", [1, 2, 3])
def test_handle_and_fixed_part_are_exact(tube, k):
    V, F, handle, fixed = tube
    T = rigid()
    W = deform(V, F, handle, fixed, T, k)
    target = V[handle] @ T[:, :3].T + T[:, 3]
    assert np.array_equal(W[fixed], V[fixed])
    assert np.array_equal(W[handle], target)
    between = ~(handle | fixed)
    assert 0.1 < np.linalg.norm((W - V)[between], axis=1).max() < 6
    # It is what the equation says: zero order-k Laplacian of the displacement.
    d = np.where(between[:, None], 0, W - V)
    assert Polyharmonic(V, F, between, k).solve(d) == pytest.approx(W - V, abs=1e-7)


def test_every_form_of_a_transform(tube):
    V, F, handle, fixed = tube
    editor = Editor(V, F, handle, fixed)
    T = rigid()
    W = editor.move(T)
    target = V[handle] @ T[:, :3].T + T[:, 3]
    whole = np.vstack([T, [0, 0, 0, 1]])
    for same in (whole, whole.tolist(), target, lambda points: points @ T[:, :3].T + T[:, 3]):
        assert editor.move(same) == pytest.approx(W, abs=1e-9)
    assert deform(V, F, np.flatnonzero(handle), np.flatnonzero(fixed), T) == pytest.approx(
        W, abs=1e-12
    )
    bent = editor.move(lambda points: points + np.sin(points))
    assert np.array_equal(bent[handle], V[handle] + np.sin(V[handle]))


def test_no_motion_changes_nothing(tube):
    V, F, handle, fixed = tube
    editor = Editor(V, F, handle, fixed)
    assert np.array_equal(editor.move(np.eye(4)), V)
    assert np.array_equal(editor.move(V[handle]), V)


def test_moves_start_from_rest_and_cost_no_factor(tube, monkeypatch):
    V, F, handle, fixed = tube
    before = V.copy()
    editor = Editor(V, F, handle, fixed, 3)
    first = editor.move(rigid())

    def never(*_, **__):
        raise AssertionError("factored again")

    monkeypatch.setattr("remeshvec.modelling.solver._factorise", never)
    editor.move(rigid((0, 0, 1), (0, 0, 2)))
    solves = []
    solve = editor._system.solver.solve
    monkeypatch.setattr(editor._system.solver, "solve", lambda *a: solves.append(1) or solve(*a))
    assert np.array_equal(editor.move(rigid()), first)
    assert not solves  # affine maps need none
    editor.move(V[handle] + 0.1)
    assert len(solves) == 1
    assert np.array_equal(V, before) and np.array_equal(editor.V, V)


def test_results_are_linear_in_the_handle(tube):
    V, F, handle, fixed = tube
    editor = Editor(V, F, handle, fixed, 2)
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, handle.sum(), 3))
    d = editor.move(V[handle] + a) + editor.move(V[handle] + b) - 2 * V
    assert editor.move(V[handle] + a + b) - V == pytest.approx(d, abs=1e-9)


def test_a_flat_sheet_follows_its_rim_rigidly():
    V, F = zoo.grid(13, 9)
    T = rigid()
    rim = (V[:, 0] % 12 == 0) | (V[:, 1] % 8 == 0)
    W = deform(V, F, rim, [], T, 1)
    assert pytest.approx(V @ T[:, :3].T + T[:, 3], abs=1e-8) == W


def test_bad_input(tube):
    V, F, handle, fixed = tube
    for one, two, match in (
        (handle, handle, "handle and fixed"),
        ([], fixed, "empty"),
        (handle, ~handle, "none is left"),
        ([len(V)], fixed, "handle"),
        (handle[:-1], fixed, "mask"),
    ):
        with pytest.raises(OptionError, match=match):
            Editor(V, F, one, two)
    editor = Editor(V, F, handle, fixed)
    projective = np.eye(4)
    projective[3, 0] = 1
    for transform in (
        np.eye(3), projective, np.full((4, 4), np.nan), V, "up", lambda points: points[1:]
    ):  # fmt: skip
        with pytest.raises(OptionError):
            editor.move(transform)
    with pytest.raises(OptionError, match="k must be"):
        Editor(V, F, handle, fixed, 0)
    two = zoo.joined((V, F), (V, F), shift=9.0)
    with pytest.raises(SingularSystemError, match="parts"):
        Editor(*two, np.flatnonzero(handle), np.flatnonzero(fixed))


def test_vertices_without_faces_stay(tube):
    V, F, handle, fixed = tube
    W = np.vstack([V, [[7.0, 7, 7]]])
    moved = deform(W, F, np.flatnonzero(handle), np.flatnonzero(fixed), rigid())
    assert np.array_equal(moved[-1], W[-1])
    assert moved[:-1] == pytest.approx(deform(V, F, handle, fixed, rigid()), abs=1e-12)
