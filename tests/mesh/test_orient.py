"""Consistent winding: what is flipped, what stays, and where no orientation exists."""

import time
from collections import Counter, defaultdict, deque

import numpy as np
import pytest
from helpers import zoo
from hypothesis import given
from hypothesis import strategies as st

from data.shapes import topology
from remeshvec.mesh.orient import orient_faces
from remeshvec.mesh.twins import match_halfedges

CLOSED = ["icosphere", "torus", "genus_3"]
OPEN = ["annulus", "grid", "planar_delaunay", "sliver_fan"]


def oriented(F):
    """Call with int32 faces; what must always hold is checked here."""
    F = np.asarray(F, dtype=np.int32).reshape(-1, 3)
    before = F.copy()
    F2, flipped = orient_faces(F, int(F.max(initial=0)) + 1)
    assert np.array_equal(F, before)
    assert F2.dtype == np.int32 and flipped.dtype == np.bool_ and flipped.shape == (len(F),)
    assert (F2 is F) == (not flipped.any())
    assert np.array_equal(F2, turned(F, flipped))
    return F2, flipped


def proper(F):
    """Faces of three different corners."""
    return np.array(topology.proper(F), dtype=np.int32).reshape(-1, 3)


def turned(F, which):
    """Swap corners 1 and 2 of some faces."""
    return np.where(np.asarray(which)[:, None], np.asarray(F)[:, [0, 2, 1]], F)


def some(count, share, seed):
    """Choose a share of so many faces at random."""
    chosen = np.zeros(count, dtype=bool)
    order = np.random.default_rng(seed).permutation(count)
    chosen[order[: round(share * count)]] = True
    return chosen


def inconsistent_edges(F):
    """Return the edges of two faces that both run the same way."""
    directed = Counter((f[c], f[(c + 1) % 3]) for f in topology.proper(F) for c in range(3))
    pairs = [edge for edge, users in topology.edge_faces(F).items() if len(users) == 2]
    return [(a, b) for a, b in pairs if directed[a, b] != 1]


def ends(edges):
    """Count the edges at every vertex."""
    return Counter(v for edge in edges for v in edge)


def is_connected(edges):
    """Whether a walk along these edges reaches all of them."""
    beside = defaultdict(set)
    for a, b in edges:
        beside[a].add(b)
        beside[b].add(a)
    return topology.groups(beside) == 1


def naive_flips(F):
    """Flip as `orient_faces` does, with sets and lists."""
    F = np.asarray(F).tolist()
    users = defaultdict(list)
    for f, corners in enumerate(F):
        if len(set(corners)) == 3:
            for edge in edges_in_order(corners):
                users[frozenset(edge)].append(f)
    flipped = {}
    for first in range(len(F)):
        if first in flipped or len(set(F[first])) < 3:
            continue
        flipped[first], part, queue = False, [first], deque([first])
        while queue:
            f = queue.popleft()
            for edge in edges_in_order(F[f]):
                pair = users[frozenset(edge)]
                for g in pair if len(pair) == 2 else ():
                    if g not in flipped:
                        same = runs(F[f], *edge) == runs(F[g], *edge)
                        flipped[g] = flipped[f] != same
                        part.append(g)
                        queue.append(g)
        if sum(flipped[f] for f in part) > len(part) / 2:
            flipped.update({f: not flipped[f] for f in part})
    return [flipped.get(f, False) for f in range(len(F))]


def edges_in_order(corners):
    """Return the edges from corner 0 towards the smaller of the others and on around."""
    a, (b, c) = corners[0], sorted(corners[1:])
    return [(a, b), (b, c), (c, a)]


def runs(corners, a, b):
    """Whether a face runs its edge from a to b."""
    return (a, b) in zip(corners, corners[1:] + corners[:1], strict=True)


# --- orientable ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", zoo.TIDY)
def test_consistent_faces_stay_as_they_are(name):
    F2, flipped = oriented(zoo.ZOO[name].make()[1])
    assert not flipped.any()
    assert topology.is_oriented(F2)


@pytest.mark.parametrize("share", [0.05, 0.3, 0.48])
@pytest.mark.parametrize("name", CLOSED + OPEN)
def test_a_minority_is_flipped_back(name, share):
    _, F = zoo.ZOO[name].make()
    wrong = some(len(F), share, seed=len(F))
    G = turned(F, wrong)
    assert not topology.is_oriented(G)
    F2, flipped = oriented(G)
    assert np.array_equal(F2, F)
    assert np.array_equal(flipped, wrong)


@pytest.mark.parametrize("name", CLOSED + OPEN)
def test_the_majority_keeps_its_winding(name):
    _, F = zoo.ZOO[name].make()
    wrong = some(len(F), 0.6, seed=3)
    F2, flipped = oriented(turned(F, wrong))
    assert np.array_equal(F2, turned(F, np.ones(len(F), bool)))
    assert np.array_equal(flipped, ~wrong)


def test_volume_does_not_decide():
    V, F = zoo.icosphere()
    inward = turned(F, np.ones(len(F), bool))
    F2, flipped = oriented(inward)
    assert not flipped.any() and zoo.volume(V, F2) < 0
    F2, _ = oriented(turned(inward, some(len(F), 0.4, seed=0)))
    assert np.array_equal(F2, inward)


def test_the_first_face_decides_a_tie():
    _, F = zoo.square()
    assert oriented(turned(F, [False, True]))[1].tolist() == [False, True]
    assert oriented(turned(F, [True, False]))[1].tolist() == [False, True]
    _, F = zoo.octahedron()
    for first in (False, True):
        half = np.arange(8) % 2 == first
        assert oriented(turned(F, half))[1].tolist() == (np.arange(8) % 2 == 1).tolist()


def test_every_component_decides_for_itself():
    parts = [zoo.torus()[1], zoo.icosphere()[1], zoo.annulus()[1], zoo.triangle()[1]]
    shares = [0.3, 0.7, 0.1, 1.0]
    F, wrong = [], []
    for k, (part, share) in enumerate(zip(parts, shares, strict=True)):
        F.append(part + 1000 * k)
        wrong.append(some(len(part), share, seed=k))
    expected = np.concatenate([~w if 0.5 < w.mean() < 1 else w & (w.mean() < 1) for w in wrong])
    F, wrong = np.concatenate(F), np.concatenate(wrong)
    shuffle = np.random.default_rng(5).permutation(len(F))
    F2, flipped = oriented(turned(F, wrong)[shuffle])
    assert np.array_equal(flipped, expected[shuffle])
    assert topology.is_oriented(F2)


def test_parts_that_share_a_vertex_are_apart():
    _, F = zoo.pinched_tetrahedra()
    wrong = np.array([False, True, False, False, True, True, True, False])
    assert oriented(turned(F, wrong))[1].tolist() == [*wrong[:4], *~wrong[4:]]


def test_a_long_strip_does_not_run_out_of_anything():
    _, F = zoo.grid(50_000, 2)
    wrong = some(len(F), 0.45, seed=1)
    assert np.array_equal(oriented(turned(F, wrong))[1], wrong)


def test_a_hub_of_any_size_takes_linear_time():
    _, F = zoo.bipyramid(150_000)
    F = (F + 1) % 150_002  # one hub comes first, the other last
    wrong = some(len(F), 0.45, seed=1)
    oriented(zoo.square()[1])  # compiled before the clock starts
    start = time.perf_counter()
    F2, _ = orient_faces(turned(F, wrong).astype(np.int32), 150_002)
    assert time.perf_counter() - start < 5.0  # about 0.02 s; chains at the hub would take a minute
    assert np.array_equal(F2, F)


# --- not orientable ------------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "m"), [(20, 4), (31, 3), (50, 2), (24, 12), (9, 10)])
def test_a_moebius_strip_is_inconsistent_along_one_line_across(n, m):
    _, F = zoo.moebius(n, m)
    boundary = {
        v for edge, users in topology.edge_faces(F).items() if len(users) == 1 for v in edge
    }
    for seed in range(4):
        G = turned(F, some(len(F), seed / 4, seed))
        G = G[np.random.default_rng(seed).permutation(len(G))]
        F2, _ = oriented(G)
        left = inconsistent_edges(F2)
        count = ends(left)
        assert is_connected(left)
        assert sorted(count.values()) == [1, 1] + [2] * (len(left) - 1)
        assert {v for v in count if v in boundary} == {v for v in count if count[v] == 1}
        assert len(left) <= 3 * m  # a line as short as the strip is wide, or nearly


def test_a_wide_moebius_strip_may_be_cut_along_its_middle():
    """From a face on the rim the two ways around meet first on a closed line in the middle."""
    _, F = zoo.moebius(4, 21)
    at_rim = np.flatnonzero((F % 21 == 0).any(axis=1))[0]
    left = inconsistent_edges(oriented(np.vstack([F[at_rim], np.delete(F, at_rim, axis=0)]))[0])
    assert is_connected(left) and set(ends(left).values()) == {2}


def klein_bottle(n=12, m=9):
    F = zoo.wrapped_grid(n, m, True, True)
    last = (F // m == n - 1).any(axis=1)[:, None] & (m > F)  # across the seam: mirrored
    return np.where(last, (m - F) % m, F)


@pytest.mark.parametrize("seed", range(4))
def test_a_klein_bottle_keeps_closed_lines(seed):
    F = klein_bottle()
    assert topology.is_closed(F) and topology.is_vertex_manifold(F)
    F2, _ = oriented(turned(F, some(len(F), 0.5, seed)))
    left = inconsistent_edges(F2)
    assert left and all(count % 2 == 0 for count in ends(left).values())


@pytest.mark.parametrize("F", [zoo.moebius()[1], klein_bottle()], ids=["moebius", "klein"])
def test_the_cut_does_not_depend_on_windings(F):
    expected = set(inconsistent_edges(oriented(F)[0]))
    for seed in range(5):
        F2, _ = oriented(turned(F, some(len(F), 0.2 * seed, seed)))
        assert set(inconsistent_edges(F2)) == expected
        assert not oriented(F2)[1].any()  # nothing to gain from a second call


# --- dirt ----------------------------------------------------------------------------------------


def cubes_with_a_wall():
    """Two cubes and the wall between them, and which of the three patches each face is in."""
    V, F = zoo.voxels([[1, 1]])  # the second axis is y
    wall = np.flatnonzero(V[:, 1] == 1)
    a, b, c, d = wall[np.lexsort(V[wall][:, [0, 2]].T)]
    F = np.vstack([F, [[a, b, d], [a, d, c]]])
    patch = np.where(V[F][:, :, 1].mean(axis=1) < 1, 0, 1)
    patch[-2:] = 2
    return F, patch


def test_patches_around_a_non_manifold_edge_decide_for_themselves():
    F, patch = cubes_with_a_wall()
    users = [len(u) for u in topology.edge_faces(F).values()]
    assert users.count(3) == 4 and set(users) == {2, 3}
    assert not oriented(F)[1].any()
    assert np.bincount(patch).tolist() == [10, 10, 2]
    for seed in range(6):
        wrong = np.zeros(len(F), dtype=bool)
        wrong[patch == 0] = some(10, 0.3, seed)
        wrong[patch == 1] = some(10, 0.7, seed)
        wrong[-1] = True
        expected = np.where(patch == 1, ~wrong, wrong)
        assert np.array_equal(oriented(turned(F, wrong))[1], expected)


def test_sheets_on_one_line_are_not_compared():
    _, F = zoo.three_half_discs()
    sheet = np.repeat([False, True, False], len(F) // 3)
    assert not oriented(turned(F, sheet))[1].any()


def test_repeated_faces():
    f = [[0, 1, 2]]
    assert oriented([*f, [0, 2, 1]])[1].tolist() == [False, False]  # a closed pillow
    assert oriented([*f, *f])[1].tolist() == [False, True]
    assert oriented([*f, *f, *f])[1].tolist() == [False] * 3
    _, F = zoo.duplicate_face()  # on a tetrahedron: its three edges have three faces
    assert not oriented(turned(F, [True, True, False, True, False]))[1][[0, 4]].any()


def test_few_or_no_faces():
    assert not oriented(np.zeros((0, 3)))[1].any()
    assert not oriented([[0, 1, 2]])[1].any()


FACES = st.lists(st.tuples(*[st.integers(0, 6)] * 3), max_size=16)


@given(FACES)
def test_any_faces_are_flipped_as_the_naive_twin_does(faces):
    F = proper(faces)
    F2, flipped = oriented(F)
    assert flipped.tolist() == naive_flips(F)
    assert not oriented(F2)[1].any()


@pytest.mark.parametrize("seed", range(40))
def test_random_faces_are_flipped_as_the_naive_twin_does(seed):
    rng = np.random.default_rng(seed)
    F = proper(rng.integers(0, rng.integers(4, 12), (rng.integers(1, 30), 3)))
    assert oriented(F)[1].tolist() == naive_flips(F)


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("seed", range(40))
def test_the_check_counts_what_is_inconsistent(seed, parallel):
    F = proper(np.random.default_rng(seed).integers(0, 8, (20, 3)))
    pairs = match_halfedges(F.reshape(-1), 8, parallel, by_winding=False)
    assert pairs.found.inconsistent_edges == len(inconsistent_edges(F))
    users = topology.edge_faces(F)
    assert pairs.found.non_manifold_edges == sum(len(faces) > 2 for faces in users.values())


@pytest.mark.parametrize("name", zoo.DIRTY)
def test_dirty_meshes_are_flipped_as_the_naive_twin_does(name):
    _, F = zoo.ZOO[name].make()
    for seed in range(3):
        G = proper(turned(F, some(len(F), 0.5, seed)))
        assert oriented(G)[1].tolist() == naive_flips(G)
