"""The same bytes from any number of workers, from clients, after deaths, and in a second run."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from helpers.processes import ROOT, children_of, eventually, needs_proc, surroundings
from large.conftest import PART

from remeshvec import OptionError, WorkerError, remesh_large


def digest(result):
    found = hashlib.sha256()
    for name in ("V", "F", "birth_face", "birth_barycentric", "lengths"):
        found.update(np.ascontiguousarray(getattr(result, name)).data)
    return found.hexdigest()


@pytest.fixture(scope="module")
def ball(large):
    case = large("ball")
    case.digest = digest(case.result)
    return case


def again(case, folder, **options):
    return remesh_large((case.V, case.F), case.L, out=folder / "out", part_faces=PART, **options)


def test_two_processes(ball, tmp_path):
    assert digest(again(ball, tmp_path, workers=2)) == ball.digest
    assert not (tmp_path / "out.scratch").exists()


@pytest.mark.parametrize("executor", [ThreadPoolExecutor])
def test_any_client_with_submit(ball, tmp_path, executor):
    with executor(2) as client:
        assert digest(again(ball, tmp_path, client=client)) == ball.digest


@needs_proc
def test_a_killed_worker_is_replaced(ball, tmp_path):
    killed = []

    def kill_one():
        part = tmp_path / "out.scratch" / "everything" / "parts"
        if eventually(part.is_dir) and eventually(lambda: len(children_of(os.getpid())) > 0):
            killed.append(int(children_of(os.getpid())[0]))
            os.kill(killed[0], signal.SIGKILL)

    killer = threading.Thread(target=kill_one)
    killer.start()
    result = again(ball, tmp_path, workers=2)
    killer.join()
    assert killed and digest(result) == ball.digest


CHILD = """
import sys
import numpy as np
from remeshvec import remesh_large
V, F = (np.load(f"{sys.argv[1]}/{name}.npy") for name in "VF")
remesh_large((V, F), float(sys.argv[2]), out=sys.argv[1] + "/out", part_faces=10_000, workers=1)
"""


@pytest.mark.parametrize("seen", ["everything/part-000001.npz", "mesh-2", "births/parts"])
def test_a_killed_call_goes_on(ball, tmp_path, seen):
    """Each file tells that the call was in another stage when it was killed."""
    np.save(tmp_path / "V.npy", ball.V)
    np.save(tmp_path / "F.npy", ball.F)
    command = [sys.executable, "-c", CHILD, str(tmp_path), repr(float(ball.L))]
    child = subprocess.Popen(command, env=surroundings(), cwd=ROOT)
    try:
        assert eventually((tmp_path / "out.scratch" / seen).exists)
    finally:
        child.kill()
        child.wait()
    assert not (tmp_path / "out").exists()
    assert digest(again(ball, tmp_path, workers=1)) == ball.digest


def test_another_call_does_not_go_on(ball, tmp_path):
    scratch = tmp_path / "scratch"

    class Broken:
        def submit(self, *_):
            raise MemoryError

    with pytest.raises(MemoryError):
        again(ball, tmp_path, client=Broken(), scratch=scratch)
    with pytest.raises(OptionError, match=r"belongs to another call \(L differ"):
        remesh_large(
            (ball.V, ball.F), 1.1 * ball.L, out=tmp_path / "out", part_faces=PART, scratch=scratch
        )
    (tmp_path / "mine").mkdir()
    Path(tmp_path / "mine" / "thesis.txt").write_text("mine")
    with pytest.raises(OptionError, match="not empty"):
        again(ball, tmp_path, scratch=tmp_path / "mine")
    assert digest(again(ball, tmp_path, workers=1, scratch=scratch, resume=False)) == ball.digest


def test_a_worker_with_another_version_is_named(ball, tmp_path, monkeypatch):
    known = {"remeshvec": "9.9", "numpy": np.__version__}
    monkeypatch.setattr("remeshvec.large.rounds.versions", lambda: known)
    with pytest.raises(WorkerError, match=r"a worker has remeshvec .*, the caller 9\.9"):
        again(ball, tmp_path, workers=1)


@pytest.mark.slow
def test_dask(ball, tmp_path):
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, distributed.Client(cluster) as client:
        assert digest(again(ball, tmp_path, client=client)) == ball.digest


@pytest.mark.slow
def test_processes_of_another_kind(ball, tmp_path):
    with ProcessPoolExecutor(2) as client:
        assert digest(again(ball, tmp_path, client=client)) == ball.digest
