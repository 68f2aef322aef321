"""Measured edges: the flags are those of plain loops, and splits and collapses do what they say."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import assert_same_bits, blocks_of, built, copied, ends, one_block

from remeshvec.core.vocabulary import DEAD, FROZEN, HALTED, NON_MANIFOLD, NONE
from remeshvec.operations.classify import REMOVED, classify_edges, is_short
from remeshvec.operations.collapse import CollapseLimits, collapse_short_edges
from remeshvec.operations.split import split_long_edges

MESHES = ["torus", "planar_delaunay", "annulus", "genus_2", "sliver_fan", "l_prism", "moebius"]
LIMITS = CollapseLimits(0.9, 1.2, 0.5, 0.5, False)


def uneven(name, seed=0):
    """Mesh with lengths that jump, about as long as its edges, and holes from a few collapses."""
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.1, seed=seed)
    mesh = built(V, F, ordered=True, length=zoo.mean_edge(V, F))
    collapse_short_edges(mesh, one_block(mesh), LIMITS._replace(shortest=0.6), False)
    mesh.X[:, 3] *= np.random.default_rng(seed).uniform(0.6, 1.5, len(mesh.X))
    return mesh


def freeze_some(mesh, seed=0):
    """Put every fourth edge on a curve, frozen or not, whatever that means."""
    rng = np.random.default_rng(seed)
    for h in np.flatnonzero((mesh.origin != DEAD) & (mesh.twin < np.arange(len(mesh.twin)))):
        if rng.random() < 0.25:
            mesh.curve[h] = flag = rng.choice([FROZEN, HALTED, 5, 5 + NON_MANIFOLD])
            if mesh.twin[h] != NONE:
                mesh.curve[mesh.twin[h]] = flag


def naive_flags(mesh, f, longest, shortest):
    """Bits of one face, from lengths in plain numbers."""
    V, lengths, corners = mesh.X[:, :3], mesh.X[:, 3], mesh.origin[3 * f : 3 * f + 3]
    bits, long = 0, {}
    for i in range(3):
        a, b = corners[i], corners[(i + 1) % 3]
        length, s, t = naive.edge_length(V, (a, b)), lengths[a], lengths[b]
        bits |= 8 * (length < shortest * 2 / (1 / s + 1 / t)) << i
        if length > longest * naive.middle_length(s, t) and mesh.curve[3 * f + i] not in (
            FROZEN,
            HALTED,
        ):
            long[i] = length
    if len(long) > 1:
        height = np.linalg.norm(naive.normal(V, corners)) / max(long.values())
        around = [naive.middle_length(*lengths[[corners[i], corners[i - 1]]]) for i in range(3)]
        if height < 0.5 * longest * np.mean(around):
            long = {max(long, key=long.get)}
    return bits | sum(1 << i for i in long)


@pytest.mark.parametrize("ratio", [1.0, 2.0, 10.0])
def test_edges_are_too_long_where_two_would_fit_between_growing_lengths(ratio):
    """Lengths grow evenly along an edge; the edges that fit are the integral of their inverse."""
    share = (np.arange(10_000) + 0.5) / 10_000
    fit = np.mean(1 / (1 + (ratio - 1) * share))
    for long in (False, True):
        length = (1.01 if long else 0.99) * 1.2 / fit
        V = np.array([[0.0, 0, 0], [length, 0, 0], [length / 2, length, 0]])
        mesh = built(V, [[0, 1, 2]], length=np.array([1.0, ratio, 100.0]))
        flags = classify_edges(mesh, one_block(mesh), 1.2, 0.1, False)
        lengths = mesh.X[mesh.origin, 3]
        at = np.flatnonzero(lengths + np.roll(lengths, -1) < 50).item()
        assert bool(flags.mask[0] >> at & 1) == long


@pytest.mark.parametrize("per_block", [8, 10**6])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", MESHES)
def test_flags_are_those_of_plain_loops(name, seed, per_block, monkeypatch):
    mesh = uneven(name, seed)
    freeze_some(mesh, seed)
    before = copied(mesh)
    flags = classify_edges(mesh, blocks_of(mesh, per_block, monkeypatch), 1.2, 0.9, False)
    assert_same_bits(mesh, before)
    alive = mesh.origin[::3] != DEAD
    assert (flags.mask[~alive] == REMOVED).all() and flags.n_gone == (~alive).sum()
    expected = [naive_flags(mesh, f, 1.2, 0.9) for f in np.flatnonzero(alive)]
    assert flags.mask[alive].tolist() == expected
    assert flags.n_long == sum((bits & 7).bit_count() for bits in expected)
    assert flags.longest == 1.2 and flags.shortest == 0.9
    assert len({bits & 7 for bits in expected}) > 2 and len({bits >> 3 for bits in expected}) > 2


@pytest.mark.parametrize("name", MESHES)
def test_both_faces_agree_on_what_is_short(name):
    """To the last bit, at the limit too; of low faces only one may want a long edge split."""
    mesh = uneven(name)
    inner = np.flatnonzero((mesh.origin != DEAD) & (mesh.twin != NONE))
    for h in inner[::5].tolist():
        t, (a, b) = int(mesh.twin[h]), ends(mesh, h)
        squared = ((mesh.X[a, :3] - mesh.X[b, :3]) ** 2).sum()
        s, u = mesh.X[[a, b], 3]
        limit = np.sqrt(squared) * (s + u) / (2 * s * u)
        found = set()
        for shortest in (limit * (1 - 1e-12), limit, limit * (1 + 1e-12)):
            mask = classify_edges(mesh, one_block(mesh), 9.0, shortest, False).mask
            bits = [bool(mask[g // 3] >> (3 + g % 3) & 1) for g in (h, t)]
            assert bits[0] == bits[1] == is_short(squared, s, u, shortest)
            found.add(bits[0])
        assert found == {False, True}


def test_nothing_is_longer_than_infinity_or_shorter_than_nothing():
    mesh = uneven("torus")
    flags = classify_edges(mesh, one_block(mesh), np.inf, 0.0, False)
    assert flags.n_long == 0 and not flags.mask[mesh.origin[::3] != DEAD].any()


def test_edges_without_length():
    """Short for any factor above zero, never long."""
    mesh = built(*zoo.ZOO["coincident_vertices"].make())
    flags = classify_edges(mesh, one_block(mesh), 1e-9, 1e-9, False)
    V = mesh.X[:, :3]
    for h in range(len(mesh.origin)):
        a, b = ends(mesh, h)
        empty = (V[a] == V[b]).all()
        assert flags.mask[h // 3] >> (3 + h % 3) & 1 == empty
        assert not (flags.mask[h // 3] >> (h % 3) & 1 and empty)


@pytest.mark.parametrize("per_block", [12, 10**6])
@pytest.mark.parametrize("name", MESHES)
def test_known_flags_change_nothing(name, per_block, monkeypatch):
    """Splits and collapses measure for themselves where they are not told, and do the same."""
    mesh = uneven(name)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    told, other = copied(mesh), copied(mesh)
    flags = classify_edges(mesh, blocks, LIMITS.longest, LIMITS.shortest, False)
    one = split_long_edges(told, blocks, LIMITS.longest, False, None, flags)
    two = split_long_edges(other, blocks, LIMITS.longest, False)
    assert one[1] == two[1] > 0
    assert_same_bits(one[0], two[0])
    told, other = copied(mesh), copied(mesh)
    flags = classify_edges(mesh, blocks, LIMITS.longest, LIMITS.shortest, False)
    tallies = [collapse_short_edges(told, blocks, LIMITS, False, flags),
               collapse_short_edges(other, blocks, LIMITS, False)]  # fmt: skip
    assert np.array_equal(*tallies) and tallies[0].any()
    assert_same_bits(told, other)
