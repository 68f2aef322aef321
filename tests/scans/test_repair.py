"""Repair: each step on a surface that needs it, and nothing on one that does not."""

import numpy as np
import pytest
from helpers import zoo

from remeshvec import MeshInputError, OptionError, quality, repair


def sphere(level=3):
    V, F = zoo.icosphere(level)
    return V / np.linalg.norm(V, axis=1)[:, None], F


def with_holes(V, F, places=(0, 200, 400), size=0.3):
    centre = V[F].mean(axis=1)
    away = np.min([np.linalg.norm(centre - V[p], axis=1) for p in places], axis=0)
    return F[away > size]


def soup_of(V, F):
    return V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)


def two_cubes_on_an_edge():
    corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, -1).T * 1.0
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    F = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    V, same = np.unique(
        np.vstack([corners, corners + np.array([1, 1, 0])]), axis=0, return_inverse=True
    )
    return V, same.reshape(-1)[np.vstack([F, F + 8])]


def assert_sources(result, V, F):
    """Coordinates are those of the input, and every face that was there has the corners it had."""
    assert np.array_equal(result.V, np.asarray(V)[result.vertex_source])
    old = result.face_source >= 0
    assert (old[:-1] >= old[1:]).all()
    then = np.asarray(V)[np.asarray(F).ravel()[result.corner_source[old]]]
    assert np.array_equal(result.V[result.F[old]], then)


def test_a_clean_surface_is_left_alone():
    V, F = sphere()
    result = repair(V, F, min_component=10, keep_largest=True, fill_holes="all")
    assert not any(result.report.to_dict().values())
    assert str(result.report) == "nothing to repair"
    assert np.array_equal(result.V, V) and np.array_equal(result.F, F)
    assert np.array_equal(result.face_source, np.arange(len(F)))


def test_a_soup_is_joined_and_closed():
    V, F = sphere()
    result = repair(*soup_of(V, F))
    q = quality(*result)
    assert q.is_closed and q.vertices == len(V) and q.components == 1
    assert result.report.welded_vertices == 3 * len(F) - len(V)
    assert result.report.unused_vertices == 0
    assert quality(*repair(*soup_of(V, F), weld=None)).components == len(F)


def test_welding_within_a_distance():
    V, F = sphere()
    soup_V, soup_F = soup_of(V, F)
    shaken = soup_V + 1e-6 * np.random.default_rng(0).normal(size=soup_V.shape)
    assert not quality(*repair(shaken, soup_F)).is_closed
    result = repair(shaken, soup_F, weld=1e-4)
    assert quality(*result).is_closed and quality(*result).vertices == len(V)
    assert np.array_equal(result.V, shaken[result.vertex_source])


def test_welding_leaves_closed_parts_that_touch_apart():
    V, F = sphere(2)
    joined = np.vstack([V, V + np.array([2.0 * V[:, 0].max(), 0, 0])])
    result = repair(joined, np.vstack([F, F + len(V)]), weld=1e-3)
    assert result.report.welded_vertices == 0
    assert quality(*result).components == 2


@pytest.mark.parametrize("fill", [40, "all"])
def test_holes_are_closed(fill):
    V, F = sphere()
    G = with_holes(V, F)
    result = repair(V, G, fill_holes=fill)
    q = quality(*result)
    assert q.is_closed and q.euler_number == 2 and q.misoriented_edges == 0
    assert result.report.filled_holes == 3 and result.report.holes_left == 0
    assert q.volume == pytest.approx(quality(V, F).volume, rel=0.02)
    assert (result.face_source < 0).sum() == result.report.filling_faces
    assert_sources(result, V, G)


def test_longer_holes_stay_open():
    V, F = sphere()
    G = np.setdiff1d(np.arange(len(F)), [0])
    G = np.intersect1d(G, np.flatnonzero(np.linalg.norm(V[F].mean(axis=1) - V[400], axis=1) > 0.4))
    report = repair(V, F[G], fill_holes=3).report
    assert (report.filled_holes, report.holes_left, report.filling_faces) == (1, 1, 1)
    assert repair(V, F[G]).report.holes_left == 2


def test_a_long_rim_is_closed():
    """Longer than one table holds: a tube of 1,000 edges around, closed at both ends."""
    n = 1000
    a = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    V = np.vstack([ring, ring + np.array([0, 0, 0.5])])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    F = np.vstack([np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)])
    q = quality(*repair(V, F, fill_holes="all"))
    assert q.is_closed and q.volume == pytest.approx(0.5 * np.pi, rel=1e-3)
    assert q.nonmanifold_edges == q.misoriented_edges == 0


def test_a_hole_that_only_existing_edges_could_close_is_left():
    """A tetrahedron without two faces: both diagonals of its loop are edges of it."""
    V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    F = np.array([[0, 2, 1], [0, 1, 3]])  # the edge 01 is inside; 23 is free
    assert quality(*repair(V, F, fill_holes=4)).is_closed
    alone = repair(V, F[:1], fill_holes=4)
    assert len(alone.F) == 1 and alone.report.holes_left == 1


def test_sheets_that_meet_in_an_edge_are_parted_and_stay_closed():
    V, F = two_cubes_on_an_edge()
    assert quality(V, F).nonmanifold_edges == 1
    result = repair(V, F)
    q = quality(*result)
    assert q.is_closed and q.components == 2 and q.nonmanifold_edges == q.nonmanifold_vertices == 0
    assert result.report.split_vertices == 2 and q.volume == pytest.approx(2.0)
    assert_sources(result, V, F)


def test_a_pinched_vertex_is_parted():
    V, F = sphere(1)
    W = np.vstack([V, V[1:] - 2 * V[0]])
    G = np.vstack([F, np.where(F == 0, -1, F + len(V) - 1)])
    G[G == -1] = 0
    W[len(V) :] = 2 * V[0] - V[1:]
    assert quality(W, G).nonmanifold_vertices == 1
    result = repair(W, G)
    assert quality(*result).nonmanifold_vertices == 0 and result.report.split_vertices == 1


def test_small_components_go():
    V, F = sphere()
    W, G = V, F
    for k, level in enumerate((0, 1, 2)):
        W, G = zoo.joined((W, G), sphere(level), shift=4.0 * (k + 1))
    assert quality(W, G).components == 4
    result = repair(W, G, min_component=100)
    assert quality(*result).components == 2
    assert (result.report.removed_components, result.report.removed_faces) == (2, 100)
    largest = repair(W, G, keep_largest=True)
    assert quality(*largest).components == 1 and len(largest.F) == len(F)
    assert largest.report.unused_vertices == len(W) - len(V)


def test_the_largest_is_that_of_the_largest_area():
    V, F = sphere(3)
    W, G = sphere(1)
    both = zoo.joined((V, F), (5 * W, G), shift=20.0)
    assert len(repair(*both, keep_largest=True).F) == len(G)


def test_faces_are_turned_outwards_and_cavities_stay():
    V, F = sphere()
    rng = np.random.default_rng(0)
    mixed = F.copy()
    some = rng.random(len(F)) < 0.3
    mixed[some] = mixed[some][:, ::-1]
    result = repair(V, mixed)
    assert quality(*result).misoriented_edges == 0 and quality(*result).volume > 0
    assert result.report.flipped_faces == some.sum()
    assert_sources(result, V, mixed)
    shell = np.vstack([V, 0.5 * V]), np.vstack([F, F[:, ::-1] + len(V)])
    inside_out = shell[1][:, ::-1]
    expected = quality(*shell).volume
    assert expected == pytest.approx(quality(V, F).volume * 7 / 8)
    result = repair(shell[0], inside_out)
    assert quality(*result).volume == pytest.approx(expected)
    assert result.report.turned_components == 2
    assert_sources(result, shell[0], inside_out)
    assert quality(*repair(shell[0], inside_out, orient=False)).volume == pytest.approx(-expected)


def test_bad_faces_go():
    V, F = sphere(2)
    dirty = np.vstack([F, F[:3], [[0, 0, 1]]])
    report = repair(np.vstack([V, V[:2] + 9]), dirty).report
    assert (report.duplicate_faces, report.degenerate_faces, report.unused_vertices) == (3, 1, 2)


def test_inputs_are_not_modified_and_bits_repeat():
    V, F = sphere()
    soup_V, soup_F = soup_of(V, with_holes(V, F)[:, ::-1])
    before = soup_V.copy(), soup_F.copy()
    one = repair(soup_V, soup_F, fill_holes="all", weld=1e-9)
    two = repair(soup_V, soup_F, fill_holes="all", weld=1e-9)
    assert np.array_equal(soup_V, before[0]) and np.array_equal(soup_F, before[1])
    assert one.V.tobytes() == two.V.tobytes() and one.F.tobytes() == two.F.tobytes()


def test_bad_input():
    V, F = sphere(1)
    for options in (
        {"weld": -1.0}, {"weld": np.nan}, {"weld": True}, {"min_component": -1}, {"min_component": 1.5},
        {"keep_largest": 1}, {"fill_holes": "some"}, {"fill_holes": -1}, {"orient": None},
    ):  # fmt: skip
        with pytest.raises(OptionError, match=next(iter(options))):
            repair(V, F, **options)
    with pytest.raises(MeshInputError, match="largest of 1 components has 80 faces"):
        repair(V, F, min_component=81)
    with pytest.raises(MeshInputError, match="three different corners"):
        repair(V, [[0, 0, 1]])
    V, F = soup_of(V, F)
    with pytest.raises(MeshInputError, match="is weld, a distance"):
        repair(V, F, weld=100.0)
