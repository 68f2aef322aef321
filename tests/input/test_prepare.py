"""From the caller's arrays to a clean mesh: dirt found and named, windings, the frame."""

import numpy as np
import pytest
from helpers import zoo
from helpers.structure import assert_same_bits, assert_valid, faces_of, shape_of
from helpers.threads import on_threads, shuffled

from data.shapes import nonmanifold
from remeshvec import MeshInputError
from remeshvec.core.compiler import kernel
from remeshvec.input.prepare import Kept, prepare
from remeshvec.mesh import morton
from remeshvec.mesh.repair import (
    _WEIGHTS,
    drop_degenerate_faces,
    drop_duplicate_faces,
    weld_vertices,
)
from remeshvec.sizing.target_lengths import mesh_size


def prepared(V, F):
    result = prepare(np.asarray(V, float), np.asarray(F, np.int64), False)
    assert not result.mesh.X[:, 3].any()
    result.mesh.X[:, 3] = 1.0  # target lengths come later
    return result


def in_input_frame(result):
    return result.mesh.X[:, :3] / result.scale + result.centre


@pytest.mark.parametrize("name", zoo.TIDY)
def test_tidy_meshes_pass_unchanged(name):
    V, F = zoo.ZOO[name].make()
    result = prepared(V, F)
    assert result.dirt == {}
    assert_valid(result.mesh)
    assert shape_of(faces_of(result.mesh)) == shape_of(F)
    assert_in_place(result, V, F)
    assert result.representative is None and result.flipped is None


def assert_in_place(result, V, F):
    """Face by face and corner by corner, bit by bit; flipped faces have corners 1 and 2 swapped."""
    if result.flipped is not None:
        assert result.flipped.shape == (len(F),) and result.flipped.any()
        F = np.where(result.flipped[:, None], F[:, [0, 2, 1]], F)
    F = F[result.face_source]
    assert np.array_equal(in_input_frame(result)[faces_of(result.mesh)], V[F])
    same = np.arange(len(V)) if result.representative is None else result.representative
    assert np.array_equal(result.vertex_source[faces_of(result.mesh)], same[F])


DIRT = {
    "moebius": {"flipped_faces", "inconsistent_edges"},
    "inconsistent_winding": {"flipped_faces"},
    "bowtie": {"pinched_vertices"},
    "pinched_tetrahedra": {"pinched_vertices"},
    "three_half_discs": {"non_manifold_edges"},
    "two_cubes_on_an_edge": {"non_manifold_edges"},
    "duplicate_face": {"duplicate_faces"},
    "repeated_index": {"degenerate_faces"},
    "unreferenced_vertices": {"unreferenced_vertices"},
    "flat_cap": {"flat_faces"},
    "coincident_vertices": {"short_edges", "collapsed_faces", "unreferenced_vertices"},
}


@pytest.mark.parametrize("name", zoo.DIRTY)
def test_dirt_is_found_and_named(name):
    V, F = zoo.ZOO[name].make()
    result = prepared(V, F)
    assert set(result.dirt) == DIRT[name]
    assert all(type(count) is int and count > 0 for count in result.dirt.values())
    assert_valid(result.mesh, slits=True)
    if result.cuts is None:
        assert_in_place(result, V, F)
    assert (result.flipped is not None) == ("flipped_faces" in result.dirt)


def test_counts_of_dirt():
    V, F = zoo.unreferenced_vertices()
    assert prepared(V, F).dirt == {"unreferenced_vertices": 3}
    V, F = zoo.repeated_index()
    assert prepared(V, F).dirt == {"degenerate_faces": 2}
    V, F = zoo.torus()
    assert prepared(V, np.vstack([F, F[:5], F[3:4, [1, 2, 0]]])).dirt == {"duplicate_faces": 6}
    assert prepared(*zoo.three_half_discs()).dirt["non_manifold_edges"] == 2


def test_seams_are_not_counted_as_pinched_but_other_vertices_are():
    V, F = zoo.joined(zoo.three_half_discs(), zoo.bowtie(), shift=5.0)
    assert prepared(V, F).dirt == {"non_manifold_edges": 2, "pinched_vertices": 1}
    V, F = zoo.joined(zoo.moebius(), zoo.pinched_tetrahedra(), shift=5.0)
    assert prepared(V, F).dirt["pinched_vertices"] == 1
    V, F = nonmanifold.COMPLEXES["three_planes"].make()
    assert set(prepared(V, F).dirt) == {"non_manifold_edges"}


def test_faces_without_area_that_stay_are_counted():
    V, F = zoo.flat_cap()
    kept = Kept(np.ones(len(V), bool), np.ones(len(F), bool))
    result = prepare(V, F, False, lambda: kept)
    mesh_size(result)
    assert result.dirt == {"zero_area_faces": 1}


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


def test_only_candidates_are_compared():
    F = np.array([[0, 1, 2], [2, 1, 0], [3, 4, 5], [4, 5, 3], [1, 2, 0]], np.int32)
    assert drop_duplicate_faces(F).tolist() == [0, 2]
    assert drop_duplicate_faces(F, np.array([4, 1, 0])).tolist() == [0, 2, 3]
    assert drop_duplicate_faces(F, np.array([0, 2])) is None


def test_points_that_look_alike_are_not_welded():
    """Points are compared by one sum of their coordinates first."""
    V = np.array([[_WEIGHTS[0], 0, 0], [0, 1.0, 0], [_WEIGHTS[0], 0, 0], [0, 1.0, 0], [0, -0.0, 1]])
    assert weld_vertices(V, np.arange(5)).tolist() == [0, 1, 0, 1, 4]
    assert weld_vertices(V, np.array([0, 1, 4])) is None
    assert weld_vertices(V, np.array([3, 2, 1])).tolist() == [0, 3, 2, 3, 4]
    V = np.random.default_rng(0).integers(0, 3, (200, 3)).astype(float)
    V[V == 0] *= np.random.default_rng(1).choice([-1, 1], (V == 0).sum())
    first = {}
    expected = [first.setdefault(tuple(p), k) for k, p in enumerate(V.tolist())]
    assert weld_vertices(V, np.arange(200)).tolist() == expected


def some_turned(F, share, seed=0):
    """Faces, a share of them with corners 1 and 2 swapped, and which."""
    which = np.random.default_rng(seed).random(len(F)) < share
    return np.where(which[:, None], F[:, [0, 2, 1]], F), which


def dirty_meshes():
    """Many kinds of dirt at once."""
    rng = np.random.default_rng(0)
    shapes = {
        "torus": zoo.torus(24, 12),
        "annulus": zoo.annulus(24, 6),
        "moebius": zoo.moebius(30, 6),
        "sheet": zoo.thin_sheet(),
        "discs": nonmanifold.half_discs(),
        "book": nonmanifold.book(),
        "bubbles": nonmanifold.double_bubble(20, 8),
    }
    for name, (V, F) in shapes.items():
        yield f"{name} turned", V, some_turned(F, 0.3)[0]
        yield f"{name} soup", V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)
        again = rng.integers(0, len(F), 20)
        yield f"{name} twice", V, rng.permutation(np.vstack([F, F[again][:, ::-1], F[again]]))
        G = F.copy()
        G[again, rng.integers(0, 3, 20)] = rng.integers(0, len(V), 20)
        yield f"{name} tangled", np.vstack([V, [[np.nan, 0, 0]]]), rng.permutation(G)
        yield f"{name} in parts", V, F[rng.random(len(F)) < 0.5]


DIRTY = list(dirty_meshes())


@pytest.mark.parametrize(("name", "V", "F"), DIRTY, ids=[name for name, _, _ in DIRTY])
def test_threads_give_the_same_bits(name, V, F):
    one = prepare(V, F, False)
    with on_threads(3):
        others = [prepare(V, F, True)]
    with on_threads(3), shuffled():
        others.append(prepare(V, F, True))
    for other in others:
        assert_same_bits(one.mesh, other.mesh)
        for x, y in zip(one[1:5], other[1:5], strict=True):
            assert (x is None) == (y is None) and (x is None or np.array_equal(x, y))
        assert one.dirt == other.dirt and list(one.dirt) == list(other.dirt)
    one.mesh.X[:, 3] = 1.0
    assert_valid(one.mesh, slits=True)
    assert_in_place(one, V, F)


def test_any_array_will_do():
    """Read-only ones, and faces of 32 bits, are neither changed nor compiled for."""
    V, F = zoo.torus()
    one = prepare(V, F, False)
    kernels = [one for one in vars(morton).values() if isinstance(one, kernel)]
    before = [len(one.compiled.signatures) for one in kernels if one is not morton._survey]
    for dtype in (np.int32, np.int64):
        fixed = V.copy(), F.astype(dtype)
        for array in fixed:
            array.setflags(write=False)
        assert_same_bits(prepare(*fixed, False).mesh, one.mesh)
    after = [len(one.compiled.signatures) for one in kernels if one is not morton._survey]
    assert before == after


# --- windings ------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.02, 0.3])
@pytest.mark.parametrize("name", ["icosphere", "genus_2", "annulus", "planar_delaunay"])
def test_faces_take_the_winding_of_their_neighbours(name, share):
    V, F = zoo.ZOO[name].make()
    G, which = some_turned(F, share)
    result = prepared(V, G)
    assert result.dirt == {"flipped_faces": which.sum()}
    assert np.array_equal(result.flipped, which)
    assert_in_place(result, V, G)
    assert shape_of(faces_of(result.mesh)) == shape_of(F)
    assert_valid(result.mesh)


def test_the_majority_keeps_its_winding_even_where_volumes_are_negative():
    V, F = zoo.icosphere(1)
    G, which = some_turned(F[:, ::-1], 0.2)
    result = prepared(V, G)
    assert np.array_equal(result.flipped, which)
    assert zoo.volume(result.mesh.X[:, :3], faces_of(result.mesh)) < 0


def test_windings_count_faces_of_the_input():
    """Also behind faces that are dropped first."""
    V, F = zoo.torus()
    F = np.vstack([[[0, 0, 1], [3, 3, 3]], F[:5], F[:2], F[5:]])
    turned = [10, 11, 40]
    F[turned] = F[turned][:, [0, 2, 1]]
    result = prepared(V, F)
    assert result.dirt == {"degenerate_faces": 2, "duplicate_faces": 2, "flipped_faces": 3}
    assert np.flatnonzero(result.flipped).tolist() == turned
    assert_in_place(result, V, F)


def test_a_moebius_strip_is_cut_where_its_windings_meet():
    V, F = zoo.moebius()
    G, _ = some_turned(F, 0.4)
    ways = [prepared(V, faces) for faces in (F, G)]
    # One line across the strip of four vertices, or all around it; the same whatever was turned.
    cuts = [result.dirt["inconsistent_edges"] for result in ways]
    assert cuts[0] == cuts[1] and cuts[0] in (3, 20)
    for result, faces in zip(ways, (F, G), strict=True):
        assert_valid(result.mesh, slits=True)
        assert_in_place(result, V, faces)
        assert zoo.is_oriented(faces_of(result.mesh))


@pytest.mark.parametrize("name", ["book", "wall_inside", "three_planes", "double_bubble"])
def test_sheets_are_oriented_each_by_itself(name):
    """Edges of three faces and more join no windings: every sheet keeps that of its majority."""
    V, F = nonmanifold.COMPLEXES[name].make()
    tidy = prepared(V, F)
    assert tidy.flipped is None
    G, which = some_turned(F, 0.1)
    result = prepared(V, G)
    assert result.dirt["flipped_faces"] == which.sum() and np.array_equal(result.flipped, which)
    assert result.dirt["non_manifold_edges"] == tidy.dirt["non_manifold_edges"]
    assert "inconsistent_edges" not in result.dirt
    assert_in_place(result, V, G)
    assert zoo.components(faces_of(result.mesh)) == len(nonmanifold.COMPLEXES[name].euler_numbers)


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
        mesh_size(prepared([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]))
