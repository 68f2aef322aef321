"""From the caller's arrays to a clean mesh: dirt found and named, the frame, the length."""

import numpy as np
import pytest
import zoo
from structure import assert_valid, faces_of, shape_of

from remeshvec import MeshInputError, OptionError
from remeshvec._types import FIXED, NONE
from remeshvec.clean import drop_degenerate_faces, drop_duplicate_faces, weld_vertices
from remeshvec.prepare import build_reference, choose_length, prepare


def prepared(V, F):
    return prepare(np.asarray(V, float), np.asarray(F, np.int64), False)


def in_input_frame(result):
    return result.mesh.X[:, :3] / result.scale + result.centre


@pytest.mark.parametrize("name", zoo.TIDY)
def test_tidy_meshes_pass_unchanged(name):
    V, F = zoo.ZOO[name].make()
    result = prepared(V, F)
    assert result.dirt == {}
    assert_valid(result.mesh)
    assert shape_of(faces_of(result.mesh)) == shape_of(F)
    # Face by face and corner by corner, bit by bit.
    assert np.array_equal(in_input_frame(result)[faces_of(result.mesh)], V[F[result.face_source]])


DIRT = {
    "moebius": {"inconsistent_edges", "pinched_vertices"},
    "inconsistent_winding": {"inconsistent_edges", "pinched_vertices"},
    "bowtie": {"pinched_vertices"},
    "pinched_tetrahedra": {"pinched_vertices"},
    "three_half_discs": {"non_manifold_edges", "pinched_vertices"},
    "two_cubes_on_an_edge": {"non_manifold_edges", "pinched_vertices"},
    "duplicate_face": {"duplicate_faces"},
    "repeated_index": {"degenerate_faces"},
    "unreferenced_vertices": {"unreferenced_vertices"},
    "flat_cap": set(),
    "coincident_vertices": set(),
}


@pytest.mark.parametrize("name", zoo.DIRTY)
def test_dirt_is_found_and_named(name):
    V, F = zoo.ZOO[name].make()
    result = prepared(V, F)
    assert set(result.dirt) == DIRT[name]
    assert all(type(count) is int and count > 0 for count in result.dirt.values())
    assert_valid(result.mesh, slits=True)
    corners = in_input_frame(result)[faces_of(result.mesh)]
    assert np.array_equal(corners, V[F[result.face_source]])


def test_counts_of_dirt():
    V, F = zoo.unreferenced_vertices()
    assert prepared(V, F).dirt == {"unreferenced_vertices": 3}
    V, F = zoo.repeated_index()
    assert prepared(V, F).dirt == {"degenerate_faces": 2}
    V, F = zoo.torus()
    assert prepared(V, np.vstack([F, F[:5], F[3:4, [1, 2, 0]]])).dirt == {"duplicate_faces": 6}
    assert prepared(*zoo.three_half_discs()).dirt["non_manifold_edges"] == 2


@pytest.mark.parametrize("name", ["flat_cap", "coincident_vertices"])
def test_faces_without_area_are_counted(name):
    V, F = zoo.ZOO[name].make()
    result = prepared(V, F)
    choose_length(result, None, 10**6)
    flat = sum(np.linalg.norm(np.cross(V[b] - V[a], V[c] - V[a])) == 0 for a, b, c in F)
    assert result.dirt == {"zero_area_faces": flat}


def test_duplicates_with_opposite_winding():
    """A closed pillow of two faces: an edge map is content with it."""
    V, F = zoo.square()
    pillow = np.vstack([F[:1], F[:1, ::-1]])
    result = prepared(V, pillow)
    assert result.dirt["duplicate_faces"] == 1
    assert len(faces_of(result.mesh)) == 1
    result = prepared(V, np.vstack([F, F[:1, ::-1]]))
    assert result.dirt["duplicate_faces"] == 1 and len(faces_of(result.mesh)) == 2


def test_welding_joins_a_soup():
    V, F = zoo.icosphere()
    soup, faces = V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)
    result = prepared(soup, faces)
    assert result.dirt == {"welded_vertices": 3 * len(F) - len(V)}
    assert shape_of(faces_of(result.mesh)) == shape_of(F)


def test_closed_parts_that_touch_stay_apart():
    V, F = zoo.joined(zoo.cube(), zoo.cube(), shift=1.0)  # four places in common
    result = prepared(V, F)
    assert result.dirt == {}
    assert zoo.components(faces_of(result.mesh)) == 2


def test_welding_a_seam():
    """Cylinder cut along a line, as texture seams leave it."""
    V, F = zoo.cylinder()
    seam = np.flatnonzero(np.isclose(V[:, 1], 0) & (V[:, 0] > 0))
    far = (V[F, 1] < -1e-9).any(axis=1)[:, None] & np.isin(F, seam)
    new = np.full(len(V), -1)
    new[seam] = len(V) + np.arange(len(seam))
    cut, W = np.where(far, new[F], F), np.vstack([V, V[seam]])
    assert len(zoo.boundary_loops(cut)) == 1
    result = prepared(W, cut)
    assert result.dirt == {"welded_vertices": len(seam)}
    assert len(zoo.boundary_loops(faces_of(result.mesh))) == 2


def test_cleaning_by_hand():
    F = np.array([[0, 1, 2], [1, 1, 2], [2, 0, 1], [0, 2, 1], [3, 4, 5], [6, 7, 6]], np.int32)
    assert drop_degenerate_faces(F).tolist() == [0, 2, 3, 4]
    assert drop_duplicate_faces(F[[0, 2, 3, 4]]).tolist() == [0, 3]
    assert drop_degenerate_faces(F[:1]) is None and drop_duplicate_faces(F[:1]) is None
    V = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0.0]])
    target = weld_vertices(V, np.array([1, 2, 3, 4]))
    assert target.tolist() == [0, 1, 2, 1, 2]
    assert weld_vertices(V, np.array([0, 1])) is None


# --- frame ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("factor", [1e-30, 1e-3, 1.0, 7.0, 1e30, 1e-150, 1e150])
def test_the_frame_has_an_extent_of_one_to_two(factor):
    V, F = zoo.torus()
    result = prepared(V * factor, F)
    extent = np.ptp(result.mesh.X[:, :3], axis=0).max()
    assert 1 <= extent < 2
    assert np.log2(result.scale) % 1 == 0
    assert not result.centre.any()
    assert np.array_equal(
        in_input_frame(result)[faces_of(result.mesh)], (V * factor)[F[result.face_source]]
    )


def test_far_from_the_origin_the_frame_is_centred():
    V, F = zoo.torus()
    result = prepared(zoo.translate(V, (1e6, 0, -1e6)), F)
    assert np.abs(result.mesh.X[:, :3]).max() < 2
    assert result.centre == pytest.approx([1e6, 0, -1e6], abs=2)


def test_unreferenced_vertices_do_not_set_the_frame():
    V, F = zoo.unreferenced_vertices()
    V[0] = [np.nan, np.inf, 1e300]
    result = prepared(V, F)
    assert 1 <= np.ptp(result.mesh.X[:, :3], axis=0).max() < 2
    assert np.isfinite(result.mesh.X).all()


def test_no_surface():
    with pytest.raises(MeshInputError, match="no face of F has three different corners"):
        prepared(np.eye(3), [[0, 0, 1], [2, 2, 2]])
    with pytest.raises(MeshInputError, match="one place"):
        prepared(np.ones((3, 3)), [[0, 1, 2]])
    with pytest.raises(MeshInputError, match="no area"):
        choose_length(prepared([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]), None, 100)


# --- length --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["torus", "grid", "cylinder"])
def test_default_length_is_nine_tenths_of_the_mean_edge(name):
    import igl

    V, F = zoo.ZOO[name].make()
    result = prepared(1000 * V, F)
    edges = igl.edges(F)
    mean = np.linalg.norm(V[edges[:, 0]] - V[edges[:, 1]], axis=1).mean()
    assert choose_length(result, None, 10**6) / result.scale == pytest.approx(900 * mean)
    assert choose_length(result, 3.0, 10**8) / result.scale == pytest.approx(3.0)


def test_too_many_faces_are_refused_with_the_numbers():
    result = prepared(*zoo.grid())  # area 24
    with pytest.raises(
        OptionError, match=r"L = 0.001 .* 5.54e\+07 faces.*max_faces = 1,000.*mean edge"
    ):
        choose_length(result, 1e-3, 1000)
    length = choose_length(result, 1.0, 56)  # 24 / (sqrt(3) / 4) = 55.4
    assert length == result.scale
    with pytest.raises(OptionError):
        choose_length(result, 1.0, 55)


def test_lengths_below_the_precision_are_refused():
    result = prepared(zoo.grid()[0] + 1e13, zoo.grid()[1])
    with pytest.raises(OptionError, match="precision"):
        choose_length(result, 0.1, 10**9)


# --- reference -----------------------------------------------------------------------------------


def test_reference_is_a_copy_and_fixes_corners():
    result = prepared(*zoo.grid())
    reference = build_reference(result.mesh, 0.2, False)
    fixed = result.mesh.kind == FIXED
    corners = in_input_frame(result)[fixed, :2]
    assert sorted(map(tuple, corners.tolist())) == [(0, 0), (0, 4), (6, 0), (6, 4)]
    result.mesh.X[:] = 0
    result.mesh.origin[:] = 0
    assert reference.X.any() and reference.origin.any()


def test_births_start_at_home():
    result = prepared(*zoo.annulus())
    mesh = result.mesh
    assert np.array_equal(mesh.origin[mesh.birth], np.arange(len(mesh.X)))
    rim = mesh.twin[mesh.vertex_halfedge] == NONE
    assert (mesh.twin[mesh.birth[rim]] == NONE).all()
