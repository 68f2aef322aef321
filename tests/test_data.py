"""The committed meshes are what data/README.md says."""

import hashlib
import re

import igl
import numpy as np
import pytest
from helpers import zoo
from helpers.processes import run_python

from data.shapes.bracket import bracket
from data.shapes.sculpted import linked_rings, thin_sheet, wavy_sheet

TABLE = {
    name: ([int(number.replace(",", "")) for number in counts.split("|")], checksum)
    for name, counts, checksum in re.findall(
        r"^\| (\S+) \|((?: -?[\d,]+ \|){4} \d+) \| `([0-9a-f]{64})` \|$",
        (zoo.DATA / "README.md").read_text(encoding="utf-8"),
        flags=re.MULTILINE,
    )
}
NAMES = list(TABLE)


def test_the_table_lists_the_files():
    files = {path.name for path in zoo.DATA.iterdir() if path.suffix in (".obj", ".off")}
    assert set(NAMES) == files
    assert len(files) == 7


@pytest.mark.parametrize("name", NAMES)
def test_checksum_and_size(name):
    content = (zoo.DATA / name).read_bytes()
    assert hashlib.sha256(content).hexdigest() == TABLE[name][1]
    assert len(content) < 1_000_000


@pytest.mark.parametrize("name", NAMES)
def test_counts(name):
    V, F = zoo.read(zoo.DATA / name)
    loops, parts = len(zoo.boundary_loops(F)), zoo.components(F)
    assert [len(V), len(F), zoo.euler_number(F), loops, parts] == TABLE[name][0]


@pytest.mark.parametrize("name", NAMES)
def test_tidy(name):
    V, F = zoo.read(zoo.DATA / name)
    assert igl.is_edge_manifold(F) and igl.is_vertex_manifold(F).all()
    assert zoo.is_oriented(F)
    assert zoo.degenerate_faces(V, F) == zoo.duplicate_faces(F) == zoo.unreferenced(V, F) == 0
    if zoo.is_closed(F):
        assert zoo.volume(V, F) > 0


def test_genus_3_and_four_loops():
    assert TABLE["pretzel.off"][0][2:] == [2 - 2 * 3, 0, 1]
    assert TABLE["wavy_sheet.obj"][0][2:] == [1 - 3, 4, 1]
    assert TABLE["linked_rings.off"][0][4] == 2


def test_thin_sheet_is_thinner_than_its_edges():
    V, F = zoo.read(zoo.DATA / "thin_sheet.obj")
    top, bottom = V[: len(V) // 2], V[len(V) // 2 :]
    above = F[F.max(axis=1) < len(top)]
    distance = np.sqrt(igl.point_mesh_squared_distance(bottom, V, above)[0])
    assert distance.max() < 0.25 * zoo.mean_edge(V, F)
    assert distance.min() > 0.1 * zoo.mean_edge(V, F)


def test_bracket_faces_lie_in_their_planes():
    V, F = zoo.read(zoo.DATA / "bracket.obj")
    for axis, level in ((0, 0), (0, 8), (0, 80), (1, 0), (1, 50), (2, 0), (2, 8)):
        assert (V[F][:, :, axis] == level).all(axis=1).any(), (axis, level)
    hole = np.pi * 6**2 * 8 * np.sin(np.pi / 20) / (np.pi / 20)  # a 40-gon
    base_and_wall = 80 * 50 * 8 + 8 * 27 * 50 + 8 * np.pi * 25**2 / 2
    eye, fillet = 8 * np.pi * 12**2, (1 - np.pi / 4) * 6**2 * 50
    assert zoo.volume(V, F) == pytest.approx(base_and_wall - 2 * hole - eye + fillet, rel=1e-3)


@pytest.mark.parametrize("make", [bracket, wavy_sheet, linked_rings, thin_sheet])
def test_made_again(make):
    path = next(zoo.DATA.glob(f"{make.__name__}.*"))
    V, F = make()
    assert np.array_equal(F, zoo.read(path)[1])
    assert np.allclose(V, zoo.read(path)[0], rtol=0, atol=6e-6)


@pytest.mark.slow
def test_the_script_makes_the_same_bytes():
    run_python(zoo.DATA / "make_meshes.py", "--check")
