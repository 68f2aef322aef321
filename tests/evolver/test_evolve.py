"""Necks are cut, surfaces evolve: spheres, catenoids, bridges, drops, and fluid on rings."""

import json
from pathlib import Path

import igl
import numpy as np
import pytest
from helpers import zoo
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from data.shapes import nonmanifold
from data.shapes.films import catenoid, catenoid_area, cone
from remeshvec import OptionError, read_mesh, remesh
from remeshvec.evolver import CapillaryProblem, cut_necks, evolve, write_frames
from remeshvec.evolver.reshape import remeshed

RINGS = Path(__file__).resolve().parents[3] / "shared/data/flotation/three_rings.json"


def assert_manifold(F):
    assert igl.is_edge_manifold(F)[0] and igl.is_vertex_manifold(F).all()
    half = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    assert len(np.unique(half, axis=0)) == len(half)


# --- necks ---------------------------------------------------------------------------------------


def dumbbell(sides, level=2, thickness=1.0):
    """Two balls, each without a patch of faces, joined by a ring of quads."""
    V, F = zoo.icosphere(level)
    if sides == 3:
        ring = F[V[F].mean(axis=1)[:, 2].argmax()]
        G = F[~(ring == F).all(axis=1)]
    else:  # two faces beside each other
        top = F[V[F].mean(axis=1)[:, 2].argmax()]
        other = next(f for f in F.tolist() if len(set(f) & set(top.tolist())) == 2)
        apex = (set(other) - set(top.tolist())).pop()
        i = next(i for i in range(3) if top[i] not in other)
        ring = np.array([top[i], top[(i + 1) % 3], apex, top[(i + 2) % 3]])
        G = np.array([f for f in F.tolist() if f not in (top.tolist(), other)])
    n = len(V)
    W = V * [1, 1, -1] + [0, 0, 2.2]
    tube = []
    for a, b in zip(ring, np.roll(ring, -1), strict=True):
        tube += [[a, b, b + n], [a, b + n, a + n]]
    return np.vstack([V, W]), np.vstack([G, G[:, ::-1] + n, tube])


@pytest.mark.parametrize("sides", [3, 4])
def test_necks_are_cut_and_capped(sides):
    V, F = dumbbell(sides)
    assert_manifold(F)
    whole = CapillaryProblem(V, F)
    assert whole.components()[0] == 1
    found = cut_necks(V, F, np.zeros(len(V), bool), perimeter=9.0)
    assert found.n_cuts >= 1
    assert_manifold(found.F)
    pieces = CapillaryProblem(found.V, found.F)
    assert pieces.components()[0] == 1 + found.n_cuts
    assert np.array_equal(found.V, V[found.source])
    # The same faces, and caps that fill both sides of the same cycle.
    assert len(found.F) == len(F) + 2 * found.n_cuts * (sides - 2)
    if sides == 3:
        assert pieces.total_volume() == pytest.approx(whole.total_volume(), rel=1e-12)
    else:
        assert cut_necks(V, F, np.zeros(len(V), bool)).n_cuts == 0
        assert cut_necks(V, F, np.zeros(len(V), bool), perimeter=0.1).n_cuts == 0


def test_held_vertices_are_not_cut():
    V, F = dumbbell(3)
    held = np.zeros(len(V), bool)
    held[F[-6:]] = True
    assert cut_necks(V, F, held).n_cuts == 0


@pytest.mark.parametrize("name", ["icosphere", "torus", "genus_2", "planar_delaunay", "annulus"])
def test_other_surfaces_are_left_alone(name):
    V, F = zoo.ZOO[name].make()
    found = cut_necks(V, F, np.zeros(len(V), bool))
    assert found.n_cuts == 0 and np.array_equal(found.F, F) and np.array_equal(found.V, V)


def with_tip(V, F, f, height=1.0):
    """Join a face to a new vertex, its middle times ``height``."""
    a, b, c = F[f]
    k = len(V)
    F = np.vstack([np.delete(F, f, axis=0), [[a, b, k], [b, c, k], [c, a, k]]])
    return np.vstack([V, V[[a, b, c]].mean(axis=0) * height]), F


def test_small_tips_are_no_necks():
    """A vertex with three faces sits on a cycle of three edges."""
    V, F = with_tip(*zoo.icosphere(2), 7, 1.1)
    assert cut_necks(V, F, np.zeros(len(V), bool)).n_cuts == 0


def test_flat_patches_are_no_necks():
    """Nine faces inside a triangle: many, but not more area than a cap would have."""
    V, F = zoo.icosphere(2)
    for f in (7, -1, -3, -5):
        V, F = with_tip(V, F, f)
    assert cut_necks(V, F, np.zeros(len(V), bool)).n_cuts == 0


def test_handles_are_cut_too():
    """A neck may separate nothing: the torus becomes a ball."""
    V, F = zoo.torus(24, 3)
    found = cut_necks(V, F, np.zeros(len(V), bool), perimeter=0.0)
    assert found.n_cuts >= 1
    assert igl.euler_characteristic(found.F) == 2 * found.n_cuts
    assert_manifold(found.F)


# --- evolution -----------------------------------------------------------------------------------


def cube():
    V, F = zoo.cube()
    V = V - V.min(axis=0)
    return V / V.max(), F


def test_a_cube_becomes_a_sphere():
    """With an error that falls with the square of the length, on triangles made on the way."""
    exact = (36 * np.pi) ** (1 / 3)
    errors = []
    for lengths in ([0.3], [0.3, 0.15], [0.3, 0.15, 0.075]):
        done = evolve(CapillaryProblem(*cube(), volume=1.0), lengths)
        assert done.minimum.converged and done.n_cuts == 0
        assert done.minimum.volume == pytest.approx(1.0, rel=1e-11)
        assert_manifold(done.minimum.F)
        errors.append(done.minimum.area / exact - 1)
    assert errors[-1] < 1e-3 and len(done.minimum.F) < 3200
    assert 3.2 < errors[0] / errors[1] < 4.5
    assert 3.4 < errors[1] / errors[2] < 4.5


@pytest.mark.parametrize("half", [0.5, 0.6, 0.65])
def test_catenoids(half):
    done = evolve(CapillaryProblem(*catenoid(half)), [0.1], sweeps=100)
    assert done.minimum.converged and done.n_cuts == 0
    assert done.minimum.area == pytest.approx(catenoid_area(half), rel=2e-4)


def test_a_catenoid_near_the_limit_stays_and_one_beyond_snaps():
    done = evolve(CapillaryProblem(*catenoid(0.66)), [0.1], sweeps=100)
    assert done.n_cuts == 0 and done.history[-1]["components"] == 1
    problem = CapillaryProblem(*catenoid(0.67))
    done = evolve(problem, [0.1], sweeps=100, frames=True)
    assert done.n_cuts >= 1 and done.history[-1]["components"] == 2
    discs = 64 * np.sin(2 * np.pi / 64)
    assert done.minimum.area == pytest.approx(discs, rel=1e-6)
    V, F = done
    assert np.abs(np.abs(V[np.unique(F), 2]) - 0.67).max() < 1e-5
    assert_manifold(F)
    events = [frame.event for frame in done.frames]
    assert "cut" in events and events[-1] == "newton"
    assert len(done.frames) == len(done.history)
    # Without remeshing it never gets there.
    stuck = evolve(problem, [0.1], sweeps=60, remeshing=False)
    assert stuck.minimum.area > 1.001 * discs and not stuck.minimum.converged


def bridge(length, n=40):
    step = 2 * np.pi / n
    V, F = zoo.cylinder(n, 1 + round(length / (0.87 * step)))
    V[:, 2] *= length / 2
    free = (V[:, 2] > 1e-9) & (V[:, 2] < length - 1e-9)
    V[free, :2] *= (1 + 0.02 * np.sin(2 * np.pi * V[free, 2] / length))[:, None]
    area = n / 2 * np.sin(step)
    return CapillaryProblem(V, F, volume=area * length, volume_offset=area * length / 3)


def test_a_short_bridge_is_a_cylinder():
    done = evolve(bridge(6.2), [0.16], sweeps=100)
    assert done.minimum.converged and done.n_cuts == 0
    inner = np.linalg.norm(done.minimum.V[:, :2], axis=1)
    assert inner == pytest.approx(1, abs=2e-3)
    assert done.minimum.pressure == pytest.approx([1.0], rel=0.01)


@pytest.mark.slow
def test_a_long_bridge_breaks():
    """Longer than its circumference [Plateau, Rayleigh]."""
    problem = bridge(6.35)
    done = evolve(problem, [0.16], sweeps=150)
    assert done.n_cuts >= 1 and done.history[-1]["components"] == 2
    assert done.minimum.converged
    assert done.minimum.volume == pytest.approx(problem.volume, rel=1e-10)
    assert_manifold(done.minimum.F)


def test_pinned_drops_follow_young_and_laplace():
    volume = 1.0
    V, F = cone(128, 1.2)
    for bond in (0.0, 2.0, 5.0):
        problem = CapillaryProblem(V, F, volume=volume, density=bond, gravity=(0, 0, -1))
        done = evolve(problem, [0.25, 0.12, 0.08])
        assert done.minimum.converged and len(done.minimum.F) < 2300
        assert done.minimum.area == pytest.approx(_drop_area(bond, volume), rel=2e-4)


def _drop_area(bond, volume):
    """Area of the axisymmetric drop on a disc of radius 1, from its apex downwards."""

    def shoot(b):
        def slope(_, y):
            r, z, phi = y[:3]
            bend = np.sin(phi) / r if r > 1e-8 else b / 2
            ring = 2 * np.pi * r
            return [np.cos(phi), np.sin(phi), b + bond * z - bend, ring, ring / 2 * r * np.sin(phi)]

        def full(_, y):
            return y[4] - volume

        full.terminal = True
        start = [1e-9, 0, 0, 0, 0]
        return solve_ivp(slope, [0, 10], start, events=full, rtol=1e-10, atol=1e-12).y[:, -1]

    tries = np.linspace(0.2, 3, 29)
    misses = [shoot(b)[0] - 1 for b in tries]
    i = next(i for i in range(28) if misses[i] * misses[i + 1] < 0)
    return shoot(brentq(lambda b: shoot(b)[0] - 1, tries[i], tries[i + 1]))[3]


def test_wires_stay():
    """Fixed vertices never move, and fixed edges stay edges."""
    V, F = zoo.grid(13, 13)
    V = V / 12
    wire = np.flatnonzero(V[:, 0] == 0.5)
    pairs = np.stack([wire[:-1], wire[1:]], axis=1)
    rim = np.unique(igl.boundary_facets(F)[0])
    V[:, 2] = 0.2 * np.sin(3 * V[:, 0]) * np.sin(3 * V[:, 1])
    problem = CapillaryProblem(V, F, rim, np.concatenate([pairs, igl.boundary_facets(F)[0]]))
    done = evolve(problem, [0.06])
    after = done.minimum.problem
    assert {tuple(p) for p in V[problem.fixed]} <= {tuple(p) for p in after.V[after.fixed]}
    ends = {tuple(sorted(map(tuple, V[e]))) for e in problem.fixed_edges.tolist()}
    edges = np.unique(np.sort(after.F[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    assert ends <= {tuple(sorted(map(tuple, after.V[e]))) for e in edges.tolist()}


def test_crumbs_are_dropped_and_pieces_keep_their_volume():
    big, small = zoo.icosphere(3), zoo.icosphere(1)
    V, F = zoo.joined(big, (0.02 * small[0], small[1]), shift=3.0)
    total = CapillaryProblem(V, F).total_volume()
    done = evolve(CapillaryProblem(V, F, volume=total), [0.25], volume="per_component")
    assert done.history[-1]["components"] == 1
    assert done.minimum.volume == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize("volume", [None, 0.0])
def test_what_encloses_nothing_vanishes(volume):
    done = evolve(CapillaryProblem(*zoo.icosphere(2), volume=volume), [0.3])
    assert len(done.minimum.F) == 0 and done.minimum.stop == "nothing is left"
    assert done.minimum.energy == 0 and done.history[-1]["components"] == 0


def test_films_that_meet_are_films():
    """Three half-discs on one wire each: junctions are kept, and nothing is cut."""
    V, F = nonmanifold.half_discs()
    done = evolve(CapillaryProblem(V, F), [0.2])
    assert done.minimum.converged and done.n_cuts == 0


def test_frames_are_written(tmp_path):
    seen = []
    done = evolve(
        CapillaryProblem(*cube(), volume=1.0), [0.3], frames=True,
        callback=lambda frame: seen.append(frame) or len(seen) < 3,
    )  # fmt: skip
    assert len(seen) == len(done.frames) == 3
    files = write_frames(tmp_path / "run", done.frames)
    assert [file.name for file in files] == [f"frame_{k:04d}.ply" for k in range(3)]
    V, F, _ = read_mesh(files[-1])
    assert len(F) == len(done.frames[-1].F) and np.allclose(V, done.frames[-1].V)


def test_bad_input():
    problem = CapillaryProblem(*cube(), volume=1.0)
    for lengths, options in (
        ([], {}), ([0.0], {}), ([-1.0, 0.1], {}), ([0.3], {"sweeps": 0}), ([0.3], {"volume": "no"}),
    ):  # fmt: skip
        with pytest.raises(OptionError):
            evolve(problem, lengths, **options)


# --- the report's problem ------------------------------------------------------------------------


def rings(volume):
    d = json.loads(RINGS.read_text())
    return CapillaryProblem(
        d["vertices"], d["faces"], d["fixed_vertices"], d["fixed_edges"],
        volume=d[volume], volume_offset=d["cap_volume"], energy_offset=d["cap_area"],
    )  # fmt: skip


@pytest.mark.skipif(not RINGS.exists(), reason="the data of the report is not here")
def test_fluid_on_three_rings():
    problem = rings("volume_full")
    finer = remeshed(problem, 16.0, 1.5, 0.5)
    assert finer.total_volume() == pytest.approx(problem.volume, rel=1e-10)
    done = evolve(problem, [16.0, 8.0])
    assert done.minimum.converged and done.n_cuts == 0
    assert 4384 < done.minimum.energy < 4395
    assert done.minimum.pressure == pytest.approx([0.0878], rel=3e-3)


@pytest.mark.slow
@pytest.mark.skipif(not RINGS.exists(), reason="the data of the report is not here")
def test_a_small_volume_splits_only_with_remeshing():
    problem = rings("volume_small")
    done = evolve(problem, [16.0, 8.0])
    assert done.history[-1]["components"] == 2 and done.minimum.converged
    assert_manifold(done.minimum.F)
    stuck = evolve(problem, [16.0, 8.0], remeshing=False)
    assert stuck.history[-1]["components"] == 1


def test_what_has_come_off_falls_out_and_the_rest_is_minimised():
    V, F = cone(24, -0.5)
    drop = remesh(V, F[:, ::-1], 0.3, boundary="fixed")
    ball = remesh(*zoo.icosphere(2), 0.6)
    W = np.vstack([drop.V, 0.4 * ball.V + [0, 0, -3]])
    G = np.vstack([drop.F, ball.F + len(drop.V)])
    load = {"density": 1.0, "gravity": (0, 0, -1.0)}
    volume = 0.6 + CapillaryProblem(0.4 * ball.V, ball.F).total_volume()
    both = CapillaryProblem(W, G, volume=volume, bodies="per_component", **load)
    found = evolve(both, [0.3], frames=True)
    assert "fell" in [frame.event for frame in found.frames]
    assert found.minimum.converged and found.history[-1]["components"] == 1
    mine = both.targets[both.body[0]]
    expected = evolve(CapillaryProblem(drop.V, drop.F, volume=mine, **load), [0.3]).minimum
    assert found.minimum.problem.total_volume() - both.volume_offset == pytest.approx(mine)
    assert found.minimum.energy == pytest.approx(expected.energy, rel=0.01)


def test_an_evolution_without_equilibrium_ends_and_says_so():
    V, F = cone(48, -1.0)
    V, F = remesh(V, F[:, ::-1], 0.2, boundary="fixed")
    problem = CapillaryProblem(V, F, volume=7.0, density=1.0, gravity=(0, 0, -1.0))
    found = evolve(problem, [0.25, 0.15])
    assert found.minimum.stop.startswith("no equilibrium") and not found.minimum.converged
    assert len(found.minimum.F) < 10_000
