"""Morton order: a permutation, near in space means near in the arrays."""

import numpy as np
import pytest
import zoo

from remeshvec.order import order_mesh


def ordered(V, F, parallel=False):
    return order_mesh(np.asarray(V, float), np.asarray(F, np.int32), parallel)


@pytest.mark.parametrize("name", [*zoo.TIDY, "unreferenced_vertices"])
def test_it_is_a_permutation(name):
    V, F = zoo.ZOO[name].make()
    result = ordered(V, F)
    assert sorted(result.face_source.tolist()) == list(range(len(F)))
    assert len(set(result.vertex_source.tolist())) == len(result.vertex_source)
    assert set(result.vertex_source.tolist()) == set(np.unique(F).tolist())
    assert np.array_equal(result.vertex_source[result.F], F[result.face_source])
    assert np.array_equal(result.X[:, :3], V[result.vertex_source])
    assert (result.X[:, 3] == 0).all()
    first = np.unique(result.F.ravel(), return_index=True)[1]
    assert (np.diff(first) > 0).all()  # vertices in the order of their first use


def test_order_does_not_depend_on_the_order_before():
    V, F = zoo.perturb(*zoo.torus(24, 12), amount=0.05)
    shuffle = np.random.default_rng(1).permutation(len(F))
    one, two = ordered(V, F), ordered(V, F[shuffle])
    assert np.array_equal(one.X, two.X) and np.array_equal(one.F, two.F)


def test_neighbours_in_space_are_near_in_the_arrays():
    V, F = zoo.grid(60, 60)
    F = F[np.random.default_rng(0).permutation(len(F))]
    centres = V[F].mean(axis=1)
    step = np.linalg.norm(np.diff(centres, axis=0), axis=1).mean()
    result = ordered(V, F)
    centres = result.X[result.F, :3].mean(axis=1)
    assert np.linalg.norm(np.diff(centres, axis=0), axis=1).mean() < step / 15


@pytest.mark.parametrize("place", [0.0, 1e6, -3.5e8])
def test_flat_and_far_input(place):
    for V, F in (zoo.triangle(), zoo.grid(), (np.zeros((3, 3)), np.array([[0, 1, 2]]))):
        result = ordered(V + place, F)
        assert sorted(result.face_source.tolist()) == list(range(len(F)))


def test_parallel_is_the_same():
    V, F = zoo.icosphere(3)
    for one, two in zip(ordered(V, F), ordered(V, F, True), strict=True):
        assert one.tobytes() == two.tobytes()
