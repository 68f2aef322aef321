"""Tips of horns and cones: where they are, how far apart, and what is none."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import built

from remeshvec.core.vocabulary import CURVE, FIXED, HELD
from remeshvec.features.dihedral import find_dihedral_angles
from remeshvec.features.tips import LEAST_TURN, find_tips, hold_tips


def tips_of(mesh, degrees=LEAST_TURN):
    return find_tips(mesh, find_dihedral_angles(mesh.X, mesh.origin, mesh.twin, degrees, False))


def apexes_of(V, F, length):
    return tips_of(built(V, F, length=length))


def test_apexes_are_tips():
    V, F = zoo.bipyramid(24, top=4.0, bottom=-0.2)
    assert apexes_of(V, F, 0.5).tolist() == [24]
    assert len(apexes_of(*zoo.icosphere(), 0.1)) == 0
    assert len(apexes_of(*zoo.cube(), 0.1)) == 0  # a defect of 90 degrees


def on_a_rim(height):
    """Cone whose rim is a crease, as the features leave it."""
    mesh = built(*zoo.bipyramid(24, top=height, bottom=0.0), length=0.1)
    mesh.kind[:24] = CURVE
    return mesh


@pytest.mark.parametrize(("height", "is_tip"), [(0.8, True), (0.5, False)])
def test_wide_cones_have_tips_too(height, is_tip):
    """A defect of 79 or 38 degrees."""
    assert (24 in tips_of(on_a_rim(height))) == is_tip


def test_a_spike_on_a_surface_that_cannot_be_unrolled_is_no_tip():
    V, F = zoo.icosphere(2)
    V[20] *= 1.2
    mesh = built(V, F, length=0.01)
    assert 60 < defects(mesh)[20] < 110
    assert len(tips_of(mesh)) == 0


@pytest.mark.parametrize(("height", "ideal"), [(10.0, 3), (1.2, 4), (0.7, 5)])
def test_faces_at_a_tip_share_its_angle(height, ideal):
    mesh = on_a_rim(height)
    before = mesh.valence_excess.copy()
    turns = find_dihedral_angles(mesh.X, mesh.origin, mesh.twin, LEAST_TURN, False)
    hold_tips(mesh, turns)
    assert np.flatnonzero(mesh.kind == HELD).tolist() == [24]
    assert mesh.valence_excess[24] == before[24] + 6 - ideal == 24 - ideal
    assert np.array_equal(np.delete(mesh.valence_excess, 24), np.delete(before, 24))


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
    assert sorted(tips_of(mesh).tolist()) == [0, 1, 3]


def defects(mesh):
    """Angle defects in degrees."""
    P, F = mesh.X[:, :3], mesh.origin.reshape(-1, 3)
    total = np.zeros(len(P))
    for face in F.tolist():
        for k in range(3):
            a, b, c = (P[face[(k + i) % 3]] for i in range(3))
            total[face[k]] += naive.angle(a, b, c)
    return 360.0 - np.degrees(total)


@pytest.mark.parametrize("degrees", [LEAST_TURN, 5.0])
@pytest.mark.parametrize("seed", range(6))
def test_no_tip_escapes_the_sieve(seed, degrees):
    """Whatever the shape: all large defects are found, though few vertices are looked at."""
    rng = np.random.default_rng(seed)
    V, F = zoo.icosphere(2) if seed % 2 else zoo.genus_2()
    V = V * (1 + rng.choice([0.0, 1.0, 3.0], (len(V), 1), p=[0.7, 0.2, 0.1]))
    V += (0.02 + 0.1 * seed) * rng.standard_normal(V.shape)
    mesh = built(V, F, length=1e-9)
    left = defects(mesh)
    found = tips_of(mesh, degrees)
    sure = np.abs(left - 120) > 0.1
    assert (left[sure] > 120).any()
    assert set(np.flatnonzero((left > 120) & sure)) == set(found.tolist()) & set(
        np.flatnonzero(sure)
    )
    assert (np.diff(left[found]) < 0.1).all(), "sharpest first"


@pytest.mark.parametrize("n", [60, 64, 65, 500])
def test_hubs_of_any_size(n):
    V, F = zoo.bipyramid(n, top=5.0, bottom=-5.0)
    F = F[np.random.default_rng(n).permutation(len(F))]
    mesh = built(V, F, length=1e-9)
    assert sorted(tips_of(mesh).tolist()) == [n, n + 1]


def test_slivers_at_a_tip_do_not_hide_it():
    """Faces without a normal: nobody knows how sharply the surface turns there."""
    V, F = zoo.bipyramid(24, top=4.0, bottom=-0.2)
    faces = []
    for face in F.tolist():
        if 24 not in face:
            faces.append(face)
            continue
        i = face.index(24)
        tip, a, b = face[i], face[(i + 1) % 3], face[(i + 2) % 3]
        middle = len(V)
        V = np.vstack([V, (V[a] + V[tip]) / 2])
        faces += [[tip, a, middle], [middle, a, b], [tip, middle, b]]
    mesh = built(V, faces, length=0.5)
    assert find_dihedral_angles(mesh.X, mesh.origin, mesh.twin, LEAST_TURN, False).slivers
    assert 24 in tips_of(mesh)
