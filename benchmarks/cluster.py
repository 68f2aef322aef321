"""Data sets: thousands of small meshes through a cluster of two workers, beside two processes.

``python -m benchmarks.cluster`` writes docs/cluster-measured.md. Each run is a process of its own, whose
memory is looked at from outside, with that of all processes below it. On the way one worker is killed.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from time import perf_counter, sleep
from typing import Any

import numpy as np

from remeshvec import LightResult, read_mesh, remesh, remesh_many, write_mesh

from .batch import HOSTILE, NOISE, _children, _resident, _said
from .meshes import DATA, ROOT, find_file
from .tables import DOCS, machine, machine_line, page, table, write_page

MESHES = 10_000
FACES = (250, 5_000)
SHAPES = 120  # meshes that all others are made from, with noise of their own
WORKERS = 2
EVERY = 0.5  # seconds between two looks at the memory

ENGINES = {"processes": "`workers=2`", "cluster": "`client=` of a LocalCluster"}


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and write the page, or do one run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--meshes", type=int, default=MESHES, help="hostile ones included")
    parser.add_argument("--output", type=Path, default=DOCS, help="folder of the page")
    parser.add_argument("--run", nargs=3, metavar=("ENGINE", "IN", "OUT"), help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    if arguments.run:
        engine, inputs, outputs = arguments.run
        print(json.dumps(run(engine, Path(inputs), Path(outputs))))
        return
    facts = machine(("distributed",))
    with tempfile.TemporaryDirectory(prefix="remeshvec-cluster-") as folder:
        root = Path(folder)
        sizes = make_meshes(root / "in", arguments.meshes)
        runs = {engine: measured(engine, root) for engine in ENGINES}
        assert len({digest(root / engine, runs) for engine in ENGINES}) == 1
    write_page(arguments.output, "cluster-measured.md", _page(facts, sizes, runs))


def make_meshes(folder: Path, number: int) -> list[int]:
    """Write the meshes, hostile ones among them; return the numbers of faces of the others."""
    folder.mkdir(parents=True)
    sources = [read_mesh(find_file(name) or name)[:2] for name in DATA]
    shapes = [_shape(*sources[k % len(sources)], k) for k in range(SHAPES)]
    every = number // (len(HOSTILE) + 1)
    hostile = {every * (k + 1): name for k, name in enumerate(HOSTILE)}
    sizes = []
    for k in range(number):
        if k in hostile:
            name = hostile[k].partition("-")[2]
            (folder / f"{k:05}-{name}").write_bytes(HOSTILE[hostile[k]])
            continue
        V, F, length = shapes[k % SHAPES]
        noise = np.random.default_rng(k).normal(0, NOISE * length, V.shape)
        write_mesh(folder / f"{k:05}-{DATA[k % len(DATA)]}.ply", V + noise, F)
        sizes.append(len(F))
    return sizes


def _shape(V: Any, F: Any, k: int) -> tuple[Any, Any, float]:
    """Return a mesh of a size between the smallest and the largest, and its target length."""
    low, high = 1.06 * FACES[0], 0.94 * FACES[1]
    wanted = low * (high / low) ** (k * 37 % SHAPES / (SHAPES - 1))
    result = remesh(V, F, preset="fast", n_faces=int(wanted))
    return result.V, result.F, result.report.target_length


# -- one run --------------------------------------------------------------------------------------


def run(engine: str, inputs: Path, outputs: Path) -> dict[str, Any]:
    """Remesh all files of a folder, and kill a worker after a third of them."""
    paths = sorted(inputs.iterdir())
    failures, done = {}, 0
    begun = perf_counter()
    with _engine(engine) as options:
        start = perf_counter()
        for item in remesh_many(paths, store=outputs, on_error="collect", ordered=False, **options):
            done += item.error is None
            if item.error is not None:
                failures[Path(item.name).name] = _said(f"{type(item.error).__name__}: {item.error}")
            if item.index == len(paths) // 3:
                os.kill(_workers(options)[0], signal.SIGKILL)
        seconds = perf_counter() - start
    return {"done": done, "failures": failures, "start": start - begun, "seconds": seconds}


@contextmanager
def _engine(name: str) -> Iterator[dict[str, Any]]:
    """Give the options of `remesh_many` that name who works."""
    if name == "processes":
        yield {"workers": WORKERS}
        return
    import dask
    from distributed import Client, LocalCluster

    dask.config.set({"distributed.worker.profile.enabled": False})  # it keeps 50 kB per mesh
    with (
        LocalCluster(n_workers=WORKERS, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster) as client,
    ):
        yield {"client": client}


def _workers(options: dict[str, Any]) -> list[int]:
    """Return the ids of the processes that work."""
    if "client" in options:
        return list(options["client"].run(os.getpid).values())
    return [int(child) for child in _children(os.getpid())]


# -- from outside ---------------------------------------------------------------------------------


def measured(engine: str, root: Path) -> dict[str, Any]:
    """Do one run in a process of its own; return what it says, and memory over time."""
    print(f"run with {engine}", file=sys.stderr, flush=True)
    words = ["--run", engine, str(root / "in"), str(root / engine)]
    samples = []
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.cluster", *words], cwd=ROOT, stdout=subprocess.PIPE
    )
    while process.poll() is None:
        below = _descendants(process.pid)
        samples.append((_resident(process.pid), float(sum(map(_resident, below)))))
        sleep(EVERY)
    assert process.returncode == 0 and process.stdout is not None
    return json.loads(process.stdout.read()) | {"resident": samples}


def _descendants(pid: int | str) -> list[str]:
    below = _children(int(pid))
    return below + [one for child in below for one in _descendants(child)]


def digest(folder: Path, runs: dict[str, Any]) -> str:
    """Hash all meshes but those that some run has lost with its worker."""
    lost = {name for one in runs.values() for name in one["failures"]}
    sha = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        if not any(Path(name).stem in path.name for name in lost):
            for array in LightResult.load(path):
                sha.update(array.tobytes())
    return sha.hexdigest()


# -- the page -------------------------------------------------------------------------------------


def _page(facts: dict[str, str], sizes: list[int], runs: dict[str, Any]) -> str:
    total = len(sizes) + len(HOSTILE)
    for engine, one in runs.items():  # processes lose the item that the killed worker was at
        assert one["done"] + len(one["failures"]) == total
        assert len(one["failures"]) == len(HOSTILE) + (engine == "processes")
    intro = (
        f"{len(sizes):,} meshes of {min(sizes):,} to {max(sizes):,} faces (median "
        f"{median(sizes):,.0f}), made from {SHAPES} shapes with noise of their own, and "
        f"{len(HOSTILE)} that cannot be read, through `remesh_many(paths, store=...)`: read, remesh, "
        "measure, write. Two processes of the package, then two workers of a cluster on this machine, "
        "one run each. After a third of the meshes one worker is killed. Dask's own profiler is off: it "
        "keeps what it sees for an hour."
    )
    return page(
        "Data sets on a cluster",
        intro,
        machine_line(facts),
        _speed_table(runs, total),
        "Results are the same, bit for bit. A process takes the mesh it is at with it; a cluster lets "
        "another worker do it again. What failed, and why:",
        "\n".join(_failure(name, said, runs) for name, said in _failures(runs).items()),
        "## Memory",
        "Resident memory in MB at shares of the run time. Workers are added up, although they share "
        "their libraries.",
        _memory_table(runs),
    )


def _speed_table(runs: dict[str, Any], total: int) -> str:
    rows = [
        [
            ENGINES[engine], f"{one['start']:.1f}", f"{one['seconds']:.1f}",
            f"{total / one['seconds']:.0f}", f"{one['done']:,}", str(len(one["failures"])),
        ]
        for engine, one in runs.items()
    ]  # fmt: skip
    head = ["", "start of the cluster, s", "seconds", "meshes per second", "done", "failed"]
    return table(head, rows)


def _failures(runs: dict[str, Any]) -> dict[str, str]:
    return dict(sorted({k: v for one in runs.values() for k, v in one["failures"].items()}.items()))


def _failure(name: str, said: str, runs: dict[str, Any]) -> str:
    engines = [engine for engine, one in runs.items() if name in one["failures"]]
    where = "" if len(engines) == len(runs) else f" (only with {engines[0]})"
    return f"- {name}: {said}{where}"


def _memory_table(runs: dict[str, Any]) -> str:
    shares = (0.2, 0.4, 0.6, 0.8, 0.95)
    rows = []
    for engine, one in runs.items():
        for kind, name in enumerate(("parent", "workers")):
            values = [sample[kind] / 1e6 for sample in one["resident"]]
            at = [values[int(share * len(values))] for share in shares]
            rows.append([ENGINES[engine], name, *(f"{v:.0f}" for v in (*at, max(values)))])
    head = ["", "of", *(f"{100 * share:.0f} %" for share in shares), "most"]
    return table(head, rows, text_columns=2)


if __name__ == "__main__":
    main()
