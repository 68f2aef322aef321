"""Creases before the call: the same as the call keeps, as edges of the input."""

import numpy as np
import pytest
from helpers import zoo
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from data.shapes import cad_parts, voxels
from data.shapes.basic import voxels as blocks
from remeshvec import Adaptive, OptionError, find_creases, remesh
from remeshvec.mesh.edges import edge_keys, unique_edges

SHAPES = {
    "plate": (cad_parts.plate, 0.4),
    "noisy": (lambda: zoo.perturb(*zoo.icosphere(3), 0.1), 0.15),
    "mask": (lambda: voxels.level_surface(voxels.ball(6)), 2.0),
    "open": (zoo.grid, 0.5),
    "sheets": (zoo.ZOO["two_cubes_on_an_edge"].make, 0.6),
}


def as_set(edges):
    return set(map(tuple, edges.tolist()))


@pytest.mark.parametrize("name", SHAPES)
def test_the_same_as_the_call_keeps(name):
    make, length = SHAPES[name]
    V, F = make()
    edges, dropped = find_creases(V, F, length, return_dropped=True)
    assert edges.dtype == np.int64 and edges.shape == (len(edges), 2)
    assert (edges[:, 0] < edges[:, 1]).all() and len(as_set(edges)) == len(edges)
    result = remesh(V, F, length)
    features = result.report.features
    assert features["crease_edges"] == len(edges)
    for reason in ("noise", "echo", "terrace", "short", "crowded"):
        assert features[f"dropped_{reason}"] == len(dropped[reason])
    assert as_set(edges) <= as_set(result.input_feature_edges)
    known = as_set(unique_edges(np.asarray(F)))
    for found in (edges, result.input_feature_edges, *dropped.values()):
        assert as_set(found) <= known
    assert np.array_equal(find_creases(V, F, length), edges)


def test_passed_on_they_give_the_same_mesh():
    V, F = cad_parts.plate()
    edges = find_creases(V, F, 0.5)
    one, two = remesh(V, F, 0.5), remesh(V, F, 0.5, feature_angle=None, feature_edges=edges)
    assert np.array_equal(one.V, two.V) and np.array_equal(one.F, two.F)
    fewer = remesh(V, F, 0.5, feature_angle=None, feature_edges=edges[10:])
    assert fewer.report.features["crease_edges"] == len(edges) - 10


def test_edges_of_unconnected_faces_are_edges_of_the_input():
    """Every face has vertices of its own, as in STL files: edges are named by those of one face."""
    V, F = cad_parts.plate()
    soup_V, soup_F = V[F].reshape(-1, 3), np.arange(F.size).reshape(-1, 3)
    edges = find_creases(soup_V, soup_F, 0.5)
    keys = edge_keys(unique_edges(soup_F).T, len(soup_V))
    assert np.isin(edge_keys(edges.T, len(soup_V)), keys).all()
    places = {tuple(sorted(map(tuple, soup_V[edge]))) for edge in edges}
    assert places == {
        tuple(sorted(map(tuple, V[list(edge)]))) for edge in cad_parts.creases_of(V, F)
    }
    again = remesh(soup_V, soup_F, 0.5, feature_angle=None, feature_edges=edges)
    assert again.report.features["crease_edges"] == len(edges)


def test_what_is_asked_for_is_among_them():
    V, F = zoo.grid()
    assert len(find_creases(V, F, 0.5)) == 0, "the boundary is not"
    assert find_creases(V, F, 0.5, feature_edges=[[11, 6]]).tolist() == [[6, 11]]
    labels = (V[F].mean(axis=1)[:, 0] < 2).astype(int)
    border = find_creases(V, F, 0.5, face_labels=labels)
    assert len(border) == 4 and (V[border][:, :, 0] == 2).all()
    edges, dropped = find_creases(*zoo.cube(), 0.1, feature_angle=30.0, return_dropped=True)
    assert len(edges) == 12 and dropped == {}


def test_lengths_and_counts():
    """What a crease is depends on the length, however it is given."""
    V, F = cad_parts.prism(cad_parts.regular(12), 1.5)
    many, few = len(find_creases(V, F, 0.1)), len(find_creases(V, F, 0.8))
    assert (many, few) == (36, 24)
    assert len(find_creases(V, F, np.full(len(V), 0.8))) == few
    assert len(find_creases(V, F, n_faces=3000)) == many
    assert len(find_creases(V, F, n_vertices=30)) == few
    assert len(find_creases(V, F, Adaptive(0.01))) in (few, many)


def test_what_cannot_work():
    V, F = zoo.cube()
    with pytest.raises(
        TypeError, match=r"find_creases\(\) got an unexpected keyword argument 'angle'"
    ):
        find_creases(V, F, 0.1, angle=30.0)
    with pytest.raises(OptionError, match="exclude each other"):
        find_creases(V, F, 0.1, n_faces=100)


def test_corners_have_an_angle_of_their_own():
    V, F = zoo.grid()
    assert len(remesh(V, F, 0.5).corners) == 4
    assert len(remesh(V, F, 0.5, corner_angle=100).corners) == 0
    assert len(remesh(V, F, 0.5, feature_angle=100.0).corners) == 0, "by default that of creases"
    assert len(remesh(V, F, 0.5, feature_angle=100.0, corner_angle=60).corners) == 4


def test_borders_of_painted_labels_come_out_smooth():
    """One pixel is half of the length: every bend would be a corner."""
    V, F, labels = voxels.painted_sheet()
    result = remesh(V, F, 2.0, face_labels=labels)
    assert len(result.corners) < 20 and result.report.features["crease_edges"] > 100
    assert result.report.quality_after.min_angle > 20
    assert set(result.face_labels) == {0, 1, 2}
    for label in (0, 1, 2):
        assert n_parts(result.F[result.face_labels == label]) == n_parts(F[labels == label])


@pytest.mark.parametrize("L", [1.5, 2.0, 3.0])
def test_corners_beside_zigzags_stay_and_those_of_zigzags_do_not(L):
    """A square's corner lies within 2 L of a border that climbs from pixel to pixel."""
    V, F, labels = voxels.painted_sheet()
    result = remesh(V, F, L, face_labels=labels)
    found = set(map(tuple, result.V[result.corners, :2].tolist()))
    square = {(x, y) for x in (0.0, 30.0) for y in (0.0, 30.0)}
    ends = {(0.0, 14.0), (0.0, 20.0), (30.0, 22.0), (30.0, 28.0)}
    assert found == square | ends


@pytest.mark.parametrize("direction", [(1, 0, 0), (0.8, 0.5, 0.33), (1, 1, 0.2)])
def test_borders_around_a_ball_of_blocks_have_no_corners(direction):
    x, y, z = voxels.grid(30)
    V, F = blocks(x**2 + y**2 + z**2 < 10**2)
    normals = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    voxel = np.round(V[F].mean(axis=1) - 0.4 * normals - 0.5)  # normals have length 1
    labels = ((voxel - voxel.mean(axis=0)) @ direction > 0).astype(int)
    for L in (1.5, 2.0, 3.0, 4.0):
        assert len(remesh(V, F, L, face_labels=labels).corners) == 0


def n_parts(F):
    """Number of pieces that hang together by their edges."""
    edges = unique_edges(F)
    vertices, edges = np.unique(edges, return_inverse=True)
    i, j = edges.reshape(-1, 2).T
    n = len(vertices)
    return connected_components(coo_matrix((np.ones(len(i)), (i, j)), (n, n)), directed=False)[0]
