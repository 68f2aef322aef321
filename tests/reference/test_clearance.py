"""How near the next sheet is, and how short chords must be for it."""

import numpy as np
import pytest
from helpers import threads, zoo

from data.shapes.basic import icosphere
from remeshvec.input.prepare import prepare
from remeshvec.reference.bvh import Surface
from remeshvec.reference.clearance import clearance_lengths, find_gaps


def prepared(V, F, L):
    """A mesh with its lengths, in a frame that keeps the scale of these shapes to a power of two."""
    made = prepare(np.asarray(V, float), np.asarray(F, np.int64), False)
    mesh = made.mesh
    mesh.X[:, 3] = L * made.scale
    return mesh, Surface(mesh.X, mesh.origin, mesh.twin.copy(), False).tree, made.scale


def gaps(V, F, L, parallel=False):
    mesh, tree, scale = prepared(V, F, L)
    return find_gaps(tree, mesh, parallel) / scale


def shell(wall, times=3):
    """A hollow ball of radius 1, closed."""
    V, F = icosphere(times)
    return np.vstack([V, (1.0 - wall) * V]), np.vstack([F, F[:, ::-1] + len(V)])


def slow_gaps(V, F, L):
    """From the middle of every face along its normal to the first face that looks back; all pairs."""
    corners = V[F]
    middle = corners.mean(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    found = np.full(len(F), np.inf)
    for f in range(len(F)):
        for g in range(len(F)):
            steep = normal[f] @ normal[g]
            if steep >= -0.5 or (corners[f][:, None] == corners[g][None]).all(axis=2).any():
                continue
            t = (corners[g, 0] - middle[f]) @ normal[g] / steep
            hit = middle[f] + t * normal[f]
            sides = [
                np.cross(corners[g, (i + 1) % 3] - corners[g, i], hit - corners[g, i]) @ normal[g]
                for i in range(3)
            ]
            if min(sides) > 0 and abs(t) < 0.5 * L:
                found[f] = min(found[f], abs(t))
    return found


def test_between_two_plates_it_is_their_distance():
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    F = np.array([(0, 2, 1), (0, 3, 2)])
    below, above = np.c_[square, np.zeros(4)], np.c_[square, np.full(4, 0.1)]
    V, facing, alike = (
        np.vstack([below, above]),
        np.vstack([F, F[:, ::-1] + 4]),
        np.vstack([F, F + 4]),
    )
    assert gaps(V, facing, 1.0) == pytest.approx(0.1)
    assert np.isinf(gaps(V, facing, 0.07)).all()  # out of reach
    assert np.isinf(gaps(V, alike, 1.0)).all()  # sheets that look the same way


def test_the_two_sides_of_a_shell_see_each_other():
    found = gaps(*shell(0.05), 0.2)
    assert found == pytest.approx(0.05, rel=0.02)
    assert np.isinf(gaps(*icosphere(3), 0.2)).all()


@pytest.mark.parametrize("seed", range(3))
def test_as_all_pairs_of_faces_have_it(seed):
    rng = np.random.default_rng(seed)
    V, F = shell(0.15, 2)
    V = V + 0.02 * rng.normal(size=V.shape)
    mesh, tree, scale = prepared(V, F, 0.4)
    found = find_gaps(tree, mesh, False) / scale
    expected = slow_gaps(mesh.X[:, :3], mesh.origin.reshape(-1, 3), 0.4 * scale) / scale
    assert np.isfinite(expected).mean() > 0.9
    assert found == pytest.approx(expected, rel=1e-9)


def test_faces_without_area_see_nothing():
    V, F = shell(0.05, 1)
    mesh, _, _ = prepared(V, F, 0.5)
    mesh.X[mesh.origin[2], :3] = mesh.X[mesh.origin[1], :3]
    tree = Surface(mesh.X, mesh.origin, mesh.twin.copy(), False).tree
    found = find_gaps(tree, mesh, False)
    assert np.isinf(found[0]) and np.isfinite(found[1:]).any()


def test_chords_take_their_share_of_the_gap():
    """On a unit ball the chord whose middle lies a share of the gap below the surface."""
    mesh, tree, scale = prepared(*shell(0.05, 4), 0.5)
    gap = find_gaps(tree, mesh, False)
    no_feature = np.zeros(len(mesh.origin), bool)
    lengths = clearance_lengths(mesh, no_feature, gap, 0.4) / scale
    h = 0.4 * 0.05
    outside = np.linalg.norm(mesh.X[:, :3], axis=1) / scale > 0.99
    assert outside.sum() == len(outside) / 2
    assert lengths[outside] == pytest.approx(2 * np.sqrt(h * (2 - h)), rel=0.05)
    assert (clearance_lengths(mesh, no_feature, gap, 0.1) / scale < 0.6 * lengths).all()


def test_flat_sheets_need_nothing():
    V, F = zoo.cube()
    V = V * (1.0, 1.0, 0.01)
    mesh, tree, _ = prepared(V, F, 0.5)
    gap = find_gaps(tree, mesh, False)
    assert np.isfinite(gap).any()
    edges = mesh.twin >= 0
    assert np.isinf(clearance_lengths(mesh, edges, gap, 0.4)).all()


@pytest.mark.parametrize("way", [threads.on_threads(2), threads.shuffled()])
def test_threads_give_the_same_bits(way):
    V, F = shell(0.05, 4)
    alone = gaps(V, F, 0.2)
    with way:
        assert np.array_equal(gaps(V, F, 0.2, parallel=True), alone)
