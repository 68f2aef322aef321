"""`remesh_many`: what fails in a batch fails alone and is named, and no worker outlives the call."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from helpers import zoo
from helpers.processes import (
    EXIT,
    KILLED,
    PATIENCE,
    ROOT,
    SLEEPS,
    alive,
    children_of,
    eventually,
    needs_proc,
    surroundings,
)

from remeshvec import (
    BatchError,
    MeshFormatError,
    MeshInputError,
    OptionError,
    RemeshvecError,
    WorkerError,
    remesh_many,
)
from remeshvec.processes import pool as _workers
from remeshvec.processes.worker import END_PATIENCE

# -- what fails -----------------------------------------------------------------------------------


def hostile(tmp_path):
    """Items that fail, with what they fail with."""
    V, F = zoo.grid(5, 5)
    (tmp_path / "empty.obj").touch()
    (tmp_path / "garbage.ply").write_bytes(os.urandom(1000))
    return [
        ((V * np.nan, F), MeshInputError),
        ((V, F + 30), MeshInputError),
        (tmp_path / "empty.obj", MeshFormatError),
        (tmp_path / "garbage.ply", MeshFormatError),
        (tmp_path / "absent.stl", MeshFormatError),
    ]


@pytest.mark.parametrize("workers", [1, 2])
def test_forty_meshes_with_five_hostile_ones(workers, tmp_path):
    bad = hostile(tmp_path)
    items = [zoo.grid(4 + k % 5, 5) for k in range(35)]
    places = [3, 4, 17, 30, 39]
    for place, (item, _) in zip(places, bad, strict=True):
        items.insert(place, item)
    found = list(remesh_many(items, workers=workers, on_error="collect"))
    failed = [item for item in found if item.error is not None]
    assert len(found) == 40 and [item.index for item in failed] == places
    for item, (given, kind) in zip(failed, bad, strict=True):
        assert type(item.error) is kind and item.result is None
        if isinstance(given, Path):
            assert item.name == str(given) and given.name in str(item.error)
    assert sum(len(item.result.F) > 0 for item in found if item.error is None) == 35


def test_a_length_that_is_too_small():
    found = list(remesh_many([zoo.grid(4, 4)] * 2, 1e-9, workers=2, on_error="collect"))
    assert [type(item.error) for item in found] == 2 * [OptionError]
    assert "max_faces" in str(found[0].error)


@pytest.mark.parametrize("workers", [1, 2])
def test_the_first_failure_names_its_input(workers, tmp_path):
    path = tmp_path / "absent.obj"
    items = iter([zoo.grid(5, 5), path, zoo.grid(5, 5), tmp_path / "other.obj"])
    found = remesh_many(items, workers=workers)
    assert next(found).index == 0
    with pytest.raises(BatchError, match=r"item 1 \(.*absent\.obj\) failed: .*no such") as caught:
        next(found)
    assert isinstance(caught.value, RemeshvecError)
    assert (caught.value.index, caught.value.name) == (1, str(path))
    assert isinstance(caught.value.__cause__, MeshFormatError)
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.index) == (str(caught.value), 1)
    assert next(found, None) is None


def test_a_worker_that_dies_takes_one_item_with_it():
    good = zoo.grid(5, 5)
    items = [good, EXIT, good, KILLED, good, good, EXIT]
    found = list(remesh_many(items, workers=2, on_error="collect"))
    assert [item.error is None for item in found] == [item is good for item in items]
    assert all(isinstance(found[k].error, WorkerError) for k in (1, 3, 6))
    assert "exit code 7" in str(found[1].error) and "SIGKILL" in str(found[3].error)
    with pytest.raises(BatchError, match=r"item 1 .*Fatal.*died"):
        list(remesh_many(items, workers=2))


def test_what_cannot_be_sent_fails_alone():
    good = zoo.grid(5, 5)
    found = list(remesh_many([good, threading.Lock(), good], workers=2, on_error="collect"))
    assert [item.error is None for item in found] == [True, False, True]
    assert "workers=1" in str(found[1].error) and found[1].name == "an object of type lock"


def test_unexpected_errors_say_where_they_come_from():
    class Odd:
        def __len__(self):
            raise RuntimeError

    found = list(remesh_many([Odd(), zoo.grid(4, 4)], workers=2, on_error="collect"))
    assert isinstance(found[0].error, WorkerError) and found[1].error is None
    found = list(remesh_many([zoo.grid(4, 4)], lambda points: 1 / 0, workers=2, on_error="collect"))
    assert isinstance(found[0].error, ZeroDivisionError)
    assert "remesh_any" in "".join(found[0].error.__notes__)


def test_workers_that_cannot_start(monkeypatch):
    monkeypatch.setattr(_workers, "_START", "import sys; sys.exit(5)")
    with pytest.raises(WorkerError, match="exit code 5"):
        list(remesh_many([zoo.grid(4, 4)], workers=2, on_error="collect"))


# -- the end --------------------------------------------------------------------------------------


def test_workers_end_when_the_caller_stops_early():
    start = time.monotonic()
    for item in remesh_many([zoo.grid(5, 5), *[SLEEPS] * 20], workers=2):
        assert item.index == 0
        break
    assert time.monotonic() - start < 0.5 * PATIENCE


SCRIPT = """
import time
from remeshvec import remesh_many

class Sleeps:
    def __reduce__(self):
        return time.sleep, (600,)

# The first one fails at once, without kernels to be loaded.
for item in remesh_many(["absent.obj", Sleeps(), Sleeps()], workers=2, on_error="collect"):
    print(item.index, flush=True)
"""


@needs_proc
@pytest.mark.parametrize("kind", ["SIGINT", "SIGTERM", "SIGKILL"])
def test_no_worker_survives(kind, tmp_path):
    """A script without a guard, which is ended while its workers work."""
    (tmp_path / "script.py").write_text(SCRIPT)
    process = subprocess.Popen(
        [sys.executable, str(tmp_path / "script.py")],
        env=surroundings(ROOT / "tests"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "0\n"
    workers = children_of(process.pid)
    assert len(workers) == 2 and all(map(alive, workers))
    start = time.monotonic()
    process.send_signal(getattr(signal, kind))
    _, errors = process.communicate(timeout=PATIENCE)
    assert time.monotonic() - start < END_PATIENCE
    assert eventually(lambda: not any(map(alive, workers)))
    assert errors.count("Traceback") == (kind == "SIGINT")
