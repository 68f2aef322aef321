"""Tasks through executors and other clients: in order, a few at a time, and what ends with them."""

from __future__ import annotations

import os
import pickle
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import pytest

from remeshvec.errors import OptionError, WorkerError
from remeshvec.processes.client import check_client, run_on_client
from remeshvec.processes.tasks import AHEAD


def act(task, common):
    if task == "die":
        os._exit(7)
    if task == "raise":
        raise KeyError("mine")
    return common * task


def outcomes(client, tasks, **options):
    found = list(run_on_client(act, tasks, 10, client, **options))
    return [outcome.error or outcome.value for outcome in found]


class Later:
    """A client whose futures know nothing but their result, computed when it is asked for."""

    def __init__(self):
        self.submitted = self.asked = 0

    def submit(self, function, *arguments):
        self.submitted += 1
        client = self

        class Future:
            def result(self):
                client.asked += 1
                return function(*arguments)

        return Future()


@pytest.mark.parametrize("ordered", [True, False])
def test_any_client(ordered):
    with ThreadPoolExecutor(2) as threads:
        for client in (threads, Later()):
            found = outcomes(client, range(20), ordered=ordered)
            assert (found if ordered else sorted(found)) == list(range(0, 200, 10))


def test_a_few_are_on_their_way():
    client = Later()
    found = run_on_client(act, iter(range(100)), 1, client, workers=3)
    for done in range(1, 101):
        assert next(found).value == done - 1
        assert client.asked == done
        assert client.submitted - done < 3 * AHEAD
    assert next(found, None) is None


def test_tasks_that_fail_fail_alone():
    found = outcomes(Later(), [1, "raise", threading.Lock(), 2])
    assert (found[0], found[3]) == (10, 20)
    assert isinstance(found[1], KeyError) and "act" in "".join(found[1].__notes__)
    assert isinstance(found[2], WorkerError) and "cannot be sent" in str(found[2])


def test_a_broken_pool_ends_the_work():
    """This executor gives up all tasks when a process dies, and takes no more."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = run_on_client(act, [1, "die", *range(100)], 10, pool, workers=1)
        assert next(found).value == 10
        lost = next(found)
        assert isinstance(lost.error, WorkerError) and "BrokenProcessPool" in str(lost.error)
        with pytest.raises(WorkerError, match=r"takes no more tasks \(BrokenProcessPool"):
            list(found)


def test_a_client_that_is_shut_down():
    pool = ThreadPoolExecutor(1)
    found = run_on_client(act, range(100), 10, pool, workers=1)
    assert next(found).value == 0
    pool.shutdown(cancel_futures=True)
    with pytest.raises(WorkerError, match="client"):
        list(found)


def test_what_is_not_done_is_withdrawn():
    withdrawn = []

    class Counted(Later):
        def submit(self, function, *arguments):
            future, number = super().submit(function, *arguments), pickle.loads(arguments[-1])
            future.cancel = lambda: withdrawn.append(number)
            return future

    found = run_on_client(act, range(100), 10, Counted(), workers=1)
    assert next(found).value == 0
    found.close()
    assert withdrawn == list(range(1, AHEAD))


def test_what_all_tasks_need_and_workers_cannot_load():
    class Local:
        def __reduce__(self):
            return act, ("raise", 0)

    with pytest.raises(OptionError, match="workers cannot use an option"):
        list(run_on_client(act, [1], Local(), Later()))


def test_clients_are_told_from_other_things():
    class Asynchronous(Later):
        asynchronous = True

    check_client(Later())
    for wrong in (3, None, "tcp://127.0.0.1:8786"):
        with pytest.raises(OptionError, match="`submit`"):
            check_client(wrong)
    with pytest.raises(OptionError, match="asynchronous"):
        check_client(Asynchronous())
