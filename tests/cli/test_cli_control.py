"""Control from the shell: every flag reaches the library, files of numbers are read, results saved."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import zoo

from remeshvec import Adaptive, read_mesh, write_mesh
from remeshvec.cli.command import main


@pytest.fixture(autouse=True)
def sheet(tmp_path, monkeypatch):
    """A sheet in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    V, F = zoo.grid(9, 9)
    write_mesh("in.obj", V / 8, F)


def save(name, values):
    np.savetxt(name, values, fmt="%g", header="numbers")
    return name


def test_sizes(asked):
    assert main(["in.obj", "--adaptive", "0.01", "--max-length", "0.2", "--gradation", "1.3"]) == 0
    assert asked[-1]["L"] == Adaptive(0.01, None, 0.2) and asked[-1]["gradation"] == 1.3
    assert main(["in.obj", "--n-faces", "300", "--quiet"]) == 0
    assert asked[-1]["n_faces"] == 300 and asked[-1]["L"] is None
    assert main(["in.obj", "--n-vertices", "100", "--quiet"]) == 0
    assert asked[-1]["n_vertices"] == 100
    lengths = np.linspace(0.1, 0.2, 81)
    np.save("lengths.npy", lengths)
    assert main(["in.obj", "--lengths", "lengths.npy", "--quiet"]) == 0
    assert np.array_equal(asked[-1]["L"], lengths)


def test_constraints(asked):
    files = {
        "feature-edges": save("edges.txt", [[0, 1], [1, 2]]),
        "fixed-vertices": save("vertices.txt", [3, 40]),
        "fixed-faces": save("faces.txt", [5]),
        "face-labels": save("labels.txt", np.arange(128) % 2),
    }
    flags = [word for name, path in files.items() for word in (f"--{name}", path)]
    flags += ["--feature-angle", "35", "--corner-angle", "70"]
    flags += ["--boundary", "split", "--tol", "0.1"]
    assert main(["in.obj", *flags, "--length", "0.1"]) == 0
    call = asked[-1]
    assert call["feature_edges"].tolist() == [[0, 1], [1, 2]]
    assert call["fixed_vertices"].tolist() == [3, 40] and call["fixed_faces"].tolist() == [5]
    assert call["face_labels"].shape == (128,)
    assert (call["feature_angle"], call["boundary"], call["tol"]) == (35.0, "split", 0.1)
    assert call["corner_angle"] == 70.0
    assert main(["in.obj", "--feature-angle", "none", "--quiet"]) == 0
    assert asked[-1]["feature_angle"] is None
    assert main(["in.obj", "--clearance", "none", "--quiet"]) == 0
    assert asked[-1]["clearance"] is None


def test_everything_is_saved(asked, capsys):
    selection = save("selection.txt", np.arange(40))
    labels = save("labels.txt", np.arange(128) // 64)
    flags = ["--selection", selection, "--face-labels", labels, "--max-deviation", "0.01"]
    assert main(["in.obj", "-o", "out.obj", "--save-arrays", "out.npz", *flags]) == 0
    assert "deviation to input" in capsys.readouterr().out
    V, F, _ = read_mesh("in.obj")
    V2, F2, _ = read_mesh("out.obj")
    with np.load("out.npz") as saved:
        assert saved["face_labels"].shape == (len(F2),) and saved["lengths"].shape == (len(V2),)
        assert np.array_equal(saved["face_map"][40:], np.arange(88))
        assert np.array_equal(saved["face_birth"][:88], np.arange(40, 128))
        assert saved["corner_birth_barycentric"].shape == (len(F2), 3, 3)
        assert saved["image_face"].shape == (len(V),)
    assert np.array_equal(V2[F2[:88]], V[F[40:]])


@pytest.mark.parametrize(
    ("flags", "word"),
    [
        (["--selection", "absent.txt"], "absent.txt"),
        (["--fixed-vertices", "half.txt"], "whole"),
        (["--feature-edges", "odd.txt"], "2 numbers per row"),
        (["--fixed-faces", "words.txt"], "words.txt"),
        (["--fixed-vertices", "big.txt"], "fixed_vertices"),
        (["--min-length", "0.1"], "--adaptive"),
        (["--gradation", "0.5"], "gradation"),
        (["--save-arrays", "in.obj"], "in.obj"),
        (["--save-arrays", "nowhere/out.npz"], "nowhere"),
    ],
)
def test_what_cannot_work_ends_in_one_line(asked, capsys, flags, word):
    save("half.txt", [0.5])
    save("odd.txt", [1, 2, 3])
    save("big.txt", [81])
    with open("words.txt", "w") as file:
        file.write("one two")
    assert main(["in.obj", *flags]) == 2
    error = capsys.readouterr().err
    assert word in error and len(error.splitlines()) == 1
    assert read_mesh("in.obj").F.shape == (128, 3)


def test_numbers_are_read_as_people_write_them(tmp_path):
    from remeshvec.cli.array_files import read_array

    path = tmp_path / "numbers.txt"
    path.write_text("# what\n1, 2\n3 4 # and why\n\n")
    assert read_array(str(path), 2).tolist() == [[1, 2], [3, 4]]
    (tmp_path / "separated.txt").write_text("# a\u2028 9\x0c 9\n1\n", encoding="utf-8")
    assert read_array(str(tmp_path / "separated.txt")).tolist() == [1]
    assert read_array(str(path)).dtype == np.int64
    np.save(tmp_path / "mask.npy", np.array([True, False]))
    assert read_array(str(tmp_path / "mask.npy")).dtype == np.bool_
