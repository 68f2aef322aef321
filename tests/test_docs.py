"""The Python of README and docs runs, and their links lead somewhere."""

import re
import warnings
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
LINK = re.compile(r"\]\((?!https?:)([^)#]+)")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    missing = [
        link for link in LINK.findall(page.read_text("utf-8")) if not (page.parent / link).exists()
    ]
    assert not missing


@pytest.mark.parametrize("name", ["README.md", "docs/modelling.md", "docs/capillary.md"])
def test_code_runs(name, monkeypatch, tmp_path, capsys):
    """From the root of a checkout, but files are written elsewhere."""
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    blocks = BLOCK.findall((ROOT / name).read_text("utf-8"))
    assert len(blocks) >= 2
    names: dict = {}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for block in blocks:
            exec(compile(block, name, "exec"), names)
    if name.endswith("capillary.md"):
        assert names["film"].history[-1]["components"] == 2
        assert names["found"].converged
    if name.endswith("modelling.md"):
        assert {"solver", "surface", "W", "moved"} <= set(names)
        assert names["surface"].V.shape[1] == 3
        assert names["heat"].max() == 1.0 and names["heat"].min() == 0.0
        assert names["curvature"].max() > 0
