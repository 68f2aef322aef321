"""Overshoot: seen from the midpoint before anything else, then again from where the vertex would go."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.collapses import LOOSE
from helpers.structure import (
    assert_same_bits,
    assert_valid,
    blocks_of,
    built,
    copied,
    faces_of,
    one_block,
)

from remeshvec.core.vocabulary import CURVE, DEAD, FIXED, HELD, INNER
from remeshvec.operations.collapse import CollapseLimits, collapse_short_edges
from remeshvec.operations.outcomes import COLLAPSED, KEPT_CURVE, KEPT_OVERSHOOT

MESHES = [
    "torus",
    "planar_delaunay",
    "annulus",
    "icosahedron",
    "genus_2",
    "tetrahedron",
    "bipyramid",
]


def limits(longest, reach=0.0):
    return LOOSE._replace(longest=longest, quadric_reach=reach)


def with_short_edge(name, a, b, seed=0):
    """Mesh with lengths that vary a little, whose edge a-b is the only short one."""
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.05, seed=seed)
    V[b] = V[a] + 1e-3 * (V[b] - V[a]) / np.linalg.norm(V[b] - V[a])
    mesh = built(V, F)
    mesh.X[:, 3] = np.random.default_rng(seed).uniform(0.9, 1.1, len(V))
    return mesh


def meeting_point(mesh, a, b):
    """Place and length: at the larger kind, or in the middle."""
    if mesh.kind[a] == mesh.kind[b]:
        return (mesh.X[a] + mesh.X[b]) / 2
    return mesh.X[max((a, b), key=lambda v: mesh.kind[v])]


def excesses(mesh, at, ends):
    """Of all edges from a place to the rings of both ends: length over their mean target length."""
    ring = naive.neighbours(faces_of(mesh))
    around = sorted((ring[ends[0]] | ring[ends[1]]) - set(ends))
    away = np.linalg.norm(mesh.X[around, :3] - at[:3], axis=1)
    return dict(zip(around, away / (0.5 * (mesh.X[around, 3] + at[3])), strict=True))


def edges_of(name, count=25):
    edges = sorted(map(sorted, naive.edges(zoo.ZOO[name].make()[1])))
    return edges[:: max(1, len(edges) // count)]


@pytest.mark.parametrize("name", MESHES)
def test_one_long_edge_is_enough_wherever_it_is(name):
    """The limit lies below the longest, then above: nothing but this vertex of the rings tells."""
    seen = set()
    for a, b in edges_of(name):
        mesh = with_short_edge(name, a, b)
        found = excesses(mesh, meeting_point(mesh, a, b), (a, b))
        if min(mesh.kind[a], mesh.kind[b]) == CURVE:
            continue  # they have slack, below
        worst = max(found.values())
        before = copied(mesh)
        tally = collapse_short_edges(mesh, one_block(mesh), limits(worst * (1 - 1e-9)), False)
        assert tally[KEPT_OVERSHOOT] == 1 and tally.sum() == 1
        assert_same_bits(mesh, before)
        tally = collapse_short_edges(mesh, one_block(mesh), limits(worst * (1 + 1e-9)), False)
        assert tally[KEPT_OVERSHOOT] == 0 and tally.sum() == 1
        seen.add(int(np.flatnonzero(tally)[0]))
        assert_valid(mesh)
    assert COLLAPSED in seen or name == "tetrahedron"


@pytest.mark.parametrize("kind", [HELD, FIXED])
@pytest.mark.parametrize("name", MESHES)
def test_from_where_the_vertex_stays(name, kind):
    """Not from the midpoint, where one of the ends is held; the other end may be in the way of itself."""
    for a, b in edges_of(name, 12):
        for end in (a, b):
            mesh = with_short_edge(name, a, b)
            if mesh.kind[a] != INNER or mesh.kind[b] != INNER:
                continue
            mesh.kind[end] = kind
            mesh.X[a + b - end, :3] += 5e-4  # so that the places differ
            worst = max(excesses(mesh, mesh.X[end], (a, b)).values())
            for share, refused in ((1 - 1e-9, 1), (1 + 1e-9, 0)):
                again = copied(mesh)
                tally = collapse_short_edges(again, one_block(again), limits(worst * share), False)
                assert tally[KEPT_OVERSHOOT] == refused and tally.sum() == 1


def test_the_edge_itself_does_not_count():
    """However long the limit lets it be: at a vertex of three edges it is the third one too."""
    V, F = zoo.tetrahedron()
    F = [*F.tolist()]
    f = F.pop(0)
    V = np.vstack([V, V[f].mean(axis=0)])
    F += [[f[0], f[1], 4], [f[1], f[2], 4], [f[2], f[0], 4]]
    mesh = built(V, F)
    mesh.kind[f[0]] = FIXED
    others = set(map(frozenset, ((f[0], 4),)))
    short = naive.edge_length(V, (f[0], 4)) * (1 + 1e-9)
    assert naive.short_edges(V, F, short) >= others
    tally = collapse_short_edges(
        mesh, one_block(mesh), limits(1e9)._replace(shortest=short, longest=1e9), False
    )
    assert tally[KEPT_OVERSHOOT] == 0 and tally[COLLAPSED] > 0
    assert_valid(mesh)


@pytest.mark.parametrize("name", ["annulus", "planar_delaunay", "grid", "cylinder"])
def test_slack_along_curves(name):
    """Edges to inner vertices may become half as long again, those along the curve may not."""
    _, F = zoo.ZOO[name].make()
    rim = sorted(map(sorted, naive.boundary_edges(F)))
    for a, b in rim[::3]:
        mesh = with_short_edge(name, a, b)
        at = meeting_point(mesh, a, b)
        found = excesses(mesh, at, (a, b))
        if not found or any(mesh.kind[v] == FIXED for v in (a, b)):
            continue
        worst = max(x / (1.5 if mesh.kind[v] == INNER else 1.0) for v, x in found.items())
        for share, refused in ((1 - 1e-9, 1), (1 + 1e-9, 0)):
            again = copied(mesh)
            tally = collapse_short_edges(again, one_block(again), limits(worst * share), False)
            if tally[KEPT_CURVE]:
                break
            assert tally[KEPT_OVERSHOOT] == refused and tally.sum() == 1


@pytest.mark.parametrize("reach", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("per_block", [20, 10**6])
@pytest.mark.parametrize("name", ["torus", "planar_delaunay", "icosphere", "genus_2", "annulus"])
def test_no_collapse_makes_a_long_edge(name, per_block, reach, monkeypatch):
    """Whatever the quadric point; edges that were too long before may stay so, none is added."""
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), n=1, noise=0.3)
    mesh = built(V, F, ordered=True, length=1.5 * zoo.mean_edge(V, F))
    mesh.X[:, 3] *= np.random.default_rng(1).uniform(0.8, 1.25, len(V))
    before = too_long(mesh, 1.3)
    rim = set(np.flatnonzero(mesh.kind != INNER).tolist())
    blocks = blocks_of(mesh, per_block, monkeypatch)
    tally = collapse_short_edges(mesh, blocks, CollapseLimits(0.8, 1.3, 0.7, reach, False), False)
    assert tally[COLLAPSED] > 5 and tally[KEPT_OVERSHOOT] > 0
    assert_valid(mesh)
    after = too_long(mesh, 1.3)
    assert {e for e in after - before if not e & rim} == set()
    assert all(x <= 1.5 * (1 + 1e-12) for e, x in ratios(mesh, after - before).items())


def ratios(mesh, edges):
    X = mesh.X
    return {
        e: naive.edge_length(X[:, :3], e) / (1.3 * X[list(e), 3].mean()) for e in edges
    }  # fmt: skip


def too_long(mesh, factor):
    X = mesh.X
    return {
        e
        for e in naive.edges(faces_of(mesh))
        if naive.edge_length(X[:, :3], e) > factor * X[list(e), 3].mean() * (1 + 1e-12)
    }


def test_dead_ends_are_no_candidates():
    """Flags of edges that vanish beside a collapse are passed over."""
    V, F = zoo.perturb(*zoo.icosphere(3), amount=0.1)
    mesh = built(V, F, ordered=True, length=3 * zoo.mean_edge(V, F))
    tally = collapse_short_edges(
        mesh, one_block(mesh), CollapseLimits(0.9, 9.0, 0.0, 0, False), False
    )
    assert tally[COLLAPSED] > 200
    assert tally[COLLAPSED] == (mesh.vertex_halfedge == DEAD).sum()
    assert_valid(mesh)
