"""The layers: imports run downwards only, no cycles, short files, a light `import remeshvec`."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "remeshvec"

# Lower numbers may not import higher ones; the same number may not import itself but for `SIDEWAYS`.
LEVELS = {
    0: ["_types", "_jit", "_threads", "_check", "errors"],
    1: ["geometry"],
    2: ["halfedge", "twins", "order", "orient", "edge_sets", "bvh", "curves", "polyline", "clean"],
    3: [
        "quality", "distance", "features", "turns", "creases", "_chains", "_echo", "corners", "sizing",
        "curvature", "gradation", "mesh_data", "meshio_data", "objects", "transfer",
    ],
    4: [
        "operations", "operations.split", "operations.collapse", "operations.flip",
        "operations.relax", "operations.project", "operations.slide", "operations.unfold",
        "operations.untangle", "operations.fit", "operations.guards", "operations.siblings",
        "operations.bisect", "operations.measure", "operations.rings", "operations.templates",
    ],
    5: [
        "options", "constraints", "prepare", "lengths", "reference", "seams", "deviation",
        "report", "sweeps", "sides", "provenance", "extract", "result", "job", "remesh",
    ],
    6: [
        "laplacians", "solver", "motion", "fairing", "editing", "multiresolution", "smoothing",
        "_file_guards", "_ply_guard", "_mesh_writers", "mesh_files",
        "_obj_data", "_ply_data", "_foreign_files", "data_files", "pyvista_accessor",
        "_serving", "_workers", "_progress",
    ],
    7: [
        "evolver", "evolver.energies", "evolver.problem", "evolver.minimize",
        "evolver.necks", "evolver.evolve", "evolver.errors", "evolver.surface_evolver",
        "viz", "html_page", "_page_views", "_page_charts", "_arguments", "_array_files",
        "batch", "_batch_files", "_batch_table", "_batch_command", "cli",
    ],
    8: ["__main__"],
}  # fmt: skip
SIDEWAYS = {
    ("_check", "errors"), ("_jit", "_threads"),
    ("halfedge", "twins"), ("twins", "order"),
    ("bvh", "halfedge"), ("curves", "halfedge"), ("orient", "twins"), ("polyline", "halfedge"),
    ("polyline", "curves"),
    ("creases", "_chains"), ("creases", "_echo"), ("creases", "turns"), ("_echo", "turns"),
    ("meshio_data", "mesh_data"), ("objects", "mesh_data"), ("objects", "meshio_data"),
    ("features", "turns"), ("sizing", "curvature"), ("sizing", "gradation"),
    ("operations.collapse", "operations.guards"), ("operations.siblings", "operations.collapse"),
    ("operations.bisect", "operations.measure"), ("operations.collapse", "operations.measure"),
    ("operations.collapse", "operations.rings"), ("operations.siblings", "operations.rings"),
    ("operations.split", "operations.bisect"), ("operations.split", "operations.measure"),
    ("operations.split", "operations.templates"),
    ("operations.slide", "operations.project"),
    ("lengths", "constraints"), ("lengths", "prepare"),
    ("reference", "constraints"), ("seams", "reference"), ("deviation", "reference"),
    ("report", "options"),
    *(("sweeps", name) for name in (
        "options", "lengths", "reference", "seams", "deviation", "report",
    )),
    ("sides", "report"), ("provenance", "sides"), ("result", "report"),
    *(("extract", name) for name in (
        "constraints", "prepare", "reference", "report", "seams", "sides",
    )),
    *(("job", name) for name in ("constraints", "prepare", "lengths", "reference", "sweeps")),
    *(("remesh", name) for name in (
        "options", "constraints", "prepare", "lengths", "provenance", "sweeps", "extract", "job",
        "report", "result",
    )),
    ("fairing", "laplacians"), ("fairing", "solver"),
    ("editing", "fairing"), ("editing", "laplacians"),
    *(("multiresolution", name) for name in ("editing", "fairing", "laplacians", "motion")),
    ("smoothing", "laplacians"), ("smoothing", "solver"),
    ("_ply_guard", "_file_guards"),
    ("_foreign_files", "_workers"), ("_workers", "_serving"),
    *(("data_files", name) for name in ("_foreign_files", "_obj_data", "_ply_data", "mesh_files")),
    ("mesh_files", "_file_guards"), ("mesh_files", "_mesh_writers"), ("mesh_files", "_ply_guard"),
    ("evolver.problem", "evolver.energies"), ("evolver.minimize", "evolver.problem"),
    ("evolver.necks", "evolver.energies"),
    *(("evolver.surface_evolver", f"evolver.{name}") for name in ("errors", "minimize", "problem")),
    *(("evolver.evolve", f"evolver.{name}") for name in ("energies", "minimize", "necks", "problem")),
    *(("cli", name) for name in ("_arguments", "_array_files", "_batch_command", "html_page", "viz")),
    *(("_batch_command", name) for name in ("_arguments", "_batch_files", "_batch_table", "batch")),
    ("html_page", "_page_charts"), ("html_page", "_page_views"), ("_page_views", "viz"),
}  # fmt: skip
LEVEL = {name: level for level, names in LEVELS.items() for name in names}


def modules():
    """Module names inside the package, with their files; the package itself is left out."""
    for path in sorted(PACKAGE.rglob("*.py")):
        name = ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__")
        if name != "__init__":
            yield name, path


def imports(name, path):
    """Modules of the package that a module imports, also inside functions."""
    package = ["remeshvec", *name.split(".")]
    if path.name != "__init__.py":
        package.pop()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else []
            whole = ".".join([*base, *([node.module] if node.module else [])])
            found = [whole, *(f"{whole}.{alias.name}" for alias in node.names)]
        else:
            continue
        for target in found:
            inner = target.removeprefix("remeshvec.")
            if inner != target and inner in LEVEL:
                yield inner


ALL = dict(modules())
GRAPH = {name: set(imports(name, path)) - {name} for name, path in ALL.items()}


def test_every_module_has_a_level():
    assert set(ALL) == set(LEVEL)


def test_the_graph_is_seen():
    """The test of the test: relative imports of all kinds are found."""
    assert {"options", "prepare", "_jit", "sweeps"} <= GRAPH["remesh"]
    assert {"operations.split", "deviation", "edge_sets"} <= GRAPH["sweeps"]
    assert {"_jit", "_types", "edge_sets", "geometry", "halfedge"} <= GRAPH["operations.collapse"]
    assert "errors" in GRAPH["_check"]


@pytest.mark.parametrize("name", sorted(ALL))
def test_imports_run_downwards(name):
    for other in GRAPH[name]:
        if {other, name} & {"operations", "evolver"}:
            continue
        allowed = LEVEL[other] < LEVEL[name] or (name, other) in SIDEWAYS
        assert allowed, f"{name} (level {LEVEL[name]}) imports {other} (level {LEVEL[other]})"


def test_no_exception_is_stale():
    """Every pair in `SIDEWAYS` is an import that exists, between modules of the same level."""
    for name, other in SIDEWAYS:
        assert other in GRAPH[name] and LEVEL[name] == LEVEL[other], f"{name} -> {other}"


def test_operations_and_fields_meet_in_policy_only():
    fields = LEVELS[3]
    for name in LEVELS[4]:
        assert not GRAPH[name] & set(fields)
        operations = {other for other in GRAPH[name] if other.startswith("operations.")}
        assert all((name, other) in SIDEWAYS for other in operations)
    for name in fields:
        assert not {other for other in GRAPH[name] if other.startswith("operations")}


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


@pytest.mark.parametrize(
    "path", [*ALL.values(), *sorted((ROOT / "tests").glob("*.py"))], ids=lambda p: p.stem
)
def test_files_are_short(path):
    limit = 420 if path.is_relative_to(PACKAGE) else 520
    assert len(path.read_text().splitlines()) <= limit


def test_numba_flags_live_in_one_module():
    for name, path in ALL.items():
        if name in ("_jit", "_threads"):  # these ask Numba how many threads there are
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module:
                assert not node.module.startswith("numba"), name
            if isinstance(node, ast.Import):
                assert not any(alias.name.startswith("numba") for alias in node.names), name


def test_kernels_never_raise():
    """Kernels return a status: who calls them knows what to say."""
    for name, path in ALL.items():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef) and any(
                getattr(getattr(d, "func", d), "id", "") in ("inlined", "kernel", "threaded")
                for d in node.decorator_list
            ):
                bad = [n for n in ast.walk(node) if isinstance(n, ast.Raise | ast.Assert | ast.Try)]
                assert not bad, f"{name}.{node.name}"


def python(code, **env):
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(ROOT), **env},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_import_is_light():
    loaded = set(python("import remeshvec, sys; print(*sys.modules)"))
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
    assert {"numba", "numpy", "remeshvec.remesh"} <= loaded


def test_a_call_needs_neither_scipy_nor_libigl():
    code = (
        "import sys\n"
        "from remeshvec import remesh\n"
        "V, F = remesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], 0.5)\n"
        "print(*sys.modules)"
    )
    assert not {"scipy.sparse", "scipy.spatial", "igl"} & set(python(code))
