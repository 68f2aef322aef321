"""The house: folders import folders below them only, files are short, `import remeshvec` is light."""

import ast
from pathlib import Path

import pytest
from helpers.processes import run_python

import remeshvec

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "remeshvec"

# From the ground up: a folder (or a file beside the folders) imports what stands on floors below its own.
FLOORS = [
    ["errors"],
    ["core"],
    ["mesh", "processes"],
    ["interop"],
    ["measures", "features", "input", "scans"],
    ["files", "sizing"],
    ["viz", "reference"],
    ["html_page", "operations"],
    ["sweeps", "output"],
    ["pipeline"],
    ["modelling", "batch"],
    ["evolver", "pyvista_accessor", "large"],
    ["__init__"],
    ["cli"],
    ["__main__"],
]
FLOOR = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
FILES = {str(p.relative_to(PACKAGE)): p for p in sorted(PACKAGE.rglob("*.py"))}


def tree_of(path):
    return ast.parse(path.read_text())


def imported(name, path):
    """Modules of the package that a file imports, also inside functions, as dotted names.

    Imports for annotations only (``if TYPE_CHECKING``) never run, so they are left out.
    """
    tree = tree_of(path)
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
    package = ["remeshvec", *Path(name).parent.parts]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name.split(".")[0] == "remeshvec")
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else []
            source = ".".join([*base, *([node.module] if node.module else [])])
            if source.split(".")[0] == "remeshvec":
                yield from (f"{source}.{a.name}" for a in node.names)


def room_of(dotted):
    """Name the folder, or the file beside the folders, that holds what a dotted name means."""
    parts = dotted.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in FLOOR else "__init__"


def file_of(dotted):
    """Name the file that a dotted name lies in: the longest part of it that is a module."""
    parts = dotted.split(".")[1:]
    for k in range(len(parts), -1, -1):
        for file in ("/".join(parts[:k]) + ".py", "/".join([*parts[:k], "__init__.py"])):
            if file in FILES:
                return file
    raise AssertionError(dotted)


GRAPH = {
    name: {file_of(dotted) for dotted in imported(name, path)} - {name}
    for name, path in FILES.items()
}


def test_every_room_has_a_floor():
    assert {name.split("/")[0].removesuffix(".py") for name in FILES} == set(FLOOR)


def test_the_graph_is_seen():
    """The test of the test: relative imports of all kinds are found."""
    assert {"input/recipe.py", "input/prepare.py", "errors.py"} <= GRAPH["pipeline/arrays.py"]
    assert "html_page/__init__.py" in GRAPH["output/result.py"]  # inside a function
    assert "core/threads.py" in GRAPH["core/compiler/decorators.py"]


@pytest.mark.parametrize("name", FILES)
def test_imports_run_downwards(name):
    here = name.split("/")[0].removesuffix(".py")
    for dotted in imported(name, FILES[name]):
        there = room_of(dotted)
        assert there == here or FLOOR[there] < FLOOR[here], f"{name} imports {dotted}"


def test_no_cycles():
    done, path = set(), []

    def visit(name):
        assert name not in path, " -> ".join([*path[path.index(name) :], name])
        if name in done:
            return
        path.append(name)
        for other in sorted(GRAPH[name]):
            visit(other)
        path.pop()
        done.add(name)

    for name in GRAPH:
        visit(name)


def test_every_folder_says_its_contract():
    for name, path in FILES.items():
        if name.endswith("/__init__.py"):
            said = ast.get_docstring(tree_of(path))
            assert said and said.splitlines()[0].endswith("."), name


@pytest.mark.parametrize(
    "path", [*FILES.values(), *sorted((ROOT / "tests").rglob("*.py"))], ids=lambda p: p.stem
)
def test_files_are_short(path):
    limit = 420 if path.is_relative_to(PACKAGE) else 520
    assert len(path.read_text().splitlines()) <= limit


def functions():
    for name, path in FILES.items():
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.FunctionDef):
                yield name, node


def is_kernel(function):
    return any(
        getattr(getattr(d, "func", d), "id", "") in ("inlined", "kernel", "threaded")
        for d in function.decorator_list
    )


def test_numba_flags_live_in_one_folder():
    for name, path in FILES.items():
        if name.startswith("core/compiler/") or name == "core/threads.py":
            continue  # the latter asks how many threads there are
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ImportFrom) and node.module:
                assert not node.module.startswith("numba"), name
            if isinstance(node, ast.Import):
                assert not any(alias.name.startswith("numba") for alias in node.names), name


def test_kernels_never_raise():
    """Kernels return a status: who calls them knows what to say."""
    for name, function in functions():
        if is_kernel(function):
            bad = [n for n in ast.walk(function) if isinstance(n, ast.Raise | ast.Assert | ast.Try)]
            assert not bad, f"{name}: {function.name}"


def test_public_names_are_those_listed():
    """`dir` shows what `__all__` lists, and every name in it is there."""
    assert set(dir(remeshvec)) == {*remeshvec.__all__, "__version__", "evolver", "html_page", "viz"}
    assert all(hasattr(remeshvec, name) for name in remeshvec.__all__)
    for folder in (remeshvec.evolver, remeshvec.viz, remeshvec.html_page):
        assert set(dir(folder)) == set(folder.__all__)


def test_import_is_light():
    loaded = set(run_python("-c", "import remeshvec, sys; print(*sys.modules)").stdout.split())
    # Numba itself imports the package scipy, to see that it is there, but none of its parts.
    parts = {"scipy.sparse", "scipy.spatial", "scipy.linalg", "scipy.special", "scipy.stats"}
    others = {
        "igl",
        "trimesh",
        "pyvista",
        "meshio",
        "plyfile",
        "matplotlib",
        "pytest",
        "vtk",
        "plotly",
    }
    assert not (parts | others) & loaded
    assert {"numba", "numpy", "remeshvec.pipeline.remesh"} <= loaded


def test_a_call_needs_neither_scipy_nor_libigl():
    code = (
        "import sys\n"
        "from remeshvec import remesh\n"
        "V, F = remesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], 0.5)\n"
        "print(*sys.modules)"
    )
    assert not {"scipy.sparse", "scipy.spatial", "igl"} & set(run_python("-c", code).stdout.split())
