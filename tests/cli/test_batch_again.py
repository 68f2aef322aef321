"""`remeshvec batch` again: it does what is missing or changed, after failures and interrupts too."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers import zoo
from helpers.batch_runs import ALL, batch, here, outputs, table
from helpers.processes import PATIENCE, alive, children_of, eventually, needs_proc, surroundings

import remeshvec
from remeshvec import read_mesh, write_mesh
from remeshvec.cli import batch_command as _batch_command
from remeshvec.cli.batch_table import ResultTable
from remeshvec.cli.command import main


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
        assert error.count("\n") == 1 and f"'{wrong}' in line" in error
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
        env=surroundings(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # a group of its own, as a terminal gives it
    )


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
    assert eventually(lambda: lines(Path("out/results.csv")) > 3)
    group = children_of(process.pid)
    assert len(group) == 2
    os.killpg(process.pid, getattr(signal, kind))
    _, errors = process.communicate(timeout=PATIENCE)
    assert eventually(lambda: not any(map(alive, group)))
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
        assert "run the same command again to continue" in errors
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
