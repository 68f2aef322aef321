"""Sheets nearer than chords of the target length allow: shorter edges, by default and only there."""

import numpy as np
import pytest
from helpers import threads, zoo

from data.shapes.basic import icosphere
from data.shapes.cad_parts import prism
from data.shapes.hard import thin_ring
from remeshvec import remesh


def hollow_ball(wall):
    V, F = icosphere(4)
    return np.vstack([V, (1.0 - wall) * V]), np.vstack([F, F[:, ::-1] + len(V)])


def thin_rods(n, length):
    """Rods of eight sides, of radius 1, beside each other."""
    t = 2 * np.pi * np.arange(8) / 8
    V, F = prism(np.c_[np.cos(t), np.sin(t)], height=length)
    shifted = [V + np.array([20.0 * k, 0.0, 0.0]) for k in range(n)]
    return np.vstack(shifted), np.vstack([F + k * len(V) for k in range(n)])


def crossing(result):
    return len(result.report.find_defects(check_intersections=True).crossing)


@pytest.mark.parametrize("wall", [0.006, 0.002])
def test_rims_of_a_thin_ring_get_edges_as_short_as_the_wall_needs(wall):
    V, F = thin_ring(wall)
    result = remesh(V, F, 0.3)
    held = remesh(V, F, 0.3, clearance=None)
    assert crossing(result) == 0
    loss = abs(zoo.volume(*result) / zoo.volume(V, F) - 1)
    assert loss < 0.03 < 0.04 < abs(zoo.volume(*held) / zoo.volume(V, F) - 1)
    expected = 2 * np.sqrt(0.4 * wall * (2 - 0.4 * wall)) / 0.3
    assert result.report.clearance["vertices"] == len(V)
    assert result.report.clearance["shortest"] == pytest.approx(expected, rel=0.01)
    assert "clearance" in result.report.stop
    assert result.lengths.max() < 1.1 * expected * 0.3
    assert held.report.clearance == {} and "clearance" not in held.report.stop


def test_faces_are_looked_at_where_there_are_no_creases():
    """Only faces at creases were: 200 of this ball's faces crossed others."""
    V, F = hollow_ball(0.012)
    result = remesh(V, F, 0.3)
    assert not len(result.feature_edges)
    assert crossing(result) == 0
    assert 0.25 < result.report.clearance["shortest"] < 0.8
    assert crossing(remesh(V, F, 0.3, clearance=None)) > 100


@pytest.mark.parametrize(("length", "L"), [(200.0, 12.0), (400.0, 65.0), (30.0, 6.0)])
def test_rods_thinner_than_the_length_keep_their_edges(length, L):
    """None of them stands out at that scale: the rods lost up to nine tenths of their volume."""
    V, F = thin_rods(3, length)
    result = remesh(V, F, L)
    assert zoo.volume(*result) == pytest.approx(zoo.volume(V, F), rel=1e-6)
    assert result.report.clearance["new_crease_edges"] == 3 * 24
    assert "more edges are creases" in result.report.stop
    for options in ({"clearance": None}, {"feature_angle": None}):
        assert zoo.volume(*remesh(V, F, L, **options)) < 0.8 * zoo.volume(V, F)


def test_lengths_stay_where_nothing_crosses():
    """Sheets may be near, and bend: what comes out is the same, bit for bit."""
    V, F = hollow_ball(0.3)
    for mesh, L in ((icosphere(3), 0.2), ((V, F), 0.2), (zoo.cube(), 0.3)):
        result, other = remesh(*mesh, L), remesh(*mesh, L, clearance=None)
        assert result.report.clearance == {}
        assert np.array_equal(result.V, other.V) and np.array_equal(result.F, other.F)


def test_a_number_of_faces_is_the_stronger_wish():
    V, F = thin_ring(0.006)
    result = remesh(V, F, n_faces=600)
    assert result.report.clearance == {}
    assert abs(len(result.F) - 600) <= 12


def test_lengths_stay_where_shorter_ones_would_need_more_faces_than_allowed():
    V, F = thin_ring(0.002)
    result = remesh(V, F, 0.3, max_faces=3000)
    assert result.report.clearance == {}
    assert len(result.F) <= 3000


def test_the_share_of_the_gap_can_be_chosen():
    V, F = thin_ring(0.006)
    shortest = [remesh(V, F, 0.3, clearance=x).report.clearance["shortest"] for x in (0.1, 0.4)]
    assert shortest[0] == pytest.approx(max(0.25, 0.5 * shortest[1]), rel=0.01)


def test_the_same_bits_on_threads_and_in_any_order():
    V, F = hollow_ball(0.012)
    alone = remesh(V, F, 0.3, threads=1)
    for way in (threads.on_threads(2), threads.shuffled()):
        with way:
            again = remesh(V, F, 0.3)
        assert np.array_equal(again.V, alone.V) and np.array_equal(again.F, alone.F)


def test_the_callback_can_end_the_second_run():
    V, F = thin_ring(0.006)
    calls = []

    def stop(sweep, phase, count):
        calls.append(sweep)
        return not (sweep == 2 and calls.count(1) > calls.index(2))

    result = remesh(V, F, 0.3, callback=stop)
    assert np.isfinite(result.V).all() and len(result.F)
