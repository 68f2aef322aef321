"""The reference surface: kinds of vertices, names of curves, births and patches from the constraints."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import (
    assert_on_reference,
    assert_valid,
    built,
    curve_edges,
    curve_neighbours,
    cut_open,
    ends,
    featured,
    half_edge,
    next_of,
    referenced,
)

from data.shapes import nonmanifold
from remeshvec.core.vocabulary import CURVE, FIXED, FROZEN, HELD, INNER, NON_MANIFOLD, NONE
from remeshvec.input.prepare import prepare

ROWS = 9


def grid():
    """Flat grid of 9 x 9 vertices, unit spacing."""
    return built(*zoo.grid(ROWS, ROWS))


def at(i, j):
    return ROWS * i + j


def line(points):
    return np.stack([points[:-1], points[1:]], axis=1)


def patches_of(mesh, reference):
    """Partition of the faces by walks that cross no wall, as sets."""
    F = mesh.origin.reshape(-1, 3)
    left, found = set(range(len(F))), set()
    while left:
        stack, patch = [left.pop()], set()
        while stack:
            f = stack.pop()
            patch.add(f)
            for h in range(3 * f, 3 * f + 3):
                t = int(reference.tree.twin[h])
                if t != NONE and t // 3 in left:
                    left.discard(t // 3)
                    stack.append(t // 3)
        found.add(frozenset(patch))
    return found


def assert_built(mesh, result):
    """What must always hold of a mesh with marked features and its reference."""
    reference = result.reference
    assert_valid(mesh, slits=result.on_non_manifold is not None)
    assert_on_reference(mesh, reference)
    assert np.array_equal(reference.X[:, :3], mesh.X[:, :3])
    assert np.array_equal(reference.origin, mesh.origin)
    patch = reference.tree.patch
    numbered = {frozenset(np.flatnonzero(patch == k).tolist()) for k in range(patch.max() + 1)}
    assert numbered == patches_of(mesh, reference)
    assert np.array_equal(mesh.source, np.arange(len(patch)))
    assert np.array_equal(
        mesh.origin[mesh.birth[mesh.kind != CURVE]], np.flatnonzero(mesh.kind != CURVE)
    )
    for v in np.flatnonzero(mesh.kind == CURVE):  # or a copy of it, on another sheet
        h = int(mesh.birth[v])
        places = reference.X[list(ends(mesh, h)), :3]
        assert (places == mesh.X[v, :3]).all(axis=1).any()
        assert mesh.birth[v] == mesh.curve[h] & (NON_MANIFOLD - 1), (
            "born on an edge that is no name"
        )


@pytest.mark.parametrize("name", zoo.TIDY)
def test_every_shape(name):
    V, F = zoo.ZOO[name].make()
    for angle in (None, 40.0, "auto"):
        mesh = built(V, F, ordered=True)
        result = featured(mesh, zoo.mean_edge(V, F), feature_angle=angle)
        assert_built(mesh, result)
        assert result.on_non_manifold is None and result.held is None
        assert result.has_curves == bool(curve_edges(mesh))


@pytest.mark.parametrize("name", nonmanifold.COMPLEXES)
def test_every_complex(name):
    known = nonmanifold.COMPLEXES[name]
    mesh, source = cut_open(*known.make())
    result = featured(mesh, 0.2 * known.size, vertex_source=source, feature_angle=40.0)
    assert_built(mesh, result)
    places = {p.tobytes(): k for p, k in zip(mesh.X[:, :3], mesh.kind == FIXED, strict=True)}
    for corner in known.corners:
        assert places[(np.asarray(corner, float) + 0.0).tobytes()]
    # Sheets agree: all copies of a vertex on a seam are fixed, or all slide with the same birth.
    on_seam = np.flatnonzero(result.on_non_manifold)
    for s in np.unique(source[on_seam]):
        copies = np.flatnonzero(source == s)
        assert len({int(k) for k in mesh.kind[copies]}) == 1
        if mesh.kind[copies[0]] == CURVE:
            assert len(set(mesh.birth[copies].tolist())) == 1
    _, sheets = np.unique(mesh.curve[mesh.curve >= NON_MANIFOLD], return_counts=True)
    assert set(sheets.tolist()) == set(known.curves)


# --- curves --------------------------------------------------------------------------------------


def test_reference_is_a_copy_and_fixes_corners():
    result = prepare(*zoo.grid(), False)
    reference = referenced(result.mesh, 0.2)
    fixed = result.mesh.kind == FIXED
    corners = (result.mesh.X[:, :3] / result.scale + result.centre)[fixed, :2]
    assert sorted(map(tuple, corners.tolist())) == [(0, 0), (0, 4), (6, 0), (6, 4)]
    result.mesh.X[:] = 0
    result.mesh.origin[:] = 0
    assert reference.X.any() and reference.origin.any()


def test_births_start_at_home():
    mesh = prepare(*zoo.annulus(), False).mesh
    reference = referenced(mesh, 0.4)
    assert (mesh.kind == CURVE).any()
    ends = np.stack([reference.origin, reference.origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()])
    assert (ends[:, mesh.birth] == np.arange(len(mesh.X))).any(axis=0).all()
    rim = mesh.twin[mesh.vertex_halfedge] == NONE
    assert (mesh.twin[mesh.birth[rim]] == NONE).all()


def test_a_line_that_ends_inside():
    """Its ends are fixed, nothing is walled off, but both sides are told apart along it."""
    mesh = grid()
    path = [at(2, 4), at(3, 4), at(4, 4), at(5, 4)]
    result = featured(mesh, 1.0, feature_edges=line(path))
    assert_built(mesh, result)
    assert mesh.kind[path].tolist() == [FIXED, CURVE, CURVE, FIXED]
    assert {frozenset(e) for e in line(path).tolist()} <= set(curve_edges(mesh))
    assert result.reference.tree.patch.max() == 0
    for a, b in line(path).tolist():
        assert result.reference.tree.twin[half_edge(mesh, a, b)] == NONE


def test_lines_that_cross_are_cut_into_patches():
    mesh = grid()
    across = [at(i, 4) for i in range(ROWS)]
    along = [at(4, j) for j in range(ROWS)]
    result = featured(mesh, 1.0, feature_edges=np.vstack([line(across), line(along)]))
    assert_built(mesh, result)
    assert mesh.kind[at(4, 4)] == FIXED and result.reference.tree.patch.max() == 3
    ends = [across[0], across[-1], along[0], along[-1]]  # where they meet the boundary
    assert (mesh.kind[ends] == FIXED).all()
    assert result.counts["crease_edges"] == 2 * (ROWS - 1)
    assert result.counts["corners"] == 4 + 4 + 1


def test_labels_make_curves():
    V, F = zoo.grid(ROWS, ROWS)
    labels = (V[F].mean(axis=1)[:, 0] > 4).astype(int)
    mesh = built(V, F)
    result = featured(mesh, 1.0, face_labels=labels)
    assert_built(mesh, result)
    border = {frozenset((at(4, j), at(4, j + 1))) for j in range(ROWS - 1)}
    assert set(curve_edges(mesh)) == border | naive.boundary_edges(F)
    patch = result.reference.tree.patch
    assert patch.max() == 1 and len({(p, k) for p, k in zip(patch, labels, strict=True)}) == 2


def test_edges_of_features_are_known_by_their_ends():
    mesh = grid()
    path = [at(4, j) for j in range(ROWS)]
    result = featured(mesh, 1.0, feature_edges=line(path))
    ends = mesh.origin[np.stack([result.features, [next_of(h) for h in result.features.tolist()]])]
    assert set(map(frozenset, ends.T.tolist())) == set(curve_edges(mesh))


def test_tips_are_held():
    V, F = zoo.bipyramid(24, top=4.0, bottom=-0.2)
    mesh = built(V, F)
    featured(mesh, 0.5)
    assert mesh.kind[24] == HELD and (np.delete(mesh.kind, 24) == INNER).all()
    featured(mesh, 0.5, fixed_vertices=[24])
    assert mesh.kind[24] == FIXED


# --- what stays ----------------------------------------------------------------------------------


def test_fixed_vertices_stay_wherever_they_are():
    """Inside, on the boundary, and on a line, which they cut."""
    mesh = grid()
    path = [at(4, j) for j in range(ROWS)]
    chosen = [at(2, 2), at(0, 3), at(4, 6)]
    result = featured(mesh, 1.0, feature_edges=line(path), fixed_vertices=chosen)
    assert_built(mesh, result)
    assert (mesh.kind[chosen] == FIXED).all()
    assert (mesh.kind == FIXED).sum() == 4 + 2 + 3
    beside = curve_neighbours(result.reference)
    for a, b in ((5, 6), (6, 7)):
        name = curve_edges(mesh)[frozenset((at(4, a), at(4, b)))]
        side = [mesh.origin[name], mesh.origin[next_of(name)]].index(at(4, 6))
        assert beside[side, name] == NONE


@pytest.mark.parametrize("mode", ["free", "split", "fixed"])
def test_boundary_modes(mode):
    V, F = zoo.annulus(60, 4)
    mesh = built(V, F)
    result = featured(mesh, 0.2, boundary=mode)
    assert_built(mesh, result)
    rim = mesh.twin == NONE
    ends = np.unique(mesh.origin[rim])
    assert (mesh.kind[ends] == (CURVE if mode == "free" else FIXED)).all()
    assert ((mesh.curve == FROZEN) == (rim & (mode == "fixed"))).all()
    assert (np.delete(mesh.kind, ends) == INNER).all()


@pytest.mark.parametrize("mode", ["split", "fixed"])
def test_boundary_modes_leave_seams_alone(mode):
    """Where sheets meet there is no boundary."""
    known = nonmanifold.COMPLEXES["half_discs"]
    mesh, source = cut_open(*known.make())
    result = featured(mesh, 0.2, vertex_source=source, boundary=mode)
    assert_built(mesh, result)
    seam = mesh.curve >= NON_MANIFOLD
    assert seam.any() and (mesh.kind[mesh.origin[seam]] == CURVE).any()
    outside = (mesh.twin == NONE) & ~seam
    assert (mesh.kind[mesh.origin[outside]] == FIXED).all()
    assert ((mesh.curve == FROZEN) == (outside & (mode == "fixed"))).all()


def test_held_faces_stay_with_all_their_edges():
    V, F = zoo.grid(ROWS, ROWS)
    mesh = built(V, F)
    faces = np.flatnonzero((V[F][:, :, 0] <= 3).all(axis=1))
    result = featured(mesh, 0.4, fixed_faces=faces)
    assert_built(mesh, result)
    assert np.array_equal(np.flatnonzero(result.held), faces)
    around = np.unique(F[faces])
    assert (mesh.kind[around] == FIXED).all()
    frozen = {e for e, name in curve_edges(mesh).items() if name == FROZEN}
    assert frozen == naive.edges(F[faces])
    patch = result.reference.tree.patch
    assert not set(patch[faces]) & set(np.delete(patch, faces))
    # Their edges are longer than what was asked for: beside them that is not to be had.
    assert (mesh.X[around, 3] >= 1.0).all()
    others = np.setdiff1d(np.arange(len(V)), around)
    assert (mesh.X[others, 3] == 0.4).all() and (result.reference.X[:, 3] == 0.4).all()


def test_held_faces_at_a_seam_freeze_it_on_all_sheets():
    V, F = nonmanifold.COMPLEXES["book"].make()
    mesh, source = cut_open(V, F)
    face = int(np.flatnonzero((V[F][:, :, :2] == 0).all(axis=2).sum(axis=1) == 2)[0])
    result = featured(mesh, 0.2, vertex_source=source, fixed_faces=[face])
    assert_built(mesh, result)
    edge = sorted(v for v in F[face] if (V[v, :2] == 0).all())
    copies = np.flatnonzero(np.isin(source, edge))
    assert (mesh.kind[copies] == FIXED).all() and len(copies) == 10
    at_seam = np.isin(mesh.origin, copies) & np.isin(
        mesh.origin.reshape(-1, 3)[:, [1, 2, 0]].ravel(), copies
    )
    assert at_seam.sum() == 5 and (mesh.curve[at_seam] == FROZEN).all()


@pytest.mark.parametrize("wanted", ["boundary", "faces"])
def test_lengths_beside_what_is_held_agree_on_all_sheets(wanted):
    """Else midpoints of a seam would get other lengths on each, slide apart, and never be welded."""
    V, F = zoo.perturb(*zoo.three_half_discs(), amount=0.1)
    mesh, source = cut_open(V, F)
    kept = {"boundary": "fixed"} if wanted == "boundary" else {"fixed_faces": [0, 7]}
    result = featured(mesh, 0.1, vertex_source=source, **kept)
    assert result.on_non_manifold.any() and mesh.X[:, 3].max() > 0.3
    low, high = np.full(len(V), np.inf), np.zeros(len(V))
    np.minimum.at(low, source, mesh.X[:, 3])
    np.maximum.at(high, source, mesh.X[:, 3])
    assert np.array_equal(low, high)


def test_a_vertex_fixed_on_one_sheet_is_fixed_on_all():
    V, F = nonmanifold.COMPLEXES["book"].make()
    mesh, source = cut_open(V, F)
    inside = [v for v in range(len(V)) if not V[v, :2].any() and 0 < V[v, 2] < 1]
    featured(mesh, 0.2, vertex_source=source, fixed_vertices=inside[:1])
    assert (mesh.kind[source == inside[0]] == FIXED).all()
    assert (mesh.kind[source == inside[1]] == CURVE).all()


def test_a_curve_that_crosses_a_seam_on_one_sheet_is_a_junction_of_all():
    V, F = nonmanifold.COMPLEXES["book"].make()
    mesh, source = cut_open(V, F)
    (v,) = (v for v in range(len(V)) if not V[v, :2].any() and np.isclose(V[v, 2], 0.4))
    page = next(
        w for w in naive.neighbours(F)[v] if V[w, :2].any() and np.isclose(V[w, 2], V[v, 2])
    )
    result = featured(mesh, 0.2, vertex_source=source, feature_edges=[[v, page]])
    assert_built(mesh, result)
    assert (mesh.kind[source == v] == FIXED).all()


def test_a_sheet_that_leaves_a_seam_smoothly_ends_it():
    """Four sheets, then three; no sheet has a corner there, and the curves do not turn."""
    n = 8
    floor = nonmanifold.sheet([-1, -1, 0], [2, 0, 0], [0, 2, 0], n, n)
    down = nonmanifold.sheet([-1, 0, -1], [2, 0, 0], [0, 0, 1], n, n // 2)
    V, F = nonmanifold.sheet([-1, 0, 0], [2, 0, 0], [0, 0, 1], n, n // 2)
    V[:, 2] += 0.1 * np.maximum(V[:, 0], 0) ** 2
    W, G = nonmanifold.welded([floor, down, (V, F)])
    mesh, source = cut_open(W, G)
    result = featured(mesh, 0.2, vertex_source=source, feature_angle=40.0)
    assert_built(mesh, result)
    _, sheets = np.unique(mesh.curve[mesh.curve >= NON_MANIFOLD], return_counts=True)
    assert set(sheets.tolist()) == {3, 4}
    middle = (mesh.X[:, :3] == 0).all(axis=1)
    assert middle.sum() == 4 and (mesh.kind[middle] == FIXED).all()


@pytest.mark.parametrize("closed", [False, True])
def test_a_vertex_of_a_seam_that_touches_another_part_stays(closed):
    """Where a face or a closed part hangs on it by one corner, which slides nowhere."""
    V, F = nonmanifold.book()
    v = next(v for v in range(len(V)) if not V[v, :2].any() and np.isclose(V[v, 2], 0.4))
    n = len(V)
    W = np.vstack([V, V[v] + [[3, 1, 0], [3, -1, 0], [3, 0, 1]]])
    part = [[v, n + 1, n], [v, n, n + 2], [v, n + 2, n + 1], [n, n + 1, n + 2]]
    mesh, source = cut_open(W if closed else W[:-1], np.vstack([F, part if closed else part[:1]]))
    result = featured(mesh, 0.2, vertex_source=source)
    assert_built(mesh, result)
    assert (source == v).sum() == 6 and (mesh.kind[source == v] == FIXED).all()


def test_ends_of_seams_are_fixed():
    """A wall that ends inside the floor: there the number of sheets changes."""
    mesh, source = cut_open(*nonmanifold.wall_inside())
    featured(mesh, 0.2, vertex_source=source)
    tips = (np.abs(mesh.X[:, :3]) == [0, 0.5, 0]).all(axis=1)
    assert tips.sum() >= 4 and (mesh.kind[tips] == FIXED).all()


def test_corners_where_closed_parts_touch_stay_apart():
    """Two cubes with a common edge: four sheets are cut, two closed surfaces remain."""
    V, F = zoo.two_cubes_on_an_edge()
    mesh, source = cut_open(V, F)
    result = featured(mesh, 0.3, vertex_source=source, feature_angle=40.0)
    assert_built(mesh, result)
    seam = mesh.curve >= NON_MANIFOLD
    assert seam.sum() == 4 and len(set(mesh.curve[seam].tolist())) == 1
