"""Bad values of the controls: one clear line that names the option; good ones in every form."""

import re

import numpy as np
import pytest
from helpers import zoo

from remeshvec import Adaptive, MeshInputError, OptionError, remesh

V, F = zoo.grid(5, 4)
N, M = len(V), len(F)  # 20 vertices, 24 faces

NAN, INF = float("nan"), float("inf")

BAD = [
    # lengths by vertex
    ("L", np.ones(N - 1)),
    ("L", np.ones(N + 1)),
    ("L", np.ones((N, 1))),
    ("L", np.ones(0)),
    ("L", np.zeros(N)),
    ("L", -np.ones(N)),
    ("L", np.append(np.ones(N - 1), NAN)),
    ("L", np.append(np.ones(N - 1), INF)),
    ("L", np.append(np.ones(N - 1), 0.0)),
    ("L", np.ones(N, bool)),
    ("L", np.ones(N, complex)),
    ("L", np.array(["1"] * N)),
    ("L", np.array([None] * N)),
    # lengths by place
    ("L", lambda P: np.ones(len(P) + 1)),
    ("L", lambda P: np.ones((len(P), 3))),
    ("L", lambda P: 1.0 - P[:, 0]),  # not positive everywhere
    ("L", lambda P: np.full(len(P), NAN)),
    ("L", lambda P: None),
    ("L", lambda P: "1"),
    # sizes
    ("gradation", 0.5),
    ("gradation", 0.0),
    ("gradation", -2.0),
    ("gradation", NAN),
    ("gradation", "1.5"),
    ("gradation", True),
    ("gradation", [1.5]),
    ("n_faces", 0),
    ("n_faces", -5),
    ("n_faces", 100.5),
    ("n_faces", True),
    ("n_faces", "100"),
    ("n_faces", [100]),
    ("n_vertices", 0),
    ("n_vertices", -5),
    ("n_vertices", 2.5),
    ("n_vertices", True),
    ("n_vertices", "many"),
    ("max_deviation", 0.0),
    ("max_deviation", -0.1),
    ("max_deviation", NAN),
    ("max_deviation", "0.1"),
    ("max_deviation", True),
    ("max_deviation", [0.1]),
    ("tol", -0.1),
    ("tol", NAN),
    ("tol", INF),
    ("tol", "0.02"),
    ("tol", True),
    ("tol", [0.02]),
    # features
    ("feature_angle", "automatic"),
    ("feature_angle", -5),
    ("feature_angle", 181),
    ("feature_angle", NAN),
    ("feature_angle", True),
    ("feature_angle", [20]),
    ("feature_edges", [[0, 1, 2]]),
    ("feature_edges", [0, 1]),
    ("feature_edges", [[0, N]]),
    ("feature_edges", [[-1, 0]]),
    ("feature_edges", [[0, 0]]),
    ("feature_edges", [[0, 19]]),  # opposite corners: no edge
    ("feature_edges", [[0, 1], [0, 2]]),
    ("feature_edges", [[0.5, 1]]),
    ("feature_edges", [["0", "1"]]),
    ("feature_edges", [[True, False]]),
    ("feature_edges", [[0, 1], [2]]),
    ("feature_edges", "all"),
    # held elements
    ("fixed_vertices", [N]),
    ("fixed_vertices", [0, -1]),
    ("fixed_vertices", [[0, 1]]),
    ("fixed_vertices", [0.5]),
    ("fixed_vertices", [NAN]),
    ("fixed_vertices", ["0"]),
    ("fixed_vertices", "all"),
    ("fixed_faces", [M]),
    ("fixed_faces", [-1]),
    ("fixed_faces", [[0, 1]]),
    ("fixed_faces", [0.5]),
    ("fixed_faces", np.ones(M - 1, bool)),
    ("fixed_faces", np.ones(M + 1, bool)),
    ("fixed_faces", np.ones((M, 1), bool)),
    ("fixed_faces", ["0"]),
    ("selection", [M]),
    ("selection", [-1]),
    ("selection", [[0, 1]]),
    ("selection", [0.5]),
    ("selection", np.ones(M - 1, bool)),
    ("selection", np.ones((M, 3), bool)),
    ("selection", "all"),
    # labels
    ("face_labels", np.zeros(M - 1, int)),
    ("face_labels", np.zeros(M + 1, int)),
    ("face_labels", np.zeros((M, 1), int)),
    ("face_labels", np.zeros(0, int)),
    ("face_labels", np.full(M, 0.5)),
    ("face_labels", np.full(M, NAN)),
    ("face_labels", ["a"] * M),
    ("face_labels", 3),
    # boundary
    ("boundary", "fix"),
    ("boundary", ""),
    ("boundary", "FREE"),
    ("boundary", 3),
    ("boundary", True),
    ("boundary", ["free"]),
]


def called(name, value):
    """The call with one bad option; lengths are an argument of their own."""
    if name == "L":
        return remesh(V, F, value)
    if name in ("n_faces", "n_vertices"):
        return remesh(V, F, **{name: value})
    return remesh(V, F, 0.7, **{name: value})


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("name", "value"), BAD, ids=[f"{i}-{name}" for i, (name, _) in enumerate(BAD)]
)
def test_bad_values_are_refused_in_one_line(name, value):
    with pytest.raises((OptionError, MeshInputError)) as error:
        called(name, value)
    text = str(error.value)
    assert re.search(rf"\b{name}\b", text), text
    assert "\n" not in text and len(text) < 250


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": -0.1}, "tolerance"),
        ({"tolerance": NAN}, "tolerance"),
        ({"tolerance": "fine"}, "tolerance"),
        ({"tolerance": True}, "tolerance"),
        ({"tolerance": 0.1, "min_length": 0.0}, "min_length"),
        ({"tolerance": 0.1, "min_length": -1.0}, "min_length"),
        ({"tolerance": 0.1, "min_length": NAN}, "min_length"),
        ({"tolerance": 0.1, "max_length": 0.0}, "max_length"),
        ({"tolerance": 0.1, "max_length": "long"}, "max_length"),
        ({"tolerance": 0.1, "min_length": 2.0, "max_length": 1.0}, "min_length"),
    ],
)
def test_bad_tolerances_are_refused(arguments, name):
    with pytest.raises(OptionError, match=name) as error:
        remesh(V, F, Adaptive(**arguments))
    assert "\n" not in str(error.value)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"n_faces": 100, "n_vertices": 60}, "n_faces"),
        ({"n_faces": 100, "L": 0.5}, "n_faces"),
        ({"n_vertices": 100, "L": 0.5}, "n_vertices"),
        ({"n_faces": 1000, "max_faces": 500}, "max_faces"),
        ({"n_vertices": 1000, "max_faces": 500}, "max_faces"),
    ],
)
def test_options_that_contradict_each_other(changes, name):
    with pytest.raises(OptionError, match=name):
        remesh(V, F, **changes)


def test_an_error_in_a_length_function_comes_out():
    def fail(P):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        remesh(V, F, fail)


def test_functions_of_place_get_points():
    seen = []

    def length(P):
        seen.append(P.copy())
        return np.full(len(P), 0.7)

    remesh(V, F, length)
    assert all(P.ndim == 2 and P.shape[1] == 3 and P.dtype == np.float64 for P in seen)
    # In the caller's units, on the mesh.
    assert min(P.min() for P in seen) > -1e-9 and max(P.max() for P in seen) < 4 + 1e-9


# --- what is accepted ----------------------------------------------------------------------------

LINE = np.array([[4, 5], [5, 6], [6, 7]])  # the column x = 1
GOOD = {
    "L": np.linspace(0.5, 0.9, N),
    "feature_edges": LINE,
    "fixed_vertices": np.array([5, 10]),
    "fixed_faces": np.array([0, 7]),
    "face_labels": np.arange(M) % 2,
    "selection": np.arange(0, M, 2),
}


def read_only(array):
    array = np.array(array)
    array.setflags(write=False)
    return array


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", GOOD)
def test_every_form_gives_the_same_mesh(name):
    value = GOOD[name]
    arguments = {"L": 0.7, name: value}
    expected = remesh(V, F, **arguments)
    forms = [read_only(value), np.repeat(value, 2, axis=0)[::2], np.asfortranarray(value)]
    if name != "L":
        forms += [value.astype(dtype) for dtype in (np.int8, np.int32, np.uint64, ">i4")]
        forms += [value.tolist(), tuple(map(tuple, value)) if value.ndim == 2 else tuple(value)]
    else:
        forms.append(value.astype(">f8"))
    for form in forms:
        result = remesh(V, F, **{**arguments, name: form})
        assert np.array_equal(result.V, expected.V) and np.array_equal(result.F, expected.F)


@pytest.mark.parametrize("name", GOOD)
def test_arrays_of_the_caller_are_never_modified(name):
    value = GOOD[name].copy()
    before = value.tobytes()
    remesh(V, F, **{"L": 0.7, name: value})
    assert value.tobytes() == before


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["feature_edges", "fixed_vertices", "fixed_faces"])
def test_nothing_held_is_the_same_as_none(name):
    expected = remesh(V, F, 0.7)
    shape = (0, 2) if name == "feature_edges" else 0
    for empty in (np.zeros(shape, int), []):
        result = remesh(V, F, 0.7, **{name: empty})
        assert np.array_equal(result.V, expected.V) and np.array_equal(result.F, expected.F)
        assert np.array_equal(result.vertex_map, expected.vertex_map)


def test_results_do_not_depend_on_threads():
    options = {name: value for name, value in GOOD.items() if name != "L"}
    one, two = (
        remesh(V, F, GOOD["L"], boundary="split", threads=threads, **options)
        for threads in (1, None)
    )
    for field in ("V", "F", "face_labels", "vertex_map", "face_map", "feature_edges", "lengths"):
        assert np.array_equal(getattr(one, field), getattr(two, field)), field
