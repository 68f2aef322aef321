"""A process that stays for the next call, and is replaced when it dies or takes too long."""

import os
import time
from functools import partial

import pytest
from helpers.processes import eventually
from helpers.threads import at_once

from remeshvec.errors import WorkerError
from remeshvec.processes.pool import StandingWorker


def act(task, _):
    if task == "die":
        os._exit(7)
    if task == "hang":
        time.sleep(60)
    if task == "raise":
        raise KeyError("mine")
    return os.getpid(), task


@pytest.fixture
def worker():
    worker = StandingWorker(act)
    yield worker
    worker.stop()


def test_the_process_stays(worker):
    first, second = worker(1, 10), worker("two", 10)
    assert first[0] == second[0] != os.getpid() and second[1] == "two"
    with pytest.raises(KeyError, match="mine"):
        worker("raise", 10)
    assert worker(3, 10) == (first[0], 3)


def test_a_process_that_dies_or_hangs_is_replaced(worker):
    with pytest.raises(WorkerError, match="died"):
        worker("die", 10)
    assert worker(1, 10)[1] == 1
    with pytest.raises(WorkerError, match=r"longer than the timeout of 0\.1 s"):
        worker("hang", 0.1)


def test_an_idle_process_leaves(worker, monkeypatch):
    monkeypatch.setattr("remeshvec.processes.pool._IDLE", 0.01)
    pid, _ = worker(1, 10)
    assert eventually(lambda: worker._pool is None)
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
    assert worker(1, 10)[0] != pid


def test_threads_take_turns(worker):
    found = at_once(*[partial(worker, k, 10) for k in range(8)])
    assert [task for _, task in found] == list(range(8))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_has_a_process_of_its_own(worker):
    pid, _ = worker(1, 10)
    child = os.fork()
    if child == 0:
        status = 1
        try:
            status = int(worker(2, 10)[0] == pid)
            worker.stop()
        finally:
            os._exit(status)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert worker(3, 10) == (pid, 3)
