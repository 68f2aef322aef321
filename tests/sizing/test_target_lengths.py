"""Target lengths on the prepared mesh: measured, given in any form, in its frame, and refused."""

import warnings

import igl
import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import built, cut_open, featured
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import shortest_path

from data.shapes import nonmanifold
from remeshvec import Adaptive, OptionError, remesh
from remeshvec.input.constraints import make_constraints
from remeshvec.input.options import RemeshOptions
from remeshvec.input.prepare import prepare
from remeshvec.reference.non_manifold import non_manifold_copies
from remeshvec.sizing.target_lengths import bound_gradation, check_gradation, mesh_size, set_lengths


def prepared(V, F):
    return prepare(np.asarray(V, float), np.asarray(F, np.int64), False)


def lengths(result, L, V=None, gradation=1.5, max_faces=10**9):
    """Set lengths; returns the length of the mean new face and those of all vertices, in V's units."""
    V = result.mesh.X[:, :3] / result.scale + result.centre if V is None else np.asarray(V, float)
    marks = make_constraints(len(V), F_of(result), RemeshOptions()).on_mesh(
        result.mesh, result.vertex_source, result.face_source, result.representative
    )
    mean = set_lengths(result, mesh_size(result), V, L, marks, None, gradation, max_faces)
    return mean / result.scale, result.mesh.X[:, 3] / result.scale


def F_of(result):
    """Faces in terms of the input's vertices."""
    return result.vertex_source[result.mesh.origin.reshape(-1, 3)].astype(np.int64)


@pytest.mark.parametrize("name", ["torus", "grid", "cylinder", "genus_2"])
def test_measures(name):
    V, F = zoo.ZOO[name].make()
    result = prepared(1000 * V, F)
    found = mesh_size(result)
    edges = igl.edges(F)
    mean = np.linalg.norm(V[edges[:, 0]] - V[edges[:, 1]], axis=1).mean()
    assert found.mean_edge / result.scale == pytest.approx(1000 * mean)
    assert found.area / result.scale**2 == pytest.approx(1e6 * zoo.area(V, F))


@pytest.mark.parametrize("name", ["torus", "grid", "cylinder"])
def test_default_length_is_nine_tenths_of_the_mean_edge(name):
    V, F = zoo.ZOO[name].make()
    result = prepared(1000 * V, F)
    edges = igl.edges(F)
    mean = np.linalg.norm(V[edges[:, 0]] - V[edges[:, 1]], axis=1).mean()
    for L, expected in ((None, 900 * mean), (3.0, 3.0)):
        found, everywhere = lengths(result, L)
        assert found == pytest.approx(expected)
        assert np.array_equal(everywhere, np.full(len(V), found))


def test_too_many_faces_are_refused_with_the_numbers():
    result = prepared(*zoo.grid())  # area 24
    with pytest.raises(
        OptionError, match=r"L = 0.001 .* 5.54e\+07 faces.*max_faces = 1,000.*mean edge"
    ):
        lengths(result, 1e-3, max_faces=1000)
    assert lengths(result, 1.0, max_faces=56)[0] == 1  # 24 / (sqrt(3) / 4) = 55.4
    with pytest.raises(OptionError):
        lengths(result, 1.0, max_faces=55)


def test_too_many_faces_of_varying_lengths_are_refused():
    """On half of the grid there would be few, on the other half too many."""
    V, F = zoo.grid(21, 5)
    L = np.where(V[:, 0] < 10, 0.05, 1.0)
    result = prepared(V, F)
    mean, found = lengths(result, L, V)
    assert found.min() == pytest.approx(0.05) and 0.2 < found.max() <= 1
    count = 80 / (np.sqrt(3) / 4) / mean**2
    with pytest.raises(OptionError, match=r"L from 0.05 to .* max_faces = 1,000"):
        lengths(result, L, V, max_faces=1000)
    assert lengths(result, L, V, max_faces=int(count) + 1)[0] == mean
    with pytest.raises(OptionError):
        lengths(result, L, V, max_faces=int(count) - 1)


@pytest.mark.parametrize("L", [0.1, "array"])
def test_lengths_below_the_precision_are_refused(L):
    V, F = zoo.grid()
    result = prepared(V + 1e13, F)
    with pytest.raises(OptionError, match="precision"):
        lengths(result, np.linspace(0.1, 0.2, len(V)) if L == "array" else L, V)


@pytest.mark.parametrize("L", [5e-324, 1e-200])
def test_lengths_next_to_nothing_are_refused_without_a_warning(L):
    V, F = zoo.grid()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for asked in (L, np.full(len(V), L)):
            with pytest.raises(OptionError):
                lengths(prepared(V, F), asked, V)


@pytest.mark.parametrize("L", [1e9, 1e200, 1.7e308])
def test_lengths_beyond_the_mesh_mean_that_there_is_little_to_do(L):
    V, F = zoo.grid()
    for asked in (L, np.full(len(V), L)):
        mean, found = lengths(prepared(V, F), asked, V)
        assert np.isfinite(found).all() and found.min() > 1e5 and mean == pytest.approx(found[0])


@pytest.mark.parametrize("factor", [1e-12, 1.0, 3e7])
@pytest.mark.parametrize(
    "name", ["torus", "planar_delaunay", "unreferenced_vertices", "repeated_index"]
)
def test_lengths_by_vertex_follow_the_vertices_of_the_input(name, factor):
    """Through drops, order and scale; a field that grows slowly is left as it is."""
    V, F = zoo.ZOO[name].make()
    if name == "unreferenced_vertices":
        V[0] = np.nan  # nobody asks for a length there
    L = np.full(len(V), 0.4)
    used = np.unique(F)
    L[used] += 0.03 * V[used, 0]
    result = prepared(V * factor, F)
    _, found = lengths(result, L * factor, V * factor)
    assert found == pytest.approx(factor * L[result.vertex_source], rel=1e-14)


def test_lengths_of_welded_vertices_are_those_of_the_one_that_stays():
    V, F = zoo.icosphere(1)
    soup, faces = V[F].reshape(-1, 3), np.arange(3 * len(F)).reshape(-1, 3)
    result = prepared(soup, faces)
    _, found = lengths(result, 0.5 + 0.05 * soup[:, 2], soup)
    assert len(found) == len(V)
    assert found == pytest.approx(0.5 + 0.05 * result.mesh.X[:, 2] / result.scale)


def test_functions_are_asked_at_the_vertices_of_the_input():
    V, F = zoo.torus()
    asked = []

    def length(P):
        asked.append(P.copy())
        return 0.4 + 0.02 * P[:, 1]

    V = V + 1e6  # the frame is centred
    result = prepared(V, F)
    _, found = lengths(result, length, V)
    assert len(asked) == 1 and np.array_equal(asked[0], V)
    assert found == pytest.approx(length(V)[result.vertex_source])


def test_lengths_grow_no_faster_than_told():
    V, F = zoo.grid(41, 9)
    L = np.where(V[:, 0] < 20, 0.3, 5.0)
    ends = np.array([(a, b) for f in F.tolist() for a, b in zip(f, f[1:] + f[:1], strict=True)])
    steps = np.linalg.norm(V[ends[:, 0]] - V[ends[:, 1]], axis=1)
    means = []
    for gradation in (1.1, 1.5, 4.0):
        result = prepared(V, F)
        mean, found = lengths(result, L, V, gradation)
        at = np.empty(len(V))
        at[result.vertex_source] = found
        assert (at <= L * (1 + 1e-12)).all() and at.min() == pytest.approx(0.3)
        growth = np.abs(np.diff(at[ends], axis=1)[:, 0]) / steps
        # An edge of 4/3 of the mean length of its ends, along the steepest way.
        assert growth.max() <= 1.5 * (gradation - 1) / (gradation + 1) * (1 + 1e-6)
        means.append(mean)
    assert means[0] < means[1] < means[2]


@pytest.mark.parametrize("value", [1.0, 0.5, -2, np.nan, np.inf, "2", True, None, [1.5]])
def test_bad_gradations(value):
    with pytest.raises(OptionError, match=r"gradation must be a number above 1"):
        check_gradation(value)


def test_good_gradations():
    for value in (1.2, 2, np.float32(1.5), np.int64(3)):
        found = check_gradation(value)
        assert type(found) is float and found == value


@pytest.mark.parametrize("name", ["book", "wall_across", "three_planes", "four_cubes"])
def test_sheets_agree_on_lengths_where_they_meet(name):
    """A small length on one sheet holds for all copies, and grows from there into every sheet."""
    V, F = nonmanifold.COMPLEXES[name].make()
    rng = np.random.default_rng(3)
    L = rng.uniform(0.05, 2.0, len(V))
    result = prepared(V, F)
    _, found = lengths(result, L, V)
    source = result.vertex_source
    assert len(source) > len(np.unique(source)), "nothing was cut"
    low, high = np.full(len(V), np.inf), np.zeros(len(V))
    np.minimum.at(low, source, found)
    np.maximum.at(high, source, found)
    assert np.array_equal(low[source], high[source])
    assert (found <= L[source] * (1 + 1e-12)).all()
    a, b = np.array(sorted(map(sorted, naive.edges(F)))).T
    growth = np.abs(low[a] - low[b]) / np.linalg.norm(V[a] - V[b], axis=1)
    assert growth.max() <= 1.5 * 0.5 / 2.5 * (1 + 1e-6)


@pytest.mark.parametrize("gradation", [1.2, 2.0])
@pytest.mark.parametrize("name", ["torus", "grid", "genus_2"])
def test_bounded_lengths_on_a_mesh(name, gradation):
    """No ratio along an edge above the bound; the largest lengths that allow for it."""
    V, F = zoo.ZOO[name].make()
    mesh = built(V, F)
    mesh.X[:, 3] = L = np.random.default_rng(0).uniform(0.1, 3.0, len(V))
    bound_gradation(mesh, gradation)
    a, b = np.array(sorted(map(sorted, naive.edges(F)))).T
    ratio = mesh.X[a, 3] / mesh.X[b, 3]
    assert np.maximum(ratio, 1 / ratio).max() <= gradation * (1 + 1e-12)
    steps = steps_between(len(V), a, b)
    assert mesh.X[:, 3] == pytest.approx((L * gradation**steps).min(axis=1), rel=1e-12)


def steps_between(n, a, b):
    """Edges on the shortest way between any two vertices."""
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n))
    return shortest_path(graph, directed=False, unweighted=True)


def test_bounding_stops_at_edges_that_stay():
    V, F = zoo.grid(9, 9)
    mesh = built(V, F)
    featured(mesh, 0.01, fixed_faces=[40])
    before = mesh.X[:, 3].copy()
    assert before.max() > 0.9
    bound_gradation(mesh, 1.2)
    assert np.array_equal(mesh.X[:, 3], before)


@pytest.mark.parametrize("name", nonmanifold.COMPLEXES)
def test_bounding_keeps_copies_alike(name):
    """Lengths steer slides and splits: sheets with other lengths drift apart."""
    known = nonmanifold.COMPLEXES[name]
    V, F = known.make()
    mesh, source = cut_open(V, F)
    built = featured(mesh, np.random.default_rng(1).uniform(0.05, 1.5, len(V))[source], source)
    bound_gradation(mesh, 1.3, non_manifold_copies(mesh, built))
    low, high = np.full(len(V), np.inf), np.zeros(len(V))
    np.minimum.at(low, source, mesh.X[:, 3])
    np.maximum.at(high, source, mesh.X[:, 3])
    assert np.array_equal(low, high)


@pytest.mark.parametrize("gradation", [1.2, 3.0])
@pytest.mark.parametrize("name", nonmanifold.COMPLEXES)
def test_seams_stay_closed_whatever_the_lengths(name, gradation):
    known = nonmanifold.COMPLEXES[name]
    V, F = known.make()
    L = known.size * np.random.default_rng(1).uniform(0.05, 1.5, len(V))
    result = remesh(V, F, L, feature_angle=40.0, gradation=gradation)
    assert sheets(result.F) == sheets(F) == set(known.curves)


def sheets(F):
    """Number of faces at the edges that have more than two."""
    return {len(users) for users in zoo.edge_faces(F).values()} - {1, 2}


def test_adaptive_lengths_on_a_sphere():
    """sqrt(6 t / k - 3 t^2) with nine tenths of the tolerance, in the units of the input."""
    V, F = zoo.icosphere(4)
    for factor in (1.0, 1e-5):
        result = prepared(V * factor, F)
        mean, found = lengths(result, Adaptive(tolerance=0.01 * factor), V * factor)
        expected = factor * np.sqrt(6 * 0.009 - 3 * 0.009**2)
        assert found == pytest.approx(expected, rel=0.05)
        assert mean == pytest.approx(expected, rel=0.03)


def test_adaptive_lengths_stay_between_their_bounds():
    V, F = zoo.torus(32, 16)
    result = prepared(V, F)
    _, found = lengths(result, Adaptive(0.01, min_length=0.2, max_length=0.21), V)
    assert found.min() >= 0.2 * (1 - 1e-12) and found.max() <= 0.21 * (1 + 1e-12)
