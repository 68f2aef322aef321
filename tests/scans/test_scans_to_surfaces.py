"""From a scan made by a script to one closed, even surface."""

import numpy as np
import pytest

from data.shapes.scans import ACCEPTANCE, Dirt, mask_surface, scan
from remeshvec import denoise, quality, remesh, repair

SMALL = Dirt(islands=30, handles=3, holes=6, noise=0.4)


def cleaned(V, F):
    body = repair(V, F, keep_largest=True, fill_holes=100)
    return remesh(denoise(body.V, body.F), body.F)


def test_the_scan_has_what_it_is_made_with():
    V, F = scan(0.045, SMALL)
    q = quality(V, F)
    assert q.components > 10 and q.boundary_loops >= 4 and q.misoriented_edges == 0
    again = scan(0.045, SMALL)
    assert np.array_equal(V, again[0]) and np.array_equal(F, again[1])
    bare = repair(*scan(0.045, SMALL._replace(islands=0, handles=0, holes=0)), keep_largest=True)
    with_handles = repair(*scan(0.045, SMALL._replace(islands=0, holes=0)), keep_largest=True)
    assert quality(*with_handles).euler_number <= quality(*bare).euler_number - 4


@pytest.mark.parametrize(
    "make",
    [
        lambda: scan(0.03, SMALL),
        pytest.param(lambda: scan(dirt=ACCEPTANCE), marks=pytest.mark.slow),
    ],
    ids=["small", "300,000 faces"],
)
def test_a_scan_becomes_one_closed_even_surface(make):
    V, F = make()
    q = quality(*cleaned(V, F))
    assert q.is_closed and q.components == 1 and q.volume > 0
    assert q.min_angle_p1 >= 40 > 20 > quality(V, F).min_angle_p1


def test_a_mask_loses_its_steps():
    V, F = mask_surface(0.06)
    even = remesh(denoise(V, F, 40), F)
    assert (
        even.report.quality_after.min_angle_p1 > 40 > remesh(V, F).report.quality_after.min_angle_p1
    )
