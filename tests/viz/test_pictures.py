"""Pictures: the right things are in them, and the absence of PyVista is named."""

from __future__ import annotations

import os
import sys

import numpy as np
import pytest

from remeshvec import viz
from remeshvec.errors import MeshFormatError, RemeshvecError
from remeshvec.viz import pictures

TETRAHEDRON = (
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
)


@pytest.fixture
def pyvista():
    return pytest.importorskip("pyvista")


def pixels(path):
    from PIL import Image

    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def is_drawn(image):
    """Whether a pixel is not background, below the titles."""
    return (np.abs(image - 255).max(axis=2) > 12)[image.shape[1] // 20 :]


def box(size, centre=(0, 0, 0)):
    V = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5
    F = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    F += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return V * size + centre, np.array(F)


def redness(image):
    """Share of pixels that are red, left and right."""
    red = (image[..., 0] > image[..., 1] + 80) & (image[..., 0] > image[..., 2] + 80)
    half = image.shape[1] // 2
    return red[:, :half].mean(), red[:, half:].mean()


def test_lines_are_red(pyvista, tmp_path):
    """On the mesh that they belong to, and in front of its faces."""
    V, F = box((1, 1, 1))
    rim = [[0, 1], [1, 3], [3, 2], [2, 0], [4, 5], [5, 7], [7, 6], [6, 4]]
    both = (V, F), (V, F)
    viz.picture(tmp_path / "a.png", *both, width=600)
    assert redness(pixels(tmp_path / "a.png")) == (0, 0)
    viz.picture(tmp_path / "b.png", *both, lines=(rim, None), width=600)
    left, right = redness(pixels(tmp_path / "b.png"))
    assert left > 0.003 and right == 0
    viz.picture(tmp_path / "c.png", *both, lines=(None, np.array(rim)), width=600)
    assert redness(pixels(tmp_path / "c.png")) == pytest.approx((0, left), rel=0.1)
    for wrong in (None, (rim,), ([0, 1], None), ([[0, 8]], None)):
        with pytest.raises(RemeshvecError, match="lines"):
            viz.picture(tmp_path / "d.png", *both, lines=wrong)


@pytest.mark.parametrize("suffix", viz.PICTURE_SUFFIXES)
def test_picture_shows_both_meshes_and_nothing_is_cut(suffix, pyvista, tmp_path, capfd):
    path = tmp_path / f"a{suffix}"
    viz.picture(path, box((1, 1, 1)), box((1, 1, 1)), width=600)
    image = pixels(path)
    assert image.shape[1] == 600 and 150 < image.shape[0] < 400
    drawn = is_drawn(image)
    left, right = drawn[:, :300], drawn[:, 300:]
    assert left.mean() > 0.2 and abs(left.mean() - right.mean()) < 0.02
    assert not drawn[[0, -1]].any() and not drawn[:, [0, 299, 300, -1]].any()
    assert os.listdir(tmp_path) == [path.name]
    assert capfd.readouterr() == ("", "")


def test_picture_does_not_depend_on_size_and_place(pyvista, tmp_path):
    viz.picture(tmp_path / "a.png", box((1, 2, 3)), box((1, 2, 3)), width=420)
    far = box(1e-6 * np.array([1, 2, 3]), (10, -20, 30))
    viz.picture(tmp_path / "b.png", far, far, width=420)
    a, b = pixels(tmp_path / "a.png"), pixels(tmp_path / "b.png")
    assert a.shape == b.shape
    assert (np.abs(a - b).max(axis=2) > 60).mean() < 0.01


def test_edges_are_dark_and_the_titles_name_the_meshes(pyvista, tmp_path):
    plain = (TETRAHEDRON, TETRAHEDRON)
    viz.picture(tmp_path / "a.png", *plain, width=600)
    viz.picture(tmp_path / "b.png", *plain, width=600, titles=("this", "that"))
    a, b = pixels(tmp_path / "a.png"), pixels(tmp_path / "b.png")
    assert a.min() < 110  # edges and titles; the faces are light
    band = 600 // 25
    assert (a[:band] != b[:band]).any() and (a[band + 2 :] == b[band + 2 :]).all()


@pytest.mark.parametrize(("up", "is_tall"), [("y", True), ("z", False)])
def test_the_chosen_axis_points_up(up, is_tall, pyvista, tmp_path):
    tower = box((1, 4, 1))
    viz.picture(tmp_path / "a.png", tower, tower, width=400, up=up)
    rows, columns = np.nonzero(is_drawn(pixels(tmp_path / "a.png"))[:, :200])
    assert (np.ptp(rows) > 2 * np.ptp(columns)) == is_tall


def test_degenerate_mesh_is_drawn(pyvista, tmp_path):
    point = (np.zeros((3, 3)), np.array([[0, 1, 2]]))
    viz.picture(tmp_path / "a.png", point, TETRAHEDRON, width=300)
    assert is_drawn(pixels(tmp_path / "a.png"))[:, 150:].any()


def test_camera_sees_the_broad_side_from_the_front():
    board = box((4, 2, 0.1))
    camera = viz.three_quarter_view(*board, pictures.UP["y"])
    assert camera.eye[2] > 0.8 and camera.eye[1] > 0.2
    np.testing.assert_allclose(np.cross(camera.right, camera.up), camera.eye, atol=1e-12)
    assert (
        viz.three_quarter_view(*box((4, 0.1, 4)), pictures.UP["y"]).eye[1] > 0.7
    )  # a map, from above
    assert (
        viz.three_quarter_view(*box((4, 0.1, 2)), pictures.UP["z"]).eye[1] < -0.8
    )  # y points away from us


def test_unknown_suffix_is_refused(pyvista, tmp_path):
    with pytest.raises(MeshFormatError, match=r"not one of \.png"):
        viz.picture(tmp_path / "a.gif", TETRAHEDRON, TETRAHEDRON)
    assert os.listdir(tmp_path) == []


def test_absence_of_pyvista_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    for work in (
        lambda: viz.picture(tmp_path / "a.png", TETRAHEDRON, TETRAHEDRON),
        lambda: viz.show(TETRAHEDRON, TETRAHEDRON),
    ):
        with pytest.raises(viz.ViewerMissingError, match="pip install pyvista"):
            work()
    assert issubclass(viz.ViewerMissingError, RemeshvecError)
    assert os.listdir(tmp_path) == []


def test_the_command_names_the_absence_before_the_work(tmp_path, monkeypatch, capsys):
    from remeshvec.cli.command import main

    monkeypatch.setitem(sys.modules, "pyvista", None)
    for flag in (["--picture", str(tmp_path / "a.png")], ["--visualize"]):
        assert main(["missing.obj", *flag]) == 2
        assert "pip install pyvista" in capsys.readouterr().err


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="displays are found otherwise")
def test_a_window_needs_a_display(pyvista, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(viz.ViewerMissingError, match="no display"):
        viz.show(TETRAHEDRON, TETRAHEDRON)


def test_window_has_two_linked_views(pyvista, monkeypatch):
    """What would be shown: the window itself is not opened."""
    shown = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(pyvista, "Plotter", lambda **options: _Recorded(pyvista, shown, **options))
    viz.show(TETRAHEDRON, box((1, 1, 1)))
    (plotter,) = shown
    assert len(plotter.renderers) == 2
    assert plotter.renderers[0].camera is plotter.renderers[1].camera
    assert [r.actors != {} for r in plotter.renderers] == [True, True]
    plotter.close()


_REAL = {}


def _Recorded(pyvista, shown, **options):
    plotter_class = _REAL.setdefault("class", pyvista.plotting.plotter.Plotter)
    plotter = plotter_class(**(options | {"off_screen": True}))
    plotter.show = lambda: shown.append(plotter)
    return plotter


def test_the_command_makes_a_picture(pyvista, tmp_path, monkeypatch, capsys):
    from remeshvec import write_mesh
    from remeshvec.cli.command import main

    monkeypatch.chdir(tmp_path)
    write_mesh("in.obj", *box((1, 1, 1)))
    assert main(["in.obj", "--length", "0.3", "--picture", "a.png"]) == 0
    assert sorted(os.listdir()) == ["a.png", "in.obj"]
    assert is_drawn(pixels("a.png")).mean() > 0.2
    assert min(redness(pixels("a.png"))) > 0.003, "creases before and after"
    assert "written: a.png" in capsys.readouterr().out
