"""`quality` and `surface_distance` against known answers, libigl, and slow loops."""

import json
import math
import warnings

import igl
import numpy as np
import pytest
from helpers import zoo
from hypothesis import given, settings
from hypothesis import strategies as st

from remeshvec.errors import MeshInputError, OptionError
from remeshvec.measures.distance import surface_distance
from remeshvec.measures.quality import quality
from remeshvec.measures.record import side_by_side

# What other tools were compared on; percent and degrees.
PUBLISHED = {  # E face, E Voronoi, CV, min, p1, mean of min angles, valence 6
    "cat.obj": (15.3, 13.1, 0.116, 33, 43, 53.7, 78),
    "iphi_bad10k.off": (67.7, 56.0, 0.622, 0.3, 3, 25.5, 33),
}


@pytest.fixture(autouse=True)
def _no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def equilateral():
    return zoo.arrays([[0, 0, 0], [1, 0, 0], [0.5, math.sqrt(0.75), 0]], [[0, 1, 2]])


# --- quality -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", zoo.ZOO)
def test_topology_agrees_with_the_slow_twin(name):
    V, F = zoo.ZOO[name].make()
    q = quality(V, F)
    assert q.euler_number == zoo.euler_number(F)
    assert q.components == zoo.components(F)
    assert q.boundary_loops == len(zoo.boundary_loops(F))
    assert q.boundary_edges == sum(map(len, zoo.boundary_loops(F)))
    assert q.nonmanifold_edges == sum(len(users) > 2 for users in zoo.edge_faces(F).values())
    assert q.nonmanifold_vertices == len(zoo.pinched_vertices(F))
    assert q.degenerate_faces == zoo.degenerate_faces(V, F)
    assert q.unreferenced_vertices == zoo.unreferenced(V, F)
    assert q.area == pytest.approx(zoo.area(V, F))
    assert (q.misoriented_edges == 0) == (zoo.is_oriented(F) or q.nonmanifold_edges > 0)
    if zoo.is_closed(F) and zoo.is_oriented(F):
        assert q.is_closed and q.volume == pytest.approx(zoo.volume(V, F))


@pytest.mark.parametrize("name", zoo.ZOO)
def test_every_number_is_finite_and_json_ready(name):
    q = quality(*zoo.ZOO[name].make())
    content = json.loads(json.dumps(q.to_dict(), allow_nan=False))
    assert content["faces"] == q.faces
    assert len(str(q).splitlines()) == len(q.rows())
    assert len(side_by_side(q, q).splitlines()) == len(q.rows()) + 1


def test_equilateral_triangle():
    q = quality(*equilateral())
    assert (q.edge_mean, q.edge_min, q.edge_max) == pytest.approx((1, 1, 1))
    assert q.edge_cv == pytest.approx(0, abs=1e-12) and q.edge_in_band == 1
    assert (q.min_angle, q.min_angle_p1, q.min_angle_mean, q.max_angle) == pytest.approx((60,) * 4)
    assert (q.radius_ratio_min, q.radius_ratio_mean) == pytest.approx((1, 1))
    assert q.area == pytest.approx(math.sqrt(3) / 4)
    assert (q.inner_vertices, q.boundary_vertices, q.valence6_inner) == (0, 3, 0)
    assert (q.area_error_face, q.area_error_voronoi) == pytest.approx((0, 0), abs=1e-12)
    assert q.volume is None and not q.is_closed


def test_right_triangle():
    q = quality([[0, 0, 0], [3, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    assert (q.edge_min, q.edge_mean, q.edge_max) == pytest.approx((3, 4, 5))
    assert q.edge_cv == pytest.approx(math.sqrt(2 / 3) / 4)
    assert q.min_angle == pytest.approx(math.degrees(math.atan2(3, 4)))
    assert q.max_angle == pytest.approx(90)
    assert q.radius_ratio_min == pytest.approx(2 * 1 / 2.5)
    assert q.area == pytest.approx(6)


def test_valences_and_areas_of_known_meshes():
    q = quality(*zoo.icosahedron())
    assert q.valence_histogram == {5: 12} and q.valence6_inner == 0
    q = quality(*zoo.torus())
    assert q.valence_histogram == {6: 128} and q.valence6_inner == 1
    q = quality(*zoo.annulus())
    assert (q.boundary_vertices, q.inner_vertices) == (32, 32)
    assert q.valence4_boundary == 1
    q = quality(*zoo.cube())
    assert q.area == pytest.approx(6) and q.volume == pytest.approx(1)
    assert quality(zoo.cube()[0], zoo.cube()[1][:, ::-1]).volume == pytest.approx(-1)


def test_area_errors_by_hand():
    V, F = zoo.arrays([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-3, 0, 0]], [[0, 1, 2], [0, 2, 3]])
    assert quality(V, F).area_error_face == pytest.approx(0.5)  # areas 1/2 and 3/2
    # both are right-angled at vertex 0: it gets half of each, the others a quarter
    areas = np.array([1 / 4 + 3 / 4, 1 / 8, 1 / 8 + 3 / 8, 3 / 8])
    expected = np.abs(areas - areas.mean()).mean() / areas.mean()
    assert quality(V, F).area_error_voronoi == pytest.approx(expected)


@pytest.mark.parametrize("name", ["icosphere", "planar_delaunay", "bipyramid", "grid", "l_prism"])
def test_shapes_agree_with_libigl(name):
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.1)
    q = quality(V, F)
    angles = np.degrees(igl.internal_angles(V, F))
    assert q.min_angle_mean == pytest.approx(angles.min(axis=1).mean())
    assert q.min_angle_p1 == pytest.approx(np.percentile(angles.min(axis=1), 1))
    assert q.max_angle == pytest.approx(angles.max())
    ratio = 2 * igl.inradius(V, F) / igl.circumradius(V, F)[0]
    assert q.radius_ratio_mean == pytest.approx(ratio.mean())
    areas = igl.massmatrix(V, F, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    error = np.abs(areas - areas.mean()).mean() / areas.mean()
    assert q.area_error_voronoi == pytest.approx(error)
    edges = igl.edges(F)
    lengths = np.linalg.norm(V[edges[:, 0]] - V[edges[:, 1]], axis=1)
    assert q.edge_cv == pytest.approx(lengths.std() / lengths.mean())
    assert q.faces_below_30 == pytest.approx((angles.min(axis=1) < 30).mean())


def test_band_refers_to_the_given_length():
    V, F = zoo.grid()  # edges of length 1 and sqrt 2
    long = quality(V, F).edge_max
    assert quality(V, F, L=1).edge_in_band == pytest.approx(58 / 82)
    assert quality(V, F, L=long).edge_in_band == pytest.approx(24 / 82)
    assert quality(V, F, L=1.2).edge_in_band == 1
    assert quality(V, F, L=0.75).edge_in_band == pytest.approx(58 / 82)  # 4/3 L is in the band
    assert quality(V, F, L=1.25 + 1e-9).edge_in_band == pytest.approx(24 / 82)  # below 4/5 L


def test_dirt_does_not_change_the_rest():
    clean, dirty = quality(*zoo.octahedron()), quality(*zoo.unreferenced_vertices())
    assert dirty.unreferenced_vertices == 3
    assert dirty.to_dict() == {**clean.to_dict(), "unreferenced_vertices": 3}
    clean, dirty = quality(*zoo.square()), quality(*zoo.repeated_index())
    assert dirty.to_dict() == {**clean.to_dict(), "degenerate_faces": 2}


def test_two_cubes_on_one_edge_enclose_a_volume():
    q = quality(*zoo.two_cubes_on_an_edge())
    assert q.is_closed and q.volume == pytest.approx(2)
    assert (q.nonmanifold_edges, q.vertices, q.inner_vertices) == (1, 14, 12)


def test_flat_faces_count_as_bad_ones():
    q = quality(*zoo.flat_cap())
    assert (q.min_angle, q.max_angle, q.radius_ratio_min) == pytest.approx((0, 180, 0), abs=1e-9)
    q = quality(*zoo.coincident_vertices())
    assert (q.edge_min, q.min_angle, q.max_angle) == pytest.approx((0, 0, 90))
    assert math.isfinite(q.area_error_voronoi)


def test_all_faces_degenerate():
    q = quality([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    assert (q.degenerate_faces, q.area, q.area_error_face, q.max_angle) == (1, 0, 0, 180)
    q = quality(np.zeros((3, 3)), [[0, 1, 2]])
    assert (q.edge_max, q.edge_cv, q.area) == (0, 0, 0)
    q = quality([[0, 0, 0], [1, 0, 0]], [[0, 1, 1]])
    assert (q.faces, q.vertices, q.degenerate_faces, q.components) == (0, 0, 1, 0)


@pytest.mark.parametrize("factor", [1e-150, 1e-6, 1e6, 1e150])
def test_scale_does_not_matter(factor):
    V, F = zoo.perturb(*zoo.icosphere())
    one, other = quality(V, F), quality(zoo.scale(V, factor), F)
    for name in ("edge_cv", "min_angle", "radius_ratio_mean", "area_error_voronoi", "edge_in_band"):
        assert getattr(other, name) == pytest.approx(getattr(one, name))
    assert other.edge_mean == pytest.approx(factor * one.edge_mean)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(zoo.TIDY))
def test_rotation_translation_and_order_do_not_matter(seed, name):
    rng = np.random.default_rng(seed)
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.1, seed=seed)
    order, place = rng.permutation(len(F)), rng.permutation(len(V))
    moved = np.empty_like(V)
    moved[place] = zoo.translate(zoo.rotate(V, rng.normal(size=3)))
    one, other = quality(V, F).to_dict(), quality(moved, place[F[order]]).to_dict()
    for key, value in one.items():
        if key == "valence_histogram" or value is None:
            assert other[key] == value
        else:
            assert other[key] == pytest.approx(value, rel=1e-6, abs=1e-6), key


def test_accepts_any_arrays_and_leaves_them_alone():
    V, F = zoo.torus()
    expected = quality(V, F)
    assert quality(V.tolist(), F.tolist()) == expected
    assert quality(np.asfortranarray(V), np.asfortranarray(F.astype(np.uint16))) == expected
    V.flags.writeable = F.flags.writeable = False
    assert quality(V, F.astype(np.int32)) == expected
    assert quality(V.astype(np.float32), F).edge_mean == pytest.approx(expected.edge_mean)


@pytest.mark.parametrize(
    ("V", "F"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]]),
        (np.zeros((3, 3)), [[0, 1, 2, 0]]),
        (np.eye(3), [[0, 1, 3]]),
        (np.eye(3), [[0, 1, -1]]),
        ([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]]),
        (np.eye(3), np.zeros((0, 3), dtype=int)),
    ],
)
def test_refuses_what_is_no_mesh(V, F):
    with pytest.raises(MeshInputError):
        quality(V, F)
    with pytest.raises(MeshInputError):
        surface_distance(*equilateral(), V, F)


@pytest.mark.parametrize("L", [0, -1, math.nan, math.inf])
def test_refuses_a_length_that_is_none(L):
    with pytest.raises(OptionError):
        quality(*equilateral(), L=L)


@pytest.mark.parametrize("name", PUBLISHED)
def test_reproduces_the_published_input_figures(name):
    q = quality(*zoo.sample(name))
    face, voronoi, cv, smallest, p1, mean, six = PUBLISHED[name]
    assert 100 * q.area_error_face == pytest.approx(face, abs=0.06)
    assert 100 * q.area_error_voronoi == pytest.approx(voronoi, abs=0.06)
    assert q.edge_cv == pytest.approx(cv, abs=6e-4)
    assert q.min_angle == pytest.approx(smallest, abs=0.5)
    assert q.min_angle_p1 == pytest.approx(p1, abs=0.5)
    assert q.min_angle_mean == pytest.approx(mean, abs=0.06)
    assert 100 * q.valence6_inner == pytest.approx(six, abs=0.6)


def test_cow_has_a_pinched_vertex():
    q = quality(*zoo.sample("cow.obj"))
    assert (q.nonmanifold_vertices, q.nonmanifold_edges, q.boundary_loops) == (1, 0, 0)


# --- surface distance ----------------------------------------------------------------------------


def test_same_surface_is_at_no_distance():
    V, F = zoo.icosphere()
    d = surface_distance(V, F, *igl.upsample(V, F))
    assert d.hausdorff < 1e-12 and d.rms < 1e-12
    assert d.diagonal == pytest.approx(np.linalg.norm(np.ptp(V, axis=0)))


def test_parallel_planes():
    V, F = zoo.grid(5, 4)
    d = surface_distance(V, F, zoo.translate(V, (0, 0, 0.25)), F)
    figures = (d.max_1_to_2, d.max_2_to_1, d.rms_1_to_2, d.rms_2_to_1, d.hausdorff, d.rms, d.mean)
    assert figures == pytest.approx((0.25,) * 7)
    assert d.diagonal == 5
    assert (d.hausdorff_relative, d.rms_relative) == pytest.approx((0.05, 0.05))


def test_tilted_plane_integrates_over_the_area():
    """Unit squares, hinged at x = 0: the distance to the lower plane is x sin(tilt)."""
    V, F = zoo.grid(9, 9)
    V = (V / 8) ** [3, 1, 1]  # most faces are narrow ones near the hinge
    sine, cosine = 0.28, 0.96
    tilted = np.column_stack([cosine * V[:, 0], V[:, 1], sine * V[:, 0]])
    d = surface_distance(tilted, F, *zoo.square())
    assert d.max_1_to_2 == pytest.approx(sine)
    assert d.mean_1_to_2 == pytest.approx(sine / 2, rel=1e-3)
    assert d.rms_1_to_2 == pytest.approx(sine / math.sqrt(3), rel=1e-3)


def test_sphere_offset():
    V, F = zoo.icosphere(4)
    d = surface_distance(V, F, 1.1 * V, F)
    assert d.max_1_to_2 == pytest.approx(0.1, rel=0.02)
    assert d.rms_2_to_1 == pytest.approx(0.1, rel=0.02)


def test_shifted_cube():
    V, F = zoo.cube()
    d = surface_distance(V, F, zoo.translate(V, (0.5, 0, 0)), F)
    # the left square is half a unit off; so is the middle of the right one, inside the other cube
    assert d.hausdorff == d.max_1_to_2 == pytest.approx(0.5)
    assert d.max_2_to_1 == pytest.approx(0.5)
    assert d.hausdorff_relative == pytest.approx(0.5 / math.sqrt(3))


def test_a_part_is_near_the_whole_but_not_the_reverse():
    V, F = zoo.grid(9, 3, seed=1)
    part = F[(V[F][:, :, 0] <= 2).all(axis=1)]
    d = surface_distance(V, part, V, F)
    assert d.max_1_to_2 < 1e-12
    assert d.max_2_to_1 == d.hausdorff == pytest.approx(6)
    assert (d.rms, d.mean) == (d.rms_2_to_1, d.mean_2_to_1)
    assert d.mean_2_to_1 == pytest.approx(6 * 6 / 2 / 8, rel=1e-3)
    assert d.diagonal == pytest.approx(math.hypot(2, 2))  # of the part: other vertices are unused


def test_unreferenced_vertices_are_no_samples():
    d = surface_distance(*zoo.unreferenced_vertices(), *zoo.octahedron())
    assert d.hausdorff < 1e-12
    assert d.diagonal == pytest.approx(math.sqrt(12))


def test_samples_between_vertices_count():
    """A tent over a flat square whose vertices all lie on the square."""
    V, F = zoo.square()
    tent = zoo.arrays([*V, [0.5, 0.5, 0.3]], [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    d = surface_distance(V, F, *tent)
    # from the middle of the square to the slanted faces: less than the tent is high
    assert 0.25 < d.max_1_to_2 < 0.3
    assert d.max_2_to_1 == pytest.approx(0.3)


def test_more_samples_raise_the_lower_bound_towards_the_truth():
    V, F = zoo.square()
    tent = zoo.arrays([*V, [0.5, 0.5, 0.3]], [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    true = 0.5 * 0.3 / math.hypot(0.5, 0.3)
    found = [surface_distance(V, F, *tent, samples=n).max_1_to_2 for n in (10, 1000, 100_000)]
    assert max(found) <= true + 1e-12
    assert found[2] == pytest.approx(true, rel=0.01)
    assert found[0] <= found[2]


def test_distance_is_deterministic_and_leaves_the_random_state_alone():
    V, F = zoo.torus()
    V2, F2 = zoo.perturb(V, F)
    state = np.random.get_state()[1].copy()  # noqa: NPY002 (it is the global one that matters)
    assert surface_distance(V, F, V2, F2) == surface_distance(V, F, V2, F2)
    assert np.array_equal(state, np.random.get_state()[1])  # noqa: NPY002
    json.dumps(surface_distance(V, F, V2, F2).to_dict(), allow_nan=False)


def test_a_surface_without_area_has_its_vertices():
    line = zoo.arrays([[0, 0, 1], [1, 0, 1], [2, 0, 1]], [[0, 1, 2]])
    d = surface_distance(*line, *zoo.grid())
    assert d.rms_1_to_2 == pytest.approx(1)


def test_refuses_no_samples():
    with pytest.raises(OptionError):
        surface_distance(*equilateral(), *equilateral(), samples=0)
