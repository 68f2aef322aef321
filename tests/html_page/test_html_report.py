"""The HTML page: what is in it, that it harms and loads nothing, and how a notebook shows it."""

from __future__ import annotations

import base64
import html
import json
import os
import pickle
import re
import sys
import webbrowser
from pathlib import Path
from urllib.parse import unquote, urlparse

import numpy as np
import pytest
from helpers import zoo

import remeshvec
from data.shapes.hard import thin_ring
from remeshvec import html_page, html_report, remesh, write_html, write_mesh
from remeshvec.cli.command import main
from remeshvec.errors import MeshFormatError, OptionError, RemeshvecError
from remeshvec.html_page import views as _page_views
from remeshvec.html_page.page import _page_json
from remeshvec.measures.quality import elements, quality

pytest.importorskip("plotly")

NASTY = "</title><script>alert('a & b')</script>\"$title.obj"
TRIANGLE = ([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


@pytest.fixture(scope="module")
def result():
    return remesh(*shape(), 0.3)


def shape():
    return zoo.upsampled(*zoo.genus_2(), noise=0.2)


def data_of(page):
    return json.loads(re.search(r'id="data">(.*?)</script>', page, re.DOTALL)[1])


def array(text, dtype):
    return np.frombuffer(base64.b64decode(text), dtype)


def without_plotly(page):
    script = html_page.require_plotly().get_plotlyjs()
    assert page.count(script) == 1
    return page.replace(script, "")


def text_of(page):
    """The words of the page, without tags."""
    body = without_plotly(page).split("<body>")[1].split("<script")[0]
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", body)).split())


def test_the_page_tells_what_the_command_prints(result):
    page = html_report(result, title="a part", command="remeshvec part.obj --length 0.3")
    text = text_of(page)
    rows = zip(result.report.quality_before.rows(), result.report.quality_after.rows(), strict=True)
    for (label, old), (_, new) in rows:
        assert f"{label} {old} {new}" in text
    assert "a part" in text and "call remeshvec part.obj --length 0.3" in text
    assert f"remeshvec {remeshvec.__version__}" in text
    assert f"sweeps ended {result.report.stop}" in text
    assert "untangle angle 43.8" in text and "flip passes 2" in text
    assert f"total {result.report.seconds['total']:.4f}" in text
    first = result.report.sweeps[0]
    assert "1 " + " ".join(f"{count:,}" for count in first.values()) in text


def test_dirt_features_and_deviation_are_told():
    V, F = zoo.cube()
    dirty = np.concatenate([F, F[:1]])
    dirtied = remesh(V, dirty, 0.2, max_deviation=0.05)
    text = text_of(html_report(dirtied))
    for name, count in dirtied.report.dirt.items():
        assert f"input: {name.replace('_', ' ')} {count:,}" in text
    assert dirtied.report.dirt and "deviation to input" in text
    assert "max deviation 0.05" in text


def test_clearance_is_told():
    result = remesh(*thin_ring(0.006), 0.3)
    text = text_of(html_report(result))
    assert "clearance: vertices 400" in text and "where sheets are near" in text


def test_the_views_hold_both_meshes(result):
    scene = data_of(html_report(result))["scene"]
    assert scene["edges"] is True and len(scene["meshes"]) == 2
    for mesh, (V, F) in zip(
        scene["meshes"], (result.report.before, result.report.after), strict=True
    ):
        X = array(mesh["vertices"], "<f4").reshape(-1, 3)
        G = array(mesh["faces"], "<u4").reshape(-1, 3)
        assert len(G) == len(F) and np.linalg.norm(X, axis=1).max() <= 1 + 1e-6
        lengths, expected = (
            np.linalg.norm(P[:, 1] - P[:, 0], axis=1) for P in (X[G], np.asarray(V)[F])
        )
        ratio = lengths / expected
        np.testing.assert_allclose(ratio, np.median(ratio), rtol=1e-4)
        assert mesh["sides"] == [1]


def test_curves_that_were_kept_are_in_the_views(result):
    """As edges of the shown meshes: their lengths add up to those of the arrays."""
    meshes = data_of(html_report(result))["scene"]["meshes"]
    given = (result.report.before[0], result.input_feature_edges), (result.V, result.feature_edges)
    ratios = []
    for mesh, (V, edges) in zip(meshes, given, strict=True):
        points = array(mesh["vertices"], "<f4").reshape(-1, 3)
        shown = array(mesh["curves"], "<u4").reshape(-1, 2)
        assert len(shown) == len(edges) > 20
        length = [
            np.linalg.norm(P[E[:, 0]] - P[E[:, 1]], axis=1).sum()
            for P, E in ((points, shown), (V, edges))
        ]
        ratios.append(length[0] / length[1])
    assert ratios[0] == pytest.approx(ratios[1], rel=1e-5)


def test_colours_are_the_measures(result):
    mesh = data_of(html_report(result))["scene"]["meshes"][1]
    measured = quality(result.V, result.F, result.report.target_length)
    levels = {name: array(text, "u1") / 255 for name, text in mesh["levels"].items()}
    assert {len(level) for level in levels.values()} == {len(result.F)}
    assert levels["shape"].mean() == pytest.approx(measured.radius_ratio_mean, abs=0.003)
    assert 60 * levels["angle"].min() == pytest.approx(measured.min_angle, abs=0.2)
    areas = np.sqrt(3) / 4 * measured.target_length**2 * 2 ** (4 * levels["area"] - 2)
    assert areas.sum() == pytest.approx(measured.area, rel=0.01)


def test_histograms_count_everything(result):
    charts = data_of(html_report(result))["charts"]
    assert [chart["name"] for chart in charts] == ["Edge lengths", "Angles", "Valences", "Areas"]
    for k, measured in enumerate((result.report.quality_before, result.report.quality_after)):
        expected = (measured.edges, 3 * measured.faces, measured.inner_vertices, measured.faces)
        assert tuple(sum(chart["counts"][k]) for chart in charts) == expected
        for chart in charts:
            assert sum(chart["percent"][k]) == pytest.approx(100, abs=0.01)
    edges, angles, valences, _ = charts
    means = [np.average(edges["centres"], weights=count) for count in edges["counts"]]
    mean = result.report.quality_after.edge_mean / result.report.target_length
    assert means[1] == pytest.approx(mean, abs=edges["width"] / 2)
    assert np.average(angles["centres"], weights=angles["counts"][1]) == pytest.approx(60, abs=2)
    six = dict(zip(valences["centres"], valences["percent"][1], strict=True))[6.0]
    assert six == pytest.approx(100 * result.report.quality_after.valence6_inner, abs=0.01)


def test_elements_agree_with_quality():
    V, F = shape()
    F = np.concatenate([F, [[0, 0, 1]]])
    V = np.concatenate([V, [[9.0, 9, 9]]])
    one, all_of = elements(V, F), quality(V, F)
    assert len(one.edge_lengths) == all_of.edges and len(one.F) == all_of.faces
    assert len(one.V) == all_of.vertices
    assert one.edge_lengths.mean() == pytest.approx(all_of.edge_mean)
    assert one.areas.sum() == pytest.approx(all_of.area)
    assert one.angles.min() == all_of.min_angle
    assert one.radius_ratios.mean() == all_of.radius_ratio_mean


def test_names_cannot_break_out(result):
    page = html_report(result, title=NASTY, command=NASTY + "\udcff")
    rest = without_plotly(page)
    assert "alert('a" not in rest and html.escape(NASTY) in rest
    assert rest.count("<script") == rest.count("</script>") == 3
    page.encode()
    assert _page_json(["</script><!--"]) == '["\\u003c/script\\u003e\\u003c!--"]'


def test_nothing_is_loaded(result):
    rest = without_plotly(html_report(result))
    assert not re.search(r"https?://|//cdn|@import|url\(|\bsrc=", rest)
    assert re.findall(r'href="([^"]*)"', rest) == ["data:,"]
    assert "default-src 'none'" in rest


def test_the_same_result_gives_the_same_page(result):
    page = html_report(result, title="a")
    assert html_report(result, title="a") == page
    assert html_report(pickle.loads(pickle.dumps(result)), title="a") == page


def test_a_page_of_20000_faces_is_small(tmp_path):
    write_html(tmp_path / "a.html", twenty_thousand())
    assert os.path.getsize(tmp_path / "a.html") < 15e6


def twenty_thousand():
    """Return an even sheet of 20,000 faces, remeshed."""
    x, y = np.meshgrid(np.arange(101.0), np.arange(101.0), indexing="ij")
    a = (101 * np.arange(100)[:, None] + np.arange(100)).ravel()
    F = np.concatenate([np.c_[a, a + 101, a + 1], np.c_[a + 101, a + 102, a + 1]])
    V = np.stack([x, y, 5 * np.sin(x / 9) * np.cos(y / 7)], axis=-1).reshape(-1, 3)
    return remesh(V, F, 1.0)


def test_of_a_large_mesh_a_part_is_shown(result, monkeypatch):
    monkeypatch.setattr(_page_views, "MOST_FACES", 150)
    monkeypatch.setattr(_page_views, "MOST_EDGED", 60)
    page = html_report(result)
    scene = data_of(page)["scene"]
    counts = [len(array(mesh["faces"], "<u4")) // 3 for mesh in scene["meshes"]]
    assert max(counts) == 60 and min(counts) > 0 and scene["edges"] is True
    text = text_of(page)
    assert f"show a part of the surface, {counts[0]:,} faces before and {counts[1]:,} after" in text
    assert f"before: {len(result.report.before[1]):,} faces" in text
    for mesh in scene["meshes"]:
        n = len(array(mesh["vertices"], "<f4")) // 3
        assert 0 <= array(mesh["curves"], "<u4").max(initial=0) < n
    centres = [array(mesh["vertices"], "<f4").reshape(-1, 3) for mesh in scene["meshes"]]
    assert np.linalg.norm(centres[0].mean(axis=0) - centres[1].mean(axis=0)) < 0.3


def test_of_a_dense_mesh_edges_are_left_out(result, monkeypatch):
    monkeypatch.setattr(_page_views, "MOST_EDGED", 60)
    page = html_report(result)
    assert data_of(page)["scene"]["edges"] is False
    assert "Edges are left out because more than 60 faces are shown" in text_of(page)


@pytest.mark.parametrize("scale", [1e-150, 1.0, 1e150])
def test_one_face(scale):
    V = scale * np.array(TRIANGLE[0])
    V.flags.writeable = False
    one = remesh(V, TRIANGLE[1], 2 * scale)
    scene = data_of(html_report(one))["scene"]
    for mesh in scene["meshes"]:
        assert len(array(mesh["faces"], "<u4")) == 3 and mesh["sides"] == [1, -1]
        assert np.isfinite(array(mesh["vertices"], "<f4")).all()


def test_read_only_and_degenerate_input_is_not_touched():
    V, F = shape()
    V = np.concatenate([V, V[:1], [[np.inf, 0, 0]]])
    F = np.concatenate([F, [[0, 0, 1], [0, 1, len(V) - 2]]])
    for one in (V, F):
        one.flags.writeable = False
    before = V.copy(), F.copy()
    html_report(remesh(V, F, 0.5))
    assert np.array_equal(V, before[0]) and np.array_equal(F, before[1])


def test_files_are_whole_or_absent(result, tmp_path, monkeypatch):
    path = tmp_path / "a.htm"
    write_html(path, result, title="é")
    assert path.read_text("utf-8") == html_report(result, title="é")
    assert os.listdir(tmp_path) == ["a.htm"]
    with pytest.raises(MeshFormatError, match=r"\.html"):
        write_html(tmp_path / "a.obj", result)
    with pytest.raises(MeshFormatError, match="cannot write"):
        write_html(tmp_path / "no" / "a.html", result)
    with pytest.raises(OptionError, match="'x'"):
        write_html(path, result, up="x")
    assert os.listdir(tmp_path) == ["a.htm"]


def test_absence_of_plotly_is_named(result, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    for work in (
        lambda: html_report(result),
        lambda: write_html(tmp_path / "a.html", result),
        result.show,
    ):
        with pytest.raises(html_page.PlotlyMissingError, match="pip install plotly"):
            work()
    assert issubclass(html_page.PlotlyMissingError, RemeshvecError)
    assert main(["missing.obj", "--html", str(tmp_path / "a.html")]) == 2  # before the work
    assert "pip install plotly" in capsys.readouterr().err
    assert os.listdir(tmp_path) == []


def test_the_command_writes_a_page(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    name = "<i>a & b.obj"
    write_mesh(name, *shape())
    assert main([name, "--length", "0.5", "--html", "a.html", "--up", "z"]) == 0
    assert "written: a.html" in capsys.readouterr().out
    text = text_of(Path("a.html").read_text("utf-8"))
    assert f"call remeshvec '{name}' --length 0.5 --html a.html --up z" in text
    for arguments, words in (
        (["--html", "a.txt"], "not one of .html"),
        (
            ["-o", "a.obj", "--html", "./a.html", "--save-stats", "a.html"],
            "two outputs have the same name",
        ),
    ):
        assert main([name, *arguments]) == 2
        assert words in capsys.readouterr().err


def test_show_opens_the_browser(result, monkeypatch, tmp_path, capsys):
    opened = []
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) or len(opened) == 1)
    result.show(title="shown")
    page = Path(unquote(urlparse(opened[0]).path))
    assert page.read_text("utf-8") == html_report(result, title="shown")
    assert page.is_relative_to(tmp_path) and capsys.readouterr().out == ""
    result.show()
    assert "there is no browser" in capsys.readouterr().out


def test_show_in_a_notebook():
    """In a kernel as Jupyter starts it."""
    manager = pytest.importorskip("jupyter_client.manager")
    pytest.importorskip("ipykernel")
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[2])!r})\n"
        "from remeshvec import html_report, remesh\n"
        f"result = remesh({TRIANGLE[0]!r}, {TRIANGLE[1]!r}, 0.5)\n"
        "result.show(title='<b>')\n"
    )
    kernel, client = manager.start_new_kernel()
    messages = []
    try:
        reply = client.execute_interactive(code, timeout=120, output_hook=messages.append)
    finally:
        client.stop_channels()
        kernel.shutdown_kernel(now=True)
    assert reply["content"]["status"] == "ok", reply["content"]
    (shown,) = [m["content"]["data"] for m in messages if m["msg_type"] == "display_data"]
    frame = shown["text/html"]
    page = html.unescape(re.search(r'srcdoc="([^"]*)"', frame)[1])
    assert frame.count("<iframe") == 1 and "allow-same-origin" not in frame
    assert page.startswith("<!DOCTYPE html>") and "&lt;b&gt;" in page
    assert data_of(page)["charts"] and without_plotly(page)
