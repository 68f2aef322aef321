"""Fair regions: analytic solutions on flat, cylindrical and spherical patches, order of continuity."""

import numpy as np
import pytest
from helpers import zoo

from remeshvec import MeshInputError, OptionError, SingularSystemError, fair, remesh
from remeshvec.modelling.fairing import Polyharmonic


def sheet(n, uneven=0.0):
    """Unit square, n cells a side, and its distance from the border in cells."""
    V, F = zoo.grid(n + 1, n + 1)
    V = V / n
    inner = (np.abs(V[:, :2] - 0.5) < 0.499).all(axis=1)
    V[inner, :2] += np.random.default_rng(0).uniform(-uneven, uneven, (inner.sum(), 2)) / n
    return V, F


def tube(n):
    """Regular tube around z, radius 1, half-height 2, with square cells."""
    V, F = zoo.cylinder(n, 1 + round(4 * n / (2 * np.pi)))
    V[:, 2] = 2 * V[:, 2] - 2
    return V, F


def dome(level):
    V, F = zoo.icosphere(level)
    return V / np.linalg.norm(V, axis=1)[:, None], F


def on_sheet(k):
    """A polyharmonic polynomial that is not of a smaller order."""
    return lambda V: ((V[:, 0] ** 2 + V[:, 1] ** 2) ** (k - 1)) * (1 + V[:, 0])


def on_tube(k):
    """``z^(k-1) cosh z cos t``, or sinh where that is even: solves ``(d2/dz2 - 1)^k f = 0``."""
    f = (np.cosh, lambda z: z * np.sinh(z), lambda z: z**2 * np.cosh(z))[k - 1]
    return lambda V: f(V[:, 2]) * V[:, 0]


def on_dome(k):
    """Functions of the colatitude t: tan(t/2) cos, and -log(1 + cos t), whose Laplacian is 1."""
    if k == 1:
        return lambda V: V[:, 0] / np.maximum(1 + V[:, 2], 0.1)
    return lambda V: -np.log(np.maximum(1 + V[:, 2], 0.1))  # the south pole is far


CASES = {
    **{f"sheet {k}": (lambda n: sheet(2 * n), on_sheet, k) for k in (1, 2, 3)},
    **{f"tube {k}": (lambda n: tube(4 * n), on_tube, k) for k in (1, 2, 3)},
    **{f"dome {k}": (lambda n: dome({8: 3, 16: 4, 32: 5}[n]), on_dome, k) for k in (1, 2)},
}


def region_of(name, V):
    if name.startswith("sheet"):
        return (np.abs(V[:, :2] - 0.5) < 0.26).all(axis=1)
    return np.abs(V[:, 2]) < 1 if name.startswith("tube") else V[:, 2] > 0.3


@pytest.mark.parametrize("name", CASES)
def test_analytic_solutions(name):
    """Fields with the right values outside get them inside, with an error that falls as h^2."""
    make, field, k = CASES[name]
    errors = []
    for n in (8, 16, 32):
        V, F = make(n)
        exact = field(k)(V)
        free = region_of(name, V)
        assert 0.1 < free.mean() < 0.6
        given = np.where(free, 0.0, exact)[:, None]
        found = Polyharmonic(V, F, free, k).solve(given)[:, 0]
        assert np.array_equal(found[~free], exact[~free])
        errors.append(np.abs(found - exact).max() / np.ptp(exact))
    assert errors[-1] < 0.004
    if errors[-1] > 1e-10:  # regular sheets have none
        assert errors[0] / errors[-1] > 8, errors


@pytest.mark.parametrize("area", ["voronoi", "uniform"])
@pytest.mark.parametrize("k", [1, 2, 3])
def test_bumps_on_flat_parts_vanish(k, area):
    V, F = sheet(24, uneven=0.2)
    free = (np.abs(V[:, :2] - 0.5) < 0.3).all(axis=1)
    bumpy = V.copy()
    bumpy[free, 2] += 0.05 * np.sin(9 * V[free, 0])
    W = fair(bumpy, F, free, k, area=area)
    assert np.array_equal(W[~free], bumpy[~free])
    assert W[:, 2] == pytest.approx(0, abs=1e-10)
    assert np.array_equal(fair(bumpy, F, np.flatnonzero(free), k, area=area), W)
    # Positions in the plane are linear, and stay where all is flat.
    assert fair(V, F, free, k) == pytest.approx(V, abs=1e-8 if area == "voronoi" else 0.1)


def step_profile(n, k):
    """Heights along x of a sheet that is 0 for x < 0 and 1 for x > 1."""
    rows = 5
    V, F = zoo.grid(3 * n + 1, rows)
    V = V * [1 / n, 1 / n, 0] - [1, 0, 0]
    free = (V[:, 0] > 1e-9) & (V[:, 0] < 1 - 1e-9)
    values = (V[:, :1] > 0.5).astype(float)
    z = Polyharmonic(V, F, free, k).solve(values)[:, 0]
    z = z.reshape(3 * n + 1, rows)
    assert np.abs(z - z[:, :1]).max() < 1e-7
    return z[:, 0]


@pytest.mark.parametrize("k", [1, 2, 3])
def test_order_of_continuity(k):
    """One-sided differences across the border: k = 1, 2, 3 join with C0, C1, C2 and not more."""
    jumps = []
    for n in (16, 32, 64):
        z, h = step_profile(n, k), 1 / n
        right, left = z[n : n + 5], z[n::-1][:5]
        jumps.append(
            [
                abs(np.diff(right, i + 1)[0] - (-1) ** (i + 1) * np.diff(left, i + 1)[0])
                / h ** (i + 1)
                for i in range(3)
            ]
        )
    jumps = np.array(jumps)  # of slope, curvature, third derivative
    analytic = [1.0, 6.0, 60.0][k - 1]
    for i in range(k - 1):  # vanish
        assert jumps[2, i] < 0.75 * jumps[1, i] < 0.75**2 * jumps[0, i]
    # The first that does not tends to that of the polynomial of degree 2 k - 1.
    assert jumps[2, k - 1] == pytest.approx(analytic, rel=0.3)
    assert abs(jumps[2, k - 1] - analytic) <= 0.6 * abs(jumps[0, k - 1] - analytic) + 1e-9


def test_orders_on_an_irregular_mesh():
    """The profile of each order, on a remeshed sheet."""
    V, F = remesh(*sheet(40), 0.02)
    free = (V[:, 0] > 0.25) & (V[:, 0] < 0.75)
    s = np.clip((V[:, 0] - 0.25) / 0.5, 0, 1)
    inner = free & (np.abs(V[:, 1] - 0.5) < 0.3)
    profiles = {1: s, 2: 3 * s**2 - 2 * s**3, 3: 10 * s**3 - 15 * s**4 + 6 * s**5}
    for k, exact in profiles.items():
        z = Polyharmonic(V, F, free, k).solve((V[:, :1] > 0.5).astype(float))[:, 0]
        assert np.abs(z - exact)[inner].max() < 0.06
        others = [np.abs(z - other)[inner].max() for j, other in profiles.items() if j != k]
        assert min(others) > 1.3 * np.abs(z - exact)[inner].max()


def test_iterations_lead_to_a_minimal_surface():
    """A catenoid between two rings: r = a cosh(z / a)."""
    V, F = tube(96)
    free = np.abs(V[:, 2]) < 0.45
    a = 1.0
    for _ in range(100):
        a = 1 / np.cosh(0.45 / a)
    rows = np.unique(V[free, 2])
    W = fair(V, F, free, 1, iterations=30)
    radius = np.linalg.norm(W[free][:, :2], axis=1)
    # The fixed rows are the first outside.
    half = np.abs(V[~free, 2]).min()
    a = 1.0
    for _ in range(200):
        a = 1 / np.cosh(half / a)
    assert len(rows) > 10
    assert radius == pytest.approx(a * np.cosh(W[free, 2] / a), abs=2e-3)
    assert not np.allclose(fair(V, F, free, 1), W, atol=1e-3)


def test_only_what_is_near_matters():
    V, F = zoo.upsampled(*zoo.torus(24, 12), noise=0.2)
    free = np.linalg.norm(V - V[0], axis=1) < 0.5
    for k in (1, 2, 3):
        W = fair(V, F, free, k)
        moved = V.copy()
        far = np.linalg.norm(V - V[0], axis=1) > 1.5
        moved[far] += 0.3
        X = fair(moved, F, free, k)
        assert np.array_equal(X[free], W[free])
        assert fair(np.asfortranarray(V), F[::-1].copy(), free, k) == pytest.approx(W, abs=1e-8)


def test_nothing_to_do():
    V, F = zoo.torus(12, 6)
    W = fair(V, F, np.zeros(len(V), bool))
    assert np.array_equal(W, V) and W is not V


def test_bad_input():
    V, F = zoo.torus(12, 6)
    with pytest.raises(SingularSystemError, match="fix"):
        fair(V, F, np.ones(len(V), bool))
    for options in ({"k": 4}, {"k": 1.5}, {"k": True}, {"area": "x"}, {"iterations": 0}):
        with pytest.raises(OptionError):
            fair(V, F, [1, 2], **options)
    with pytest.raises(OptionError, match="region"):
        fair(V, F, [len(V)])
    with pytest.raises(OptionError, match="do not belong to a face"):
        fair(np.vstack([V, [[1, 1, 1]]]), F, [len(V)])
    flat = V.copy()
    flat[F[0]] = flat[F[0, 0]]
    with pytest.raises(MeshInputError, match="no area"):
        fair(flat, F, F[0])
