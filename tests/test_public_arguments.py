"""Every parameter of every public function refuses what cannot work, with an error that names it.

Names of `modelling` and of `evolver` have tables of their own, in tests of their own.
"""

import inspect
import re

import numpy as np
import pytest
import zoo

import remeshvec
from remeshvec import (
    Adaptive,
    BatchError,
    MeshFormatError,
    RemeshResult,
    RemeshvecError,
    html_page,
    remesh,
    viz,
)

V, F = zoo.grid(3, 3)
MESH = (V, F)
NAN, INF = float("nan"), float("inf")
HUGE = 10**400  # beyond all floats

# Values that are wrong for every parameter of a kind.
NOT_NUMBERS = [True, np.True_, "1", NAN, INF, -INF, HUGE, 1j, [1.0], {}]
NOT_POSITIVE = [*NOT_NUMBERS, 0, -1.0]
NOT_COUNTS = [True, "1", 0, -1, 1.0, 2.5, NAN, [1], {}]
NOT_FLAGS = [0, 1, "yes", [], NAN]
NOT_WORDS = ["", "x", 1, True, ["y"], {}]
NOT_TEXTS = [1, None, True, b"a", ["a"]]
NOT_PATHS = [1, None, True, b"a.obj", ["a.obj"], 2.5]
NOT_FUNCTIONS = [1, "print", True, [print]]
NOT_VERTICES = [
    None,
    3,
    "V",
    [],
    V[:, :2],
    V[0],
    [[0, 0], [1]],
    V + 1j,
    V > 0,
    np.full((9, 3), NAN),
]
NOT_FACES = [None, 3, "F", [], F[:, :2], F[0], [[0, 1], [2]], F + 0.5, F - 1, F + 9, F > 0]
NOT_INDICES = ["1", [[0], [1, 2]], [0.5], [-1], [99], [None]]
NOT_LENGTHS = [*NOT_POSITIVE, "a", V, np.full(9, NAN), np.zeros(9), [1.0, 2.0], [[1], [2, 3]]]

REMESH = {
    "V": [None, 3, "V", [], V[:, :2], V[0], V + 1j, V > 0, np.full((9, 3), NAN), object()],
    "F": [None, 3, "F", [], F[:, :2], F[0], [[0, 1], [2]], F + 0.5, F - 1, F + 9, F > 0],
    "L": [*NOT_LENGTHS, lambda points: "a", lambda points: -points[:, 0], 1e-9],
    "preset": NOT_WORDS,
    "iterations": NOT_COUNTS,
    "tol": [*NOT_NUMBERS, -0.1, 1.1],
    "split": [*NOT_NUMBERS[:8], {}, [True], ["1"], [NAN], [], -1.0, [[1.3], [1.4]], 0.1],
    "collapse": [*NOT_NUMBERS[:8], {}, [True], ["1"], [NAN], [], -1.0, [[0.7], [0.8]], 2.0],
    "foldover": [*NOT_POSITIVE, 90, 91.0],
    "sliver_check": NOT_FLAGS,
    "project": NOT_FLAGS,
    "untangle_angle": [*NOT_POSITIVE, 90, 91.0],
    "fit": NOT_FLAGS,
    "feature_angle": [True, "1", "x", NAN, INF, -1.0, 181.0, [30.0], {}],
    "feature_edges": [
        "1",
        [0.5],
        [[0, 99]],
        [[0, -1]],
        [[0, 0.5]],
        [[0, 1, 2]],
        [[0], [1, 2]],
        [[0, 8]],
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
    "max_faces": [*NOT_COUNTS, None],
    "callback": NOT_FUNCTIONS,
    "return_result": [*NOT_FLAGS, True],  # True: for arrays
}

# For every function its bad values by parameter, and arguments with which it works.
TABLE = {
    remesh: (REMESH, {"V": V, "F": F}),
    remeshvec.quality: (
        {"V": NOT_VERTICES, "F": NOT_FACES, "L": NOT_POSITIVE},
        {"V": V, "F": F},
    ),
    remeshvec.surface_distance: (
        {
            "V1": NOT_VERTICES,
            "F1": NOT_FACES,
            "V2": NOT_VERTICES,
            "F2": NOT_FACES,
            "samples": NOT_COUNTS,
        },
        {"V1": V, "F1": F, "V2": V, "F2": F},
    ),
    Adaptive: (
        {
            "tolerance": [*NOT_POSITIVE, None],
            "min_length": [*NOT_POSITIVE, 2.0],
            "max_length": [*NOT_POSITIVE, 0.1],
        },
        {"tolerance": 0.1, "min_length": 0.5, "max_length": 1.0},
    ),
    remeshvec.read_mesh: ({"path": [*NOT_PATHS, "", ".", "absent.obj", "a\0.obj", "a.txt"]}, None),
    remeshvec.write_mesh: (
        {
            "path": [*NOT_PATHS, "", ".", "absent/a.obj", "a\0.obj", "a.txt"],
            "V": NOT_VERTICES,
            "F": NOT_FACES,
        },
        {"path": "a.obj", "V": V, "F": F},
    ),
    remeshvec.remesh_file: (
        {
            "source": [*NOT_PATHS, "", "absent.obj"],
            "target": [*NOT_PATHS, "", "absent/a.obj"],
            "L": NOT_LENGTHS,
        },
        {"source": "in.obj", "target": "out.obj"},
    ),
    remeshvec.remesh_many: (
        {
            "items": [
                3,
                None,
                "a.obj",
                b"a.obj",
                True,
                [3],
                [None],
                ["absent.obj"],
                [MESH, (V, None)],
            ],
            "L": NOT_LENGTHS,
            "workers": NOT_COUNTS,
            "on_error": NOT_WORDS,
            "ordered": NOT_FLAGS,
            "progress": NOT_FLAGS,
            "timeout": NOT_POSITIVE,
        },
        {"items": [MESH], "workers": 1},
    ),
    html_page.html_report: (
        {
            "result": [None, 3, MESH, "page"],
            "title": NOT_TEXTS,
            "command": NOT_TEXTS,
            "up": NOT_WORDS,
        },
        {"result": remesh},
    ),
    html_page.write_html: (
        {
            "path": [*NOT_PATHS, "", "absent/a.html", "a.obj"],
            "result": [None, 3, MESH, "page"],
            "title": NOT_TEXTS,
            "command": NOT_TEXTS,
            "up": NOT_WORDS,
        },
        {"path": "a.html", "result": remesh},
    ),
    html_page.show_html: (
        {"result": [None, 3, MESH, "page"], "title": NOT_TEXTS, "up": NOT_WORDS},
        {"result": remesh},
    ),
    viz.picture: (
        {
            "path": [*NOT_PATHS, "", "absent/a.png", "a.gif"],
            "before": [None, 3, [V], {}, (V, None), (V, F + 9), (V[:, :2], F)],
            "after": [None, 3, [V], {}, (V, None), (V, F + 9), (V[:, :2], F)],
            "titles": [None, 3, "ab", ("a",), ("a", "b", "c"), ("a", 3)],
            "width": NOT_COUNTS,
            "up": NOT_WORDS,
        },
        {"path": "a.png", "before": MESH, "after": MESH},
    ),
    viz.show: (
        {
            "before": [None, 3, [V], {}, (V, None), (V, F + 9), (V[:, :2], F)],
            "after": [None, 3, [V], {}, (V, None), (V, F + 9), (V[:, :2], F)],
            "titles": [None, 3, "ab", ("a",), ("a", "b", "c"), ("a", 3)],
            "width": NOT_COUNTS,
            "up": NOT_WORDS,
        },
        None,
    ),
    html_page.require_plotly: ({}, None),
    viz.require_viewer: ({"window": NOT_FLAGS}, None),
    viz.three_quarter_view: (
        {
            "V": NOT_VERTICES,
            "F": NOT_FACES,
            "axes": [None, 3, "y", np.eye(2), [[1], [2, 3]], np.full((3, 3), NAN), 1j * np.eye(3)],
        },
        {"V": V, "F": F, "axes": np.eye(3)},
    ),
    RemeshResult.show: (
        {"self": [], "title": NOT_TEXTS, "up": NOT_WORDS},
        None,
    ),
    RemeshResult.transfer: (
        {
            "self": [],
            "values": [None, 3, [1.0], [[1], [2, 3]]],
            "on": NOT_WORDS,
            "method": NOT_WORDS,
        },
        {"values": V},
    ),
    RemeshResult.matrix: ({"self": [], "on": NOT_WORDS}, {}),
    RemeshResult.transfer_back: (
        {
            "self": [],
            "values": [None, 3, [1.0], [[1], [2, 3]]],
            "on": [*NOT_WORDS, "corners"],
            "method": NOT_WORDS,
        },
        None,
    ),
}

# Made by the library, to be read.
RECORDS = {"BatchItem", "MeshFile", "Quality", "RemeshResult", "Report", "SurfaceDistance"}


def public_objects():
    for place in (remeshvec, viz, html_page):
        yield from ((name, getattr(place, name)) for name in place.__all__)


def name_of(function):
    return getattr(function, "__qualname__", str(function))


@pytest.mark.parametrize(("name", "value"), list(public_objects()))
def test_every_public_function_has_a_table(name, value):
    is_error = isinstance(value, type) and issubclass(value, Exception)
    if not callable(value) or is_error or name in RECORDS:
        return
    assert value in TABLE or value.__module__.startswith("remeshvec.modelling."), name


@pytest.mark.parametrize("function", TABLE, ids=name_of)
def test_every_parameter_has_bad_values(function):
    known = inspect.signature(function).parameters
    own = [name for name, one in known.items() if one.kind is not one.VAR_KEYWORD]
    assert set(TABLE[function][0]) == set(own)


@pytest.fixture(scope="module")
def result():
    return remesh(V, F, preset="fast", iterations=1)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty folder with one mesh."""
    remeshvec.write_mesh(tmp_path / "in.obj", V, F)
    monkeypatch.chdir(tmp_path)


def called(function, arguments, result):
    """Call a function, and use up what it returns."""
    given = dict(arguments or {})
    if "self" in inspect.signature(function).parameters:
        given["self"] = result
    if given.get("result") is remesh:
        given["result"] = result
    for name, one in inspect.signature(function).parameters.items():
        if one.default is one.empty and one.kind is not one.VAR_KEYWORD and name not in given:
            given[name] = FILLERS[name]
    out = function(**given)
    return list(out) if inspect.isgenerator(out) else out


FILLERS = {"before": MESH, "after": MESH, "values": V, "path": "a.obj"}


def cases():
    for function, (bad, good) in TABLE.items():
        for name, values in bad.items():
            for value in values:
                shown = " ".join(repr(value).split())[:30]
                label = f"{name_of(function)}-{name}-{shown}"
                yield pytest.param(function, good, name, value, id=label)


@pytest.mark.parametrize(
    ("function", "good"), [(f, good) for f, (_, good) in TABLE.items() if good is not None], ids=str
)
def test_good_arguments_are_good(function, good, result):
    """Else every refusal below could be one of something else."""
    try:
        called(function, good, result)
    except (viz.ViewerMissingError, html_page.PlotlyMissingError) as error:
        pytest.skip(str(error))


@pytest.mark.parametrize(("function", "good", "name", "value"), list(cases()))
def test_bad_arguments_are_refused(function, good, name, value, result):
    with pytest.raises(RemeshvecError) as caught:
        called(function, {**(good or {}), name: value}, result)
    if not isinstance(caught.value, MeshFormatError | BatchError):  # these name files and items
        assert re.search(rf"\b{name}\b", str(caught.value)), str(caught.value)
