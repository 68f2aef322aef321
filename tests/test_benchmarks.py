"""The benchmark suite's own parts: generated meshes, the store of results, targets, workers."""

import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import zoo

from remeshvec import quality

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import adaptive, pages, parts, peers, race, results, targets
from benchmarks import contenders as who
from benchmarks import quality as quality_page
from benchmarks.contenders import CONTENDERS, Contender
from benchmarks.generate import cut_finer
from benchmarks.meshes import Sample, load, made


@pytest.mark.parametrize("n", [1, 2, 5])
@pytest.mark.parametrize("make", [zoo.genus_2, zoo.annulus], ids=["closed", "open"])
def test_a_mesh_cut_finer_keeps_its_topology(make, n):
    V, F = make()
    W, G = cut_finer(V, F, n)
    before, after = quality(V, F), quality(W, G)
    assert len(G) == n * n * len(F)
    for kept in ("euler_number", "boundary_loops", "components", "nonmanifold_edges"):
        assert getattr(after, kept) == getattr(before, kept)
    assert after.misoriented_edges == after.degenerate_faces == after.unreferenced_vertices == 0


def test_a_mesh_cut_finer_is_the_same_every_time_and_near_the_surface():
    V, F = zoo.icosphere(3)
    W, G = cut_finer(V, F, 6)
    again = cut_finer(V, F, 6)
    assert np.array_equal(W, again[0]) and np.array_equal(G, again[1])
    radii = np.linalg.norm(W, axis=1)
    flat = np.linalg.norm(V[F].mean(axis=1), axis=1).min()
    assert 1 - radii.min() < 0.5 * (1 - flat)  # rounder than the flat faces
    assert radii.max() - 1 < 0.5 * (1 - flat)
    assert quality(W, G).edge_cv > 0.15  # irregular


def test_names_of_meshes():
    base, finer = load("bracket"), load("bracket-x4@0.5")
    assert len(finer.F) == 4 * len(base.F)
    assert finer.length == pytest.approx(base.length / 0.9 / 4, rel=0.05)
    for wrong in ("bracket-x5", "no_such_mesh", "bracket x 4"):
        with pytest.raises(SystemExit, match=r"no mesh|square|no name"):
            load(wrong)


def test_results_of_parts_are_kept_apart(tmp_path):
    results.record(tmp_path, "samples", "cat", {"faces": 1})
    results.record(tmp_path, "samples", "cow", {"faces": 2})
    results.record(tmp_path, "large", "cat", {"faces": 3})
    results.record(tmp_path, "samples", "cat", {"faces": 4})
    found = results.read_results(tmp_path)
    assert [found[p][k]["faces"] for p, k in (("samples", "cat"), ("samples", "cow"))] == [4, 2]
    assert found["large"]["cat"]["faces"] == 3
    assert found["samples"]["cow"]["measured"]["date"]


def entry(mesh, faces, seconds):
    rows = {
        name: {
            "first": s, "seconds": [s] * 5, "cpu_seconds": [s] * 5, "median": s, "cpu_median": s,
            "bytes_before": 10**8, "bytes_peak": 2 * 10**8, "digest": "",
            "quality": {column.key: 1.0 for column in pages.COLUMNS},
        }
        for name, s in seconds.items()
    }  # fmt: skip
    return {"mesh": mesh, "faces": faces, "bytes": 1, "contenders": rows, "measured": FACTS}


FACTS = {"date": "today", "cores": "2", "load average before": "0.1"}


def test_targets_are_ratios_of_medians_and_say_what_was_missed():
    cat = entry("cat", 10, {who.FAST: 0.5, who.TRUEFORM: 1.0, who.DEFAULT: 3.0})
    small = entry(made(36), 10, {who.FAST: 1.0, who.DEFAULT: 1.0})
    large = entry(made(400), 100, {who.FAST: 12.0, who.DEFAULT: 15.0})
    found = {"samples": {"cat": cat}, "per-face": {made(36): small, made(400): large}}
    by_name = {(t.group, t.what): t for t in targets.all_targets(found)}
    equal = by_name["fast without projection / trueform, one core", "cat"]
    assert equal.measured == 0.5 and equal.is_met
    per_face = "cost of a face at 4 million / at 360,000, one core"
    assert by_name[per_face, who.FAST].measured == pytest.approx(1.2)
    missed = [t.what for t in by_name.values() if t.measured is not None and not t.is_met]
    assert missed == ["cat", who.DEFAULT]
    assert "**3.00** (+1.00)" in targets.as_table(found)
    assert sum(t.measured is None for t in by_name.values()) == len(by_name) - 4


def test_threads_count_on_the_smallest_machine_that_has_them():
    names = {n: who.on_threads("default", n).name for n in (1, 2, 16)}
    two = entry(made(256), 10, {names[1]: 1.9, names[2]: 1.0})
    many = entry(made(256), 10, {names[1]: 10.0, names[2]: 6.0, names[16]: 1.0})
    many["measured"] = {**FACTS, "cores": "16"}
    found = {"threads": {"a": many, "b": two}}
    by_name = {(t.group, t.what): t.measured for t in targets.all_targets(found)}
    what = "default, 2.6 million faces"
    assert by_name["time on one thread / on 2", what] == 1.9
    assert by_name["time on one thread / on 16", what] == 10.0


def test_pages_need_results_only_and_name_who_is_absent(tmp_path):
    found = {"samples": {"cat": entry("cat", 10, {who.FAST: 0.5, who.TRUEFORM: 1.0})}}
    found["samples"]["cat"]["contenders"][who.GPYTOOLBOX] = {"failed": "it crashed"}
    results.write_results(tmp_path, found)
    pages.write_pages(tmp_path)
    text = (tmp_path / "benchmarks.md").read_text(encoding="utf-8")
    assert "58,520" in text and "Not installed where this was measured: PMP, " in text
    assert "- gpytoolbox on cat: it crashed" in text
    assert not (tmp_path / "threads.md").exists()


def nothing(V, F, length, reason=""):
    if reason:
        raise ValueError(reason)
    return V, F


def test_who_fails_costs_its_own_row_only():
    V, F = zoo.icosphere(2)
    good = Contender("good", "numpy", nothing, "", "no")
    bad = Contender("bad", "numpy", nothing, "", "no", {"reason": "cannot"})
    entrants = [race.Entrant(contender, Sample("ball", V, F, 0.3)) for contender in (bad, good)]
    rows = race.race(entrants, race.Effort(repeat=2))
    assert rows[0] == {"failed": "ValueError: cannot"}
    assert len(rows[1]["seconds"]) == 2 and rows[1]["median"] > 0
    assert rows[1]["quality"]["faces"] == len(F) and rows[1]["bytes_peak"] > 0


def test_every_part_has_meshes_and_contenders():
    for name, part in parts.RACES.items():
        for quick in (False, True):
            for case in part.cases(quick):
                assert case.meshes and case.contenders, name
    assert set(parts.PARTS) == {*parts.RACES, *parts.OTHERS}
    assert CONTENDERS[who.DEFAULT].is_installed


def test_triangles_along_a_field_are_measured_where_installed():
    """A process that crashes gives a reason; the page lists it below the others."""
    figures = {column.key: 1.0 for column in pages.COLUMNS}
    ours = [quality_page.Entry(mesh, "even", figures, "kept", 0) for mesh in ("ball", "torus")]
    beside = {"ball": {who.FIELD: {"failed": "it crashed"}}, "torus": {}}
    assert "along a field" not in quality_page.as_page(ours, beside)
    if not CONTENDERS[who.FIELD].is_installed:
        pytest.skip("pyinstantmeshes is not installed")
    found = quality_page.others(Sample("torus", *zoo.torus(48, 24), 0.2))
    assert found[who.FIELD]["quality"]["valence6"] > 60.0
    text = quality_page.as_page(ours, {**beside, "torus": found})
    assert f"{who.FIELD} on ball: it crashed" in text
    assert f"| torus | {who.FIELD} |" in text


def test_mmg_is_asked_for_what_is_as_far_from_the_input(monkeypatch):
    """Here by spheres whose chords sag by the bound."""

    def sphere(V, F, bound):
        n = int(np.clip(np.log2(1.2 / np.sqrt(8 * bound)) + 1, 1, 6))
        return zoo.icosphere(n)

    monkeypatch.setattr(peers, "mmgpy_adaptive", sphere)
    V, F = zoo.icosphere(6)
    sample = Sample("sphere", V, F, 0.1)
    near, far = (adaptive.as_far(sample, h, 12**0.5) for h in (0.1, 1.0))
    assert near.hausdorff <= 0.1 and far.hausdorff <= 1.0
    assert near.faces > far.faces > 80


def test_adaptive_lengths_stand_beside_the_same_as_an_array(monkeypatch):
    monkeypatch.setattr(adaptive, "find_spec", lambda name: None)
    V, F = zoo.torus(48, 24)
    rows = adaptive.rows_of(Sample("torus", V, F, 0.1), 0.005)
    assert [row[:2] for row in rows] == [["torus", "Adaptive"], ["torus", "array"]]
    assert all(len(row) == len(adaptive.HEAD) and float(row[3]) > 35 for row in rows)
    assert rows[1][-1] == "1.0"
