"""A cube that carries data of every kind, and checks that remeshing kept them."""

import numpy as np

from data.shapes import textured
from remeshvec.files.data_files import write_data
from remeshvec.interop.mesh_data import MeshData

RED_AND_BLUE = np.array([[255, 0, 0], [0, 0, 255]], np.uint8)


def loaded_cube():
    """A cube with one chart per side, a field, colours, and two groups."""
    V, F, uv = textured.cube(4)
    top = V[F].mean(axis=1)[:, 2] > 0
    return MeshData(
        V,
        F,
        {"height": V[:, 2].copy(), "color": RED_AND_BLUE[(V[:, 2] > 0).astype(int)]},
        {"group": top.astype(np.int32)},
        {"uv": uv},
        ("uv", "group"),
    )


def obj_cube(folder):
    """Write the cube as OBJ with named groups and a material library; returns the path."""
    path = folder / "cube.obj"
    data = loaded_cube()
    data.extra["group"] = ["lower half", "upper half"]
    (folder / "cube.mtl").write_text("newmtl a\nmap_Kd t.png\n")
    write_data(path, data)
    path.write_text("mtllib cube.mtl\n" + path.read_text())
    return path


def assert_field(data, name="height"):
    assert np.allclose(data.on_vertices[name].ravel(), data.V[:, 2], atol=1e-6)


def assert_charts(uv):
    """Check that texture coordinates (m, 3, 2) cover their area and that no face spans two charts."""
    assert np.isclose(abs(areas(uv)).sum(), 0.81, rtol=1e-5)
    assert np.ptp(uv, axis=1).max() < 0.2


def corner_uv(data):
    """Texture coordinates at corners, wherever a format holds them."""
    if "uv" in data.on_corners:
        return data.on_corners["uv"]
    return data.find(next(name for name in data.on_vertices if "uv" in name or "TCoords" in name))


def assert_groups(data, name="group"):
    top = data.V[data.F].mean(axis=1)[:, 2] > 0
    part = data.on_faces[name].ravel()
    assert len(np.unique(part[top])) == len(np.unique(part[~top])) == 1
    assert part[top][0] != part[~top][0]


def areas(uv):
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
