"""Flags that repair and denoise before the remeshing."""

from __future__ import annotations

import numpy as np
import pytest
from helpers import zoo

from remeshvec import denoise, quality, read_mesh, remesh, repair, write_mesh
from remeshvec.cli.command import main


def raw():
    """A sphere without a face, as a soup, beside a crumb."""
    V, F = zoo.icosphere(3)
    W, G = zoo.joined((V, F[1:]), zoo.icosphere(0), shift=4.0)
    return W[G].reshape(-1, 3), np.arange(3 * len(G)).reshape(-1, 3)


@pytest.fixture
def soup(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_mesh("in.obj", *raw())
    return "in.obj"


def test_one_command_makes_a_closed_surface(soup, capsys):
    assert (
        main([soup, "-o", "out.obj", "--keep-largest", "--fill-holes", "3", "--denoise", "5"]) == 0
    )
    out = capsys.readouterr().out
    assert "note: repaired: welded vertices " in out and "filled holes 1" in out
    found = read_mesh("out.obj")
    q = quality(found.V, found.F)
    assert q.is_closed and q.components == 1
    body = repair(*read_mesh(soup)[:2], keep_largest=True, fill_holes=3)
    expected = remesh(denoise(body.V, body.F, 5), body.F)
    assert np.array_equal(found.V, expected.V) and np.array_equal(found.F, expected.F)


@pytest.mark.parametrize(
    ("flags", "components", "closed"),
    [
        (["--repair"], 2, False),
        (["--fill-holes", "all"], 2, True),
        (["--min-component", "21"], 1, False),
        (["--weld", "1e-6", "--keep-largest"], 1, False),
    ],
)
def test_each_flag_does_its_part(soup, flags, components, closed):
    assert main([soup, "-o", "out.obj", "--quiet", *flags]) == 0
    q = quality(*read_mesh("out.obj")[:2])
    assert (q.components, q.is_closed) == (components, closed)


def test_data_is_taken_along(tmp_path, monkeypatch):
    """Colours per vertex, and groups per face, where components go and a hole is filled."""
    monkeypatch.chdir(tmp_path)
    meshio = pytest.importorskip("meshio")
    V, F = zoo.joined(zoo.icosphere(3), zoo.icosphere(0), shift=4.0)
    F = F[1:]
    height = {"height": V[:, 2]}
    side = {"side": [(V[F].mean(axis=1)[:, 0] > 0).astype(int)]}
    meshio.Mesh(V, [("triangle", F)], height, side).write("in.vtu")
    assert main(["in.vtu", "-o", "out.vtu", "--keep-largest", "--fill-holes", "9", "--quiet"]) == 0
    found = meshio.read("out.vtu")
    assert quality(found.points, found.cells[0].data).is_closed
    assert found.point_data["height"] == pytest.approx(found.points[:, 2], abs=0.02)
    centre = found.points[found.cells[0].data].mean(axis=1)[:, 0]
    clear = np.abs(centre) > 0.1
    assert np.array_equal(found.cell_data["side"][0][clear], (centre > 0)[clear])


@pytest.mark.parametrize("flag", ["--fixed-vertices", "--lengths", "--selection"])
def test_files_of_numbers_do_not_go_with_a_repair(soup, capsys, flag):
    np.save("numbers.npy", np.arange(3))
    assert main([soup, "--repair", flag, "numbers.npy"]) == 2
    assert f"{flag} numbers what is in INPUT" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words", [["--fill-holes", "0"], ["--fill-holes", "some"], ["--weld", "0"]]
)
def test_bad_values_are_refused(soup, words):
    with pytest.raises(SystemExit):
        main([soup, *words])


def test_an_impossible_repair_ends_in_one_line(soup, capsys):
    assert main([soup, "--min-component", "100000"]) == 2
    assert capsys.readouterr().err.startswith("remeshvec: min_component = 100000 leaves nothing")
