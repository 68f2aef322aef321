"""Results and records show themselves: one line, a table, a notebook's table; and go elsewhere."""

import pickle
import sys
from html.parser import HTMLParser

import numpy as np
import pytest
from helpers import zoo

from remeshvec import MeshFormatError, OptionError, quality, read_mesh, remesh
from remeshvec.files.data_files import read_data
from remeshvec.input.options import RemeshOptions

V, F = zoo.grid(6, 6)
LABELS = (V[F].mean(axis=1)[:, 0] > V[:, 0].mean()).astype(int)


@pytest.fixture(scope="module")
def result():
    return remesh(V, F, face_labels=LABELS)


def test_lines(result):
    n, m, before = len(result.V), len(result.F), len(F)
    length = f"{result.report.target_length:.4g}"
    facts = f"{before} faces -> {m}, L = {length}, preset default, {result.report.stop}>"
    assert repr(result) == f"<RemeshResult: {n} vertices, {facts}"
    assert repr(result.report) == f"<Report: {facts}"
    shown = repr(quality(V, F))
    assert shown.startswith(f"<Quality: {len(V)} vertices, {before} faces, edges of ")
    assert shown.endswith("1 boundary loops>") and "\n" not in shown
    assert repr(result.report.defects) == f"<Defects: {result.report.defects}>"
    assert repr(RemeshOptions()) == "RemeshOptions()"
    given = RemeshOptions(n_faces=9, fixed_faces=np.zeros(8, bool), split=(1.0, 2.0))
    assert repr(given) == "RemeshOptions(n_faces=9, fixed_faces=<array 8>, split=(1.0, 2.0))"


def test_a_line_measures_nothing():
    one = remesh(V, F)
    assert repr(one) and repr(one.report)
    assert "quality_before" not in vars(one.report)


def test_tables_for_people(result):
    lines = str(result.report).splitlines()
    assert result.summary() == str(result.report)
    heading = next(i for i, line in enumerate(lines) if line.split() == ["before", "after"])
    assert lines[heading - 2].startswith("target length ") and not lines[heading - 1]
    table = {line[:31].strip(): line[31:].split() for line in lines[heading + 1 :]}
    assert table["faces"] == [f"{len(F)}", f"{len(result.F)}"]
    assert set(table) == {label for label, _ in quality(V, F).rows()}
    soup = remesh(V[F].reshape(-1, 3), np.arange(F.size).reshape(-1, 3), 0.5)
    assert "note: welded vertices: " in str(soup.report)


class Cells(HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.rows = [], []

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1].append(data)


@pytest.mark.parametrize("name", ["result", "report", "quality"])
def test_tables_for_notebooks(result, name):
    shown = {"result": result, "report": result.report, "quality": quality(V, F)}[name]
    cells = Cells()
    cells.feed(shown._repr_html_())
    assert not cells.open
    table = {row[0]: row[1:] for row in cells.rows if len(row) > 1}
    both = name != "quality"
    assert table["faces"] == [f"{len(F)}", f"{len(result.F)}"][: 1 + both]
    assert 8 <= len(cells.rows) <= 10


def test_results_are_compared_by_identity(result):
    other = pickle.loads(pickle.dumps(result))
    assert result == result and result != other and len({result, other}) == 2
    assert result.report != other.report and result.report.defects != other.report.defects
    assert np.array_equal(other.V, result.V) and quality(V, F) == quality(V, F)


def test_other_names_of_the_arrays(result):
    assert result.vertices is result.V and result.faces is result.F


def test_results_become_objects(result):
    pytest.importorskip("trimesh")
    pytest.importorskip("pyvista")
    mesh, polydata = result.to_trimesh(), result.to_pyvista()
    assert np.array_equal(mesh.vertices, result.V) and np.array_equal(mesh.faces, result.F)
    assert np.array_equal(mesh.face_attributes["face_labels"], result.face_labels)
    assert np.array_equal(polydata.points, result.V)
    assert np.array_equal(polydata.regular_faces, result.F)
    assert np.array_equal(polydata.cell_data["face_labels"], result.face_labels)
    torch = pytest.importorskip("torch")
    tensors = remesh(torch.tensor(V), torch.tensor(F), face_labels=LABELS)
    assert np.array_equal(tensors.to_trimesh().vertices, result.V)
    assert np.array_equal(tensors.to_pyvista()["face_labels"], result.face_labels)


@pytest.mark.parametrize("name", ["trimesh", "pyvista"])
def test_a_library_that_is_absent_is_named(result, name, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(OptionError, match=f"to_{name} needs {name}: pip install {name}"):
        getattr(result, f"to_{name}")()


def test_results_are_saved(result, tmp_path):
    for suffix in (".ply", ".obj", ".stl"):
        result.save(tmp_path / f"a{suffix}")
    assert np.array_equal(read_mesh(tmp_path / "a.obj").V, result.V)
    data, _ = read_data(tmp_path / "a.ply")
    assert np.array_equal(data.on_faces["face_labels"], result.face_labels)
    with pytest.raises(MeshFormatError, match="suffix"):
        result.save(tmp_path / "a.txt")
