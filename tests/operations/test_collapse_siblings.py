"""Siblings: a non-manifold edge collapses on all its sheets at once, or on none."""

from itertools import pairwise

import numpy as np
import pytest
from helpers import zoo
from helpers.collapses import LOOSE
from helpers.siblings import opened, sheets_at_places, siblings_of
from helpers.structure import (
    assert_on_reference,
    assert_same_bits,
    assert_valid,
    built,
    copied,
    ends,
    faces_of,
    one_block,
)

from data.shapes import nonmanifold
from remeshvec.core.vocabulary import DEAD, INNER, NON_MANIFOLD, NONE
from remeshvec.features.polyline import find_siblings
from remeshvec.operations.collapse import collapse_short_edges
from remeshvec.operations.siblings import collapse_siblings


@pytest.mark.parametrize("name", nonmanifold.COMPLEXES)
def test_seams_collapse_on_all_sheets(name):
    make = nonmanifold.COMPLEXES[name].make
    if name == "wall_inside":  # its ends are near everything
        make = lambda: nonmanifold.wall_inside(8)  # noqa: E731
    mesh, reference = opened(*make(), 100.0, feature_angle=40.0)
    before = sheets_at_places(mesh)
    limits = LOOSE._replace(shortest=1.0)
    total = 0
    for _ in range(6):
        members, group = siblings_of(mesh)
        done = collapse_siblings(mesh, members, group, limits)
        total += done
        assert_valid(mesh, slits=True)
        assert_on_reference(mesh, reference)
        after = sheets_at_places(mesh)
        assert sum(after.values()) <= sum(before.values()) - 2 * done
        collapse_short_edges(mesh, one_block(mesh), limits, False)
        assert_valid(mesh, slits=True)
        assert sheets_at_places(mesh) == after, "it must not touch seams"
    assert total > 0
    # A curve of k sheets is still one of k sheets: siblings vanished together.
    assert set(sheets_at_places(mesh).values()) == set(before.values())


def test_one_sheet_that_refuses_keeps_all():
    """On one page a neighbour lies so near that its faces would fold over."""
    mesh, _ = opened(*nonmanifold.book(), 0.01)
    members, group = siblings_of(mesh)
    groups = [members[i:j] for i, j in pairwise(group)]
    (pages,) = (one for one in groups if middle(mesh, one[0])[2] == pytest.approx(0.5))
    limits = LOOSE._replace(shortest=100.0)
    only = np.array([0, len(pages)], np.int32)
    free = copied(mesh)
    assert len(pages) == 5 and collapse_siblings(free, pages, only, limits) == 1
    assert_valid(free, slits=True)
    for h in pages.tolist():
        spoilt = copied(mesh)
        a, b = ends(spoilt, h)
        F = faces_of(spoilt)
        beside = next(set(f) - {a} for f in F.tolist() if a in f and b not in f)
        v = next(v for v in beside if spoilt.kind[v] == INNER)
        # Past the line through the new place and the third corner.
        w = (beside - {v}).pop()
        spoilt.X[v, :3] = spoilt.X[a, :3] + 0.3 * (middle(spoilt, h) - spoilt.X[a, :3])
        spoilt.X[v, :3] += 1e-3 * (spoilt.X[w, :3] - spoilt.X[a, :3])
        before = copied(spoilt)
        assert collapse_siblings(spoilt, pages, only, limits) == 0
        assert_same_bits(spoilt, before)


def middle(mesh, h):
    return mesh.X[list(ends(mesh, h)), :3].mean(axis=0)


def test_long_siblings_stay():
    mesh, _ = opened(*nonmanifold.book(), 0.01)
    before = copied(mesh)
    assert collapse_siblings(mesh, *siblings_of(mesh), LOOSE._replace(shortest=1.0)) == 0
    assert_same_bits(mesh, before)


def slit_tube(n, m=6):
    """Tube of n around, cut along a line: both sides of the cut are siblings on the same sheet."""
    V, _ = zoo.cylinder(n, m)
    mesh = built(np.vstack([V, V[:m]]), zoo.wrapped_grid(n + 1, m, False, False))
    a, b = mesh.origin, mesh.origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    cut = (mesh.twin == NONE) & (a % (n * m) < m) & (b % (n * m) < m)
    members, group = find_siblings(mesh.X, mesh.origin, np.flatnonzero(cut).astype(np.int32))
    assert np.array_equal(group, np.arange(0, 2 * m, 2))
    mesh.curve[members] += NON_MANIFOLD
    return mesh, members, group


@pytest.mark.parametrize("n", [2, 3, 4, 8])
def test_siblings_whose_rings_overlap_stay(n):
    """The first collapse would change what was asked about the second."""
    mesh, members, group = slit_tube(n)
    inner = [k for k in range(len(group) - 1) if is_inner(mesh, members[group[k]])]
    k = inner[0]
    pair, only = members[group[k] : group[k + 1]], np.array([0, 2], np.int32)
    rings = [ring(mesh, h) for h in pair]
    before = copied(mesh)
    done = collapse_siblings(mesh, pair, only, LOOSE._replace(shortest=100.0))
    assert done == (not rings[0] & rings[1])
    if not done:
        assert_same_bits(mesh, before)
    assert_valid(mesh, slits=True)
    assert done == (n > 2)


def is_inner(mesh, h):
    """Whether an edge of the cut does not touch the rims."""
    z = mesh.X[list(ends(mesh, h)), 2]
    return z.min() > 0 and z.max() < 2


def ring(mesh, h):
    """Vertices of all faces at both ends of an edge."""
    F = faces_of(mesh)
    return set(F[np.isin(F, ends(mesh, h)).any(axis=1)].ravel().tolist())


def test_groups_with_a_removed_member_stay():
    """A group may have lost an edge to the group before it."""
    mesh, members, _ = slit_tube(8)
    mesh.origin[members[0] // 3 * 3 : members[0] // 3 * 3 + 3] = DEAD
    before = copied(mesh)
    assert (
        collapse_siblings(
            mesh, members[:2], np.array([0, 2], np.int32), LOOSE._replace(shortest=100.0)
        )
        == 0
    )
    assert_same_bits(mesh, before)
