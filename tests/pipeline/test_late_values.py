"""What a result computes late does not depend on what the caller does with its arrays meanwhile."""

import numpy as np
import pytest
from helpers import zoo

from remeshvec import remesh, remesh_many

LATE = (
    "birth_face", "birth_barycentric", "face_birth", "corner_birth_face", "corner_birth_barycentric",
    "image_face", "image_barycentric", "vertex_map", "face_map", "feature_edges", "corners",
)  # fmt: skip


def late_values(result, V, F):
    values = {name: getattr(result, name) for name in LATE}
    values |= {
        "on vertices": result.transfer(V),
        "on faces": result.transfer(np.arange(len(F)), on="faces"),
        "on corners": result.transfer(V[F], on="corners"),
        "matrix": result.matrix().toarray(),
        "back": result.transfer_back(result.V),
        "before": str(result.report.quality_before),
        "after": str(result.report.quality_after),
    }
    return values


def spoil(*arrays):
    for array in arrays:
        array[:] = array[::-1].copy() * 2


def options_of(kind, m):
    return {
        "plain": {},
        "labels": {"face_labels": np.arange(m) % 2},
        "selection": {"selection": np.arange(m // 2)},
        "held": {"fixed_faces": np.arange(m) < m // 4, "fixed_vertices": np.arange(3)},
        "preserve": {"preserve": (np.arange(m) < m // 2).astype(float)},
    }[kind]


@pytest.mark.parametrize("kind", ["plain", "labels", "selection", "held", "preserve"])
@pytest.mark.parametrize("dtypes", [(float, np.int64), (np.float32, np.int32)])
def test_arrays_may_change_after_the_call(kind, dtypes):
    V0, F0 = (np.array(x, t) for x, t in zip(zoo.grid(8, 8), dtypes, strict=True))
    known = late_values(remesh(V0, F0, 0.9, preset="fast", **options_of(kind, len(F0))), V0, F0)
    V, F, options = V0.copy(), F0.copy(), options_of(kind, len(F0))
    result = remesh(V, F, 0.9, preset="fast", **options)
    spoil(V, F, *options.values())
    for name, value in late_values(result, V0, F0).items():
        assert np.array_equal(value, known[name]), name


def test_tensors_may_change_after_the_call():
    torch = pytest.importorskip("torch")
    V, F = (torch.from_numpy(np.array(x)) for x in zoo.grid(8, 8))
    known = remesh(V.clone(), F.clone(), 0.9, preset="fast")
    result = remesh(V, F, 0.9, preset="fast")
    values = torch.rand(len(V), 3, dtype=torch.float64)
    V *= 2
    F[:] = F.flip(0)
    assert torch.equal(result.transfer(values), known.transfer(values))
    assert str(result.report.quality_before) == str(known.report.quality_before)


@pytest.mark.parametrize("workers", [1, 2])
def test_items_of_a_batch_may_share_one_array(workers):
    V0, F = zoo.grid(5, 5)
    V = V0.copy()

    def meshes():
        for k in range(6):
            V[:] = V0 * (k + 1)
            yield V, F

    for k, item in enumerate(remesh_many(meshes(), preset="fast", workers=workers)):
        assert np.isclose(np.ptp(item.result.V), np.ptp(V0) * (k + 1))
        assert np.isclose(np.ptp(item.result.report.before[0]), np.ptp(V0) * (k + 1))
