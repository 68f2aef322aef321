from __future__ import annotations

import pytest
from helpers.processes import ROOT, surroundings


@pytest.fixture(scope="session")
def cluster():
    """Two worker processes of one thread each, which are started again when they die."""
    distributed = pytest.importorskip("distributed")
    environment = {"PYTHONPATH": surroundings(ROOT / "tests")["PYTHONPATH"]}
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", env=environment
    ) as cluster:
        yield cluster


@pytest.fixture
def client(cluster):
    """A client of its own for each test, with both workers there."""
    with cluster.get_client() as client:
        client.wait_for_workers(2, timeout=60)
        yield client
