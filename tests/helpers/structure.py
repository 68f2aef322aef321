"""Build half-edge meshes in tests, read them back, and check every array of them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from data.shapes import topology
from remeshvec.core.vocabulary import (
    CURVE,
    DEAD,
    FIXED,
    FROZEN,
    HALTED,
    HELD,
    INNER,
    NON_MANIFOLD,
    NONE,
    PINNED,
    Blocks,
    Mesh,
    Tree,
)
from remeshvec.features.curves import link_chains
from remeshvec.input.constraints import make_constraints
from remeshvec.input.options import RemeshOptions
from remeshvec.mesh.blocks import make_blocks
from remeshvec.mesh.halfedge import build_mesh
from remeshvec.mesh.morton import order_mesh
from remeshvec.operations.project import locate_vertices, project_vertices
from remeshvec.reference.build import FeaturedReference, build_reference
from remeshvec.reference.bvh import build_tree
from remeshvec.reference.surface import Reference


def built(V, F, ordered: bool = False, length: float = 1.0) -> Mesh:
    """Half-edge mesh of clean arrays, vertices and faces as they come (or in Morton order)."""
    V, F = np.asarray(V, dtype=float), np.asarray(F, dtype=np.int32)
    if ordered:
        X, F, *_ = order_mesh(V, F, False)
    else:
        X = np.column_stack([V, np.zeros(len(V))])
    mesh, *_ = build_mesh(X, F)
    mesh.X[:, 3] = length
    mesh.birth[:] = mesh.vertex_halfedge
    return mesh


def cut_open(V, F) -> tuple[Mesh, np.ndarray]:
    """Half-edge mesh of a surface with edges of three faces and more; where its vertices come from."""
    X = np.column_stack([np.asarray(V, float), np.ones(len(V))])
    mesh, _, source = build_mesh(X, np.asarray(F, np.int32))
    mesh.birth[:] = mesh.vertex_halfedge
    return mesh, source


def tree_of(mesh: Mesh, parallel: bool = False) -> Tree:
    patch = np.zeros(mesh.origin.size // 3, np.int32)
    return build_tree(mesh.X, mesh.origin.reshape(-1, 3), mesh.twin, patch, parallel)


def draw(mesh: Mesh, *paths) -> list[int]:
    """Put curves along paths of vertices, named as in `polyline`; returns a half-edge of each edge.

    Vertices where other than two edges of curves meet become fixed. Births are left as they are.
    """
    drawn = [h for path in paths for a, b in pairwise(path) for h in half_edges(mesh, a, b)[:1]]
    for h in drawn:
        t = int(mesh.twin[h])
        mesh.curve[h] = name = h if t == NONE else min(h, t)
        if t != NONE:
            mesh.curve[t] = name
    meeting = curve_edges(mesh)
    for v in {int(v) for edge in meeting for v in edge}:
        mesh.kind[v] = CURVE if sum(v in edge for edge in meeting) == 2 else FIXED
    return drawn


def curve_edges(mesh: Mesh) -> dict[frozenset[int], int]:
    """Map edges on curves, as pairs of vertices, to their curve."""
    found = {}
    for h in np.flatnonzero((mesh.curve != NONE) & (mesh.origin != DEAD)).tolist():
        found[frozenset(ends(mesh, h))] = int(mesh.curve[h])
    return found


def featured(
    mesh: Mesh, length: float | None = None, vertex_source=None, parallel: bool = False, **wanted
) -> FeaturedReference:
    """Find and mark the features of a mesh: all that `build_reference` returns.

    ``wanted`` are the keywords of `make_constraints`, in terms of the vertices before the surface was
    cut; no creases unless ``feature_angle`` is among them. ``length`` None leaves lengths as they are.
    """
    if length is not None:
        mesh.X[:, 3] = length
    if vertex_source is None:
        vertex_source = np.arange(len(mesh.X), dtype=np.int32)
    F = vertex_source[mesh.origin.reshape(-1, 3)].astype(np.int64)
    constraints = make_constraints(
        int(F.max()) + 1, F, RemeshOptions(**{"feature_angle": None, **wanted})
    )
    marks = constraints.on_mesh(mesh, vertex_source, np.arange(len(F)), None)
    mean_edge = mean_edge_of(mesh)
    return build_reference(
        mesh, vertex_source, constraints.feature_angle, marks, mean_edge, parallel
    )


def mean_edge_of(mesh: Mesh) -> float:
    """Mean length of the edges."""
    once = mesh.twin < np.arange(mesh.origin.size)
    F = mesh.origin.reshape(-1, 3)
    P = mesh.X[:, :3]
    return float(np.linalg.norm(P[F[:, [1, 2, 0]]] - P[F], axis=2).ravel()[once].mean())


def links_of(mesh: Mesh, is_feature) -> np.ndarray:
    """What follows and what precedes every feature half-edge on its curve, (2, 3 m)."""
    curves = link_chains(mesh.origin, mesh.twin, is_feature, len(mesh.X))
    links = np.full((2, mesh.origin.size), NONE, np.int32)
    for row, places in zip(links, (curves.after, curves.before), strict=True):
        row[curves.edges] = np.where(places == NONE, NONE, curves.edges[places])
    return links


def referenced(mesh: Mesh, length: float | None = None, **wanted) -> Reference:
    """Only the reference surface of `featured`."""
    return featured(mesh, length, **wanted).reference


def project(mesh: Mesh, reference, blocks: Blocks | None = None, parallel: bool = False) -> None:
    """Project, looking at the whole surface."""
    project_vertices(mesh, blocks or one_block(mesh), reference, 0.0, parallel)


def locate(mesh: Mesh, reference, blocks: Blocks | None = None, parallel: bool = False):
    return locate_vertices(mesh, blocks or one_block(mesh), reference, 0.0, parallel)


def one_block(mesh: Mesh) -> Blocks:
    return Blocks(
        np.array([0, mesh.origin.size // 3], np.int64),
        np.array([0, mesh.vertex_halfedge.size], np.int64),
    )


def blocks_of(mesh: Mesh, faces_per_block: int, monkeypatch) -> Blocks:
    monkeypatch.setattr("remeshvec.mesh.blocks.FACES_PER_BLOCK", faces_per_block)
    return make_blocks(mesh)


def copied(mesh: Mesh) -> Mesh:
    return Mesh(*(array.copy() for array in mesh))


def packed(mesh: Mesh) -> Mesh:
    """Twin of `compact`: live faces in their order, live vertices in that of their half-edges."""
    alive = mesh.origin[::3] != DEAD
    corners = np.flatnonzero(np.repeat(alive, 3))
    vertices = np.flatnonzero(mesh.vertex_halfedge != DEAD)
    vertices = vertices[np.argsort(mesh.vertex_halfedge[vertices])]
    new_corner = np.full(3 * len(alive), NONE, np.int32)
    new_corner[corners] = np.arange(len(corners))
    new_vertex = np.full(len(mesh.X), NONE, np.int32)
    new_vertex[vertices] = np.arange(len(vertices))
    twin = mesh.twin[corners]
    return Mesh(
        new_vertex[mesh.origin[corners]],
        np.where(twin == NONE, np.int32(NONE), new_corner[twin]),
        mesh.curve[corners],
        mesh.source[alive],
        new_corner[mesh.vertex_halfedge[vertices]],
        mesh.valence_excess[vertices],
        mesh.X[vertices],
        mesh.kind[vertices],
        mesh.birth[vertices],
    )


def faces_of(mesh: Mesh) -> np.ndarray:
    """Live faces."""
    F = mesh.origin.reshape(-1, 3)
    return F[F[:, 0] != DEAD]


def half_edge(mesh: Mesh, a: int, b: int) -> int:
    """Find the half-edge from a to b."""
    return next(h for h in half_edges(mesh, a, b) if mesh.origin[h] == a)


def half_edges(mesh: Mesh, a: int, b: int) -> list[int]:
    """Find the two half-edges between a and b, or the one on the boundary."""
    F = mesh.origin.reshape(-1, 3)
    G = np.roll(F, -1, axis=1)
    f, c = np.nonzero(((a == F) & (b == G)) | ((b == F) & (a == G)))
    assert 1 <= len(f) <= 2, f"edge {a}-{b} has {len(f)} sides"
    return (3 * f + c).tolist()


def assert_same_bits(one: Mesh, two: Mesh) -> None:
    """Compare all that is defined: of dead elements only that they are dead."""
    for name, x, y in zip(Mesh._fields, one, two, strict=True):
        assert x.shape == y.shape and x.dtype == y.dtype, name
    assert np.array_equal(one.origin, two.origin)
    alive = one.origin != DEAD
    assert np.array_equal(one.twin[alive], two.twin[alive])
    assert np.array_equal(one.curve[alive], two.curve[alive])
    assert np.array_equal(one.source[alive[::3]], two.source[alive[::3]])
    assert np.array_equal(one.vertex_halfedge, two.vertex_halfedge)
    used = one.vertex_halfedge != DEAD
    assert np.array_equal(one.valence_excess[used], two.valence_excess[used])
    assert np.array_equal(one.kind[used], two.kind[used])
    assert np.array_equal(one.birth[used], two.birth[used])
    assert one.X[used].tobytes() == two.X[used].tobytes()


def assert_valid(mesh: Mesh, slits: bool = False) -> None:
    """Check every array against the definitions in `Mesh`.

    ``slits`` allows an edge whose two sides are boundaries, which a cut leaves.
    """
    m, n = mesh.origin.size // 3, mesh.vertex_halfedge.size
    assert mesh.origin.shape == mesh.twin.shape == mesh.curve.shape == (3 * m,)
    assert mesh.source.shape == (m,)
    assert mesh.X.shape == (n, 4) and mesh.X.dtype == np.float64
    assert mesh.valence_excess.shape == mesh.kind.shape == mesh.birth.shape == (n,)
    origin, twin = mesh.origin.tolist(), mesh.twin.tolist()

    F = mesh.origin.reshape(-1, 3)
    dead = (F == DEAD).any(axis=1)
    assert (F[dead] == DEAD).all(), "half a face is dead"
    assert F[~dead].min() >= 0 and F[~dead].max() < n
    assert mesh.source[~dead].min() >= 0
    assert (F[~dead] != np.roll(F[~dead], 1, axis=1)).all(), "a face repeats a vertex"

    outgoing: dict[int, list[int]] = {}
    seen = set()
    for h in np.flatnonzero(mesh.origin != DEAD).tolist():
        a, b = origin[h], origin[next_of(h)]
        assert (a, b) not in seen, f"edge {a}-{b} is there twice"
        seen.add((a, b))
        outgoing.setdefault(a, []).append(h)
        t = twin[h]
        if t == NONE:
            assert slits or (b, a) not in seen, f"edge {a}-{b} is there twice"
            continue
        assert 0 <= t < 3 * m and origin[t] != DEAD, "twin of a dead face"
        assert twin[t] == h and t != h, "twins are not mutual"
        assert (origin[t], origin[next_of(t)]) == (b, a), "twins do not run opposite ways"

    used = np.zeros(n, bool)
    used[list(outgoing)] = True
    assert ((mesh.vertex_halfedge != DEAD) == used).all(), "dead vertices"
    assert np.isfinite(mesh.X[used]).all() and (mesh.X[used, 3] > 0).all()
    on_curve = mesh.curve != NONE
    inner = np.flatnonzero((mesh.origin != DEAD) & (mesh.twin != NONE))
    assert (on_curve[inner] == on_curve[mesh.twin[inner]]).all(), "a curve on one side only"
    assert (mesh.curve[inner] == mesh.curve[mesh.twin[inner]]).all(), "sides on different curves"
    assert on_curve[(mesh.origin != DEAD) & (mesh.twin == NONE)].all(), "a boundary off all curves"
    for v, leaving in outgoing.items():
        open_ones = [h for h in leaving if twin[h] == NONE]
        start = int(mesh.vertex_halfedge[v])
        assert start in leaving, f"vertex_halfedge[{v}] leaves another vertex"
        assert len(open_ones) <= 1, f"vertex {v} is on several boundary loops"
        assert not open_ones or open_ones == [start], f"boundary vertex {v} starts inside"
        assert walk(origin, twin, start) == sorted(leaving), f"vertex {v} is no single fan"
        valence = len(leaving) + len(open_ones)
        ideal = [4] if open_ones else [3, 4, 5, 6] if mesh.kind[v] == HELD else [6]
        assert valence - mesh.valence_excess[v] in ideal, f"valence of {v}"
        at_curve = sum(on_curve[h] for h in leaving) + len(open_ones)
        assert at_curve == 2 or mesh.kind[v] != CURVE, f"vertex {v} ends or joins curves"
        # Edges that a guard has halted are on no curve.
        is_on_curve = open_ones or any(on_curve[h] and mesh.curve[h] != HALTED for h in leaving)
        kinds = (CURVE, PINNED, FIXED) if is_on_curve else (INNER, HELD, FIXED)
        assert mesh.kind[v] in kinds, f"kind of {v}"


def assert_on_reference(mesh: Mesh, reference: Reference) -> None:
    """Check that vertices, faces and edges know where they belong: on the same curve, in one patch."""
    chain = chains_of(reference)
    patch = reference.tree.patch
    alive = np.flatnonzero(mesh.origin != DEAD)
    on_curve = alive[mesh.curve[alive] >= 0]
    names = mesh.curve[on_curve] & (NON_MANIFOLD - 1)
    assert (reference.tree.twin[names] == NONE).all(), "an edge on a curve that does not exist"
    inside = alive[(mesh.curve[alive] == NONE) & (mesh.twin[alive] != NONE)]
    own, across = patch[mesh.source[inside // 3]], patch[mesh.source[mesh.twin[inside] // 3]]
    assert (own == across).all(), "faces beside an inner edge in different patches"
    for h in alive.tolist():
        v = mesh.origin[h]
        if mesh.kind[v] in (INNER, HELD):
            here = patch[mesh.birth[v] // 3]
            assert here == patch[mesh.source[h // 3]], f"vertex {v} was born in another patch"
    for h, name in zip(on_curve.tolist(), names.tolist(), strict=True):
        for v in ends(mesh, h):
            if mesh.kind[v] == CURVE:
                assert chain[mesh.birth[v]] == chain[name], f"vertex {v} was born on another curve"
            else:
                assert mesh.kind[v] == FIXED, f"vertex {v} on a curve"
    frozen = alive[mesh.curve[alive] == FROZEN]
    frozen_ends = [v for h in frozen for v in ends(mesh, h)]
    assert (mesh.kind[frozen_ends] == FIXED).all(), "a frozen edge with an end that may move"


def curve_neighbours(reference: Reference) -> np.ndarray:
    """Names of the neighbours at both ends of every half-edge that is a name, (2, 3 m)."""
    return reference.curve_neighbours[:, reference.curve_row]


def chains_of(reference: Reference) -> np.ndarray:
    """Equal numbers for edges of the same polyline, by their names."""
    h = np.arange(len(reference.origin))
    if not reference.curve_neighbours.shape[1]:
        return h
    pairs = np.array(
        [(i, j) for side in curve_neighbours(reference) for i, j in enumerate(side) if j != NONE]
    )
    graph = coo_matrix((np.ones(len(pairs)), pairs.reshape(-1, 2).T), shape=(len(h), len(h)))
    return connected_components(graph, directed=False)[1]


def ends(mesh: Mesh, h: int) -> tuple[int, int]:
    """Vertices that a half-edge joins, its origin first."""
    return int(mesh.origin[h]), int(mesh.origin[next_of(int(h))])


def place(mesh: Mesh, h: int) -> frozenset[tuple]:
    """Where the ends of an edge lie, whichever way it runs; -0 counts as 0."""
    return frozenset(tuple((mesh.X[v, :3] + 0.0).tolist()) for v in ends(mesh, h))


def next_of(h: int) -> int:
    return h - 2 if h % 3 == 2 else h + 1


def walk(origin, twin, start: int) -> list[int]:
    """Outgoing half-edges met by turning counter-clockwise from one, sorted."""
    met, h = [start], start
    while True:
        h = twin[h + 2 if h % 3 == 0 else h - 1]
        if h == NONE or h == start:
            return sorted(met)
        assert h not in met
        met.append(h)


def shape_of(F) -> dict[str, object]:
    """What no phase may change."""
    return {
        "euler": topology.euler_number(F),
        "components": topology.components(F),
        "loops": len(topology.boundary_loops(F)),
        "oriented": topology.is_oriented(F),
        "manifold": topology.is_vertex_manifold(F),
        "duplicate faces": topology.duplicate_faces(F),
        "proper": len(topology.proper(F)) == len(F),
    }
