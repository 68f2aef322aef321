"""`remesh_many` and `remesh_item` on a real cluster of two workers, which die at times."""

from __future__ import annotations

import os
import signal
import threading

import numba
import numpy as np
import pytest
from batch.test_batch import digest, meshes
from helpers import zoo
from helpers.processes import KILLED, eventually

from remeshvec import (
    BatchError,
    LightResult,
    MeshFormatError,
    MeshInputError,
    OptionError,
    WorkerError,
    remesh,
    remesh_item,
    remesh_many,
    write_mesh,
)
from remeshvec.processes.tasks import AHEAD

distributed = pytest.importorskip("distributed")

FAST = {"preset": "fast"}

# -- remesh_many ----------------------------------------------------------------------------------


def test_the_same_bytes_as_single_calls(client, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where the workers are not
    V, F = zoo.grid(9, 9)
    write_mesh("a.ply", V, F)
    items = [*meshes(), "a.ply"]
    expected = [digest(remesh(*mesh)) for mesh in meshes()] + [digest(remesh(V, F))]
    found = list(remesh_many(items, client=client))
    assert [item.index for item in found] == list(range(len(items)))
    assert [digest(item.result) for item in found] == expected
    assert all(item.seconds > 0 and item.path is None for item in found)
    assert (found[0].name, found[6].name) == ("128 vertices, 256 faces", "a.ply")
    loose = list(remesh_many(items, client=client, ordered=False, workers=1))
    assert {item.index: digest(item.result) for item in loose} == dict(enumerate(expected))


def test_functions_reach_the_workers(client):
    V, F = zoo.torus(16, 8)
    found = remesh_many([(V, F)], lambda points: 0.3 + 0.1 * points[:, 0] ** 2, client=client)
    alone = remesh(V, F, lambda points: 0.3 + 0.1 * points[:, 0] ** 2)
    assert [digest(item.result) for item in found] == [digest(alone)]


def test_workers_write_and_results_stay_there(client, tmp_path):
    V, F = zoo.grid(9, 9)
    write_mesh(tmp_path / "a.ply", V, F)
    items = [(V, F), tmp_path / "a.ply", (V * np.nan, F), zoo.icosphere(2)]
    for engine in ({"client": client}, {"workers": 1}, {"workers": 2}):
        store = tmp_path / next(iter(engine)) / str(engine.get("workers", ""))
        found = list(remesh_many(items, store=store, on_error="collect", **engine))
        assert [item.result for item in found] == 4 * [None]
        assert isinstance(found[2].error, MeshInputError) and found[2].path is None
        names = ["000000-mesh.npz", "000001-a.npz", "000003-mesh.npz"]
        assert sorted(os.listdir(store)) == names
        for item, name in zip([found[0], found[1], found[3]], names, strict=True):
            assert item.path == str(store / name)
        for item, mesh in ((found[1], (V, F)), (found[3], items[3])):
            light, whole = LightResult.load(item.path), remesh(*mesh)
            assert light.V.tobytes() == whole.V.tobytes() and light.F.tobytes() == whole.F.tobytes()
            assert light.report["quality_after"] == whole.report.quality_after.to_dict()


def test_items_are_taken_when_they_are_needed_and_nothing_is_left_behind(client):
    taken, most = [0], 0

    def endless():
        while True:
            taken[0] += 1
            yield zoo.grid(4, 4)

    found = remesh_many(endless(), client=client)
    assert taken[0] == 0
    for done in range(1, 30):
        assert next(found).error is None
        most = max(most, taken[0] - done)
    assert most < 2 * AHEAD
    found.close()

    def is_empty(dask_scheduler):
        return not dask_scheduler.tasks

    assert eventually(lambda: client.run_on_scheduler(is_empty))


def test_what_fails_fails_alone(client, tmp_path):
    V, F = zoo.grid(5, 5)
    absent = tmp_path / "absent.obj"
    items = [(V, F), (V, F + 30), absent, threading.Lock(), (V, F)]
    found = list(remesh_many(items, client=client, on_error="collect"))
    kinds = [type(None), MeshInputError, MeshFormatError, WorkerError, type(None)]
    assert [type(item.error) for item in found] == kinds
    assert found[2].name == str(absent) and "no such file" in str(found[2].error)
    with pytest.raises(BatchError, match=r"item 1 .*vertices.* failed") as caught:
        list(remesh_many(items, client=client))
    assert isinstance(caught.value.__cause__, MeshInputError)


def test_a_worker_that_is_killed_takes_nothing_with_it(client):
    """Its items are done by others; the cluster starts another worker."""
    pids = set(client.run(os.getpid).values())
    items = [zoo.torus(24, 12) for _ in range(24)]
    done = []
    for item in remesh_many(items, 0.2, client=client):
        done.append(digest(item.result))
        if item.index == 3:
            os.kill(min(pids), signal.SIGKILL)
    assert done == 24 * [digest(remesh(*items[0], 0.2))]
    client.wait_for_workers(2, timeout=60)
    assert set(client.run(os.getpid).values()) != pids


def test_a_mesh_that_kills_its_workers_becomes_an_error(client):
    client.run_on_scheduler(lambda dask_scheduler: setattr(dask_scheduler, "allowed_failures", 0))
    good = zoo.grid(5, 5)
    try:
        found = list(remesh_many([good, KILLED], client=client, on_error="collect", workers=1))
    finally:
        client.run_on_scheduler(
            lambda dask_scheduler: setattr(dask_scheduler, "allowed_failures", 3)
        )
    assert isinstance(found[1].error, WorkerError) and "worker process died" in str(found[1].error)
    client.wait_for_workers(2, timeout=60)


# -- before the first task ------------------------------------------------------------------------


def test_a_worker_with_other_versions_is_refused(client):
    address = min(client.nthreads())

    def pretend(version):
        import numba

        numba.__version__ = version

    client.run(pretend, "1.0", workers=[address])
    try:
        with pytest.raises(WorkerError) as caught:
            list(remesh_many([zoo.grid(4, 4)], client=client))
        here = f"it has numba 1.0, and here is {numba.__version__}"
        assert str(caught.value) == f"1 of 2 workers cannot be used; {address}: {here}"
        executor = client.get_executor(workers=[address])  # of which nobody is asked beforehand
        with pytest.raises(WorkerError, match=f"a worker cannot be used: {here}"):
            list(remesh_many([zoo.grid(4, 4)], client=executor))
    finally:
        client.run(pretend, numba.__version__, workers=[address])


def test_a_folder_that_is_not_shared_is_refused(client, tmp_path):
    address = min(client.nthreads())

    def hide(path):
        import os.path

        os.path.real, os.path.exists = os.path.exists, lambda name: not name.startswith(path)

    def show():
        import os.path

        os.path.exists = os.path.real

    client.run(hide, str(tmp_path), workers=[address])
    try:
        with pytest.raises(WorkerError, match="must be shared") as caught:
            list(remesh_many([zoo.grid(4, 4)], client=client, store=tmp_path))
    finally:
        client.run(show, workers=[address])
    assert f"{address}: it does not see {tmp_path}" in str(caught.value)
    assert "\n" not in str(caught.value) and os.listdir(tmp_path) == []


def test_the_call_waits_for_a_first_worker():
    with (
        distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=":0") as queue,
        distributed.Client(queue) as client,
    ):
        threading.Timer(0.3, queue.scale, [1]).start()
        found = list(remesh_many([zoo.grid(4, 4)] * 9, client=client))
    assert [item.error for item in found] == 9 * [None]


def test_arguments(client, tmp_path):
    mesh = zoo.grid(4, 4)
    (tmp_path / "file").touch()
    for wrong, word in [
        ({"client": 3}, "method `submit`"),
        ({"client": client, "timeout": 3.0}, "timeout and client"),
        ({"client": client, "workers": 0}, "workers"),
        ({"store": 3}, "store"),
        ({"store": tmp_path / "file"}, "store"),
    ]:
        with pytest.raises(OptionError, match=word):
            remesh_many([mesh], **wrong)


# -- remesh_item ----------------------------------------------------------------------------------


@pytest.fixture
def files(tmp_path):
    paths = [str(tmp_path / name) for name in ("a.ply", "b.obj")]
    for k, path in enumerate(paths):
        write_mesh(path, *zoo.grid(8 + k, 8))
    return paths


def test_client_map(client, files, tmp_path):
    futures = client.map(remesh_item, files, L=0.5, **FAST)
    for light, path in zip(client.gather(futures), files, strict=True):
        assert isinstance(light, LightResult)
        assert light.V.tobytes() == remesh_item(path, 0.5, **FAST).V.tobytes()
    (tmp_path / "out").mkdir()
    paths = client.gather(client.map(remesh_item, files, L=0.5, store=tmp_path / "out", **FAST))
    assert [os.path.basename(path)[:2] for path in paths] == ["a-", "b-"]
    assert sorted(os.listdir(tmp_path / "out")) == sorted(map(os.path.basename, paths))
    failed = client.submit(remesh_item, tmp_path / "absent.obj")
    with pytest.raises(MeshFormatError, match="absent"):
        failed.result()


def test_bags(client, files):
    bag = pytest.importorskip("dask.bag")
    sizes = bag.from_sequence(files).map(remesh_item, L=0.5, **FAST).map(lambda x: len(x.F))
    assert sizes.compute() == [len(remesh_item(path, 0.5, **FAST).F) for path in files]


def test_delayed(client, files):
    dask = pytest.importorskip("dask")
    item = dask.delayed(remesh_item)
    V, F = zoo.grid(6, 6)
    calls = [
        item(files[0], 0.5, **FAST),
        item((V, F), 0.5, **FAST),
        item(item((V, F)), 0.5, **FAST),
    ]
    one, two, three = dask.compute(*calls)
    assert digest_light(one) == digest_light(remesh_item(files[0], 0.5, **FAST))
    assert digest_light(two) == digest_light(remesh(V, F, 0.5, **FAST).light())
    assert digest_light(three) == digest_light(remesh(*remesh(V, F), 0.5, **FAST).light())


def digest_light(light):
    return light.V.tobytes() + light.F.tobytes()
