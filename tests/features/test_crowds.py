"""Of two edges at an acute angle the less sure one goes, but for clean ones."""

import numpy as np
import pytest

from remeshvec.features.candidates import CLEAN, CROWDED, HARD, STRONG
from remeshvec.features.crowds import drop_acute
from remeshvec.features.links import Segments


def star(angles, lengths=1.0):
    """Edges from one vertex in a plane, by their directions in degrees."""
    t = np.radians(angles)
    k = len(t)
    end = np.stack([np.zeros(k), 1 + np.arange(k)], axis=1).astype(np.int32)
    unit = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
    length = np.broadcast_to(lengths, k)
    return Segments(end, unit, np.stack([length, length], axis=1), k + 1)


def left(segments, ratio, strength, rank=STRONG, kept=True):
    """Which edges stay."""
    k = len(segments.end)
    ranks = np.full(k, rank, np.int8)
    is_kept = np.broadcast_to(kept, k).copy()
    arrays = (np.asarray(x, float) for x in (ratio, strength))
    found = drop_acute(segments, ranks, *arrays, is_kept)
    assert found == (ranks == CROWDED).any()
    return np.flatnonzero(ranks != CROWDED).tolist()


def test_the_weaker_of_an_acute_pair_goes():
    assert left(star([0, 20]), [10, 10], [2, 1]) == [0]
    assert left(star([0, 20]), [10, 10], [1, 2]) == [1]
    assert left(star([0, 20]), [10, 10], [1, 1]) == [0] or [1]
    assert left(star([0, 40]), [10, 10], [2, 1]) == [0, 1], "not acute"
    assert left(star([0, 180]), [10, 10], [2, 1]) == [0, 1], "straight on"


def test_either_direction_of_an_edge():
    segments = star([0, 20])
    turned = segments._replace(end=segments.end[:, ::-1].copy(), unit=-segments.unit)
    mixed = segments._replace(
        end=np.stack([segments.end[0], turned.end[1]]),
        unit=np.stack([segments.unit[0], turned.unit[1]]),
    )
    for one in (turned, mixed):
        assert left(one, [10, 10], [2, 1]) == [0]


@pytest.mark.parametrize(("length", "expected"), [(1.7, [0]), (1.8, [0, 1])])
def test_long_edges_soon_part(length, expected):
    """At 20 degrees the end of an edge of 1.75 is 0.6 target lengths away from the line of the other."""
    assert left(star([0, 20], [1.0, length]), [10, 10], [2, 1]) == expected


def test_clean_and_hard_edges_stay():
    assert left(star([0, 20]), [100, 100], [2, 1]) == [0, 1]
    assert left(star([0, 20]), [99, 100], [2, 1]) == [1], "the clean one, however weak"
    assert left(star([0, 20]), [10, 10], [2, 1], HARD) == [0, 1]
    assert left(star([0, 20]), [10, 10], [2, 1], CLEAN) == [0], "clean by its chain alone"


def test_all_pairs_are_looked_at_before_any_edge_goes():
    assert left(star([0, 20, 40]), [10, 10, 10], [3, 2, 1]) == [0]


def test_edges_that_are_not_kept_do_not_count():
    assert left(star([0, 20]), [10, 10], [2, 1], kept=[False, True]) == [0, 1]
