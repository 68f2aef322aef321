"""`max_deviation`: however coarse the length, the two surfaces stay that close."""

import numpy as np
import pytest
from helpers import zoo
from helpers.complexes import shape
from helpers.invariants import assert_clean
from helpers.measures import diagonal
from helpers.structure import built, featured

from data.shapes.solids import plate, uv_sphere
from remeshvec import remesh, surface_distance
from remeshvec.sweeps.deviation import DeviationCheck, measure_deviation
from remeshvec.sweeps.guard import lazy_tree

# Shape, and two deviations as shares of the diagonal.  Real meshes have details finer than 0.005.
SHAPES = {
    "sphere": (lambda: uv_sphere(48, 24), 0.002, 0.006),
    "torus": (lambda: zoo.torus(48, 20), 0.002, 0.006),
    "tube": (lambda: zoo.cylinder(40, 12), 0.002, 0.006),
    "plate": (lambda: (plate().V, plate().F), 0.002, 0.006),
    "wavy_sheet": (lambda: zoo.read(zoo.DATA / "wavy_sheet.obj"), 0.002, 0.006),
    "cow.obj": (lambda: zoo.sample("cow.obj"), 0.005, 0.015),
    "iphi_bad10k.off": (lambda: zoo.sample("iphi_bad10k.off"), 0.005, 0.015),
}


def deviation(V, F, result):
    """Largest distance in either direction, from 20,000 points on each surface and the vertices.

    It is a lower bound of the true one, so it must not exceed what was promised.
    """
    return surface_distance(V, F, *result, samples=20_000).hausdorff


@pytest.mark.parametrize("which", ["tight", "wide"])
@pytest.mark.parametrize("name", SHAPES)
def test_deviation_is_kept_at_a_coarse_length(name, which):
    make, tight, wide = SHAPES[name]
    V, F = make()
    size = diagonal(V)
    L, allowed = 0.12 * size, size * (tight if which == "tight" else wide)
    loose, result = remesh(V, F, L), remesh(V, F, L, max_deviation=allowed)
    assert_clean(*result)
    assert shape(result.F) == shape(loose.F)
    assert deviation(V, F, result) <= allowed * (1 + 1e-6)
    if which == "tight":
        assert deviation(V, F, loose) > allowed, "there was something to do"
    # Not by giving up: at most some twice the faces of the input.
    assert len(loose.F) <= len(result.F) < 2.5 * len(F)


def test_plane_faces_need_no_more():
    """Blocks of unit cubes: with all creases kept, any length is within any deviation."""
    V, F = zoo.upsampled(*zoo.genus_2(), n=2, noise=0)
    loose, result = (
        remesh(V, F, 0.5, max_deviation=allowed, feature_angle=30) for allowed in (None, 0.004)
    )
    assert deviation(V, F, result) <= 0.004
    assert len(result.F) == pytest.approx(len(loose.F), rel=0.1)


def test_a_tight_deviation_takes_more_faces():
    V, F = uv_sphere(96, 48)
    counts, off = [], []
    for allowed in (0.05, 0.02, 0.005):
        result = remesh(V, F, 0.9, max_deviation=allowed)
        counts.append(len(result.F))
        off.append(deviation(V, F, result))
        assert off[-1] <= allowed * (1 + 1e-6)
    assert counts[0] < counts[1] < counts[2]
    # An ideal mesh of the sphere within 0.005 has 1,000 faces; three times as many are too many.
    assert counts[2] < 3000


def test_a_wide_deviation_changes_little():
    V, F = zoo.torus(48, 20)
    one, two = remesh(V, F, 0.1), remesh(V, F, 0.1, max_deviation=0.5)
    assert len(two.F) == pytest.approx(len(one.F), rel=0.02)


def test_flat_meshes_keep_their_length():
    """No deviation there to bound: L is what decides."""
    V, F = zoo.grid(21, 21)
    result = remesh(V, F, 2.0, max_deviation=1e-3)
    assert result.lengths == pytest.approx(2.0, rel=1e-6)
    assert len(result.F) < 0.6 * len(F)
    assert surface_distance(V, F, *result, samples=5000).hausdorff < 1e-9


def test_where_it_is_short_is_where_it_curves():
    """A sheet, half of it flat and half of it rolled up."""
    V, F = zoo.grid(61, 21)
    x = V[:, 0] / 20 - 1.5
    t = np.maximum(x, 0) / 0.4
    V = np.stack([np.where(x < 0, x, 0.4 * np.sin(t)), V[:, 1] / 20, 0.4 * (1 - np.cos(t))], axis=1)
    result = remesh(V, F, 0.3, max_deviation=0.004)
    assert deviation(V, F, result) <= 0.004 * (1 + 1e-6)
    flat = (result.V[:, 0] < -0.7) & (result.V[:, 2] < 1e-9)
    curved = result.V[:, 2] > 0.05
    assert np.median(result.lengths[flat]) > 1.5 * np.median(result.lengths[curved])


@pytest.mark.parametrize("amount", [0.0, 0.05])
def test_the_largest_deviation_is_that_of_all_samples(amount):
    """Found without a search for most of them."""
    V, F = zoo.torus(48, 20)
    other = featured(built(V, F, ordered=True), 0.3)
    coarse = built(*zoo.perturb(*zoo.torus(20, 10), amount), ordered=True, length=0.6)
    coarse.birth[:] = coarse.source[:] = 0  # a face of the reference to start at
    _, to_input, from_input = DeviationCheck(other, 0.1, False).distances(
        coarse, lazy_tree(coarse, False), 0.0
    )
    found = measure_deviation(coarse, other, False)
    assert found["to_input"] == pytest.approx(to_input.max(), rel=1e-12)
    assert found["from_input"] == pytest.approx(from_input.max(), rel=1e-12)
