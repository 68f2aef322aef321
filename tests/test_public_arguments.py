"""Every parameter of every public function refuses what cannot work, with an error that names it.

The names of `modelling` and of `evolver` have tables in tests of their own.
"""

import inspect
import re

import numpy as np
import pytest
from evolver import test_evolver_arguments
from helpers import zoo
from helpers.bad_arguments import (
    INF,
    NAN,
    NOT_COUNTS,
    NOT_FUNCTIONS,
    NOT_NUMBERS,
    NOT_PATHS,
    NOT_POSITIVE,
    NOT_TEXTS,
    NOT_WORDS,
    Entry,
    assert_complete,
    called,
    cases,
    name_of,
    public_methods,
)
from helpers.bad_arguments import NOT_FLAGS as NOT_FLAGS_OR_NONE
from modelling import test_modelling_arguments

import remeshvec
from remeshvec import (
    Adaptive,
    BatchError,
    LargeResult,
    LightResult,
    MeshFormatError,
    RemeshResult,
    RemeshvecError,
    evolver,
    html_page,
    remesh,
    viz,
)

V, F = zoo.grid(3, 3)  # 9 vertices, 8 faces
MESH = (V, F)
RECORDS = {
    "BatchItem",
    "Defects",
    "LargePart",
    "MeshFile",
    "Quality",
    "RepairReport",
    "RepairResult",
    "Report",
    "SurfaceDistance",
}  # made by the library

NOT_FLAGS = [value for value in NOT_FLAGS_OR_NONE if value is not None]
NOT_VERTICES = [
    None, 3, "V", [], V[:, :2], V[0], [[0, 0], [1]], V + 1j, V > 0, V.astype(str), np.full((9, 3), NAN),
]  # fmt: skip
NOT_FACES = [
    None, 3, "F", [], F[:, :2], F[0], [[0, 1], [2]], F + 0.5, F - 1, F + 9, F > 0, F + 1j, F.astype(str),
]  # fmt: skip
NOT_INDICES = ["1", [[0], [1, 2]], [0.5], [-1], [99], [None]]
NOT_LENGTHS = [*NOT_POSITIVE, "a", V, np.full(9, NAN), np.zeros(9), [1.0, 2.0], [[1], [2, 3]]]
NOT_FACTORS = [value for value in NOT_NUMBERS if not isinstance(value, list)]
NOT_FACTORS += [[True], ["1"], [NAN], [], -1.0, [[1.0], [1.1]]]
NOT_ANGLES = [*NOT_POSITIVE, 90, 91.0]
NOT_RESULTS = [None, 3, MESH, "page"]
NOT_MESHES = [None, 3, [V], {}, (V, None), (V, F + 9), (V[:, :2], F)]
NOT_VALUES = [None, 3, [1.0], [[1], [2, 3]]]
NOT_STORES = [value for value in NOT_PATHS if value is not None]
NOT_TITLES = [None, 3, "ab", ("a",), ("a", "b", "c"), ("a", 3)]
PAGE = {"title": NOT_TEXTS, "command": NOT_TEXTS, "up": NOT_WORDS}
PICTURE = {
    "before": NOT_MESHES,
    "after": NOT_MESHES,
    "lines": [None, 3, ([[0, 1]],), (None, [[0, 99]]), ([0, 1], None), ([[0.5, 1]], None)],
    "titles": NOT_TITLES,
    "width": NOT_COUNTS,
    "up": NOT_WORDS,
}

REMESH = {
    "V": [value for value in NOT_VERTICES if value is not V],
    "F": NOT_FACES,
    "L": [*NOT_LENGTHS, lambda points: "a", lambda points: -points[:, 0], 1e-9],
    "preset": NOT_WORDS,
    "iterations": NOT_COUNTS,
    "tol": [*NOT_NUMBERS, -0.1, 1.1],
    "split": [*NOT_FACTORS, 0.1],
    "collapse": [*NOT_FACTORS, 2.0],
    "foldover": NOT_ANGLES,
    "sliver_check": NOT_FLAGS,
    "project": NOT_FLAGS,
    "untangle_angle": NOT_ANGLES,
    "fit": NOT_FLAGS,
    "avoid_intersections": NOT_FLAGS,
    "clearance": [*NOT_POSITIVE, 1.1],
    "feature_angle": [True, "1", "x", NAN, INF, -1.0, 181.0, [30.0], {}],
    "corner_angle": [*NOT_POSITIVE, 181.0],
    "feature_edges": [
        "1", [0.5], [[0, 99]], [[0, -1]], [[0, 0.5]], [[0, 1, 2]], [[0], [1, 2]], [[0, 8]],
    ],
    "fixed_vertices": NOT_INDICES,
    "fixed_faces": [*NOT_INDICES, "a name", [True]],
    "face_labels": ["a name", 3, [1, 2], np.full(8, 0.5), [None] * 8, np.full(8, 1j)],
    "preserve": ["a name", 3, [1, 2], np.full((8, 3), NAN), {}, np.zeros((9, 3))],
    "selection": [*NOT_INDICES, "a name", [True]],
    "boundary": NOT_WORDS,
    "gradation": [*NOT_NUMBERS, 1.0, 0.5, -2.0],
    "n_faces": NOT_COUNTS,
    "n_vertices": NOT_COUNTS,
    "max_deviation": NOT_POSITIVE,
    "threads": NOT_COUNTS,
    "max_faces": [*NOT_COUNTS, None, 10**9],  # more than 32-bit indices hold
    "callback": NOT_FUNCTIONS,
    "return_result": [*NOT_FLAGS, True],  # True: arrays give the result anyway
}  # fmt: skip


def result():
    return remesh(V, F, preset="fast", iterations=1)


def large_result():
    return remeshvec.remesh_large(MESH, out="out", preset="fast", iterations=1)


TABLE = {
    remesh: Entry(REMESH, lambda: {"V": V, "F": F}),
    remeshvec.find_creases: Entry(
        {**{k: v for k, v in REMESH.items() if k != "return_result"}, "return_dropped": NOT_FLAGS},
        lambda: {"V": V, "F": F},
    ),
    remeshvec.quality: Entry(
        {"V": NOT_VERTICES, "F": NOT_FACES, "L": NOT_POSITIVE}, lambda: {"V": V, "F": F}
    ),
    remeshvec.surface_distance: Entry(
        {
            "V1": NOT_VERTICES,
            "F1": NOT_FACES,
            "V2": NOT_VERTICES,
            "F2": NOT_FACES,
            "samples": NOT_COUNTS,
        },
        lambda: {"V1": V, "F1": F, "V2": V, "F2": F},
    ),
    remeshvec.repair: Entry(
        {
            "V": NOT_VERTICES,
            "F": NOT_FACES,
            "weld": [*NOT_NUMBERS, -1.0],
            "min_component": [value for value in NOT_COUNTS if value != 0],
            "keep_largest": NOT_FLAGS_OR_NONE,
            "fill_holes": [*(value for value in NOT_COUNTS if value != 0), "none", None],
            "orient": NOT_FLAGS_OR_NONE,
        },
        lambda: {"V": V, "F": F},
    ),
    Adaptive: Entry(
        {
            "tolerance": [*NOT_POSITIVE, None],
            "min_length": [*NOT_POSITIVE, 2.0],
            "max_length": [*NOT_POSITIVE, 0.1],
        },
        lambda: {"tolerance": 0.1, "min_length": 0.5, "max_length": 1.0},
    ),
    Adaptive.limits: Entry(
        {"extent": [*NOT_NUMBERS, -1.0]}, lambda: {"self": Adaptive(0.1), "extent": 1}
    ),
    remeshvec.read_mesh: Entry(
        {"path": [*NOT_PATHS, "", ".", "absent.obj", "a\0.obj", "a.txt"]},
        lambda: {"path": "in.obj"},
    ),
    remeshvec.write_mesh: Entry(
        {
            "path": [*NOT_PATHS, "", ".", "absent/a.obj", "a\0.obj", "a.txt"],
            "V": NOT_VERTICES,
            "F": NOT_FACES,
        },
        lambda: {"path": "a.obj", "V": V, "F": F},
    ),
    remeshvec.remesh_file: Entry(
        {
            "source": [*NOT_PATHS, "", "absent.obj"],
            "target": [*NOT_PATHS, "", "absent/a.obj"],
            "L": NOT_LENGTHS,
        },
        lambda: {"source": "in.obj", "target": "out.obj"},
    ),
    remeshvec.remesh_many: Entry(
        {
            "items": [
                3, None, "a.obj", b"a.obj", True, [3], [None], ["absent.obj"], [MESH, (V, None)],
            ],
            "L": NOT_LENGTHS,
            "workers": NOT_COUNTS,
            "on_error": NOT_WORDS,
            "ordered": NOT_FLAGS,
            "progress": NOT_FLAGS,
            "timeout": NOT_POSITIVE,
            "client": [3, "tcp://127.0.0.1:8786", {}],
            "store": [*NOT_STORES, "in.obj", "in.obj/out"],
        },
        lambda: {"items": [MESH], "workers": 1},
    ),
    remeshvec.remesh_item: Entry(
        {
            "mesh": [3, None, "absent.obj", [V], {}],  # of pairs, V and F are named
            "L": NOT_LENGTHS,
            "store": [*NOT_STORES, "absent", "absent/a.npz", "in.obj"],
        },
        lambda: {"mesh": MESH},
    ),
    RemeshResult.light: Entry({}, lambda: {"self": result()}),
    LightResult.save: Entry(
        {"path": [*NOT_PATHS, "", "absent/a.npz", "a.obj"]},
        lambda: {"self": result().light(), "path": "a.npz"},
    ),
    remeshvec.remesh_large: Entry(
        {
            "source": [None, 3, "", "absent.ply", (V,), (V, F, V), ("V.npy", "F.npy")],
            "L": NOT_LENGTHS,
            "out": [*NOT_PATHS, "absent/out", "out.obj", "in.obj"],
            "scratch": [value for value in NOT_PATHS if value is not None],
            "client": [3, "tcp://host:8786", object()],
            "workers": NOT_COUNTS,
            "part_faces": [*NOT_COUNTS, 9_999],
            "resume": NOT_FLAGS,
            "progress": NOT_FLAGS,
        },
        lambda: {"source": MESH, "out": "out", "workers": 1},
    ),
    LargeResult.parts: Entry({"faces": NOT_COUNTS}, lambda: {"self": large_result()}),
    LargeResult.transfer: Entry(
        {
            "values": [*NOT_VALUES, "absent.npy"],
            "out": [3, b"a", "a.txt", "absent/a.npy"],
            "method": NOT_WORDS,
        },
        lambda: {"self": large_result(), "values": V},
    ),
    RemeshResult.show: Entry(
        {"title": NOT_TEXTS, "up": NOT_WORDS}, lambda: {"self": result()}
    ),
    RemeshResult.summary: Entry({}, lambda: {"self": result()}),
    RemeshResult.to_trimesh: Entry({}, lambda: {"self": result()}),
    RemeshResult.to_pyvista: Entry({}, lambda: {"self": result()}),
    RemeshResult.save: Entry(
        {"path": [*NOT_PATHS, "", ".", "absent/a.obj", "a\0.obj", "a.txt"]},
        lambda: {"self": result(), "path": "a.obj"},
    ),
    RemeshResult.transfer: Entry(
        {"values": NOT_VALUES, "on": NOT_WORDS, "method": NOT_WORDS},
        lambda: {"self": result(), "values": V},
    ),
    RemeshResult.transfer_back: Entry(
        {"values": NOT_VALUES, "on": [*NOT_WORDS, "corners"], "method": NOT_WORDS},
        lambda: {"self": (one := result()), "values": one.V},
    ),
    RemeshResult.matrix: Entry({"on": NOT_WORDS}, lambda: {"self": result()}),
    RemeshResult.back_matrix: Entry({}, lambda: {"self": result()}),
    html_page.html_report: Entry({"result": NOT_RESULTS, **PAGE}, lambda: {"result": result()}),
    html_page.write_html: Entry(
        {"path": [*NOT_PATHS, "", "absent/a.html", "a.obj"], "result": NOT_RESULTS, **PAGE},
        lambda: {"path": "a.html", "result": result()},
    ),
    html_page.show_html: Entry(
        {"result": NOT_RESULTS, "title": NOT_TEXTS, "up": NOT_WORDS}, lambda: {"result": result()}
    ),
    html_page.require_plotly: Entry({}, dict),
    viz.picture: Entry(
        {"path": [*NOT_PATHS, "", "absent/a.png", "a.gif"], **PICTURE},
        lambda: {"path": "a.png", "before": MESH, "after": MESH},
    ),
    viz.show: Entry(PICTURE, lambda: {"before": MESH, "after": MESH}),
    viz.require_viewer: Entry({"window": NOT_FLAGS_OR_NONE}, dict),
    viz.three_quarter_view: Entry(
        {
            "V": NOT_VERTICES,
            "F": NOT_FACES,
            "axes": [None, 3, "y", np.eye(2), [[1], [2, 3]], np.full((3, 3), NAN), 1j * np.eye(3)],
        },
        lambda: {"V": V, "F": F, "axes": np.eye(3)},
    ),
}  # fmt: skip

OTHERS = [test_modelling_arguments, test_evolver_arguments]
WINDOWS = {viz.show, html_page.show_html, RemeshResult.show}  # their good arguments open one


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty folder with one mesh."""
    remeshvec.write_mesh(tmp_path / "in.obj", V, F)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("place", [remeshvec, viz, html_page, evolver], ids=lambda m: m.__name__)
def test_every_public_function_is_in_one_table(place):
    tables = [TABLE, *(other.TABLE for other in OTHERS)]
    records = RECORDS.union(*(other.RECORDS for other in OTHERS))
    for name in place.__all__:
        value = getattr(place, name)
        is_error = inspect.isclass(value) and issubclass(value, Exception)
        if callable(value) and not is_error and name not in records:
            made = (RemeshResult, LightResult, LargeResult)  # which only the library makes
            wanted = [] if value in made else [value]
            wanted += public_methods(value) if inspect.isclass(value) else []
            for one in wanted:
                assert sum(one in table for table in tables) == 1, one


@pytest.mark.parametrize("function", TABLE, ids=name_of)
def test_every_parameter_has_bad_values(function):
    assert_complete(TABLE, function)


@pytest.mark.parametrize("function", [f for f in TABLE if f not in WINDOWS], ids=name_of)
def test_good_arguments_are_good(function):
    """Else every refusal below could be one of something else."""
    try:
        called(function, TABLE[function].good())
    except (viz.ViewerMissingError, html_page.PlotlyMissingError) as error:
        pytest.skip(str(error))


@pytest.mark.parametrize(("function", "name", "value"), list(cases(TABLE)))
def test_bad_arguments_are_refused(function, name, value):
    with pytest.raises(RemeshvecError) as caught:
        called(function, {**TABLE[function].good(), name: value})
    if not isinstance(caught.value, MeshFormatError | BatchError):  # these name files and items
        assert re.search(rf"\b{name}\b", str(caught.value)), str(caught.value)
