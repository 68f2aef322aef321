"""Formats that other libraries read and write keep what they can hold; bad files end with our error."""

import os

import numpy as np
import pytest
from helpers.loaded_cube import (
    areas,
    assert_charts,
    assert_field,
    assert_groups,
    corner_uv,
    loaded_cube,
    obj_cube,
)

from data.shapes import textured
from remeshvec import MeshFormatError
from remeshvec.batch.one_file import remesh_file
from remeshvec.files import foreign
from remeshvec.files.data_files import read_data, write_data


def need_library(suffix):
    """Skip the test if the library that reads a format is absent; returns its name."""
    if suffix == ".xdmf":
        pytest.importorskip("h5py")
    library = {".vtp": "pyvista", ".glb": "trimesh"}.get(suffix, "meshio")
    pytest.importorskip(library)
    return library


@pytest.mark.parametrize("suffix", [".vtk", ".vtu", ".xdmf", ".msh", ".vtp"])
def test_formats_with_fields(tmp_path, suffix):
    need_library(suffix)
    source, target = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    data = loaded_cube()
    data.on_corners.clear()
    data.on_vertices.pop("color")
    assert write_data(source, data) == []
    result = remesh_file(source, target, 0.3, preserve=data.on_faces["group"])
    out, _ = read_data(target)
    assert np.allclose(out.V, result.V, atol=1e-6) and np.array_equal(out.F, result.F)
    assert_field(out)
    assert_groups(out)


@pytest.mark.parametrize("suffix", [".vtk", ".vtu", ".msh", ".xdmf", ".vtp", ".glb"])
def test_data_of_all_shapes_are_written_or_named(tmp_path, suffix):
    need_library(suffix)
    data = loaded_cube()
    n = len(data.V)
    data.on_vertices |= {"pair": data.V[:, :2].copy(), "tensor": np.ones((n, 3, 3))}
    data.on_vertices |= {"four": np.ones((n, 4), np.float32), "truth": data.V[:, 0] > 0}
    names = {*data.on_vertices, *data.on_faces, *data.on_corners}
    lost = set(write_data(tmp_path / f"a{suffix}", data))
    out, notices = read_data(tmp_path / f"a{suffix}")
    read = {name.lstrip("_") for name in (*out.on_vertices, *out.on_faces, "visual:colour")}
    found = {name for name in names - lost if name in read or name in ("uv", "color")}
    assert not notices and found == names - lost
    assert_field(out, "_height" if suffix == ".glb" else "height")


@pytest.mark.parametrize("suffix", [".vtk", ".vtu", ".vtp", ".glb"])
def test_texture_goes_from_obj_to_formats_that_hold_it_at_vertices(tmp_path, suffix):
    need_library(suffix)
    target = tmp_path / f"even{suffix}"
    result = remesh_file(obj_cube(tmp_path), target, 0.3)
    out, _ = read_data(target)
    assert len(out.F) == len(result.F) and len(out.V) > len(result.V)
    out.F = out.F.astype(np.int64)
    assert_charts(corner_uv(out))


def test_gltf_keeps_texture_and_image(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    Image = pytest.importorskip("PIL.Image")
    V, F, uv = textured.cylinder()
    A, B, t = textured.split_at_seams(V, F, uv)
    mesh = trimesh.Trimesh(A, B, process=False)
    image = Image.new("RGB", (4, 4), (10, 200, 30))
    mesh.visual = trimesh.visual.TextureVisuals(uv=t, image=image)
    mesh.export(tmp_path / "a.glb")
    result = remesh_file(tmp_path / "a.glb", tmp_path / "b.glb", 0.3)
    out = trimesh.load(tmp_path / "b.glb", force="mesh", process=False)
    assert out.visual.kind == "texture" and len(out.faces) == len(result.F)
    assert np.isclose(abs(areas(np.asarray(out.visual.uv)[out.faces])).sum(), 1.0, rtol=1e-5)
    colour = out.visual.material.to_color(out.visual.uv)
    assert (colour[:, :3] == (10, 200, 30)).all()


def test_scenes_of_several_meshes_stay_apart_and_in_place(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    red = trimesh.creation.box()
    red.visual.vertex_colors = [255, 0, 0, 255]
    blue = trimesh.creation.icosphere(subdivisions=2)
    blue.visual.face_colors = [0, 0, 255, 255]
    scene = trimesh.Scene()
    scene.add_geometry(red)
    scene.add_geometry(blue, transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    scene.export(tmp_path / "a.glb")
    remesh_file(tmp_path / "a.glb", tmp_path / "b.glb", 0.3)
    parts = trimesh.load(tmp_path / "b.glb", force="scene").dump(concatenate=False)
    assert len(parts) == 2
    box, ball = sorted(parts, key=lambda part: part.bounds[0, 0])
    assert np.allclose(box.bounds, [[-0.5] * 3, [0.5] * 3], atol=1e-6)
    assert np.allclose(ball.centroid, [5, 0, 0], atol=0.02)
    assert (box.visual.vertex_colors[:, :3] == (255, 0, 0)).all()


@pytest.mark.parametrize("suffix", [".vtk", ".vtu", ".glb", ".vtp", ".msh"])
def test_broken_files_end_with_our_exception(tmp_path, suffix):
    path = tmp_path / f"broken{suffix}"
    path.write_bytes(b"this is no mesh\n" * 3)
    with pytest.raises(MeshFormatError, match="broken"):
        read_data(path)
    with pytest.raises(MeshFormatError, match=r"no such file|not installed"):
        read_data(tmp_path / f"missing{suffix}")
    with pytest.raises(MeshFormatError, match="folder"):
        (tmp_path / f"d{suffix}").mkdir()
        read_data(tmp_path / f"d{suffix}")


def test_a_reader_that_never_ends_is_ended(tmp_path, monkeypatch):
    pytest.importorskip("meshio")
    path = tmp_path / "endless.bdf"
    path.write_text("SOL 101\nCEND\nBEGIN BULK\n")
    monkeypatch.setattr(foreign, "_SECONDS", 0.2)
    with pytest.raises(MeshFormatError, match=r"cannot read .*endless\.bdf: it took longer"):
        read_data(path)


@pytest.mark.parametrize("suffix", [".vtk", ".bdf", ".vtp", ".glb"])
def test_pipes_and_devices_are_refused(tmp_path, suffix):
    os.mkfifo(tmp_path / f"pipe{suffix}")
    (tmp_path / f"zero{suffix}").symlink_to("/dev/zero")
    for name in ("pipe", "zero"):
        with pytest.raises(MeshFormatError, match="regular file"):
            read_data(tmp_path / f"{name}{suffix}")


@pytest.mark.parametrize("suffix", [".vtk", ".vtp", ".glb"])
def test_nothing_is_lost_between_processes(tmp_path, suffix):
    library = need_library(suffix)
    path = tmp_path / f"a{suffix}"
    write_data(path, loaded_cube())
    here, notices = foreign._read_here((library, path, tmp_path), None)
    data, others = read_data(path)
    assert others == notices and data.feature_data == here.feature_data
    for name in ("on_vertices", "on_faces", "on_corners"):
        there, known = getattr(data, name), getattr(here, name)
        assert list(there) == list(known)
        for key, values in known.items():
            assert there[key].dtype == values.dtype and np.array_equal(there[key], values)
    assert data.V.dtype == here.V.dtype and np.array_equal(data.V, here.V)
    assert data.F.dtype == here.F.dtype and np.array_equal(data.F, here.F)
