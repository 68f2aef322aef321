"""The shapes and checks for the controls: right on the input itself, and they notice damage."""

from collections import Counter

import igl
import numpy as np
import pytest

from data.shapes.nonmanifold import COMPLEXES
from data.shapes.solids import FORMS, SOLIDS, bare, circle_edges, plate, triangulated, uv_sphere
from data.shapes.topology import proper
from helpers import zoo
from helpers.complexes import (
    curves_of,
    junctions_of,
    orientable_patches,
    patch_euler_numbers,
    patches,
    pinched_count,
    shape,
)
from helpers.invariants import (
    assert_clean,
    assert_corners,
    assert_creases,
    assert_on_surface,
    assert_same_complex,
    assert_solid_kept,
    assert_upright,
)
from helpers.measures import (
    ON,
    along,
    boundary_edges,
    diagonal,
    edge_places,
    face_areas,
    face_places,
    face_points,
    label_borders,
    lengths_of,
    sag,
    surface_samples,
    to_segments,
    to_surface,
    unit_normals,
)


def dihedral_edges(V, F, degrees=20.0):
    """Edges where two faces meet at more than this turn."""
    N = unit_normals(V, F)
    found = []
    for edge, users in zoo.edge_faces(F).items():
        if len(users) == 2 and N[users[0]] @ N[users[1]] < np.cos(np.radians(degrees)):
            found.append(edge)
    return np.array(found).reshape(-1, 2)


# --- solids --------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", SOLIDS)
def test_inputs_pass_the_checks_of_solids(name, form):
    V, F = triangulated(name, form)
    assert_solid_kept(SOLIDS[name], V, F, dihedral_edges(V, F))
    assert igl.is_edge_manifold(F)
    assert face_areas(V, F).min() > 0.05 * face_areas(V, F).mean()


def test_known_solids():
    volumes = {"cube": 1.0, "l_prism": 4.5, "tetrahedron": 8 / 3, "octahedron": 4 / 3}
    volumes["triangle_prism"] = 1.2 * 0.75 * np.sqrt(3)
    volumes["pentagon_prism"] = 1.5 * 2.5 * np.sin(np.radians(72))
    volumes["leaning_prism"] = 1.0
    for name, solid in SOLIDS.items():
        assert zoo.volume(*bare(solid)) == pytest.approx(volumes[name])
    assert len(SOLIDS["cube"].creases) == 12 and len(SOLIDS["l_prism"].creases) == 18
    assert {len(solid.corners) for solid in SOLIDS.values()} == {4, 6, 8, 10, 12}


@pytest.mark.parametrize("damage", ["corner", "crease", "face", "fold", "gap", "double"])
def test_the_checks_notice_damage(damage):
    """Each by a hundredth of what a remeshing might do."""
    solid = SOLIDS["cube"]
    V, F = (array.copy() for array in triangulated("cube", "even"))
    edges = dihedral_edges(V, F)
    free = np.setdiff1d(np.arange(len(V)), edges)
    degree = np.bincount(edges.ravel(), minlength=len(V))
    if damage == "corner":
        V[0] += 1e-6
    elif damage == "crease":
        V[np.flatnonzero(degree == 2)[0]] += 1e-6
    elif damage == "face":
        V[free[0]] += 1e-5
    elif damage == "fold":
        ring = F[(free[0] == F).any(axis=1)]
        V[free[0]] += 1.5 * (V[ring[0]].mean(axis=0) - V[free[0]]) * 2
    elif damage == "gap":
        F = F[1:]
    else:
        F = np.vstack([F, F[:1]])
    with pytest.raises(AssertionError):
        assert_solid_kept(solid, V, F, edges)


def test_a_crease_that_is_cut_short_is_noticed():
    V, F = triangulated("cube", "even")
    edges = dihedral_edges(V, F)
    size = diagonal(V)
    assert_creases(V, edges, SOLIDS["cube"].creases, size)
    with pytest.raises(AssertionError):
        assert_creases(V, edges[1:], SOLIDS["cube"].creases, size)
    inner = np.setdiff1d(np.arange(len(V)), edges)
    with pytest.raises(AssertionError):
        assert_creases(V, np.vstack([edges, [[0, inner[0]]]]), SOLIDS["cube"].creases, size)


# --- the part ------------------------------------------------------------------------------------


def test_plate():
    part = plate()
    V, F = part.V, part.F
    assert_clean(V, F)
    assert shape(F) == {
        "euler": 0, "components": 1, "loops": 0, "oriented": True, "manifold": True,
        "duplicate faces": 0, "proper": True,
    }  # fmt: skip
    size = diagonal(V)
    assert_corners(V, part.corners, size)
    creases = np.vstack([part.straight, part.curved])
    # Facets of cylinders turn by 11.25 degrees, true creases by 90.
    assert_creases(V, dihedral_edges(V, F, 20), creases, size)
    assert_creases(V, dihedral_edges(V, F, 80), creases, size)
    hole = 0.5 * 32 * np.sin(2 * np.pi / 32)  # area of the polygon in a unit circle
    fillet = 0.25 * (1 - hole / 4)
    assert zoo.volume(V, F) == pytest.approx(24 + hole * (0.81 - 0.64) - 4 * fillet)
    tilted = np.abs(unit_normals(V, F)).max(axis=1) < 1 - 1e-9
    chord = np.sin(np.pi / 32) / (np.pi / 32)  # to arc, of a facet
    round_area = sum(part.curved_areas)
    assert face_areas(V, F)[tilted].sum() == pytest.approx(round_area * chord)


# --- complexes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", COMPLEXES)
def test_complexes_are_what_they_say(name):
    known = COMPLEXES[name]
    V, F = known.make()
    assert_clean(V, F)
    junctions = junctions_of(F)
    assert Counter(kind for kind, *_ in junctions.curves) == known.curves
    assert len(junctions.junctions) == known.junctions
    assert sum(len(curve) == 1 for curve in junctions.curves) == known.closed_curves
    assert patch_euler_numbers(F) == known.euler_numbers
    assert patches(F)[0] == orientable_patches(F) == len(known.euler_numbers)
    assert len(curves_of(boundary_edges(F)).curves) >= known.loops
    assert (known.loops == 0) == (len(boundary_edges(F)) == 0)
    assert_corners(V, known.corners, diagonal(V))
    assert_same_complex(V, F, V, F)
    assert_same_complex(V, np.random.default_rng(0).permutation(F), V, F)


@pytest.mark.parametrize("name", COMPLEXES)
def test_a_cut_complex_is_noticed(name):
    """One face loose from its neighbours, as a seam that was not welded leaves it."""
    V, F = COMPLEXES[name].make()
    at_seam = np.isin(F, junctions_of(F).junctions if COMPLEXES[name].junctions else F[:1])
    f = int(np.argmax(at_seam.any(axis=1)))
    cut = F.copy()
    cut[f] = len(V) + np.arange(3)
    with pytest.raises(AssertionError):
        assert_same_complex(np.vstack([V, V[F[f]]]), cut, V, F)


def test_junctions_of_known_graphs():
    _, F = zoo.three_half_discs()
    curves = junctions_of(F)
    assert curves.junctions.tolist() == [1, 2] and curves.curves == [(3, 1, 2)]
    _, F = zoo.two_cubes_on_an_edge()
    assert [curve[0] for curve in junctions_of(F).curves] == [4]
    star = curves_of([[0, 1], [0, 2], [0, 3], [3, 4], [5, 6], [6, 7], [7, 5]])
    assert star.junctions.tolist() == [0, 1, 2, 4]
    assert star.curves == [(1,), (1, 0, 1), (1, 0, 2), (1, 0, 4)]
    assert curves_of([[0, 1], [1, 2]], [3, 4]).curves == [(3, 0, 1), (4, 1, 2)]


# --- topology ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", zoo.ZOO)
def test_fast_topology_agrees_with_the_slow_one(name):
    known = zoo.ZOO[name]
    _, F = known.make()
    expected = {
        "euler": zoo.euler_number(F),
        "components": zoo.components(F),
        "loops": len(zoo.boundary_loops(F)),
        "oriented": zoo.is_oriented(F),
        "manifold": zoo.is_vertex_manifold(F),
        "duplicate faces": zoo.duplicate_faces(F),
        "proper": len(proper(F)) == len(F),
    }
    found = shape(F)
    if not known.edge_manifold:  # loops that branch are counted otherwise
        expected.pop("loops"), found.pop("loops")
    assert found == expected
    if known.edge_manifold and known.clean:
        assert pinched_count(F) == len(zoo.pinched_vertices(F))
        assert orientable_patches(F) == patches(F)[0] - (name == "moebius")
        assert sum(patch_euler_numbers(F)) == zoo.euler_number(F) + pinched_count(F)


# --- measures ------------------------------------------------------------------------------------


def test_samples_lie_on_their_mesh():
    V, F = zoo.torus()
    P = surface_samples(V, F)
    assert len(P) == len(V) + 3 * len(F) // 2 + 3 * len(F)
    assert to_surface(P, V, F).max() < 1e-15
    assert to_surface(P + np.array([0, 0, 0.01]), V, F).max() > 5e-3
    assert np.array_equal(P, surface_samples(V, F))
    inner = face_points(V, F)
    assert inner[:, 0] == pytest.approx(V[F].mean(axis=1))
    assert to_surface(inner[:, 1], V, F).max() < 1e-15


def test_distances_to_segments():
    segments = np.array([[[0, 0, 0], [1, 0, 0]], [[1, 0, 0], [1, 2, 0]]], float)
    P = [[0.5, 0, 0], [0.5, 0.1, 0], [-1, 0, 0], [1, 3, 0], [1.2, 1, 0]]
    assert to_segments(P, segments) == pytest.approx([0, 0.1, 1, 1, 0.2])
    assert along(segments, n=3).tolist()[:3] == [[0, 0, 0], [0.5, 0, 0], [1, 0, 0]]


def test_places_do_not_depend_on_numbers():
    V, F = zoo.grid()
    new = np.random.default_rng(0).permutation(len(V))
    W = np.empty_like(V)
    W[new] = V
    G = new[F][:, [1, 2, 0]]
    assert face_places(W, G) == face_places(V, F)
    assert edge_places(W, boundary_edges(G)) == edge_places(V, boundary_edges(F))
    W[new[0], 0] = np.nextafter(W[new[0], 0], 1)
    assert edge_places(W, boundary_edges(G)) != edge_places(V, boundary_edges(F))
    assert face_places(W, G) != face_places(V, F)
    assert face_places(V, F[:, ::-1]) != face_places(V, F)


def test_borders_of_labels():
    V, F = zoo.grid(5, 4)
    labels = np.where(V[F, 0].mean(axis=1) < 2, 7, -3)
    borders = label_borders(F, labels)
    assert (V[borders, 0] == 2).all() and lengths_of(V, borders).sum() == 3
    assert len(label_borders(F, np.zeros(len(F)))) == 0


def test_circles_of_the_sphere():
    V, F = uv_sphere(24, 12)
    edges = circle_edges(24, 12, 3)
    known = {tuple(sorted(edge)) for edge in zoo.edge_faces(F)}
    assert {tuple(sorted(edge)) for edge in edges.tolist()} <= known
    assert np.ptp(V[edges][..., 2]) < ON and shape(F)["euler"] == 2
    assert curves_of(edges).curves == [(1,)]
    assert sag(lengths_of(V, edges)[0], np.sin(np.pi / 3)) == pytest.approx(
        np.sin(np.pi / 3) * (1 - np.cos(np.pi / 24)), rel=1e-9
    )


def test_upright_and_on_surface_notice_a_turned_face():
    V, F = triangulated("octahedron", "even")
    turned = F.copy()
    turned[5] = turned[5, ::-1]
    assert_upright(V, F, *bare(SOLIDS["octahedron"]))
    with pytest.raises(AssertionError):
        assert_upright(V, turned, *bare(SOLIDS["octahedron"]))
    with pytest.raises(AssertionError):
        assert_on_surface(V * 1.001, F, V, F, diagonal(V))
