"""The spread of the areas, against its definition."""

import numpy as np
import pytest
from helpers import zoo
from helpers.structure import blocks_of, built, one_block

from remeshvec.operations.collapse import CollapseLimits, collapse_short_edges
from remeshvec.operations.spread import area_spread


def plain(V, F, lengths):
    """Standard deviation over mean of the areas in squared target lengths."""
    a, b, c = (V[F[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / lengths[F].mean(axis=1) ** 2
    return np.std(areas) / np.mean(areas)


@pytest.mark.parametrize("per_block", [9, 100_000])
@pytest.mark.parametrize("name", ["icosphere", "annulus", "genus_2", "two_components"])
def test_it_is_the_coefficient_of_variation(name, per_block, monkeypatch):
    V, F = zoo.perturb(*zoo.ZOO[name].make(), amount=0.25, seed=3)
    mesh = built(V, F, ordered=True)
    mesh.X[:, 3] = np.exp(np.random.default_rng(5).normal(scale=0.4, size=len(V)))
    expected = plain(mesh.X[:, :3], mesh.origin.reshape(-1, 3), mesh.X[:, 3])
    blocks = blocks_of(mesh, per_block, monkeypatch)
    assert area_spread(mesh, blocks, False) == pytest.approx(expected, rel=1e-10)


def test_equal_areas_have_none():
    """Their squares cancel to rounding, whose root is left."""
    mesh = built(*zoo.grid(6, 6))
    assert area_spread(mesh, one_block(mesh), False) < 1e-7


def test_removed_faces_do_not_count():
    mesh = built(*zoo.perturb(*zoo.torus(), 0.2), length=0.6)
    collapse_short_edges(mesh, one_block(mesh), CollapseLimits(0.8, 4 / 3, 0.9, 0.5, False), False)
    F = mesh.origin.reshape(-1, 3)
    alive = F[F[:, 0] >= 0]
    assert 0 < len(alive) < len(F)
    expected = plain(mesh.X[:, :3], alive, mesh.X[:, 3])
    assert area_spread(mesh, one_block(mesh), False) == pytest.approx(expected, rel=1e-10)


def test_no_area_has_none():
    mesh = built(*zoo.grid(1, 1))
    mesh.X[:, :3] = 0.0
    assert area_spread(mesh, one_block(mesh), False) == 0.0
