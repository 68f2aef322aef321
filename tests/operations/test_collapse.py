"""Collapses: each guard refuses where a weaker one would break the mesh, the rest is done right."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.collapses import LOOSE, survivor_of
from helpers.structure import (
    assert_same_bits,
    assert_valid,
    blocks_of,
    built,
    copied,
    faces_of,
    half_edge,
    one_block,
    shape_of,
)

from data.shapes import topology
from remeshvec.core.vocabulary import CURVE, DEAD, FIXED, HELD, INNER
from remeshvec.operations.collapse import collapse_short_edges
from remeshvec.operations.guards import keeps_curves
from remeshvec.operations.outcomes import (
    COLLAPSED,
    KEPT_CURVE,
    KEPT_FOLDOVER,
    KEPT_LINK,
    KEPT_OVERSHOOT,
    KEPT_SLIVER,
    N_COLLAPSE_OUTCOMES,
)
from remeshvec.operations.rings import RING_CAPACITY


def limits(shortest, **changes):
    return LOOSE._replace(shortest=shortest, **changes)


def outcomes(mesh, shortest, **changes):
    return collapse_short_edges(mesh, one_block(mesh), limits(shortest, **changes), False)


def assert_only(tally, outcome, count=1):
    expected = np.zeros(N_COLLAPSE_OUTCOMES, int)
    expected[outcome] = count
    assert tally.tolist() == expected.tolist()


def pulled(V, a, b, length=0.1):
    """Move b towards a."""
    V = V.copy()
    V[b] = V[a] + length * (V[b] - V[a]) / np.linalg.norm(V[b] - V[a])
    return V


# --- what a collapse makes -----------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["octahedron", "icosahedron", "torus", "grid", "annulus", "genus_2"]
)
def test_each_single_collapse_is_that_of_the_twin(name):
    """Every edge in turn, as the only candidate; with the guards of geometry as far off as they go."""
    V, F = zoo.ZOO[name].make()
    refused = taken = 0
    for edge in sorted(map(sorted, naive.edges(F)))[:40]:
        a, b = edge
        W = pulled(V, a, b, length=1e-3)
        mesh = built(W, F)
        before = copied(mesh)
        tally = outcomes(mesh, 2e-3)
        assert tally.sum() == 1
        assert_valid(mesh)
        if not tally[COLLAPSED]:
            assert_same_bits(mesh, before)
            refused += 1
            continue
        taken += 1
        survivor = survivor_of(mesh, a, b)
        removed = a + b - survivor
        expected = naive.collapse(F, survivor, removed)
        assert topology_of(faces_of(mesh)) == topology_of(expected)
        assert shape_of(expected) == shape_of(F)
        assert mesh.vertex_halfedge[removed] == DEAD
        at = (W[a] + W[b]) / 2 if before.kind[a] == before.kind[b] else W[survivor]
        assert mesh.X[survivor, :3] == pytest.approx(at)
        assert before.kind[survivor] >= before.kind[removed]
    assert taken > 0


def topology_of(F):
    """Faces up to where each starts."""
    return sorted(tuple(np.roll(f, -int(np.argmin(f))).tolist()) for f in np.asarray(F))


def test_boundary_collapses_keep_kinds_and_places():
    V, F = zoo.grid()  # unit spacing; the bottom row runs along x
    rim = {v for edge in naive.boundary_edges(F) for v in edge}
    inner = next(v for v in naive.neighbours(F) if v not in rim and naive.neighbours(F)[v] & rim)
    wall = next(w for w in naive.neighbours(F)[inner] & rim if V[w, 0] == V[inner, 0])
    mesh = built(pulled(V, wall, inner), F)
    assert_only(outcomes(mesh, 0.2), COLLAPSED)
    assert mesh.vertex_halfedge[inner] == DEAD and mesh.kind[wall] == CURVE
    assert np.array_equal(mesh.X[wall, :3], V[wall])
    assert_valid(mesh)


def test_fixed_vertices_stay_and_swallow_others():
    V, F = zoo.grid()
    for fixed in (0, 1):
        a, b = sorted(sorted(naive.boundary_edges(F), key=sorted)[1])
        mesh = built(pulled(V, a, b), F)
        held = (a, b)[fixed]
        mesh.kind[held] = FIXED
        place = mesh.X[held].copy()
        assert_only(outcomes(mesh, 0.2), COLLAPSED)
        assert mesh.kind[held] == FIXED and np.array_equal(mesh.X[held], place)
        assert mesh.vertex_halfedge[a + b - held] == DEAD
        assert_valid(mesh)


def test_the_quadric_point_stays_on_the_planes_and_within_reach():
    V, F = zoo.upsampled(*zoo.cube(), n=2, noise=0.0)
    corner = int(np.argmin(V.sum(axis=1)))
    other = min(naive.neighbours(F)[corner], key=lambda w: np.linalg.norm(V[w] - V[corner]))
    W = pulled(V, corner, other, length=0.05)
    mesh = built(W, F)
    assert_only(outcomes(mesh, 0.06, quadric_reach=1.0), COLLAPSED)
    survivor = corner if mesh.vertex_halfedge[corner] != DEAD else other
    assert np.linalg.norm(mesh.X[survivor, :3] - V[corner]) < 0.005  # midpoint: 0.025
    mesh = built(W, F)
    outcomes(mesh, 0.06, quadric_reach=0.01)
    step = mesh.X[survivor, :3] - (W[corner] + W[other]) / 2
    assert np.linalg.norm(step) == pytest.approx(0.01)


def test_nothing_short_nothing_done():
    mesh = built(*zoo.torus())
    before = copied(mesh)
    assert not outcomes(mesh, 1e-3).any()
    assert_same_bits(mesh, before)


# --- guards --------------------------------------------------------------------------------------


def test_link_condition_tetrahedron():
    """Links of the ends meet in the two apexes only, as vertices: the edge between these tells."""
    V, F = zoo.tetrahedron()
    mesh = built(pulled(V, 0, 1), F)
    assert naive.neighbours(F)[0] & naive.neighbours(F)[1] == {2, 3}  # a weaker rule is content
    assert not naive.link_condition(F, 0, 1)
    assert (
        len(naive.collapse(F, 0, 1)) == topology.duplicate_faces(naive.collapse(F, 0, 1)) + 1 == 2
    )
    assert_only(outcomes(mesh, 0.2), KEPT_LINK)


def necklace():
    """Torus with three vertices around: the 3-cycles around the tube bound no face."""
    V, F = zoo.torus(12, 3, radius=0.3)
    return V, F


def test_link_condition_necklace():
    V, F = necklace()
    ring = naive.neighbours(F)
    a, b = next(
        (a, b)
        for a, b in map(sorted, naive.edges(F))
        if any({a, b, c} not in [set(f) for f in F.tolist()] for c in ring[a] & ring[b])
    )
    find_tips = {v for f in F.tolist() if {a, b} <= set(f) for v in f} - {a, b}
    assert len(find_tips) == 2 and len(ring[a] & ring[b]) == 3
    assert not naive.link_condition(F, a, b)
    broken = naive.collapse(F, a, b)
    assert not zoo.is_edge_manifold(broken)
    tally = outcomes(built(pulled(V, a, b, 1e-3), F), 2e-3)
    assert_only(tally, KEPT_LINK)


def test_link_condition_boundary_loop_of_three():
    """A hole of three edges stays: closing it would lose a loop."""
    V, F = zoo.icosahedron()
    hole, F = F[0], F[1:]
    a, b = sorted((int(hole[0]), int(hole[1])))
    assert len(zoo.boundary_loops(F)) == 1
    assert not naive.link_condition(F, a, b)
    assert len(zoo.boundary_loops(naive.collapse(F, a, b))) != 1 or not zoo.is_vertex_manifold(
        naive.collapse(F, a, b)
    )
    assert_only(outcomes(built(pulled(V, a, b, 1e-3), F), 2e-3), KEPT_LINK)


@pytest.mark.parametrize("name", zoo.TIDY)
def test_guards_of_topology_agree_with_the_link_condition(name):
    """Boundary and link guard together refuse what the definition refuses, no more."""
    V, F = zoo.ZOO[name].make()
    for a, b in sorted(map(sorted, naive.edges(F)))[:60]:
        mesh = built(pulled(V, a, b, 1e-6), F)
        tally = outcomes(mesh, 2e-6)
        refused = tally[KEPT_LINK] + tally[KEPT_CURVE] > 0
        too_many = max(len(naive.neighbours(F)[v]) for v in (a, b)) >= RING_CAPACITY - 1
        assert refused == (not naive.link_condition(F, a, b)) or too_many, (a, b)


def test_boundary_guard_bridge():
    """An inner edge between two boundary vertices: its collapse would pinch the surface."""
    V, F = zoo.annulus(16, 2)
    rim = {v for edge in naive.boundary_edges(F) for v in edge}
    a, b = next(sorted(e) for e in naive.edges(F) if e <= rim and e not in naive.boundary_edges(F))
    common = naive.neighbours(F)[a] & naive.neighbours(F)[b]
    assert len(common) == 2  # a link condition without the boundary is content
    assert not zoo.is_vertex_manifold(naive.collapse(F, a, b))
    assert_only(outcomes(built(pulled(V, a, b, 1e-3), F), 2e-3), KEPT_CURVE)


def test_boundary_guard_lone_face():
    V, F = zoo.triangle()
    mesh = built(pulled(V, 0, 1), F)
    assert_only(outcomes(mesh, 0.2), KEPT_CURVE)
    assert not keeps_curves(mesh, half_edge(mesh, 0, 1), 0, 1)


def test_two_fixed_vertices_stay_apart():
    V, F = zoo.grid()
    a, b = sorted(sorted(naive.boundary_edges(F), key=sorted)[0])
    mesh = built(pulled(V, a, b), F)
    mesh.kind[[a, b]] = FIXED
    assert_only(outcomes(mesh, 0.2), KEPT_CURVE)


@pytest.mark.parametrize("kind", [INNER, HELD, FIXED])
def test_tips_stay_where_they_are(kind):
    """A tip swallows inner vertices, and no other kind swallows a tip."""
    V, F = zoo.grid()
    a, b = inner_edge = next(
        (a, b)
        for a, b in map(sorted, naive.edges(F))
        if not any({a, b} & edge for edge in naive.boundary_edges(F))
    )
    for tip, other in (inner_edge, inner_edge[::-1]):
        mesh = built(pulled(V, a, b), F)
        mesh.kind[tip], mesh.kind[other] = HELD, kind
        place = mesh.X[tip].copy()
        assert_only(outcomes(mesh, 0.2), COLLAPSED if kind == INNER else KEPT_CURVE)
        assert mesh.kind[tip] == HELD and np.array_equal(mesh.X[tip], place)
        assert mesh.vertex_halfedge[tip] != DEAD


def test_overshoot():
    """The edge is short and its ends' edges are not too long, but those of the midpoint would be."""
    V, F = zoo.grid()
    a, b = 16, 17
    assert frozenset((a, b)) in naive.edges(F)
    V[:, 1] *= 3.0
    V = pulled(V, a, b, 0.6)
    around = (naive.neighbours(F)[a] | naive.neighbours(F)[b]) - {a, b}
    after = max(np.linalg.norm(V[w] - (V[a] + V[b]) / 2) for w in around)
    longest = max(naive.edge_length(V, (v, w)) for v in (a, b) for w in naive.neighbours(F)[v])
    assert longest != pytest.approx(after)
    mesh = built(V, F)
    assert_only(outcomes(mesh, 0.7, longest=after * (1 - 1e-9)), KEPT_OVERSHOOT)
    assert_only(outcomes(mesh, 0.7, longest=after * (1 + 1e-9)), COLLAPSED)


def test_no_edge_gets_longer_than_allowed():
    V, F = zoo.perturb(*zoo.icosphere(3), amount=0.15)
    L = 2 * zoo.mean_edge(V, F)
    mesh = built(V, F, ordered=True)
    tally = outcomes(mesh, 0.8 * L, longest=4 / 3 * L, foldover_cosine=0.9)
    assert tally[COLLAPSED] > 100 and tally[KEPT_OVERSHOOT] > 0
    W, G = mesh.X[:, :3], faces_of(mesh)
    assert not naive.long_edges(W, G, 4 / 3 * L)


def test_foldover_refuses_to_turn_a_flat_face_over():
    """The midpoint of 0-1 lies just behind edge 2-3 of face 0-2-3, which would turn over."""
    P = [[0, 0], [2, 0], [0.95, 3], [0.97, 6], [-4, 0], [1, -4], [6, 0], [4, 5]]
    F = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 1], [1, 5, 6], [1, 6, 7], [1, 7, 2]]
    V, F = np.column_stack([P, np.zeros(8)]), np.array([*F, [2, 7, 3]])
    assert all(naive.normal(V, f)[2] > 0 for f in naive.tuples(F))
    assert naive.link_condition(F, 0, 1)  # topology is content
    W = V.copy()
    W[0] = [1, 0, 0]
    after = [naive.normal(W, f)[2] for f in naive.collapse(F, 0, 1)]
    assert sum(z < 0 for z in after) == 1
    assert_only(outcomes(built(V, F), 2.1), KEPT_FOLDOVER)
    V[2:4, 0] += 0.2  # now the midpoint stays in front of the edge
    assert_only(outcomes(built(V, F), 2.1), COLLAPSED)


@pytest.mark.parametrize("degrees", [5.0, 20.0, 60.0])
def test_foldover_by_angle(degrees):
    """A ridge edge shortened over a crease turns the faces beside it by a known angle."""
    refused = []
    for lift in np.linspace(0.02, 2.1, 25):
        V, F = zoo.grid(5, 5)
        a, b = 12, 13
        V = pulled(V, a, b, 0.4)
        V[b, 2] += lift * 0.4
        W = V.copy()
        W[a] = W[b] = (V[a] + V[b]) / 2
        stays = [f for f in naive.tuples(F) if (a in f) != (b in f)]
        worst = max(naive.angle(np.zeros(3), naive.normal(V, f), naive.normal(W, f)) for f in stays)
        mesh = built(V, F)
        short = 1.0001 * np.linalg.norm(V[a] - V[b])
        tally = outcomes(mesh, short, foldover_cosine=np.cos(np.radians(degrees)))
        assert tally[KEPT_FOLDOVER] == (worst > np.radians(degrees))
        refused.append(bool(tally[KEPT_FOLDOVER]))
    assert not refused[0] and (refused[-1] or degrees > 40)


def test_foldover_sees_faces_at_both_ends():
    """Whichever end survives: mirror images are refused alike."""
    V, F = zoo.grid(5, 5)
    V = pulled(V, 12, 13, 0.4)
    for lifted in (12, 13):
        W = V.copy()
        W[lifted, 2] += 0.8
        tally = outcomes(built(W, F), 0.9, foldover_cosine=np.cos(np.radians(20)))
        assert_only(tally, KEPT_FOLDOVER)


def test_sliver_check_is_an_option():
    V, F = zoo.icosphere(1)
    a, b = sorted(next(iter(naive.edges(F))))
    middle = (V[a] + V[b]) / 2
    W = V.copy()
    W[a] = W[b] = middle
    stays = [f for f in naive.tuples(F) if (a in f) != (b in f)]
    around = [f for f in naive.tuples(F) if a in f or b in f]
    assert min(shape(W, f) for f in stays) < min(shape(V, f) for f in around)
    short = naive.edge_length(V, (a, b)) * (1 + 1e-9)
    others = [e for e in naive.edges(F) if naive.edge_length(V, e) < short]
    for checked in (False, True):
        mesh = built(V, F)
        tally = outcomes(mesh, short, sliver_check=checked)
        assert (tally[KEPT_SLIVER] > 0) == checked
        assert tally[COLLAPSED] > 0 or checked
    assert others


def shape(V, f):
    lengths = [((V[f[i]] - V[f[i - 1]]) ** 2).sum() for i in range(3)]
    return 2 * np.sqrt(3) * np.linalg.norm(naive.normal(V, f)) / sum(lengths)


def test_sliver_check_compares_the_worst_before_and_after():
    V, F = zoo.perturb(*zoo.icosphere(1), amount=0.15)
    seen = set()
    for a, b in sorted(map(sorted, naive.edges(F))):
        W = pulled(V, a, b, 0.2)
        W[a] += 1e-9  # no ties
        after = W.copy()
        after[a] = after[b] = (W[a] + W[b]) / 2
        around = [f for f in naive.tuples(F) if a in f or b in f]
        stays = [f for f in around if not {a, b} <= set(f)]
        worse = min(shape(after, f) for f in stays) < min(shape(W, f) for f in around)
        tally = outcomes(built(W, F), 0.21, sliver_check=True)
        if tally[KEPT_SLIVER] + tally[COLLAPSED] == 1:
            assert bool(tally[KEPT_SLIVER]) == worse
            seen.add(worse)
    assert seen == {False, True}


@pytest.mark.parametrize("name", ["torus", "planar_delaunay", "icosphere"])
def test_sliver_check_never_makes_the_worst_triangle_worse(name):
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), noise=0.3)
    mesh = built(V, F, ordered=True)
    worst = min(shape(mesh.X[:, :3], f) for f in faces_of(mesh).tolist())
    tally = outcomes(mesh, zoo.mean_edge(V, F), sliver_check=True)
    assert tally[COLLAPSED] > 5 and tally[KEPT_SLIVER] > 0
    assert min(shape(mesh.X[:, :3], f) for f in faces_of(mesh).tolist()) >= worst


def test_hubs_with_too_many_spokes_stay():
    n = RING_CAPACITY + 20
    V, F = zoo.bipyramid(n, top=1.0, bottom=-1.0)
    V = pulled(V, 0, n, 0.1)  # the tip n comes near rim vertex 0
    mesh = built(V, F)
    tally = outcomes(mesh, 0.11)
    assert tally[KEPT_LINK] > 0
    assert_valid(mesh)
    assert shape_of(faces_of(mesh)) == shape_of(F)


# --- everything at once --------------------------------------------------------------------------


@pytest.mark.parametrize("name", zoo.TIDY)
@pytest.mark.parametrize("per_block", [6, 40, 100_000])
def test_collapsing_all_that_goes_keeps_topology(name, per_block, monkeypatch):
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.05)
    mesh = built(V, F, ordered=True)
    before = shape_of(F)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    for _ in range(4):
        collapse_short_edges(mesh, blocks, limits(10.0), False)
        assert_valid(mesh)
        assert shape_of(faces_of(mesh)) == before


@pytest.mark.parametrize("name", ["icosphere", "planar_delaunay", "torus", "genus_3"])
def test_all_blocks_together_leave_no_short_edge_unseen(name, monkeypatch):
    """Whatever the blocks, every candidate gets an outcome: none is frozen at a border."""
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.01)
    mesh = built(V, F, ordered=True)
    short = np.quantile([naive.edge_length(V, e) for e in naive.edges(F)], 0.3)
    expected = len(naive.short_edges(V, F, short))
    tally = collapse_short_edges(mesh, blocks_of(mesh, 9, monkeypatch), limits(short), False)
    vanished = expected - tally.sum()  # candidates that died with a neighbour
    assert 0 <= vanished <= 2 * tally[COLLAPSED]
    assert tally[1] == 0
