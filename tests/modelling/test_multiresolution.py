"""Multiresolution edits: details turn, triangles stay good, births lead back."""

import igl
import numpy as np
import pytest
from helpers import zoo
from scipy.spatial.transform import Rotation

from data.shapes.drawn import bumpy_bar
from remeshvec import MultiresolutionEditor, OptionError, fair, surface_distance
from remeshvec.modelling.motion import part_of_motion, rotations_between

LENGTH = 6.0


def turned(axis, degrees, at=(LENGTH / 2, 0, 0), shift=(0, 0, 0)):
    """Turn about an axis through a point, then a shift; (3, 4)."""
    M = Rotation.from_rotvec(np.radians(degrees) * np.asarray(axis, float)).as_matrix()
    return np.column_stack([M, np.asarray(at) - M @ at + shift])


TWIST = [turned((1, 0, 0), 90.0)] * 12
BEND = [turned((0, 1, 0), -120.0)]
PULL = [turned((1, 0, 0), 60.0, shift=(20.0, 0, 0))]


@pytest.fixture(scope="module")
def bar():
    V, F = bumpy_bar()
    return V, F, V[:, 0] > LENGTH - 0.9, V[:, 0] < 0.9


def editor_of(bar, **options):
    return MultiresolutionEditor(*bar, **{"k": 2, "detail_size": 0.6, **options})


def angles(surface, X):
    F = surface.F[surface.support[surface.F].any(axis=1)]
    return np.degrees(igl.internal_angles(X, F).min(axis=1))


# --- motions -------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [0.0, 1e-7, 40.0, 179.0])
def test_parts_of_a_motion(degrees):
    rng = np.random.default_rng(0)
    P = rng.normal(size=(50, 3))
    T = turned((0.6, 0, 0.8), degrees, rng.normal(size=3), rng.normal(size=3))
    ones = np.ones(50)
    moved = P @ T[:, :3].T + T[:, 3]
    for centre in (np.zeros(3), rng.normal(size=3)):
        assert part_of_motion(T, centre, P, 0 * ones) == pytest.approx(P, abs=1e-12)
        assert part_of_motion(T, centre, P, ones) == pytest.approx(moved, abs=1e-8)
        half = part_of_motion(T, centre, P, 0.5 * ones)
        # Half of the motion twice is all of it, and rigid.
        assert part_of_motion(T, centre, half, 0.5 * ones) == pytest.approx(moved, abs=1e-8)
        assert np.linalg.norm(half - half[0], axis=1) == pytest.approx(
            np.linalg.norm(P - P[0], axis=1), abs=1e-10
        )


def test_parts_of_a_stretch():
    rng = np.random.default_rng(0)
    P, centre = rng.normal(size=(20, 3)), rng.normal(size=3)
    A = rng.normal(size=(3, 4)) + 2 * np.eye(3, 4)
    assert part_of_motion(A, centre, P, np.ones(20)) == pytest.approx(P @ A[:, :3].T + A[:, 3])
    assert part_of_motion(A, centre, P, np.zeros(20)) == pytest.approx(P)
    S = np.diag([2.0, 3.0, 0.5])
    half = part_of_motion(np.column_stack([S, centre - S @ centre]), centre, P, 0.5 * np.ones(20))
    assert half == pytest.approx(centre + (P - centre) * [1.5, 2.0, 0.75])


def test_rotations_are_found():
    V, F = zoo.upsampled(*zoo.torus(24, 12), noise=0.2)
    R = Rotation.from_rotvec([0.4, -2.0, 1.0]).as_matrix()
    assert rotations_between(V, V @ R.T + 3.0, F) == pytest.approx(
        np.broadcast_to(R, (len(V), 3, 3)), abs=1e-9
    )


# --- the base ------------------------------------------------------------------------------------


def test_base_and_details(bar):
    V, _, handle, fixed = bar
    editor = editor_of(bar)
    assert np.array_equal(editor.details, V - editor.base)
    assert np.array_equal(editor.base[handle | fixed], V[handle | fixed])
    bumps = np.linalg.norm(editor.details, axis=1)
    assert 0.02 < bumps.max() < 0.1
    # Bumps only go up: what is left of them is mostly their mean.
    middle = np.abs(V[:, 0] - LENGTH / 2) < 1
    smooth_V, _ = bumpy_bar(height=0.0)
    bump = np.linalg.norm(V - smooth_V, axis=1)
    rest = np.linalg.norm(editor.base - smooth_V, axis=1)[middle]
    assert rest.std() < 0.4 * bump[middle].std()


def test_by_default_the_base_is_fair():
    V, F = zoo.upsampled(*zoo.torus(48, 24), n=0, noise=0.0)
    V = V + 0.05 * np.sin(9 * V) * [0, 0, 1]
    d = np.linalg.norm(V - V[0], axis=1)
    support = (d > 0.15) & (d < 0.6)
    editor = MultiresolutionEditor(V, F, d <= 0.15, d >= 0.6, 2)
    assert editor.base == pytest.approx(fair(V, F, support, 2), abs=1e-12)


# --- moves ---------------------------------------------------------------------------------------


def test_at_rest_nothing_changes(bar):
    V, F, _, _ = bar
    for transform in (np.eye(4), V[bar[2]]):
        surface = editor_of(bar).move(transform)
        assert pytest.approx(V, abs=1e-12) == surface.V
        assert np.array_equal(surface.F, F) and surface.remeshed == 0
        W, G = surface
        assert W is surface.V and G is surface.F


@pytest.mark.parametrize("path", [TWIST, PULL], ids=["twist", "pull"])
def test_remeshing_keeps_triangles_good(bar, path):
    """The smallest angle of the support: above 20 degrees; without remeshing below 5, or 12 if pulled."""
    F = bar[1]
    without = editor_of(bar, remesh=False).move(*path)
    assert np.array_equal(without.F, F)
    limit = 5.0 if path is TWIST else 12.0
    assert angles(without, without.V).min() < limit
    assert angles(without, without.base).min() < limit
    surface = editor_of(bar).move(*path)
    assert surface.remeshed >= 1
    assert angles(surface, surface.base).min() > 30
    assert angles(surface, surface.V).min() > 20
    # The same surface, within the triangles of the one without remeshing.
    assert igl.euler_characteristic(surface.F) == 2
    assert igl.is_edge_manifold(surface.F)[0]
    distance = surface_distance(without.base, without.F, surface.base, surface.F)
    assert distance.rms < 0.05


@pytest.mark.parametrize("path", [TWIST, BEND, PULL], ids=["twist", "bend", "pull"])
def test_handle_and_fixed_part_are_exact(bar, path):
    V, F, handle, fixed = bar
    target = V[handle]
    for T in path:
        target = target @ T[:, :3].T + T[:, 3]
    surface = editor_of(bar).move(*path)
    at = V[F[surface.birth_face]]
    rest = np.einsum("vc,vcx->vx", surface.birth_barycentric, at)
    for mask, where in ((handle, target), (fixed, V[fixed])):
        found = surface.V[~surface.support]
        tree = {tuple(np.round(p, 6)) for p in found}
        assert {tuple(np.round(p, 6)) for p in where} <= tree
        assert mask.sum() == len(where)
    assert (surface.birth_barycentric >= -1e-9).all()
    assert surface.birth_barycentric.sum(axis=1) == pytest.approx(1)
    # Births of held vertices are their own places.
    held = np.isin(np.round(rest[~surface.support], 6), np.round(V, 6)).all()
    assert held


@pytest.mark.parametrize("remesh", [False, True])
def test_details_turn_with_the_base(bar, remesh):
    """The height of bumps over the base, along its normal, is what it was."""
    F = bar[1]
    editor = editor_of(bar, remesh=remesh)
    normal = igl.per_vertex_normals(editor.base, F)
    height = (editor.details * normal).sum(axis=1)
    for path in ([turned((0, 1, 0), -90.0)], [turned((1, 0, 0), 180.0)]):
        surface = editor.move(*path)
        rest = np.einsum("vc,vc->v", surface.birth_barycentric, height[F[surface.birth_face]])
        details = surface.V - surface.base
        now = (details * igl.per_vertex_normals(surface.base, surface.F)).sum(axis=1)
        high = surface.support & (rest > 0.02)
        assert high.sum() > 100
        assert now[high] == pytest.approx(rest[high], abs=0.006)
        if not remesh:
            sizes = np.linalg.norm(editor.details, axis=1)
            assert np.linalg.norm(details, axis=1) == pytest.approx(sizes, abs=1e-9)


def test_a_bend_keeps_the_bar_thick(bar):
    """Each cross-section is moved rigidly: the volume stays."""
    editor = editor_of(bar)
    V, F, _, _ = bar

    def volume(V, F):
        a, b, c = (V[F[:, i]] for i in range(3))
        return np.einsum("fi,fi->", a, np.cross(b, c)) / 6

    for path in (BEND, [turned((1, 0, 0), 180.0)]):
        assert volume(*editor.move(*path)) == pytest.approx(volume(V, F), rel=0.04)


def test_moves_go_on_from_one_another(bar):
    """There and back again: near where it was, with good triangles all the way."""
    V, F, _, _ = bar
    editor = editor_of(bar)
    for quarters in (4, 8, 12, 6, 0):
        surface = editor.move(*TWIST[:quarters]) if quarters else editor.move(np.eye(4))
        assert angles(surface, surface.base).min() > 25
        assert angles(surface, surface.V).min() > 20
    assert surface.remeshed >= 3
    back = surface_distance(V, F, surface.V, surface.F)
    assert back.hausdorff < 0.05 and back.rms < 0.006


def test_free_positions_move_it_too(bar):
    V, _, handle, _ = bar
    editor = editor_of(bar)
    surface = editor.move(V[handle] + [3.0, 0.5, 0.0])
    assert surface.remeshed >= 1
    assert angles(surface, surface.base).min() > 25
    assert surface.V[:, 0].max() == pytest.approx(LENGTH + 3)


def test_results_are_the_same_each_time(bar):
    one, two = (editor_of(bar).move(*TWIST) for _ in range(2))
    assert one.V.tobytes() == two.V.tobytes() and np.array_equal(one.F, two.F)


def test_results_are_the_callers(bar):
    V, F, handle, fixed = (array.copy() for array in bar)
    editor = MultiresolutionEditor(V, F, handle, fixed, detail_size=0.6)
    first = editor.move(*BEND)
    keep = first.V.copy()
    for array in (first.V, first.F, first.base, first.birth_face, first.support, V, F):
        array[...] = 0
    assert np.array_equal(editor.move(*BEND).V, keep)


def test_length_sets_the_edges(bar):
    coarse = editor_of(bar, length=0.12).move(*TWIST)
    fine = editor_of(bar, length=0.06).move(*TWIST)
    assert 2.5 < fine.support.sum() / coarse.support.sum() < 6


def test_bad_input(bar):
    for options in ({"detail_size": 0}, {"length": -1}, {"k": 5}, {"area": "x"}):
        with pytest.raises(OptionError):
            editor_of(bar, **options)
    with pytest.raises(OptionError, match="handle and fixed"):
        MultiresolutionEditor(*bar[:2], bar[2], bar[2])
    with pytest.raises(OptionError):
        editor_of(bar).move(np.eye(3))
