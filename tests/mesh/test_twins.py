"""Twins: pairs, fans and counts as sets and lists give them, for any faces and order of the pieces."""

import time
from collections import defaultdict

import numpy as np
import pytest
from helpers import zoo
from helpers.threads import on_threads, shuffled

from data.shapes import topology
from remeshvec.core.vocabulary import CURVE, INNER, NONE
from remeshvec.mesh.twins import PINCHED, match_halfedges
from remeshvec.mesh.walk import next_halfedge, previous_halfedge


def matched(F, n, by_winding=True):
    """Match on one thread, on three, and with the pieces in some other order: the same each time."""
    origin = np.ascontiguousarray(F, np.int32).reshape(-1)
    before = origin.copy()
    one = match_halfedges(origin, n, False, by_winding)
    with on_threads(3):
        others = [match_halfedges(origin, n, True, by_winding)]
    with on_threads(3), shuffled():
        others.append(match_halfedges(origin, n, True, by_winding))
    assert np.array_equal(origin, before)
    whole = [k for k in range(n) if one.kind[k] != PINCHED]
    for other in others:
        assert np.array_equal(one.twin, other.twin) and one.found == other.found
        if by_winding:
            assert np.array_equal(one.curve, other.curve) and np.array_equal(one.kind, other.kind)
            for x, y in ((one.vertex_halfedge, other.vertex_halfedge),
                         (one.valence_excess, other.valence_excess)):  # fmt: skip
                assert np.array_equal(x[whole], y[whole])
    return one


def half_edges_by_edge(F):
    """Half-edges of every undirected edge, as (number, start)."""
    edges = defaultdict(list)
    for f, corners in enumerate(np.asarray(F).tolist()):
        for c in range(3):
            a, b = corners[c], corners[(c + 1) % 3]
            edges[min(a, b), max(a, b)].append((3 * f + c, a))
    return edges


def naive_twins(F):
    twin = [NONE] * (3 * len(F))
    for users in half_edges_by_edge(F).values():
        if len(users) == 2 and users[0][1] != users[1][1]:
            (g, _), (h, _) = users
            twin[g], twin[h] = h, g
    return twin


def naive_fans(F, twin):
    """Fans of every vertex: lists of the half-edges that leave it, joined through twins."""
    fans = defaultdict(list)
    seen = set()
    for first in range(3 * len(F)):
        if first in seen:
            continue
        fan, rest = [], [first]
        while rest:
            h = rest.pop()
            if h in seen:
                continue
            seen.add(h)
            fan.append(h)
            for g in (
                twin[previous_halfedge(h)],
                next_halfedge(twin[h]) if twin[h] != NONE else NONE,
            ):
                if g != NONE:
                    rest.append(int(g))
        fans[int(np.reshape(F, -1)[first])].append(sorted(fan))
    return fans


def assert_as_naive(F, n):
    F = np.array(topology.proper(F), np.int32).reshape(-1, 3)
    result = matched(F, n)
    twin = naive_twins(F)
    assert result.twin.tolist() == twin
    assert result.curve.tolist() == [h if t == NONE else NONE for h, t in enumerate(twin)]
    fans = naive_fans(F, twin)
    for v in range(n):
        if len(fans[v]) > 1:
            assert result.kind[v] == PINCHED
        elif fans[v]:
            (fan,) = fans[v]
            ends = [h for h in fan if twin[h] == NONE]
            assert result.kind[v] == (CURVE if ends else INNER)
            assert result.vertex_halfedge[v] == (ends or [max(fan)])[0]
            assert result.valence_excess[v] == len(fan) - (3 if ends else 6)
        else:
            assert result.kind[v] == INNER and result.valence_excess[v] == -6
    users = half_edges_by_edge(F).values()
    found = result.found
    assert found.non_manifold_edges == sum(len(u) > 2 for u in users)
    assert found.inconsistent_edges == sum(len(u) == 2 and u[0][1] == u[1][1] for u in users)
    assert found.pinched_vertices == sum(len(parts) > 1 for parts in fans.values())
    rings = [fan for parts in fans.values() if len(parts) == 1 for fan in parts]
    rings = [fan for fan in rings if len(fan) == 2 and all(twin[h] != NONE for h in fan)]
    assert found.doubled_faces == 2 * len(rings)


@pytest.mark.parametrize("name", zoo.ZOO)
def test_the_zoo(name):
    V, F = zoo.ZOO[name].make()
    rng = np.random.default_rng(len(F))
    assert_as_naive(F, len(V))
    assert_as_naive(rng.permutation(len(V))[F], len(V))  # vertices in no order
    turned = np.where(rng.random(len(F))[:, None] < 0.3, F[:, [0, 2, 1]], F)
    assert_as_naive(turned, len(V))
    assert_as_naive(np.vstack([F, F[:3], F[2:5, ::-1]]), len(V))
    assert_as_naive(F[rng.random(len(F)) < 0.6], len(V))


@pytest.mark.parametrize("seed", range(60))
def test_random_faces(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(4, 14))
    assert_as_naive(rng.integers(0, n, (rng.integers(1, 60), 3)), n)


@pytest.mark.parametrize("seed", range(30))
def test_pairs_of_any_winding(seed):
    rng = np.random.default_rng(seed)
    F = topology.proper(rng.integers(0, 9, (rng.integers(1, 25), 3)))
    twin = [NONE] * (3 * len(F))
    for users in half_edges_by_edge(F).values():
        if len(users) == 2:
            (g, _), (h, _) = users
            twin[g], twin[h] = h, g
    assert matched(F, 9, by_winding=False).twin.tolist() == twin


def test_more_threads_than_faces():
    with on_threads(8):
        result = match_halfedges(np.array([0, 1, 2], np.int32), 3, True)
    assert result.twin.tolist() == [NONE] * 3 and result.kind.tolist() == [CURVE] * 3


@pytest.mark.parametrize("first", [0, 1])
def test_a_hub_of_any_size_takes_linear_time(first):
    """The same for a bundle of faces on one edge."""
    _, F = zoo.bipyramid(150_000)
    F = ((F + first) % 150_002).astype(np.int32).reshape(-1)
    rim = np.arange(100_000) + 2
    book = np.column_stack([0 * rim, 0 * rim + 1, rim]).astype(np.int32).reshape(-1)
    match_halfedges(F[:30], 150_002, False)  # compiled before the clock starts
    start = time.perf_counter()
    assert (match_halfedges(F, 150_002, False).kind == INNER).all()
    assert match_halfedges(book, 100_002, False).found.non_manifold_edges == 1
    assert time.perf_counter() - start < 5.0  # about 0.03 s; quadratic time would be minutes
