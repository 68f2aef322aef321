"""Files that end with .gz are packed and unpacked, whatever their format."""

import gzip

import numpy as np
import pytest
from helpers.loaded_cube import loaded_cube

from remeshvec import MeshFormatError, read_mesh, remesh_file, write_mesh
from remeshvec.cli.command import main
from remeshvec.files import disk
from remeshvec.files.data_files import read_data, write_data
from remeshvec.files.mesh_files import SUFFIXES

LIBRARIES = {".vtp": "pyvista", ".vtu": "meshio", ".glb": "trimesh"}


@pytest.mark.parametrize("suffix", [*SUFFIXES, *LIBRARIES])
def test_packed_files_hold_the_same(suffix, tmp_path):
    if suffix in LIBRARIES:
        pytest.importorskip(LIBRARIES[suffix])
    packed, plain = tmp_path / f"a{suffix}.gz", tmp_path / f"a{suffix}"
    data = loaded_cube()
    assert write_data(packed, data) == write_data(plain, data)
    content = packed.read_bytes()
    assert content[:2] == b"\x1f\x8b"
    if suffix not in LIBRARIES:
        assert gzip.decompress(content) == plain.read_bytes()
        assert np.array_equal(read_mesh(packed).F, read_mesh(plain).F)
    (one, _), (two, _) = read_data(packed), read_data(plain)
    assert np.array_equal(one.V, two.V) and np.array_equal(one.F, two.F)
    assert list(one.on_corners) == list(two.on_corners)
    write_data(packed, data)
    assert packed.read_bytes() == content or suffix in LIBRARIES  # no time in it


def test_packed_files_through_everything(tmp_path, capsys):
    data = loaded_cube()
    write_mesh(tmp_path / "a.OBJ.gz", data.V, data.F)
    remesh_file(tmp_path / "a.OBJ.gz", tmp_path / "b.ply.gz", 0.4)
    assert main([str(tmp_path / "b.ply.gz"), "-o", str(tmp_path / "c.off.gz"), "--quiet"]) == 0
    assert len(read_mesh(tmp_path / "c.off.gz").F) > 100
    out = tmp_path / "out"
    words = [str(tmp_path / "*.gz"), "--out", str(out), "--format", "stl", "--workers", "1"]
    assert main(["batch", *words, "--quiet"]) == 0
    assert sorted(path.name for path in out.glob("*.stl")) == ["a.stl", "b.stl", "c.stl"]


def test_damaged_and_too_large_files_are_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.obj.gz"
    write_mesh(path, *read_data_arrays())
    whole = path.read_bytes()
    for content in (whole[:-9], whole[:40] + b"x" + whole[41:], b"v 0 0 0\n", whole[:5]):
        path.write_bytes(content)
        with pytest.raises(MeshFormatError, match="not a complete gzip file"):
            read_mesh(path)
    path.write_bytes(gzip.compress(bytes(9000)))
    monkeypatch.setattr(disk, "MAX_BYTES", 1000)
    with pytest.raises(MeshFormatError, match="unpacks to more than 1,000 bytes"):
        read_mesh(path)
    path.write_bytes(b"")
    with pytest.raises(MeshFormatError):
        read_mesh(path)


def read_data_arrays():
    data = loaded_cube()
    return data.V, data.F
