"""Every function takes a mesh as `remesh` does: arrays, a pair, an object, a result."""

import inspect

import numpy as np
import pytest

from data.shapes import textured
from remeshvec import (
    MeshInputError,
    OptionError,
    RemeshResult,
    cotangent_matrix,
    find_creases,
    laplacian,
    quality,
    read_mesh,
    remesh,
    smooth,
    surface_distance,
    vertex_areas,
    write_mesh,
)
from remeshvec.files.data_files import read_data

V, F, UV = textured.cube(3)
L = 0.5


def result():
    one = remesh(V, F, L)
    one.V, one.F = V.copy(), F.copy()  # so that all kinds hold the same mesh
    return one


def trimesh_object():
    return pytest.importorskip("trimesh").Trimesh(V, F, process=False)


def polydata():
    return pytest.importorskip("pyvista").PolyData.from_regular_faces(V, F)


def meshio_object():
    return pytest.importorskip("meshio").Mesh(V, [("triangle", F)])


def open3d_object():
    o3d = pytest.importorskip("open3d", exc_type=ImportError)
    return o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(V), o3d.utility.Vector3iVector(F.astype(np.int32))
    )


def tensors():
    torch = pytest.importorskip("torch")
    return torch.tensor(V, requires_grad=True), torch.tensor(F)


KINDS = {
    "pair": lambda: (V, F), "lists": lambda: [V.tolist(), F.tolist()], "tensors": tensors,
    "result": result, "trimesh": trimesh_object, "pyvista": polydata, "meshio": meshio_object,
    "open3d": open3d_object,
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_every_function_takes_every_mesh(kind, tmp_path):
    mesh = KINDS[kind]()
    assert quality(mesh).to_dict() == quality(V, F).to_dict()
    assert quality(mesh, L).target_length == quality(mesh, L=L).target_length == L
    assert np.array_equal(smooth(mesh, 0.01), smooth(V, F, 0.01))
    assert np.array_equal(smooth(mesh, iterations=2), smooth(V, F, iterations=2))
    for function in (laplacian, cotangent_matrix):
        assert (function(mesh) != function(V, F)).nnz == 0
    assert (laplacian(mesh, area="uniform") != laplacian(V, F, area="uniform")).nnz == 0
    assert np.array_equal(vertex_areas(mesh), vertex_areas(V, F))
    assert np.array_equal(find_creases(mesh, L), find_creases(V, F, L))
    assert np.array_equal(find_creases(mesh, L=L), find_creases(V, F, L))
    shifted = V + np.array([0.0, 0.0, 0.5])
    expected = surface_distance(V, F, shifted, F, samples=100)
    assert surface_distance(mesh, shifted, F, samples=100) == expected
    assert surface_distance(mesh, (shifted, F), samples=100) == expected
    back = surface_distance(shifted, F, mesh, samples=100)
    assert back.max_2_to_1 == expected.max_1_to_2
    write_mesh(tmp_path / "a.ply", mesh)
    written = read_mesh(tmp_path / "a.ply")
    assert np.array_equal(written.V, V) and np.array_equal(written.F, F)
    assert remesh(mesh, L) is not None


def test_what_a_file_holds_is_a_mesh_too(tmp_path):
    write_mesh(tmp_path / "a.obj", V, F)
    mesh = read_mesh(tmp_path / "a.obj")
    assert quality(mesh) == quality(V, F)
    assert np.array_equal(remesh(mesh, L).V, remesh(V, F, L).V)


def test_results_go_in_again():
    one = remesh(V, F, L)
    two = remesh(one, L)
    assert isinstance(two, RemeshResult) and np.array_equal(two.V, remesh(*one, L).V)


def test_objects_are_written_with_what_they_carry(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    pv = pytest.importorskip("pyvista")
    Image = pytest.importorskip("PIL.Image")
    A, B, uv = textured.split_at_seams(V, F, UV)
    look = trimesh.visual.TextureVisuals(uv=uv, image=Image.new("RGB", (4, 4), "red"))
    write_mesh(tmp_path / "a.obj", trimesh.Trimesh(A, B, process=False, visual=look))
    assert (tmp_path / "a.mtl").exists() and (tmp_path / "a.png").exists()
    assert np.allclose(read_data(tmp_path / "a.obj")[0].on_corners["uv"], UV)
    mesh = pv.PolyData.from_regular_faces(A, B)
    mesh.point_data["height"] = A[:, 2]
    mesh.active_texture_coordinates = uv
    write_mesh(tmp_path / "a.vtu", mesh)
    data, _ = read_data(tmp_path / "a.vtu")
    assert np.allclose(data.on_corners["uv"], UV)
    assert np.allclose(data.on_vertices["height"], data.V[:, 2])


def test_creases_by_names_of_data():
    mesh = trimesh_object()
    mesh.face_attributes["part"] = (V[F].mean(axis=1)[:, 0] > 0).astype(int)
    mesh.vertex_attributes["size"] = np.full(len(V), L)
    named = find_creases(mesh, "size", face_labels="part")
    assert len(named) > len(find_creases(mesh, L))


def test_the_accessor_has_all_functions():
    mesh = polydata()
    assert repr(mesh.remeshvec) == f"<remeshvec of a PolyData with {len(F)} cells>"
    assert mesh.remeshvec.quality(L) == quality(V, F, L)
    assert np.array_equal(mesh.remeshvec.find_creases(L), find_creases(V, F, L))
    assert mesh.remeshvec.surface_distance(mesh, samples=9).hausdorff < 1e-12
    smoothed = mesh.remeshvec.smooth(iterations=2)
    assert np.allclose(smoothed.points, smooth(V, F, iterations=2))
    assert np.array_equal(mesh.points, V)
    assert (mesh.remeshvec.laplacian(area="uniform") != laplacian(V, F, area="uniform")).nnz == 0


@pytest.mark.parametrize("function", [quality, smooth, laplacian, find_creases, remesh])
def test_what_is_no_mesh_is_named(function):
    with pytest.raises(MeshInputError, match="object is not a mesh of a known type"):
        function(object())
    with pytest.raises(MeshInputError, match="F"):
        function(V)
    assert list(inspect.signature(function).parameters)[:2] == ["V", "F"]


def test_too_much_is_refused(tmp_path):
    with pytest.raises(OptionError, match="takes two meshes"):
        surface_distance((V, F), (V, F), V)
    with pytest.raises(MeshInputError, match="is a path: remesh_file"):
        write_mesh(tmp_path / "a.ply", "in.obj")
