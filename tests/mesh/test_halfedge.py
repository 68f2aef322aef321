"""The build: twins, one-rings, boundary starts, and what dirt becomes."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import (
    assert_same_bits,
    assert_valid,
    built,
    copied,
    faces_of,
    half_edge,
    walk,
)

from data.shapes import topology
from remeshvec.core.vocabulary import CURVE, DEAD, FIXED, INNER, NONE
from remeshvec.mesh.blocks import make_blocks
from remeshvec.mesh.halfedge import build_mesh
from remeshvec.mesh.morton import order_mesh
from remeshvec.mesh.walk import next_halfedge, previous_halfedge
from remeshvec.operations.split import compact

TINY = ["triangle", "square", "tetrahedron", "octahedron", "sliver_fan"]


def build_dirty(V, F):
    """Build as `prepare` does, but keep duplicates; returns the mesh, the report, and the order."""
    F = np.asarray(F)[[len(set(f)) == 3 for f in np.asarray(F).tolist()]]
    ordered = order_mesh(np.asarray(V, float), F.astype(np.int32), False)
    mesh, found, source = build_mesh(ordered.X, ordered.F)
    mesh.X[:, 3] = 1.0
    # Every vertex is a copy of the one that it comes from; the first copy keeps its number.
    assert np.array_equal(mesh.X[:, :3], ordered.X[source, :3])
    assert np.array_equal(source[: len(ordered.X)], np.arange(len(ordered.X)))
    assert np.array_equal(source[faces_of(mesh)], ordered.F)
    return mesh, found, ordered


def test_following_and_previous_stay_in_the_face():
    for h in range(12):
        assert next_halfedge(h) // 3 == previous_halfedge(h) // 3 == h // 3
        assert next_halfedge(previous_halfedge(h)) == previous_halfedge(next_halfedge(h)) == h
        assert next_halfedge(h) == 3 * (h // 3) + (h + 1) % 3


@pytest.mark.parametrize("name", zoo.TIDY)
def test_tidy_meshes_are_connected_as_they_are(name):
    V, F = zoo.ZOO[name].make()
    mesh, found, source = build_mesh(np.column_stack([V, 1 + 0 * V[:, 0]]), F.astype(np.int32))
    assert_valid(mesh)
    assert not any(found)
    assert np.array_equal(faces_of(mesh), F)
    assert np.array_equal(mesh.X[:, :3], V)
    assert np.array_equal(source, np.arange(len(V)))
    assert np.array_equal(mesh.source, np.arange(len(F)))
    assert mesh.twin.tolist() == naive.twins(F)
    ring, ideal = naive.neighbours(F), naive.ideal_valence(F)
    assert [len(ring[v]) - ideal[v] for v in range(len(V))] == mesh.valence_excess.tolist()
    rim = {v for edge in naive.boundary_edges(F) for v in edge}
    assert [v in rim for v in range(len(V))] == (mesh.kind == CURVE).tolist()
    assert (mesh.kind[sorted(set(range(len(V))) - rim)] == INNER).all()
    h = np.arange(mesh.origin.size)
    assert np.array_equal(mesh.curve, np.where(mesh.twin == NONE, h, NONE))


@pytest.mark.parametrize("name", ["annulus", "genus_2", "planar_delaunay"])
def test_a_walk_visits_the_one_ring(name):
    V, F = zoo.ZOO[name].make()
    mesh = built(V, F)
    ring = naive.neighbours(F)
    for v in range(len(V)):
        met = walk(mesh.origin.tolist(), mesh.twin.tolist(), int(mesh.vertex_halfedge[v]))
        found = {int(mesh.origin[next_halfedge(h)]) for h in met}
        found |= {int(mesh.origin[previous_halfedge(h)]) for h in met}
        assert found == ring[v]


def test_boundary_half_edges_form_loops():
    mesh = built(*zoo.annulus())
    open_ones = np.flatnonzero(mesh.twin == NONE)
    lengths, seen = [], set()
    for first in open_ones.tolist():
        h, length = first, 0
        while h not in seen:
            seen.add(h)
            length += 1
            h = int(mesh.vertex_halfedge[mesh.origin[next_halfedge(h)]])
            assert mesh.twin[h] == NONE
        if length:
            assert h == first
            lengths.append(length)
    assert lengths == [16, 16]


@pytest.mark.parametrize("name", zoo.DIRTY)
def test_dirty_meshes_become_oriented_manifolds(name):
    V, F = zoo.ZOO[name].make()
    mesh, found, ordered = build_dirty(V, F)
    assert_valid(mesh, slits=True)
    assert len(faces_of(mesh)) == len(topology.proper(F))
    # Every corner lies where it was.
    assert np.array_equal(mesh.X[faces_of(mesh), :3], ordered.X[ordered.F, :3])
    shape = zoo.ZOO[name]
    assert (found.non_manifold_edges > 0) == (not shape.edge_manifold)
    if shape.edge_manifold and shape.oriented:
        assert found.inconsistent_edges == 0
    if not (shape.vertex_manifold and shape.oriented):
        assert found.pinched_vertices > 0


def test_an_edge_of_three_faces_is_cut():
    """Into three boundaries that lie in the same place; nothing is fixed, sheets are to agree later."""
    V, F = zoo.three_half_discs()
    mesh, found, _ = build_dirty(V, F)
    assert found.non_manifold_edges == 2 and found.inconsistent_edges == 0
    on_line = np.abs(mesh.X[:, 1:3]).max(axis=1) == 0
    assert on_line.sum() == 9  # three vertices, each once a sheet
    assert (mesh.kind == CURVE).all()
    assert len(zoo.boundary_loops(faces_of(mesh))) == 3
    ends = mesh.origin, mesh.origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    h = np.flatnonzero(on_line[ends[0]] & on_line[ends[1]])
    assert len(h) == 6 and (mesh.twin[h] == NONE).all() and np.array_equal(mesh.curve[h], h)


def test_equally_directed_faces_are_cut():
    V, F = zoo.square()
    mesh, found, _ = build_dirty(V, [F[0], F[1][::-1]])
    assert found.inconsistent_edges == 1 and found.non_manifold_edges == 0
    assert len(mesh.X) == 6 and (mesh.twin == NONE).all()
    assert (mesh.kind == CURVE).all()


def test_inconsistent_then_third_face_counts_once():
    V = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]]
    mesh, found, _ = build_dirty(V, [[0, 1, 2], [0, 1, 3], [1, 0, 4]])
    assert (found.non_manifold_edges, found.inconsistent_edges) == (1, 0)
    assert (mesh.twin == NONE).all()


def test_many_faces_on_one_edge_do_not_hang():
    n = 200
    V = np.vstack(
        [
            [[0, 0, 0], [0, 0, 1]],
            np.column_stack([np.cos(zoo.turn(n)), np.sin(zoo.turn(n)), 0 * zoo.turn(n)]),
        ]
    )
    F = np.array([[0, 1, k + 2] if k % 2 else [1, 0, k + 2] for k in range(n)])
    mesh, found, _ = build_dirty(V, F)
    assert found.non_manifold_edges == 1
    assert len(mesh.X) == 3 * n and (mesh.twin == NONE).all()
    assert_valid(mesh)
    _, copies = np.unique(mesh.X[:, :3], axis=0, return_counts=True)
    assert sorted(copies.tolist()) == [1] * n + [n, n]


def test_pinched_vertices_become_one_a_fan():
    for make, fans in ((zoo.bowtie, 2), (zoo.pinched_tetrahedra, 2)):
        V, F = make()
        mesh, found, _ = build_dirty(V, F)
        assert found.pinched_vertices == 1
        assert len(mesh.X) == len(V) + fans - 1
        assert (mesh.kind != FIXED).all()
        assert zoo.is_vertex_manifold(faces_of(mesh))


def test_the_input_is_not_modified():
    V, F = zoo.two_cubes_on_an_edge()
    X, F = np.column_stack([V, V[:, 0]]), F.astype(np.int32)
    before = X.copy(), F.copy()
    build_mesh(X, F)
    assert np.array_equal(X, before[0]) and np.array_equal(F, before[1])


# --- compact -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*TINY, "annulus"])
def test_compact_of_a_whole_mesh_only_renumbers(name):
    mesh = built(*zoo.ZOO[name].make())
    before = copied(mesh)
    packed = compact(mesh, make_blocks(mesh), False)
    assert_valid(packed)
    assert_same_bits(mesh, before)
    assert np.array_equal(packed.X[faces_of(packed)], mesh.X[faces_of(mesh)])
    again = compact(packed, make_blocks(packed), False)
    assert_same_bits(packed, again)


def test_compact_drops_what_is_dead():
    V, F = zoo.joined(zoo.grid(), zoo.tetrahedron(), shift=20.0)
    mesh = built(V, F)
    dead = F[: 2 * 24].max()  # the grid's faces come first: remove the whole component
    mesh.origin[: 3 * 48] = DEAD
    mesh.vertex_halfedge[: dead + 1] = DEAD
    packed = compact(mesh, make_blocks(mesh), False)
    assert_valid(packed)
    assert len(packed.X) == 4 and packed.origin.size == 12
    assert packed.X[:, 0].min() > 15


def test_half_edge_finds_what_it_should():
    mesh = built(*zoo.square())
    h = half_edge(mesh, 0, 2)
    assert mesh.origin[h] == 0 and mesh.origin[next_halfedge(h)] == 2
