"""Meshes from standard input and to standard output."""

import io
import re
import sys

import numpy as np
import pytest
from helpers.loaded_cube import corner_uv, loaded_cube

from remeshvec import read_mesh, remesh
from remeshvec.cli.command import main
from remeshvec.files.data_files import read_data, write_data


class Stream:
    """Stands for standard input or output, with its bytes."""

    def __init__(self, content=b""):
        self.buffer = io.BytesIO(content)
        self.text = ""

    def write(self, text):
        self.text += text

    def flush(self):
        pass


def through(words, content, monkeypatch):
    """Run the command; returns its status and what it wrote to standard output."""
    out = Stream()
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdin", Stream(content))
        patch.setattr(sys, "stdout", out)
        status = main(words)
    assert out.text == ""
    return status, out.buffer.getvalue()


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "vtp", "glb"])
def test_from_standard_input_to_standard_output(kind, tmp_path, monkeypatch, capsys):
    pytest.importorskip({"vtp": "pyvista", "glb": "trimesh"}.get(kind, "numpy"))
    monkeypatch.chdir(tmp_path)
    data = loaded_cube()
    write_data(f"a.{kind}", data)
    content = (tmp_path / f"a.{kind}").read_bytes()
    words = ["-", "-o", "-", "--format", kind, "--length", "0.4"]
    status, written = through(words, content, monkeypatch)
    assert status == 0 and len(list(tmp_path.iterdir())) == 1
    (tmp_path / f"b.{kind}").write_bytes(written)
    given, _ = read_data(f"a.{kind}")
    out, _ = read_data(f"b.{kind}")
    kept = {} if kind == "stl" else {"preserve": [given.find(name) for name in given.feature_data]}
    assert len(out.F) == len(remesh(given.V, given.F, 0.4, **kept).F)
    assert kind == "stl" or np.ptp(corner_uv(out), axis=1).max() < 0.2
    err = capsys.readouterr().err
    assert "target length 0.4" in err and "smallest angle" in err
    assert through([*words, "--quiet"], content, monkeypatch) == (0, written)
    assert capsys.readouterr().err == ""


def test_libraries_are_seen_from_the_current_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = loaded_cube()
    data.on_faces = {"material": np.zeros(len(data.F), int)}
    data.extra |= {"material": ["a"], "mtllib": [str(tmp_path / "looks" / "cube.mtl")]}
    write_data("a.obj", data)
    content = (tmp_path / "a.obj").read_bytes()
    _, written = through(["-", "-o", "-", "--format", "obj", "--quiet"], content, monkeypatch)
    assert written.startswith(b"mtllib looks/cube.mtl\n")


def test_one_end_may_be_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_data("a.ply", loaded_cube())
    status, written = through(["a.ply", "-o", "-", "--format", "off"], b"", monkeypatch)
    assert status == 0 and written.startswith(b"OFF")
    assert through(["-", "-o", "b.ply", "--format", "off", "--quiet"], written, monkeypatch)[0] == 0
    assert len(read_mesh("b.ply").F) > 10


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["-"], "- needs --format"),
        (["a.ply", "-o", "-"], "- needs --format"),
        (["a.ply", "--format", "obj"], "--format is that of -"),
        (["-", "--format", "obj"], "cannot read .*standard input.obj: it is empty"),
    ],
)
def test_wrong_calls_are_named(words, reason, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_data("a.ply", loaded_cube())
    status, written = through(words, b"", monkeypatch)
    err = capsys.readouterr().err
    assert status == 2 and written == b"" and err.count("\n") == 1
    assert re.search(reason, err)
