"""One surface in parts: what must hold of the result, whatever the parts."""

from __future__ import annotations

import numpy as np
import pytest
from large.conftest import MESHES, PART

from remeshvec import find_creases, quality, remesh, remesh_large


def born_at(case):
    corners = case.V[case.F[case.result.birth_face]]
    return (corners * case.result.birth_barycentric[:, :, None]).sum(axis=1)


@pytest.mark.parametrize("name", MESHES)
def test_nothing_shows_where_the_cuts_were(large, name):
    """Shape is that of the input, quality that of one call."""
    case = large(name)
    assert case.result.report["rounds"][0]["parts"] > 1
    ours = quality(case.result.V, case.result.F, case.L)
    call = remesh(case.V, case.F, case.L)
    theirs = quality(call.V, call.F, case.L)
    for measure in ("euler_number", "components", "boundary_loops", "nonmanifold_edges"):
        assert getattr(ours, measure) == getattr(theirs, measure), measure
    assert ours.nonmanifold_vertices == ours.degenerate_faces == 0
    assert ours.area == pytest.approx(theirs.area, rel=1e-3)
    assert ours.faces == pytest.approx(theirs.faces, rel=0.02)
    assert ours.area_error_face < theirs.area_error_face + 0.0015
    assert ours.valence6_inner > theirs.valence6_inner - 0.005
    assert ours.min_angle > min(38.0, theirs.min_angle - 1.0)


@pytest.mark.parametrize("name", MESHES)
def test_vertices_lie_on_the_input_where_their_births_say(large, name):
    case = large(name)
    assert np.abs(born_at(case) - case.result.V).max() < 1e-9 * case.L
    weights = case.result.birth_barycentric
    assert weights.min() > -1e-9
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)


def test_creases_and_corners_of_a_box_stay(large):
    case = large("box")
    V, F = map(np.asarray, case.result)
    creases = find_creases(V, F, case.L, feature_angle=40.0)
    length = np.linalg.norm(V[creases[:, 0]] - V[creases[:, 1]], axis=1)
    assert length.sum() == pytest.approx(12.0, abs=1e-9)
    corners = np.array(np.meshgrid(*[[0.0, 1.0]] * 3)).reshape(3, -1).T
    assert (np.abs(corners[:, None] - V).max(axis=2).min(axis=1) == 0.0).all()
    assert quality(V, F).volume == pytest.approx(1.0, abs=1e-9)


def test_boundaries_keep_their_length(large):
    case = large("open_pair")
    assert boundary_length(*case.result) == pytest.approx(boundary_length(case.V, case.F), rel=1e-3)


def boundary_length(V, F):
    ends = np.sort(np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1)
    edges, uses = np.unique(ends, axis=0, return_counts=True)
    a, b = edges[uses == 1].T
    return np.linalg.norm(np.asarray(V)[a] - np.asarray(V)[b], axis=1).sum()


def test_one_part_is_one_call_bit_for_bit(tmp_path):
    V, F = MESHES["ball"]()
    L = 0.9 * quality(V, F).edge_mean
    labels = (V[F].mean(axis=1)[:, 2] > 0).astype(np.int32)
    result = remesh_large((V, F), L, out=tmp_path / "out", face_labels=labels)
    call = remesh(V, F, L, face_labels=labels)
    for name in ("V", "F", "birth_face", "birth_barycentric", "lengths", "face_labels"):
        assert np.array_equal(getattr(result, name), getattr(call, name)), name
        assert getattr(result, name).dtype == getattr(call, name).dtype, name


def test_labels_sizes_and_fixed_elements_work_across_parts(tmp_path):
    """Lengths that vary, labels, and faces and vertices that stay, all cut by borders of parts."""
    V, F = MESHES["ball"]()
    mean = quality(V, F).edge_mean
    labels = (V[F].mean(axis=1)[:, 0] > 0).astype(np.int16)
    fixed_faces = np.flatnonzero(V[F].mean(axis=1)[:, 1] > 0.98)
    options = {"face_labels": labels, "fixed_faces": fixed_faces, "fixed_vertices": [7, 8, 9]}
    result = remesh_large(
        (V, F), lambda P: mean * (0.9 + 0.3 * P[:, 2]), out=tmp_path / "out", workers=1,
        part_faces=PART, **options,
    )  # fmt: skip
    V2, F2 = map(np.asarray, result)
    found = quality(V2, F2)
    assert (found.euler_number, found.components, found.boundary_loops) == (2, 1, 0)
    # The border between labels is where it was: areas of both sides agree with those of the input.
    centre = V2[F2].mean(axis=1)
    assert (result.face_labels == (centre[:, 0] > 0)).mean() > 0.99
    assert result.face_labels.dtype == np.int16
    points = {p.tobytes() for p in V2}
    assert all(V[v].tobytes() in points for v in (7, 8, 9, *np.unique(F[fixed_faces])))
    length = np.linalg.norm(V2[F2[:, 0]] - V2[F2[:, 1]], axis=1)
    assert length[centre[:, 2] > 0.7].mean() > 1.4 * length[centre[:, 2] < -0.7].mean()
    free = V2[:, 1] < 0.9  # beside faces that stay, lengths are those of their edges
    wanted = mean * (0.9 + 0.3 * V2[:, 2])
    np.testing.assert_allclose(result.lengths[free], wanted[free], rtol=0.02)


def test_dirt_is_mended_before_the_cuts(tmp_path):
    """Faces of the other winding, without area, twice: births name the caller's own faces."""
    V, F = MESHES["ball"]()
    rng = np.random.default_rng(5)
    turned = rng.choice(len(F), 500, replace=False)
    F = F.copy()
    F[turned] = F[turned][:, ::-1]
    F = np.concatenate([F[:100], [[5, 5, 9]], F[:1], F[100:]])
    V = np.concatenate([V, [[9.0, 9.0, 9.0]]])
    result = remesh_large((V, F), 0.03, out=tmp_path / "out", workers=1, part_faces=PART)
    found = quality(result.V, result.F)
    assert (found.euler_number, found.components, found.boundary_loops) == (2, 1, 0)
    assert found.volume == pytest.approx(4 / 3 * np.pi, rel=0.01)
    born = (V[F[result.birth_face]] * result.birth_barycentric[:, :, None]).sum(axis=1)
    assert np.abs(born - result.V).max() < 1e-9 * 0.03
    assert {"flipped_faces", "degenerate_faces", "duplicate_faces"} <= result.report["dirt"].keys()


def test_data_follow(large, tmp_path):
    case = large("ball")
    np.save(tmp_path / "x.npy", case.V.astype(np.float32))
    there = case.result.transfer(tmp_path / "x.npy", out=tmp_path / "y.npy")
    assert there.dtype == np.float32
    np.testing.assert_allclose(there, case.result.V, atol=1e-6)
    assert np.array_equal(np.load(tmp_path / "y.npy"), case.result.transfer(case.V.astype("f4")))


def test_parts_cover_the_result(large):
    case, n = large("box"), 0
    for part in case.result.parts(5000):
        assert np.array_equal(part.V[part.F], case.result.V[case.result.F[n : n + len(part.F)]])
        assert np.array_equal(part.birth_face, case.result.birth_face[part.vertices])
        n += len(part.F)
    assert n == len(case.result.F)
