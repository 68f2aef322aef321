"""Target lengths: from curvature, from the caller, how fast they grow, how many faces they make."""

import re
from dataclasses import FrozenInstanceError
from fractions import Fraction

import numpy as np
import pytest
from helpers import zoo
from helpers.structure import built
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from remeshvec.errors import OptionError
from remeshvec.sizing import gradation as gradation_module
from remeshvec.sizing.adaptive import Adaptive, adaptive_lengths, expected_faces, target_lengths
from remeshvec.sizing.gradation import _limit, _steepest, gradation_slope, limit_gradation


def arrays(mesh):
    return mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge


def lengths_on(V, F, tolerance, shortest=1e-9, longest=1e9, marks=None):
    mesh = built(V, F)
    marks = np.zeros(len(mesh.origin), bool) if marks is None else marks
    return adaptive_lengths(*arrays(mesh), marks, tolerance, shortest, longest)


def ideal(tolerance, radius):
    return np.sqrt(6 * tolerance * radius - 3 * tolerance**2)


# --- the tolerance and its bounds ----------------------------------------------------------------


def test_the_formula_is_the_height_of_a_cap():
    """An equilateral triangle with corners on the unit sphere is off by the tolerance in its middle."""
    for tolerance in (1e-3, 0.1, 0.5):
        corner = np.sqrt(1 - (1 - tolerance) ** 2)  # from the middle to a corner
        assert ideal(tolerance, 1.0) == pytest.approx(np.sqrt(3) * corner)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-3, 0.05])
@pytest.mark.parametrize("radius", [0.3, 1.0, 70.0])
def test_spheres(tolerance, radius):
    V, F = zoo.icosphere(5)
    found = lengths_on(V * radius, F, tolerance * radius)
    assert found == pytest.approx(ideal(tolerance * radius, radius), rel=0.01)


def test_flat_and_strongly_curved_take_the_bounds():
    V, F = zoo.closed_cylinder(48, 20)
    mesh = built(V, F)
    rim = np.isin(V[mesh.origin, 2], (0, 2)) & (np.abs(np.hypot(*V[mesh.origin, :2].T) - 1) < 1e-9)
    ends = np.roll(np.arange(len(rim)).reshape(-1, 3), -1, axis=1).ravel()
    marks = rim & rim[ends] & (V[mesh.origin, 2] == V[mesh.origin[ends], 2])
    marks |= marks[mesh.twin]
    found = lengths_on(V, F, 0.01, 0.02, 0.7, marks)
    assert (found[-2:] == 0.7).all()
    assert found[:-2] == pytest.approx(ideal(0.01, 1.0), rel=0.02)
    assert (lengths_on(V, F, 0.01, 0.4, 0.7, marks)[:-2] == 0.4).all()
    # A radius below half the tolerance has no length at all by the formula.
    assert (lengths_on(*zoo.icosphere(3), 2.5, 0.2, 0.7) == 0.2).all()


def test_lengths_scale_with_the_mesh():
    V, F = zoo.perturb(*zoo.torus(40, 20), 0.05)
    expected = lengths_on(V, F, 1e-3)
    for factor in (1e-5, 0.7, 1e6):
        found = lengths_on(V * factor, F, 1e-3 * factor, 1e-9 * factor, 1e9 * factor)
        assert found / factor == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(("amount", "share"), [(0.25, 0.85), (0.5, 0.75), (1.0, 0.65)])
def test_one_noisy_vertex_matters_little(amount, share):
    V, F = zoo.icosphere(4)
    expected = lengths_on(V, F, 1e-3)
    V[777] *= 1 + amount * zoo.mean_edge(V, F)
    found = lengths_on(V, F, 1e-3)
    assert found.min() > share * expected.min()
    assert (np.abs(found / expected - 1) > 0.02).sum() < 100  # of 2562


def test_noise_matters_little():
    V, F = zoo.icosphere(4)
    expected = lengths_on(V, F, 1e-3)
    found = lengths_on(*zoo.perturb(V, F, 0.1), 1e-3)
    assert np.median(found / expected) == pytest.approx(1, abs=0.07)
    assert np.quantile(found / expected, 0.01) > 0.8


def test_default_bounds():
    assert Adaptive(0.001).limits(2.0) == pytest.approx((0.003, 0.2))
    # A sphere with the box's side as its radius would have longer edges.
    assert Adaptive(0.1).limits(2.0) == pytest.approx((0.3, ideal(0.1, 2.0)))
    assert Adaptive(0.1, min_length=0.01, max_length=5).limits(2.0) == (0.01, 5.0)
    assert Adaptive(0.1, max_length=0.2).limits(2.0) == (0.2, 0.2)
    assert Adaptive(0.1, min_length=3.0).limits(2.0) == (3.0, 3.0)
    for tolerance in (1e-9, 1e-3, 1.0, 50.0):
        shortest, longest = Adaptive(tolerance).limits(2.0)
        assert 0 < shortest <= longest


def test_the_shortest_length_keeps_tips_from_exploding():
    """The tip of a cone has any curvature that its triangles are fine enough to show."""
    for n in (16, 200):
        V, F = zoo.upsampled(*zoo.cone(n), 3, 0.0)
        shortest, longest = Adaptive(1e-3).limits(2.0)
        found = lengths_on(V, F, 1e-3, shortest, longest)
        assert found.min() >= 0.003 and found.max() <= 0.2


@pytest.mark.parametrize("bad", [0, -1.0, np.nan, np.inf, True, np.True_, "0.1", None, 1j, 10**400])
@pytest.mark.parametrize("name", ["tolerance", "min_length", "max_length"])
def test_bad_bounds_are_refused(name, bad):
    if bad is None and name != "tolerance":
        return
    with pytest.raises(OptionError, match=rf"^{name} must be a positive number of units of V; got"):
        Adaptive(**{"tolerance": 0.1, name: bad})


def test_bounds_must_be_in_order_and_stay():
    with pytest.raises(OptionError, match=r"min_length = 2 is above max_length = 1\.0; swap"):
        Adaptive(0.1, 2, 1.0)
    spec = Adaptive(np.float32(0.5), Fraction(1, 3), 1)
    assert spec.limits(1.0) == pytest.approx((1 / 3, 1))
    with pytest.raises(FrozenInstanceError):
        spec.tolerance = 1.0


# --- what the caller gives -----------------------------------------------------------------------

P = np.random.default_rng(2).random((6, 3))


@pytest.mark.parametrize("value", [1, 0.5, np.float32(0.5), np.int64(3), Fraction(1, 2), 5e-324])
def test_numbers_stay_numbers(value):
    found = target_lengths(P, value)
    assert type(found) is float and found == float(value)


@pytest.mark.parametrize("value", [0, -1, np.nan, -np.inf, True, False, 10**400, Fraction(-1, 2)])
def test_bad_numbers(value):
    with pytest.raises(OptionError, match=r"^L must be a positive number of units of V; got"):
        target_lengths(P, value)


def test_arrays_and_functions():
    given = np.arange(1.0, 7.0)
    assert target_lengths(P, given) is given
    for value in (given.tolist(), given.astype(np.float32), given.astype(int), tuple(given)):
        found = target_lengths(P, value)
        assert found.dtype == np.float64 and np.array_equal(found, given)
    assert np.array_equal(target_lengths(P, lambda points: 1 + points[:, 0]), 1 + P[:, 0])
    assert np.array_equal(target_lengths(P, lambda points: list(given)), given)


def test_functions_get_a_copy():
    before = P.copy()

    def spoil(points):
        assert points.shape == P.shape and points.dtype == np.float64
        points[:] = np.nan
        return np.ones(len(points))

    target_lengths(P, spoil)
    assert np.array_equal(P, before)


BAD = {
    "short": (np.ones(5), r"have shape \(6,\).*got \(5,\)$"),
    "column": (np.ones((6, 1)), r"have shape \(6,\).*got \(6, 1\); flatten it$"),
    "square": (np.ones((6, 3)), r"got \(6, 3\)$"),
    "scalar": (np.array(1.0), r"got \(\)$"),
    "empty": ([], r"got \(0,\)$"),
    "ragged": ([[1], [1, 2], 1, 1, 1, 1], "real numbers.*got list"),
    "text": ("fine", "real numbers.*got str"),
    "texts": (["1"] * 6, "real numbers.*got dtype <U1"),
    "none": (None, "real numbers.*got NoneType"),
    "dict": ({0: 1.0}, "real numbers.*got dict"),
    "complex": (np.ones(6) * 1j, "real numbers.*got dtype complex128"),
    "bools": (np.ones(6, bool), "real numbers.*got dtype bool"),
    "zero": ([1, 1, 0, 1, 1, 1], r"not at 1 of 6 vertices \(2\), where it is 0 "),
    "negative": ([1, 1, -2, 1, 1, -3], r"not at 2 of 6 vertices \(2, 5\), where it is -2 "),
    "nan": ([np.nan] * 6, r"not at 6 of 6 vertices \(0, 1, 2, 3, 4, \.\.\.\), where it is nan"),
    "inf": ([1, 1, 1, 1, np.inf, 1], r"\(4\), where it is inf"),
    "huge": (np.full(6, np.longdouble("1e400")), r"not at 6 of 6.* inf"),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", BAD)
def test_bad_arrays_are_refused(name):
    value, message = BAD[name]
    with pytest.raises(OptionError) as error:
        target_lengths(P, value)
    assert re.search("^L must .*" + message, str(error.value))
    if callable(value) or value is None:
        return
    with pytest.raises(OptionError) as error:
        target_lengths(P, lambda points: value)
    assert re.search(r"^L\(points\) must .*" + message, str(error.value))


def test_vertices_without_a_place_may_have_any_length():
    V = P.copy()
    V[3, 1] = np.nan
    found = target_lengths(V, lambda points: 1 + points.sum(axis=1))
    assert np.isnan(found[3]) and np.isfinite(np.delete(found, 3)).all()
    with pytest.raises(OptionError, match=r"\(2\)"):
        target_lengths(V, [1, 1, np.nan, 1, 1, 1])


# --- how fast lengths may grow -------------------------------------------------------------------


def slopes(mesh, u):
    """Gradients of the linear interpolant, by least squares in every face; 0 where it has no area."""
    found = []
    for f in mesh.origin.reshape(-1, 3):
        A, d = mesh.X[f[1:], :3] - mesh.X[f[0], :3], u[f[1:]] - u[f[0]]
        has_area = np.linalg.norm(np.cross(*A)) > 1e-9 * np.linalg.norm(A, axis=1).max() ** 2
        found.append(np.linalg.norm(np.linalg.lstsq(A, d, rcond=None)[0]) if has_area else 0.0)
    return np.array(found)


def edge_slopes(mesh, u):
    a, b = mesh.origin, np.roll(mesh.origin.reshape(-1, 3), -1, axis=1).ravel()
    lengths = np.linalg.norm(mesh.X[a, :3] - mesh.X[b, :3], axis=1)
    return (np.abs(u[a] - u[b])[lengths > 0] / lengths[lengths > 0], u[a] - u[b], lengths)


def bellman_ford(mesh, u, slope):
    """Largest field below ``u`` that no edge is too steep for, slowly."""
    u = u.copy()
    heads = np.roll(mesh.origin.reshape(-1, 3), -1, axis=1).ravel()
    while True:
        before = u.copy()
        for a, b in [*zip(mesh.origin, heads, strict=True), *zip(heads, mesh.origin, strict=True)]:
            u[b] = min(u[b], u[a] + slope * np.linalg.norm(mesh.X[a, :3] - mesh.X[b, :3]))
        if np.array_equal(u, before):
            return u


def limited_by_edges(mesh, u, slope):
    u, n = u.copy(), len(u)
    heap, place = np.empty(n, np.int32), np.full(n, -1, np.int32)
    assert _limit(*arrays(mesh), slope, u, False, 10 * n, heap, place)
    assert (place == -1).all()
    return u


def random_lengths(mesh, kind, seed, size):
    rng, n = np.random.default_rng(seed), len(mesh.X)
    if kind == "spread":
        return size * 10 ** rng.uniform(-1.5, 1.5, n)
    found = np.full(n, 1e3 * size)
    found[rng.integers(0, n, 1 if kind == "point" else 3)] = size * 10 ** rng.uniform(-1, 0)
    return found


FIELDS = st.fixed_dictionaries(
    {
        "name": st.sampled_from([*zoo.TIDY, "flat_cap", "coincident_vertices"]),
        "amount": st.sampled_from([0.0, 0.1, 0.4]),
        "kind": st.sampled_from(["spread", "point", "few"]),
        "gradation": st.sampled_from([1.01, 1.2, 1.5, 3.0, 100.0]),
        "seed": st.integers(0, 10**6),
    }
)


def made(field):
    mesh = built(*zoo.perturb(*zoo.ZOO[field["name"]].make(), field["amount"], field["seed"]))
    size = zoo.mean_edge(mesh.X[:, :3], mesh.origin.reshape(-1, 3))
    return mesh, random_lengths(mesh, field["kind"], field["seed"], size)


def test_slope_and_gradation():
    """Lengths at the ends of an edge of 4/3 of their mean, if they differ by the slope."""
    for gradation in (1.01, 1.5, 4.0):
        ends = 1.0, gradation
        assert gradation - 1 == pytest.approx(gradation_slope(gradation) * 4 / 3 * np.mean(ends))


@given(FIELDS)
def test_limited_fields(field):
    mesh, given_lengths = made(field)
    before, slope = given_lengths.copy(), gradation_slope(field["gradation"])
    found = limit_gradation(*arrays(mesh), given_lengths, field["gradation"])
    assert np.array_equal(given_lengths, before)
    assert (found <= before).all() and found.min() == before.min()
    assert slopes(mesh, found).max() <= slope * (1 + 1e-9) + 1e-12
    _, steps, lengths = edge_slopes(mesh, found)
    assert (np.abs(steps) <= slope * lengths * (1 + 1e-9) + 1e-14 * found.max()).all()
    again = limit_gradation(*arrays(mesh), found, field["gradation"])
    assert again.tobytes() == found.tobytes()


@given(FIELDS)
def test_edges_alone_are_the_naive_twin(field):
    mesh, lengths = made(field)
    slope = gradation_slope(field["gradation"])
    expected = bellman_ford(mesh, lengths, slope)
    assert limited_by_edges(mesh, lengths, slope) == pytest.approx(expected, rel=1e-12)
    assert (limit_gradation(*arrays(mesh), lengths, field["gradation"]) <= expected * 1.0001).all()


def test_edges_alone_are_not_enough():
    """From one vertex of a grid, edge by edge, the slope inside faces is up to 1.41 of that allowed."""
    mesh = built(*zoo.grid(15, 15))
    lengths = np.full(225, 100.0)
    lengths[112] = 0.1
    slope = gradation_slope(1.5)
    assert slopes(mesh, limited_by_edges(mesh, lengths, slope)).max() > 1.3 * slope


def largest_sum(mesh, lengths, slope, directions=32):
    """Largest sum of a limited field, by linear programming with 32 directions of the gradient."""
    F, n = mesh.origin.reshape(-1, 3), len(lengths)
    rows = []
    for f in F:
        T = mesh.X[f, :3]
        A = T[1:] - T[0]
        u = A[0] / np.linalg.norm(A[0])
        w = np.cross(np.cross(A[0], A[1]), u)
        w /= np.linalg.norm(w)
        G = np.linalg.inv(A @ np.stack([u, w], axis=1)) @ [[-1, 1, 0], [-1, 0, 1]]
        for angle in zoo.turn(directions):
            row = np.zeros(n)
            row[f] = np.array([np.cos(angle), np.sin(angle)]) @ G
            rows.append(row)
    bounds = np.stack([np.full(n, lengths.min()), lengths], axis=1)
    return -linprog(-np.ones(n), np.array(rows), np.full(len(rows), slope), bounds=bounds).fun


@pytest.mark.parametrize("name", ["icosphere", "planar_delaunay", "torus", "bipyramid", "l_prism"])
@pytest.mark.parametrize("kind", ["spread", "point"])
def test_nearly_the_largest_field(name, kind):
    mesh, lengths = made({"name": name, "amount": 0.0, "kind": kind, "seed": 4})
    found = limit_gradation(*arrays(mesh), lengths, 1.5)
    assert found.sum() > 0.9 * largest_sum(mesh, lengths, gradation_slope(1.5))


def test_linear_fields_at_the_limit_stay():
    """In whatever direction, on whatever triangles; a little steeper, and they are lowered."""
    V, F = zoo.planar_delaunay(400)
    mesh = built(V, F)
    slope = gradation_slope(1.4)
    for angle in zoo.turn(7):
        lengths = 2 + slope * (V[:, :2] @ [np.cos(angle), np.sin(angle)])
        assert np.array_equal(limit_gradation(*arrays(mesh), lengths, 1.4), lengths)
        steeper = 2 + (1 + 1e-8) * (lengths - 2)
        assert (limit_gradation(*arrays(mesh), steeper, 1.4) < steeper).mean() > 0.5


def test_rounding_in_faces_without_height_lowers_nothing():
    V, F = zoo.upsampled(*zoo.flat_cap(), 3, 0.0)
    mesh = built(zoo.rotate(V), F)
    for angle in zoo.turn(7):
        lengths = 2 + 0.99 * gradation_slope(1.4) * (V[:, :2] @ [np.cos(angle), np.sin(angle)])
        assert np.array_equal(limit_gradation(*arrays(mesh), lengths, 1.4), lengths)


def test_growth_goes_with_the_distance_on_the_surface():
    V, F = zoo.icosphere(4)
    mesh = built(V, F)
    lengths = np.full(len(V), 10.0)
    lengths[50] = 0.05
    found = limit_gradation(*arrays(mesh), lengths, 1.5)
    away = np.arccos(np.clip(V @ V[50], -1, 1))
    expected = 0.05 + gradation_slope(1.5) * away
    assert (found <= expected * 1.01).all()
    assert (found / expected).min() > 0.75 and (found / expected).mean() > 0.9


def test_lengths_scale_with_the_mesh_when_limited():
    mesh, lengths = made({"name": "torus", "amount": 0.1, "kind": "spread", "seed": 1})
    expected = limit_gradation(*arrays(mesh), lengths, 1.3)
    mesh.X[:] *= 2.0**-20
    assert np.array_equal(
        limit_gradation(*arrays(mesh), lengths * 2.0**-20, 1.3), expected * 2.0**-20
    )


def test_what_is_left_when_visits_run_out(monkeypatch):
    monkeypatch.setattr(gradation_module, "_VISITS", 0)
    for kind in ("spread", "point"):
        mesh, lengths = made({"name": "torus", "amount": 0.4, "kind": kind, "seed": 1})
        found = limit_gradation(*arrays(mesh), lengths, 1.5)
        assert (found <= lengths).all() and found.min() == lengths.min()
        assert 0.99 < slopes(mesh, found).max() / gradation_slope(1.5) <= 1 + 1e-9


def test_visits_are_few_on_slivers():
    """Every edge of a squeezed, perturbed torus is a sliver's; ten visits a vertex are enough."""
    V, F = zoo.perturb(*zoo.torus(60, 30), 0.4)
    V[:, 2] *= 1e-3
    mesh = built(V, F)
    lengths = random_lengths(mesh, "spread", 0, 0.1)
    slope, n = gradation_slope(1.5), len(V)
    found = limited_by_edges(mesh, lengths, slope)
    heap, place = np.empty(n, np.int32), np.full(n, -1, np.int32)
    assert _limit(*arrays(mesh), slope, found, True, 10 * n, heap, place)
    assert _steepest(mesh.X, mesh.origin, found) <= slope * (1 + 1e-9)


# --- how many faces they make --------------------------------------------------------------------


def sampled_faces(mesh, lengths, n=200):
    """The same integral from the middles of n^2 small triangles a face."""
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    low, high = i + j < n, i + j < n - 1
    B = np.vstack([
        np.stack([i[low] + 1 / 3, j[low] + 1 / 3], axis=1),
        np.stack([i[high] + 2 / 3, j[high] + 2 / 3], axis=1),
    ]) / n  # fmt: skip
    total = 0.0
    for f in mesh.origin.reshape(-1, 3):
        T, u = mesh.X[f, :3], lengths[f]
        area = 0.5 * np.linalg.norm(np.cross(T[1] - T[0], T[2] - T[0]))
        at = u[0] + B @ (u[1:] - u[0])
        total += area * (1 / (np.sqrt(3) / 4 * at**2)).mean()
    return total


def test_constant_lengths_make_equilateral_faces():
    mesh = built(*zoo.cube())
    assert expected_faces(mesh.X, mesh.origin, np.full(8, 0.1)) == pytest.approx(
        6 / (np.sqrt(3) / 4 * 0.01)
    )


@pytest.mark.parametrize("spread", [0.0, 1e-15, 1e-12, 1e-5, 4e-4, 0.0012, 0.1, 1.0])
def test_varying_lengths_are_integrated(spread):
    mesh = built(*zoo.ZOO["l_prism"].make())
    lengths = 0.3 * 10 ** (spread * np.random.default_rng(1).uniform(-1, 1, len(mesh.X)))
    expected = sampled_faces(mesh, lengths)
    tolerance = 2e-6 if spread < 0.01 else 2e-3
    assert expected_faces(mesh.X, mesh.origin, lengths) == pytest.approx(expected, rel=tolerance)


def test_two_equal_lengths_in_a_face():
    mesh = built(*zoo.triangle())
    for lengths in ([1.0, 1.0, 3.0], [3.0, 1.0, 3.0], [1.0, 3.0, 3.0 + 1e-12]):
        expected = sampled_faces(mesh, np.array(lengths))
        found = expected_faces(mesh.X, mesh.origin, np.array(lengths))
        assert found == pytest.approx(expected, rel=1e-4)
