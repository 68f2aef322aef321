"""The same bits on any number of threads, and whatever the order in which they take the blocks."""

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import zoo
from helpers.no_negative_index import all_modules
from helpers.processes import run_python, surroundings
from helpers.structure import (
    assert_same_bits,
    assert_valid,
    blocks_of,
    built,
    copied,
    featured,
    locate,
    project,
)
from helpers.threads import on_threads, shuffled

import remeshvec
from data.shapes import cad_parts, nonmanifold, voxels
from remeshvec.core.compiler.decorators import ThreadedKernel
from remeshvec.core.vocabulary import FIXED, NONE
from remeshvec.input.prepare import prepare
from remeshvec.operations import folds
from remeshvec.operations.bisect import bisect_edges
from remeshvec.operations.classify import classify_edges
from remeshvec.operations.collapse import CollapseLimits, collapse_short_edges
from remeshvec.operations.fit import fit_vertices
from remeshvec.operations.flip import FlipLimits, flip_edges
from remeshvec.operations.frames import FRAME_SIZE, measure_frames
from remeshvec.operations.lloyd import Pace, run_lloyd_round, turn_velocities
from remeshvec.operations.project import project_curves, read_lengths
from remeshvec.operations.relax import relax_vertices
from remeshvec.operations.slide import slide_vertices
from remeshvec.operations.split import compact, split_long_edges
from remeshvec.operations.spread import area_spread
from remeshvec.operations.turned import find_turned_faces
from remeshvec.operations.unfold import undo_folded_edges, undo_folds
from remeshvec.operations.untangle import untangle_vertices
from remeshvec.output import extract
from remeshvec.reference.bvh import Surface, closest_faces
from remeshvec.reference.clearance import find_gaps
from remeshvec.reference.crossings import crossing_faces
from remeshvec.sizing.target_lengths import mesh_size
from remeshvec.sweeps.guard import tree_of


def mesh():
    """Closed and open component, unevenly triangulated."""
    one = zoo.upsampled(*zoo.torus(24, 12), noise=0.3)
    V, F = zoo.joined(one, zoo.upsampled(*zoo.annulus(24, 5), noise=0.3), shift=4.0)
    return zoo.perturb(V, F, amount=0.05)


def same(one, two):
    if isinstance(one, Surface):
        same(one.tree, two.tree)
    elif isinstance(one, tuple):
        for x, y in zip(one, two, strict=True):
            same(x, y)
    else:
        assert np.asarray(one).tobytes() == np.asarray(two).tobytes()


def phases():
    """Name and call of every phase; a call gets mesh, blocks, reference and the build to use."""
    collapses = CollapseLimits(0.8, 4 / 3, 0.9, 0.5, False)
    flips = FlipLimits(0.7, True, False)
    yield "measure", lambda m, b, r, p: tuple(classify_edges(m, b, 1.0, 0.8, p))
    yield "flip", lambda m, b, r, p: flip_edges(m, b, flips, p, passes=3)
    trades = FlipLimits(0.7, True, False, 0.4)
    yield "trade", lambda m, b, r, p: flip_edges(m, b, trades, p)
    yield "collapse", lambda m, b, r, p: collapse_short_edges(m, b, collapses, p)
    yield "bisect", lambda m, b, r, p: bisect_edges(m, b, classify_edges(m, b, 1.3, 0.8, p), p)
    yield "slide", lambda m, b, r, p: slide_vertices(m, b, r, p)
    for stiffness in (20.0, 0.0):
        yield "relax", lambda m, b, r, p, s=stiffness: relax_vertices(m, b, s, p)
    for varies in (False, True):
        yield "lloyd", lambda m, b, r, p, v=varies: lloyd_rounds(m, b, v, p)
    yield "spread", lambda m, b, r, p: np.array(area_spread(m, b, p))
    yield "unfold", lambda m, b, r, p: unfold(m, b, p)
    yield "unfold edges", lambda m, b, r, p: unfold(m, b, p, undo_folded_edges)
    yield "project", lambda m, b, r, p: project(shifted(m), r, b, p)
    yield "project curves", lambda m, b, r, p: project_curves(shifted(m), b, r, p)
    yield "untangle", lambda m, b, r, p: untangle_vertices(m, b, r.tree, True, 0.8, 2, p)
    yield "fit", lambda m, b, r, p: fit_vertices(m, b, r.tree, 0.1, p)
    yield "locate", lambda m, b, r, p: locate(m, r, b, p)
    yield "lengths", lambda m, b, r, p: read_lengths(stretched(m), b, r, p)
    yield "closest", lambda m, b, r, p: closest_faces(r.tree, *queries(m), 0.0, p)
    yield (
        "folds",
        lambda m, b, r, p: (folds.find_folds(m, folds.area_vectors(m, b, p)), has(m, b, p)),
    )
    yield "crossings", lambda m, b, r, p: (crossing_faces(tree_of(m, False), p),)
    yield "turned", lambda m, b, r, p: (turned(m, b, r, p),)


# Phases that change no mesh.
LOOKS = ("locate", "closest", "measure", "spread", "folds", "crossings", "turned")


def has(mesh, blocks, parallel):
    return np.array(folds.has_folds(mesh, blocks, parallel))


def turned(mesh, blocks, reference, parallel):
    found = find_turned_faces(shifted(copied(mesh)), blocks, reference.tree, parallel)
    assert len(found)
    return found


def write_out(mesh, parallel):
    """Arrays of a mesh with removed faces and vertices, twice as large."""
    numbers = extract._number_alive(mesh, parallel)
    assert len(numbers.faces) < len(mesh.source)
    frame = SimpleNamespace(scale=0.5, centre=np.ones(3))
    return (
        numbers.faces,
        numbers.vertices,
        *extract._write_result(mesh, numbers, frame, np.dtype(np.int64), parallel),
    )


def shifted(mesh):
    """Move all vertices but the fixed ones, some of them over their neighbours."""
    noise = np.random.default_rng(5).normal(size=(len(mesh.X), 3))
    free = mesh.kind < FIXED
    mesh.X[free, :3] += 0.3 * mesh.X[free, 3:] * noise[free]
    return mesh


def unfold(mesh, blocks, parallel, undo=undo_folds):
    before = mesh.X.copy()
    return undo(shifted(mesh), blocks, before, parallel)


def lloyd_rounds(mesh, blocks, varies, parallel):
    frames, velocity = np.empty((len(mesh.X), FRAME_SIZE)), np.zeros((len(mesh.X), 3))
    for _ in range(3):
        measure_frames(mesh, blocks, 400.0, frames, parallel)
        turn_velocities(mesh, blocks, frames, velocity, parallel)
        run_lloyd_round(mesh, blocks, frames, velocity, Pace(3.0, 0.85, 0.05), varies, parallel)
    return frames, velocity


def stretched(mesh):
    mesh.X[:, 3] *= 1.5
    return mesh


def queries(mesh):
    return mesh.X[:, :3].copy(), np.full(len(mesh.X), NONE, np.int32)


def in_every_way(call):
    """Results of ``call(parallel)`` on one thread, on four, and with its pieces in some other order."""
    with on_threads(1):
        results = [call(False)]
    with on_threads(4):
        results.append(call(True))
    with shuffled() as order:
        results.append(call(True))
    ORDERED.update(order.seen)
    return results


ORDERED: set[str] = set()  # kernels whose pieces were shuffled


def test_sizes_are_the_same_in_any_order():
    """Several pieces of many faces each."""
    prepared = prepare(*zoo.torus(160, 130), False)
    results = in_every_way(lambda parallel: mesh_size(prepared, parallel))
    assert all(result == results[0] for result in results)


def fine_prisms():
    """Many prisms of 12 sides that are parts: their facets are judged twice."""
    prism = cad_parts.prism(cad_parts.regular(12), 1.0)
    V, F = prism
    for k in range(1, 150):
        V, F = zoo.joined((V, F), prism, shift=3.0 * k)
    return V, F


@pytest.mark.parametrize(
    ("make", "length", "reason"),
    [
        (lambda: zoo.perturb(*zoo.upsampled(*zoo.torus(96, 48), noise=0.45), 0.02), 0.01, "noise"),
        (lambda: voxels.level_surface(voxels.ball(14)), 2.0, "terrace"),
        (fine_prisms, 1.0, "echo"),
    ],
)
def test_creases_are_the_same_in_any_order(make, length, reason):
    one = built(*make(), length=length)
    results = in_every_way(
        lambda parallel: featured(copied(one), parallel=parallel, feature_angle="auto")
    )
    assert results[0].counts[f"dropped_{reason}"] > 100
    for other in results[1:]:
        assert other.counts == results[0].counts
        same(tuple(results[0].reference), tuple(other.reference))


def test_every_kernel_is_the_same_in_any_order(monkeypatch):
    V, F = mesh()
    ready = in_every_way(lambda parallel: prepare(V, F, parallel))
    L = 1.3 * zoo.mean_edge(V, F) * ready[0].scale
    lengths = L * (1 + 0.3 * np.sin(4 * ready[0].mesh.X[:, 0]))
    labels = (ready[0].mesh.X[ready[0].mesh.origin.reshape(-1, 3), 1].mean(axis=1) > 0).astype(int)

    def referenced(parallel):
        one = ready.pop(0).mesh
        reference = featured(one, lengths, parallel=parallel, face_labels=labels).reference
        assert reference.tree is not None  # built here, not when it is first asked for
        return one, reference

    for one in ready[1:]:
        assert_same_bits(ready[0].mesh, one.mesh)
    ready = in_every_way(referenced)
    for one in ready[1:]:
        assert_same_bits(ready[0][0], one[0])
        same(tuple(ready[0][1]), tuple(one[1]))
    current, reference = ready[0]
    far = copied(current)
    far.X[:, 3] *= 20.0
    gaps = in_every_way(lambda p: find_gaps(reference.tree, far, p))
    assert np.isfinite(gaps[0]).any()
    for one in gaps[1:]:
        same(gaps[0], one)
    for _ in range(2):
        blocks = blocks_of(current, 100, monkeypatch)
        assert len(blocks.face) > 10
        done = in_every_way(lambda p: split_long_edges(current, blocks, 1.0, p))  # noqa: B023
        for one in done[1:]:
            assert one[1] == done[0][1]
            assert_same_bits(one[0], done[0][0])
        current = done[0][0]
        blocks = blocks_of(current, 100, monkeypatch)
        for name, phase in phases():
            copies = []

            def run(parallel, phase=phase, copies=copies):
                copies.append(copied(current))  # noqa: B023
                return phase(copies[-1], blocks, reference, parallel)  # noqa: B023

            results = in_every_way(run)
            for one, result in zip(copies[1:], results[1:], strict=True):
                assert_same_bits(copies[0], one)
                if result is not None:
                    same(results[0], result)
            # It did something: runs that all leave out their loops would agree as well.
            changed = any(
                not np.array_equal(*pair) for pair in zip(current, copies[0], strict=True)
            )
            assert changed or name in LOOKS, name
            current = copies[0]
            assert_valid(current)
        written = in_every_way(lambda p: write_out(current, p))  # noqa: B023
        for one in written[1:]:
            same(written[0], one)
        packed = in_every_way(lambda p: compact(current, blocks, p, 0.1))  # noqa: B023
        for one in packed[1:]:
            assert_same_bits(packed[0], one)
        current = packed[0]
    unused = {one.__name__ for one in kernels(ThreadedKernel)} - ORDERED
    assert not unused, "kernels that this test does not reach"


def kernels(kind):
    for module in all_modules():
        yield from (value for value in vars(module).values() if isinstance(value, kind))


def test_results_hardly_depend_on_the_blocks(monkeypatch):
    """They may, but blocks follow from the size of the mesh only: nothing is frozen at their borders."""
    V, F = mesh()
    L = zoo.mean_edge(V, F)
    whole = remeshvec.remesh(V, F, L)
    monkeypatch.setattr("remeshvec.mesh.blocks.FACES_PER_BLOCK", 100)
    cut = remeshvec.remesh(V, F, L)
    assert len(cut.F) == pytest.approx(len(whole.F), rel=0.03)
    a, b = whole.report.quality_after, cut.report.quality_after
    assert b.edge_cv == pytest.approx(a.edge_cv, abs=0.01)
    assert b.valence6_inner == pytest.approx(a.valence6_inner, abs=0.03)


SCRIPT = """
import hashlib, json, sys
import numpy as np
from remeshvec import remesh
from remeshvec.core import threads as _threads
from remeshvec.mesh import blocks
module = sys.modules["remeshvec.sweeps.work"]
path, per_block, threshold, options = json.loads(sys.argv[1])
data = np.load(path)
blocks.FACES_PER_BLOCK = per_block
seen = {}
for threads, faces in ((1, threshold), (2, threshold), (4, threshold), (4, 10**9), (None, threshold)):
    module._PARALLEL_FACES = faces
    used = []
    r = remesh(data["V"], data["F"], data["L"] if data["L"].ndim else float(data["L"]), threads=threads,
               callback=lambda *_: used.append(_threads._scope.threads), **options)
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
    env = surroundings() | {"NUMBA_NUM_THREADS": "4"}
    return json.loads(run_python("-c", SCRIPT, case, env=env).stdout)


def assert_identical(seen):
    assert len({digest for digest, _, _ in seen.values()}) == 1, seen
    assert [seen[case][1] for case in seen if case.startswith(("2", "4"))][:2] == [2, 4]


@pytest.mark.parametrize("preset", ["fast", "default", "even", "fine"])
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


@pytest.mark.parametrize(
    ("name", "varies"), [(name, k % 2 == 0) for k, name in enumerate(CONTROLLED)]
)
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
    """They share the threads, and may run one another's pieces."""
    from concurrent.futures import ThreadPoolExecutor

    monkeypatch.setattr(sys.modules["remeshvec.sweeps.work"], "_PARALLEL_FACES", 0)
    V, F = mesh()
    expected = remeshvec.remesh(V, F, 0.15, threads=1)
    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(lambda _: remeshvec.remesh(V, F, 0.15), range(8)))
    for result in results:
        same((result.V, result.F), (expected.V, expected.F))
