"""Mesh objects of other libraries go in and come out as what they are, with what they carry."""

import warnings

import numpy as np
import pytest
from helpers import zoo
from helpers.loaded_cube import areas, assert_charts
from helpers.processes import run_python

from data.shapes import textured
from remeshvec import MeshInputError, OptionError, RemeshResult, remesh, remesh_many
from remeshvec.interop.mesh_data import split_vertices

V, F, UV = textured.cube(4)
L = 0.3


# --- trimesh ---------------------------------------------------------------------------------


def test_trimesh_with_texture_and_attributes():
    trimesh = pytest.importorskip("trimesh")
    Image = pytest.importorskip("PIL.Image")
    A, B, uv = textured.split_at_seams(V, F, UV)
    image = Image.new("RGB", (8, 8), "red")
    mesh = trimesh.Trimesh(
        A, B, process=False, metadata={"name": "crate"}, vertex_attributes={"x": A[:, 0].copy()},
        face_attributes={"side": np.abs(A[B].mean(axis=1)).argmax(axis=1)},
        visual=trimesh.visual.TextureVisuals(uv=uv, image=image),
    )  # fmt: skip
    before = mesh.vertices.copy()
    out = remesh(mesh, L)
    assert type(out) is trimesh.Trimesh and out.metadata["name"] == "crate"
    assert out.visual.kind == "texture" and out.visual.material is mesh.visual.material
    assert_charts(np.asarray(out.visual.uv)[out.faces])
    assert np.allclose(out.vertex_attributes["x"], out.vertices[:, 0], atol=1e-12)
    side = np.abs(out.triangles_center).argmax(axis=1)
    assert np.array_equal(out.face_attributes["side"], side)
    assert np.array_equal(mesh.vertices, before)
    merged = out.copy()
    merged.merge_vertices(merge_tex=True)
    assert merged.is_watertight and np.isclose(merged.volume, 8)


def test_trimesh_with_a_seam_that_is_no_crease():
    trimesh = pytest.importorskip("trimesh")
    A, B, uv = textured.split_at_seams(*textured.cylinder())
    visual = trimesh.visual.TextureVisuals(uv=uv)
    out = remesh(trimesh.Trimesh(A, B, process=False, visual=visual), 0.25)
    found = np.asarray(out.visual.uv)[out.faces]
    assert np.isclose(areas(found).sum(), 1.0) and (areas(found) > 0).all()


@pytest.mark.parametrize("kind", ["vertex", "face"])
def test_trimesh_with_colours(kind):
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(V, F, process=False)
    if kind == "vertex":
        shade = np.rint(255 * (V[:, :1] + 1) / 2).astype(np.uint8)
        mesh.visual.vertex_colors = np.column_stack([np.repeat(shade, 3, 1), np.full(len(V), 255)])
    else:
        red = V[F].mean(axis=1)[:, 2] > 0
        mesh.visual.face_colors = np.where(red[:, None], [255, 0, 0, 255], [0, 0, 255, 255])
    out = remesh(mesh, L=L)
    assert out.visual.kind == kind
    if kind == "vertex":
        assert abs(out.visual.vertex_colors[:, 0] - 255 * (out.vertices[:, 0] + 1) / 2).max() <= 1
    else:
        is_red = out.visual.face_colors[:, 0] == 255
        assert (is_red | (out.visual.face_colors[:, 2] == 255)).all()
        away = abs(out.triangles_center[:, 2]) > L
        assert np.array_equal(is_red[away], out.triangles_center[away, 2] > 0)


def test_subclasses_come_back_as_such():
    trimesh = pytest.importorskip("trimesh")

    class Part(trimesh.Trimesh):
        pass

    assert type(remesh(Part(V, F, process=False), L)) is Part


# --- pyvista ---------------------------------------------------------------------------------


def polydata():
    pv = pytest.importorskip("pyvista")
    A, B, uv = textured.split_at_seams(V, F, UV)
    mesh = pv.PolyData.from_regular_faces(A, B)
    mesh.point_data["height"] = A[:, 2].astype(np.float32)
    mesh.point_data["vector"] = A.copy()
    mesh.cell_data["part"] = (A[B].mean(axis=1)[:, 0] > 0).astype(np.int8)
    mesh.field_data["who"] = ["me"]
    mesh.active_texture_coordinates = uv
    mesh.set_active_scalars("height")
    return pv, mesh


def test_pyvista_with_point_cell_and_field_data():
    pv, mesh = polydata()
    out = remesh(mesh, L, preserve="part")
    assert type(out) is pv.PolyData and out.is_all_triangles
    assert out.active_scalars_name == "height" and out.field_data["who"][0] == "me"
    assert out.point_data["height"].dtype == np.float32
    assert np.allclose(out["height"], out.points[:, 2], atol=1e-6)
    assert np.allclose(out["vector"], out.points, atol=1e-6)
    assert_charts(np.asarray(out.active_texture_coordinates)[out.regular_faces])
    middle = out.points[out.regular_faces].mean(axis=1)
    assert np.array_equal(out["part"], (middle[:, 0] > 0).astype(np.int8))
    assert out.clean().is_manifold


def test_pyvista_polygons_and_normals():
    pv = pytest.importorskip("pyvista")
    out = remesh(pv.Cube(), 0.2)
    assert out.is_all_triangles and np.isclose(out.volume, 1)
    ball = remesh(pv.Sphere(), 0.1)
    normals = ball.point_data.active_normals
    assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    assert (np.einsum("ij,ij->i", normals, ball.points) > 0.49).all()


@pytest.mark.parametrize("name", ["Cylinder", "Cone", "Arrow", "Dodecahedron", "Disc"])
def test_pyvista_with_mixed_polygons(name):
    pv = pytest.importorskip("pyvista")
    mesh = getattr(pv, name)()
    mesh.cell_data["number"] = np.arange(mesh.n_cells)
    out = remesh(mesh, 0.05)
    assert out.is_all_triangles and np.isclose(out.area, mesh.triangulate().area, rtol=0.06)
    assert out.cell_data["number"].dtype == mesh.cell_data["number"].dtype
    assert name == "Disc" or out.clean().n_open_edges == mesh.triangulate().clean().n_open_edges
    assert mesh.remeshvec.quality().faces == mesh.triangulate().n_cells


def test_pyvista_lines_are_left_out_aloud():
    pv = pytest.importorskip("pyvista")
    p, tri, _ = textured.grid(4, 4, False, False)
    both = pv.PolyData.from_regular_faces(np.column_stack([p, np.zeros(len(p))]), tri)
    both.lines = [2, 0, 1, 2, 1, 2]
    with pytest.warns(UserWarning, match="lines"):
        out = remesh(both, 0.2)
    assert out.n_lines == 0 and np.isclose(out.area, 1)


def test_other_kinds_of_pyvista_are_named():
    pv = pytest.importorskip("pyvista")
    with pytest.raises(MeshInputError, match="extract_surface"):
        remesh(pv.ImageData(dimensions=(3, 3, 3)), 0.2)
    with pytest.warns(UserWarning), pytest.raises(MeshInputError, match="no faces"):
        remesh(pv.PolyData(np.eye(3)), 0.2)
    blocks = pv.MultiBlock([pv.Cube(), pv.Cube(center=(3, 0, 0))])
    with pytest.raises(MeshInputError, match=r"blocks.combine\(\).extract_surface\(\)"):
        remesh(blocks, 0.2)
    surface = blocks.combine().extract_surface(algorithm="dataset_surface")
    assert np.isclose(remesh(surface, 0.2).area, 12)


def test_scenes_of_trimesh_get_a_hint():
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene([trimesh.creation.box()])
    with pytest.raises(MeshInputError, match=r"scene.to_mesh\(\) as one"):
        remesh(scene, 0.2)
    assert np.isclose(remesh(scene.to_mesh(), 0.2).volume, 1)


def test_the_accessor_of_pyvista():
    _, mesh = polydata()
    out = mesh.remeshvec.remesh(L)
    assert np.array_equal(out.points, remesh(mesh, L).points)
    mesh.point_data["size"] = np.full(mesh.n_points, L)
    assert np.array_equal(mesh.remeshvec.remesh("size").points, remesh(mesh, "size").points)
    assert out.remeshvec.quality().faces == out.n_cells


# --- meshio ----------------------------------------------------------------------------------


def test_meshio_with_blocks_sets_and_groups():
    meshio = pytest.importorskip("meshio")
    p, tri, _ = textured.grid(4, 4, False, False)
    left = p[tri].mean(axis=1)[:, 0] < 0.5
    blocks = [tri[left], tri[~left]]
    mesh = meshio.Mesh(
        p, [("triangle", b) for b in blocks], point_data={"T": p[:, 0]},
        cell_data={"gmsh:physical": [np.full(len(b), 7 + i) for i, b in enumerate(blocks)]},
        cell_sets={"low": [np.flatnonzero(p[b].mean(axis=1)[:, 1] < 0.5) for b in blocks]},
        field_data={"steel": np.array([7, 2])},
    )  # fmt: skip
    out = remesh(mesh, 0.1)
    assert type(out) is meshio.Mesh and out.points.shape[1] == 2
    assert np.allclose(out.point_data["T"], out.points[:, 0])
    assert out.field_data["steel"].tolist() == [7, 2] and len(out.cells) == 2
    for i, block in enumerate(out.cells):
        middle = out.points[block.data].mean(axis=1)
        assert ((middle[:, 0] < 0.5) == (i == 0)).all()
        x = out.points[block.data][..., 0]
        assert (x <= 0.5 + 1e-12).all() if i == 0 else (x >= 0.5 - 1e-12).all()
        assert (out.cell_data["gmsh:physical"][i] == 7 + i).all()
        low = np.flatnonzero(middle[:, 1] < 0.5)
        assert np.array_equal(out.cell_sets["low"][i], low)


def test_meshio_quads_and_polygons():
    meshio = pytest.importorskip("meshio")
    p, tri, _ = textured.grid(4, 4, False, False)
    quads = np.concatenate([tri[:16], tri[16:, 2:]], axis=1)
    points = np.column_stack([p, np.zeros(len(p))])
    mesh = meshio.Mesh(points, [("quad", quads)], cell_data={"id": [np.arange(16)]})
    out = remesh(mesh, 0.1)
    assert out.cells[0].type == "triangle" and out.points.shape[1] == 3
    assert set(out.cell_data["id"][0]) == set(range(16))
    points = np.array([[0, 0], [2, 0], [3, 1], [1, 2], [0, 1.0]])
    polygon = meshio.Mesh(points, [("polygon", [[0, 1, 2, 3, 4]])])
    assert np.isclose(area(remesh(polygon, 0.3)), 4.0, rtol=0.01)


def area(mesh):
    a, b, c = mesh.points[mesh.cells[0].data].transpose(1, 0, 2)
    return 0.5 * abs(np.cross(b - a, c - a) if a.shape[1] == 3 else
                     (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum()  # fmt: skip


def test_meshio_cells_that_are_no_surface():
    meshio = pytest.importorskip("meshio")
    with pytest.raises(MeshInputError, match="tetra"):
        remesh(meshio.Mesh(np.eye(4, 3), [("tetra", [[0, 1, 2, 3]])]), 0.2)
    for cells in (np.array([[0, 1, 2.5]]), np.array([[True, False, True]])):
        with pytest.raises(MeshInputError, match="must hold integers"):
            remesh(meshio.Mesh(V, [("triangle", cells)]), 0.2)
    lines = meshio.Mesh(V, [("line", F[:4, :2]), ("triangle", F)])
    with pytest.warns(UserWarning, match="line"):
        assert [b.type for b in remesh(lines, L).cells] == ["triangle"]


# --- open3d ----------------------------------------------------------------------------------


def test_open3d_with_texture_colours_and_materials():
    o3d = pytest.importorskip("open3d", exc_type=ImportError)
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(V), o3d.utility.Vector3iVector(F.astype(np.int32))
    )
    mesh.vertex_colors = o3d.utility.Vector3dVector((V + 1) / 2)
    mesh.triangle_uvs = o3d.utility.Vector2dVector(UV.reshape(-1, 2))
    top = V[F].mean(axis=1)[:, 2] > 0
    mesh.triangle_material_ids = o3d.utility.IntVector(top.astype(np.int32))
    mesh.textures = [o3d.geometry.Image(np.zeros((4, 4, 3), np.uint8))]
    mesh.compute_vertex_normals()
    out = remesh(mesh, L)
    assert type(out) is o3d.geometry.TriangleMesh and out.is_watertight()
    assert_charts(np.asarray(out.triangle_uvs).reshape(-1, 3, 2))
    X = np.asarray(out.vertices)
    assert np.allclose(np.asarray(out.vertex_colors), (X + 1) / 2, atol=1e-9)
    middle = X[np.asarray(out.triangles)].mean(axis=1)
    assert np.array_equal(np.asarray(out.triangle_material_ids) == 1, middle[:, 2] > 0)
    assert out.has_textures() and out.has_vertex_normals()


# --- torch, pairs, and what is none ----------------------------------------------------------


def test_tensors_in_tensors_out_with_gradients():
    torch = pytest.importorskip("torch")
    vertices = torch.tensor(V, dtype=torch.float32, requires_grad=True)
    result = remesh(vertices, torch.tensor(F, dtype=torch.int32), L)
    assert isinstance(result, RemeshResult)
    assert result.V.dtype == torch.float32 and result.F.dtype == torch.int32
    again = result.transfer(vertices)
    assert torch.allclose(again, result.V, atol=1e-6)
    again.square().sum().backward()
    P = result.matrix().to_dense()
    assert torch.allclose(vertices.grad, 2 * P.T @ (P @ vertices.detach()), atol=1e-4)
    labels = result.transfer(torch.arange(len(F)), on="faces")
    assert labels.dtype == torch.int64 and labels.shape == (len(result.F),)
    uv = result.transfer(torch.tensor(UV), on="corners")
    assert uv.shape == (len(result.F), 3, 2)
    back = result.transfer_back(result.V)
    assert torch.allclose(back, vertices.detach(), atol=1e-5)
    mixed = remesh(vertices.detach(), F, L, preserve=torch.tensor(UV))
    assert torch.is_tensor(mixed.V) and isinstance(mixed.F, np.ndarray)


def test_everything_of_a_result_is_a_tensor():
    torch = pytest.importorskip("torch")
    parts = (V[F].mean(axis=1)[:, 0] > 0).astype(np.int16)
    arrays = remesh(V, F, L, face_labels=parts)
    result = remesh(torch.tensor(V, dtype=torch.float32), torch.tensor(F), L, face_labels=parts)
    mixed = remesh(V, torch.tensor(F), L, face_labels=parts)
    for name in [
        "V", "F", "lengths", "face_labels", "birth_face", "birth_barycentric", "face_birth",
        "corner_birth_face", "corner_birth_barycentric", "image_face", "image_barycentric",
        "vertex_map", "face_map", "feature_edges", "input_feature_edges", "corners",
    ]:  # fmt: skip
        expected, found = getattr(arrays, name), getattr(result, name)
        assert isinstance(expected, np.ndarray) and torch.is_tensor(found), name
        assert np.allclose(found.numpy(), expected, atol=1e-6), name
        assert found.dtype == torch.float32 or not found.is_floating_point(), name
        assert name == "V" or torch.is_tensor(getattr(mixed, name)), name
    assert mixed.birth_barycentric.dtype == torch.float64
    for call in (
        lambda r: r.matrix(), lambda r: r.matrix("faces"), lambda r: r.matrix("corners"),
        lambda r: r.back_matrix(),
    ):  # fmt: skip
        assert call(result).is_sparse and call(result).dtype == torch.float32
        assert np.allclose(call(result).to_dense().numpy(), call(arrays).toarray(), atol=1e-6)


def test_a_network_trains_through_the_matrix():
    torch = pytest.importorskip("torch")
    torch.manual_seed(0)
    result = remesh(torch.tensor(V, dtype=torch.float32), torch.tensor(F), L)
    P, back = result.matrix(), result.back_matrix()
    features, wanted = torch.tensor(V, dtype=torch.float32), torch.sin(3 * result.V[:, :1])
    first = torch.nn.Linear(3, 16)  # at the vertices of the input
    second = torch.nn.Linear(16, 1)  # at those of the result
    adam = torch.optim.Adam([*first.parameters(), *second.parameters()], lr=0.02)
    losses = []
    for _ in range(150):
        adam.zero_grad()
        loss = (second(torch.tanh(P @ first(features))) - wanted).square().mean()
        loss.backward()
        adam.step()
        losses.append(loss.item())
    assert first.weight.grad.abs().max() > 0 and losses[-1] < 0.05 * losses[0]
    given = result.V.clone().requires_grad_()
    (back @ given).sum().backward()
    assert torch.allclose(given.grad, back.to_dense().T @ torch.ones(len(V), 3), atol=1e-5)


def test_pairs_are_meshes_too():
    one, two = remesh((V, F), L), remesh(V, F, L)
    assert np.array_equal(one.V, two.V) and isinstance(one, RemeshResult)
    assert np.array_equal(remesh([V, F], L=L).V, two.V)
    lengths = np.full(len(V), L)
    assert np.array_equal(remesh((V, F), lengths).V, remesh(V, F, lengths).V)
    with pytest.raises(MeshInputError, match="F"):
        remesh([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])  # two vertices are no pair
    with pytest.raises(OptionError, match="followed by the length alone"):
        remesh((V, F), L, L)
    assert np.array_equal(remesh(V.tolist(), F.tolist(), L).V, two.V)


def test_result_beside_the_object():
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(V, F, process=False)
    out, result = remesh(mesh, L, return_result=True)
    assert np.array_equal(out.vertices, result.V) and result.report.target_length == L
    with pytest.raises(OptionError, match="return_result"):
        remesh(V, F, L, return_result=True)


def test_batches_of_objects():
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(V, F, process=False, vertex_attributes={"x": V[:, 0]})
    alone = remesh(mesh, L)
    for item in remesh_many([mesh, (V, F), mesh], L, workers=2):
        if item.index == 1:
            assert np.array_equal(item.result.V, alone.vertices)
            uv = item.result.transfer(UV, on="corners")
            assert uv.shape == (len(item.result.F), 3, 2)
        else:
            assert type(item.result) is trimesh.Trimesh
            assert np.array_equal(item.result.vertex_attributes["x"], alone.vertex_attributes["x"])


def test_objects_take_all_options():
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(V, F, process=False)
    mesh.face_attributes["part"] = (V[F].mean(axis=1)[:, 0] > 0).astype(int)
    mesh.vertex_attributes["size"] = 0.2 + 0.1 * (V[:, 0] + 1)
    out, result = remesh(
        mesh, "size", face_labels="part", preset="fast", fixed_vertices=[0], return_result=True
    )
    assert result.report.preset == "fast" and result.vertex_map[0] >= 0
    assert np.array_equal(result.face_labels, out.face_attributes["part"])
    assert np.ptp(result.lengths) > 0.1


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda m: remesh(m, 0.1, 0.2), OptionError, "followed by the length alone"),
        (lambda m: remesh(m, "size"), OptionError, "no data 'size' on vertices"),
        (lambda m: remesh(m, L, face_labels="part"), OptionError, "face_labels: there are no data"),
        (lambda m: remesh(object(), L), MeshInputError, "object is not a mesh of a known type"),
        (lambda m: remesh(None), MeshInputError, "NoneType is not a mesh"),
        (lambda m: remesh("part.obj", 0.1), MeshInputError, "part.obj is a path: remesh_file"),
        (lambda m: remesh(V, F, "size"), OptionError, "L "),
    ],
)
def test_wrong_calls_are_named(call, error, message):
    trimesh = pytest.importorskip("trimesh")
    with pytest.raises(error, match=message):
        call(trimesh.Trimesh(V, F, process=False))


def test_no_library_is_imported_for_arrays():
    code = (
        "import sys, numpy as np, remeshvec\n"
        "r = remeshvec.remesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], 0.5)\n"
        "r.transfer(np.zeros(3)), r.transfer(np.zeros((1, 3)), on='corners')\n"
        "print(*sys.modules)"
    )
    loaded = set(run_python("-c", code).stdout.split())
    assert not {"trimesh", "pyvista", "meshio", "open3d", "torch"} & loaded


# --- splitting vertices ----------------------------------------------------------------------


@pytest.mark.parametrize("shape", [textured.cube, textured.cylinder, textured.torus, textured.slit])
def test_vertices_are_split_where_corners_differ(shape):
    points, faces, uv = shape()
    _, expected, _ = textured.split_at_seams(points, faces, uv)
    corner, split = split_vertices(faces, [uv])
    assert split.shape == faces.shape and len(corner) == expected.max() + 1
    assert np.allclose(uv.reshape(-1, 2)[corner][split], uv)
    assert np.array_equal(faces.ravel()[corner][split], faces)
    assert np.array_equal(np.unique(split), np.arange(len(corner)))


@pytest.mark.parametrize("name", list(zoo.ZOO))
def test_nothing_is_split_where_nothing_differs(name):
    points, faces = zoo.ZOO[name].make()
    corner, _ = split_vertices(faces, [points[faces], np.zeros((len(faces), 3), int)])
    around = {v: set(faces[(faces == v).any(axis=1)].ravel()) for v in np.unique(faces)}
    assert len(corner) >= len(around)
    if zoo.ZOO[name].vertex_manifold and zoo.ZOO[name].clean:
        assert len(corner) == len(around)
        assert np.array_equal(faces.ravel()[corner], np.unique(faces))


def test_not_numbers_and_infinite_ones_split_nothing_they_should_not():
    p, faces, _ = textured.grid(2, 2, False, False)
    values = np.where(np.arange(len(p)) == 4, np.nan, 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        corner, _ = split_vertices(faces, [values[faces]])
    assert len(corner) == len(p)
