"""What the caller wants kept: refused with the number that is wrong, then masks on the mesh."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import built, curve_edges, cut_open, ends, half_edges

from data.shapes import nonmanifold
from remeshvec import OptionError
from remeshvec.core.vocabulary import NONE
from remeshvec.input.constraints import make_constraints
from remeshvec.input.options import RemeshOptions

V, F = zoo.grid(5, 4)
N, M = len(V), len(F)  # 20 vertices, 24 faces


def made(**wanted):
    return make_constraints(N, F, RemeshOptions(**wanted))


BAD = {
    "angle of nothing": (
        {"feature_angle": 0.0},
        r'feature_angle must be "auto", None or degrees .*got 0\.0',
    ),
    "angle of all": (
        {"feature_angle": 180},
        r"feature_angle must be .* between 0 and 180; got 180",
    ),
    "angle by name": ({"feature_angle": "sharp"}, r"feature_angle must be .* got 'sharp'"),
    "angle as truth": ({"feature_angle": True}, r"feature_angle must be .* got True"),
    "angle nan": ({"feature_angle": float("nan")}, r"feature_angle must be .* got nan"),
    "angle array": ({"feature_angle": np.array([30.0])}, r"feature_angle must be"),
    "boundary": ({"boundary": "fix"}, r"boundary must be one of free, split, fixed; got 'fix'"),
    "boundary array": ({"boundary": np.array(["free"])}, r"boundary must be one of"),
    "vertex too large": (
        {"fixed_vertices": [0, 20]},
        r"fixed_vertices\[1\] = 20 is not a vertex index; they run from 0 to 19",
    ),
    "vertex negative": (
        {"fixed_vertices": [-1]},
        r"fixed_vertices\[0\] = -1 is not a vertex index",
    ),
    "vertex float": (
        {"fixed_vertices": [1.0]},
        r"fixed_vertices must hold vertex indices; got shape \(1,\) of float64",
    ),
    "vertex mask": (
        {"fixed_vertices": np.ones(N, bool)},
        r"fixed_vertices must hold vertex indices; .* of bool",
    ),
    "vertex matrix": (
        {"fixed_vertices": [[0, 1]]},
        r"fixed_vertices must hold vertex indices; got shape \(1, 2\)",
    ),
    "vertex ragged": (
        {"fixed_vertices": [[0], [1, 2]]},
        r"fixed_vertices is not a rectangular array",
    ),
    "vertex object": (
        {"fixed_vertices": [None]},
        r"fixed_vertices is not a rectangular array of numbers",
    ),
    "face too large": (
        {"fixed_faces": [3, 24]},
        r"fixed_faces\[1\] = 24 is not a face index; they run from 0 to 23",
    ),
    "face mask": (
        {"fixed_faces": np.ones(5, bool)},
        r"fixed_faces as a mask must have shape \(24,\); got \(5,\)",
    ),
    "face float": ({"fixed_faces": [0.5]}, r"fixed_faces must hold face indices"),
    "selection": ({"selection": [24]}, r"selection\[0\] = 24 is not a face index"),
    "selection mask": (
        {"selection": np.ones((24, 1), bool)},
        r"selection as a mask must have shape \(24,\); got \(24, 1\)",
    ),
    "labels short": (
        {"face_labels": [1, 2]},
        r"face_labels must hold one whole number per face, shape \(24,\); got shape \(2,\)",
    ),
    "labels float": ({"face_labels": np.zeros(M)}, r"face_labels must hold .* of float64"),
    "labels text": ({"face_labels": ["a"] * M}, r"face_labels must hold .* of <U1"),
    "edge shape": (
        {"feature_edges": [0, 1]},
        r"feature_edges must have shape \(k, 2\), two vertices a row; got \(2,\)",
    ),
    "edge too large": (
        {"feature_edges": [[0, 1], [1, 20]]},
        r"feature_edges.* = 20 is not a vertex index",
    ),
    "edge that is none": ({"feature_edges": [[0, 1], [0, 19]]}, r"feature_edges.*\b1\b"),
    "edge of one vertex": ({"feature_edges": [[3, 3]]}, r"feature_edges"),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", BAD)
def test_what_is_wrong_is_said(name):
    wanted, message = BAD[name]
    with pytest.raises(OptionError, match=message) as error:
        made(**wanted)
    assert "\n" not in str(error.value) and len(str(error.value)) < 200


def test_nothing_wanted():
    found = made()
    assert found.feature_angle == "auto" and found.boundary == "free"
    assert found.feature_edges.shape == (0, 2) and found.fixed_vertices.shape == (0,)
    assert found.fixed_faces is None and found.labels is None and found.unselected is None


def test_corner_angles():
    assert made().corner_angle is None
    assert made(corner_angle=180).corner_angle == 180.0
    for value in (0, 181, "auto", True, float("nan")):
        with pytest.raises(OptionError, match=r"corner_angle must be .* degrees"):
            made(corner_angle=value)


def test_good_angles():
    for value, expected in (("auto", "auto"), (None, None), (30, 30.0), (np.float32(1.5), 1.5)):
        found = made(feature_angle=value).feature_angle
        assert found == expected and (type(found) is float or value in ("auto", None))


def test_faces_by_number_or_mask():
    mask = np.zeros(M, bool)
    mask[[3, 20]] = True
    for given in (mask, [20, 3], np.array([3, 20, 3], np.uint8), (3, 20)):
        assert np.array_equal(made(fixed_faces=given).fixed_faces, mask)
        found = made(selection=given)
        assert np.array_equal(found.fixed_faces, ~mask)
        assert np.array_equal(found.unselected, ~mask)
    assert not made(fixed_faces=[]).fixed_faces.any()
    assert made(selection=[]).unselected.all()


def test_masks_are_copies():
    mask = np.zeros(M, bool)
    found = made(fixed_faces=mask, selection=mask)
    mask[:] = True
    assert found.fixed_faces.all() and found.unselected.all()
    assert not made(fixed_faces=~mask).fixed_faces.any()


def test_faces_outside_the_selection_join_the_fixed_ones():
    found = made(fixed_faces=[0, 1], selection=np.arange(1, M))
    assert np.flatnonzero(found.fixed_faces).tolist() == [0, 1]
    assert np.flatnonzero(found.unselected).tolist() == [0]


# --- on a mesh -----------------------------------------------------------------------------------


def marks_of(mesh, source=None, same=None, faces=None, n=None, G=None, **wanted):
    """Marks on a mesh, by default one whose elements are those of the input."""
    source = np.arange(len(mesh.X), dtype=np.int32) if source is None else source
    G = source[mesh.origin.reshape(-1, 3)].astype(np.int64) if G is None else G
    faces = np.arange(len(mesh.source)) if faces is None else faces
    found = make_constraints(int(G.max()) + 1 if n is None else n, G, RemeshOptions(**wanted))
    return found.on_mesh(mesh, source, faces, same)


def edges_in(mesh, which):
    """Edges of a mask of half-edges, as sets of vertices."""
    return {frozenset(ends(mesh, h)) for h in np.flatnonzero(which)}


def test_nothing_marked():
    mesh = built(V, F)
    marks = marks_of(mesh)
    assert marks.held is None
    assert not (marks.hard.any() or marks.frozen.any() or marks.fixed.any())
    assert marks.hard.shape == marks.frozen.shape == (3 * M,) and marks.fixed.shape == (N,)
    assert marks_of(mesh, fixed_faces=[], selection=np.arange(M)).held is None


def test_edges_are_marked_on_both_sides():
    mesh = built(V, F)
    inner = [sorted(e) for e in naive.edges(F) - naive.boundary_edges(F)][:5]
    rim = [sorted(e) for e in naive.boundary_edges(F)][:2]
    marks = marks_of(mesh, feature_edges=[e[::-1] for e in inner] + rim)
    assert marks.hard.sum() == 2 * 5 + 2
    assert edges_in(mesh, marks.hard) == set(map(frozenset, inner + rim))


def test_borders_of_labels_are_marked():
    mesh = built(V, F)
    for dtype in (int, np.uint8, bool, np.int8):
        labels = (np.arange(M) % 3 == 0).astype(dtype)
        marks = marks_of(mesh, face_labels=labels)
        h = np.arange(3 * M)
        inner = mesh.twin != NONE
        expected = inner & (labels[h // 3] != labels[np.where(inner, mesh.twin, 0) // 3])
        assert np.array_equal(marks.hard, expected) and expected.any()


def test_held_faces_freeze_their_edges_and_fix_their_corners():
    mesh = built(V, F)
    marks = marks_of(mesh, fixed_faces=[5, 17])
    assert np.flatnonzero(marks.held).tolist() == [5, 17]
    assert edges_in(mesh, marks.frozen) == naive.edges(F[[5, 17]])
    for edge in naive.edges(F[[5, 17]]):
        assert marks.frozen[half_edges(mesh, *edge)].all(), "one side is not frozen"
    assert set(np.flatnonzero(marks.fixed).tolist()) == set(F[[5, 17]].ravel().tolist())
    assert not marks.hard.any()


@pytest.mark.parametrize("mode", ["split", "fixed"])
def test_boundary_modes(mode):
    mesh = built(V, F)
    marks = marks_of(mesh, boundary=mode)
    rim = {v for edge in naive.boundary_edges(F) for v in edge}
    assert set(np.flatnonzero(marks.fixed).tolist()) == rim
    assert np.array_equal(marks.frozen, (mesh.twin == NONE) & (mode == "fixed"))
    assert marks.held is None and not marks.hard.any()


def test_faces_come_from_where_they_come_from():
    """Faces in another order, and some of the input dropped."""
    order = np.random.default_rng(0).permutation(M)[: M - 4]
    mesh = built(V, F[order])
    labels = np.arange(M)
    marks = marks_of(
        mesh, faces=order, n=N, G=F, fixed_faces=[order[0], order[5]], face_labels=labels
    )
    assert np.flatnonzero(marks.held).tolist() == [0, 5]
    assert np.array_equal(marks.hard, mesh.twin != NONE)


def test_copies_of_a_vertex_get_the_marks_of_its_source():
    known = nonmanifold.COMPLEXES["book"]
    W, G = known.make()
    mesh, source = cut_open(W, G)
    spine = [v for v in range(len(W)) if not W[v, :2].any()]
    a, b = sorted(spine, key=lambda v: W[v, 2])[1:3]
    marks = marks_of(mesh, source, fixed_vertices=[a], feature_edges=[[a, b]])
    assert np.array_equal(marks.fixed, source == a) and marks.fixed.sum() == 5
    assert marks.hard.sum() == 5 and (mesh.twin[marks.hard] == NONE).all()
    face = next(f for f in range(len(G)) if {a, b} <= set(G[f].tolist()))
    marks = marks_of(mesh, source, fixed_faces=[face])
    at_seam = np.isin(source[mesh.origin], [a, b]) & (mesh.twin == NONE)
    assert marks.frozen[at_seam].sum() == 5, "the edge is frozen on one sheet only"


@pytest.mark.parametrize("mode", ["split", "fixed"])
def test_seams_are_no_boundary(mode):
    W, G = nonmanifold.COMPLEXES["half_discs"].make()
    mesh, source = cut_open(W, G)
    marks = marks_of(mesh, source, boundary=mode)
    seam = {frozenset(e) for e, faces in zoo.edge_faces(G).items() if len(faces) > 2}
    rim = naive.boundary_edges(G)
    frozen = {frozenset(source[list(e)].tolist()) for e in edges_in(mesh, marks.frozen)}
    assert frozen == (rim if mode == "fixed" else set())
    fixed = set(source[marks.fixed].tolist())
    assert fixed == {v for edge in rim for v in edge}
    assert {v for edge in seam for v in edge} - fixed


def test_welded_vertices_stand_for_each_other():
    """The caller names vertices that were welded to others."""
    mesh = built(V, F)
    same = np.append(np.arange(N), [7, 12]).astype(np.int32)  # two more, that lie on 7 and 12
    a, b = next(sorted(e) for e in naive.edges(F) if 7 in e and 12 not in e)
    other = a + b - 7
    G = np.where(F == 7, N, F)  # the input used the copy
    marks = marks_of(
        mesh, same=same, n=N + 2, G=G, fixed_vertices=[N + 1], feature_edges=[[N, other]]
    )
    assert np.flatnonzero(marks.fixed).tolist() == [12]
    assert edges_in(mesh, marks.hard) == {frozenset((7, other))}


def test_vertices_that_no_face_uses_mark_nothing():
    """Also where their numbers lie beyond those of all others: no edge is taken for another."""
    mesh = built(V, F)
    G = np.vstack([F, [[0, 0, N + 7]]])  # the last face was dropped
    neighbour = next(
        w for w in naive.neighbours(F)[1] if frozenset((1, w)) not in naive.boundary_edges(F)
    )
    for far in (N + 7, N + neighbour):
        G[-1, 2] = far
        edge = [[0, far]]
        marks = marks_of(mesh, n=N + 20, G=G, fixed_vertices=[N + 19, far], feature_edges=edge)
        assert not marks.fixed.any() and not marks.hard.any()


def test_marks_do_not_touch_the_mesh():
    mesh = built(V, F)
    before = curve_edges(mesh)
    marks_of(mesh, fixed_faces=[0], boundary="fixed", fixed_vertices=[9])
    assert curve_edges(mesh) == before
