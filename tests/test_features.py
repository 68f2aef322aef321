"""Tips of horns and cones: where they are, how far apart, and what is none."""

import numpy as np
import pytest
import zoo
from structure import built

from remeshvec._types import FIXED
from remeshvec.features import apexes


def apexes_of(V, F, length):
    return apexes(built(V, F, length=length))


def test_apexes_are_tips():
    V, F = zoo.bipyramid(24, top=4.0, bottom=-0.2)
    assert apexes_of(V, F, 0.5).tolist() == [24]
    assert len(apexes_of(*zoo.icosphere(), 0.1)) == 0
    assert len(apexes_of(*zoo.cube(), 0.1)) == 0  # a defect of 90 degrees


def test_apexes_keep_apart():
    V, F = zoo.tetrahedron()  # four defects of 180 degrees, edges of 2.83
    assert sorted(apexes_of(V, F, 2.0).tolist()) == [0, 1, 2, 3]
    assert apexes_of(V, F, 3.0).tolist() == [0]


def test_apexes_keep_apart_by_the_lengths_around_them():
    """The one that comes later gives way where its own length says so."""
    V, F = zoo.tetrahedron()
    assert sorted(apexes_of(V, F, np.array([9.0, 2.0, 2.0, 2.0])).tolist()) == [0, 1, 2, 3]
    assert sorted(apexes_of(V, F, np.array([2.0, 2.0, 9.0, 2.0])).tolist()) == [0, 1, 3]


@pytest.mark.parametrize(("top", "bottom"), [(5.0, -4.0), (4.0, -5.0)])
def test_of_two_that_are_close_the_sharper_one_wins(top, bottom):
    V, F = zoo.bipyramid(24, top=top, bottom=bottom)
    assert sorted(apexes_of(V, F, 1.0).tolist()) == [24, 25]
    assert apexes_of(V, F, 20.0).tolist() == [24 if top > -bottom else 25]


def test_vertices_of_boundaries_and_fixed_ones_are_no_apexes():
    assert len(apexes_of(*zoo.grid(), 0.1)) == 0
    mesh = built(*zoo.tetrahedron(), length=0.1)
    mesh.kind[2] = FIXED
    assert sorted(apexes(mesh).tolist()) == [0, 1, 3]
