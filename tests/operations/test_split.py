"""Splits: templates, midpoints, rounds that end, against splitting one edge after the other."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import (
    assert_same_bits,
    assert_valid,
    blocks_of,
    built,
    copied,
    faces_of,
    packed,
    shape_of,
)

from remeshvec.core.vocabulary import CURVE, FIXED, INNER
from remeshvec.mesh.blocks import make_blocks
from remeshvec.operations import templates
from remeshvec.operations.split import MAX_ROUNDS, split_long_edges


def split(mesh, longest):
    """One round, without the room that it leaves free."""
    refined, count = split_long_edges(mesh, make_blocks(mesh), longest, False)
    return refined if refined is mesh else packed(refined), count


def coordinates(mesh):
    """Faces as sets of coordinates, whatever their numbers."""
    return sorted(sorted(map(tuple, np.round(mesh.X[f, :3], 12).tolist())) for f in faces_of(mesh))


@pytest.mark.parametrize("mask", range(8))
def test_every_template(mask):
    """A triangle whose long edges are those of the mask, with a neighbour across each edge."""
    V = {0: (1, 1, 1), 1: (1.3, 1, 1), 2: (1, 1.3, 1), 4: (1, 1, 1.3)}.get(mask)
    if V is None:
        V = {3: (1.3, 1.25, 0.9), 6: (0.9, 1.3, 1.25), 5: (1.25, 0.9, 1.3), 7: (1.3, 1.2, 1.25)}[
            mask
        ]
    mesh = built(*fringed(*V))
    before = shape_of(faces_of(mesh))
    refined, count = split(mesh, 1.1)
    assert count == bin(mask).count("1")
    assert_valid(refined)
    assert shape_of(faces_of(refined)) == before
    # Every split edge cuts its two faces, and the middle one is cut once an edge.
    assert len(faces_of(refined)) == 4 + 2 * count
    assert zoo.area(refined.X[:, :3], faces_of(refined)) == pytest.approx(
        zoo.area(mesh.X[:, :3], faces_of(mesh))
    )


def fringed(l0, l1, l2):
    """Triangle with edges l0 (corners 0-1), l1 (1-2), l2 (2-0), and a thin face outside each."""
    x = (l0**2 + l2**2 - l1**2) / (2 * l0)
    P = np.array([[0, 0, 0], [l0, 0, 0], [x, np.sqrt(l2**2 - x**2), 0]])
    V, F = list(P), [[0, 1, 2]]
    for c in range(3):
        a, b = P[c], P[(c + 1) % 3]
        out = np.cross(b - a, [0, 0, 1.0])
        V.append((a + b) / 2 + 0.3 * out / np.linalg.norm(out))
        F.append([(c + 1) % 3, c, 3 + c])
    return np.array(V), np.array(F)


@pytest.mark.parametrize("lengths", [(1.3, 1.25, 0.9), (1.25, 1.3, 0.9)])
@pytest.mark.parametrize("turn", range(3))
def test_two_long_edges_take_the_shorter_diagonal(lengths, turn):
    V, _ = fringed(*lengths)
    F = np.roll([[0, 1, 2]], turn, axis=1)
    refined, count = split(built(V[:3], F), 1.1)
    assert count == 2 and len(faces_of(refined)) == 3
    middles = [(V[0] + V[1]) / 2, (V[1] + V[2]) / 2]
    diagonals = [np.linalg.norm(middles[0] - V[2]), np.linalg.norm(middles[1] - V[0])]
    found = {
        round(naive.edge_length(refined.X[:, :3], e), 9) for e in naive.edges(faces_of(refined))
    }
    assert round(min(diagonals), 9) in found and round(max(diagonals), 9) not in found


@pytest.mark.parametrize(
    "name", ["torus", "planar_delaunay", "sliver_fan", "genus_2", "two_components"]
)
def test_one_round_splits_what_is_asked_for(name):
    V, F = zoo.ZOO[name].make()
    limit = 0.9 * zoo.mean_edge(V, F)
    expected = naive.asked_splits(V, F, limit)
    assert expected <= naive.long_edges(V, F, limit)
    refined, count = split(built(V, F), limit)
    assert count == len(expected) > 0
    new = {tuple(p) for p in refined.X[:, :3].tolist()} - {tuple(p) for p in V.tolist()}
    assert new == {tuple(((V[a] + V[b]) * 0.5).tolist()) for a, b in expected}


@pytest.mark.parametrize("name", ["square", "tetrahedron", "planar_delaunay"])
def test_single_splits_are_those_of_the_twin(name):
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.05)
    lengths = sorted((naive.edge_length(V, e), sorted(e)) for e in naive.edges(F))
    (second, _), (first, (a, b)) = lengths[-2:]
    refined, count = split(built(V, F), (first + second) / 2)
    assert count == 1
    W, G = naive.split(V, F, a, b)
    assert coordinates(refined) == coordinates(built(W, G))


@pytest.mark.parametrize("name", zoo.TIDY)
@pytest.mark.parametrize("per_block", [7, 100_000])
def test_rounds_end_with_no_long_edge_and_the_same_surface(name, per_block, monkeypatch):
    V, F = zoo.ZOO[name].make()
    limit = 0.4 * zoo.mean_edge(V, F)
    mesh = built(V, F, ordered=True)
    before = shape_of(F)
    for rounds in range(MAX_ROUNDS):  # noqa: B007
        mesh, count = split_long_edges(mesh, blocks_of(mesh, per_block, monkeypatch), limit, False)
        assert_valid(mesh)
        if not count:
            break
    halvings = np.log2(max(naive.edge_length(V, e) for e in naive.edges(F)) / limit)
    assert rounds <= 3 * np.ceil(halvings) + 1  # a low face has its edges split one after the other
    W, G = mesh.X[:, :3], faces_of(mesh)
    assert not naive.long_edges(W, G, limit)
    assert shape_of(G) == before
    assert zoo.area(W, G) == pytest.approx(zoo.area(V, F), rel=1e-12)
    if zoo.is_closed(F):
        assert zoo.volume(W, G) == pytest.approx(zoo.volume(V, F), rel=1e-11)


def test_a_mesh_without_long_edges_is_returned_as_it_is():
    mesh = built(*zoo.torus())
    before = copied(mesh)
    same, count = split(mesh, 100.0)
    assert same is mesh and count == 0
    assert_same_bits(mesh, before)


def test_the_old_mesh_is_not_touched():
    mesh = built(*zoo.torus())
    before = copied(mesh)
    split(mesh, 0.1)
    assert_same_bits(mesh, before)


def test_midpoints_get_kinds_and_births():
    mesh = built(*zoo.square())
    mesh.kind[:] = FIXED
    refined, count = split(mesh, 0.9)
    assert count == 5 and len(refined.X) == 9
    inner = np.abs(refined.X[:, :2] - 0.5).max(axis=1) < 0.25
    corner = (refined.X[:, :2] % 1 == 0).all(axis=1)
    assert (refined.kind[corner] == FIXED).all() and corner.sum() == 4
    assert (refined.kind[inner] == INNER).all() and inner.sum() == 1
    assert (refined.kind[~inner & ~corner] == CURVE).all()
    # A boundary midpoint is born where the boundary half-edge under it starts.
    h = refined.birth[~inner & ~corner]
    a, b = (mesh.X[mesh.origin[g], :3] for g in (h, np.where(h % 3 == 2, h - 2, h + 1)))
    assert np.array_equal(refined.X[~inner & ~corner, :3], (a + b) / 2)


def test_needles_are_cut_across():
    """All three edges of a needle at once make (l / L)^2 faces of it; in place it never ends."""
    counts = []
    for length in (50.0, 200.0):
        V = np.array([[0, 0, 0], [length, 0, 0], [length / 2, 1e-3, 0], [length / 2, -1e-3, 0]])
        mesh = built(V, [[0, 1, 2], [1, 0, 3]])
        for _ in range(MAX_ROUNDS):
            mesh, count = split(mesh, 1.0)
            if not count:
                break
        assert count == 0
        assert_valid(mesh)
        assert not naive.long_edges(mesh.X[:, :3], faces_of(mesh), 1.0)
        counts.append(len(faces_of(mesh)))
    assert counts[1] < 12 * counts[0]  # 16 where all edges go at once


def test_templates_are_consistent():
    count, corner, inner, part, gain = templates._build_templates()
    for mask in templates._CHILDREN:
        n = 3 * count[mask]
        assert (corner[mask, :n] >= 0).all() and (corner[mask, n:] == -1).all()
        inside = inner[mask, :n] >= 0
        assert (inner[mask, inner[mask, :n][inside]] == np.flatnonzero(inside)).all()
        outside = set(np.flatnonzero(~inside).tolist())
        assert {p for p in part[mask].tolist() if p >= 0} == outside
        assert gain[mask].sum() == n - 3
