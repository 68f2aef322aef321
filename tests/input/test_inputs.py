"""What `remesh` takes and refuses: one clear line for every kind of bad input, and no change to it."""

import warnings

import numpy as np
import pytest
from helpers import zoo

import remeshvec
from remeshvec import MeshInputError, OptionError, RemeshvecError, remesh

SQUARE = zoo.square()
GOOD_V = SQUARE[0].tolist()
GOOD_F = SQUARE[1].tolist()


def with_value(V, index, value):
    V = np.array(V, dtype=float)
    V[index] = value
    return V


BAD = [
    # coordinates
    (with_value(GOOD_V, (2, 1), np.nan), GOOD_F, "1 vertex (2) of V"),
    (with_value(GOOD_V, (3, 0), np.inf), GOOD_F, "1 vertex (3) of V"),
    (with_value(GOOD_V, (slice(1, 3), 0), -np.inf), GOOD_F, "2 vertices (1, 2) of V"),
    (with_value(with_value(GOOD_V, (0, 0), np.inf), (1, 0), -np.inf), GOOD_F, "(0, 1) of V"),
    ([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], "column_stack"),
    ([0, 0, 0, 1, 0, 0], [[0, 1, 2]], "V must have shape (n, 3)"),
    (np.zeros((2, 3, 3)), [[0, 1, 2]], "V must have shape (n, 3)"),
    (np.zeros((4, 4)), GOOD_F, "V must have shape (n, 3)"),
    ([[0, 0, 0], [1, 0], [0, 1, 0]], [[0, 1, 2]], "V is not a rectangular array"),
    ([["a", "b", "c"]] * 4, GOOD_F, "V must hold real numbers"),
    (np.array(GOOD_V) + 1j, GOOD_F, "V must hold real numbers; got dtype complex128"),
    (np.array(GOOD_V) > 0, GOOD_F, "V must hold real numbers; got dtype bool"),
    ([[None, 0, 0]] * 4, GOOD_F, "V is not a rectangular array"),
    (None, GOOD_F, "V is not a rectangular array"),
    (np.zeros((4, 3)), GOOD_F, "one place"),
    ([[0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, 3]], GOOD_F, "no area"),
    # faces
    (GOOD_V, [[0, 1, 4]], "1 face (0) of F name vertices outside 0 to 3"),
    (GOOD_V, [[0, 1, 2], [1, 2, 4], [3, 4, 5]], "2 faces (1, 2) of F"),
    (GOOD_V, [[1, 2, 4], [2, 3, 4]], "indices are 0-based"),
    (GOOD_V, [[0, 1, -1]], "from -1 to 1"),
    (GOOD_V, np.array([[0, 1, 2**63]], np.uint64), "1 face (0) of F"),
    (GOOD_V, [[0, 1, 2, 3]], "polygons with 4 corners; triangulate them first"),
    (GOOD_V, [[0, 1]], "F must have shape (m, 3)"),
    (GOOD_V, [0, 1, 2], "F must have shape (m, 3)"),
    (GOOD_V, [], "F is empty"),
    (GOOD_V, np.zeros((0, 3), int), "F is empty"),
    (np.zeros((0, 3)), np.zeros((0, 3), int), "F is empty"),
    (np.zeros((0, 3)), [[0, 1, 2]], "1 face (0) of F"),
    (GOOD_V, [[0, 1, 2], [0, 2]], "F is not a rectangular array"),
    (GOOD_V, [[0, 1, 2.5]], "F must hold integer vertex indices; got dtype float64"),
    (GOOD_V, [[0, 1, np.nan]], "F must hold integer"),
    (GOOD_V, [[0, 1, np.inf]], "F must hold integer"),
    (GOOD_V, [[True, False, True]], "F must hold integer vertex indices; got dtype bool"),
    (GOOD_V, [["0", "1", "2"]], "F must hold integer"),
    (GOOD_V, [[0, 1, 2j]], "F must hold integer"),
    (GOOD_V, None, "F is not a rectangular array"),
    (GOOD_V, [[0, 0, 1], [2, 2, 2]], "no face of F has three different corners"),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("V", "F", "message"), BAD)
def test_bad_meshes_are_refused_in_one_line(V, F, message):
    with pytest.raises(MeshInputError) as error:
        remesh(V, F)
    text = str(error.value)
    assert message in text
    assert "\n" not in text and len(text) < 250
    assert isinstance(error.value, RemeshvecError) and isinstance(error.value, ValueError)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "L",
    [0, 0.0, -1, -1e-9, np.nan, np.inf, -np.inf, "1", "long", [1.0], 1j, True, (), 1e-300, 1e-160],
)
def test_bad_lengths(L):
    with pytest.raises(OptionError, match=r"^L "):
        remesh(*SQUARE, L)


@pytest.mark.filterwarnings("error")
def test_too_short_a_length_is_refused_at_once():
    with pytest.raises(
        OptionError, match=r"faces, more than max_faces = 50,000,000; the mean edge"
    ):
        remesh(*SQUARE, 1e-5)
    with pytest.raises(OptionError, match="max_faces = 10"):
        remesh(*SQUARE, 0.1, max_faces=10)
    for bad in (0, -1, 2.5, True, None):
        with pytest.raises(OptionError, match="max_faces must be a whole number"):
            remesh(*SQUARE, 0.5, max_faces=bad)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("L", [10, 1e3, 1e30, 1e160, 1e300, np.float32(50), np.int64(7)])
def test_lengths_beyond_the_mesh_are_fine(L):
    for name in ("torus", "square", "tetrahedron"):
        V, F = zoo.ZOO[name].make()
        V2, F2 = remesh(V, F, L)
        assert np.isfinite(V2).all()
        assert zoo.euler_number(F2) == zoo.ZOO[name].euler


@pytest.mark.parametrize(
    "changes",
    [
        {"preset": "best"},
        {"iterations": 0},
        {"threads": 0},
        {"collapse": 2},
        {"callback": 3},
        {"foldover": 180},
    ],
)
def test_bad_options_are_refused(changes):
    with pytest.raises(OptionError, match=next(iter(changes))):
        remesh(*SQUARE, 0.5, **changes)


def test_unknown_options_are_refused():
    with pytest.raises(TypeError, match="iteratoins"):
        remesh(*SQUARE, iteratoins=3)
    with pytest.raises(TypeError):
        remesh(*SQUARE, 0.5, "fast")  # options are keyword-only


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [1e-300, 1e-150, 1e-12, 1e12, 1e150, 1e300])
def test_any_unit(size):
    V, F = zoo.torus()
    expected = remesh(V, F, 0.4)
    result = remesh(V * size, F, 0.4 * size)
    assert np.isfinite(result.V).all()
    assert zoo.euler_number(result.F) == 0
    assert len(result.F) == pytest.approx(len(expected.F), rel=0.1)
    assert result.report.target_length == pytest.approx(0.4 * size)


@pytest.mark.filterwarnings("error")
def test_denormal_and_overflowing_extents_do_not_crash():
    V, F = zoo.torus()
    for size in (1e-310, 1e-322, 1.2e308):
        try:
            result = remesh(V * size, F)
        except RemeshvecError as error:
            assert "V" in str(error) or "precision" in str(error)
        else:
            assert np.isfinite(result.V).all() and zoo.euler_number(result.F) == 0


# --- what is accepted ----------------------------------------------------------------------------


def forms(V, F):
    """The same mesh in every form a caller may hold it."""
    yield "lists", V.tolist(), F.tolist()
    yield "tuples", tuple(map(tuple, V.tolist())), tuple(map(tuple, F.tolist()))
    yield "Fortran", np.asfortranarray(V), np.asfortranarray(F)
    yield "strided", np.repeat(V, 2, axis=0)[::2], np.repeat(F, 2, axis=0)[::2]
    yield "reversed", V[::-1][::-1], F[::-1][::-1]
    for dtype in (np.int8, np.int16, np.int32, np.uint8, np.uint16, np.uint32, np.uint64, float):
        yield f"faces {np.dtype(dtype)}", V, F.astype(dtype)
    yield "big-endian", V.astype(">f8"), F.astype(">i4")
    yield "read-only", *map(read_only, (V, F))
    yield "unaligned", *map(unaligned, (V, F))


def read_only(array):
    array = array.copy()
    array.setflags(write=False)
    return array


def unaligned(array):
    raw = np.zeros(array.nbytes + 1, np.uint8)
    view = raw[1:].view(array.dtype).reshape(array.shape)
    view[:] = array
    return view


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("form", range(16))
def test_every_form_gives_the_same_mesh(form):
    V, F = zoo.icosphere(1)
    expected = remesh(V, F, 0.5)
    name, V2, F2 = list(forms(V, F))[form]
    result = remesh(V2, F2, 0.5)
    assert np.array_equal(result.V, expected.V), name
    assert np.array_equal(result.F, expected.F), name


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, np.longdouble])
def test_float_dtypes_come_back(dtype):
    V, F = zoo.icosphere(1)
    result = remesh(V.astype(dtype), F, 0.5)
    assert result.V.dtype == dtype
    same = remesh(V.astype(dtype).astype(float), F, 0.5)
    assert np.array_equal(result.F, same.F)
    assert np.array_equal(result.V, same.V.astype(dtype))


@pytest.mark.parametrize(
    "dtype", [np.int8, np.int16, np.int32, np.int64, np.uint8, np.uint32, np.uint64]
)
def test_face_dtypes_come_back(dtype):
    V, F = zoo.icosphere(1)
    assert remesh(V, F.astype(dtype), 0.5).F.dtype == dtype


def test_index_dtypes_widen_rather_than_wrap():
    V, F = zoo.icosphere(1)
    for dtype in (np.int8, np.uint8):
        result = remesh(V, F.astype(dtype), 0.1)
        assert len(result.V) > 256
        assert result.F.max() == len(result.V) - 1
        assert zoo.euler_number(result.F) == 2


def test_integer_coordinates_give_float64():
    V, F = zoo.cube()
    result = remesh(V.astype(int), F, 0.4)
    assert result.V.dtype == np.float64
    assert np.array_equal(result.V, remesh(V, F, 0.4).V)


@pytest.mark.parametrize(
    "name", ["torus", "grid", "three_half_discs", "unreferenced_vertices", "coincident_vertices"]
)
@pytest.mark.parametrize("preset", ["fast", "default", "fine"])
def test_inputs_are_never_modified(name, preset):
    V, F = zoo.ZOO[name].make()
    V32, F32 = V.astype(np.float64), F.astype(np.int32)
    for v, f in ((V, F), (V32, F32)):
        before = v.tobytes(), f.tobytes()
        result = remesh(v, f, 0.3, preset=preset)
        assert (v.tobytes(), f.tobytes()) == before
        assert not np.shares_memory(result.V, v) and not np.shares_memory(result.F, f)
        assert result.V.flags.writeable and result.F.flags.writeable


def test_unreferenced_vertices_may_be_anything():
    V, F = zoo.tetrahedron()
    dirty = np.vstack([V, [[np.nan, np.inf, 0]]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = remesh(dirty, F, 1.0)
    assert np.array_equal(result.V, remesh(V, F, 1.0).V)
    assert result.report.dirt == {"unreferenced_vertices": 1}


def test_names():
    assert remeshvec.__all__ == sorted(remeshvec.__all__)
    assert all(hasattr(remeshvec, name) for name in remeshvec.__all__)
