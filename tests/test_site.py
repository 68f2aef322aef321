"""The site builds without warnings, from this checkout alone."""

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NEEDED = ("sphinx", "myst_parser", "furo", "numpydoc", "sphinx_copybutton", "sphinxcontrib.bibtex")


def is_there(package):
    try:
        return find_spec(package) is not None
    except ModuleNotFoundError:  # of the namespace that it is in
        return False


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    absent = [package for package in NEEDED if not is_there(package)]
    if absent:
        pytest.skip(f"the site needs {', '.join(absent)}: pip install '.[docs]'")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", f"{folder}/trees"]
    done = subprocess.run(
        [*command, "docs", f"{folder}/html"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder / "html"


def test_every_page_is_built(site):
    sources = [page for page in (ROOT / "docs").rglob("*.md") if "_build" not in page.parts]
    names = {page.relative_to(ROOT / "docs").with_suffix(".html") for page in sources}
    assert not [name for name in names if not (site / name).exists()]


def test_reference_shows_docstrings(site):
    page = (site / "api" / "remeshing.html").read_text("utf-8")
    assert 'id="remeshvec.remesh"' in page
    assert "Target edge length in the units" in page
    assert 'id="remeshvec.RemeshResult.birth_face"' in page


def test_papers_are_listed(site):
    page = (site / "references.html").read_text("utf-8")
    assert "A Remeshing Approach to Multiresolution Modeling".lower() in page.lower()


def test_changes_are_included(site):
    assert "Isotropic remeshing after" in (site / "changelog.html").read_text("utf-8").replace(
        "isotropic", "Isotropic"
    )


def test_nothing_is_loaded_from_the_network(site):
    """Scripts, styles, fonts and pictures; links may lead anywhere."""
    loaded = re.compile(r'<(?:script|img|link|iframe)\b[^>]*\b(?:src|href)="https?://[^"]*"')
    for page in site.rglob("*.html"):
        assert not loaded.findall(page.read_text("utf-8")), page
    for style in site.rglob("*.css"):
        assert not re.findall(r"url\([\"']?https?:", style.read_text("utf-8")), style
