"""`remesh_many`: items in order, the bytes of single calls, and no more in memory than needed."""

from __future__ import annotations

import gc
import hashlib
import io
import sys

import numpy as np
import pytest
from helpers import zoo
from helpers.processes import SLEEPS
from helpers.threads import at_once

from remeshvec import (
    MeshInputError,
    OptionError,
    WorkerError,
    read_mesh,
    remesh,
    remesh_many,
    write_mesh,
)
from remeshvec.batch import progress as _progress
from remeshvec.processes import pool as _workers


def meshes():
    """Small meshes of several kinds: closed, open, with creases, dirty."""
    V, F = zoo.torus(16, 8)
    return [
        (V, F),
        zoo.grid(9, 9),
        zoo.genus_2(),
        (V.astype(np.float32), np.r_[F, F[:1]].astype(np.int32)),
        (V.tolist(), F.tolist()),
        zoo.icosphere(2),
    ]


def digest(result):
    """Hash all that a result holds but for its times, and the threads that it might have used."""
    report = result.report.to_dict()
    report.pop("seconds")
    report["options"].pop("threads")
    sha = hashlib.sha256(repr(report).encode())
    for name in ("V", "F", "lengths", "birth_face", "birth_barycentric", "vertex_map", "face_map"):
        array = getattr(result, name)
        sha.update(f"{name}{array.dtype}{array.shape}".encode() + array.tobytes())
    return sha.hexdigest()


# -- results --------------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [1, 2])
def test_the_same_bytes_as_one_at_a_time(workers, tmp_path):
    V, F = zoo.grid(9, 9)
    write_mesh(tmp_path / "a.ply", V, F)
    path = tmp_path / "a.ply"
    items = [*meshes(), path, str(path), read_mesh(path), remesh(V, F), list(zoo.grid(5, 5))]
    found = list(remesh_many(items, workers=workers))
    assert [item.index for item in found] == list(range(len(items)))
    assert all(item.error is None and item.seconds > 0 for item in found)
    expected = [digest(remesh(*mesh)) for mesh in meshes()]
    expected += 3 * [digest(remesh(*read_mesh(path)[:2]))]
    expected += [digest(remesh(*remesh(V, F))), digest(remesh(*zoo.grid(5, 5)))]
    assert [digest(item.result) for item in found] == expected
    assert found[0].name == "128 vertices, 256 faces"
    assert found[6].name == found[7].name == str(path)


def test_options_reach_every_item():
    V, F = zoo.torus(16, 8)
    options = {"preset": "fast", "feature_angle": None, "boundary": "split", "iterations": 2}
    alone = digest(remesh(V, F, 0.3, **options))
    for workers in (1, 2):
        found = remesh_many([(V, F)] * 3, 0.3, workers=workers, **options)
        assert [digest(item.result) for item in found] == 3 * [alone]


def test_functions_need_a_module_or_cloudpickle(monkeypatch):
    V, F = zoo.torus(16, 8)
    alone = digest(remesh(V, F, lambda points: 0.3 + 0.1 * points[:, 0] ** 2))
    here = remesh_many([(V, F)], lambda points: 0.3 + 0.1 * points[:, 0] ** 2, workers=1)
    assert digest(next(here).result) == alone
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    with pytest.raises(OptionError, match=r"cloudpickle.*workers=1"):
        list(remesh_many([(V, F)], lambda points: points[:, 0], workers=2))
    monkeypatch.undo()
    pytest.importorskip("cloudpickle")
    there = remesh_many([(V, F)], lambda points: 0.3 + 0.1 * points[:, 0] ** 2, workers=2)
    assert [digest(item.result) for item in there] == [alone]


def test_as_completed():
    """The first item waits for its death, the others do not wait for it."""
    items = [SLEEPS, *meshes(), *meshes()]
    found = list(remesh_many(items, workers=2, ordered=False, on_error="collect", timeout=3.0))
    assert sorted(item.index for item in found) == list(range(13))
    assert found[0].index != 0
    slow = next(item for item in found if item.index == 0)
    assert isinstance(slow.error, WorkerError) and "timeout of 3 s" in str(slow.error)
    assert [item.index for item in found].index(0) > 4
    for item in found:
        if item is not slow:
            assert digest(item.result) == digest(remesh(*items[item.index]))


def test_calls_at_once():
    """From several threads, each with workers of its own."""

    def call():
        return [digest(item.result) for item in remesh_many(meshes(), workers=2)]

    assert at_once(call, call) == 2 * [[digest(remesh(*mesh)) for mesh in meshes()]]


def test_what_workers_print_does_not_disturb():
    found = list(remesh_many([zoo.grid(5, 5)], callback=print, workers=2, on_error="collect"))
    assert found[0].error is None and len(found[0].result.F) > 0


def test_arguments():
    mesh = zoo.grid(4, 4)
    for wrong, word in [
        ({"on_error": "ignore"}, "on_error"),
        ({"workers": 0}, "workers"),
        ({"timeout": -1}, "timeout"),
        ({"color": 3}, "no option color"),
    ]:
        with pytest.raises(OptionError, match=word):
            remesh_many([mesh], **wrong)
    assert list(remesh_many([])) == list(remesh_many([], workers=1)) == []
    with pytest.raises(OptionError, match="iterable of meshes; got an object of type int"):
        remesh_many(3)
    with pytest.raises(OptionError, match="single one into a list"):
        remesh_many("a.obj")


# -- lazily ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("ordered", [True, False])
def test_items_are_taken_when_they_are_needed(workers, ordered):
    taken, most = [0], 0

    def endless():
        while True:
            taken[0] += 1
            yield zoo.grid(4, 4)

    found = remesh_many(endless(), workers=workers, ordered=ordered)
    assert taken[0] == 0
    for done in range(1, 30):
        assert next(found).error is None
        most = max(most, taken[0] - done)
    assert most < _workers.AHEAD * workers if workers > 1 else most == 0
    found.close()


def test_an_error_of_the_callers_generator_reaches_the_caller():
    def items():
        yield zoo.grid(4, 4)
        raise LookupError("no more")

    for workers in (1, 2):
        with pytest.raises(LookupError, match="no more"):
            list(remesh_many(items(), workers=workers))


@pytest.fixture
def quick_collection():
    """Let the garbage collector look only at what a test makes: the rest costs it 0.3 s each time."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.usefixtures("quick_collection")
@pytest.mark.parametrize("workers", [1, 2])
def test_nothing_is_kept_of_what_was_handed_on(workers):
    import weakref

    alive, arrays = [], []

    def items():
        for _ in range(12):
            V, F = zoo.grid(5, 5)
            arrays.append(weakref.ref(V))
            yield V, F
            del V, F

    for item in remesh_many(items(), workers=workers):
        del item
        gc.collect()
        alive.append(sum(array() is not None for array in arrays))
    assert max(alive) <= _workers.AHEAD * workers
    gc.collect()
    assert not any(array() is not None for array in arrays)


@pytest.mark.parametrize("workers", [1, 2])
def test_errors_that_are_kept_keep_no_arrays(workers):
    import weakref

    arrays = []

    def items():
        for _ in range(4):
            V, F = zoo.grid(5, 5)
            V = V * np.nan
            arrays.append(weakref.ref(V))
            yield V, F
            del V, F

    kept = list(remesh_many(items(), workers=workers, on_error="collect"))
    gc.collect()
    assert all(isinstance(item.error, MeshInputError) for item in kept)
    assert not any(array() is not None for array in arrays)


# -- progress -------------------------------------------------------------------------------------


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_in_a_log(capsys, tmp_path, monkeypatch):
    items = [zoo.grid(4, 4), tmp_path / "absent.obj", zoo.grid(4, 4)]
    assert len(list(remesh_many(items, workers=1, progress=True, on_error="collect"))) == 3
    assert capsys.readouterr().err.endswith("3 of 3 meshes, 1 failed, 0 s\n")
    monkeypatch.setattr(_progress, "SECONDS", 0.0)
    list(remesh_many(iter(items[:1]), workers=1, progress=True))
    assert capsys.readouterr().err == "1 meshes, 0 s\n"


def test_progress_on_a_terminal(monkeypatch):
    def shown():
        stream = Terminal()
        assert list(_progress.bar(range(5), 5, lambda k: k == 2, stream)) == list(range(5))
        return stream.getvalue()

    monkeypatch.setattr(_progress, "BLINK", 0.0)
    with monkeypatch.context() as context:
        context.setitem(sys.modules, "rich.progress", None)
        text = shown()
    assert text.count("\r\x1b[K") == 5 and "5 of 5 meshes, 1 failed, 0 s" in text
    pytest.importorskip("rich")
    text = shown()
    assert "5/5" in text and "1 failed" in text
