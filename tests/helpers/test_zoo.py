"""The zoo is what it says, and its slow topology agrees with libigl and notices a broken mesh."""

import igl
import numpy as np
import pytest

from helpers import zoo


@pytest.mark.parametrize("name", zoo.ZOO)
def test_shape_is_what_the_registry_says(name):
    shape = zoo.ZOO[name]
    V, F = shape.make()
    assert V.dtype == np.float64 and V.shape[1:] == (3,)
    assert F.dtype == np.int64 and F.shape[1:] == (3,)
    assert zoo.euler_number(F) == shape.euler
    assert len(zoo.boundary_loops(F)) == shape.loops
    assert zoo.components(F) == shape.components
    assert zoo.is_edge_manifold(F) == shape.edge_manifold
    assert zoo.is_vertex_manifold(F) == shape.vertex_manifold
    assert zoo.is_oriented(F) == shape.oriented
    dirt = zoo.degenerate_faces(V, F) + zoo.duplicate_faces(F) + zoo.unreferenced(V, F)
    assert (dirt == 0) == shape.clean


@pytest.mark.parametrize("name", zoo.TIDY)
def test_tidy_shapes_agree_with_libigl(name):
    V, F = zoo.ZOO[name].make()
    assert igl.is_edge_manifold(F) and igl.is_vertex_manifold(F).all()
    assert igl.euler_characteristic(F) == zoo.euler_number(F)
    assert zoo.area(V, F) == pytest.approx(igl.doublearea(V, F).sum() / 2)
    if zoo.is_closed(F):
        assert zoo.volume(V, F) > 0


def test_every_boundary_edge_is_in_one_loop():
    _, F = zoo.annulus()
    loops = zoo.boundary_loops(F)
    edges = [edge for loop in loops for edge in loop]
    assert sorted(map(len, loops)) == [16, 16]
    assert set(edges) == {tuple(sorted(e)) for e in igl.boundary_facets(F)[0].tolist()}


def test_known_sizes():
    assert zoo.volume(*zoo.cube()) == pytest.approx(1)
    assert zoo.area(*zoo.l_prism()) == pytest.approx(2 * 3 + 8 * 1.5)
    assert zoo.volume(*zoo.l_prism()) == pytest.approx(4.5)
    assert zoo.area(*zoo.planar_delaunay()) == pytest.approx(1)
    assert zoo.volume(*zoo.icosphere(3)) == pytest.approx(4 / 3 * np.pi, rel=0.02)
    assert zoo.volume(*zoo.torus(64, 32)) == pytest.approx(2 * np.pi**2 * 0.16, rel=0.02)


def test_changes_are_seeded_and_leave_the_input_alone():
    V, F = zoo.grid()
    before = V.copy(), F.copy()
    for change in (zoo.perturb, zoo.upsampled):
        one, two, other = change(V, F, seed=1), change(V, F, seed=1), change(V, F, seed=2)
        assert np.array_equal(one[0], two[0]) and not np.array_equal(one[0], other[0])
    assert np.array_equal(V, before[0]) and np.array_equal(F, before[1])


def test_upsampled_stays_on_a_plane_and_inside_its_rim():
    V, F = zoo.upsampled(*zoo.grid(), n=2)
    assert len(F) == 16 * len(zoo.grid()[1])
    assert np.abs(V[:, 2]).max() < 1e-12
    assert zoo.area(V, F) == pytest.approx(24)
    assert np.ptp(V[:, :2], axis=0) == pytest.approx([6, 4])


def test_moves_keep_lengths():
    V, F = zoo.torus()
    assert zoo.area(zoo.rotate(V), F) == pytest.approx(zoo.area(V, F))
    assert zoo.area(zoo.translate(V), F) == pytest.approx(zoo.area(V, F))
    assert zoo.volume(zoo.scale(V, 2), F) == pytest.approx(8 * zoo.volume(V, F))
    assert not np.allclose(zoo.rotate(V), V)
