"""Light results: the mesh, its labels and figures, and nothing that makes them heavy."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest
from helpers import zoo

from remeshvec import LightResult, MeshFormatError, remesh


@pytest.fixture(params=[False, True], ids=["plain", "labels"])
def result(request):
    V, F = zoo.torus(24, 12)
    labels = np.arange(len(F)) % 5 // 3 if request.param else None
    return remesh(V.astype(np.float32), F.astype(np.int32), 0.2, face_labels=labels)


def test_it_holds_what_the_result_holds(result):
    light = result.light()
    V, F = light
    assert V is result.V and F is result.F and light.face_labels is result.face_labels
    assert light.report == json.loads(json.dumps(result.report.to_dict()))
    assert light.report["quality_after"] == result.report.quality_after.to_dict()


def test_a_pickle_is_hardly_larger_than_the_arrays(result):
    light = result.light()
    arrays = sum(array.nbytes for array in (*light, light.face_labels) if array is not None)
    assert arrays < len(pickle.dumps(light)) < arrays + 4000 < len(pickle.dumps(result)) / 2


def same(one, other):
    labels = [light.face_labels for light in (one, other)]
    assert (labels[0] is None) == (labels[1] is None)
    for a, b in zip([*one, labels[0]], [*other, labels[1]], strict=True):
        if a is not None:
            assert a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    assert one.report == other.report


def test_files_and_pickles_give_the_same_again(result, tmp_path):
    light = result.light()
    light.save(tmp_path / "a.npz")
    same(LightResult.load(tmp_path / "a.npz"), light)
    same(pickle.loads(pickle.dumps(light)), light)
    with np.load(tmp_path / "a.npz") as held:  # without this package
        assert held["V"].dtype == np.float32 and held["F"].tobytes() == light.F.tobytes()
        assert json.loads(held["report"].tobytes()) == light.report
        assert ("face_labels" in held) == (light.face_labels is not None)


def test_other_files_are_refused(result, tmp_path):
    (tmp_path / "empty.npz").touch()
    (tmp_path / "text.npz").write_text("v 0 0 0")
    np.savez(tmp_path / "other.npz", V=np.eye(3))
    np.save(tmp_path / "array.npz.npy", np.eye(3))
    (tmp_path / "array.npz.npy").rename(tmp_path / "array.npz")
    np.savez(tmp_path / "objects.npz", V=np.array([{}]), F=np.eye(3), report=np.eye(3))
    result.light().save(tmp_path / "cut.npz")
    whole = (tmp_path / "cut.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[: len(whole) // 2])
    for name in ("absent", "empty", "text", "other", "array", "objects", "cut"):
        with pytest.raises(MeshFormatError, match=f"cannot read .*{name}.npz: "):
            LightResult.load(tmp_path / f"{name}.npz")
