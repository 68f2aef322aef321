"""OBJ and PLY come back remeshed with what they carried; what a format cannot hold is named."""

import json
from contextlib import suppress
from time import perf_counter

import numpy as np
import pytest
from helpers.hostile_files import LEGAL, OBJ
from helpers.loaded_cube import (
    assert_charts,
    assert_field,
    assert_groups,
    corner_uv,
    loaded_cube,
    obj_cube,
)

from data.shapes import textured
from remeshvec import MeshFormatError, read_mesh
from remeshvec.batch.one_file import remesh_file
from remeshvec.files.data_files import read_data, write_data


def test_obj_keeps_texture_groups_colours_and_material_library(tmp_path):
    source = obj_cube(tmp_path)
    (tmp_path / "out").mkdir()
    target = tmp_path / "out" / "even.obj"
    result = remesh_file(source, target, 0.3)
    data, notices = read_data(target)
    assert not notices and len(data.F) == len(result.F)
    assert np.array_equal(data.V, result.V)
    assert_charts(corner_uv(data))
    assert_groups(data)
    assert data.extra["group"] == ["lower half", "upper half"]
    assert target.read_text().startswith("mtllib ../cube.mtl\n")
    colours = data.on_vertices["color"]
    assert np.allclose(colours[data.V[:, 2] == 1], [0, 0, 1], atol=0.01)


def test_obj_statements_of_all_kinds(tmp_path):
    path = tmp_path / "odd.obj"
    path.write_text(
        "o thing\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0 0\nvt 1 1\nvt 0\n"
        "usemtl red paint\nf 1/1 2/2 \\\n3/3 4/4 # a comment\ng side\nv 0 0 1\nf -1/1/7 -5/2/7 -4/3/7\n"
    )
    data, notices = read_data(path)
    assert notices == ["polygons were cut: 2 faces became 3 triangles"]
    assert data.F.tolist() == [[0, 1, 2], [0, 2, 3], [4, 0, 1]]
    assert data.on_corners["uv"][1].tolist() == [[0, 0], [1, 1], [0, 0]]
    assert data.on_faces["material"].tolist() == [0, 0, 0] and data.extra["material"] == [
        "red paint"
    ]
    assert data.on_faces["group"].tolist() == [-1, -1, 0] and data.extra["group"] == ["side"]
    assert data.extra["object"] == ["thing"]


def test_a_bad_texture_index_leaves_the_mesh(tmp_path):
    path = tmp_path / "bad.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/2 3/9\n")
    data, notices = read_data(path)
    assert len(data.F) == 1 and not data.on_corners
    assert "texture coordinate 9; there are 1" in notices[0]


@pytest.mark.parametrize("flat", [True, False])
def test_ply_keeps_every_property(tmp_path, flat):
    source, target = tmp_path / "a.ply", tmp_path / "b.ply"
    data = loaded_cube()
    if flat:
        data.on_corners.clear()
    data.on_vertices["normal"] = data.V / np.linalg.norm(data.V, axis=1, keepdims=True)
    data.on_vertices["count"] = np.arange(len(data.V))
    data.on_faces["quality"] = np.linspace(0, 1, len(data.F)).astype(np.float32)
    data.extra["comments"] = ["TextureFile wood.png", "one"]
    write_data(source, data)
    assert np.array_equal(read_mesh(source).V, data.V)
    result = remesh_file(source, target, 0.3, preserve=data.on_faces["group"])
    out, _ = read_data(target)
    assert np.array_equal(out.V, result.V) and np.array_equal(out.F, result.F)
    assert_field(out)
    assert_groups(out)
    assert out.extra["comments"] == (["one"] if not flat else ["TextureFile wood.png", "one"])
    assert b"\ncomment TextureFile wood.png\n" in target.read_bytes()
    assert out.on_vertices["count"].dtype == np.int32
    assert out.on_faces["quality"].dtype == np.float32
    assert out.on_vertices["color"].dtype == np.uint8
    assert np.allclose(np.linalg.norm(out.on_vertices["normal"], axis=1), 1)
    if not flat:
        assert_charts(corner_uv(out))


@pytest.mark.parametrize("text", [False, True])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("mixed", [False, True])
def test_ply_is_read_as_plyfile_wrote_it(tmp_path, text, order, mixed):
    plyfile = pytest.importorskip("plyfile")
    V, F, uv = textured.cube(2)
    polygons = [row.tolist() for row in F] + [[0, 1, 2, 3]] * mixed
    texture = [row.ravel() for row in uv] + [np.arange(8.0)] * mixed
    vertex = np.empty(len(V), [("id", "u2"), ("z", "f8"), ("x", "f8"), ("y", "f8"), ("t", "f4")])
    vertex["x"], vertex["y"], vertex["z"] = V.T
    vertex["id"], vertex["t"] = np.arange(len(V)), V[:, 0] / 3
    # Of a table with lists, plyfile writes scalars of more than a byte in the machine's order.
    kinds = [("q", "u1"), ("vertex_index", "O"), ("texcoord", "O"), ("group", "i1")]
    face = np.empty(len(polygons), kinds)
    face["q"], face["group"] = np.arange(len(polygons)), -(np.arange(len(polygons)) % 3)
    face["vertex_index"], face["texcoord"] = [
        np.array([*rows, None], dtype=object)[:-1] for rows in (polygons, texture)
    ]
    camera = np.array([(1, 2.5)], [("a", "i4"), ("b", "f8")])
    tables = [
        plyfile.PlyElement.describe(camera, "camera"),
        plyfile.PlyElement.describe(face, "face", val_types={"texcoord": "f8"}),
        plyfile.PlyElement.describe(vertex, "vertex"),
    ]
    plyfile.PlyData(tables, text=text, byte_order=order, comments=["one"]).write(tmp_path / "a.ply")
    data, notices = read_data(tmp_path / "a.ply")
    assert len(notices) == mixed
    row = [*range(len(F)), *[len(F)] * 2 * mixed]
    assert np.array_equal(data.V, V)
    assert np.array_equal(data.F, [*F.tolist(), *[[0, 1, 2], [0, 2, 3]] * mixed])
    assert np.array_equal(data.on_vertices["id"], vertex["id"])
    assert np.array_equal(data.on_vertices["t"], vertex["t"])
    assert np.array_equal(data.on_faces["q"], face["q"][row])
    assert np.array_equal(data.on_faces["group"], face["group"][row])
    kinds = {name: x.dtype.str for name, x in (data.on_vertices | data.on_faces).items()}
    assert kinds == {"id": "<u2", "t": "<f4", "q": "|u1", "group": "|i1"}
    assert np.array_equal(data.on_corners["uv"][: len(F)], uv)
    if mixed:
        assert data.on_corners["uv"][-1].tolist() == [[0, 1], [4, 5], [6, 7]]
    assert data.extra["comments"] == ["one"]


def test_ply_is_written_as_plyfile_reads_it(tmp_path):
    plyfile = pytest.importorskip("plyfile")
    data = loaded_cube()
    data.extra["comments"] = ["one", "two"]
    data.on_vertices["tensor"] = np.arange(4.0 * len(data.V)).reshape(-1, 2, 2)
    data.on_faces["truth"] = data.F[:, 0] > 9
    data.on_faces["large"] = np.full(len(data.F), 1 << 40)
    write_data(tmp_path / "a.ply", data)
    tables = plyfile.PlyData.read(tmp_path / "a.ply")
    vertex, face = tables["vertex"], tables["face"]
    assert tables.comments == ["one", "two"]
    assert np.array_equal(np.stack([vertex[axis] for axis in "xyz"], axis=1), data.V)
    assert np.array_equal(np.stack(face["vertex_indices"]), data.F)
    assert np.array_equal(np.stack(face["texcoord"]), data.on_corners["uv"].reshape(-1, 6))
    assert np.array_equal(vertex["tensor_2"], data.on_vertices["tensor"][:, 1, 0])
    assert vertex["red"].dtype == np.uint8 and face["truth"].dtype == np.uint8
    assert face["large"].dtype == np.float64 and (face["large"] == 1 << 40).all()


@pytest.mark.parametrize(
    ("name", "values", "reason"),
    [
        ("two words", np.zeros(1), "a blank ends the name"),
        ("s", np.array(["x"]), "cannot hold values"),
    ],
)
def test_what_ply_cannot_say_is_named(tmp_path, name, values, reason):
    data = loaded_cube()
    data.on_vertices[name] = np.repeat(values, len(data.V))
    with pytest.raises(MeshFormatError, match=reason):
        write_data(tmp_path / "a.ply", data)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace(" ", "\t"),
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace(" 3/3", " \\ \r\n 3/3"),
        lambda text: text.replace("f 1/1 2/2 3/3", "f 1/1 2/2 3/3 # f 1/1"),
        lambda text: "# a \\\n comment \f \x1c\n" + text,
        lambda text: text.replace("f 1/1 2/2 3/3", "f -4/-4 -3/-3 -2/-2"),
        lambda text: text.replace("f 1/1 2/2 3/3", "f 1/1/ 2/2/1 3/3/"),
    ],
)
def test_obj_with_data_has_the_faces_of_the_mesh(tmp_path, change):
    path = tmp_path / "a.obj"
    text = (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "usemtl a\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
    )
    path.write_bytes(change(text).encode())
    data, _ = read_data(path)
    assert np.array_equal(data.F, read_mesh(path).F) and data.F.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert data.on_corners["uv"][0].tolist() == [[0, 0], [1, 0], [1, 1]]
    assert data.on_faces["material"].tolist() == [0, 0]


@pytest.mark.parametrize("name", LEGAL)
def test_both_readers_find_the_same_mesh(name, tmp_path):
    (tmp_path / name).write_bytes(LEGAL[name])
    data, notices = read_data(tmp_path / name)
    mesh = read_mesh(tmp_path / name)
    assert np.array_equal(data.V, mesh.V) and np.array_equal(data.F, mesh.F)
    assert notices == mesh.notices


@pytest.mark.parametrize("line", ["f\u00a01 2 3", "F 1 2 3", "fo 1 2 3", "f1 2 3"])
def test_lines_without_a_known_keyword_are_named(line, tmp_path):
    path = tmp_path / "a.obj"
    path.write_bytes(OBJ + f"{line}\nl 1 2\ncstype bezier\nnonsense\n".encode())
    for notices in (read_data(path)[1], read_mesh(path).notices):
        assert len(notices) == 1 and notices[0].startswith("2 lines without a keyword of OBJ")
        assert line[0] in notices[0]


@pytest.mark.parametrize(
    "name", ["a\nf 1 2 3", "a\rf 1 2 3", "a\\", "a \\ \\\t", "a # b", "a\u2028f 1 2 3", "", "\n"]
)
def test_no_name_changes_what_is_written(name, tmp_path):
    data = loaded_cube()
    data.extra |= {"group": [name, "upper half"], "mtllib": [str(tmp_path / name / "a.mtl")]}
    write_data(tmp_path / "a.obj", data)
    for F in (read_data(tmp_path / "a.obj")[0].F, read_mesh(tmp_path / "a.obj").F):
        assert np.array_equal(F, data.F)


def test_the_time_to_read_obj_is_linear(tmp_path):
    path = tmp_path / "a.obj"
    path.write_bytes(OBJ + b"".join(b"g %d\nf 1 2 3\n" % i for i in range(60_000)))
    start = perf_counter()
    assert len(read_data(path)[0].extra["group"]) == 60_000
    digits = b"1" * 300_000
    for old, new in [
        (b"v 1", b"v " + digits), (b"v 1", b"v " + digits + b"x"), (b"v 1", b"v 0." + digits),
        (b"f 1", b"f 1/" + digits), (b"f 1", b"f 1" + b"/" * 300_000), (b"v 1", b"\\ " * 150_000),
    ]:  # fmt: skip
        path.write_bytes(OBJ.replace(old, new))
        with suppress(MeshFormatError):
            read_data(path)
    assert perf_counter() - start < 5


def test_what_a_format_cannot_hold_is_told(tmp_path):
    data = loaded_cube()
    assert write_data(tmp_path / "a.stl", data) == ["color", "group", "height", "uv"]
    assert write_data(tmp_path / "a.json", data) == ["color", "group", "height", "uv"]
    assert json.loads((tmp_path / "a.json").read_text()).keys() == {"verts", "faces"}
    assert write_data(tmp_path / "a.obj", data) == ["height"]


def test_unknown_suffixes_are_named(tmp_path):
    with pytest.raises(MeshFormatError, match=r"'.xyz' is not one of"):
        write_data(tmp_path / "a.xyz", loaded_cube())
    with pytest.raises(MeshFormatError, match=r"read only|not installed"):
        remesh_file(obj_cube(tmp_path), tmp_path / "a.3mf")
