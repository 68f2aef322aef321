"""Faces that cross others: all pairs of a slow twin, and known numbers."""

import numpy as np
import pytest
from helpers import zoo
from helpers.threads import on_threads, shuffled

from remeshvec.reference.bvh import build_tree
from remeshvec.reference.crossings import crossing_faces


def tree_over(V, F):
    nothing = np.full(F.size, -1, np.int32)
    return build_tree(
        np.asarray(V, float), F.astype(np.int32), nothing, np.zeros(len(F), np.int32), False
    )


def found(V, F):
    return crossing_faces(tree_over(V, F), False).tolist()


def naive(V, F):
    """Every edge of every face against every face that it shares no corner with, by determinants."""
    crossing = set()
    for f, A in enumerate(F):
        for i in range(3):
            p, q = A[i], A[(i + 1) % 3]
            for g, B in enumerate(F):
                if f == g or p in B or q in B:
                    continue
                a, b, c = V[B]
                s, t = (np.linalg.det([b - a, c - a, V[v] - a]) for v in (p, q))
                u = [
                    np.linalg.det([V[q] - V[p], x - V[p], y - V[p]])
                    for x, y in ((a, b), (b, c), (c, a))
                ]
                if s * t < -1e-20 and (min(u) > 0 or max(u) < 0):
                    crossing |= {f, g}
    return sorted(crossing)


@pytest.mark.parametrize("seed", range(4))
def test_soups_cross_as_in_the_twin(seed):
    rng = np.random.default_rng(seed)
    V = rng.random((40, 3))
    F = np.array([rng.choice(40, 3, replace=False) for _ in range(60)])
    assert found(V, F) == naive(V, F)
    assert len(found(V, F)) > 10


@pytest.mark.parametrize("seed", range(4))
def test_only_some_are_asked(seed):
    """The ones that are asked for and cross any other, and those others."""
    rng = np.random.default_rng(seed)
    V = rng.random((40, 3))
    F = np.array([rng.choice(40, 3, replace=False) for _ in range(60)])
    is_asked = rng.random(60) < 0.2
    tree = tree_over(V, F)
    pairs = {(f, g) for f in range(60) for g in range(f) if len(naive(V, F[[f, g]])) == 2}
    some = crossing_faces(tree, False, False, is_asked).tolist()
    apart = [pair for pair in pairs if not set(F[pair[0]].tolist()) & set(F[pair[1]].tolist())]
    expected = sorted({f for pair in apart if is_asked[list(pair)].any() for f in pair})
    assert some == expected
    assert 5 < len(some) < len(crossing_faces(tree, False, False))


@pytest.mark.parametrize("name", ["icosphere", "torus", "cube", "grid", "two_cubes_on_an_edge"])
def test_surfaces_that_only_touch_do_not_cross(name):
    V, F = getattr(zoo, name)()
    assert found(V, F) == []
    assert found(*zoo.perturb(V, F, 0.01)) == []


def test_two_spheres_cross_along_a_circle():
    V, F = zoo.icosphere(1)
    W, G = zoo.joined((V, F), (V, F), shift=0.9)
    crossing = found(W, G)
    assert crossing == naive(W, G)
    assert len(crossing) > 10


def test_any_order_and_number_of_threads():
    V, F = zoo.icosphere(3)
    tree = tree_over(*zoo.joined((V, F), (V, F), shift=0.9))
    expected = crossing_faces(tree, False)
    for n in (1, 2, 4):
        with on_threads(n):
            assert np.array_equal(crossing_faces(tree, True), expected)
    for order in range(3):
        with shuffled(order):
            assert np.array_equal(crossing_faces(tree, True), expected)
