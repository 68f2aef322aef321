"""Textures, images and materials go from every format to every other."""

import io

import numpy as np
import pytest
from helpers.loaded_cube import loaded_cube

from data.shapes import textured
from remeshvec import remesh_file
from remeshvec.files.data_files import read_data, write_data
from remeshvec.files.materials import image_bytes, known_materials

Image = pytest.importorskip("PIL.Image")
pytest.importorskip("trimesh")
pytest.importorskip("meshio")
pytest.importorskip("pyvista")

SUFFIXES = [".obj", ".ply", ".glb", ".vtp", ".vtu"]
SIZE = 96  # texels a side
METAL = (0.2, 0.4, 0.6)


def picture():
    """An image whose texels tell their place."""
    y, x = np.mgrid[:SIZE, :SIZE]
    return np.stack([x, y, (7 * x + 13 * y) % 256], axis=2).astype(np.uint8)


def sides_of(points):
    """Number of the side of the cube that points near the middle of a face lie on."""
    axis = abs(points).argmax(axis=1)
    return 2 * axis + (np.take_along_axis(points, axis[:, None], axis=1)[:, 0] > 0)


def place_in_texture(points, side):
    """Texture coordinates (m, 3, 2) of points (m, 3, 3) on sides (m,)."""
    across = np.array([[1, 2], [0, 2], [0, 1]])[side // 2]
    p = (np.take_along_axis(points, across[:, None, :], axis=2) + 1) / 2
    return (0.05 + 0.9 * p + np.stack([side % 3, side // 3], axis=1)[:, None]) / [3, 2]


def painted_cube(folder):
    """Write an OBJ file of a cube with four painted sides, and two of metal."""
    V, F, uv = textured.cube(4)
    data = loaded_cube()
    data.on_vertices.clear()
    data.on_faces.clear()
    data.on_faces["material"] = (sides_of(V[F].mean(axis=1)) >= 4).astype(int)
    data.extra |= {"material": ["painted wood", "metal"], "mtllib": [str(folder / "cube.mtl")]}
    Image.fromarray(picture()).save(folder / "a paint.png")
    (folder / "cube.mtl").write_text(
        "newmtl painted wood\nKd 1 1 1\nmap_Kd a paint.png\n\n"
        f"newmtl metal\nKd {' '.join(map(str, METAL))}\n"
    )
    write_data(folder / "cube.obj", data)
    assert np.allclose(uv, place_in_texture(V[F], sides_of(V[F].mean(axis=1))))
    return folder / "cube.obj"


def assert_painted(path):
    """Check by our reader that the texture lies where it lay, with its image, and all materials."""
    data, notices = read_data(path)
    assert not notices
    corners = data.V[data.F]
    side = sides_of(corners.mean(axis=1))
    shift = data.on_corners["uv"] - place_in_texture(corners, side)
    assert abs(shift).max() * SIZE < 1
    materials = known_materials(data)
    named = {material.name: material for material in materials}
    assert set(named) == {"painted wood", "metal"}
    label = data.on_faces["material"]
    names = np.array([material.name for material in materials])
    assert np.array_equal(names[label], np.where(side >= 4, "metal", "painted wood"))
    content = image_bytes(named["painted wood"])
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(content))), picture())
    assert image_bytes(named["metal"]) is None
    assert np.allclose(named["metal"].color, (*METAL, 1), atol=0.003)


@pytest.mark.parametrize("target", SUFFIXES)
@pytest.mark.parametrize("source", SUFFIXES)
def test_textures_between_all_pairs(tmp_path, source, target):
    given, out = tmp_path / f"given{source}", tmp_path / "out" / f"even{target}"
    out.parent.mkdir()
    lost = write_data(given, read_data(painted_cube(tmp_path))[0])
    assert lost == [] and len(list(out.parent.iterdir())) == 0
    remesh_file(given, out, 0.3)
    assert_painted(out)


@pytest.mark.parametrize("target", [".obj", ".glb"])
def test_other_programs_see_the_same(tmp_path, target):
    import trimesh

    out = tmp_path / f"even{target}"
    remesh_file(painted_cube(tmp_path), out, 0.3)
    scene = trimesh.load(out, force="scene", process=False)
    painted = 0
    for mesh in scene.dump(concatenate=False):
        if mesh.visual.material.name != "painted wood":
            continue
        corners = np.asarray(mesh.vertices)[mesh.faces]
        expected = place_in_texture(corners, sides_of(corners.mean(axis=1)))
        centre = np.asarray(mesh.visual.uv)[mesh.faces].mean(axis=1)
        seen = mesh.visual.material.to_color(centre)[:, :2].astype(int)
        wanted = expected.mean(axis=1) * [1, -1] + [0, 1]  # rows of an image count from its top
        assert abs(seen - (wanted * SIZE - 0.5)).max() < 1.01
        painted += len(corners)
    assert painted > 100


def test_a_material_library_from_gltf_never_replaces_another_file(tmp_path):
    given = tmp_path / "given.glb"
    write_data(given, read_data(painted_cube(tmp_path))[0])
    (tmp_path / "even.png").write_text("mine")
    (tmp_path / "even.mtl").write_text("mine too")
    for _ in range(2):  # the second time the files are there, and used again
        remesh_file(given, tmp_path / "even.obj", 0.3)
        assert_painted(tmp_path / "even.obj")
    assert (tmp_path / "even.png").read_text() == "mine"
    assert (tmp_path / "even.mtl").read_text() == "mine too"
    assert {path.name for path in tmp_path.glob("even-*")} == {"even-2.png", "even-2.mtl"}


def test_ply_files_that_only_name_an_image(tmp_path):
    data = loaded_cube()
    Image.fromarray(picture()).save(tmp_path / "wood.png")
    data.extra["comments"] = ["made by hand", "TextureFile wood.png"]
    write_data(tmp_path / "a.ply", data)
    (tmp_path / "out").mkdir()
    remesh_file(tmp_path / "a.ply", tmp_path / "out" / "b.ply", 0.3)
    header = (tmp_path / "out" / "b.ply").read_bytes().split(b"end_header")[0].decode()
    assert "comment made by hand\ncomment TextureFile ../wood.png\n" in header
    assert "texnumber" not in header and not list((tmp_path / "out").glob("*.mtl"))
    remesh_file(tmp_path / "a.ply", tmp_path / "b.glb", 0.3)
    (material,) = known_materials(read_data(tmp_path / "b.glb")[0])
    assert material.name == "wood"
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(image_bytes(material)))), picture())


def test_texture_coordinates_of_ply_stay_at_vertices(tmp_path):
    data = loaded_cube()
    data.extra["uv at vertices"] = True
    write_data(tmp_path / "a.ply", data)
    remesh_file(tmp_path / "a.ply", tmp_path / "b.ply", 0.3)
    header = (tmp_path / "b.ply").read_bytes().split(b"end_header")[0]
    assert b"property double s\nproperty double t\n" in header and b"texcoord" not in header


def test_images_that_cannot_be_carried_are_told(tmp_path):
    data, _ = read_data(painted_cube(tmp_path))
    assert write_data(tmp_path / "a.stl", data) == [
        "images of materials",
        "material",
        "uv",
    ]
    assert "images of materials" in write_data(tmp_path / "a.vtk", data)


def test_a_library_opens_images_alone(tmp_path):
    data, _ = read_data(painted_cube(tmp_path))
    (tmp_path / "secret").write_text("a password")
    (tmp_path / "cube.mtl").write_text("newmtl painted wood\nmap_Kd secret\nnewmtl metal\nKd x\n")
    assert [image_bytes(material) for material in known_materials(data)] == [None, None]
    (tmp_path / "cube.mtl").write_text(
        "newmtl metal\nmap_Kd -clamp on -s 1 .5 1 a paint.png\nd .5\n"
    )
    metal = known_materials(data)[1]
    assert metal.image == tmp_path / "a paint.png" and metal.color == (1, 1, 1, 0.5)
    (tmp_path / "cube.mtl").unlink()
    assert [material.name for material in known_materials(data)] == ["painted wood", "metal"]
