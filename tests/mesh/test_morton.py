"""Morton order: a permutation, near in space means near in the arrays."""

import numpy as np
import pytest
from helpers import zoo
from helpers.threads import on_threads, shuffled

from remeshvec.mesh.morton import order_mesh, survey


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


def scattered():
    """Nearly all in one cell of the curve, faces and vertices in no order, some in the same place."""
    V, F = zoo.icosphere(3)
    V = np.vstack([V * 1e-6, [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]], V * 1e-6])
    F = np.vstack([F, [[642, 643, 644]], F + 645])
    rng = np.random.default_rng(0)
    new = rng.permutation(len(V))
    return V[np.argsort(new)], new[F][rng.permutation(len(F))]


@pytest.mark.parametrize(
    "make", [lambda: zoo.icosphere(3), lambda: zoo.grid(30, 30), zoo.triangle, scattered]
)
def test_threads_give_the_same_order(make):
    V, F = make()
    one = ordered(V, F)
    others = []
    for threads in (1, 2, 3, 40):
        with on_threads(threads):
            others.append(ordered(V, F, True))
    with on_threads(4), shuffled():
        others.append(ordered(V, F, True))
    for other in others:
        for x, y in zip(one, other, strict=True):
            assert x.tobytes() == y.tobytes()


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_survey(dtype, parallel):
    V, F = zoo.grid()
    V = np.vstack([V, [[np.nan, -1e300, 1e300]]])  # no face uses it
    F = np.vstack([F, [[0, 0, 1], [3, 3, 3]]]).astype(dtype)
    faces, low, high, repeated = survey(V, F, parallel)
    assert faces.dtype == np.int32 and np.array_equal(faces, F) and not np.shares_memory(faces, F)
    assert np.array_equal(low, V[:-1].min(axis=0)) and np.array_equal(high, V[:-1].max(axis=0))
    assert repeated == 2


def test_a_box_has_no_negative_zeros():
    V = np.array([[-0.0, 0.0, -0.0], [1.0, -0.0, -0.0], [0.0, -1.0, -0.0]])
    _, low, high, _ = survey(V, np.array([[0, 1, 2]]), False)
    assert not np.signbit(np.concatenate([low[[0, 2]], high])).any()
