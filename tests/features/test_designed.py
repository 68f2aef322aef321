"""What was designed: chains that turn evenly, parts, and what both say about their edges."""

import numpy as np
import pytest
from helpers import zoo

from data.shapes import cad_parts
from data.shapes.perturb import perturb
from remeshvec import find_creases
from remeshvec.features.candidates import (
    CLEAN,
    CURVED,
    ECHO,
    HARD,
    NOISE,
    TERRACE,
    Candidates,
)
from remeshvec.features.designed import find_designed, is_part, promote
from remeshvec.features.links import Segments


def path(turns, ratios, ranks=NOISE, length=1.0, bend=0.0):
    """Candidates one after the other along a curve that bends evenly."""
    turns = np.asarray(turns, float)
    k = len(turns)
    direction = np.radians(bend * np.arange(k))
    end = np.stack([np.arange(k), 1 + np.arange(k)], axis=1).astype(np.int32)
    unit = np.stack([np.cos(direction), np.sin(direction), 0 * direction], axis=1)
    segments = Segments(end, unit, np.full((k, 2), length), k + 1)
    rank = np.broadcast_to(np.asarray(ranks, np.int8), k).copy()
    ratio = np.broadcast_to(np.asarray(ratios, float), k).copy()
    return Candidates(np.arange(k), turns, ratio, rank), segments


@pytest.mark.parametrize(
    ("edges", "unevenness", "ratio", "length", "bend", "expected"),
    [
        (5, 0.05, 9.0, 0.5, 20.0, True),
        (5, 0.05, 9.0, 0.5, 30.0, False),  # bends too far
        (5, 0.05, 7.0, 0.5, 20.0, False),  # too much noise
        (4, 0.05, 9.0, 0.5, 20.0, False),  # too few edges
        (5, 0.08, 9.0, 0.5, 20.0, False),  # too uneven
        (20, 0.12, 9.0, 0.1, 15.0, True),  # long chains may be less even
        (20, 0.12, 9.0, 0.1, 20.0, False),
        (4, 0.14, 21.0, 1.0, 15.0, True),  # quiet ones, too
        (4, 0.14, 21.0, 0.9, 15.0, False),
        (2, 0.03, 13.0, 1.5, 20.0, True),  # long edges
        (2, 0.03, 13.0, 1.4, 20.0, False),
    ],
)
def test_rows_of_the_table(edges, unevenness, ratio, length, bend, expected):
    """Turns that alternate between 60 and a little less."""
    turns = np.where(np.arange(edges) % 2, 60.0 * (1 - unevenness), 60.0)
    assert (find_designed(*path(turns, ratio, length=length, bend=bend)) == expected).all()


def test_flat_chains_and_single_edges_are_not_designed():
    assert not find_designed(*path(np.full(30, 39.0), 50.0)).any()
    assert find_designed(*path(np.full(30, 41.0), 50.0)).all()
    assert not find_designed(*path([60.0], 90.0, length=9.0)).any()


def test_terraces_are_not_linked():
    """The chain falls into two of three edges, which are too few."""
    ranks = [NOISE, NOISE, NOISE, TERRACE, NOISE, NOISE, NOISE]
    assert find_designed(*path(np.full(7, 60.0), 9.0, length=0.5)).all()
    assert not find_designed(*path(np.full(7, 60.0), 9.0, ranks, length=0.5)).any()


@pytest.mark.parametrize(
    ("ratios", "ranks", "expected"),
    [
        (np.full(8, 200.0), CLEAN, True),
        (np.full(8, 29.0), CLEAN, False),  # none is clean
        ([100, 20, 20, 20], CLEAN, True),
        ([100, 12, 12, 12], CLEAN, False),
        ([1e6, 12, 12, 12], CLEAN, False),  # a clean edge counts no more than as clean
        (np.full(8, 200.0), CURVED, False),  # all are echoes
    ],
)
def test_parts(ratios, ranks, expected):
    candidates, segments = path(np.full(len(ratios), 90.0), ratios, ranks)
    assert is_part(candidates, segments) == expected
    flat = candidates._replace(turn=np.full(len(ratios), 39.0))
    assert not is_part(flat, segments), "nothing turns sharply"


def promoted(candidates, segments, designed=False, on_part=False):
    marks = np.full(len(candidates.edges), designed)
    promote(candidates, segments, marks, on_part)
    return candidates.rank.tolist()


def test_designed_edges_become_clean_but_for_noise_curvature_and_terraces():
    ranks = [NOISE, ECHO, CURVED, TERRACE, NOISE]
    one = path([60, 60, 60, 60, 60], [3, 3, 3, 3, 1.9], ranks)
    assert promoted(*one, designed=True) == [CLEAN, CLEAN, CURVED, TERRACE, NOISE]
    one = path([60, 60, 60, 60, 60], [3, 3, 3, 3, 1.9], ranks)
    assert promoted(*one) == ranks


def test_networks_that_are_half_clean_are_clean():
    half = path([60, 60, 60, 60], [200, 200, 3, 3], [CLEAN, CLEAN, NOISE, ECHO])
    assert promoted(*half) == [CLEAN] * 4
    less = path([60, 60, 60, 60, 60], [200, 200, 3, 3, 3], [CLEAN, CLEAN, NOISE, ECHO, NOISE])
    assert promoted(*less) == [CLEAN, CLEAN, NOISE, ECHO, NOISE]


def test_on_parts_sharp_edges_are_hard_but_folds_need_a_chain():
    one = path([60, 30, 150, 60], [200, 200, 200, 8.1], [CLEAN, CLEAN, CLEAN, NOISE])
    assert promoted(*one, on_part=True) == [HARD, CLEAN, CLEAN, HARD]
    noisy = path([60, 60], [7.9, 7.9], NOISE)
    assert promoted(*noisy, on_part=True) == [NOISE, NOISE]


def test_a_part_keeps_short_and_narrow_edges():
    """A chamfer and a groove of less than half a length, and a single edge of less than that."""
    V, F = cad_parts.chamfered_block()
    known = cad_parts.creases_of(V, F, 40.0)
    for length in (0.1, 0.3, 1.0):
        assert set(map(tuple, find_creases(V, F, length).tolist())) == known


def test_noise_all_over_is_no_part():
    V, F = perturb(*zoo.icosphere(4), 0.12)
    assert len(find_creases(V, F, zoo.mean_edge(V, F))) < 20
