"""The tree over the input: the closest face, against libigl and against looking at every face."""

import igl
import naive
import numpy as np
import pytest
import zoo
from remeshvec._jit import kernel
from remeshvec.bvh import STACK, build_tree, closest_face
from remeshvec.order import order_mesh

RNG = np.random.default_rng(11)


@kernel
def query(tree, P, hints, faces, weights, squared):
    stack = np.empty((2, STACK), np.int64)
    for i in range(len(P)):
        f, s, t, d = closest_face(tree, P[i, 0], P[i, 1], P[i, 2], hints[i], stack)
        faces[i], weights[i, 0], weights[i, 1], squared[i] = f, s, t, d


def closest(V, F, P, hints=None):
    """Faces, points and distances, through the tree over the mesh as ordered here."""
    tree = build_tree(V, F, False)
    faces, weights, squared = np.empty(len(P), int), np.empty((len(P), 2)), np.empty(len(P))
    if hints is None:
        hints = RNG.integers(len(F), size=len(P))
    query(tree, P, np.asarray(hints, np.int64), faces, weights, squared)
    a, b, c = np.moveaxis(V[F[faces], :3], 1, 0)
    s, t = weights[:, :1], weights[:, 1:]
    return faces, a + s * (b - a) + t * (c - a), np.sqrt(squared)


def in_order(V, F):
    ordered = order_mesh(np.asarray(V, float), np.asarray(F, np.int32), False)
    return ordered.X, ordered.F


@pytest.mark.parametrize("name", ["triangle", "square", "tetrahedron", "torus", "genus_3", "thin_sheet", "bipyramid"])
def test_distance_agrees_with_libigl(name):
    X, F = in_order(*zoo.ZOO[name].make())
    size = np.ptp(X[:, :3], axis=0).max()
    P = X[:, :3].mean(axis=0) + size * RNG.normal(size=(400, 3))
    _, points, distance = closest(X, F, P)
    squared, _, expected = igl.point_mesh_squared_distance(P, X[:, :3].copy(), F.astype(np.int64))
    assert distance == pytest.approx(np.sqrt(squared), rel=1e-9)
    assert np.linalg.norm(P - points, axis=1) == pytest.approx(distance, rel=1e-9)
    near = np.linalg.norm(points - expected, axis=1) < 1e-7 * size
    assert near.mean() > 0.9  # the others are as near to two places


@pytest.mark.parametrize("seed", range(3))
def test_on_the_surface_and_near_it(seed):
    X, F = in_order(*zoo.perturb(*zoo.icosphere(3), amount=0.1, seed=seed))
    corners = RNG.dirichlet((1, 1, 1), size=len(F))
    P = np.einsum("fc,fcx->fx", corners, X[F, :3])
    _, points, distance = closest(X, F, P)
    assert distance.max() < 1e-14
    P += 1e-3 * RNG.normal(size=P.shape)
    _, _, distance = closest(X, F, P)
    squared, _, _ = igl.point_mesh_squared_distance(P, X[:, :3].copy(), F.astype(np.int64))
    assert distance == pytest.approx(np.sqrt(squared), rel=1e-7, abs=1e-14)


def test_faces_without_area():
    V, F = zoo.torus(9, 6)
    flat = np.array([[0, 1, 1], [2, 2, 2], [5, 9, 14]])
    V[14] = (V[5] + V[9]) / 2
    X, F = in_order(V, np.vstack([F, flat]))
    P = RNG.normal(size=(100, 3))
    _, _, distance = closest(X, F, P)
    assert distance == pytest.approx([naive.distance_to_mesh(p, X[:, :3], F) for p in P])


def test_the_distance_does_not_depend_on_the_hint():
    X, F = in_order(*zoo.genus_2())
    P = RNG.normal(scale=2, size=(50, 3))
    distances = [closest(X, F, P, np.full(len(P), hint))[2] for hint in range(0, len(F), 7)]
    assert all(np.array_equal(distances[0], d) for d in distances)


def test_ties_go_to_the_hint():
    X, F = in_order(*zoo.square())
    for hint in (0, 1):
        faces, _, _ = closest(X, F, np.array([[0.5, 0.5, 0.0], [0.5, 0.5, 2.0]]), [hint, hint])
        assert faces.tolist() == [hint, hint]


@pytest.mark.parametrize("count", [1, 2, 4, 5, 16, 17, 64, 65, 257])
def test_every_size_of_tree(count):
    V = RNG.random((3 * count, 3))
    X, F = in_order(V, np.arange(3 * count).reshape(-1, 3))
    tree = build_tree(X, F, False)
    assert tree.level[-1] == len(tree.boxes) and tree.level[-1] - tree.level[-2] == 1
    assert tree.boxes[-1] == pytest.approx(np.r_[X[:, :3].min(axis=0), X[:, :3].max(axis=0)])
    P = RNG.normal(size=(30, 3))
    squared, _, _ = igl.point_mesh_squared_distance(P, X[:, :3].copy(), F.astype(np.int64))
    assert closest(X, F, P)[2] == pytest.approx(np.sqrt(squared))


def test_parallel_is_the_same():
    X, F = in_order(*zoo.icosphere(3))
    for one, two in zip(build_tree(X, F, False), build_tree(X, F, True), strict=True):
        assert one.tobytes() == two.tobytes()
