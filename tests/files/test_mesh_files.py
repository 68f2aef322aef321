"""Every format round trips, and no file, however hostile, gets through wrong."""

from __future__ import annotations

import os
import random
import stat
import struct

import numpy as np
import pytest
from helpers import zoo
from helpers.hostile_files import HOSTILE, LEGAL, OBJ, OFF, F, V, as_json, ply, stl

from remeshvec import read_mesh, write_mesh
from remeshvec.errors import MeshFormatError
from remeshvec.files.disk import check_writable, write_file
from remeshvec.files.mesh_files import SUFFIXES


@pytest.mark.parametrize("name", LEGAL)
def test_unusual_legal_files_are_read(name, tmp_path, capfd):
    (tmp_path / name).write_bytes(LEGAL[name])
    mesh = read_mesh(tmp_path / name)
    np.testing.assert_array_equal(mesh.V[mesh.F], V[F])
    assert mesh.V.shape == (4, 3) and mesh.V.dtype == np.float64
    assert mesh.F.shape == (4, 3) and mesh.F.dtype == np.int64
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused(name, tmp_path, capfd):
    content, reason = HOSTILE[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshFormatError) as caught:
        read_mesh(tmp_path / name)
    message = str(caught.value)
    assert name in message and reason in message
    assert "\n" not in message and len(message) < 300 + len(str(tmp_path))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["mixed.obj", "mixed.off", "mixed.ply", "mixed.json"])
def test_polygons_are_cut_with_a_notice(name, tmp_path):
    content = {
        "mixed.obj": OBJ + b"f 1 2 3 4\nf 1 2 3 4 1\n",
        "mixed.off": OFF.replace(b"4 4 6", b"4 6 6") + b"4 0 1 2 3\n5 0 1 2 3 0\n",
        "mixed.ply": ply(faces=[*F.tolist(), [0, 1, 2, 3], [0, 1, 2, 3, 0]]),
        "mixed.json": as_json(faces=[*F.tolist(), [0, 1, 2, 3], [0, 1, 2, 3, 0]]),
    }[name]
    (tmp_path / name).write_bytes(content)
    mesh = read_mesh(tmp_path / name)
    fans = [[0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 3], [0, 3, 0]]
    np.testing.assert_array_equal(mesh.F, [*F.tolist(), *fans])
    assert mesh.notices == ["polygons were cut: 6 faces became 9 triangles"]


@pytest.mark.parametrize("order", ["little", "big"])
def test_quads_of_binary_ply_are_cut(order, tmp_path):
    quads = [[0, 1, 2, 3], [3, 2, 1, 0]]
    (tmp_path / "quads.ply").write_bytes(ply(f"binary_{order}_endian", faces=quads))
    mesh = read_mesh(tmp_path / "quads.ply")
    np.testing.assert_array_equal(mesh.F, [[0, 1, 2], [0, 2, 3], [3, 2, 1], [3, 1, 0]])
    assert mesh.notices == ["polygons were cut: 2 faces became 4 triangles"]


@pytest.mark.parametrize("order", ["little", "big"])
def test_mixed_polygons_of_binary_ply_are_read(order, tmp_path):
    mixed = [[0, 1, 2], [0, 1, 2, 3], [3, 2, 1]]
    (tmp_path / "mixed.ply").write_bytes(ply(f"binary_{order}_endian", faces=mixed))
    mesh = read_mesh(tmp_path / "mixed.ply")
    np.testing.assert_array_equal(mesh.F, [[0, 1, 2], [0, 1, 2], [0, 2, 3], [3, 2, 1]])


def test_columns_of_ply_in_another_order_are_read(tmp_path):
    content = ply().replace(b"double x", b"double w").replace(b"double y", b"double x")
    (tmp_path / "a.ply").write_bytes(content.replace(b"double w", b"double y"))
    np.testing.assert_array_equal(read_mesh(tmp_path / "a.ply").V, V[:, [1, 0, 2]])


@pytest.mark.parametrize("suffix", [".obj", ".off", ".ply"])
def test_polygons_of_many_corners_are_read(suffix, tmp_path):
    polygon = [0, 1, 2] * 2000
    content = {
        ".obj": OBJ + b"f" + b"".join(b" %d/1/1" % (i + 1) for i in polygon),
        ".off": OFF.replace(b"4 4 6", b"4 5 6") + b"6000 " + b" ".join(b"%d" % i for i in polygon),
        ".ply": ply(faces=[*F.tolist(), polygon]),
    }[suffix]
    (tmp_path / f"a{suffix}").write_bytes(content)
    assert len(read_mesh(tmp_path / f"a{suffix}").F) == 4 + 5998


def test_random_damage_never_gets_through_wrong(tmp_path, capfd):
    rng = random.Random(0)
    seeds = list(LEGAL.items())
    for _ in range(600):
        name, content = rng.choice(seeds)
        (tmp_path / name).write_bytes(_damaged(content, rng))
        try:
            mesh = read_mesh(tmp_path / name)
        except MeshFormatError:
            continue
        assert np.isfinite(mesh.V).all()
        assert mesh.F.min() >= 0 and mesh.F.max() < len(mesh.V)
    assert capfd.readouterr() == ("", "")


def _damaged(content, rng):
    data = bytearray(content)
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(max(len(data), 1))
        match rng.randrange(4):
            case 0:
                data[at : at + 1] = [rng.randrange(256)]
            case 1:
                del data[at : at + rng.randint(1, 10)]
            case 2:
                data[at:at] = rng.choice([b"99999999999", b"nan", b"-1", b" ", b"\n", b"3 0 1 2\n"])
            case 3:
                del data[max(at, 1) :]
    return bytes(data or b" ")


def test_missing_file_folder_and_device(tmp_path):
    (tmp_path / "folder.obj").mkdir()
    os.mkfifo(tmp_path / "pipe.obj")
    for name, reason in [("none", "no such file"), ("folder", "folder"), ("pipe", "regular file")]:
        with pytest.raises(MeshFormatError, match=reason):
            read_mesh(tmp_path / f"{name}.obj")


def test_file_beyond_the_size_limit(tmp_path, monkeypatch):
    monkeypatch.setattr("remeshvec.files.disk.MAX_BYTES", 10)
    (tmp_path / "a.obj").write_bytes(OBJ)
    with pytest.raises(MeshFormatError, match="the limit is 10"):
        read_mesh(tmp_path / "a.obj")


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("scale", [1.0, 1e-300, 1e300])
def test_round_trip(suffix, scale, tmp_path):
    rng = np.random.default_rng(0)
    points = rng.normal(size=(500, 3)) * (scale if suffix != ".stl" else 1.0)
    faces = rng.permutation(np.arange(900) % 500).reshape(-1, 3)
    write_mesh(tmp_path / f"a{suffix}", points, faces)
    mesh = read_mesh(tmp_path / f"a{suffix}")
    if suffix == ".stl":
        np.testing.assert_array_equal(mesh.V[mesh.F], points.astype(np.float32)[faces])
        assert len(mesh.V) == 500
        assert mesh.notices == ["900 corners of triangles were welded to 500 vertices"]
    else:
        np.testing.assert_array_equal(mesh.V, points)
        np.testing.assert_array_equal(mesh.F, faces)
        assert mesh.notices == []


def test_stl_is_welded_in_the_order_of_first_appearance(tmp_path):
    (tmp_path / "a.stl").write_bytes(stl())
    mesh = read_mesh(tmp_path / "a.stl")
    np.testing.assert_array_equal(mesh.F[0], [0, 1, 2])
    np.testing.assert_array_equal(mesh.V, V[[0, 2, 1, 3]])


def test_written_stl_has_unit_normals_and_none_where_there_is_no_area(tmp_path):
    write_mesh(tmp_path / "a.stl", V, [[0, 1, 2], [0, 1, 1]])
    content = (tmp_path / "a.stl").read_bytes()
    assert len(content) == 84 + 2 * 50
    assert struct.unpack_from("<3f", content, 84) == (0, 0, 1)
    assert struct.unpack_from("<3f", content, 134) == (0, 0, 0)


@pytest.mark.parametrize(
    ("points", "faces", "reason"),
    [
        (V, [[0, 1, 4]], "outside"),
        (V, [[0, 1, -1]], "outside"),
        (V, [[0.0, 1.0, 2.0]], "integers"),
        (V, np.zeros((0, 3), int), "shape"),
        (V[:, :2], F, "shape"),
        (V * np.nan, F, "not finite"),
    ],
)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_invalid_mesh_is_not_written(suffix, points, faces, reason, tmp_path):
    with pytest.raises(MeshFormatError, match=reason):
        write_mesh(tmp_path / f"a{suffix}", points, faces)
    assert os.listdir(tmp_path) == []


def test_coordinates_beyond_single_precision_are_not_written_to_stl(tmp_path):
    with pytest.raises(MeshFormatError, match="too large for STL"):
        write_mesh(tmp_path / "a.stl", V * 1e39, F)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("failing", ["os.replace", "shutil.copymode"])
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_leaves_the_old_file_and_nothing_else(failing, error, tmp_path, monkeypatch):
    write_file(tmp_path / "a.obj", b"old")

    def fail(*_):
        raise error

    monkeypatch.setattr(failing, fail)
    with pytest.raises((MeshFormatError, KeyboardInterrupt)) as caught:
        write_mesh(tmp_path / "a.obj", V, F)
    assert isinstance(caught.value, KeyboardInterrupt) or "No space left" in str(caught.value)
    assert os.listdir(tmp_path) == ["a.obj"]
    assert (tmp_path / "a.obj").read_bytes() == b"old"


def test_the_content_is_on_the_disk_before_the_name(tmp_path, monkeypatch):
    done = []
    monkeypatch.setattr("os.fsync", lambda descriptor: done.append(os.fstat(descriptor).st_mode))
    replace = os.replace
    monkeypatch.setattr("os.replace", lambda *names: (done.append("rename"), replace(*names)))
    write_file(tmp_path / "a.obj", b"new")
    assert stat.S_ISREG(done[0]) and done[1] == "rename" and stat.S_ISDIR(done[2])
    monkeypatch.setattr("os.open", lambda *_: (_ for _ in ()).throw(PermissionError()))
    write_file(tmp_path / "a.obj", b"newer")  # where folders cannot be opened
    assert (tmp_path / "a.obj").read_bytes() == b"newer"


def test_permissions_and_links_are_kept(tmp_path):
    write_file(tmp_path / "a.obj", b"old")
    assert (tmp_path / "a.obj").stat().st_mode & 0o600 == 0o600
    (tmp_path / "a.obj").chmod(0o640)
    (tmp_path / "link.obj").symlink_to("a.obj")
    write_mesh(tmp_path / "link.obj", V, F)
    assert (tmp_path / "link.obj").is_symlink()
    assert (tmp_path / "a.obj").stat().st_mode & 0o777 == 0o640
    assert len(read_mesh(tmp_path / "a.obj").F) == 4


def test_check_writable(tmp_path):
    check_writable(tmp_path / "a.obj", SUFFIXES)
    check_writable(tmp_path / "A.OBJ", SUFFIXES)
    check_writable(tmp_path / "stats.txt")
    (tmp_path / "folder.obj").mkdir()
    for name, reason in [
        ("a.mesh", "not one of .obj"),
        ("missing/a.obj", "no folder"),
        ("folder.obj", "it is a folder"),
        ("a" * 300 + ".obj", "name too long"),
    ]:
        with pytest.raises(MeshFormatError, match=reason):
            check_writable(tmp_path / name, SUFFIXES)
    with pytest.raises(MeshFormatError, match="regular file"):
        check_writable("/dev/null")


def test_check_writable_in_a_folder_without_permission(tmp_path, monkeypatch):
    monkeypatch.setattr("os.access", lambda *_: False)  # root may write everywhere
    with pytest.raises(MeshFormatError, match="is not writable"):
        check_writable(tmp_path / "a.obj")


@pytest.mark.parametrize(
    ("name", "n", "m"),
    [
        ("cow.obj", 2903, 5804),
        ("iphi_bad10k.off", 5002, 10000),
        ("sample1.json", 9753, 8366),
        ("wolf_head.obj", None, None),
        ("phands.obj", None, None),
    ],
)
def test_real_samples_survive_all_formats(name, n, m, tmp_path):
    mesh = read_mesh(zoo.sample_path(name))
    if n is not None:
        assert (len(mesh.V), len(mesh.F)) == (n, m)
    for suffix in (".obj", ".off", ".ply", ".json"):
        write_mesh(tmp_path / f"a{suffix}", mesh.V, mesh.F)
        again = read_mesh(tmp_path / f"a{suffix}")
        np.testing.assert_array_equal(again.V, mesh.V)
        np.testing.assert_array_equal(again.F, mesh.F)
