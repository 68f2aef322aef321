"""Conflict-free sets: disjoint ranges, every candidate's turn comes, footprints are owned whole."""

from itertools import pairwise

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.dead_elements import with_room
from helpers.structure import assert_same_bits, blocks_of, built, copied, half_edge, tree_of

from remeshvec.core.vocabulary import DEAD, Blocks
from remeshvec.mesh import blocks as edge_sets
from remeshvec.mesh.blocks import OWNED, SHIFTED, list_range, per_stage_block, vertex_range
from remeshvec.operations import bisect, collapse, flip, untangle
from remeshvec.operations.classify import classify_edges
from remeshvec.operations.outcomes import N_COLLAPSE_OUTCOMES, N_FLIP_OUTCOMES


@pytest.mark.parametrize("per_block", [4, 17, 50, 10_000])
@pytest.mark.parametrize("name", ["triangle", "torus", "planar_delaunay", "two_components"])
def test_blocks_partition_the_mesh(name, per_block, monkeypatch):
    mesh = built(*zoo.ZOO[name].make(), ordered=True)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    for ends, size in ((blocks.face, mesh.origin.size // 3), (blocks.vertex, len(mesh.X))):
        assert ends[0] == 0 and ends[-1] == size and (np.diff(ends) >= 0).all()
    assert (
        len(blocks.face)
        == len(blocks.vertex)
        == max(1, round(len(mesh.origin) / 3 / per_block)) + 1
    )


def test_small_meshes_are_one_block_and_big_ones_many():
    assert len(edge_sets.make_blocks(built(*zoo.torus())).face) == 2
    mesh = built(*zoo.grid(150, 150), ordered=True)
    assert (
        len(edge_sets.make_blocks(mesh).face)
        == round(149 * 149 * 2 / edge_sets.FACES_PER_BLOCK) + 1
    )
    assert len(edge_sets.stages(edge_sets.make_blocks(mesh))) == 3


@pytest.mark.parametrize(("count", "expected"), [(1, 1), (2, 3), (4, 3), (5, 4), (16, 4), (17, 5)])
def test_stages_end_with_one_group(count, expected):
    ends = np.arange(count + 1)
    stages = edge_sets.stages(Blocks(ends, ends))
    assert stages == tuple(range(expected))
    assert per_stage_block(None, Blocks(ends, ends), stages[-1]) == 1
    assert vertex_range(Blocks(ends, ends), stages[-1], 0) == (0, count)


def test_one_block_needs_one_stage():
    assert edge_sets.stages(edge_sets.make_blocks(built(*zoo.torus()))) == (OWNED,)


@pytest.mark.parametrize("stage", [OWNED, SHIFTED, 2, 3])
def test_ranges_of_a_stage_are_disjoint(stage):
    blocks = Blocks(np.arange(0, 60, 10), np.array([0, 3, 9, 9, 20, 31]))
    pieces = range(per_stage_block(None, blocks, stage))
    ranges = [vertex_range(blocks, stage, k) for k in pieces]
    assert all(low <= high for low, high in ranges)
    assert all(one[1] <= two[0] for one, two in pairwise(ranges))
    if stage != SHIFTED:
        assert ranges[0][0] == 0 and ranges[-1][1] == 31
    lists = [range(*list_range(blocks, stage, k)) for k in pieces]
    if stage == 3:
        assert ranges == [(0, 31)] and list(lists[0]) == [0, 1, 2, 3, 4]
    if stage == 2:
        assert ranges == [(0, 20), (20, 31)] and [list(one) for one in lists] == [[0, 1, 2, 3], [4]]
    if stage == OWNED:
        assert [list(one) for one in lists] == [[0], [1], [2], [3], [4]]


def test_shifted_ranges_cover_the_borders():
    blocks = Blocks(np.arange(0, 50, 10), np.array([0, 10, 20, 30, 40]))
    ranges = [
        vertex_range(blocks, SHIFTED, k) for k in range(per_stage_block(None, blocks, SHIFTED))
    ]
    assert ranges == [(5, 15), (15, 25), (25, 35)]


def test_morton_blocks_own_most_edges(monkeypatch):
    mesh = built(*zoo.icosphere(4), ordered=True)
    blocks = blocks_of(mesh, 1024, monkeypatch)
    block = np.searchsorted(blocks.vertex, np.arange(len(mesh.X)), side="right")
    F = block[mesh.origin.reshape(-1, 3)]
    assert (F[:, :1] == F).all(axis=1).mean() > 0.75


# --- footprints ----------------------------------------------------------------------------------


def with_last(V, F, v):
    """Renumber so that vertex v comes last; returns V, F and the new numbers."""
    new = np.arange(len(V)) - (np.arange(len(V)) > v)
    new[v] = len(V) - 1
    W = np.empty_like(V)
    W[new] = V
    return W, new[F], new


def all_but_the_last_vertex(mesh):
    """One block with every face, one with none, and the last vertex."""
    m, n = mesh.origin.size // 3, len(mesh.X)
    return Blocks(np.array([0, m, m], np.int64), np.array([0, n - 1, n], np.int64))


def run_owned(driver, mesh, blocks, limits, h, n_outcomes, *marks):
    """Run one candidate through the first stage; returns whether it was dealt with."""
    candidates = one_candidate(3 * blocks.face, h)
    tally = np.zeros((2, n_outcomes), np.int64)
    driver(False, mesh, blocks, OWNED, limits, candidates, *marks, tally)
    return candidates.items[0] == edge_sets.DONE


def one_candidate(starts, candidate):
    """List a candidate in the first of two blocks."""
    candidates = edge_sets.make_candidates(starts)
    candidates.items[0] = candidate
    candidates.counts[0] = 1
    return candidates


def flip_owned(mesh, blocks, h):
    """Likewise for a flip; what it touches is its quad."""
    quad = {int(mesh.origin[g]) for side in (h, mesh.twin[h]) for g in face_of(side)}
    touched = np.zeros(len(mesh.X), np.uint8)
    done = run_owned(flip._flip, mesh, blocks, FLIPS, h, N_FLIP_OUTCOMES, touched)
    assert set(np.flatnonzero(touched).tolist()) == (quad if done else set())
    return done


def face_of(h):
    return range(h - h % 3, h - h % 3 + 3)


FLIPS = flip.FlipLimits(normal_cosine=0.0, delaunay_ties=True, sliver_check=False)


def quad():
    """Hexagonal patch: edge 0-1 is inside, violates Delaunay, and 2 and 3 are its apexes."""
    V = np.array([[-1, 0, 0], [1, 0, 0], [0, 0.4, 0], [0, -0.4, 0.0], [-3, 0, 0], [3, 0, 0]])
    F = [[0, 1, 2], [1, 0, 3], [0, 2, 4], [3, 0, 4], [2, 1, 5], [1, 3, 5]]
    return V, np.array(F)


def wanted(V, F, quad_vertices):
    """Mesh whose valences say that the quad's edge should flip."""
    mesh = built(V, F)
    mesh.valence_excess[list(quad_vertices)] = [1, 1, -1, -1]
    return mesh


def test_the_flip_itself_is_wanted():
    mesh = wanted(*quad(), range(4))
    blocks = Blocks(np.array([0, 6, 6]), np.array([0, 6, 6]))
    assert flip_owned(mesh, blocks, half_edge(mesh, 0, 1))
    half_edge(mesh, 2, 3)


@pytest.mark.parametrize("outside", range(4))
def test_a_flip_owns_the_four_vertices_of_its_quad(outside):
    """Both faces lie in the block, so a rule that owns faces only would let each of these run."""
    V, F, new = with_last(*quad(), outside)
    mesh = wanted(V, F, new[:4])
    before = copied(mesh)
    h = half_edge(mesh, new[0], new[1])
    for side in (h, int(mesh.twin[h])):
        assert not flip_owned(mesh, all_but_the_last_vertex(mesh), side)
        assert_same_bits(mesh, before)


@pytest.mark.parametrize("outside", [4, 5])
def test_a_flip_owns_no_more_than_its_quad(outside):
    V, F, new = with_last(*quad(), outside)
    mesh = wanted(V, F, new[:4])
    h = half_edge(mesh, new[0], new[1])
    assert flip_owned(mesh, all_but_the_last_vertex(mesh), h)
    half_edge(mesh, new[2], new[3])


def bisect_owned(V, F, a, b):
    """Split edge a-b in place; the block has all faces, the new vertex, and all old ones but the last."""
    n, m = len(V), len(F)
    mesh = with_room(built(V, F, length=100.0), 2, 1)
    mesh.X[[a, b], 3] = 0.9 * naive.edge_length(V, (a, b))
    order = np.r_[: n - 1, n, n - 1]  # its own inverse
    columns = ("vertex_halfedge", "valence_excess", "X", "kind", "birth")
    origin = np.where(mesh.origin == DEAD, DEAD, order[mesh.origin]).astype(np.int32)
    mesh = mesh._replace(origin=origin, **{name: getattr(mesh, name)[order] for name in columns})
    blocks = Blocks(np.array([0, m + 2, m + 2]), np.array([0, n, n + 1]))
    mask = classify_edges(mesh, blocks, 1.0, 0.0, False).mask
    done, left = np.zeros(2, np.int64), np.zeros(2, np.int64)
    bisect._bisect(False, mesh, blocks, OWNED, (0.5, 0.0), mask, done, left)
    assert done.any() != left.any()
    return bool(done.any())


def test_a_split_owns_the_four_vertices_of_its_quad():
    """And no more: both faces, the new vertex and both new faces lie in the block in any case."""
    for v in range(6):
        V, F, new = with_last(*quad(), v)
        assert bisect_owned(V, F, new[0], new[1]) == (v > 3)
    for v in range(4):  # on the boundary: the three of its face
        V, F, new = with_last(*two_faces(), v)
        assert bisect_owned(V, F, new[0], new[1]) == (v > 2)


def two_faces():
    V = np.array([[-1, 0, 0], [1, 0, 0], [0, 0.9, 0], [2, 0.9, 0]])
    return V, np.array([[0, 1, 2], [2, 1, 3]])


def hill():
    """Grid whose inner edge 14-20 (of 5 x 7 vertices) is short."""
    V, F = zoo.grid(7, 5)
    a, b = inner_edge(F)
    V[b] = V[a] + 0.3 * (V[b] - V[a])
    return V, F, a, b


def inner_edge(F):
    rim = {v for edge in naive.boundary_edges(F) for v in edge}
    ring = naive.neighbours(F)
    far = [v for v in ring if v not in rim and len(ring[v] & rim) <= 2]
    return next((v, w) for v in far for w in ring[v] if w in far and w > v)


COLLAPSES = collapse.CollapseLimits(
    shortest=0.5, longest=9.0, foldover_cosine=0.0, quadric_reach=0.0, sliver_check=False
)


def collapse_owned(V, F, a, b):
    mesh = built(V, F)
    h = half_edge(mesh, a, b)
    h = max(h, int(mesh.twin[h]))
    before = copied(mesh)
    done = run_owned(
        collapse._collapse, mesh, all_but_the_last_vertex(mesh), COLLAPSES, h, N_COLLAPSE_OUTCOMES
    )
    if not done:
        assert_same_bits(mesh, before)
    return done


def test_a_collapse_owns_the_closed_rings_of_both_ends():
    V, F, a, b = hill()
    ring = naive.neighbours(F)
    footprint = ring[a] | ring[b] | {a, b}
    assert len(footprint) >= 8
    for v in range(len(V)):
        W, G, new = with_last(V, F, v)
        assert collapse_owned(W, G, new[a], new[b]) == (v not in footprint), v


def test_a_move_owns_the_closed_ring_of_its_vertex():
    """Untangling vertex 0 reads its ring: with a ring vertex outside, it waits for a later stage."""
    V, F = zoo.sliver_fan(12)
    centre = len(V) - 1
    for v in (0, 5, centre):
        W, G, new = with_last(V, F, v)
        mesh = built(W, G)
        blocks = all_but_the_last_vertex(mesh)
        candidates = one_candidate(blocks.vertex, new[centre])
        moved = np.zeros(len(W), np.uint8)
        search = untangle.Search(False, np.cos(0.8))
        untangle._untangle(False, mesh, blocks, OWNED, tree_of(mesh), search, candidates, moved)
        assert candidates.items[0] == new[centre] and not moved.any()
