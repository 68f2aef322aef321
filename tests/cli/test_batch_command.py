"""`remeshvec batch`: results, options, names, refusals, and a large batch."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from helpers import zoo
from helpers.batch_runs import ALL, batch, here, outputs, table
from helpers.processes import ROOT

import remeshvec
from remeshvec import read_mesh, remesh, write_mesh
from remeshvec.cli.batch_files import find_jobs
from remeshvec.cli.batch_table import COLUMNS, MEASURES
from remeshvec.cli.command import main

# -- results --------------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", ["1", "2"])
def test_results_are_those_of_single_calls(folder, workers, capsys):
    words = ["in/**/*.*", "--out", "out", "--workers", workers, "--length", "0.7"]
    assert main(["batch", *words]) == 0
    assert outputs() == ALL
    rows, quality = table(), remeshvec.quality
    assert sorted(rows) == ALL
    for name in ALL:
        V, F, _ = read_mesh(f"in/{name}")
        expected = remesh(V, F, 0.7)
        write_mesh(f"expected{Path(name).suffix}", expected.V, expected.F)
        assert Path("out", name).read_bytes() == Path(f"expected{Path(name).suffix}").read_bytes()
        row = rows[name]
        assert row["input"] == f"in/{name}" and row["error"] == ""
        assert int(row["faces_before"]) == len(F) and int(row["faces_after"]) == len(expected.F)
        assert float(row["seconds"]) > 0 and float(row["target_length"]) == 0.7
        after = quality(expected.V, expected.F, L=0.7)
        for column, attribute in MEASURES.items():
            assert float(row[f"{column}_after"]) == pytest.approx(getattr(after, attribute), 1e-5)
    text = capsys.readouterr().out
    assert "6 of 6 meshes are done, 0 failed" in text and "valence6, median" in text
    summary = json.loads(Path("out/summary.json").read_text())
    assert (summary["meshes"], summary["good"], summary["failed"]) == (6, 6, 0)


def test_options_reach_the_library(folder, asked):
    words = ["in/a/x.obj", "--out", "out", "--workers", "1"]
    assert batch(*words) == 0
    assert asked[-1] == {
        "L": None,
        "preset": "default",
        "clearance": 0.4,
        "feature_angle": "auto",
        "boundary": "free",
    }
    more = "--l-factor 2 --preset fast --boundary split --feature-angle none --tol 0.1 --no-project"
    assert batch(*words, *more.split()) == 0
    mean = remeshvec.quality(*read_mesh("in/a/x.obj")[:2]).edge_mean
    assert asked[-1]["L"] == pytest.approx(2 * mean)
    assert asked[-1]["boundary"] == "split" and asked[-1]["feature_angle"] is None
    assert (asked[-1]["tol"], asked[-1]["project"]) == (0.1, False)
    assert batch(*words, "--n-faces", "200") == 0
    assert asked[-1]["n_faces"] == 200


def test_formats_and_parquet(folder):
    assert here("--format", "ply", "--table", "table.parquet") == 0
    assert outputs() == [str(Path(name).with_suffix(".ply")) for name in ALL]
    parquet = pytest.importorskip("pyarrow.parquet")
    found = parquet.read_table("table.parquet").to_pylist()
    assert len(found) == 6 and tuple(found[0]) == COLUMNS
    assert isinstance(found[0]["faces_after"], int) and isinstance(found[0]["seconds"], float)
    assert found[0]["error"] is None


# -- names ----------------------------------------------------------------------------------------


def test_names_keep_what_the_patterns_do_not_share(folder):
    def names(*patterns, suffix=None):
        return [job.output for job in find_jobs(patterns, "out", suffix)]

    assert names("in/a/*.obj") == ["x.obj", "y.obj"]
    assert names("in/a/x.obj", "in/b/x.obj") == ["a/x.obj", "b/x.obj"]
    assert names("in/a/*.obj", "in/b/*.obj") == ["a/x.obj", "a/y.obj", "b/u.obj", "b/x.obj"]
    assert names("in/*/x.obj", suffix=".stl") == ["a/x.stl", "b/x.stl"]
    assert names("in/**/*.ply") == ["b/c/z.ply"]
    assert names("./in/a/x.obj", str(folder / "in/a/x.obj"), "in/a/*.obj") == ["x.obj", "y.obj"]
    Path("in/a/[1].obj").write_bytes(Path("in/a/x.obj").read_bytes())
    Path("in/a/notes.txt").touch()
    assert names("in/a/[1].obj") == ["[1].obj"]
    assert names("in/a/*") == ["[1].obj", "x.obj", "y.obj"]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["in/*.stl"], "in/*.stl: there is no such mesh file"),
        (["in/a"], "in/a is a folder; use 'in/a/*.obj'"),
        (["in/a/*.obj", "--out", "in/a"], "in/a/x.obj is an input"),
        (["in/**/*.obj", "--out", "in", "--format", "obj"], "is an input"),
        (["in/a/*.obj", "in/a/x.ply", "--format", "off"], "in/a/x.obj goes there"),
        (["in/a/*.obj", "--min-length", "1"], "--adaptive"),
        (["in/a/*.obj", "--table", "t.txt"], ".csv or .parquet"),
        (["in/a/*.obj", "--table", "none/t.csv"], "there is no folder"),
        (["in/a/*.obj", "--table", "in/a/x.obj"], ".csv or .parquet"),
        (["in/a/*.obj", "--table", "foreign.csv"], "is not a table of a batch"),
        (["in/a/x.obj", "in/s/summary.json"], "the batch itself writes it"),
    ],
)
def test_what_cannot_work_ends_in_one_line_before_the_work(folder, words, reason, capsys, calls):
    write_mesh("in/a/x.ply", *zoo.grid(4, 4))
    Path("in/s").mkdir()
    write_mesh("in/s/summary.json", *zoo.grid(4, 4))
    if reason.startswith("the batch"):
        words = ["in/s/summary.json"]
    Path("foreign.csv").write_text("name,age\nx,3\n")
    before = sorted(p for p in Path("in").rglob("*"))
    out = [] if "--out" in words else ["--out", "out"]
    assert main(["batch", *words, *out, "--workers", "1"]) == 2
    printed, error = capsys.readouterr()
    assert printed == "" and error.count("\n") == 1 and reason in error
    assert calls == [] and sorted(p for p in Path("in").rglob("*")) == before


@pytest.mark.parametrize("words", [[], ["--out", "out"], ["x.obj"], ["x.obj", "--selection", "f"]])
def test_bad_arguments_end_with_one_line(words, folder, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["batch", *words])
    err = capsys.readouterr().err
    assert caught.value.code == 2 and err.startswith("remeshvec batch: ") and err.count("\n") == 1


def test_a_file_named_batch(folder, capsys):
    assert main(["./batch"]) == 2
    assert "cannot read" in capsys.readouterr().err


# -- many -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_five_hundred_meshes_with_five_hostile_ones(tmp_path, monkeypatch):
    """1,000 to 20,000 faces; finishes, 495 good, 5 named, and memory stays as it is."""
    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks.batch import HOSTILE, make_meshes, measure

    make_meshes(tmp_path / "in")
    found = measure(tmp_path / "in", tmp_path / "out", workers=2)
    assert (found["good"], found["failed"]) == (495, 5)
    assert sorted(Path(name).name for name in found["failures"]) == sorted(HOSTILE)
    assert found["status"] == 3
    count = len(found["resident"])
    for kind in ("parent", "workers"):  # but for the end, where workers go
        values = [sample[kind] for sample in found["resident"][count // 3 : 9 * count // 10]]
        assert max(values) < 1.25 * min(values), kind
