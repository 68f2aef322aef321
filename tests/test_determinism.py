"""The same bits on any number of threads, and from every serial and parallel build of a driver."""

import importlib
import json
import os
import pkgutil
import subprocess
import sys
from pathlib import Path

import nonmanifold
import numpy as np
import pytest
import zoo
from structure import assert_same_bits, assert_valid, blocks_of, copied, featured, locate, project

import remeshvec
from remeshvec._jit import driver
from remeshvec._types import FIXED, NONE
from remeshvec.bvh import closest_faces
from remeshvec.operations.collapse import CollapseLimits, collapse_short_edges
from remeshvec.operations.fit import fit_vertices
from remeshvec.operations.flip import FlipLimits, flip_edges
from remeshvec.operations.project import project_curves, read_lengths
from remeshvec.operations.relax import relax_vertices
from remeshvec.operations.slide import slide_vertices
from remeshvec.operations.split import compact, split_long_edges
from remeshvec.operations.unfold import undo_folds
from remeshvec.operations.untangle import untangle_vertices
from remeshvec.prepare import prepare

ROOT = Path(__file__).resolve().parents[1]


def mesh():
    """Closed and open component, unevenly triangulated."""
    one = zoo.upsampled(*zoo.torus(24, 12), noise=0.3)
    V, F = zoo.joined(one, zoo.upsampled(*zoo.annulus(24, 5), noise=0.3), shift=4.0)
    return zoo.perturb(V, F, amount=0.05)


def same(one, two):
    if isinstance(one, tuple):
        for x, y in zip(one, two, strict=True):
            same(x, y)
    else:
        assert np.asarray(one).tobytes() == np.asarray(two).tobytes()


def phases():
    """Name and call of every phase; a call gets mesh, blocks, reference and the build to use."""
    collapses = CollapseLimits(0.8, 4 / 3, 0.9, 0.5, False)
    flips = FlipLimits(0.7, True, False)
    yield "flip", lambda m, b, r, p: flip_edges(m, b, flips, p)
    yield "collapse", lambda m, b, r, p: collapse_short_edges(m, b, collapses, p)
    yield "slide", lambda m, b, r, p: slide_vertices(m, b, r, p)
    for stiffness in (20.0, 0.0):
        yield "relax", lambda m, b, r, p, s=stiffness: relax_vertices(m, b, s, p)
    yield "unfold", lambda m, b, r, p: unfold(m, b, p)
    yield "project", lambda m, b, r, p: project(shifted(m), r, b, p)
    yield "project curves", lambda m, b, r, p: project_curves(shifted(m), b, r, p)
    yield "untangle", lambda m, b, r, p: untangle_vertices(m, b, r.tree, True, 0.8, p)
    yield "fit", lambda m, b, r, p: fit_vertices(m, b, r.tree, 0.1, p)
    yield "locate", lambda m, b, r, p: locate(m, r, b, p)
    yield "lengths", lambda m, b, r, p: read_lengths(stretched(m), b, r, p)
    yield "closest", lambda m, b, r, p: closest_faces(r.tree, *queries(m), 0.0, p)


def shifted(mesh):
    """Move all vertices but the fixed ones, some of them over their neighbours."""
    noise = np.random.default_rng(5).normal(size=(len(mesh.X), 3))
    free = mesh.kind < FIXED
    mesh.X[free, :3] += 0.3 * mesh.X[free, 3:] * noise[free]
    return mesh


def unfold(mesh, blocks, parallel):
    before = mesh.X.copy()
    return undo_folds(shifted(mesh), blocks, before, parallel)


def stretched(mesh):
    mesh.X[:, 3] *= 1.5
    return mesh


def queries(mesh):
    return mesh.X[:, :3].copy(), np.full(len(mesh.X), NONE, np.int32)


def test_every_driver_is_the_same_in_both_builds(monkeypatch):
    V, F = mesh()
    both = [prepare(V, F, parallel) for parallel in (False, True)]
    assert_same_bits(both[0].mesh, both[1].mesh)
    L = 1.3 * zoo.mean_edge(V, F) * both[0].scale
    references = []
    for one, parallel in zip(both, (False, True), strict=True):
        lengths = L * (1 + 0.3 * np.sin(4 * one.mesh.X[:, 0]))
        labels = (one.mesh.X[one.mesh.origin.reshape(-1, 3), 1].mean(axis=1) > 0).astype(int)
        references.append(
            featured(one.mesh, lengths, parallel=parallel, face_labels=labels).reference
        )
    same(tuple(references[0]), tuple(references[1]))
    assert_same_bits(both[0].mesh, both[1].mesh)
    current, reference = both[0].mesh, references[0]
    for _ in range(2):
        blocks = blocks_of(current, 100, monkeypatch)
        assert len(blocks.face) > 10
        done = [split_long_edges(current, blocks, 1.0, parallel) for parallel in (False, True)]
        assert done[0][1] == done[1][1]
        assert_same_bits(done[0][0], done[1][0])
        current = done[0][0]
        blocks = blocks_of(current, 100, monkeypatch)
        for name, phase in phases():
            other = copied(current)
            before = copied(current)
            results = [phase(m, blocks, reference, p) for m, p in ((current, False), (other, True))]
            assert_same_bits(current, other)
            if results[0] is not None:
                same(results[0], results[1])
            assert_valid(current)
            # It did something: two builds that both drop their loops would agree as well.
            changed = any(not np.array_equal(x, y) for x, y in zip(current, before, strict=True))
            assert changed or name in ("locate", "closest"), name
        packed = [compact(current, blocks, parallel) for parallel in (False, True)]
        assert_same_bits(*packed)
        current = packed[0]
    unused = [one.__name__ for one in drivers() if "parallel" not in vars(one)]
    assert not unused, "drivers that this test does not reach"


def drivers():
    for info in pkgutil.walk_packages(remeshvec.__path__, "remeshvec."):
        if info.name.rsplit(".", 1)[-1] in ("__main__", "viz", "cli"):
            continue
        for value in vars(importlib.import_module(info.name)).values():
            if isinstance(value, driver):
                yield value


def test_results_hardly_depend_on_the_blocks(monkeypatch):
    """They may, but blocks follow from the size of the mesh only: nothing is frozen at their borders."""
    V, F = mesh()
    L = zoo.mean_edge(V, F)
    whole = remeshvec.remesh(V, F, L)
    monkeypatch.setattr("remeshvec.edge_sets.FACES_PER_BLOCK", 100)
    cut = remeshvec.remesh(V, F, L)
    assert len(cut.F) == pytest.approx(len(whole.F), rel=0.03)
    a, b = whole.report.quality_after, cut.report.quality_after
    assert b.edge_cv == pytest.approx(a.edge_cv, abs=0.01)
    assert b.valence6_inner == pytest.approx(a.valence6_inner, abs=0.03)


SCRIPT = """
import hashlib, json, sys
import numpy as np, numba
from remeshvec import edge_sets, remesh
module = sys.modules["remeshvec.sweeps"]
path, per_block, threshold, options = json.loads(sys.argv[1])
data = np.load(path)
edge_sets.FACES_PER_BLOCK = per_block
seen = {}
for threads, faces in ((1, threshold), (2, threshold), (4, threshold), (4, 10**9), (None, threshold)):
    module._PARALLEL_FACES = faces
    used = []
    r = remesh(data["V"], data["F"], data["L"] if data["L"].ndim else float(data["L"]), threads=threads,
               callback=lambda *_: used.append(numba.get_num_threads()), **options)
    digest = hashlib.sha256()
    for x in (r.V, r.F, r.birth_face, r.birth_barycentric, r.vertex_map, r.face_map, r.feature_edges,
              r.corners, r.lengths):
        digest.update(np.ascontiguousarray(x).tobytes())
    seen[f"{threads} {faces}"] = [digest.hexdigest(), max(used), len(r.F)]
print(json.dumps(seen))
"""


def digests(tmp_path, V, F, L, per_block=100, threshold=0, **options):
    np.savez(tmp_path / "mesh.npz", V=V, F=F, L=L)
    case = json.dumps([str(tmp_path / "mesh.npz"), per_block, threshold, options])
    env = {**os.environ, "NUMBA_NUM_THREADS": "4", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, case], env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def assert_identical(seen):
    assert len({digest for digest, _, _ in seen.values()}) == 1, seen
    assert [seen[case][1] for case in seen if case.startswith(("2", "4"))][:2] == [2, 4]


@pytest.mark.parametrize("preset", ["fast", "default", "fine"])
def test_threads_give_the_same_bits(tmp_path, preset):
    V, F = mesh()
    assert_identical(digests(tmp_path, V, F, 0.8 * zoo.mean_edge(V, F), preset=preset))


def test_samples_give_the_same_bits(tmp_path):
    V, F = zoo.sample("cow.obj")
    assert_identical(digests(tmp_path, V, F, 0.7 * zoo.mean_edge(V, F), per_block=500))


CONTROLLED = {
    "creases": (lambda: zoo.upsampled(*zoo.genus_2(), n=2, noise=0.2), {}),
    "bracket": (lambda: zoo.read(zoo.DATA / "bracket.obj"), {}),
    "seams": (lambda: nonmanifold.interfaces(nonmanifold.FOUR_CUBES, 8), {}),
    "round seams": (lambda: nonmanifold.double_bubble(60, 21), {"feature_angle": None}),
    "held": (
        lambda: zoo.upsampled(*zoo.annulus(24, 5), noise=0.3),
        {
            "fixed_faces": list(range(0, 300, 17)),
            "fixed_vertices": [3, 50, 77],
            "boundary": "split",
        },
    ),
    "selection": (mesh, {"selection": list(range(500, 1500))}),
    "labels": (mesh, {"face_labels": [k // 900 for k in range(3072)]}),
    "deviation": (lambda: zoo.torus(48, 24), {"max_deviation": 0.01}),
}


@pytest.mark.parametrize("varies", [False, True])
@pytest.mark.parametrize("name", CONTROLLED)
def test_controlled_calls_give_the_same_bits(tmp_path, name, varies):
    """With curves, seams, held parts, and lengths by vertex."""
    make, options = CONTROLLED[name]
    V, F = make()
    L = 0.9 * zoo.mean_edge(V, F)
    if varies:
        size = np.ptp(V, axis=0).max()
        L = L * (1.3 + 0.6 * np.sin(6 * V[:, 0] / size) * np.cos(5 * V[:, 1] / size))
    assert_identical(digests(tmp_path, V, F, L, **options))


@pytest.mark.slow
def test_half_a_million_faces_give_the_same_bits(tmp_path):
    V, F = zoo.upsampled(*zoo.icosphere(6), noise=0.3)
    V *= 1 + 0.05 * np.sin(7 * V[:, :1])
    L = zoo.mean_edge(V, F) * (len(F) / 500_000) ** 0.5
    seen = digests(tmp_path, V, F, L, per_block=12288, threshold=20_000)
    assert_identical(seen)
    assert next(iter(seen.values()))[2] > 400_000


def test_repeated_calls_and_other_calls_between():
    V, F = mesh()
    one = remeshvec.remesh(V, F, 0.2)
    remeshvec.remesh(*zoo.torus(), 0.1)
    remeshvec.remesh(*nonmanifold.book(), 0.1)
    two = remeshvec.remesh(V, F, 0.2)
    same(
        (one.V, one.F, one.birth_face, one.birth_barycentric),
        (two.V, two.F, two.birth_face, two.birth_barycentric),
    )


def test_concurrent_calls_give_the_same_bits(monkeypatch):
    """Numba's pool takes one caller at a time; whoever comes second runs serially."""
    from concurrent.futures import ThreadPoolExecutor

    monkeypatch.setattr(sys.modules["remeshvec.sweeps"], "_PARALLEL_FACES", 0)
    V, F = mesh()
    expected = remeshvec.remesh(V, F, 0.15, threads=1)
    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(lambda _: remeshvec.remesh(V, F, 0.15), range(8)))
    for result in results:
        same((result.V, result.F), (expected.V, expected.F))
