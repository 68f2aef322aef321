"""Flips: gains, guards against duplicate edges and folded quads, and the state after each."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import (
    assert_same_bits,
    assert_valid,
    blocks_of,
    built,
    copied,
    curve_edges,
    draw,
    ends,
    faces_of,
    half_edge,
    one_block,
    shape_of,
)

from remeshvec.core.vocabulary import FIXED, FROZEN, HALTED, NON_MANIFOLD, NONE, Blocks
from remeshvec.operations.flip import (
    FlipLimits,
    bends_quad,
    duplicates_edge,
    flip_edges,
    folds_neighbour,
)
from remeshvec.operations.flip_gains import is_good_trade, valence_gain, violates_delaunay
from remeshvec.operations.outcomes import (
    FLIPPED,
    KEPT_DUPLICATE,
    KEPT_NORMAL,
    KEPT_SLIVER,
    NO_LONGER_WANTED,
    NOT_OWNED,
)

LOOSE = FlipLimits(normal_cosine=0.0, delaunay_ties=False, sliver_check=False)
STRICT = FlipLimits(np.cos(np.radians(45)), True, False)


def inner_pairs(mesh):
    """Both half-edges of every inner edge."""
    return [(h, int(t)) for h, t in enumerate(mesh.twin) if t != NONE and t < h]


@pytest.mark.parametrize("name", ["torus", "planar_delaunay", "genus_2", "annulus", "l_prism"])
def test_gain_and_delaunay_are_those_of_the_twins(name):
    V, F = zoo.ZOO[name].make()
    mesh = built(V, F)
    gains = set()
    for h, t in inner_pairs(mesh)[:80]:
        a, b = ends(mesh, h)
        assert violates_delaunay(mesh, h, t) == naive.violates_delaunay(V, F, a, b)
        gain = valence_gain(mesh, h, t)
        gains.add(gain)
        if min(mesh.valence_excess[[a, b]]) > -3:
            assert gain == naive.valence_gain(F, a, b)
    assert len(gains) > 1 or name in ("torus", "annulus")


@pytest.mark.parametrize("degrees", [60.0, 89.9, 90.1, 91.0, 120.0])
def test_delaunay_by_angle(degrees):
    """Both angles opposite the edge are known."""
    y = 1 / np.tan(np.radians(degrees) / 2)
    V = np.array([[-1, 0, 0], [1, 0, 0], [0, y, 0], [0, -y, 0]])
    mesh = built(V, [[0, 1, 2], [1, 0, 3]])
    h = half_edge(mesh, 0, 1)
    assert violates_delaunay(mesh, h, int(mesh.twin[h])) == (degrees > 90)


TRADE = 25.0
TRADES = STRICT._replace(trade=np.tan(np.radians(TRADE)))


@pytest.mark.parametrize("gain", [-4, -2, 0, 2, 4])
def test_a_trade_weighs_angles_against_valences(gain):
    """The angles opposite an edge sum to any number of degrees; each step of two is worth 25 of them."""
    for left in (10.0, 35.0, 60.0, 89.0, 91.0, 120.0, 150.0):
        for right in np.arange(2.0, 178.0, 4.0):
            x, y = (1 / np.tan(np.radians(angle) / 2) for angle in (left, right))
            V = np.array([[-1, 0, 0], [1, 0, 0], [0, x, 0], [0, -y, 0]])
            mesh = built(V, [[0, 1, 2], [1, 0, 3]])
            h = half_edge(mesh, 0, 1)
            found = is_good_trade(mesh, h, int(mesh.twin[h]), gain, TRADES.trade)
            assert naive.excess(V, [[0, 1, 2], [1, 0, 3]], 0, 1) == pytest.approx(
                left + right - 180
            )
            assert found == (left + right - 180 > -TRADE * gain / 2), (left, right)


@pytest.mark.parametrize("name", ["planar_delaunay", "genus_2", "icosphere"])
@pytest.mark.parametrize("per_block", [20, 100_000])
def test_trades_find_their_edges_and_end(name, per_block, monkeypatch):
    """All edges that the twin wants are flipped or refused by a guard, and none flips for ever."""
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), n=1, noise=0.5, seed=1)
    mesh = built(V, F, ordered=True)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    counts = [flip_edges(mesh, blocks, TRADES, False)[FLIPPED] for _ in range(40)]
    assert counts[0] > 10 and counts[-1] == 0
    assert_valid(mesh)
    assert shape_of(faces_of(mesh)) == shape_of(F)
    W, G = mesh.X[:, :3], faces_of(mesh)
    left = 0
    for h, t in inner_pairs(mesh):
        a, b = ends(mesh, h)
        gain = valence_gain(mesh, h, t)
        if gain != -1 and naive.excess(W, G, a, b) > -TRADE * gain / 2 + 1e-6:
            c, d = (int(mesh.origin[g // 3 * 3 + (g + 2) % 3]) for g in (h, t))
            left += 1
            assert (
                duplicates_edge(mesh, c, d)
                or bends_quad(mesh, h, t, TRADES.normal_cosine)
                or folds_neighbour(mesh, h, t)
            )
    assert left < 0.15 * len(G)  # the noise has turned faces over in the plane


def test_vertices_of_three_edges_lose_none():
    """Without the floor the gain of this flip is positive, and a vertex of two edges remains."""
    V, F = zoo.tetrahedron()
    mesh = built(V, F)
    mesh.valence_excess[:] = [-3, 5, -5, -5]
    h = half_edge(mesh, 0, 1)
    assert valence_gain(mesh, h, int(mesh.twin[h])) < 0


@pytest.mark.parametrize("name", ["torus", "planar_delaunay", "icosphere", "annulus"])
def test_each_single_flip_is_that_of_the_twin(name):
    V, F = zoo.ZOO[name].make()
    edges = [
        e
        for e in sorted(map(sorted, naive.edges(F)))
        if frozenset(e) not in naive.boundary_edges(F)
    ]
    flipped = 0
    for a, b in edges[:40]:
        mesh = built(V, F)
        alone(mesh, a, b)
        tally = flip_edges(mesh, one_block(mesh), LOOSE, False)
        assert tally.sum() == 1
        restore(mesh)
        assert_valid(mesh)
        if tally[FLIPPED]:
            flipped += 1
            assert same_faces(faces_of(mesh), naive.flip(F, a, b))
            assert shape_of(faces_of(mesh)) == shape_of(F)
        else:
            assert tally[KEPT_DUPLICATE] or tally[KEPT_NORMAL]
    assert flipped > 10


def alone(mesh, a, b):
    """Tell lies about the valences, so that one edge is the only one that wants to flip."""
    h = half_edge(mesh, a, b)
    c, d = (int(mesh.origin[g // 3 * 3 + (g + 2) % 3]) for g in (h, mesh.twin[h]))
    mesh.valence_excess[:] = -3  # floor: no vertex may lose an edge
    mesh.valence_excess[[a, b]] = 10
    mesh.valence_excess[[c, d]] = -10


def restore(mesh):
    from remeshvec.mesh.halfedge import build_mesh

    fresh, *_ = build_mesh(mesh.X.copy(), mesh.origin.reshape(-1, 3).copy())
    mesh.valence_excess[:] = fresh.valence_excess


def same_faces(F, G):
    turn = lambda f: tuple(np.roll(f, -int(np.argmin(f))).tolist())  # noqa: E731
    return sorted(map(turn, np.asarray(F))) == sorted(map(turn, np.asarray(G)))


# --- guards --------------------------------------------------------------------------------------


def bipyramid():
    """Four rim vertices 0-3, poles 4 and 5; the lie that every rim edge wants to join the poles."""
    V, F = zoo.bipyramid(4, top=1.0, bottom=-1.0)
    mesh = built(V, F)
    mesh.valence_excess[:] = [10, 10, 10, 10, -10, -10]
    return V, F, mesh


def test_two_flips_that_share_no_face_may_make_the_same_edge():
    """Why a flip owns the four vertices of its quad, and looks for its edge before it makes it."""
    _, F, _ = bipyramid()
    once = naive.flip(F, 0, 1)
    assert zoo.is_edge_manifold(once)
    quads = [{f for f in naive.tuples(F) if {a, b} <= set(f)} for a, b in ((0, 1), (2, 3))]
    assert not quads[0] & quads[1]  # a rule that owns faces lets both run
    assert not zoo.is_edge_manifold(naive.flip(once, 2, 3))


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("cut", [None, (0, 2, 6), (0, 5, 6), (0, 3, 6)])
def test_a_second_edge_between_the_poles_is_refused(cut, parallel):
    """One of the flips runs, in whatever blocks the vertices lie."""
    _, _, mesh = bipyramid()
    blocks = one_block(mesh) if cut is None else Blocks(np.array([0, 4, 8]), np.array(cut))
    tally = flip_edges(mesh, blocks, LOOSE, parallel)
    assert tally[FLIPPED] == 1 and tally[KEPT_DUPLICATE] >= 1
    restore(mesh)
    assert_valid(mesh)


def test_the_new_edge_exists_already():
    """In a tetrahedron every flip would double the opposite edge."""
    V, F = zoo.tetrahedron()
    assert not zoo.is_edge_manifold(naive.flip(F, 0, 1)) or zoo.duplicate_faces(naive.flip(F, 0, 1))
    mesh = built(V, F)
    alone(mesh, 0, 1)
    tally = flip_edges(mesh, one_block(mesh), LOOSE, False)
    assert tally[KEPT_DUPLICATE] == 1 and tally[FLIPPED] == 0


@pytest.mark.parametrize("name", ["square", "annulus", "planar_delaunay", "octahedron"])
def test_duplicates_edge_looks_all_around(name):
    """Inner and boundary vertices: every pair is found exactly if there is an edge."""
    _, F = zoo.ZOO[name].make()
    mesh = built(*zoo.ZOO[name].make())
    ring = naive.neighbours(F)
    for c in list(ring)[:12]:
        for d in ring:
            assert duplicates_edge(mesh, c, d) == (d == c or d in ring[c])


def dart(x=0.3):
    """Flat quad 0-2-1-3 about edge 0-1; not convex where x < 0: the other diagonal lies outside."""
    V = np.array([[0, 0, 0], [2, 0, 0], [-x, 1, 0], [-x, -1, 0]], float)
    return V, np.array([[0, 1, 2], [1, 0, 3]])


@pytest.mark.parametrize(("x", "fits"), [(-0.5, True), (0.0, False), (0.5, False)])
def test_a_flip_in_a_dart_would_fold(x, fits):
    V, F = dart(x)
    normals = [naive.normal(V, f)[2] for f in naive.flip(F, 0, 1)]
    assert (min(normals) > 0) == fits
    mesh = built(V, F)
    h = half_edge(mesh, 0, 1)
    assert bends_quad(mesh, h, int(mesh.twin[h]), 0.0) == (not fits)
    mesh.valence_excess[:] = [1, 1, -1, -1]
    tally = flip_edges(mesh, one_block(mesh), LOOSE, False)
    assert tally[FLIPPED if fits else KEPT_NORMAL] == 1


@pytest.mark.parametrize("degrees", [20, 44, 46, 70])
def test_normals_across_the_new_edge(degrees):
    """The new faces lean by a known angle each against their mean."""
    s, c = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    V = np.array([[0, c, -s], [0, -c, -s], [1, 0, 0], [-1, 0, 0]], float)  # new edge along x
    mesh = built(V, [[0, 1, 2], [1, 0, 3]])
    h = half_edge(mesh, 0, 1)
    assert bends_quad(mesh, h, int(mesh.twin[h]), STRICT.normal_cosine) == (degrees > 45)


@pytest.mark.parametrize("height", [0.5, 20.0])
def test_a_flip_folds_no_face_beside_its_quad(height):
    """The quad is a tent over its new edge; a wall stands at one side, steep or steeper than 150 degrees.

    With the old faces the wall is not folded.
    """
    V = np.array([[-1, 0, 0], [1, 0, 0], [0, 1, 0.8], [0, -1, 0.8], [1.4, 1.4, -height]], float)
    V[4, 2] = height
    F = [[0, 1, 2], [1, 0, 3], [2, 1, 4]]
    mesh = built(V, F)
    h = half_edge(mesh, 0, 1)
    new = [naive.normal(V, f) for f in naive.flip(F, 0, 1)]
    wall, old = naive.normal(V, F[2]), naive.normal(V, F[0])
    folds = any(naive.is_folded(wall, n) for n in new[1:]) and not naive.is_folded(wall, old)
    assert folds == folds_neighbour(mesh, h, int(mesh.twin[h]))


def test_sliver_check_is_an_option():
    """A flip that evens out valences but makes needles."""
    V = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -1, 0]], float)
    for checked in (False, True):
        mesh = built(V, [[0, 1, 2], [1, 0, 3]])
        mesh.valence_excess[:] = [1, 1, -1, -1]
        before = copied(mesh)
        tally = flip_edges(mesh, one_block(mesh), LOOSE._replace(sliver_check=checked), False)
        assert tally[KEPT_SLIVER if checked else FLIPPED] == 1
        if checked:
            assert_same_bits(mesh, before)


def test_delaunay_breaks_ties():
    V = np.array([[0, 0, 0], [2, 0, 0], [1, 0.3, 0], [1, -0.3, 0]], float)
    for ties in (False, True):
        mesh = built(V, [[0, 1, 2], [1, 0, 3]])
        mesh.valence_excess[:] = [1, 1, 0, 0]  # gain 0
        tally = flip_edges(mesh, one_block(mesh), LOOSE._replace(delaunay_ties=ties), False)
        assert tally[FLIPPED] == ties


def test_ties_do_not_flip_back_and_forth():
    V, F = zoo.grid(9, 9)  # squares: both diagonals are Delaunay
    mesh = built(V, F, ordered=True)
    passes = [flip_edges(mesh, one_block(mesh), STRICT, False)[FLIPPED] for _ in range(12)]
    assert passes[0] > 0 and passes[-1] == 0


# --- curves --------------------------------------------------------------------------------------


@pytest.mark.parametrize("flag", [0, 7, 7 + NON_MANIFOLD, FROZEN, HALTED])
def test_edges_on_curves_do_not_flip(flag):
    """However much it would gain."""
    V, F = dart(-0.5)
    mesh = built(V, F)
    mesh.valence_excess[:] = [10, 10, -10, -10]
    h = half_edge(mesh, 0, 1)
    mesh.curve[[h, mesh.twin[h]]] = flag
    before = copied(mesh)
    assert not flip_edges(mesh, one_block(mesh), LOOSE, False).any()
    assert_same_bits(mesh, before)
    mesh.curve[[h, mesh.twin[h]]] = NONE
    assert flip_edges(mesh, one_block(mesh), LOOSE, False)[FLIPPED] == 1


def test_flags_travel_with_their_edges():
    """The sides of the quad change their slots, on their other faces they stay where they are."""
    V, F = zoo.grid(6, 6)
    a, b = next(
        e
        for e in map(sorted, naive.edges(F))
        if not any(v in edge for v in e for edge in naive.boundary_edges(F))
    )
    quad = [f for f in F.tolist() if {a, b} <= set(f)]
    c, d = (next(v for v in f if v not in (a, b)) for f in quad)
    for side in ((a, c), (c, b), (b, d), (d, a)):
        for flag in (7, 7 + NON_MANIFOLD, FROZEN, HALTED):
            mesh = built(V, F)
            alone(mesh, a, b)
            h = half_edge(mesh, *side)
            mesh.curve[[h, mesh.twin[h]]] = flag
            mesh.kind[list(side)] = FIXED
            before = curve_edges(mesh)
            assert flip_edges(mesh, one_block(mesh), LOOSE, False)[FLIPPED] == 1
            assert curve_edges(mesh) == before
            restore(mesh)
            assert_valid(mesh)
            new = half_edge(mesh, c, d)
            assert mesh.curve[new] == mesh.curve[mesh.twin[new]] == NONE


@pytest.mark.parametrize("per_block", [12, 100_000])
@pytest.mark.parametrize("seed", range(3))
def test_no_number_of_flips_changes_a_curve(seed, per_block, monkeypatch):
    """A web of curves over a bad triangulation; the flags are compared as pairs of vertices."""
    V, F = zoo.planar_delaunay(250, seed)
    V, F = zoo.perturb(V, F, 0.1, seed)
    mesh = built(V, F, ordered=True)
    rng = np.random.default_rng(seed)
    pairs = [sorted(e) for e in naive.edges(faces_of(mesh))]
    draw(mesh, *(pairs[k] for k in rng.choice(len(pairs), 120, replace=False)))
    curves, ends = curve_edges(mesh), mesh.kind.copy()
    total = 0
    for _ in range(4):
        total += flip_edges(mesh, blocks_of(mesh, per_block, monkeypatch), STRICT, False)[FLIPPED]
        assert curve_edges(mesh) == curves
        assert_valid(mesh)
    assert total > 50 and np.array_equal(mesh.kind, ends)


def test_sources_stay_in_their_patch():
    """A flip may move a face of the reference only as far as its neighbour, which is no further curve."""
    V, F = zoo.grid(9, 9)
    line = 9 * np.arange(9) + 4
    mesh = built(V, F)
    draw(mesh, line.tolist())
    side = V[F].mean(axis=1)[:, 1] > 4
    for _ in range(4):
        alone_on(mesh, np.random.default_rng(0))
        flip_edges(mesh, one_block(mesh), LOOSE, False)
        G = mesh.origin.reshape(-1, 3)
        assert np.array_equal(V[G].mean(axis=1)[:, 1] > 4, side[mesh.source])


def alone_on(mesh, rng):
    """Tell lies about all valences, so that many edges want to flip."""
    mesh.valence_excess[:] = rng.integers(-2, 6, len(mesh.X))


# --- everything at once --------------------------------------------------------------------------


@pytest.mark.parametrize("name", zoo.TIDY)
@pytest.mark.parametrize("per_block", [6, 40, 100_000])
def test_flips_keep_topology_and_bring_valences_to_six(name, per_block, monkeypatch):
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.02)
    mesh = built(V, F, ordered=True)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    before, X = shape_of(F), mesh.X.copy()
    for limits in (LOOSE, STRICT):
        for _ in range(3):
            error = np.abs(mesh.valence_excess).sum()
            tally = flip_edges(mesh, blocks, limits, False)
            assert tally[NOT_OWNED] == 0
            assert_valid(mesh)
            assert shape_of(faces_of(mesh)) == before
            after = np.abs(mesh.valence_excess).sum()
            assert after <= error
            if limits is LOOSE:
                assert after < error or not tally[FLIPPED]
    assert np.array_equal(mesh.X, X)


def test_every_flip_of_a_pass_still_gains():
    """A neighbour's flip may have taken the gain away: then the candidate is let go."""
    V, F = zoo.planar_delaunay(400)
    mesh = built(V, F, ordered=True)
    rounds = [flip_edges(mesh, one_block(mesh), LOOSE, False) for _ in range(10)]
    assert rounds[0][NO_LONGER_WANTED] > 0
    assert rounds[-1][FLIPPED] == 0
