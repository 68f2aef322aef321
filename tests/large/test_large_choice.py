"""Of two versions of a region the better one is taken, each region by itself."""

import numpy as np

from remeshvec.large.choice import better_regions
from remeshvec.large.geometry import smallest_angle_cosines

# Two squares, each a region with the four corners as its rim (vertices 0 to 3, and 4 to 7).
RIM = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
X = np.zeros((8, 4))
X[:4, :2], X[4:, :2] = RIM, np.add(RIM, [3.0, 0.0])


def fans(first, second):
    """Both squares as fans around a new vertex each."""
    F = [[-1 - (4 * k + i), -1 - (4 * k + (i + 1) % 4), k] for k in (0, 1) for i in range(4)]
    points = np.zeros((2, 4))
    points[0, :2], points[1, :2] = first, np.add(second, [3.0, 0.0])
    return {
        "F": np.array(F),
        "X": points,
        "kind": np.zeros(2, np.uint8),
        "birth": np.array([7, 8], np.int32),
        "curve": np.full((8, 3), -1, np.int32),
        "source": np.arange(8, dtype=np.int32),
    }


def centres(part):
    used = np.unique(part["F"][part["F"] >= 0])
    return sorted(part["X"][used, :2].tolist())


def test_each_region_is_judged_alone():
    old, new = fans([0.5, 0.5], [0.1, 0.5]), fans([0.2, 0.5], [0.5, 0.5])
    chosen = better_regions(old, new, X)
    assert centres(chosen) == [[0.5, 0.5], [3.5, 0.5]]
    assert sorted(chosen["source"].tolist()) == sorted([0, 1, 2, 3, 4, 5, 6, 7])
    assert len(chosen["F"]) == len(chosen["curve"]) == 8


def test_better_versions_are_taken_as_they_are():
    old, new = fans([0.2, 0.5], [0.1, 0.5]), fans([0.5, 0.5], [0.5, 0.5])
    assert better_regions(old, new, X) is new
    assert centres(better_regions(new, old, X)) == [[0.5, 0.5], [3.5, 0.5]]


def test_smallest_angles():
    corners = np.zeros((3, 3, 3))
    corners[0, :, :2] = [[0, 0], [1, 0], [0.5, 3**0.5 / 2]]
    corners[1, :, :2] = [[0, 0], [1, 0], [0, 1]]
    corners[2, :, :2] = [[0, 0], [1, 0], [0, 0]]
    expected = [0.5, 2**-0.5, 1.0]
    np.testing.assert_allclose(smallest_angle_cosines(corners), expected, atol=1e-12)
