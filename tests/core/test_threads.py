"""Threads: calls at once, errors, ends; nobody waits for ever, nobody takes too much."""

import hashlib
import itertools
import sys
import threading
import time

import numba
import numpy as np
import pytest
from helpers import no_negative_index, zoo
from helpers.processes import PATIENCE, eventually
from helpers.threads import at_once

from remeshvec import remesh
from remeshvec.core import threads as _threads
from remeshvec.core.compiler import kernel as Kernel
from remeshvec.core.compiler.decorators import ThreadedKernel

CORES = 4  # as the tests have it, whatever the machine says

needs_jit = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="kernels are not compiled")


HELPERS = _threads._Helpers()  # ours, because the library's own may be more than we want


@pytest.fixture
def pool(monkeypatch):
    """Four cores."""
    monkeypatch.setattr(_threads, "_helpers", HELPERS)
    monkeypatch.setattr(_threads, "available_threads", lambda: CORES)
    return HELPERS


@pytest.fixture
def all_parallel(monkeypatch, pool):
    """Let small meshes have many blocks, and share them."""
    monkeypatch.setattr("remeshvec.mesh.blocks.FACES_PER_BLOCK", 200)
    monkeypatch.setattr("remeshvec.sweeps.work._PARALLEL_FACES", 0)
    return pool


def helper_threads():
    return [thread for thread in threading.enumerate() if thread.name == "remeshvec"]


def digest(result):
    arrays = (result.V, result.F, result.birth_face, result.birth_barycentric)
    return hashlib.sha256(b"".join(np.ascontiguousarray(x).tobytes() for x in arrays)).hexdigest()


# -- the GIL --------------------------------------------------------------------------------------


def kernels():
    for module in no_negative_index.all_modules():
        yield from (value for value in vars(module).values() if isinstance(value, Kernel))


@needs_jit
def test_all_kernels_are_built_to_release_the_gil():
    assert len(set(kernels())) > 20
    assert all(kernel.compiled.targetoptions["nogil"] for kernel in kernels())


@needs_jit
def test_python_threads_run_while_kernels_do(monkeypatch):
    """Nobody is ever asked for the GIL here, so that another thread counts only if it is let go of."""
    ticks, during, done = [0], [], threading.Event()

    def count():
        while not done.is_set():
            ticks[0] += 1
            time.sleep(0)

    def watched(self, *args):
        serial = self.compiled
        before = ticks[0]
        serial(*args)
        during.append(ticks[0] - before)

    interval = sys.getswitchinterval()
    counter = threading.Thread(target=count)
    V, F = zoo.read(zoo.DATA / "pretzel.off")
    remesh(V, F, threads=1)  # compiles
    monkeypatch.setattr(
        ThreadedKernel, "__call__", lambda self, _, *args: spans(self, watched, args)
    )
    deadline = time.monotonic() + PATIENCE
    try:
        sys.setswitchinterval(1000.0)
        counter.start()
        while not any(during) and time.monotonic() < deadline:
            remesh(V, F, threads=1)
    finally:
        sys.setswitchinterval(interval)
        done.set()
        counter.join()
    assert any(during)


def spans(shared, run, args):
    run(shared, (0, shared.count(*args)), *args)


# -- calls at once --------------------------------------------------------------------------------


def test_eight_calls_at_once_give_the_same_bits(monkeypatch, all_parallel):
    monkeypatch.setattr("remeshvec.sweeps.work._PARALLEL_FACES", 2000)
    meshes = [zoo.torus(48, 24), zoo.torus(24, 12), zoo.upsampled(*zoo.genus_2(), n=2, noise=0.2)]
    cases = list(itertools.product(meshes, ("fast", "default")))
    cases = (cases * 2)[:8]
    assert {len(F) > 2000 for (_, F), _ in cases} == {True, False}

    def call(V, F, preset, threads):
        return digest(remesh(V, F, 0.8 * zoo.mean_edge(V, F), preset=preset, threads=threads))

    alone = [call(*mesh, preset, 1) for mesh, preset in cases]
    calls = [lambda c=c: call(*c[0], c[1], CORES) for c in cases]
    assert at_once(*calls) == alone
    assert at_once(*calls[:2]) == alone[:2]  # eight have one core each, or none
    assert len(set(alone)) == 6
    assert 0 < all_parallel.count < CORES
    assert _threads._calls == 0


class Crowd:
    """Pieces that wait until as many as expected run at once; counts how many do."""

    def __init__(self, expected):
        self.expected = expected
        self.changed = threading.Condition()
        self.now = self.most = 0

    def run(self, span):
        with self.changed:
            self.now += 1
            self.most = max(self.most, self.now)
            self.changed.notify_all()
            self.changed.wait_for(lambda: self.most >= self.expected, 0.2 * PATIENCE)
        time.sleep(0.001)  # for others, who should not come
        with self.changed:
            self.now -= 1


def crowd_of(expected):
    """Run a loop of which so many pieces should run at once; how many do."""
    crowd = Crowd(expected)
    _threads.share(crowd.run, 32, ())
    return crowd.most


@pytest.mark.parametrize("calls", [1, 2, 3, CORES, 2 * CORES])
def test_calls_share_the_cores(monkeypatch, pool, calls):
    helpers = _threads._Helpers()
    monkeypatch.setattr(_threads, "_helpers", helpers)
    expected = calls * max(1, CORES // calls)
    crowd, inside = Crowd(expected), threading.Barrier(calls)

    def call():
        with _threads.thread_scope(CORES):
            inside.wait(PATIENCE)
            for _ in range(4):
                _threads.share(crowd.run, 32, ())
            inside.wait(PATIENCE)

    at_once(*[call] * calls)
    assert crowd.most == expected
    assert helpers.count == max(0, expected - calls)


def test_cores_are_given_up_and_taken_back(pool):
    """A call that began alone shares with a second one from its next loop on, and gets all back."""
    came, may_end = threading.Event(), threading.Event()

    def second():
        with _threads.thread_scope(CORES):
            came.set()
            may_end.wait(PATIENCE)

    with _threads.thread_scope(CORES):
        assert crowd_of(CORES) == CORES
        other = threading.Thread(target=second)
        other.start()
        came.wait(PATIENCE)
        assert crowd_of(CORES // 2) == CORES // 2
        may_end.set()
        other.join()
        assert crowd_of(CORES) == CORES


def test_a_call_takes_no_more_than_it_asked_for(pool):
    for threads in (1, 2, 3, 100):
        with _threads.thread_scope(threads) as may_run:
            assert may_run == (threads > 1)
            assert crowd_of(min(threads, CORES)) == min(threads, CORES)


def test_every_piece_runs_once(pool):
    for count, threads in itertools.product((1, 2, 7, 16, 100), (1, 2, 3, 4)):
        seen = np.zeros(count, int)

        def note(span, seen=seen):
            seen[span[0] : span[1]] += 1

        with _threads.thread_scope(threads):
            _threads.share(note, count, ())
        assert (seen == 1).all()


def test_a_call_inside_a_callback(all_parallel):
    V, F = zoo.torus(32, 16)
    alone = digest(remesh(V, F, 0.15, threads=CORES))
    inner = []

    def callback(sweep, phase, count):
        if (sweep, phase) == (1, "flip"):
            inner.append(digest(remesh(V, F, 0.15, threads=CORES)))

    assert digest(remesh(V, F, 0.15, threads=CORES, callback=callback)) == alone
    assert inner == [alone]


# -- errors ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [ValueError, MemoryError, KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("where", ["helper", "caller"])
def test_an_error_in_a_piece_reaches_the_caller(pool, kind, where):
    caller = threading.current_thread()
    raised, begun = threading.Event(), []

    def fail(span):
        begun.append(span)
        if (threading.current_thread() is caller) == (where == "caller"):
            raised.set()
            raise kind("no")
        raised.wait(PATIENCE)

    with _threads.thread_scope(CORES):
        with pytest.raises(kind, match="no"):
            _threads.share(fail, 10_000, ())
        assert crowd_of(CORES) == CORES  # all helpers are alive
    assert pool.count == CORES - 1


def test_nobody_begins_pieces_of_a_loop_that_failed(pool):
    """Else they would change arrays that their caller has given up."""
    caller = threading.current_thread()
    failed, begun = threading.Event(), []

    def fail(span):
        if threading.current_thread() is caller:
            raise ValueError
        failed.wait(PATIENCE)
        begun.append(span)

    with _threads.thread_scope(CORES), pytest.raises(ValueError):
        _threads.share(fail, 16, ())
    failed.set()
    time.sleep(0.05)
    assert len(begun) <= CORES - 1


def test_where_no_thread_can_be_started_the_caller_does_the_work(monkeypatch, all_parallel):
    def refuse(self):
        raise RuntimeError("can't start new thread")

    V, F = zoo.torus(32, 16)
    alone = digest(remesh(V, F, 0.15, threads=1))
    helpers = _threads._Helpers()
    monkeypatch.setattr(_threads, "_helpers", helpers)
    monkeypatch.setattr(threading.Thread, "start", refuse)
    assert digest(remesh(V, F, 0.15, threads=CORES)) == alone
    assert helpers.count == 0
    assert helpers.jobs.empty()  # nothing keeps the arrays alive


# -- what helpers cost ----------------------------------------------------------------------------


def test_helpers_are_started_once(all_parallel):
    V, F = zoo.torus(12, 8)
    with _threads.thread_scope(CORES):
        crowd_of(CORES)
    before = threading.enumerate()
    for _ in range(200):
        remesh(V, F, 0.4, preset="fast", iterations=1, threads=CORES)
    assert threading.enumerate() == before
    assert all_parallel.count == CORES - 1
    assert eventually(all_parallel.jobs.empty)


@pytest.mark.skipif(not hasattr(time, "pthread_getcpuclockid"), reason="no clock of a thread")
def test_helpers_without_work_cost_nothing(pool):
    with _threads.thread_scope(CORES):
        crowd_of(CORES)
    time.sleep(0.05)
    clocks = [time.pthread_getcpuclockid(thread.ident) for thread in helper_threads()]
    before = [time.clock_gettime(clock) for clock in clocks]
    time.sleep(0.5)
    spent = [time.clock_gettime(c) - b for c, b in zip(clocks, before, strict=True)]
    assert len(spent) >= CORES - 1
    assert max(spent) < 1e-3


def test_arrays_are_let_go_of(pool):
    """A helper that waits keeps nothing of the last loop."""
    import weakref

    array = np.zeros(10)

    def wait(span, x):
        time.sleep(0.001)

    with _threads.thread_scope(CORES):
        _threads.share(wait, 16, (array,))
    alive = weakref.ref(array)
    del array
    assert eventually(lambda: alive() is None)
