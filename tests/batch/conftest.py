import threading
from pathlib import Path

import pytest
from helpers.processes import children_of


def children():
    return set(children_of("self")) if Path("/proc/self/task").exists() else set()


@pytest.fixture(autouse=True)
def no_processes_left():
    """But for those of tests before, as the one that watches over the resources of `multiprocessing`."""
    before = children()
    yield
    assert children() <= before
    assert not [t for t in threading.enumerate() if t.name == "remeshvec feeder"]
