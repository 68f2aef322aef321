"""Target lengths: from curvature, from the caller, and how many faces they make."""

import re
from dataclasses import FrozenInstanceError
from fractions import Fraction

import numpy as np
import pytest
from helpers import zoo
from helpers.structure import built

from remeshvec.errors import OptionError
from remeshvec.sizing.adaptive import Adaptive, adaptive_lengths, expected_faces, target_lengths


def lengths_on(V, F, tolerance, shortest=1e-9, longest=1e9, marks=None):
    mesh = built(V, F)
    marks = np.zeros(len(mesh.origin), bool) if marks is None else marks
    return adaptive_lengths(
        mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge, marks, tolerance, shortest, longest
    )


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
