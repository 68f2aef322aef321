"""Terraces of voxels are no creases, whatever their slope; ledges and blocks among them are."""

import numpy as np
import pytest
from helpers import zoo
from helpers.structure import built, mean_edge_of

from data.shapes import voxels
from data.shapes.basic import voxels as blocks
from remeshvec import find_creases, remesh
from remeshvec.core.vocabulary import NONE
from remeshvec.features.creases import judge_edges

LENGTHS = (1.5, 2.0, 3.0, 4.0, 8.0)


def ellipsoid(scale=(1, 1, 1)):
    """A smooth body in voxels of any shape."""
    x, y, z = voxels.grid(30) * np.reshape(scale, (3, 1, 1, 1))
    V, F = voxels.level_surface((x / 12) ** 2 + (y / 10) ** 2 + (z / 13) ** 2 < 1)
    return V * scale, F


def sloping(slope, n=24):
    """An open terraced plane: the upper side of a half-space of voxels."""
    x, y, z = voxels.grid(n)
    V, F = voxels.level_surface(np.pad(slope[0] * x + slope[1] * y + z < 0, 1))
    middle = V[F].mean(axis=1)
    return V, F[((middle > 2) & (middle < n - 1)).all(axis=1)]


MASKS = {
    "ball": lambda: voxels.level_surface(voxels.ball(9)),
    "turned": lambda: (
        zoo.rotate(voxels.level_surface(voxels.ball(9))[0], [0.3, 0.5, 0.1]),
        voxels.level_surface(voxels.ball(9))[1],
    ),
    "ellipsoid": ellipsoid,
    "tall_voxels": lambda: ellipsoid((1, 1, 3)),
    "wide_voxels": lambda: ellipsoid((2, 1, 1)),
    "blocks": lambda: blocks(voxels.ball(8)),
    "steep_plane": lambda: sloping((0.6, 0.4)),
    "plane": lambda: sloping((0.33, 0.2)),
}


@pytest.mark.parametrize("name", MASKS)
def test_masks_have_no_creases(name):
    V, F = MASKS[name]()
    for length in LENGTHS:
        edges, dropped = find_creases(V, F, length, return_dropped=True)
        assert len(edges) <= 20 and len(dropped["terrace"]) > 200
        assert len(find_creases(V, F, length, feature_angle=40)) > 200


@pytest.mark.parametrize("name", ["ball", "tall_voxels"])
def test_masks_become_even(name):
    V, F = MASKS[name]()
    result = remesh(V, F, 2.0)
    assert result.report.quality_after.min_angle > 35
    assert result.report.features["dropped_terrace"] > 200


def test_a_block_beside_a_ball_keeps_its_edges():
    V, F = voxels.level_surface(voxels.ball_and_block())
    edges = find_creases(V, F, 2.0)
    middles = V[edges].mean(axis=1)
    block = V[V[:, 0] < 18]  # the ball is farther to the right
    from_sides = np.minimum(abs(middles - block.min(axis=0)), abs(middles - block.max(axis=0)))
    assert len(edges) > 400
    assert (np.sort(from_sides, axis=1)[:, 1] < 1.1).mean() > 0.95, "along two faces of the block"


@pytest.mark.parametrize("height", [1, 4])
def test_a_single_ledge_stays(height):
    """Across the middle of a plane; it bends back once, and not again."""
    x, _, z = voxels.grid(24)
    V, F = voxels.level_surface(np.pad((z < 0) | ((x < 0) & (z < height)), 1))
    middle = V[F].mean(axis=1)
    F = F[((middle[:, :2] > 3) & (middle[:, :2] < 22)).all(axis=1) & (middle[:, 2] > 3)]
    for length in LENGTHS:
        edges, dropped = find_creases(V, F, length, return_dropped=True)
        assert len(dropped["terrace"]) == 0
        assert len(edges) > 30 and (abs(V[edges][:, :, 0] - 12.5) < 1.1).all()


def test_the_steps_of_a_part_stay():
    """Long edges are not those of voxels, even where they all are steps."""
    x = np.repeat(np.arange(9.0), 2)[1:-1]
    z = np.repeat(np.arange(8.0), 2)
    V = np.concatenate([np.stack([x, np.full(16, y), z], axis=1) for y in (0.0, 30.0)])
    i = np.arange(15)
    F = np.concatenate([np.stack([i, i + 1, i + 17], 1), np.stack([i, i + 17, i + 16], 1)])
    edges, dropped = find_creases(V, F, 2.0, return_dropped=True)
    assert len(edges) == 14 and len(dropped["terrace"]) == 0


@pytest.mark.parametrize("segments", [24, 64])
def test_the_round_steps_of_a_part_stay(segments):
    """A turned shaft of many shoulders; its edges are as short as those of voxels."""
    steps = np.arange(13)
    radius = 5 - 0.3 * np.repeat(steps, 2)[:-1]
    height = 0.3 * np.repeat(steps, 2)[1:]
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    rings = [np.c_[r * np.cos(angle), r * np.sin(angle), 0 * angle + z]
             for r, z in zip(radius, height, strict=True)]  # fmt: skip
    V = np.concatenate(rings)
    i = np.arange(len(V) - segments)
    j = np.where(i % segments == segments - 1, i - segments + 1, i + 1)
    F = np.concatenate([np.c_[i, j, j + segments], np.c_[i, j + segments, i + segments]])
    edges, dropped = find_creases(V, F, 2.0, return_dropped=True)
    assert len(dropped["terrace"]) == 0
    assert len(edges) == segments * (len(rings) - 2)


def test_what_became_of_every_edge_is_known():
    """An edge that turns far enough is a crease or was dropped for one reason."""
    V, F = voxels.level_surface(voxels.ball_and_block())
    mesh = built(V, F, length=2.0)
    surface = mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge
    hard = np.zeros(mesh.origin.size, bool)
    found = judge_edges(surface, hard, "auto", mean_edge_of(mesh))
    kept = np.flatnonzero(
        found.is_feature & (mesh.twin != NONE) & (mesh.twin < np.arange(hard.size))
    )
    dropped = np.concatenate(list(found.dropped.values()))
    every = judge_edges(surface, hard, 24.99, mean_edge_of(mesh)).is_feature
    every = np.flatnonzero(every & (mesh.twin < np.arange(hard.size)))
    assert np.array_equal(np.sort(np.concatenate([kept, dropped])), every)
