"""What `remesh_large` reads, and what it refuses in words."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import zoo
from large.conftest import MESHES, PART

from remeshvec import (
    Adaptive,
    MeshFormatError,
    MeshInputError,
    OptionError,
    read_mesh,
    remesh_large,
    write_mesh,
)
from remeshvec.cli import main
from remeshvec.large.source import read_source

V, F = zoo.icosphere(2)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"n_faces": 100}, "does not take n_faces"),
        ({"n_vertices": 100}, "does not take n_vertices"),
        ({"max_deviation": 0.1}, "does not take max_deviation"),
        ({"tol": 0.1}, "does not take tol"),
        ({"callback": print}, "does not take callback"),
        ({"selection": [1]}, "does not take selection"),
        ({"avoid_intersections": True}, "avoid_intersections"),
        ({"project": False}, "keeps all vertices on the input"),
        ({"fit": True}, "keeps all vertices on the input"),
        ({"preset": "fine"}, "keeps all vertices on the input"),
        ({"L": Adaptive(0.1)}, "does not take Adaptive"),
        ({"L": -1.0}, "L must be"),
        ({"workers": 0}, "workers"),
        ({"client": 3}, "client must have a method submit"),
        ({"client": "tcp://host:1"}, "client must have a method submit"),
        ({"part_faces": 100}, "part_faces must be a whole number, at least 10000"),
        ({"resume": 1}, "resume must be True or False"),
        ({"progress": "yes"}, "progress must be True or False"),
        ({"scratch": 3}, "scratch must be the path"),
        ({"out": 3}, "out must be the path"),
        ({"out": "mesh.obj"}, "out must be a file with the suffix"),
    ],
)
def test_what_has_no_meaning_in_parts_is_refused(tmp_path, options, reason):
    call = {"L": 0.1, "out": tmp_path / "out"} | options
    with pytest.raises(OptionError, match=reason):
        remesh_large((V, F), call.pop("L"), **call)
    assert not list(tmp_path.iterdir())


def test_client_and_workers_exclude_each_other(tmp_path):
    class Client:
        def submit(self, function, *args):
            raise AssertionError

    with pytest.raises(OptionError, match="exclude each other"):
        remesh_large((V, F), 0.1, out=tmp_path / "out", client=Client(), workers=2)


def test_unknown_keywords_are_named(tmp_path):
    with pytest.raises(TypeError, match=r"remesh_large\(\) got .*'presets'; did you mean 'preset'"):
        remesh_large((V, F), 0.1, out=tmp_path / "out", presets="even")


@pytest.mark.parametrize("source", [None, 3, (V,), (V, F, V)])
def test_sources_that_are_none(tmp_path, source):
    with pytest.raises(MeshInputError, match="source must be a path or a pair"):
        remesh_large(source, 0.1, out=tmp_path / "out")


def test_missing_and_foreign_files(tmp_path):
    with pytest.raises(MeshFormatError, match="no such file"):
        remesh_large(tmp_path / "a.ply", 0.1, out=tmp_path / "out")
    with pytest.raises(MeshFormatError, match="no such file"):
        remesh_large(tmp_path, 0.1, out=tmp_path / "out")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("mine")
    with pytest.raises(OptionError, match="not the result of an earlier call"):
        remesh_large((V, F), 0.1, out=tmp_path / "out")
    assert (tmp_path / "out" / "thesis.txt").read_text() == "mine"


def test_non_manifold_surfaces_need_one_part(tmp_path):
    V, F = MESHES["box"]()
    a, b = F[0, :2]
    V, F = np.vstack([V, V[a] + [0.1, 0.2, 0.3]]), np.vstack([F, [a, b, len(V)]])
    with pytest.raises(OptionError, match="edges with three faces"):
        remesh_large((V, F), out=tmp_path / "out", part_faces=PART)
    result = remesh_large((V, F), out=tmp_path / "out", part_faces=10 * PART)
    assert len(result.F) > 10_000


def test_a_full_disk_is_told_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.disk_usage", lambda path: type("Usage", (), {"free": 10**6}))
    with pytest.raises(OptionError, match=r"needs about .* GB on the disk"):
        remesh_large(MESHES["ball"](), out=tmp_path / "out", part_faces=PART)


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])
def test_files_are_read_as_ever(tmp_path, suffix):
    """Mapped or read whole, a file holds the same mesh."""
    write_mesh(tmp_path / f"mesh{suffix}", V, F)
    known = read_mesh(tmp_path / f"mesh{suffix}")
    found = read_source(tmp_path / f"mesh{suffix}")
    assert np.array_equal(found.V, known.V) and np.array_equal(found.F, known.F)


@pytest.mark.parametrize("kind", ["quads", "text", "colours", "big_endian"])
def test_ply_files_of_all_kinds(tmp_path, kind):
    path = tmp_path / "mesh.ply"
    head = "element vertex 4\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], "f4")
    if kind == "text":
        rows = "\n".join(" ".join(map(str, p)) for p in points) + "\n3 0 1 2\n3 0 2 3\n"
        head += "element face 2\nproperty list uchar int vertex_index\n"
        path.write_text(f"ply\nformat ascii 1.0\n{head}end_header\n{rows}")
    elif kind == "quads":
        head += "element face 1\nproperty list uchar int vertex_indices\n"
        body = points.tobytes() + bytes([4]) + np.arange(4, dtype="<i4").tobytes()
        path.write_bytes(
            f"ply\nformat binary_little_endian 1.0\n{head}end_header\n".encode() + body
        )
    else:
        order, form = (">", "big") if kind == "big_endian" else ("<", "little")
        head += "property uchar red\nelement face 2\nproperty list uchar int vertex_indices\n"
        vertices = np.zeros(4, [("p", f"{order}f4", 3), ("red", "u1")])
        vertices["p"] = points
        faces = np.zeros(2, [("n", "u1"), ("f", f"{order}i4", 3)])
        faces["n"], faces["f"] = 3, [[0, 1, 2], [0, 2, 3]]
        text = f"ply\nformat binary_{form}_endian 1.0\n{head}end_header\n"
        path.write_bytes(text.encode() + vertices.tobytes() + faces.tobytes())
    found = read_source(path)
    assert np.array_equal(found.V, points.astype(float))
    assert np.array_equal(found.F, [[0, 1, 2], [0, 2, 3]])


def test_a_ply_file_cut_short_is_refused(tmp_path):
    write_mesh(tmp_path / "mesh.ply", V, F)
    whole = (tmp_path / "mesh.ply").read_bytes()
    (tmp_path / "mesh.ply").write_bytes(whole[:-20])
    with pytest.raises(MeshFormatError, match=r"mesh\.ply: the header promises"):
        remesh_large(tmp_path / "mesh.ply", 0.1, out=tmp_path / "out")


@pytest.mark.parametrize("suffix", [".ply", ".stl"])
def test_a_mesh_file_is_written(tmp_path, suffix):
    """With its arrays beside it, which are a source themselves; a second call replaces both."""
    np.save(tmp_path / "V.npy", V.astype(np.float32))
    np.save(tmp_path / "F.npy", F.astype(np.int32))
    out = tmp_path / f"out{suffix}"
    for _ in range(2):
        result = remesh_large(tmp_path, 0.2, out=out)
    assert result.V.dtype == np.float32 and result.F.dtype == np.int32
    written = read_mesh(out)
    assert np.array_equal(written.V[written.F].astype("f4"), result.V[result.F])
    assert np.array_equal(read_source(result.folder).V, result.V)


def test_the_command(tmp_path, capsys):
    write_mesh(tmp_path / "mesh.ply", V, F)
    words = ["large", str(tmp_path / "mesh.ply"), "-l", "0.2", "-o", str(tmp_path / "out.ply")]
    assert main([*words, "--workers", "1"]) == 0
    assert "target length 0.2" in capsys.readouterr().out
    assert len(read_mesh(tmp_path / "out.ply").F) > 100
    assert main([*words, "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    assert main([*words, "--tol", "0.1"]) == 2
    assert "does not take tol" in capsys.readouterr().err
    assert main([*words, "--lengths", "x.txt"]) == 2
    assert main([*words, "--scheduler", "tcp://127.0.0.1:1"]) == 2
