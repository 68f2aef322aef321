"""Threads in processes: children of every kind, interrupts, ends, kernels compiled at once."""

import json
from pathlib import Path

import pytest
from core.test_threads import CORES, needs_jit
from helpers.processes import PATIENCE, run_python, surroundings
from helpers.threads import at_once

COMMON = """
import hashlib, json, multiprocessing, os, sys, threading, time
import numpy as np
from remeshvec import read_mesh, remesh
from remeshvec.core import threads as _threads
from remeshvec.core.compiler import threaded
from remeshvec.mesh import blocks
V, F, _ = read_mesh("data/pretzel.off")

def digest(threads=None, callback=None):
    blocks.FACES_PER_BLOCK = 200
    sys.modules["remeshvec.sweeps.work"]._PARALLEL_FACES = 0
    r = remesh(V, F, preset="fast", iterations=2, threads=threads, callback=callback)
    return hashlib.sha256(r.V.tobytes() + r.F.tobytes() + r.birth_barycentric.tobytes()).hexdigest()

def helpers():
    return sum(thread.name == "remeshvec" for thread in threading.enumerate())

def call(_):
    return digest(), helpers()
"""


def in_a_process(tmp_path, text, *paths, limit=CORES, **env):
    """Run a script in the root; what it prints last, as JSON."""
    (tmp_path / "script.py").write_text(COMMON + text)
    env = {**surroundings(*paths), **env}
    env.pop("NUMBA_NUM_THREADS", None)
    if limit:
        env["NUMBA_NUM_THREADS"] = str(limit)
    done = run_python(tmp_path / "script.py", env=env, timeout=PATIENCE)
    assert "Traceback" not in done.stderr
    return json.loads(done.stdout.splitlines()[-1])


ALONE = """
found = {"available": _threads.available_threads()}
for threads in (1, 2, None):
    found[str(threads)] = [digest(threads), helpers()]
print(json.dumps(found))
"""


def test_helpers_start_with_the_first_call_that_shares(tmp_path):
    """None for one thread; as many as Numba's limit allows; and the process ends while they wait."""
    found = in_a_process(tmp_path, ALONE, limit=3)
    assert found["available"] == 3
    assert [found[threads][1] for threads in ("1", "2", "None")] == [0, 1, 2]
    assert len({found[threads][0] for threads in ("1", "2", "None")}) == 1


CHILDREN = """
from concurrent.futures import ProcessPoolExecutor

def fork_and_go_on(sweep, phase, count):
    # The child goes on with the call, makes another one, and says what came out.
    global child, pipe
    if child is None and phase == "flip":
        reader, writer = os.pipe()
        child = os.fork()
        pipe = reader if child else writer
        os.close(writer if child else reader)

child = pipe = None
if __name__ == "__main__":
    found = {"parent": [digest(1), 0], "shared": call(0)}
    for method in multiprocessing.get_all_start_methods():
        context = multiprocessing.get_context(method)
        with ProcessPoolExecutor(1, context) as executor:
            found[method] = next(executor.map(call, range(1)))
    if hasattr(os, "fork"):
        inside = digest(callback=fork_and_go_on)
        if child == 0:
            os.write(pipe, json.dumps([inside, *call(0)]).encode())
            os._exit(0)
        inside_child, again, count = json.loads(os.read(pipe, 1000))
        os.waitpid(child, 0)
        found["fork in a call"], found["and after it"] = [inside, 3], [inside_child, 3]
        found["in its child"] = [again, count]
    print(json.dumps(found))
"""


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_children_share_their_calls_too(tmp_path):
    """Forked after a call that did, inside of one, or started anew."""
    found = in_a_process(tmp_path, CHILDREN)
    assert len({digest for digest, _ in found.values()}) == 1, found
    assert all(helpers == CORES - 1 for name, (_, helpers) in found.items() if name != "parent")
    assert "spawn" in found


JOBS = """
import joblib

if __name__ == "__main__":
    found = [[digest(1), 0], call(0)]
    for backend in ("loky", "threading"):
        jobs = (joblib.delayed(call)(k) for k in range(4))
        found += joblib.Parallel(n_jobs=2, backend=backend)(jobs)
    print(json.dumps([found, joblib.cpu_count()]))
"""


def test_joblib(tmp_path):
    joblib = pytest.importorskip("joblib")
    folder = Path(joblib.__file__).parents[1]
    found, cores = in_a_process(tmp_path, JOBS, folder, limit=None)
    assert len(found) == 10
    assert len({digest for digest, _ in found}) == 1
    # joblib lets each of its processes have a part of the cores, and tells Numba.
    assert max(helpers for _, helpers in found[2:6]) < max(cores // 2, 1)


INTERRUPTED = """
import _thread
caught = 0
digest()  # imports all there is: an interrupt inside Python's import lock may leave it held for ever
for k in range(40):
    timer = threading.Timer(0.001 * (7 * k % 40), _thread.interrupt_main)
    try:
        timer.start()
        digest()
        timer.join()
    except KeyboardInterrupt:
        caught += 1
print(json.dumps([caught, digest() == digest(1), helpers()]))
"""


def test_calls_can_be_interrupted(tmp_path):
    """Python itself drops the odd interrupt: one that comes while it runs a finalizer."""
    caught, is_same, helpers = in_a_process(tmp_path, INTERRUPTED)
    assert caught >= 36
    assert is_same
    assert helpers == CORES - 1


BUSY = """
begun = threading.Event()

def for_ever():
    while True:
        digest(callback=lambda *_: begun.set())

for _ in range(2):
    threading.Thread(target=for_ever, daemon=True).start()
begun.wait()
time.sleep(0.05)
print(helpers(), flush=True)
"""


def test_a_process_ends_while_others_of_its_threads_remesh(tmp_path):
    assert 0 < in_a_process(tmp_path, BUSY) < CORES


# -- compilation ----------------------------------------------------------------------------------

COMPILED = """
@threaded(lambda x: len(x))
def double(pieces, x):
    for i in range(pieces[0], pieces[1]):
        x[i] *= 2.0

arrays = [np.arange(1000.0) for _ in range(8)]
barrier = threading.Barrier(len(arrays))

def run(x):
    barrier.wait()
    with _threads.thread_scope(4):
        double(True, x)

threads = [threading.Thread(target=run, args=(x,)) for x in arrays]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
same = all((x == 2.0 * np.arange(1000.0)).all() for x in arrays)
print(json.dumps([bool(same), len(double.compiled.overloads)]))
"""


@needs_jit
def test_threads_and_processes_that_compile_at_once(tmp_path):
    """On an empty cache, which they fill together."""
    cache = tmp_path / "cache"

    def run():
        return in_a_process(tmp_path, COMPILED, NUMBA_CACHE_DIR=str(cache))

    assert at_once(run, run) == [[True, 1]] * 2
    assert run() == [True, 1]
    assert len(list(cache.rglob("*.nbi"))) == 1
