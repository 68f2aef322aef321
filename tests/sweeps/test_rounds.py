"""Rounds after the sweeps: areas become even, angles stay good, and nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import zoo

from remeshvec import quality, remesh
from remeshvec.core.vocabulary import HELD
from remeshvec.input.recipe import PRESETS
from remeshvec.sweeps import rounds


def wavy(seed=0):
    V, F = zoo.upsampled(*zoo.torus(36, 18), noise=0.3, seed=seed)
    return zoo.perturb(V, F, 0.03)


def test_areas_are_a_third_more_even_than_after_sweeps_alone():
    """Sweeps alone, even twelve of them, leave 7 % on such meshes."""
    V, F = wavy()
    q = quality(*remesh(V, F, 0.9 * zoo.mean_edge(V, F)))
    assert q.area_error_face < 0.052
    assert q.area_error_voronoi < 0.042
    assert q.min_angle > 42.0 and q.min_angle_p1 > 43.5
    assert q.valence6_inner > 0.82


def test_even_is_more_even():
    V, F = wavy()
    L = 0.9 * zoo.mean_edge(V, F)
    default, even = (quality(*remesh(V, F, L, preset=name)) for name in ("default", "even"))
    assert even.area_error_face < 0.87 * default.area_error_face
    assert even.valence6_inner > default.valence6_inner
    assert even.min_angle > 43.5 and even.min_angle_p1 > default.min_angle_p1


def test_cells_follow_lengths_that_vary():
    """Areas over squared lengths are even, not areas."""
    V, F = wavy()
    L = 0.9 * zoo.mean_edge(V, F) * (1.3 + 0.5 * np.sin(V[:, 0]))
    result = remesh(V, F, L)
    a, b, c = (result.V[result.F[:, k]] for k in range(3))
    share = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    share /= (result.lengths[result.F] ** 2).mean(axis=1)
    assert np.abs(share - share.mean()).mean() < 0.068 * share.mean()


def signed_area(V, F):
    """Area of a flat mesh; faces that lie upside down count as negative."""
    a, b, c = (V[F[:, k], :2] for k in range(3))
    return 0.5 * np.linalg.det(np.stack([b - a, c - a], axis=1)).sum()


@pytest.mark.parametrize("name", ["annulus", "planar_delaunay"])
def test_rounds_keep_boundaries_flat_meshes_and_corners(name):
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), noise=0.3)
    result = remesh(V, F, 0.7 * zoo.mean_edge(V, F))
    assert np.abs(result.V[:, 2]).max() < 1e-12
    # Signed: the input has folds that lie flat, and lose them.
    assert signed_area(result.V, result.F) == pytest.approx(signed_area(V, F), rel=0.01)
    if name == "annulus":  # the other has a jagged boundary
        assert quality(*result).min_angle > 42.0


def test_held_vertices_stay(monkeypatch):
    """Tips, and what a guard holds, do not move in rounds."""
    seen = []
    run = rounds.run_rounds

    def look(work, stage):
        held = np.flatnonzero(work.mesh.kind == HELD)
        before = work.mesh.X[held].copy()
        run(work, stage)
        seen.append(len(held))
        assert np.array_equal(work.mesh.X[held], before)

    monkeypatch.setattr(rounds, "run_rounds", look)
    V, F = zoo.bipyramid(20, top=3.0, bottom=-3.0)
    remesh(*zoo.upsampled(V, F, n=3), 0.15, feature_angle=None)
    assert seen and seen[0] > 0


def test_a_bound_holds_through_the_rounds():
    """The rounds run under the guard: without it they drift farther than the bound on this mesh."""
    V, F = zoo.torus(48, 24)
    result = remesh(V, F, 0.25, max_deviation=0.01)
    assert max(result.report.deviation.values()) <= 0.01


def test_settling_waits_for_progress():
    """A fall of 1 % moves the mark; what rises, or falls by less, does not."""
    spreads = [1.0, 0.98, 0.985, 0.975, 0.96, 0.955, 0.99, 0.952, 0.951]
    settling = rounds.Settling(30)
    answers = [settling.has_settled(10 * k, spread) for k, spread in enumerate(spreads)]
    assert answers == [False] * 7 + [True] * 2


def test_a_slow_fall_is_progress():
    """Each look brings too little, several together enough."""
    settling = rounds.Settling(30)
    assert not any(settling.has_settled(10 * k, 0.995**k) for k in range(50))


@pytest.mark.parametrize("patience", [0, 20])
def test_without_patience_all_rounds_are_run(patience, monkeypatch):
    monkeypatch.setattr(rounds, "area_spread", lambda *_: 0.0)
    even = PRESETS["even"]
    stages = tuple(stage._replace(number=50, patience=patience) for stage in even.rounds)
    monkeypatch.setitem(PRESETS, "even", replace(even, rounds=stages))
    assert looks(*wavy(), 0.4) == (4 if patience else 10)


def looks(V, F, L):
    """Projections while areas are evened out; one every tenth round."""
    phases = []
    remesh(V, F, L, preset="even", callback=lambda _, phase, __: phases.append(phase))
    return phases.count("even out")


def test_rounds_end_where_areas_settle():
    """Small meshes have few defects to lose."""
    V, F = wavy()
    assert 10 <= looks(V, F, 0.9 * zoo.mean_edge(V, F)) < 50


def test_fast_has_no_rounds():
    V, F = wavy()
    assert "even out" not in remesh(V, F, 0.3, preset="fast").report.seconds
