"""Creases: parts whose creases are known, shapes that have none, and the plain threshold."""

from itertools import pairwise

import numpy as np
import parts
import pytest
import zoo
from structure import built, next_of

from remeshvec._types import NONE
from remeshvec.creases import find_creases


def found_in(V, F, length, angle="auto", hard=()):
    """Crease edges without the boundary, as sorted pairs of vertices, and the counts."""
    mesh = built(V, F, length=length)
    end = mesh.origin[[next_of(h) for h in range(mesh.origin.size)]]
    edges = list(zip(*np.sort([mesh.origin, end], axis=0).tolist(), strict=True))
    is_hard = np.array([edge in hard for edge in edges])
    before = is_hard.copy()
    is_feature, counts = find_creases(
        mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge, is_hard, angle
    )
    assert is_feature.dtype == np.bool_ and np.array_equal(is_hard, before)
    inside = mesh.twin != NONE
    assert is_feature[~inside].all(), "the boundary"
    assert np.array_equal(is_feature[inside], is_feature[mesh.twin[inside]]), "both half-edges"
    creases = {edges[h] for h in np.flatnonzero(is_feature & inside)}
    assert counts["crease_edges"] == len(creases)
    assert (counts["chains"] > 0) == (len(creases) > 0)
    return creases, counts


def scores(found, known):
    """Recall and precision."""
    right = len(found & known)
    return right / len(known), right / len(found) if found else 1.0


def frozen(V, F, factor=0.9):
    """Share of edges that are creases."""
    return len(found_in(V, F, factor * zoo.mean_edge(V, F))[0]) / (1.5 * len(F))


PARTS = {
    "cube": zoo.cube,
    "l_prism": zoo.l_prism,
    "plate": parts.plate,
    "cylinder": lambda: zoo.closed_cylinder(24, 9),
    "cone": lambda: zoo.cone(24),
    "hemisphere": parts.hemisphere,
    "genus_2": zoo.genus_2,
}
BARE = {
    "cube": zoo.cube,
    "tetrahedron": zoo.tetrahedron,
    "octahedron": zoo.octahedron,
    "l_prism": zoo.l_prism,
    "l_tilted": lambda: parts.prism(parts.L_SHAPE, 1.5, (0.3, 0.2)),
    "two_rows": lambda: parts.prism(parts.regular(5), 2.0, rows=2),
    **{f"prism_{n}": lambda n=n: parts.prism(parts.regular(n)) for n in (3, 4, 5, 6)},
    **{f"flat_{n}": lambda n=n: parts.prism(parts.regular(n), 0.3) for n in (3, 5, 6)},
    **{f"tilted_{n}": lambda n=n: parts.prism(parts.regular(n), 1, (0.4, 0.2)) for n in (3, 4, 6)},
}


# --- known creases -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BARE)
def test_bare_solids_keep_all(name):
    V, F = BARE[name]()
    known = parts.creases_of(V, F, 25.0)
    for factor in (0.05, 0.1):
        length = factor * parts.diagonal(V)
        assert found_in(V, F, length)[0] == known
        assert found_in(parts.turned(V) + 3.0, F, length)[0] == known


@pytest.mark.parametrize("name", PARTS)
def test_clean_parts_keep_exactly_their_creases(name):
    V, F = PARTS[name]()
    known = parts.creases_of(V, F)
    for factor in (0.3, 0.5, 0.9, 1.5):
        assert found_in(V, F, factor * zoo.mean_edge(V, F))[0] == known


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
@pytest.mark.parametrize("name", PARTS)
def test_noisy_irregular_parts(name, noise):
    V, F = PARTS[name]()
    V, F, known = parts.roughened(V, F, noise, times=3 if len(F) < 100 else 2)
    for factor in (0.5, 0.9, 1.5):
        recall, precision = scores(found_in(V, F, factor * zoo.mean_edge(V, F))[0], known)
        assert recall > 0.97 and precision > 0.99


@pytest.mark.parametrize("length", [0.01, 0.1, 0.5, 3.0])
def test_a_cylinder_of_24_sides_has_two_rims(length):
    """Turns of 15 degrees, whatever the length."""
    V, F = zoo.closed_cylinder(24, 9)
    known = parts.creases_of(V, F)
    assert len(known) == 48
    found, counts = found_in(V, F, length)
    assert found == known and counts["chains"] == 2


def test_coarse_prisms_are_cylinders_at_the_scale_of_their_facets():
    """Both readings of 8 sides of 45 degrees, each 0.77 wide."""
    V, F = parts.prism(parts.regular(8), 3.0)
    found, counts = found_in(V, F, 0.77)
    assert len(found) == 16 and counts["dropped_echo"] == 8
    assert len(found_in(V, F, 0.4)[0]) == 24


@pytest.mark.parametrize("segments", [2, 3, 8, 20])
def test_fillets_have_no_creases(segments):
    """Tangential arcs, also of two segments: turns of 22, 45 and 22 degrees."""
    V, F = parts.prism(parts.rounded(segments), 1.5, rows=6)
    known = parts.creases_of(V, F, 60.0)
    assert len(known) == 8 * (segments + 1)
    for factor in (0.5, 0.9, 1.5):
        assert found_in(V, F, factor * zoo.mean_edge(V, F))[0] == known


@pytest.mark.parametrize("thickness", [0.02, 0.1, 0.3])
def test_plates_keep_both_edges(thickness):
    """The turns of 90 degrees repeat one thickness further: no echo."""
    V, F = parts.plate(32, thickness, 2)
    assert found_in(V, F, 0.5)[0] == parts.creases_of(V, F)


def strip(heights, columns=12):
    """Sheet over unit steps along x."""
    x, y = np.meshgrid(np.arange(len(heights)), np.arange(columns), indexing="ij")
    z = np.repeat(np.asarray(heights, float)[:, None], columns, axis=1)
    V = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return V, zoo.wrapped_grid(len(heights), columns, False, False)


def columns_of(found, columns=12):
    return sorted({a // columns for a, b in found if a // columns == b // columns})


def test_a_fold_is_a_crease_and_an_arc_is_none():
    """The same turns of 40 degrees: once, four times alike, and up and down."""
    slope = np.tan(np.radians(40))
    fold = [0, 0, 0, 0, *(slope * np.arange(1, 5))]
    assert columns_of(found_in(*strip(fold), 1.0)[0]) == [3]
    angles = np.radians([-60, -60, -60, -20, 20, 60, 60, 60])
    arc = [0, *np.cumsum(np.sin(angles))]
    V, F = strip(arc)
    V[:, 0] = np.repeat([0, *np.cumsum(np.cos(angles))], 12)
    found, counts = found_in(V, F, 0.9)
    assert not found and counts["dropped_echo"] == 33
    step = [0, 0, 0, 0, slope, slope, slope, slope]
    assert columns_of(found_in(*strip(step), 1.0)[0]) == [3, 4]


# --- nothing to find -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["icosphere", "torus", "grid", "annulus"])
def test_smooth_shapes_have_none(name):
    V, F = zoo.ZOO[name].make()
    for noise in (0.0, 0.02):
        assert frozen(*zoo.perturb(V, F, noise)) == 0.0


def test_noise_alone_is_no_crease():
    """A tenth of an edge: edges that turn by 25 degrees and more here and there."""
    V, F = zoo.icosphere(4)
    V, F = zoo.perturb(V, F, 0.1)
    counts = found_in(V, F, zoo.mean_edge(V, F))[1]
    assert counts["dropped_noise"] > 150 and counts["crease_edges"] < 10


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("cat.obj", 0.001),
        ("phands.obj", 0.001),
        ("cow.obj", 0.015),
        ("iphi_bad10k.off", 0.015),
        ("wolf_head.obj", 0.015),
    ],
)
def test_organic_samples_freeze_next_to_nothing(name, limit):
    V, F = zoo.sample(name)
    assert frozen(V, F) <= limit
    assert frozen(V, F, 2.0) <= limit


# --- the other modes, hard edges -----------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 10, 30.0, 60.0, 179.0])
@pytest.mark.parametrize("name", ["icosphere", "torus", "cube", "bipyramid", "cylinder"])
def test_a_number_is_the_plain_threshold(name, angle):
    V, F = zoo.perturb(*zoo.ZOO[name].make(), 0.1)
    turns = parts.edge_turns(V, F)
    assert found_in(V, F, 0.5, angle)[0] == {edge for edge, turn in turns.items() if turn > angle}


def test_equal_turns_fall_on_one_side_of_the_threshold():
    """12 sides turn by 30 degrees; the plain threshold is exclusive, the rule inclusive."""
    for V in (zoo.closed_cylinder(12)[0], parts.turned(zoo.closed_cylinder(12)[0])):
        F = zoo.closed_cylinder(12)[1]
        assert len(found_in(V, F, 0.5, 30.0)[0]) == 24
        assert len(found_in(V, F, 0.5, 29.999)[0]) == 72
        assert len(found_in(V, F, 0.1)[0]) == 72
        assert not found_in(*zoo.cube(), 0.5, 90.0)[0]


def test_none_is_hard_edges_alone():
    found, counts = found_in(*zoo.cube(), 0.1, None)
    assert not found and not any(counts.values())
    found, counts = found_in(*zoo.grid(), 0.5, None, {(6, 11)})
    assert found == {(6, 11)} and counts["chains"] == 1


@pytest.mark.parametrize("angle", ["auto", 80.0, None])
def test_hard_edges_stay(angle):
    """A line over a sphere, too short and too flat for any rule."""
    V, F = zoo.icosphere()
    edges = sorted(parts.edge_turns(V, F))
    hard = set(edges[::17])
    assert found_in(V, F, 0.3, angle, hard)[0] == hard


def test_what_continues_a_hard_edge_is_kept():
    """A fold of 27 degrees with noise beside it is weak: alone it goes, after a hard edge it stays."""
    V, F = strip([0, 0, 0, 0, *(np.tan(np.radians(27)) * np.arange(1, 5))], 3)
    rng = np.random.default_rng(1)
    bumps = np.setdiff1d(np.arange(len(V)), np.arange(9, 12))
    V[bumps, 2] += 0.03 * rng.standard_normal(len(bumps))
    fold = {(9, 10), (10, 11)}
    assert not found_in(V, F, 1.0)[0] & fold
    assert found_in(V, F, 1.0, "auto", {(9, 10)})[0] == fold


# --- invariance, dirt ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["plate", "hemisphere", "genus_2"])
def test_scale_and_orientation(name):
    V, F, _ = parts.roughened(*PARTS[name](), 0.03, times=1)
    length = zoo.mean_edge(V, F)
    found, counts = found_in(V, F, length)
    for k in (-30, -1, 7):
        assert found_in(2.0**k * V, F, 2.0**k * length) == (found, counts)
    assert found_in(parts.turned(V), F, length)[0] == found
    assert found_in(V * [1, 1, -1], F[:, ::-1], length)[0] == found


def test_the_order_of_faces_does_not_matter():
    V, F = parts.plate()
    known = parts.creases_of(V, F)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(F))
        assert found_in(V, np.roll(F[order], seed, axis=1), 0.4)[0] == known


def with_caps(V, F, height):
    """Put a vertex on the middle of every crease, in a cap of this height to one side."""
    V, F = list(V), F.tolist()
    for a, b in sorted(parts.creases_of(np.array(V), np.array(F))):
        f = next(i for i, face in enumerate(F) if (a, b) in pairwise([*face, face[0]]))
        c = next(v for v in F[f] if v not in (a, b))
        middle = 0.5 * (V[a] + V[b])
        V.append(middle + height * (V[c] - middle))
        F[f] = [a, len(V) - 1, c]
        F += [[len(V) - 1, b, c], [a, b, len(V) - 1]]
    return zoo.arrays(V, F)


@pytest.mark.parametrize("height", [0.0, 1e-12, 1e-7, 1e-5])
@pytest.mark.parametrize("name", ["cube", "l_prism", "plate"])
def test_caps_without_area_lend_their_normals(name, height):
    """The crease then runs along the short sides of each cap: closed as before."""
    V, F = PARTS[name]()
    W, G = with_caps(V, F, height)
    found, _ = found_in(W, G, 0.2)
    expected = set()
    for k, (a, b) in enumerate(sorted(parts.creases_of(V, F))):
        expected |= {(a, len(V) + k), (b, len(V) + k)}
    assert found == expected


@pytest.mark.parametrize("name", ["flat_cap", "coincident_vertices", "sliver_fan"])
def test_dirt_does_not_poison(name):
    V, F = zoo.ZOO[name].make()
    for angle in ("auto", 20.0, None):
        assert not found_in(V, F, 0.3, angle)[0]


def test_surfaces_without_area():
    V, F = zoo.octahedron()
    for squashed in (V * [1, 0, 0], 0 * V, V * [1, 1e-200, 0]):
        for angle in ("auto", 20.0):
            found_in(squashed, F, 0.3, angle)


def test_hubs_are_cheap_and_make_no_chains():
    """A pleated fan: 2000 folds meet in one vertex."""
    V, F = zoo.bipyramid(2000, top=0.3, bottom=-5.0)
    V[1:2000:2, 2] = 0.3
    found, counts = found_in(V, F, 0.01)
    assert len(found) + counts["dropped_short"] + counts["dropped_echo"] > 1000
