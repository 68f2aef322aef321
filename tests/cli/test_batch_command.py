"""`remeshvec batch`: names, refusals, the table, second runs, interrupts, and a large batch."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from batch.test_batch import PATIENCE, ROOT, alive, children_of, needs_proc
from helpers import zoo

import remeshvec
from remeshvec import read_mesh, remesh, write_mesh
from remeshvec.cli import batch_command as _batch_command
from remeshvec.cli.batch_files import find_jobs
from remeshvec.cli.batch_table import COLUMNS, MEASURES, ResultTable
from remeshvec.cli.command import main


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Six meshes in two folders, two of the same name."""
    monkeypatch.chdir(tmp_path)
    for k, name in enumerate(
        ["a/x.obj", "a/y.obj", "b/x.obj", "b/c/z.ply", "b/c/v.off", "b/u.obj"]
    ):
        path = Path("in", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        V, F = zoo.grid(6 + k, 6)
        write_mesh(path, V + 0.2 * np.sin(3 * V[:, ::-1]), F)
    return tmp_path


@pytest.fixture
def calls(monkeypatch):
    """Note which files are remeshed, in this process."""
    seen, real = [], _batch_command._remesh_file

    def note(job, options):
        seen.append(job.output)
        return real(job, options)

    monkeypatch.setattr(_batch_command, "_remesh_file", note)
    return seen


def batch(*words):
    return main(["batch", *words, "--quiet"])


def here(*words):
    """Run with one worker, so that `calls` sees it."""
    return batch("in/**/*.*", "--out", "out", "--workers", "1", "--preset", "fast", *words)


def table(path="out/results.csv"):
    with open(path, newline="") as file:
        return {row["output"]: row for row in csv.DictReader(file)}


def outputs(root="out"):
    files = (p.relative_to(root).as_posix() for p in Path(root).rglob("*") if p.is_file())
    return sorted(name for name in files if name not in ("results.csv", "summary.json"))


ALL = ["a/x.obj", "a/y.obj", "b/c/v.off", "b/c/z.ply", "b/u.obj", "b/x.obj"]


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


def test_options_reach_the_library(folder, monkeypatch):
    asked, real = [], remeshvec.remesh

    def note(V, F, L=None, **options):
        asked.append({"L": L} | options)
        return real(V, F, L, **options)

    monkeypatch.setattr("remeshvec.remesh", note)
    words = ["in/a/x.obj", "--out", "out", "--workers", "1"]
    assert batch(*words) == 0
    assert asked[-1] == {
        "L": None,
        "preset": "default",
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
        (["in/a"], "in/a is a folder; say 'in/a/*.obj'"),
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
def test_bad_arguments_end_with_the_usage(words, folder, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["batch", *words])
    assert caught.value.code == 2 and "usage: remeshvec batch" in capsys.readouterr().err


def test_a_file_named_batch(folder, capsys):
    assert main(["./batch"]) == 2
    assert "cannot read" in capsys.readouterr().err


# -- going on -------------------------------------------------------------------------------------


def test_a_second_run_does_what_is_missing_or_changed(folder, calls):
    def again(*words):
        calls.clear()
        assert here(*words) == 0
        return sorted(calls)

    assert again() == ALL
    kept = table()
    assert again() == []
    assert table() == kept
    assert again("--threads", "1", "--table", "out/results.csv") == []
    Path("out/b/x.obj").unlink()
    assert again() == ["b/x.obj"]
    write_mesh("in/a/y.obj", *zoo.grid(5, 5))
    assert again() == ["a/y.obj"]
    assert again("--preset", "default") == ALL
    assert again("--preset", "default", "--force") == ALL
    write_mesh("in/b/new.obj", *zoo.grid(5, 5))
    assert again("--preset", "default") == ["b/new.obj"]
    assert len(table()) == 7


def test_another_version_does_all_again(folder, calls, monkeypatch):
    assert here() == 0
    calls.clear()
    monkeypatch.setattr("remeshvec.__version__", "0.0.0")
    assert here() == 0
    assert sorted(calls) == ALL


def test_failures_are_named_and_tried_again(folder, calls, capsys):
    Path("in/empty.obj").touch()
    Path("in/garbage.stl").write_bytes(os.urandom(500))
    words = ["in/**/*.*", "--out", "out", "--workers", "1", "--preset", "fast"]
    assert main(["batch", *words]) == _batch_command.EXIT_SOME_FAILED == 3
    text = capsys.readouterr().out
    assert "6 of 8 meshes are done, 2 failed" in text
    assert "failed: in/empty.obj: MeshFormatError: cannot read in/empty.obj: it is empty" in text
    rows = table()
    assert rows["empty.obj"]["error"].startswith("MeshFormatError: cannot read in/empty.obj")
    assert rows["empty.obj"]["faces_after"] == ""
    assert outputs() == ALL
    calls.clear()
    write_mesh("in/empty.obj", *zoo.grid(4, 4))
    assert here() == 3
    assert sorted(calls) == ["empty.obj", "garbage.stl"]
    assert table()["empty.obj"]["error"] == ""
    failures = json.loads(Path("out/summary.json").read_text())["failures"]
    assert list(failures) == ["in/garbage.stl"]


def test_outputs_are_no_inputs_of_the_next_run(folder, calls):
    words = ["**/*.obj", "--out", "out", "--workers", "1", "--preset", "fast"]
    assert batch(*words) == 0
    assert len(calls) == 4
    assert batch(*words) == 0
    assert len(calls) == 4


def test_a_table_that_was_cut_short(folder, calls):
    """At every byte of its last two rows: what is whole counts, the rest is done again."""
    assert here() == 0
    content = Path("out/results.csv").read_bytes()
    ends = [k for k, byte in enumerate(content) if byte == 10]
    for cut in range(ends[-3] + 1, len(content), 7):
        Path("out/results.csv").write_bytes(content[:cut])
        whole = sum(end < cut for end in ends) - 1
        assert len(ResultTable("out/results.csv").rows) == whole
    calls.clear()
    assert here() == 0
    assert calls == ALL[5:]
    assert sorted(table()) == ALL
    for short in (b"", content[: ends[0]], content[: ends[0] + 1]):
        Path("out/results.csv").write_bytes(short)
        assert ResultTable("out/results.csv").rows == {}


def test_a_table_that_a_spreadsheet_saved(folder, calls, capsys):
    assert here() == 0
    path = Path("out/results.csv")
    content = path.read_text()
    with_commas = "\ufeff" + content.replace(",", ";").replace(".", ",").replace("\n", "\r\n")
    with_commas = (
        with_commas.replace(",obj", ".obj").replace(",ply", ".ply").replace(",off", ".off")
    )
    with_commas = with_commas.replace(
        remeshvec.__version__.replace(".", ","), remeshvec.__version__
    )
    quoted = "".join(
        ",".join(f'"{cell}"' for cell in line.split(",")) + "\n" for line in content.splitlines()
    )
    for saved in ("\ufeff" + content, content.replace(",", "\t"), with_commas, quoted):
        path.write_text(saved, newline="")
        calls.clear()
        assert here() == 0 and calls == []
        assert path.read_text() == content
    rows = table()
    stamp = rows["b/x.obj"]["input_mtime_ns"]
    path.write_text(content.replace(stamp, f"{float(stamp):.5E}"))
    assert here() == 0 and "b/x.obj" in calls  # and others written in the same moment
    faces = rows["b/x.obj"]["faces_before"]
    line = next(line for line in content.splitlines() if "b/x.obj" in line)
    for wrong in ("1,000", "Jan 98", "1.000"):
        path.write_text(content.replace(line, line.replace(f",{faces},", f',"{wrong}",', 1)))
        capsys.readouterr()
        assert here() == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and f"'{wrong}' stands in line" in error
        assert "faces_before" in error and wrong in path.read_text()
    path.write_bytes(content.encode("utf-16"))
    assert here() == 2
    assert "is not a table of a batch" in capsys.readouterr().err


def test_odd_names_survive(folder, calls):
    V, F = zoo.grid(4, 4)
    names = ['comma, and quote".obj', "line\nbreak.obj", "\N{SNOWMAN}.obj", " blank .obj"]
    for name in names:
        Path("odd").mkdir(exist_ok=True)
        write_mesh(f"odd/{name}", V, F)
    words = ["odd/*.obj", "--out", "out", "--workers", "1", "--preset", "fast"]
    assert batch(*words) == 0
    assert sorted(table()) == sorted(names) == outputs()
    calls.clear()
    assert batch(*words) == 0
    assert calls == []


def test_rows_are_there_before_the_end(folder, monkeypatch):
    """What is done is in the table when the next one begins; an interrupt loses nothing."""
    seen, real = [], _batch_command._remesh_file

    def stop(job, options):
        seen.append(len(table()))
        if len(seen) == 4:
            raise KeyboardInterrupt
        return real(job, options)

    monkeypatch.setattr(_batch_command, "_remesh_file", stop)
    assert here() == 130
    assert seen == [0, 1, 2, 3]
    assert sorted(table()) == outputs() == ALL[:3]
    assert json.loads(Path("out/summary.json").read_text())["not_done"] == 3
    monkeypatch.setattr(_batch_command, "_remesh_file", real)
    assert here() == 0
    assert sorted(table()) == outputs() == ALL


# -- interrupts of real processes -----------------------------------------------------------------


def start(*words):
    return subprocess.Popen(
        [sys.executable, "-m", "remeshvec", *words],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # a group of its own, as a terminal gives it
    )


def wait_for(condition):
    deadline = time.monotonic() + PATIENCE
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert condition()


def lines(path):
    return path.read_bytes().count(b"\n") if path.exists() else 0


MANY = 40  # meshes, of which two workers do about 25 per second


@needs_proc
@pytest.mark.parametrize("kind", ["SIGINT", "SIGKILL"])
def test_an_interrupted_batch_leaves_nothing_half_done_and_goes_on(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("in").mkdir()
    V, F = zoo.torus(40, 20)
    for k in range(MANY):
        write_mesh(f"in/{k:02}.obj", V * (1 + 0.01 * k), F)
    words = ["batch", "in/*.obj", "--out", "out", "--workers", "2"]
    process = start(*words)
    wait_for(lambda: lines(Path("out/results.csv")) > 3)
    group = children_of(process.pid)
    assert len(group) == 2
    os.killpg(process.pid, getattr(signal, kind))
    _, errors = process.communicate(timeout=PATIENCE)
    wait_for(lambda: not any(map(alive, group)))
    assert process.returncode == (130 if kind == "SIGINT" else -9)
    assert "Traceback" not in errors
    assert not list(Path("out").glob(".*.part"))
    found = outputs()
    done = table()
    assert 2 < len(found) < MANY
    assert set(done) <= set(found) and len(found) - len(done) <= 2
    for name in found:
        assert len(read_mesh(f"out/{name}").F) > 500
    if kind == "SIGINT":
        assert "the same command continues" in errors
    times = {name: os.stat(f"out/{name}").st_mtime_ns for name in done}
    assert main([*words, "--quiet"]) == 0
    assert len(table()) == len(outputs()) == MANY
    assert all(os.stat(f"out/{name}").st_mtime_ns == at for name, at in times.items())


@needs_proc
def test_an_interrupted_command_leaves_nothing_half_done(tmp_path, monkeypatch):
    """The command for one mesh, in the middle of its sweeps, by the signal of a terminal."""
    monkeypatch.chdir(tmp_path)
    V, F = zoo.torus(160, 80)
    write_mesh("in.ply", V, F)
    Path("out.ply").write_bytes(b"what was there")
    process = start("in.ply", "-o", "out.ply", "--save-stats", "s.json", "--iterations", "5000")
    assert process.stderr.readline().startswith(("sweep ", "remeshvec: compiling"))
    os.killpg(process.pid, signal.SIGINT)
    begun = time.monotonic()
    out, errors = process.communicate(timeout=PATIENCE)
    assert time.monotonic() - begun < 10
    assert process.returncode == 130 and out == ""
    assert errors.splitlines()[-1] == "remeshvec: interrupted, nothing more was written"
    assert "Traceback" not in errors
    assert sorted(os.listdir()) == ["in.ply", "out.ply"]
    assert Path("out.ply").read_bytes() == b"what was there"


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
