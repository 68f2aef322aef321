"""Sheets that meet in common edges come back welded; dirt is cleaned, counted and closed."""

import numpy as np
import pytest
from helpers import zoo
from helpers.complexes import (
    edges_of,
    junction_edges,
    orientable_patches,
    patches,
    pinched_count,
    shape,
)
from helpers.invariants import assert_clean, assert_corners, assert_same_complex
from helpers.measures import (
    NEAR,
    ON,
    along,
    boundary_edges,
    diagonal,
    edge_lengths,
    face_areas,
    lengths_of,
    sag,
    sorted_edges,
    surface_samples,
    to_segments,
    to_surface,
)

from data.shapes.nonmanifold import COMPLEXES, interfaces
from data.shapes.solids import SOLIDS, triangulated, uv_sphere
from remeshvec import remesh


def assert_complex_kept(result, known, V, F, L):
    V2, F2 = result
    size = diagonal(V)
    assert_clean(V2, F2)
    assert_same_complex(V2, F2, V, F)
    assert_corners(V2, known.corners, size)
    joints, given = junction_edges(F2), junction_edges(F)
    # Junction vertices lie on the input's junction curves, which the new ones cover.
    # New vertices lie on chords of the input's curves, whose corners they cut.
    own = sag(lengths_of(V, given).max(), known.radius) if not known.straight else 0.0
    chord = ON * size if known.straight else sag(1.5 * L, known.radius) + own
    assert to_segments(V2[np.unique(joints)], V[given]).max() < ON * size
    assert to_segments(along(V2[joints]), V[given]).max() <= chord
    assert to_segments(along(V[given]), V2[joints]).max() <= chord
    features = {tuple(edge) for edge in sorted_edges(result.feature_edges).tolist()}
    expected = np.vstack([joints, boundary_edges(F2)])
    assert {tuple(edge) for edge in sorted_edges(expected).tolist()} <= features
    away = to_surface(surface_samples(V2, F2), V, F).max()
    if known.straight:
        assert away < NEAR * size
        assert zoo.area(V2, F2) == pytest.approx(zoo.area(V, F), rel=NEAR)
    else:
        assert away < sag(1.5 * L, known.radius) + own


@pytest.mark.parametrize("factor", [0.08, 0.2, 0.45])
@pytest.mark.parametrize("name", COMPLEXES)
def test_junctions_come_back(name, factor):
    known = COMPLEXES[name]
    V, F = known.make()
    L = factor * known.size
    result = remesh(V, F, L)
    assert_complex_kept(result, known, V, F, L)
    mean = edge_lengths(*result).mean()
    # Sheets as wide as two edges leave lengths little choice.
    assert mean == pytest.approx(L, rel=0.2 if factor < 0.4 else 0.35)
    joints = lengths_of(result.V, junction_edges(result.F))
    assert joints.max() < 1.5 * L
    assert result.report.dirt.get("non_manifold_edges") == len(junction_edges(F))


@pytest.mark.parametrize("name", COMPLEXES)
def test_junctions_come_back_at_very_coarse_lengths(name):
    """L is as wide as a sheet: next to nothing but the corners is left."""
    known = COMPLEXES[name]
    V, F = known.make()
    result = remesh(V, F, 0.9 * known.size)
    assert_complex_kept(result, known, V, F, 0.9 * known.size)
    assert len(result.F) < len(F)


@pytest.mark.parametrize("name", ["book", "four_cubes", "double_bubble", "wall_inside"])
def test_junctions_without_an_angle(name):
    """They are features by nature, not by their angles."""
    known = COMPLEXES[name]
    V, F = known.make()
    result = remesh(V, F, 0.25, feature_angle=None)
    assert_same_complex(*result, V, F)
    joints, given = junction_edges(result.F), junction_edges(F)
    assert to_segments(result.V[np.unique(joints)], V[given]).max() < ON * diagonal(V)


@pytest.mark.parametrize("name", ["half_discs", "two_planes", "double_bubble"])
def test_shuffled_and_turned_faces(name):
    """Sheets that meet by three or four have no common orientation to rely on."""
    known = COMPLEXES[name]
    V, F = known.make()
    rng = np.random.default_rng(4)
    F = rng.permutation(F)
    flipped = rng.random(len(F)) < 0.3
    F[flipped] = F[flipped, ::-1]
    result = remesh(V, F, 0.2)
    assert_complex_kept(result, known, V, F, 0.2)
    assert len(oddly_wound(result.F)) == 0


def oddly_wound(F):
    """Edges of two faces that run it the same way."""
    edges, origin = edges_of(F), np.asarray(F).ravel()
    forward = np.bincount(
        edges.of, weights=origin == edges.ends[edges.of, 0], minlength=len(edges.ends)
    )
    return edges.ends[(edges.faces == 2) & (forward != 1)]


def test_labels_of_cells_stay_apart():
    """A foam of four cells: every wall keeps its label, and its area."""
    V, F = interfaces([[1, 2], [3, 4]], n=5)
    _, wall = patches(F)
    result = remesh(V, F, 0.15, face_labels=wall)
    _, found = patches(result.F)
    labels = np.asarray(result.face_labels)
    pairs = set(zip(found.tolist(), labels.tolist(), strict=True))
    assert len(pairs) == wall.max() + 1
    for value in range(wall.max() + 1):
        area = face_areas(result.V, result.F)[labels == value].sum()
        assert area == pytest.approx(face_areas(V, F)[wall == value].sum(), rel=NEAR)


# --- one-sided surfaces --------------------------------------------------------------------------


@pytest.mark.parametrize("L", [0.12, 0.3])
def test_a_moebius_strip_stays_one_sided(L):
    V, F = zoo.moebius(60, 7)
    result = remesh(V, F, L)
    V2, F2 = result
    assert_clean(V2, F2)
    found = shape(F2)
    assert (found["euler"], found["components"], found["loops"]) == (0, 1, 1)
    assert found["manifold"] and not found["oriented"]
    assert orientable_patches(F2) == 0 and patches(F2)[0] == 1
    size = diagonal(V)
    rim = V2[np.unique(boundary_edges(F2))]
    assert to_segments(rim, V[boundary_edges(F)]).max() < ON * size
    assert to_surface(V2, V, F).max() < NEAR * size
    assert zoo.area(V2, F2) == pytest.approx(zoo.area(V, F), rel=0.03)
    assert edge_lengths(V2, F2).mean() == pytest.approx(L, rel=0.15)


# --- dirt ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_flipped_faces_are_turned_back(seed):
    V, F = zoo.icosphere(3)
    flipped = np.random.default_rng(seed).random(len(F)) < 0.2
    dirty = F.copy()
    dirty[flipped] = dirty[flipped, ::-1]
    result = remesh(V, dirty, 0.2)
    assert shape(result.F) == shape(F)
    assert zoo.volume(*result) > 0.95 * zoo.volume(V, F), "faces look outward, as most did"
    assert_flipped(result, int(flipped.sum()))


def assert_flipped(result, count):
    dirt = result.report.dirt
    assert dirt["flipped_faces"] == count
    assert set(dirt) <= {"flipped_faces", "inconsistent_edges"}


def test_flipped_faces_of_an_open_sheet():
    V, F = zoo.grid(15, 11)
    dirty = F.copy()
    dirty[::4] = dirty[::4, ::-1]
    result = remesh(V, dirty, 0.7)
    assert shape(result.F) == shape(F)
    assert zoo.area(*result) == pytest.approx(zoo.area(V, F), rel=ON)
    assert_flipped(result, len(F[::4]))
    assert len(oddly_wound(result.F)) == 0


@pytest.mark.parametrize("name", ["cube", "octahedron", "l_prism"])
def test_triangle_soup_is_welded(name):
    V, F = triangulated(name, "bare")
    soup, faces = V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)
    result = remesh(soup, faces, 0.1 * SOLIDS[name].diagonal)
    assert shape(result.F) == shape(F)
    assert_corners(result.V, SOLIDS[name].corners, SOLIDS[name].diagonal)
    assert zoo.volume(*result) == pytest.approx(zoo.volume(V, F), rel=1e-6)
    assert result.report.dirt == {"welded_vertices": 3 * len(F) - len(V)}
    # All input vertices at a corner are that corner.
    where = result.vertex_map
    assert (where >= 0).all() and np.array_equal(result.V[where], soup)


def test_welded_sheets_of_three_faces_an_edge():
    """Soup of a complex: welding makes the junction."""
    known = COMPLEXES["two_planes"]
    V, F = known.make()
    soup, faces = V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)
    result = remesh(soup, faces, 0.3)
    assert_same_complex(*result, V, F)
    assert result.report.dirt["welded_vertices"] == 3 * len(F) - len(V)


def bow_tie():
    """Two square sheets in one plane that share a corner."""
    V, F = zoo.grid(7, 7)
    W, G = np.vstack([V, -V[1:]]), np.where(F == 0, 0, F + len(V) - 1)
    return W, np.vstack([F, G])


def pinched_spheres():
    """Two spheres that share a pole."""
    V, F = uv_sphere(24, 12)
    top = len(V) - 2  # (0, 0, 1)
    W = np.delete(V * [1, 1, -1] + [0, 0, 2], top, axis=0)
    G = np.where(top == F, top, len(V) + F - (top < F))[:, ::-1]
    return np.vstack([V, W]), np.vstack([F, G])


@pytest.mark.parametrize("name", ["bow tie", "pinched spheres"])
@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_pinched_vertices(name, factor):
    V, F = bow_tie() if name == "bow tie" else pinched_spheres()
    assert pinched_count(F) == 1
    result = remesh(V, F, factor * zoo.mean_edge(V, F))
    assert_clean(*result)
    assert result.report.dirt == {"pinched_vertices": 1}
    assert (edges_of(result.F).faces <= 2).all()
    # Parted or joined, the sheets are two, each what it was.
    expected, found = shape(F), shape(result.F)
    assert patches(result.F)[0] == patches(F)[0] == 2
    assert found["loops"] == expected["loops"]
    assert found["euler"] + pinched_count(result.F) == expected["euler"] + pinched_count(F)
    assert zoo.area(*result) == pytest.approx(zoo.area(V, F), rel=0.03 * factor)
    assert to_surface(result.V, V, F).max() < NEAR * diagonal(V)


def test_duplicate_and_degenerate_faces():
    V, F = triangulated("cube", "even")
    rng = np.random.default_rng(2)
    copies = F[rng.choice(len(F), 9, replace=False)]
    copies[::2] = copies[::2, [1, 2, 0]]
    copies[1::2] = copies[1::2, ::-1]
    flat = np.stack([F[:5, 0], F[:5, 0], F[:5, 1]], axis=1)
    dirty = rng.permutation(np.vstack([F, copies, flat]))
    result = remesh(V, dirty, 0.1)
    assert result.report.dirt == {"duplicate_faces": 9, "degenerate_faces": 5}
    assert shape(result.F) == shape(F)
    assert zoo.volume(*result) == pytest.approx(1, rel=1e-6)
    assert_corners(result.V, SOLIDS["cube"].corners, 1)


def test_all_dirt_at_once():
    """A soup with flipped, doubled and degenerate faces and vertices that nobody uses."""
    V, F = triangulated("l_prism", "even")
    rng = np.random.default_rng(3)
    flipped = rng.random(len(F)) < 0.2
    turned = np.where(flipped[:, None], F[:, ::-1], F)
    soup, faces = V[turned].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)
    faces = np.vstack([faces, faces[:4], [[0, 0, 1]]])
    soup = np.vstack([soup, [[9, 9, 9], [np.nan, 0, 0]]])
    result = remesh(soup, faces, 0.12 * SOLIDS["l_prism"].diagonal)
    assert shape(result.F) == shape(F)
    assert_corners(result.V, SOLIDS["l_prism"].corners, SOLIDS["l_prism"].diagonal)
    assert zoo.volume(*result) == pytest.approx(zoo.volume(V, F), rel=1e-6)
    dirt = result.report.dirt
    assert dirt["unreferenced_vertices"] == 2 and dirt["flipped_faces"] == flipped.sum()
    assert dirt["degenerate_faces"] == 1 and dirt["duplicate_faces"] == 4
    assert dirt["welded_vertices"] == 3 * len(F) - len(V)
