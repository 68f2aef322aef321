"""What a result computes when first asked for: the same as at once, once, in threads and copies."""

import copy
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from helpers import zoo

from data.shapes import nonmanifold
from remeshvec import remesh
from remeshvec.core.lazy import Lazy
from remeshvec.reference import bvh

LATE = ("birth_face", "birth_barycentric", "vertex_map", "face_map", "feature_edges", "corners")
DRIFTING = {"preset": "fast", "project": False}


@pytest.fixture
def trees(monkeypatch):
    """Count the trees that are built."""
    built = []
    build = bvh.build_tree
    monkeypatch.setattr(bvh, "build_tree", lambda *args: built.append(1) or build(*args))
    return built


def shape():
    return zoo.upsampled(*zoo.genus_2(), noise=0.2)


def arrays(result):
    return [getattr(result, name) for name in LATE]


def assert_same(one, two):
    for name, a, b in zip(LATE, arrays(one), arrays(two), strict=True):
        assert np.array_equal(a, b) and a.dtype == b.dtype, name


def test_sweeps_that_do_not_project_need_no_tree(trees):
    result = remesh(*shape(), 0.3, **DRIFTING)
    assert not trees
    assert result.birth_face.shape == (len(result.V),)
    assert len(trees) == 1
    assert result.birth_barycentric.shape == (len(result.V), 3)
    assert result.birth_face is result.birth_face
    assert len(trees) == 1


def test_projected_vertices_are_located_at_once(trees):
    result = remesh(*shape(), 0.3, preset="fast")
    trees.clear()
    assert result.birth_face.shape == (len(result.V),)
    assert not trees
    assert "locate" in result.report.seconds


@pytest.mark.parametrize("options", [DRIFTING, {"preset": "fast"}, {"preset": "fine"}])
@pytest.mark.parametrize(
    "again", [copy.deepcopy, copy.copy, lambda r: pickle.loads(pickle.dumps(r))]
)
def test_copies_hold_the_same(options, again):
    V, F = shape()
    options = {**options, "fixed_faces": [3], "face_labels": np.arange(len(F)) // 40}
    unread, read = remesh(V, F, 0.3, **options), remesh(V, F, 0.3, **options)
    arrays(read)
    assert_same(again(unread), read)
    assert_same(again(read), unread)


def test_seams_are_welded_before_births_are_asked_for():
    V, F = nonmanifold.double_bubble()
    result = remesh(V, F, 0.2, **DRIFTING)
    assert len(result.birth_face) == len(result.birth_barycentric) == len(result.V)
    born = np.einsum("nc,ncx->nx", result.birth_barycentric, V[F[result.birth_face]])
    assert np.linalg.norm(born - result.V, axis=1).max() < 0.1


def test_the_callers_arrays_may_change_before_births_are_asked_for():
    V, F = shape()
    expected = remesh(V, F, 0.3, **DRIFTING)
    arrays(expected)
    late = remesh(V, F, 0.3, **DRIFTING)
    V[:], F[:] = 0.0, 0
    assert_same(late, expected)


def test_threads_get_one_value():
    made = []
    late = Lazy(lambda: made.append(1) or np.arange(3))
    with ThreadPoolExecutor(8) as pool:
        values = list(pool.map(lambda _: late(), range(64)))
    assert len(made) == 1 and all(value is values[0] for value in values)


def test_births_in_threads_are_the_same():
    results = [remesh(*shape(), 0.3, **DRIFTING) for _ in range(4)]
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(arrays, results))
    for result in results[1:]:
        assert_same(result, results[0])


def test_a_failure_is_tried_again():
    answers = iter([MemoryError("full"), 7])

    def make():
        answer = next(answers)
        if isinstance(answer, Exception):
            raise answer
        return answer

    late = Lazy(make)
    with pytest.raises(MemoryError):
        late()
    assert late() == late() == 7
