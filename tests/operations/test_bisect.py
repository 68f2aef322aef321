"""Splits in place: the mesh is whole after each, nothing long is left, the flags stay true."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.dead_elements import (
    CLOSED,
    OPEN,
    few_long,
    holed,
    longest_edge,
    numbers,
    spotted,
    with_room,
)
from helpers.siblings import opened, siblings_of
from helpers.structure import (
    assert_on_reference,
    assert_same_bits,
    assert_valid,
    built,
    copied,
    curve_edges,
    draw,
    faces_of,
    half_edges,
    one_block,
    packed,
    shape_of,
)
from helpers.threads import on_threads, shuffled

from data.shapes import nonmanifold
from remeshvec.core.vocabulary import CURVE, DEAD, FIXED, FROZEN, HALTED, NONE
from remeshvec.mesh.blocks import make_blocks
from remeshvec.mesh.walk import ends_of
from remeshvec.operations import split as module
from remeshvec.operations.bisect import bisect_edges
from remeshvec.operations.classify import classify_edges
from remeshvec.operations.split import split_long_edges


def assert_true(flags, mesh, blocks):
    """The flags are what is measured anew."""
    fresh = classify_edges(mesh, blocks, flags.longest, flags.shortest, False)
    assert np.array_equal(flags.mask, fresh.mask)
    return fresh


def bisect(mesh, blocks, longest=1.0, shortest=0.5, parallel=False):
    """Split in place; returns how many were split and are left, after all checks of the flags."""
    flags = classify_edges(mesh, blocks, longest, shortest, parallel)
    n_split, n_left = bisect_edges(mesh, blocks, flags, parallel)
    fresh = assert_true(flags, mesh, blocks)
    assert n_left == fresh.n_long
    return n_split, n_left


# --- one at a time -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*OPEN, *CLOSED, "triangle", "tetrahedron"])
def test_each_split_leaves_a_whole_mesh(name):
    """There is room for a single one; then the mesh is looked at, and gets room for the next."""
    mesh, reference = spotted(name, 0)
    shape = shape_of(faces_of(mesh))
    area = zoo.area(mesh.X[:, :3], faces_of(mesh))
    total = 0
    for step in range(60):
        mesh = with_room(packed(mesh), 2, 1, np.random.default_rng(step))
        faces, vertices = numbers(mesh)
        rim = len(naive.boundary_edges(faces_of(mesh)))
        n_split, n_left = bisect(mesh, one_block(mesh))
        assert n_split == 1 or not n_left
        assert_valid(mesh)
        assert_on_reference(mesh, reference)
        on_rim = len(naive.boundary_edges(faces_of(mesh))) - rim
        assert numbers(mesh) == (faces + 2 * n_split - on_rim, vertices + n_split)
        total += n_split
        if not n_left:
            break
    assert total > 0
    assert shape_of(faces_of(mesh)) == shape
    assert zoo.area(mesh.X[:, :3], faces_of(mesh)) == pytest.approx(area)


def test_the_longest_edge_of_both_faces_goes_first():
    """The first needle wants the edge that they share, the second one a longer edge of its own.

    Were needles to cut one another's shorter edges, vertices would meet in one place.
    """
    V = np.array([[0, 0, 0], [9.0, 0.05, 0], [10.0, 0, 0], [4.5, 0.1, 0]])
    F = np.array([[0, 1, 3], [0, 2, 1]])
    mesh = with_room(built(V, F), 2, 1, np.random.default_rng(0))
    mesh.X[:, 3] = 1.0
    assert bisect(mesh, one_block(mesh))[0] == 1
    X = mesh.X[mesh.vertex_halfedge != DEAD, :3]
    assert (X == [5.0, 0, 0]).all(axis=1).any()


def test_a_split_is_that_of_the_twin():
    """Inside and on the boundary; the longest edge is the only one that is too long."""
    for name in ("square", "tetrahedron", "planar_delaunay", "annulus"):
        V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.05)
        edges = sorted(naive.edges(F), key=lambda e: naive.edge_length(V, e))
        limit = naive.edge_length(V, edges[-2]) * (1 + 1e-9)
        for a, b in [sorted(edges[-1])]:
            mesh = with_room(built(V, F), 2, 1)
            before = copied(mesh)
            assert bisect(mesh, one_block(mesh), limit, 0.0) == (1, 0)
            W, G = naive.split(V, F, a, b)
            new = len(V)
            assert np.array_equal(mesh.X[:, :3], W)
            assert mesh.X[new, 3] == 1.0
            turned = lambda F: sorted(tuple(np.roll(f, -np.argmin(f)).tolist()) for f in F)  # noqa: E731
            assert turned(faces_of(mesh)) == turned(G)
            for array, old in zip(mesh[6:], before[6:], strict=True):
                assert np.array_equal(array[:new], old[:new])


def at_corner(mesh, v):
    """Faces around a vertex as sets of places."""
    return {
        frozenset(tuple(p) for p in mesh.X[f, :3].tolist())
        for f in faces_of(mesh)
        if v in f.tolist()
    }


def test_the_midpoint_is_what_a_new_mesh_has_there():
    """Kind, length and birth, on curves of all sorts: those of `split`, bit for bit."""
    V, F = zoo.perturb(*zoo.grid(9, 8), amount=0.1)
    rng = np.random.default_rng(0)
    web = built(V, F)
    draw(web, [8 * i + 3 for i in range(1, 8)], [32 + j for j in range(8)])
    web.kind[rng.random(len(web.kind)) < 0.2] += 1  # held, pinned, fixed
    web.kind[web.kind > FIXED] = FIXED
    web.birth[:] = rng.permutation(len(web.birth))
    web.source[:] = rng.permutation(len(web.source))
    seen = set()
    for a, b in sorted(map(sorted, naive.edges(F))):
        mesh = copied(web)
        mesh.X[[a, b], 3] = 0.3 * naive.edge_length(V, (a, b))
        mesh.X[np.setdiff1d(np.arange(len(V)), [a, b]), 3] = 100.0
        fresh, count = split_long_edges(mesh, one_block(mesh), 2.0, False)
        assert count == 1
        fresh = packed(fresh)
        mesh = with_room(mesh, 2, 1)
        assert bisect(mesh, one_block(mesh), 2.0, 0.0)[0] == 1
        place = (mesh.X[a, :3] + mesh.X[b, :3]) * 0.5
        (u,) = np.flatnonzero((fresh.X[:, :3] == place).all(axis=1))
        v = len(V)
        assert np.array_equal(fresh.X[u], mesh.X[v])
        assert fresh.kind[u] == mesh.kind[v] and fresh.birth[u] == mesh.birth[v]
        assert fresh.valence_excess[u] == mesh.valence_excess[v]
        assert at_corner(fresh, u) == at_corner(mesh, v)
        assert by_place(fresh) == by_place(mesh)
        seen.add((int(mesh.kind[v]), int(web.kind[a]), int(web.kind[b])))
    assert len(seen) > 12


def by_place(mesh):
    """Curves and sources, by the places of edges and faces."""
    at = [tuple(p) for p in mesh.X[:, :3].tolist()]
    curves = {frozenset(at[v] for v in edge): name for edge, name in curve_edges(mesh).items()}
    alive = np.flatnonzero(mesh.origin[::3] != DEAD)
    sources = {
        frozenset(at[v] for v in mesh.origin[3 * f : 3 * f + 3]): int(mesh.source[f]) for f in alive
    }
    return curves, sources


@pytest.mark.parametrize("flag", [FROZEN, HALTED])
def test_frozen_edges_stay_however_long(flag):
    """Up to twice their target length: beside longer ones there always is a long edge."""
    V, F = zoo.perturb(*zoo.grid(7, 6), amount=0.05)
    mesh = with_room(built(V, F, length=0.6), 4000, 2000)
    rng = np.random.default_rng(1)
    chosen = [sorted(e) for e in naive.edges(F) if rng.random() < 0.2]
    mesh.kind[:] = FIXED
    for a, b in chosen:
        mesh.curve[half_edges(mesh, a, b)] = flag
        mesh.X[[a, b], 3] = np.maximum(mesh.X[[a, b], 3], 0.7 * naive.edge_length(V, (a, b)))
    n_split, n_left = bisect(mesh, one_block(mesh))
    assert n_split > len(F) and n_left == 0
    assert_valid(mesh)
    frozen = set(map(frozenset, chosen))
    assert {edge for edge, name in curve_edges(mesh).items() if name == flag} == frozen
    long = {
        edge
        for edge in naive.edges(faces_of(mesh))
        if naive.edge_length(mesh.X[:, :3], edge) > mesh.X[list(edge), 3].mean()
    }
    assert long and long <= frozen


def test_needles_end():
    """In half-edge order a long neighbour could move to a new slot again and again."""
    for length in (50.0, 200.0):
        V = np.array([[0, 0, 0], [length, 0, 0], [length / 2, 1e-3, 0], [length / 2, -1e-3, 0]])
        mesh = with_room(built(V, [[0, 1, 2], [1, 0, 3]]), 40_000, 20_000)
        n_split, n_left = bisect(mesh, one_block(mesh))
        assert length < n_split < 100 * length and n_left == 0
        assert_valid(mesh)
        assert not naive.long_edges(mesh.X[:, :3], faces_of(mesh), 1.0)


def test_faces_that_end_up_behind_are_split_in_the_next_round():
    """The new face lies before the old one, only it wants more, and only the face across says so."""
    V = np.array([[0, 0, 0], [1.9, 0, 0], [0.45, 0.1, 0], [1, -1, 0]])
    mesh = built(V, [[1, 2, 0], [1, 0, 3]])
    mesh.X[3, 3] = 100.0
    n = 12
    dead = with_room(mesh, n, n)
    order = np.r_[6 : 6 + 3 * n, :6]
    shift = lambda h: np.where(h == NONE, NONE, h + 3 * n).astype(np.int32)  # noqa: E731
    mesh = dead._replace(
        origin=dead.origin[order],
        twin=shift(dead.twin)[order],
        curve=dead.curve[order],
        source=np.zeros(n + 2, np.int32),
        vertex_halfedge=np.r_[shift(mesh.vertex_halfedge), dead.vertex_halfedge[4:]],
    )
    assert_valid(mesh)
    assert bisect(mesh, one_block(mesh)) == (2, 0)
    assert_valid(mesh)


def test_siblings_are_never_split_in_place():
    """All of a group must be, whatever room their blocks have."""
    mesh, _ = opened(*nonmanifold.COMPLEXES["two_cubes"].make(), 1.0, feature_angle=40.0)
    mesh = with_room(mesh, 500, 500)
    mesh.X[:, 3] = 2 * longest_edge(mesh.X[:, :3], faces_of(mesh))
    siblings = siblings_of(mesh)
    mesh.X[ends_of(mesh.origin, siblings[0][:1]), 3] = 0.1
    flags = classify_edges(mesh, one_block(mesh), 1.0, 0.0, False)
    assert 0 < 2 * flags.n_long <= flags.n_gone and 16 * flags.n_long <= len(flags.mask)
    before = copied(mesh)
    refined, count = split_long_edges(mesh, one_block(mesh), 1.0, False, siblings)
    assert count and refined is not mesh
    assert_same_bits(mesh, before)


# --- many blocks ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "per_block"), [(0, 20), (1, 250)])
@pytest.mark.parametrize("name", [*OPEN, *CLOSED])
def test_nothing_long_is_left_in_any_number_of_blocks(name, seed, per_block, monkeypatch):
    mesh, reference = holed(name, seed, per_block, monkeypatch)
    blocks = make_blocks(mesh)
    assert_valid(mesh)
    shape, before = shape_of(faces_of(mesh)), numbers(mesh)
    n_split, n_left = bisect(mesh, blocks)
    assert n_split > 3
    assert_valid(mesh)
    assert_on_reference(mesh, reference)
    assert shape_of(faces_of(mesh)) == shape
    assert numbers(mesh)[1] == before[1] + n_split
    assert numbers(mesh)[0] <= before[0] + 2 * n_split
    if not n_left:
        assert classify_edges(mesh, blocks, 1.0, 0.5, False).n_long == 0
        assert bisect(mesh, blocks) == (0, 0)


@pytest.mark.parametrize("per_block", [20, 60])
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", [*OPEN, *CLOSED])
def test_any_order_of_blocks_gives_the_same_bits(name, seed, per_block, monkeypatch):
    mesh, _ = holed(name, seed, per_block, monkeypatch)
    blocks = make_blocks(mesh)
    done = copied(mesh)
    expected = bisect(done, blocks)
    for order in range(3):
        other = copied(mesh)
        with shuffled(order):
            assert bisect(other, blocks, parallel=True) == expected
        assert_same_bits(other, done)
    other = copied(mesh)
    with on_threads(4):
        assert bisect(other, blocks, parallel=True) == expected
    assert_same_bits(other, done)


@pytest.mark.parametrize("name", ["torus", "annulus", "genus_2"])
def test_new_elements_lie_in_the_block_of_their_parents(name, monkeypatch):
    """Or near: between the middles of two."""
    mesh, _ = holed(name, 0, 60, monkeypatch)
    blocks = make_blocks(mesh)
    was_dead = mesh.vertex_halfedge == DEAD
    flags = classify_edges(mesh, blocks, 1.0, 0.5, False)
    monkeypatch.setattr("remeshvec.operations.bisect.stages", lambda _: (0,))
    bisect_edges(mesh, blocks, flags, False)
    new = np.flatnonzero(was_dead & (mesh.vertex_halfedge != DEAD))
    assert len(new)
    of_face = np.searchsorted(blocks.face, np.arange(len(mesh.origin) // 3), side="right")
    of_vertex = np.searchsorted(blocks.vertex, np.arange(len(mesh.X)), side="right")
    for v in new.tolist():
        assert of_face[mesh.vertex_halfedge[v] // 3] == of_vertex[v]


def test_dead_elements_may_hold_anything():
    """What is left in them comes from whatever lay in memory."""
    mesh, _ = spotted("annulus")
    done = []
    for seed in range(4):
        other = with_room(mesh, 400, 200, np.random.default_rng(seed))
        assert bisect(other, one_block(other))[0] > 5
        done.append(packed(other))
        assert_same_bits(done[0], done[-1])


# --- as a part of `split_long_edges` -------------------------------------------------------------


@pytest.mark.parametrize("name", [*OPEN, *CLOSED])
def test_few_long_edges_are_split_in_place(name):
    """All of them at once, and the flags say afterwards what is short."""
    mesh, reference = few_long(name, 2)
    shape = shape_of(faces_of(mesh))
    flags = classify_edges(mesh, one_block(mesh), 1.0, 0.3, False)
    assert flags.n_long > 0
    same, count = split_long_edges(mesh, one_block(mesh), 1.0, False, None, flags)
    assert same is mesh and count > 0
    assert_true(flags, mesh, one_block(mesh))
    assert_valid(mesh)
    assert_on_reference(mesh, reference)
    assert shape_of(faces_of(mesh)) == shape
    assert split_long_edges(mesh, one_block(mesh), 1.0, False) == (mesh, 0)


@pytest.mark.parametrize(("faces", "vertices"), [(6, 1), (7, 300), (400, 2), (400, 0), (1, 300)])
def test_where_room_runs_out_the_mesh_is_written_anew(faces, vertices):
    """With what was split in place, counted all in all."""
    mesh, reference = spotted("annulus", 1)
    n = len(mesh.X)
    mesh = with_room(mesh, faces, vertices)
    flags = classify_edges(mesh, one_block(mesh), 1.0, 0.3, False)
    flags = flags._replace(n_gone=10**6)  # so that it is tried
    refined, count = split_long_edges(mesh, one_block(mesh), 1.0, False, None, flags)
    assert refined is not mesh and count > min(vertices, faces // 2)
    assert_valid(mesh)
    assert_valid(refined)
    assert_on_reference(refined, reference)
    assert numbers(refined)[1] == n + count
    assert shape_of(faces_of(refined)) == shape_of(faces_of(mesh))


def test_many_long_edges_are_not_split_in_place():
    mesh, _ = spotted("torus")
    mesh = with_room(mesh, 10**4, 10**4)
    before = copied(mesh)
    refined, count = split_long_edges(mesh, one_block(mesh), 0.05, False)
    assert refined is not mesh and count > len(faces_of(mesh)) // 2
    assert_same_bits(mesh, before)


def test_curves_keep_their_vertices():
    """A curve vertex made in place has two edges of the curve, in the middle of the old one."""
    mesh, _ = few_long("closed_cylinder", 3)
    edges = curve_edges(mesh)
    before = set(np.flatnonzero(mesh.vertex_halfedge != DEAD).tolist())
    split_long_edges(mesh, one_block(mesh), 1.0, False)
    new = [v for v in np.flatnonzero(mesh.vertex_halfedge != DEAD).tolist() if v not in before]
    found = curve_edges(mesh)
    for v in new:
        at = [(edge, name) for edge, name in found.items() if v in edge]
        assert (mesh.kind[v] == CURVE) == (len(at) == 2)
        assert len({name for _, name in at}) <= 1
    assert set(found.values()) == set(edges.values())


def test_when_it_is_tried(monkeypatch):
    """Below a sixteenth of the faces, and with two free faces for each."""
    mesh, _ = few_long("torus", 1)
    called = []
    monkeypatch.setattr(module, "bisect_edges", lambda *a: called.append(a) or (0, 1))
    flags = classify_edges(mesh, one_block(mesh), 1.0, 0.3, False)
    size = len(flags.mask)
    for n_long, n_gone, expected in [
        (size // 16, size, 1),
        (size // 16 + 1, size, 0),
        (10, 20, 1),
        (10, 19, 0),
        (0, 0, 1),
    ]:
        called.clear()
        split_long_edges(
            mesh, one_block(mesh), 1.0, False, None, flags._replace(n_long=n_long, n_gone=n_gone)
        )
        assert len(called) == expected
