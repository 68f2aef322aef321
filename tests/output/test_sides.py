"""Paths over faces to a vertex, by which births across a slit are told from those on the own side."""

import numpy as np
import pytest
from helpers import naive

from data.shapes import textured
from remeshvec import remesh
from remeshvec.output.sides import _DETOUR, _NEARBY, _find_paths, _path_lengths, locate_corners


def provenance(V, F, uv, L):
    """What a result holds of the last mesh and of the reference, until births were asked for."""
    return remesh(V, F, L, preserve=uv, feature_angle=None)._corner_births._make.args[0]


@pytest.mark.parametrize("shape", [textured.cylinder, textured.torus, textured.slit])
def test_paths_are_those_of_the_twin(shape):
    V, F, uv = shape()
    V = V + np.random.default_rng(3).normal(size=V.shape) * 0.02
    p = provenance(V, F, uv, 0.2)
    tree, X = p.reference.tree, p.mesh.X[:, :3]
    corners = p.mesh.origin.reshape(-1, 3)[p.rows][:60]
    start = locate_corners(p)[0][:60, 1]
    birth = (p.births()[0] // 3).astype(np.int32)
    v, w = corners[:, 0].astype(np.int64), corners[:, 1]
    for goal in (birth, birth[::-1].copy()):  # their own faces, and ones far away
        near, length = _path_lengths(p, v, w, start, goal)
        for i in range(len(v)):
            known, face = naive.path_lengths(
                tree, start[i], goal[v[i]], X[v[i]], X[w[i]], _DETOUR, _NEARBY
            )
            assert length[i] == pytest.approx(known, rel=1e-9)
            ours, theirs = (
                naive.closest_on_triangle(X[v[i]], *tree.corners[f].reshape(3, 3))[1]
                for f in (near[i], face)
            )
            assert ours == pytest.approx(theirs, abs=1e-12)


def nudged(x, rng):
    """Numbers of which each is the next larger or smaller one, or the same."""
    return np.nextafter(x, x + rng.integers(-1, 2, x.shape))


@pytest.mark.parametrize("shape", [textured.cylinder, textured.torus, textured.slit])
def test_rounding_does_not_decide_between_paths(shape):
    """The regular shapes are full of paths that are equally long, but for rounding."""
    p = provenance(*shape(), 0.2)
    tree, X = p.reference.tree, p.mesh.X
    corners = p.mesh.origin.reshape(-1, 3)[p.rows][:300]
    start = locate_corners(p)[0][:300, 1].astype(np.int32)
    v, w = corners[:, 0].astype(np.int64), corners[:, 1]
    rng = np.random.default_rng(5)

    def lengths(tree, X, goal):
        seen, found = np.zeros(len(tree.patch), np.int32), np.full(len(v), np.inf)
        _find_paths(tree, X, v, w, start.copy(), goal, seen, found)
        return found

    far = rng.integers(len(tree.patch), size=len(X)).astype(np.int32)
    for goal in ((p.births()[0] // 3).astype(np.int32), far):
        known = lengths(tree, X, goal)
        for _ in range(5):
            rough = tree._replace(corners=nudged(tree.corners, rng))
            assert lengths(rough, nudged(X, rng), goal) == pytest.approx(known, rel=1e-9)


def test_no_path_leads_across_a_seam():
    """Straight across it is near; over the surface the path goes around, or there is none."""
    V, F, uv = textured.cylinder()
    p = provenance(V, F, uv, 0.3)
    left, right = np.flatnonzero(uv[:, :, 0].min(axis=1) == 0), uv[:, :, 0].max(axis=1) == 1
    place = np.empty(len(F), np.int64)
    place[p.face_source] = np.arange(len(F))
    middle = V[F].mean(axis=1)
    p.mesh.X[: len(left), :3] = middle[left]
    across = [
        np.flatnonzero(right)[np.linalg.norm(middle[right] - m, axis=1).argmin()]
        for m in middle[left]
    ]
    n = len(left)
    birth = np.zeros(len(p.mesh.X), np.int32)
    birth[:n] = place[left]
    p.mesh.X[n : 2 * n, :3] = middle[across]
    v, w = np.arange(n), np.arange(n, 2 * n).astype(np.int32)
    straight = np.linalg.norm(middle[left] - middle[across], axis=1)
    _, own = _path_lengths(p, v, w, place[left], birth)
    _, length = _path_lengths(p, v, w, place[across], birth)
    assert np.allclose(own, straight) and straight.max() < 0.4
    assert (length > 3.0).all()
