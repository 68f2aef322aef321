"""The shell command: what it prints, writes, refuses, and how it ends."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import zoo
from helpers.processes import surroundings

import remeshvec
from remeshvec import read_mesh, write_mesh
from remeshvec.cli.command import ProgressLine, main
from remeshvec.errors import OptionError
from remeshvec.files.mesh_files import SUFFIXES


def bumpy_sheet(n=12):
    """Return a triangulated sheet with uneven edges."""
    x, y = np.meshgrid(np.linspace(0, 1, n) ** 2, np.linspace(0, 1, n), indexing="ij")
    V = np.stack([x, y, 0.1 * np.sin(5 * x) * np.cos(4 * y)], axis=-1).reshape(-1, 3)
    a = (n * np.arange(n - 1)[:, None] + np.arange(n - 1)).ravel()
    return V, np.concatenate([np.c_[a, a + n, a + 1], np.c_[a + n, a + n + 1, a + 1]])


@pytest.fixture
def sheet(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_mesh("in.obj", *bumpy_sheet())
    return "in.obj"


def failing_remesh(error):
    def remesh(*_, **__):
        raise error

    return remesh


def test_without_output_only_the_table_is_shown(sheet, capsys):
    assert main([sheet]) == 0
    out = capsys.readouterr().out
    assert os.listdir() == ["in.obj"]
    assert "no mesh was written" in out and "written: " not in out
    heading, *rows = out.split("\n\n")[1].splitlines()
    assert heading.split() == ["before", "after"]
    table = {row[:31].strip(): row[31:].split() for row in rows}
    assert table["vertices"][0] == "144" and table["faces"][0] == "242"
    angles = table["smallest angle, mean"]
    assert float(angles[2]) > float(angles[0]) + 5  # "34.5 deg 51.2 deg"


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_output_in_every_format(suffix, sheet, capsys):
    assert main([sheet, "-o", f"out{suffix}"]) == 0
    assert f"written: out{suffix}" in capsys.readouterr().out
    mesh = read_mesh(f"out{suffix}")
    expected = remeshvec.remesh(*read_mesh(sheet)[:2])
    assert mesh.F.shape == expected.F.shape
    tolerance = 1e-7 if suffix == ".stl" else 0
    np.testing.assert_allclose(mesh.V[mesh.F], expected.V[expected.F], rtol=0, atol=tolerance)
    assert sorted(os.listdir()) == ["in.obj", f"out{suffix}"]


def test_the_input_may_be_replaced(sheet):
    before = read_mesh(sheet).V.shape
    assert main([sheet, "-o", sheet, "--quiet"]) == 0
    assert os.listdir() == ["in.obj"]
    assert read_mesh(sheet).V.shape != before


def test_statistics(sheet):
    arguments = ["--quiet", "-o", "out.ply", "--save-stats", "s.json", "--preset", "fast"]
    assert main([sheet, *arguments, "--length", "0.1"]) == 0
    content = json.loads(Path("s.json").read_text())
    assert (content["input"], content["output"], content["notices"]) == ("in.obj", "out.ply", [])
    before, after = content["quality_before"], content["quality_after"]
    assert before["faces"] == 242 and after["faces"] == len(read_mesh("out.ply").F)
    assert after["area_error_face"] < before["area_error_face"]
    assert after["target_length"] == content["target_length"] == 0.1
    assert content["preset"] == "fast"


def test_statistics_of_what_json_lacks_are_null(sheet, monkeypatch):
    real = remeshvec.remesh

    def remesh(*args, **options):
        result = real(*args, **options)
        as_dict = {"a": float("nan"), "b": [1, float("inf")], "c": {2: "x"}}
        monkeypatch.setattr(type(result.report), "to_dict", lambda _: as_dict)
        return result

    monkeypatch.setattr("remeshvec.remesh", remesh)
    assert main([sheet, "--save-stats", "s.json"]) == 0
    content = json.loads(Path("s.json").read_text())
    assert {key: content[key] for key in "abc"} == {"a": None, "b": [1, None], "c": {"2": "x"}}


def test_default_options_are_left_to_the_library(sheet, asked):
    assert main([sheet]) == 0
    assert isinstance(asked[0].pop("callback"), ProgressLine)
    defaults = {"preset": "default", "feature_angle": "auto", "boundary": "free", "clearance": 0.4}
    assert asked == [{"L": None, **defaults}]


def test_options_reach_the_library(sheet, asked):
    flags = "--length 0.2 --preset fast --iterations 2 --foldover 30 --no-sliver-check"
    flags += " --split 1.5 --collapse 0.5 --no-fit"
    assert main([sheet, *flags.split(), "--no-project", "--threads", "1", "--quiet"]) == 0
    assert asked == [
        {
            "L": 0.2,
            "preset": "fast",
            "clearance": 0.4,
            "feature_angle": "auto",
            "boundary": "free",
            "iterations": 2,
            "split": 1.5,
            "collapse": 0.5,
            "fit": False,
            "foldover": 30.0,
            "sliver_check": False,
            "project": False,
            "threads": 1,
            "callback": None,
        }
    ]


def test_length_factor_multiplies_the_mean_edge(sheet, asked):
    from remeshvec.measures.quality import quality

    assert main([sheet, "--l-factor", "1.5", "--sliver-check"]) == 0
    assert asked[0]["L"] == pytest.approx(1.5 * quality(*bumpy_sheet()).edge_mean, rel=1e-12)
    assert asked[0]["sliver_check"] is True


def test_timing_lists_the_phases(sheet, capsys):
    assert main([sheet, "-o", "out.off", "--timing"]) == 0
    out = capsys.readouterr().out
    rows = [line.split() for line in out.splitlines() if line.endswith(" s")]
    names = {" ".join(row[:-2]) for row in rows}
    assert {"read", "split", "collapse", "flip", "relax", "remesh, total", "write"} <= names
    assert all(float(row[-2]) >= 0 for row in rows)


def test_quiet_prints_nothing(sheet, capsys):
    remeshvec.remesh(*bumpy_sheet())  # the library may say that it compiles
    capsys.readouterr()
    assert main([sheet, "-o", "out.obj", "--quiet", "--timing"]) == 0
    assert capsys.readouterr() == ("", "")


def test_notices_and_dirt_are_shown(sheet, capsys):
    V, F = bumpy_sheet()
    write_mesh("dirty.json", np.r_[V, [[5, 5, 5]]], F)
    assert main(["dirty.json"]) == 0
    assert "note: unreferenced vertices: 1\n" in capsys.readouterr().out
    Path("quad.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    assert main(["quad.obj"]) == 0
    assert "note: polygons were cut: 1 faces became 2 triangles\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["missing.obj"], "cannot read missing.obj: there is no such file"),
        (["broken.obj"], "cannot read broken.obj: 'f 1' is not a face"),
        (["in.obj", "-o", "out.xyz"], "cannot write out.xyz: the suffix '.xyz' is not one of"),
        (["in.obj", "-o", "none/out.obj"], "cannot write none/out.obj: there is no folder"),
        (["in.obj", "-o", "folder.obj"], "cannot write folder.obj: it is a folder"),
        (["in.obj", "--save-stats", "none/s.json"], "there is no folder"),
        (["in.obj", "-o", "a.json", "--save-stats", "a.json"], "two outputs have the same name"),
        (["in.obj", "--save-stats", "in.obj"], "would replace the input in.obj"),
        (["ring.obj"], "cannot read ring.obj: "),
        (["ring.obj", "-o", "out.obj"], "cannot read ring.obj: "),
        (["ring.vtp"], "cannot read ring.vtp: "),
        (["batch", "ring.obj", "--out", "out"], "ring.obj: there is no such mesh file"),
    ],
)
def test_bad_input_ends_with_one_line_before_the_work(arguments, reason, sheet, capsys, asked):
    Path("broken.obj").write_text("v 0 0 0\nf 1\n")
    Path("folder.obj").mkdir()
    for suffix in (".obj", ".vtp"):
        Path(f"ring{suffix}").symlink_to(f"back{suffix}")
        Path(f"back{suffix}").symlink_to(f"ring{suffix}")
    names = sorted(os.listdir())
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("remeshvec: ") and err.count("\n") == 1
    assert reason in err
    assert asked == [] and sorted(os.listdir()) == names


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["in.obj", "--length", "-1"],
        ["in.obj", "--length", "nan"],
        ["in.obj", "--length", "1", "--l-factor", "1"],
        ["in.obj", "--iterations", "0"],
        ["in.obj", "--iterations", "1.5"],
        ["in.obj", "--threads", "0"],
        ["in.obj", "--preset", "best"],
        ["in.obj", "-o", ""],
        ["in.obj", "--save-stats="],
        ["in.obj", "--fixed-faces", ""],
        [""],
        ["batch", "in.obj", "", "--out", "out"],
        ["batch", "in.obj", "--out", ""],
    ],
)
def test_bad_arguments_end_with_one_line(arguments, sheet, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    err = capsys.readouterr().err
    assert err.startswith("remeshvec") and err.count("\n") == 1
    assert "--help lists all arguments" in err and "_positive_number" not in err


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("in.obj --lenght 1", "there is no flag --lenght; did you mean --length?"),
        ("in.obj --edge-length=1", "there is no flag --edge-length; did you mean --length?"),
        ("in.obj --target-length 1", "there is no flag --target-length; did you mean --length?"),
        ("in.obj --num-faces 9", "there is no flag --num-faces; did you mean --n-faces?"),
        ("in.obj --n-jobs 9", "there is no flag --n-jobs; did you mean --threads?"),
        ("batch in.obj --outt out", "there is no flag --outt; did you mean --out?"),
        ("in.obj --xyzzy", "there is no flag --xyzzy ("),
        ("in.obj --preset evn", "did you mean even?"),
        ("in.obj --length few", "argument --length: few is not a positive number"),
        ("in.obj --iterations 1.5", "1.5 is not a whole number, at least 1"),
    ],
)
def test_wrong_flags_get_the_right_one(words, line, sheet, capsys):
    with pytest.raises(SystemExit) as caught:
        main(words.split())
    err = capsys.readouterr().err
    assert caught.value.code == 2 and line in err and err.count("\n") == 1


def test_flags_may_be_abbreviated_and_names_begin_with_dashes(sheet, capsys):
    write_mesh("--odd.obj", *bumpy_sheet())
    assert main(["--quie", "--", "--odd.obj"]) == 0


@pytest.mark.parametrize(
    ("error", "status", "reason"),
    [
        (OptionError("L is too small"), 2, "L is too small"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (MemoryError(), 1, "not enough memory"),
    ],
)
def test_failures_of_the_work_leave_no_file(error, status, reason, sheet, capsys, monkeypatch):
    monkeypatch.setattr("remeshvec.remesh", failing_remesh(error))
    assert main([sheet, "-o", "out.obj", "--save-stats", "s.json"]) == status
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and reason in err
    assert os.listdir() == ["in.obj"]


def test_version(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out.startswith("remeshvec ")


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_rewrites_one_line_on_a_terminal(monkeypatch):
    monkeypatch.setattr("remeshvec.cli.command.PATIENCE", 0)
    progress = ProgressLine(Terminal())
    progress(0, "split", 1234)
    progress(0, "collapse", 5)
    progress.clear()
    assert progress.stream.getvalue().split("\r\x1b[K") == [
        "",
        "sweep 1, 0 s, split 1,234",
        "sweep 1, 0 s, collapse 5",
        "",
    ]


def test_progress_has_a_line_a_sweep_in_a_log(monkeypatch):
    monkeypatch.setattr("remeshvec.cli.command.PATIENCE", 0)
    progress = ProgressLine(io.StringIO())
    for sweep in range(2):
        for phase in ("split", "collapse"):
            progress(sweep, phase, 7)
    progress.clear()
    assert progress.stream.getvalue() == "sweep 1, 0 s\nsweep 2, 0 s\n"


def test_short_work_shows_no_progress():
    progress = ProgressLine(Terminal())
    progress(0, "split", 7)
    progress.clear()
    assert progress.stream.getvalue() == ""


def test_progress_of_real_work(sheet, capsys, monkeypatch):
    monkeypatch.setattr("remeshvec.cli.command.PATIENCE", 0)
    assert main([sheet, "--iterations", "2", "--preset", "fast"]) == 0
    err = capsys.readouterr().err
    assert "sweep 1, 0 s\n" in err and "sweep 2, 0 s\n" in err


def command(*arguments):
    return [sys.executable, "-m", "remeshvec", *arguments]


def test_as_a_process_bad_input_gives_one_line_and_status_2(sheet):
    done = subprocess.run(
        command("missing.obj"), env=surroundings(), capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == "remeshvec: cannot read missing.obj: there is no such file\n"


def test_as_a_process_a_closed_pipe_gives_no_traceback(sheet):
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "wb") as stdout:
        done = subprocess.run(
            command(sheet, "-o", "out.obj"),
            env=surroundings(),
            stdout=stdout,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert "Traceback" not in done.stderr and "Broken pipe" not in done.stderr
    assert len(read_mesh("out.obj").F) > 0


@pytest.mark.parametrize(
    ("name", "dirt"),
    [("sample1.json", "unreferenced vertices: 4,875"), ("cow.obj", None), ("wolf_head.obj", None)],
)
def test_real_samples(name, dirt, tmp_path, capsys):
    assert main([str(zoo.sample_path(name)), "-o", str(tmp_path / "out.ply")]) == 0
    out = capsys.readouterr().out
    assert dirt is None or f"note: {dirt}" in out
    assert len(read_mesh(tmp_path / "out.ply").F) > 100
