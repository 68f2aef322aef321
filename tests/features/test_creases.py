"""Creases: parts whose creases are known, shapes that have none, and the plain threshold."""

from itertools import pairwise

import numpy as np
import pytest
from helpers import zoo
from helpers.structure import built, mean_edge_of, next_of

from data.shapes import cad_parts
from remeshvec.core.compiler import kernel
from remeshvec.core.vocabulary import NONE
from remeshvec.features.candidates import Ground
from remeshvec.features.creases import find_creases
from remeshvec.features.echo import echo_cosines, echoes_beside


def found_in(V, F, length, angle="auto", hard=()):
    """Crease edges without the boundary, as sorted pairs of vertices, and the counts."""
    mesh = built(V, F, length=length)
    end = mesh.origin[[next_of(h) for h in range(mesh.origin.size)]]
    edges = list(zip(*np.sort([mesh.origin, end], axis=0).tolist(), strict=True))
    is_hard = np.array([edge in hard for edge in edges])
    before = is_hard.copy()
    is_feature, counts = find_creases(
        mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge, is_hard, angle, mean_edge_of(mesh)
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
    "plate": cad_parts.plate,
    "cylinder": lambda: zoo.closed_cylinder(24, 9),
    "cone": lambda: zoo.cone(24),
    "hemisphere": cad_parts.hemisphere,
    "genus_2": zoo.genus_2,
}
BARE = {
    "cube": zoo.cube,
    "tetrahedron": zoo.tetrahedron,
    "octahedron": zoo.octahedron,
    "l_prism": zoo.l_prism,
    "l_tilted": lambda: cad_parts.prism(cad_parts.L_SHAPE, 1.5, (0.3, 0.2)),
    "two_rows": lambda: cad_parts.prism(cad_parts.regular(5), 2.0, rows=2),
    **{f"prism_{n}": lambda n=n: cad_parts.prism(cad_parts.regular(n)) for n in (3, 4, 5, 6)},
    **{f"flat_{n}": lambda n=n: cad_parts.prism(cad_parts.regular(n), 0.3) for n in (3, 5, 6)},
    **{
        f"tilted_{n}": lambda n=n: cad_parts.prism(cad_parts.regular(n), tilt=(0.4, 0.2))
        for n in (3, 4, 6)
    },
}


# --- known creases -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BARE)
def test_bare_solids_keep_all(name):
    V, F = BARE[name]()
    known = cad_parts.creases_of(V, F, 25.0)
    for factor in (0.05, 0.1):
        length = factor * cad_parts.diagonal(V)
        assert found_in(V, F, length)[0] == known
        assert found_in(cad_parts.turned(V) + 3.0, F, length)[0] == known


@pytest.mark.parametrize("name", PARTS)
def test_clean_parts_keep_exactly_their_creases(name):
    V, F = PARTS[name]()
    known = cad_parts.creases_of(V, F)
    for factor in (0.3, 0.5, 0.9, 1.5):
        assert found_in(V, F, factor * zoo.mean_edge(V, F))[0] == known


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
@pytest.mark.parametrize("name", PARTS)
def test_noisy_irregular_parts(name, noise):
    V, F = PARTS[name]()
    V, F, known = cad_parts.roughened(V, F, noise, times=3 if len(F) < 100 else 2)
    for factor in (0.5, 0.9, 1.5):
        recall, precision = scores(found_in(V, F, factor * zoo.mean_edge(V, F))[0], known)
        assert recall > 0.97 and precision > 0.99


@pytest.mark.parametrize("length", [0.01, 0.1, 0.5, 3.0])
def test_a_cylinder_of_24_sides_has_two_rims(length):
    """Turns of 15 degrees, whatever the length."""
    V, F = zoo.closed_cylinder(24, 9)
    known = cad_parts.creases_of(V, F)
    assert len(known) == 48
    found, counts = found_in(V, F, length)
    assert found == known and counts["chains"] == 2


@pytest.mark.parametrize("n", [7, 8, 9, 10, 12])
def test_prisms_keep_the_edges_of_facets_wider_than_three_quarters_of_the_length(n):
    """Their rims are sharp and clean, so the surface is a part."""
    V, F = cad_parts.prism(cad_parts.regular(n), 1.5)
    side = 2 * np.sin(np.pi / n)
    found, _ = found_in(V, F, side / 0.76)
    assert len(found) == 3 * n


def test_narrow_facets_that_turn_little_are_a_cylinder():
    """Twelve sides turn by 30 degrees."""
    V, F = cad_parts.prism(cad_parts.regular(12), 1.5)
    found, counts = found_in(V, F, 2 * np.sin(np.pi / 12) / 0.7)
    assert len(found) == 24 and counts["dropped_echo"] == 12


def test_facets_of_a_coarse_torus_are_curvature():
    """As clean as those of a part, and as sharp, but each repeats beside itself."""
    V, F = zoo.ZOO["torus"].make()
    turns = cad_parts.edge_turns(V, F)
    assert max(turns.values()) > 40.0
    found, counts = found_in(V, F, 0.9 * zoo.mean_edge(V, F))
    assert not found and counts["dropped_echo"] > 50


@pytest.mark.parametrize("segments", [2, 3, 8, 20])
def test_fillets_have_no_creases(segments):
    """Tangential arcs, also of two segments: turns of 22, 45 and 22 degrees."""
    V, F = cad_parts.prism(cad_parts.rounded(segments), 1.5, rows=6)
    known = cad_parts.creases_of(V, F, 60.0)
    assert len(known) == 8 * (segments + 1)
    for factor in (0.5, 0.9, 1.5):
        assert found_in(V, F, factor * zoo.mean_edge(V, F))[0] == known


@pytest.mark.parametrize("thickness", [0.02, 0.1, 0.3])
def test_plates_keep_both_edges(thickness):
    """The turns of 90 degrees repeat one thickness further: no echo."""
    V, F = cad_parts.plate(32, thickness, 2)
    assert found_in(V, F, 0.5)[0] == cad_parts.creases_of(V, F)


# --- folds of a sheet ----------------------------------------------------------------------------


def sheet(angles, columns=12, noise=0.0):
    """Sheet of unit squares over a profile: the slope of each piece in degrees."""
    t = np.radians(angles)
    x, z = (np.repeat([0, *np.cumsum(part)], columns) for part in (np.cos(t), np.sin(t)))
    y = np.tile(np.arange(columns), len(t) + 1)
    V = np.stack([x, y, z], axis=1)
    V += noise * np.random.default_rng(0).standard_normal(V.shape)
    return V, zoo.wrapped_grid(len(t) + 1, columns, False, False)


def folds(found, columns=12):
    """Numbers of the lines across the profile that are creases over half of their length."""
    along = [a // columns for a, b in found if a // columns == b // columns]
    assert 4 * (len(found) - len(along)) < len(found) + 1
    return [k for k in sorted(set(along)) if 2 * along.count(k) > columns]


def test_a_turn_that_comes_once_is_a_crease():
    fold = [0, 0, 0, 40, 40, 40]
    for noise in (0.0, 0.01, 0.03):
        assert folds(found_in(*sheet(fold, noise=noise), 1.0)[0]) == [3]
    assert not found_in(*sheet([0, 0, 0, 20, 20, 20]), 1.0)[0]


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
def test_a_turn_that_comes_three_times_is_an_arc(noise):
    arc = sheet([-60, -60, -60, -20, 20, 60, 60, 60], noise=noise)
    found, counts = found_in(*arc, 1.0)
    assert not found and counts["dropped_echo"] >= 33
    assert folds(found_in(*arc, 0.6)[0]) == [3, 4, 5], "wide faces at this scale"


def test_a_turn_that_comes_twice_is_a_chamfer_where_faces_are_flat_or_edges_turn_evenly():
    chamfer = [0, 0, 0, 40, 80, 80, 80]
    assert folds(found_in(*sheet(chamfer), 1.0)[0]) == [3, 4]
    assert folds(found_in(*sheet(chamfer, noise=0.005), 1.0)[0]) == [3, 4]
    assert not found_in(*sheet(chamfer, noise=0.05), 1.0)[0]


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.02])
def test_steps_and_ends_of_faces_are_no_echo(noise):
    """A turn back; and a turn twice as large, which is the end of the face between."""
    assert folds(found_in(*sheet([0, 0, 0, 40, 0, 0, 0], noise=noise), 1.0)[0]) == [3, 4]
    assert folds(found_in(*sheet([0, 0, 0, 42, 132, 132], noise=noise), 1.0)[0]) == [3, 4]


@kernel
def listen(X, origin, twin, normals, is_hard, edges, reach, turn, echoes):
    quiet, loud = echo_cosines(turn)
    ground = Ground(X, origin, twin, normals, is_hard)
    for k in range(len(edges)):
        echoes[k] = echoes_beside(ground, edges[k], reach, quiet, loud, 2)[0]


@pytest.mark.parametrize("seed", range(3))
def test_walks_go_straight_over_any_faces(seed):
    """Between two parallel folds, a unit apart, lies a random triangulation."""
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(seed)
    y = np.linspace(0, 3, 16)
    lines = [np.stack([np.full(16, x), y], axis=1) for x in (-1.0, 0.0, 1.0, 2.0)]
    P = np.vstack([*lines, rng.random((60, 2)) * [0.9, 2.9] + 0.05])
    F = Delaunay(P).simplices
    x = P[:, 0]
    V = np.column_stack([P, -np.maximum(0, np.maximum(-x, x - 1))])
    sides = V[np.roll(F, -1, axis=1)] - V[F]
    F = np.where(np.cross(sides[:, 0], sides[:, 1])[:, 2:] > 0, F, F[:, ::-1])
    mesh = built(cad_parts.turned(V), F)
    sides = mesh.X[np.roll(F, -1, axis=1), :3] - mesh.X[F, :3]
    N = np.cross(sides[:, 0], sides[:, 1])
    N /= np.linalg.norm(N, axis=1, keepdims=True)
    end = mesh.origin[[next_of(h) for h in range(mesh.origin.size)]]
    inward = (x[mesh.origin] == 0) & (x[end] == 0) & (x[F].max(axis=1).repeat(3) > 0)
    edges = np.flatnonzero(inward)
    edges = edges[np.abs(P[mesh.origin[edges], 1] - 1.5) < 1]  # away from the border
    assert len(edges) > 6
    no_hard = np.zeros(mesh.origin.size, bool)
    for reach, expected in ((0.999, 0), (1.001, 1)):
        echoes = np.empty(len(edges))
        listen(mesh.X, mesh.origin, mesh.twin, N, no_hard, edges, reach, np.pi / 4, echoes)
        assert (echoes == expected).all()


def test_a_long_fold_may_fade_out():
    """50 degrees at the border, nothing in the middle: a loose end. A short one is noise."""
    V, F = zoo.arrays(zoo.grid(13, 13)[0], zoo.wrapped_grid(13, 13, False, False))
    V += 0.01 * np.random.default_rng(0).standard_normal(V.shape)
    for reach, expected in ((9.0, range(5, 9)), (4.0, range(1))):
        fading = np.clip((reach - V[:, 0]) / 4, 0, 1)
        W = V + np.outer(
            np.abs(np.arange(169) % 13 - 6) * fading * np.tan(np.radians(25)), [0, 0, 1]
        )
        found, _ = found_in(W, F, 1.0)
        assert all(a % 13 == b % 13 == 6 for a, b in found)
        assert len(found) in expected


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
    turns = cad_parts.edge_turns(V, F)
    assert found_in(V, F, 0.5, angle)[0] == {edge for edge, turn in turns.items() if turn > angle}


@pytest.mark.parametrize("seed", range(4))
def test_equal_turns_fall_on_one_side_of_the_threshold(seed):
    """12 sides turn by 30 degrees; the plain threshold is exclusive, the rule inclusive."""
    V, F = zoo.closed_cylinder(12)
    V = zoo.rotate(V, np.random.default_rng(seed).random(3)) + 300.0 * seed
    assert len(found_in(V, F, 0.5, 30.0)[0]) == 24
    assert len(found_in(V, F, 0.5, 29.999)[0]) == 72
    assert len(found_in(V, F, 0.1)[0]) == 72
    assert not found_in(zoo.rotate(zoo.cube()[0]), zoo.cube()[1], 0.5, 90.0)[0]
    assert not found_in(zoo.rotate(zoo.grid()[0]), zoo.grid()[1], 0.5, 0.0)[0]


def test_none_is_hard_edges_alone():
    found, counts = found_in(*zoo.cube(), 0.1, None)
    assert not found and not any(counts.values())
    found, counts = found_in(*zoo.grid(), 0.5, None, {(6, 11)})
    assert found == {(6, 11)} and counts["chains"] == 1


@pytest.mark.parametrize("angle", ["auto", 80.0, None])
def test_hard_edges_stay(angle):
    """A line over a sphere, too short and too flat for any rule."""
    V, F = zoo.icosphere()
    edges = sorted(cad_parts.edge_turns(V, F))
    hard = set(edges[::17])
    assert found_in(V, F, 0.3, angle, hard)[0] == hard


def test_what_continues_a_hard_edge_is_kept():
    """A fold of 27 degrees beside noise is weak: alone it goes, after a hard edge it stays."""
    V, F = sheet([0, 0, 0, 27, 27, 27], 4)
    rng = np.random.default_rng(1)
    off = np.setdiff1d(np.arange(len(V)), np.arange(12, 16))
    V[off, 2] += 0.03 * rng.standard_normal(len(off))
    fold = {(12, 13), (13, 14), (14, 15)}
    assert not found_in(V, F, 1.0)[0] & fold
    assert found_in(V, F, 1.0, "auto", {(12, 13)})[0] == fold


# --- invariance, dirt ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["plate", "hemisphere", "genus_2"])
def test_scale_and_orientation(name):
    V, F, _ = cad_parts.roughened(*PARTS[name](), 0.03, times=1)
    length = zoo.mean_edge(V, F)
    found, counts = found_in(V, F, length)
    for k in (-30, -1, 7):
        assert found_in(2.0**k * V, F, 2.0**k * length) == (found, counts)
    assert found_in(cad_parts.turned(V), F, length)[0] == found
    assert found_in(V * [1, 1, -1], F[:, ::-1], length)[0] == found


def test_the_order_of_faces_does_not_matter():
    V, F = cad_parts.plate()
    known = cad_parts.creases_of(V, F)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(F))
        assert found_in(V, np.roll(F[order], seed, axis=1), 0.4)[0] == known


def with_caps(V, F, height):
    """Put a vertex on the middle of every crease, in a cap of this height to one side."""
    V, F = list(V), F.tolist()
    for a, b in sorted(cad_parts.creases_of(np.array(V), np.array(F))):
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
    for k, (a, b) in enumerate(sorted(cad_parts.creases_of(V, F))):
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
