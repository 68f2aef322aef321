"""Loops are closed by faces that bend little: known cases, all triangulations of a small loop."""

from itertools import product

import numpy as np
import pytest

from remeshvec.scans.triangulate import triangulate


def loop_edges(n):
    return {frozenset((i, (i + 1) % n)) for i in range(n)}


def edges_of(faces):
    return [frozenset(e) for f in faces for e in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0]))]


def unit_normals(P, faces):
    a, b, c = (P[faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    return n / np.linalg.norm(n, axis=1)[:, None]


def all_triangulations(i, j):
    """Every way to close the chain of points from i to j, as lists of faces (j, m, i)."""
    if j == i + 1:
        return [[]]
    return [
        [(j, m, i), *left, *right]
        for m in range(i + 1, j)
        for left, right in product(all_triangulations(i, m), all_triangulations(m, j))
    ]


def sharpest(P, outer, faces):
    """The largest negative cosine of a bend, by looking at every edge."""
    normals = unit_normals(P, np.array(faces))
    sides: dict = {}
    for k, edges in enumerate(zip(*[iter(edges_of(faces))] * 3, strict=True)):
        for edge in edges:
            sides.setdefault(edge, []).append(normals[k])
    for i in range(len(P)):
        sides[frozenset((i, (i + 1) % len(P)))].append(outer[i])
    return max(-(a @ b) for a, b in sides.values())


def no_chords(n):
    return np.zeros((n, n), bool)


def saddle(n, seed):
    rng = np.random.default_rng(seed)
    a = 2 * np.pi * np.arange(n) / n
    P = np.stack([np.cos(a), -np.sin(a), 0.4 * np.cos(2 * a)], axis=1)
    P += 0.05 * rng.normal(size=P.shape)
    outer = rng.normal(size=P.shape) * 0.3 + [0, 0, 1.0]
    return P, outer / np.linalg.norm(outer, axis=1)[:, None]


@pytest.mark.parametrize("seed", range(6))
def test_few_triangulations_bend_less(seed):
    """Every chord remembers one way to close what it cuts off, so the best may be missed by a little."""
    P, outer = saddle(8, seed)
    faces = triangulate(P, outer, no_chords(8))
    every = [sharpest(P, outer, other) for other in all_triangulations(0, 7)]
    assert len(every) == 132  # the Catalan number
    assert sharpest(P, outer, faces.tolist()) <= np.quantile(every, 0.08)
    assert min(every) < np.median(every) - 0.1


def test_a_flat_loop_has_short_edges():
    n = 24
    a = -2 * np.pi * np.arange(n) / n
    P = np.stack([4 * np.cos(a), np.sin(a), 0 * a], axis=1)
    faces = triangulate(P, np.tile([0, 0, 1.0], (n, 1)), no_chords(n))
    assert len(faces) == n - 2
    assert unit_normals(P, faces) == pytest.approx(np.tile([0, 0, 1.0], (n - 2, 1)))
    longest = max(np.linalg.norm(P[list(e)][0] - P[list(e)][1]) for e in edges_of(faces.tolist()))
    assert longest < 2.5  # across the ellipse, not along it


def test_straight_sides_give_no_face_without_area():
    """A square hole with six points a side: three neighbours on a side make no triangle."""
    side = np.arange(6.0)
    zero = np.zeros(6)
    P = np.concatenate(
        [
            np.stack([zero, side, zero], axis=1),
            np.stack([side, zero + 6, zero], axis=1),
            np.stack([zero + 6, 6 - side, zero], axis=1),
            np.stack([6 - side, zero, zero], axis=1),
        ]
    )
    faces = triangulate(P, np.tile([0, 0, 1.0], (24, 1)), no_chords(24))
    assert unit_normals(P, faces) == pytest.approx(np.tile([0, 0, 1.0], (22, 1)))


def test_every_edge_has_its_faces():
    P, outer = saddle(30, 1)
    edges = edges_of(triangulate(P, outer, no_chords(30)).tolist())
    uses = {edge: edges.count(edge) for edge in edges}
    assert {edge for edge, k in uses.items() if k == 1} == loop_edges(30)
    assert set(uses.values()) == {1, 2}


def test_taken_chords_are_left_out():
    P, outer = saddle(5, 0)
    taken = no_chords(5)
    for free in ((0, 2), (1, 3)):
        taken[:] = True
        taken[free] = taken[free[::-1]] = False
        assert triangulate(P, outer, taken) is None  # a pentagon needs two chords
    taken[:] = True
    for chord in ((0, 2), (0, 3)):
        taken[chord] = taken[chord[::-1]] = False
    edges = set(edges_of(triangulate(P, outer, taken).tolist()))
    assert edges == loop_edges(5) | {frozenset((0, 2)), frozenset((0, 3))}
