"""Capillary problems: derivatives against differences, minima against formulas, errors."""

import numpy as np
import pytest
import scipy.sparse as sp
from helpers import zoo

from data.shapes.films import catenoid, catenoid_area, cone
from remeshvec import MeshInputError, OptionError, remesh
from remeshvec.evolver import CapillaryProblem, minimize
from remeshvec.evolver.energies import areas, gradients, hessian, potentials, volumes
from remeshvec.evolver.motions import find_motions
from remeshvec.evolver.steps import METHODS, _constrained


def soup(seed=0):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(6, 3))
    return X, np.array([[0, 1, 2], [1, 3, 2], [3, 4, 5], [0, 5, 1]])


def differences(f, X, h=1e-5):
    """Central differences of a function of (n, 3), flattened, in the first axis."""
    rows = []
    for k in range(X.size):
        d = np.zeros(X.size)
        d[k] = h
        d = d.reshape(X.shape)
        rows.append((f(X + d) - f(X - d)) / (2 * h))
    return np.array(rows)


# --- energies ------------------------------------------------------------------------------------


@pytest.mark.parametrize("a", [(0.0, 0.0, 0.0), (0.3, -0.2, 1.1)])
def test_derivatives(a):
    X, F = soup()
    a, tension, pressure = np.array(a), 1.7, np.random.default_rng(1).normal(size=len(F))

    def energy(X):
        T = X[F]
        return tension * areas(T).sum() + potentials(T, a).sum() - (pressure * volumes(T)).sum()

    def gradient(X):
        area, volume, potential = gradients(X[F], a)
        corners = tension * area + potential - pressure[:, None, None] * volume
        total = np.zeros_like(X)
        np.add.at(total, F, corners)
        return total

    assert gradient(X).ravel() == pytest.approx(differences(energy, X), abs=1e-8)
    space = np.broadcast_to(np.eye(3), (len(X), 3, 3))
    H = hessian(X, F, space, a, tension, pressure).toarray()
    expected = differences(lambda X: gradient(X).ravel(), X)
    assert pytest.approx(expected, abs=1e-8) == H
    assert np.abs(H - H.T).max() < 1e-12
    along = np.random.default_rng(2).normal(size=(len(X), 1, 3))
    P = np.zeros((X.size, len(X)))
    for k in range(len(X)):
        P[3 * k : 3 * k + 3, k] = along[k, 0]
    assert hessian(X, F, along, a, tension, pressure).toarray() == pytest.approx(P.T @ H @ P)


def test_integrals_over_closed_surfaces():
    V, F = zoo.icosphere(4)
    V = V * [1.0, 2.0, 0.5] + [0.3, -0.4, 1.0]
    problem = CapillaryProblem(V, F, density=2.0, gravity=(1.0, -2.0, -3.0), tension=0.5)
    assert problem.total_volume() == pytest.approx(4 / 3 * np.pi, rel=0.01)
    # -density * gravity . centre * volume, exact on the polyhedron: shift by s adds -density g.s V.
    shifted = problem.with_mesh(V + np.array([0.0, 0.0, 1.0]))
    added = shifted.energy() - problem.energy()
    assert added == pytest.approx(2.0 * 3.0 * problem.total_volume(), rel=1e-10)
    at_centre = problem.with_mesh(V - np.array([0.3, -0.4, 1.0]))
    assert at_centre.energy() == pytest.approx(0.5 * problem.area(), abs=1e-10)


def test_offsets_are_constants():
    V, F = zoo.cylinder(12, 5)
    plain = CapillaryProblem(V, F)
    more = CapillaryProblem(V, F, volume_offset=2.0, energy_offset=3.0, volume=5.0)
    assert more.energy() == plain.energy() + 3
    assert more.total_volume() == plain.total_volume() + 2
    assert more.targets.tolist() == [3.0]


def test_boundaries_are_wires_by_default():
    V, F = zoo.cylinder(12, 5)
    problem = CapillaryProblem(V, F)
    rim = (V[:, 2] == 0) | (V[:, 2] == V[:, 2].max())
    assert np.array_equal(problem.fixed, rim)
    assert len(problem.fixed_edges) == 24
    free = CapillaryProblem(V, F, fixed=[0], fixed_edges=[])
    assert free.fixed.sum() == 1 and free.fixed_edges.shape == (0, 2)


# --- minimisation --------------------------------------------------------------------------------


@pytest.mark.parametrize("half", [0.3, 0.5])
def test_catenoids(half):
    problem = CapillaryProblem(*catenoid(half), tension=2.0)
    before = problem.V.copy()
    flowed = minimize(problem, "flow", tol=1e-3)
    assert flowed.converged and flowed.stop == "converged"
    energies = [step["energy"] for step in flowed.history]
    assert (np.diff(energies) <= 1e-12).all() and len(energies) > 2
    found = minimize(flowed.problem, "newton", tol=1e-10)
    assert found.converged and len(found.history) <= 3
    assert found.area == pytest.approx(catenoid_area(half), rel=3e-4)
    assert found.energy == pytest.approx(2 * found.area)
    assert found.pressure.shape == (0,)
    assert np.array_equal(found.V[problem.fixed], before[problem.fixed])
    assert np.array_equal(problem.V, before)


@pytest.fixture(scope="module")
def ball():
    V, F = zoo.icosphere(4)
    V = V / np.linalg.norm(V, axis=1)[:, None] * [1.2, 0.9, 1.0]
    return remesh(V, F, 0.2, feature_angle=None)


@pytest.mark.parametrize("method", ["flow", "newton"])
def test_spheres(ball, method):
    volume = 4.0
    radius = (3 * volume / (4 * np.pi)) ** (1 / 3)
    problem = CapillaryProblem(*ball, volume=volume, tension=3.0)
    if method == "newton":
        problem = minimize(problem, "flow", steps=20).problem
    found = minimize(problem, method, tol=1e-10 if method == "newton" else 5e-3)
    assert found.converged, found.stop
    assert found.volume == pytest.approx(volume, rel=1e-11)
    assert found.pressure == pytest.approx([2 * 3.0 / radius], rel=3e-3)
    assert found.area == pytest.approx(4 * np.pi * radius**2, rel=4e-3)
    assert np.linalg.norm(found.V - found.V.mean(axis=0), axis=1) == pytest.approx(radius, rel=0.02)


def test_newton_is_quadratic(ball):
    problem = minimize(CapillaryProblem(*ball, volume=4.0), "flow", steps=20).problem
    found = minimize(problem, "newton", tol=1e-11)
    residuals = [step["residual"] for step in found.history]
    assert found.converged and len(residuals) <= 5
    assert residuals[-1] < 1e-3 * residuals[-2]


def test_pressure_is_the_derivative_of_the_energy(ball):
    energies = {}
    for volume in (3.99, 4.0, 4.01):
        start = minimize(CapillaryProblem(*ball, volume=volume), "flow", steps=20).problem
        energies[volume] = minimize(start, "newton", tol=1e-11)
    slope = (energies[4.01].energy - energies[3.99].energy) / 0.02
    assert energies[4.0].pressure[0] == pytest.approx(slope, rel=1e-4)


def test_bodies_keep_a_volume_each():
    one, two = zoo.icosphere(3), zoo.icosphere(2)
    V, F = zoo.joined(one, (0.5 * two[0], two[1]), shift=4.0)
    V = V * [1.0, 1.0, 1.3]
    total = CapillaryProblem(V, F).total_volume()
    each = CapillaryProblem(V, F, volume=total, bodies="per_component")
    assert len(each.targets) == 2 and each.targets.sum() == pytest.approx(total)
    found = minimize(each, "flow", steps=30)
    assert found.problem.body_volumes() == pytest.approx(each.targets, rel=1e-11)
    assert found.pressure[1] > 1.7 * found.pressure[0]
    shared = minimize(CapillaryProblem(V, F, volume=total), "flow", steps=10)
    assert shared.pressure.shape == (1,)
    assert shared.volume == pytest.approx(total, rel=1e-11)


def test_a_heavy_drop_sags():
    V, F = remesh(*cone(48, 1.0), 0.12, feature_angle=None, boundary="fixed")
    tops = []
    for density in (0.0, 3.0):
        problem = CapillaryProblem(V, F, volume=1.0, density=density, gravity=(0, 0, -1))
        found = minimize(minimize(problem, "flow", steps=30).problem, "newton", tol=1e-9)
        assert found.converged
        tops.append(found.V[:, 2].max())
    assert tops[1] < 0.93 * tops[0]


def test_shifts_make_indefinite_problems_go_down():
    """A stretched cylinder of fluid is a saddle; from beside it Newton's method must go down."""
    V, F = zoo.cylinder(24, 41)
    V[:, 2] *= 4.5
    wave = np.sin(2 * np.pi * V[:, 2] / 9.0)
    V[:, :2] *= (1 + 0.05 * wave)[:, None]
    poly = 12 * np.sin(2 * np.pi / 24)
    problem = CapillaryProblem(V, F, volume=9.0 * poly, volume_offset=9.0 * poly / 3)
    found = minimize(problem, "newton", steps=4)
    energies = [problem.energy(), *(step["energy"] for step in found.history)]
    assert len(energies) > 2 and energies[-1] < energies[1] - 1e-3
    forces = problem.forces()
    motions = find_motions(problem)
    normal, area, free = motions.normal, motions.area, motions.vertex
    assert motions.is_normal and np.array_equal(free, np.flatnonzero(problem.free))
    H = problem.hessian(normal[:, None], np.array([1.0]))[free][:, free]
    assert np.linalg.eigvalsh(H.toarray()).min() < 0
    G = np.einsum("gnx,nx->gn", forces.volume, normal)[:, free].T
    u = _constrained(
        sp.csc_array((H + H.T) / 2),
        sp.diags_array(area),
        G,
        G[:, 0] * 0 + 1.0,
        np.zeros(1),
        problem,
    )
    assert np.abs(G.T @ u).max() < 1e-8


def test_nothing_free():
    V, F = zoo.grid(3, 2)
    found = minimize(CapillaryProblem(V, F))
    assert found.stop == "all is fixed" and found.converged
    assert np.array_equal(found.V, V) and found.area == pytest.approx(2)


def test_callbacks_end_it(ball):
    seen = []
    problem = CapillaryProblem(*ball, volume=4.0)
    found = minimize(problem, callback=lambda *args: seen.append(args) or np.bool_(len(seen) < 3))
    assert found.stop == "cancelled" and len(found.history) == 3
    assert [args[0] for args in seen] == [0, 1, 2]


def test_bad_input():
    V, F = zoo.icosphere(1)
    for options in (
        {"tension": 0}, {"tension": -1.0}, {"volume": np.nan}, {"volume": "a"}, {"density": np.inf},
        {"gravity": (0, 1)}, {"gravity": (0, 0, np.nan)}, {"fixed": [len(V)]}, {"bodies": "one"},
        {"fixed_edges": [[0, 1, 2]]}, {"fixed_edges": [[0, 999]]}, {"volume_offset": None},
    ):  # fmt: skip
        with pytest.raises(OptionError):
            CapillaryProblem(V, F, **options)
    with pytest.raises(MeshInputError):
        CapillaryProblem(V, F + 1)
    turned = F.copy()
    turned[3] = turned[3, ::-1]
    with pytest.raises(MeshInputError, match="the same way"):
        CapillaryProblem(V, turned, volume=1.0)
    assert CapillaryProblem(V, turned).area() == pytest.approx(CapillaryProblem(V, F).area())
    problem = CapillaryProblem(V, F, volume=1.0)
    for options in ({"method": "lbfgs"}, {"tol": 0}, {"steps": 0}):
        with pytest.raises(OptionError):
            minimize(problem, **options)


# --- lines ---------------------------------------------------------------------------------------


def film_in_a_tetrahedron(n=3, middle=(0.1, -0.07, 0.05)):
    """Six sheets from the edges of a tetrahedron of edge length 1 to a point, each face cut n times."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / 8**0.5
    V = np.vstack([corners, [middle]])
    F = np.array([(a, b, 4) for a in range(4) for b in range(a + 1, 4)])
    for _ in range(n):
        sides = np.sort(np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1)
        edges, which = np.unique(sides, axis=0, return_inverse=True)
        ab, bc, ca = len(V) + which.reshape(3, -1)
        a, b, c = F.T
        V = np.vstack([V, V[edges].mean(axis=1)])
        parts = (a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)
        F = np.concatenate([np.stack(part, axis=1) for part in parts])
    return V, F


def test_lines_move_across_themselves_and_their_junction_anywhere():
    V, F = film_in_a_tetrahedron(2)
    motions = find_motions(CapillaryProblem(V, F))
    count = np.bincount(motions.vertex, minlength=len(V))
    on_wires = np.unique(CapillaryProblem(V, F).fixed_edges)
    assert (count[on_wires] == 0).all()
    assert count[4] == 3
    ends = V[:4]
    for v in np.flatnonzero(count == 2):
        along = V[v] - V[4]
        assert min(np.linalg.norm(np.cross(along, e - V[4])) for e in ends) < 1e-12
        D = motions.direction[motions.vertex == v]
        assert np.abs(D @ along).max() < 1e-12 and abs(D[0] @ D[1]) < 1e-12
    assert (count == 2).sum() == 4 * 3  # three vertices inside each line
    inside = np.setdiff1d(np.arange(len(V)), on_wires)
    assert (count[inside] >= 1).all()


@pytest.mark.parametrize("method", METHODS)
def test_films_with_lines_converge_in_every_component_or_say_that_they_do_not(method):
    problem = CapillaryProblem(*film_in_a_tetrahedron())
    found = minimize(problem, method, tol=1e-8)
    force = np.abs(found.problem.forces().energy[problem.free]).max()
    assert found.converged == (force < 1e-6)
    if method != "newton":
        assert found.converged
        assert found.area == pytest.approx(3 * 2**0.5 / 4, rel=1e-12)


@pytest.mark.parametrize("bond", [0.0, 2.0])
def test_auto_needs_few_steps_where_newton_fails(bond):
    V, F = zoo.disc(24)
    problem = CapillaryProblem(*remesh(V, F, 0.08, boundary="fixed"), volume=1.0, density=bond)
    problem.gravity[:] = (0.0, 0.0, -1.0)
    found = minimize(problem, "auto", tol=1e-8)
    assert found.converged and len(found.history) < 20


# --- no equilibrium ------------------------------------------------------------------------------


def hanging_drop(volume):
    """Pinned at a ring of radius 1, Bond number 1; the largest volume is about 5.5."""
    V, F = cone(48, -1.0)
    V, F = remesh(V, F[:, ::-1], 0.2, boundary="fixed")
    return CapillaryProblem(V, F, volume=volume, density=1.0, gravity=(0, 0, -1.0))


@pytest.mark.parametrize("method", ["auto", "flow"])
def test_a_drop_that_is_too_heavy_has_no_equilibrium(method):
    held = minimize(hanging_drop(4.5), method, steps=400, tol=1e-3)
    assert held.converged
    found = minimize(hanging_drop(7.0), method)
    assert not found.converged and len(found.history) < 60
    assert found.stop.startswith("no equilibrium: component 0 of 1") and "gravity" in found.stop
    assert np.isfinite(found.V).all()


def test_arguments_that_have_no_answer():
    V, F = zoo.icosphere(2)
    with pytest.raises(OptionError, match="nothing holds the surface"):
        minimize(CapillaryProblem(V, F))
    with pytest.raises(OptionError, match="sign of what the faces enclose"):
        CapillaryProblem(V, F, volume=-1.0)
