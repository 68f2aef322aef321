"""Build half-edge meshes in tests, read them back, and check every array of them."""

from __future__ import annotations

import numpy as np
import topology

from remeshvec._types import APEX, BOUNDARY, DEAD, FIXED, INNER, NONE, Blocks, Mesh, Tree
from remeshvec.bvh import build_tree
from remeshvec.edge_sets import make_blocks
from remeshvec.halfedge import build_mesh
from remeshvec.operations.project import locate_vertices, project_vertices
from remeshvec.order import order_mesh


def built(V, F, ordered: bool = False) -> Mesh:
    """Half-edge mesh of clean arrays, vertices and faces as they come (or in Morton order)."""
    V, F = np.asarray(V, dtype=float), np.asarray(F, dtype=np.int32)
    if ordered:
        X, F, *_ = order_mesh(V, F, False)
    else:
        X = np.column_stack([V, np.zeros(len(V))])
    mesh, _ = build_mesh(X, F)
    mesh.birth[:] = mesh.vertex_halfedge
    return mesh


def tree_of(mesh: Mesh, parallel: bool = False) -> Tree:
    return build_tree(mesh.X, mesh.origin.reshape(-1, 3), mesh.twin, parallel)


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
    monkeypatch.setattr("remeshvec.edge_sets.FACES_PER_BLOCK", faces_per_block)
    return make_blocks(mesh)


def copied(mesh: Mesh) -> Mesh:
    return Mesh(*(array.copy() for array in mesh))


def faces_of(mesh: Mesh) -> np.ndarray:
    """Live faces."""
    F = mesh.origin.reshape(-1, 3)
    return F[F[:, 0] != DEAD]


def half_edge(mesh: Mesh, a: int, b: int) -> int:
    """Find the half-edge from a to b."""
    F = mesh.origin.reshape(-1, 3)
    f, c = np.nonzero((a == F) & (np.roll(F, -1, axis=1) == b))
    assert len(f) == 1
    return int(3 * f[0] + c[0])


def assert_same_bits(one: Mesh, two: Mesh) -> None:
    """Compare all that is defined: of dead elements only that they are dead."""
    for name, x, y in zip(Mesh._fields, one, two, strict=True):
        assert x.shape == y.shape and x.dtype == y.dtype, name
    assert np.array_equal(one.origin, two.origin)
    alive = one.origin != DEAD
    assert np.array_equal(one.twin[alive], two.twin[alive])
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
    assert mesh.origin.shape == mesh.twin.shape == (3 * m,)
    assert mesh.X.shape == (n, 4) and mesh.X.dtype == np.float64
    assert mesh.valence_excess.shape == mesh.kind.shape == mesh.birth.shape == (n,)
    origin, twin = mesh.origin.tolist(), mesh.twin.tolist()

    F = mesh.origin.reshape(-1, 3)
    dead = (F == DEAD).any(axis=1)
    assert (F[dead] == DEAD).all(), "half a face is dead"
    assert F[~dead].min() >= 0 and F[~dead].max() < n
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
    assert np.isfinite(mesh.X[used, :3]).all()
    for v, leaving in outgoing.items():
        open_ones = [h for h in leaving if twin[h] == NONE]
        start = int(mesh.vertex_halfedge[v])
        assert start in leaving, f"vertex_halfedge[{v}] leaves another vertex"
        assert len(open_ones) <= 1, f"vertex {v} is on several boundary loops"
        assert not open_ones or open_ones == [start], f"boundary vertex {v} starts inside"
        assert walk(origin, twin, start) == sorted(leaving), f"vertex {v} is no single fan"
        valence = len(leaving) + len(open_ones)
        assert mesh.valence_excess[v] == valence - (4 if open_ones else 6), f"valence of {v}"
        kinds = (BOUNDARY, FIXED) if open_ones else (INNER, APEX, FIXED)
        assert mesh.kind[v] in kinds, f"kind of {v}"


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
