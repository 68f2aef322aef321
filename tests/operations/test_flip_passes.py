"""Later passes of flips look around touched vertices only, and miss nothing."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import (
    assert_same_bits,
    assert_valid,
    blocks_of,
    built,
    copied,
    draw,
    faces_of,
    next_of,
    shape_of,
)

from remeshvec.core.vocabulary import DEAD
from remeshvec.mesh.blocks import make_candidates, stages
from remeshvec.operations import flip
from remeshvec.operations.collapse import CollapseLimits, collapse_short_edges
from remeshvec.operations.flip import (
    FlipLimits,
    bends_quad,
    duplicates_edge,
    flip_edges,
    flip_makes_sliver,
    folds_neighbour,
)
from remeshvec.operations.outcomes import FLIPPED, N_FLIP_OUTCOMES

LIMITS = [
    FlipLimits(0.0, False, False),
    FlipLimits(np.cos(np.radians(60)), True, False),
    FlipLimits(np.cos(np.radians(20)), True, True),
    FlipLimits(np.cos(np.radians(60)), True, False, np.tan(np.radians(25))),
]
NAMES = ["loose", "default", "strict", "trades"]
MESHES = ["torus", "planar_delaunay", "annulus", "genus_2", "icosphere", "thin_sheet", "sliver_fan"]


def rough(name, seed, collapsed=True):
    """Bumpy mesh with valences of all sorts, curves here and there, and dead faces."""
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), n=1, noise=0.3, seed=seed)
    V, F = zoo.perturb(V, F, 0.1, seed)
    mesh = built(V, F, ordered=True, length=zoo.mean_edge(V, F))
    rng = np.random.default_rng(seed)
    pairs = [sorted(e) for e in naive.edges(faces_of(mesh))]
    draw(mesh, *(pairs[k] for k in rng.choice(len(pairs), len(pairs) // 12, replace=False)))
    if collapsed:
        limits = CollapseLimits(0.8, 9.0, 0.0, 0.5, False)
        collapse_short_edges(mesh, blocks_of_all(mesh), limits, False)
    return mesh


def blocks_of_all(mesh):
    with pytest.MonkeyPatch.context() as patch:
        return blocks_of(mesh, 10**6, patch)


class Passes:
    """`flip_edges`, one pass after the other, whose lists can be looked at."""

    def __init__(self, mesh, blocks, limits):
        self.mesh, self.blocks, self.limits = mesh, blocks, limits
        self.touched = np.zeros(len(mesh.X), np.uint8)

    def listed(self, find, *marks):
        candidates = make_candidates(3 * self.blocks.face)
        find(False, self.mesh, self.blocks, self.limits, *marks, candidates)
        return candidates

    def all(self):
        return self.listed(flip._find_trades if self.limits.trade else flip._find_flips)

    def again(self):
        return self.listed(flip._find_again, self.touched)

    def edges(self, listed):
        """As pairs of vertices; each once."""
        starts = listed.starts[:-1]
        h = [
            i
            for k, n in zip(starts, listed.counts, strict=True)
            for i in listed.items[k : k + n].tolist()
        ]
        found = [
            frozenset((int(self.mesh.origin[i]), int(self.mesh.origin[next_of(i)]))) for i in h
        ]
        assert len(set(found)) == len(found), "an edge is listed twice"
        return dict(zip(found, h, strict=True))

    def is_allowed(self, h):
        """Whether every guard agrees."""
        mesh, t = self.mesh, int(self.mesh.twin[h])
        c, d = (int(mesh.origin[g - g % 3 + (g + 2) % 3]) for g in (h, t))
        return not (
            duplicates_edge(mesh, c, d)
            or bends_quad(mesh, h, t, self.limits.normal_cosine)
            or folds_neighbour(mesh, h, t)
            or (self.limits.sliver_check and flip_makes_sliver(mesh, h, t))
        )

    def run(self, listed):
        tally = np.zeros((len(listed.counts), N_FLIP_OUTCOMES), np.int64)
        for stage in stages(self.blocks):
            flip._flip(
                False, self.mesh, self.blocks, stage, self.limits, listed, self.touched, tally
            )
        return int(tally.sum(axis=0)[FLIPPED])


@pytest.mark.parametrize("per_block", [25, 10**6])
@pytest.mark.parametrize("limits", LIMITS, ids=NAMES)
@pytest.mark.parametrize("name", MESHES)
def test_no_flip_is_missed(name, limits, per_block, monkeypatch):
    """What a look at all edges would list and the guards allow is around a touched vertex."""
    mesh = rough(name, 0)
    passes = Passes(mesh, blocks_of(mesh, per_block, monkeypatch), limits)
    flipped, shortened = passes.run(passes.all()), 0
    assert flipped > 0
    for _ in range(4):
        everywhere, around = passes.edges(passes.all()), passes.edges(passes.again())
        assert set(around) <= set(everywhere)
        shortened += len(everywhere) - len(around)
        missed = [
            h for edge, h in everywhere.items() if edge not in around and passes.is_allowed(h)
        ]
        assert not missed
        passes.run(passes.again())
        assert_valid(mesh)
    assert shortened > 0 or limits is not LIMITS[2]


@pytest.mark.parametrize("per_block", [25, 10**6])
@pytest.mark.parametrize("limits", LIMITS, ids=NAMES)
@pytest.mark.parametrize("name", MESHES)
def test_passes_end_where_nothing_is_left(name, limits, per_block, monkeypatch):
    mesh = rough(name, 1)
    blocks, shape = blocks_of(mesh, per_block, monkeypatch), shape_of(faces_of(mesh))
    tally = flip_edges(mesh, blocks, limits, False, passes=60)
    assert tally[FLIPPED] > 0
    assert_valid(mesh)
    assert shape_of(faces_of(mesh)) == shape
    again = flip_edges(mesh, blocks, limits, False)
    assert again[FLIPPED] == 0


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("per_block", [25, 10**6])
@pytest.mark.parametrize("name", MESHES)
def test_passes_are_those_of_one_call(name, per_block, n, monkeypatch):
    """The twin above runs the same; the tally is that of all passes."""
    mesh = rough(name, 2)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    other = copied(mesh)
    passes = Passes(other, blocks, LIMITS[1])
    flipped = passes.run(passes.all()) + sum(passes.run(passes.again()) for _ in range(n - 1))
    tally = flip_edges(mesh, blocks, LIMITS[1], False, passes=n)
    assert tally[FLIPPED] == flipped
    assert_same_bits(mesh, other)


@pytest.mark.parametrize("name", MESHES)
def test_a_second_pass_flips_as_much_as_a_second_call(name):
    """In another order, so that a few may differ."""
    one, two = rough(name, 3), rough(name, 3)
    blocks = blocks_of_all(one)
    both = flip_edges(one, blocks, LIMITS[1], False, passes=2)[FLIPPED]
    calls = [flip_edges(two, blocks, LIMITS[1], False)[FLIPPED] for _ in range(2)]
    assert both > calls[0] or calls[1] == 0
    assert abs(both - sum(calls)) <= 2 + 0.1 * calls[1]


def test_dead_faces_are_passed_over():
    mesh = rough("torus", 0)
    dead = np.flatnonzero(mesh.origin[::3] == DEAD)
    assert len(dead)
    corners = np.ravel(3 * dead[:, None] + [0, 1, 2])
    other = copied(mesh)
    other.twin[corners] = other.curve[corners] = 7
    for one in (mesh, other):
        flip_edges(one, blocks_of_all(one), LIMITS[1], False, passes=3)
    assert_same_bits(mesh, other)
