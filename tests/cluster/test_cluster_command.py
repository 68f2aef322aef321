"""`remeshvec batch --scheduler`: the table and the second run as with processes of its own."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import zoo
from helpers.batch_runs import batch, outputs, table
from helpers.processes import PATIENCE

from remeshvec import write_mesh
from remeshvec.cli.command import main

pytest.importorskip("distributed")

NAMES = ["a/x.obj", "b/x.obj", "b/y.ply", "b/z.off"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where the workers are not
    for k, name in enumerate(NAMES):
        path = Path("in", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        V, F = zoo.grid(6 + k, 6)
        write_mesh(path, V + 0.2 * np.sin(3 * V[:, ::-1]), F)


def there(cluster, *words):
    """Run on the cluster."""
    words = ("in/**/*.*", "--out", "out", "--preset", "fast", *words)
    return batch(*words, "--scheduler", cluster.scheduler_address)


@pytest.mark.usefixtures("folder")
def test_the_files_are_those_of_processes_and_a_second_run_goes_on(cluster, client):
    assert there(cluster) == 0
    assert sorted(table()) == outputs() == NAMES
    assert batch("in/**/*.*", "--out", "here", "--preset", "fast", "--workers", "1") == 0
    for name in NAMES:
        assert Path("out", name).read_bytes() == Path("here", name).read_bytes()
    different = {"seconds"}
    for mine, other in zip(table().values(), table("here/results.csv").values(), strict=True):
        assert {k for k in mine if mine[k] != other[k]} <= different
    times = {name: os.stat(f"out/{name}").st_mtime_ns for name in NAMES}
    assert there(cluster) == 0
    Path("in/empty.obj").touch()
    Path("out/b/y.ply").unlink()
    assert there(cluster) == 3
    again = {name for name in NAMES if os.stat(f"out/{name}").st_mtime_ns != times[name]}
    assert again == {"b/y.ply"}
    assert table()["empty.obj"]["error"].endswith("empty.obj: it is empty")


@pytest.mark.usefixtures("folder")
def test_a_killed_worker_is_a_row_with_an_error(cluster, client, capsys):
    """The scheduler gives up a mesh after several deaths; here after the first, to save time."""

    def die_at(name):
        import os

        from remeshvec.cli import batch_command

        read = batch_command.read_data
        batch_command.read_data = lambda path: os._exit(7) if path.endswith(name) else read(path)

    def tolerate(deaths, dask_scheduler):
        dask_scheduler.allowed_failures = deaths

    client.run(die_at, "b/x.obj")
    client.run_on_scheduler(tolerate, 0)
    try:
        assert there(cluster) == 3
    finally:
        client.run_on_scheduler(tolerate, 3)
        client.restart(timeout=PATIENCE)
    row = table()["b/x.obj"]
    assert row["error"].startswith("WorkerError: its worker process died")
    assert there(cluster) == 0
    assert sorted(table()) == outputs() == NAMES


@pytest.mark.usefixtures("folder")
def test_what_differs_is_said_before_the_first_task(cluster, client, capsys):
    address = min(client.nthreads())

    def pretend(version):
        import remeshvec.processes.client

        was, remeshvec.processes.client.__version__ = (
            remeshvec.processes.client.__version__,
            version,
        )
        return was

    was = client.run(pretend, "0.0.0", workers=[address])[address]
    try:
        assert there(cluster) == 2
    finally:
        client.run(pretend, was, workers=[address])
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"1 of 2 workers cannot be used; {address}: it has remeshvec 0.0.0" in said
    assert outputs() == []


@pytest.mark.usefixtures("folder")
def test_arguments(capsys, monkeypatch):
    words = ["batch", "in/a/x.obj", "--out", "out", "--scheduler"]

    def refused(*more):
        with pytest.raises(SystemExit):
            main([*words, *more])
        return capsys.readouterr().err

    assert "not allowed with argument" in refused("tcp://127.0.0.1:1", "--workers", "2")
    assert main([*words, "tcp://127.0.0.1:1", "--timeout", "3"]) == 2
    assert "--timeout and --scheduler exclude" in capsys.readouterr().err
    monkeypatch.setattr("remeshvec.processes.client._CONNECT", "0.5s")
    for address in ("tcp://127.0.0.1:1", "nonsense://x", "127.0.0.1:port"):
        assert main([*words, address]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1 and f"no Dask scheduler answers at {address}" in said
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main([*words, "tcp://127.0.0.1:1"]) == 2
    assert "remeshvec[cluster]" in capsys.readouterr().err
