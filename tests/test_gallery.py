"""Every picture of the gallery can be made again, is small, and stands on the page of parameters."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("benchmarks.panels")
from docs.gallery.__main__ import FOLDER, LARGEST, NAMES, PICTURES, PLOTS, main

PAGE = Path(__file__).resolve().parents[1] / "docs" / "parameters.md"


@pytest.mark.parametrize("name", PICTURES)
def test_meshes_of_a_picture(name):
    """All but the rendering, which takes longer than remeshing."""
    if name == "return_result":
        pytest.importorskip("trimesh")
    picture = PICTURES[name]()
    assert len(picture.panels) >= 2
    captions = [panel.caption for panel in picture.panels]
    assert len(set(captions)) > 1
    for panel in picture.panels:
        assert np.isfinite(panel.V[panel.F]).all()
        assert panel.colours is None or len(panel.colours) == len(panel.F)
    first, last = picture.panels[0], picture.panels[-1]
    assert first.F.shape != last.F.shape or not np.array_equal(first.V, last.V)


@pytest.mark.parametrize("name", PLOTS)
def test_plots(name, tmp_path):
    pytest.importorskip("matplotlib")
    assert main([name, "--output", str(tmp_path)]) == 0
    assert (tmp_path / f"{name}.png").stat().st_size > 5_000


@pytest.mark.skipif(find_spec("pyvista") is None, reason="rendering needs PyVista")
def test_rendering(tmp_path):
    assert main(["boundary", "--output", str(tmp_path)]) == 0
    assert (tmp_path / "boundary.png").stat().st_size > 20_000


def test_committed_pictures_are_those_of_the_gallery():
    assert {path.stem for path in FOLDER.glob("*.png")} == set(NAMES)
    assert all(path.stat().st_size < LARGEST for path in FOLDER.glob("*.png"))
    text = PAGE.read_text("utf-8")
    assert not [name for name in NAMES if f"pictures/options/{name}.png" not in text]
