"""The Python of README and docs runs, their links lead somewhere, and nothing in them is out of date."""

import ast
import importlib
import inspect
import re
import warnings
from importlib.util import find_spec
from pathlib import Path

import pytest
from test_architecture import FLOOR

import remeshvec
from remeshvec import evolver, viz
from remeshvec.sweeps.loop import run_sweeps

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
SITE = [page for page in sorted(DOCS.rglob("*.md")) if "_build" not in page.parts]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *SITE]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\((?!https?:)([^)#]+)")
CITED = re.compile(r"\[+([A-Z][a-z]+)[^\[\]]*?\b((?:19|20)\d\d)\b")

# Packages that only examples need: where one is absent, a page runs up to the block that imports it.
OPTIONAL = {
    "dask",
    "distributed",
    "meshio",
    "pyvista",
    "skfem",
    "skimage",
    "torch",
    "trimesh",
}


def name_of(page):
    return str(page.relative_to(ROOT))


def blocks_of(page):
    return BLOCK.findall(page.read_text("utf-8"))


WITH_CODE = [page for page in PAGES if blocks_of(page)]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    missing = [
        link for link in LINK.findall(page.read_text("utf-8")) if not (page.parent / link).exists()
    ]
    assert not missing


def imported(block):
    """Packages that a piece of code imports."""
    names = set()
    for node in ast.walk(ast.parse(block)):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.partition(".")[0])
    return names


@pytest.mark.parametrize("page", WITH_CODE, ids=name_of)
def test_code_runs(page, monkeypatch, tmp_path):
    """From the root of a checkout, but files are written elsewhere; block after block."""
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for k, block in enumerate(blocks_of(page), 1):
        needed = sorted(imported(block) & OPTIONAL)
        absent = [package for package in needed if find_spec(package) is None]
        if absent:
            pytest.skip(f"{name_of(page)} ran up to its block {k}, which needs {', '.join(absent)}")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # those of other packages while they are imported
            for package in needed:
                importlib.import_module(package)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            exec(compile(block, f"{name_of(page)}, block {k}", "exec"), names)
    if page.name == "capillary.md":
        assert names["film"].history[-1]["components"] == 2
        assert names["found"].converged
    if page.name == "modelling.md":
        assert {"solver", "surface", "W", "moved"} <= set(names)
        assert names["surface"].V.shape[1] == 3
        assert names["heat"].max() == 1.0 and names["heat"].min() == 0.0
        assert names["curvature"].max() > 0


def test_pages_with_code_are_found():
    """The test of the test: the guides are among them, and have several blocks."""
    many = {name_of(page) for page in WITH_CODE if len(blocks_of(page)) >= 2}
    guides = {name_of(page) for page in (DOCS / "guides").glob("*.md")}
    assert len(guides) >= 5
    assert {"README.md", "docs/capillary.md", "docs/getting-started.md", *guides} <= many
    assert imported("import skfem.helpers\nfrom meshio import Mesh") == {"skfem", "meshio"}


def test_every_keyword_has_a_section_and_a_picture():
    text = (DOCS / "parameters.md").read_text("utf-8")
    sections = dict(re.findall(r"^### (\w+)\n(.*?)(?=^##|\Z)", text, re.DOTALL | re.MULTILINE))
    keywords = inspect.signature(remeshvec.remesh).parameters.keys() - {"V", "F"}
    assert keywords == set(sections)
    assert not [name for name, body in sections.items() if "![" not in body]


@pytest.mark.parametrize("module", [remeshvec, evolver, viz], ids=lambda module: module.__name__)
def test_reference_has_every_public_name(module):
    pages = "".join(page.read_text("utf-8") for page in (DOCS / "api").glob("*.md"))
    documented = set(re.findall(r"^\.\. auto\w+:: ([\w.]+)(?:\(\))?$", pages, re.MULTILINE))
    assert not {f"{module.__name__}.{name}" for name in module.__all__} - documented


def test_citations_are_in_the_bibliography():
    """By the first author's family name and the year."""
    entries = re.findall(
        r"author = \{([\w\\\"{}-]+),.*?year = \{(\d{4})\}",
        (DOCS / "references.bib").read_text("utf-8"),
        re.DOTALL,
    )
    sources = [*(ROOT / "remeshvec").rglob("*.py"), *SITE]
    cited = {
        (name, int(year))
        for path in sources
        for name, year in CITED.findall(path.read_text("utf-8"))
        if path.name not in ("benchmarks.md", "start.md")
    }
    assert len(cited) >= 10
    assert not cited - {(name, int(year)) for name, year in entries}


def test_flags_are_those_of_the_parser():
    flags = pytest.importorskip("docs.flags")
    page = flags.PAGE.read_text("utf-8")
    assert page == flags.with_flags(page), "python -m docs.flags writes them"


def test_comparison_is_that_of_the_results():
    from benchmarks.comparison import comparison_page
    from benchmarks.results import read_results

    page = (DOCS / "comparison.md").read_text("utf-8")
    assert page == comparison_page(read_results(DOCS)), "python -m benchmarks --pages writes it"


def test_architecture_page_quotes_the_loop():
    page = (DOCS / "architecture.md").read_text("utf-8")
    quoted = re.findall(r"^```py\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    assert len(quoted) == 1
    assert inspect.getsource(run_sweeps).endswith(quoted[0])
    assert quoted[0].startswith("    for sweep in schedule:\n")


def test_architecture_page_lists_all_folders():
    page = (DOCS / "architecture.md").read_text("utf-8")
    rows = re.findall(r"^\| (\d+) \| (.*?) \|", page, re.MULTILINE)
    listed = {
        room.strip("/").removesuffix(".py"): int(floor)
        for floor, rooms in rows
        for room in re.findall(r"`([\w/.]+)`", rooms)
    }
    assert listed == {room: floor for room, floor in FLOOR.items() if room != "__main__"}
