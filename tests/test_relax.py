"""Relaxation against the formula, areas against libigl, slides along curves, and what must not move."""

import igl
import naive
import numpy as np
import pytest
import zoo
from structure import (
    assert_valid,
    blocks_of,
    built,
    faces_of,
    featured,
    half_edge,
    next_of,
    one_block,
)

from remeshvec._types import CURVE, FIXED, HELD, NONE, PINNED
from remeshvec.geometry import SHARP
from remeshvec.operations import relax
from remeshvec.operations.relax import relax_vertices


def relaxed(V, F, stiffness=0.0, length=1.0, fixed=()):
    mesh = built(V, F, length=length)
    mesh.kind[list(fixed)] = FIXED
    relax_vertices(mesh, one_block(mesh), stiffness, False)
    assert_valid(mesh)
    return mesh.X[:, :3].copy()


def bumpy(name):
    return zoo.perturb(*zoo.ZOO[name].make(), amount=0.08, seed=3)


MESHES = [
    "icosphere",
    "torus",
    "planar_delaunay",
    "annulus",
    "cylinder",
    "genus_2",
    "two_components",
]


@pytest.mark.parametrize("name", MESHES)
def test_one_step_of_the_published_formula(name):
    V, F = bumpy(name)
    assert relaxed(V, F) == pytest.approx(naive.relaxed(V, F), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("name", MESHES)
def test_weights_are_areas_over_squared_lengths(name):
    V, F = bumpy(name)
    lengths = np.exp(np.random.default_rng(5).normal(scale=0.4, size=len(V)))
    found = relaxed(V, F, length=lengths)
    assert found == pytest.approx(naive.relaxed(V, F, lengths=lengths), rel=1e-9, abs=1e-12)
    assert not np.allclose(found, naive.relaxed(V, F), atol=1e-3)
    # What counts is how lengths compare, not how large they are.
    assert relaxed(V, F, length=8 * lengths) == pytest.approx(found, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("stiffness", [20.0, 80.0])
@pytest.mark.parametrize("name", ["icosphere", "torus", "cylinder", "genus_2"])
def test_stiffness(name, stiffness):
    V, F = bumpy(name)
    found = relaxed(V, F, stiffness)
    expected = naive.relaxed(V, F, stiffness=stiffness)
    assert found == pytest.approx(expected, rel=1e-7, abs=1e-10)
    free = np.linalg.norm(naive.relaxed(V, F) - V, axis=1)
    held = np.linalg.norm(found - V, axis=1)
    assert (held <= free + 1e-12).all() and held.sum() < 0.99 * free.sum()


def test_stiffness_lets_vertices_slide_along_a_ridge():
    """Roof over the x axis, its ridge vertices unevenly spaced: they move along, not off."""
    V, F = zoo.grid(9, 3)
    V[:, 1] -= 1
    V[:, 2] = -np.abs(V[:, 1])
    ridge = (V[:, 1] == 0) & (V[:, 0] > 0) & (V[:, 0] < 8)
    V[ridge, 0] += np.random.default_rng(0).uniform(-0.3, 0.3, ridge.sum())
    stiff, soft = relaxed(V, F, 80.0), relaxed(V, F)
    assert np.abs(stiff[ridge, 0] - V[ridge, 0]).max() > 0.1
    assert np.abs(stiff[ridge, 1]).max() < 0.2 * np.abs(soft[ridge, 1]).max()


@pytest.mark.parametrize("per_block", [9, 100_000])
@pytest.mark.parametrize("name", MESHES)
def test_areas_are_mixed_voronoi_areas(name, per_block, monkeypatch):
    mesh = built(*bumpy(name), ordered=True)
    V, F = mesh.X[:, :3].copy(), faces_of(mesh).astype(np.int64)
    blocks = blocks_of(mesh, per_block, monkeypatch)
    points, across = np.empty((len(V), 4)), np.empty(len(F), np.int32)
    count = np.zeros(len(blocks.face) - 1, np.int64)
    relax._sum_areas(False, mesh, blocks, points, across, count)
    relax._sum_areas_across(mesh, blocks, points, across, count)
    assert np.array_equal(points[:, :3], V)
    expected = igl.massmatrix(V, F, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    assert points[:, 3] == pytest.approx(expected, rel=1e-9)
    assert points[:, 3].sum() == pytest.approx(zoo.area(V, F))


@pytest.mark.parametrize("name", ["planar_delaunay", "annulus"])
def test_flat_meshes_stay_flat(name):
    V, F = zoo.ZOO[name].make()
    V = zoo.rotate(V)
    flat = np.linalg.svd(V - V.mean(axis=0))[2][2]
    for stiffness in (0.0, 80.0):
        W = relaxed(V, F, stiffness)
        assert not np.array_equal(W, V)
        assert (W - V.mean(axis=0)) @ flat == pytest.approx(0, abs=1e-13)


@pytest.mark.parametrize("kind", [HELD, PINNED, FIXED])
def test_held_and_fixed_vertices_stay(kind):
    V, F = zoo.perturb(*zoo.grid(), amount=0.1)
    free = relaxed(V, F)
    assert not (free == V).all(axis=1).any()
    still = (built(V, F).kind == CURVE) == (kind != HELD)
    mesh = built(V, F)
    mesh.kind[still] = kind
    relax_vertices(mesh, one_block(mesh), 0.0, False)
    assert np.array_equal(mesh.X[still, :3], V[still])
    assert not (mesh.X[~still, :3] == V[~still]).all(axis=1).any()


def test_lengths_are_not_touched():
    mesh = built(*zoo.perturb(*zoo.torus(), amount=0.1))
    mesh.X[:, 3] = lengths = np.random.default_rng(0).uniform(0.5, 2, len(mesh.X))
    relax_vertices(mesh, one_block(mesh), 20.0, False)
    assert np.array_equal(mesh.X[:, 3], lengths)


@pytest.mark.parametrize("height", [0.2, 1.0, 3.0, 8.0])
def test_sharp_vertices_stay(height):
    """Where the normals cancel any tangent plane would be noise: the tip of a steep cone."""
    V, F = zoo.bipyramid(20, top=height, bottom=-height)
    V[:, :2] += [0.1, 0.05] * (V[:, 2:] == 0)  # so that there is somewhere to go
    tip = int(np.argmax(V[:, 2]))
    around = [naive.normal(V, f) for f in naive.tuples(F) if tip in f]
    share = np.linalg.norm(sum(around)) / sum(np.linalg.norm(n) for n in around)
    W = relaxed(V, F)
    assert np.array_equal(W[tip], V[tip]) == (share <= SHARP)


def test_degenerate_rings_stay_finite():
    for name in ("flat_cap", "coincident_vertices"):
        V, F = zoo.ZOO[name].make()
        for stiffness in (0.0, 80.0):
            assert np.isfinite(relaxed(V, F, stiffness)).all()


def test_areas_become_even():
    V, F = zoo.upsampled(*zoo.icosphere(2), noise=0.3)
    spread = lambda W: np.std(naive.voronoi_areas(W, F)) / np.mean(naive.voronoi_areas(W, F))  # noqa: E731
    mesh = built(V, F)
    for _ in range(10):
        relax_vertices(mesh, one_block(mesh), 0.0, False)
    assert spread(mesh.X[:, :3]) < 0.6 * spread(V)


@pytest.mark.parametrize("name", ["torus", "annulus"])
@pytest.mark.parametrize("per_block", [5, 30, 1000])
def test_blocks_agree_to_rounding(per_block, name, monkeypatch):
    """The order of a sum may depend on the blocks, whose number depends on the size only."""
    V, F = bumpy(name)
    mesh = built(V, F, ordered=True)
    same = built(V, F, ordered=True)
    mesh.X[:, 3] = same.X[:, 3] = np.random.default_rng(1).uniform(0.5, 2, len(V))
    relax_vertices(mesh, one_block(mesh), 20.0, False)
    relax_vertices(same, blocks_of(same, per_block, monkeypatch), 20.0, False)
    assert pytest.approx(same.X, rel=1e-12, abs=1e-14) == mesh.X


# --- curves --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["grid", "annulus", "planar_delaunay", "cylinder"])
def test_boundary_vertices_slide_along_their_chord(name):
    """Whatever their lengths; the rest of the mesh has no say."""
    V, F = bumpy(name)
    lengths = np.random.default_rng(2).uniform(0.5, 2, len(V))
    rim = built(V, F).kind == CURVE
    found = relaxed(V, F, length=lengths)
    expected = naive.relaxed(V, F, lengths=lengths)
    assert found[rim] == pytest.approx(expected[rim], rel=1e-9, abs=1e-12)
    away = V.copy()
    away[~rim] += 0.3
    assert np.array_equal(relaxed(away, F, length=lengths)[rim], found[rim])


def crossed(seed=0):
    """Bumpy grid with a curve along its middle row, unevenly spaced; edges and vertices of the curve."""
    V, F = zoo.perturb(*zoo.grid(11, 7, seed), amount=0.08, seed=seed)
    row = 7 * np.arange(11) + 3
    return V, F, np.stack([row[:-1], row[1:]], axis=1), row


def test_curves_inside_slide_as_boundaries_do():
    V, F, edges, row = crossed()
    rim = sorted({v for edge in naive.boundary_edges(F) for v in edge} & set(row.tolist()))
    mesh = built(V, F)
    featured(mesh, feature_edges=edges, fixed_vertices=rim)
    corners = np.flatnonzero(mesh.kind == FIXED)
    assert set(rim) <= set(corners.tolist()) and (mesh.kind[row[1:-1]] == CURVE).all()
    lengths = np.random.default_rng(3).uniform(0.5, 2, len(V))
    mesh.X[:, 3] = lengths
    relax_vertices(mesh, one_block(mesh), 0.0, False)
    curves = [frozenset(edge) for edge in edges.tolist()]
    expected = naive.relaxed(V, F, lengths=lengths, curves=curves, fixed=corners.tolist())
    assert mesh.X[:, :3] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert np.linalg.norm(mesh.X[row[1:-1], :3] - V[row[1:-1]], axis=1).min() > 0


@pytest.mark.parametrize("seed", range(4))
def test_curves_slide_to_the_same_bits_whichever_neighbour_comes_first(seed):
    """Sheets that meet in a seam see it from both ends: a last bit of difference would open it."""
    V, F, edges, row = crossed(seed)
    rng = np.random.default_rng(seed)
    lengths = rng.uniform(0.5, 2, len(V))
    on_curves = np.union1d(row, np.unique([sorted(edge) for edge in naive.boundary_edges(F)]))
    found, starts = [], set()
    for turned in range(6):
        G = (F[:, ::-1] if turned % 2 else F)[rng.permutation(len(F))]
        G = np.take_along_axis(G, (np.arange(3) + rng.integers(3, size=(len(G), 1))) % 3, axis=1)
        mesh = built(V, G)
        featured(mesh, feature_edges=edges, fixed_vertices=row[[0, -1]])
        mesh.X[:, 3] = lengths
        starts.add(ends_of_first_curve(mesh, int(row[5])))
        relax_vertices(mesh, one_block(mesh), 60.0, False)
        found.append(mesh.X[on_curves, :3].tobytes())
    assert len(set(found)) == 1
    assert len(starts) == 2, "the neighbours never swapped"


def ends_of_first_curve(mesh, v):
    """Where the first curve edge leads that a walk around an inner vertex meets."""
    h = int(mesh.vertex_halfedge[v])
    while mesh.curve[h] == NONE:
        h = int(mesh.twin[h - h % 3 + (h + 2) % 3])
    return int(mesh.origin[next_of(h)])


def test_a_curve_settles_where_edges_have_their_lengths():
    """Straight boundary between two fixed corners: edges in the ratio of the lengths at their ends."""
    V, F = zoo.grid(9, 3)
    lengths = 1 + V[:, 0]
    bottom = np.flatnonzero(V[:, 1] == 0)
    mesh = built(V, F, length=lengths)
    mesh.kind[np.setdiff1d(np.arange(len(V)), bottom[1:-1])] = FIXED
    for _ in range(400):
        relax_vertices(mesh, one_block(mesh), 0.0, False)
    steps = np.diff(mesh.X[bottom, 0])
    wanted = lengths[bottom[1:]] + lengths[bottom[:-1]]
    assert steps / steps.sum() == pytest.approx(wanted / wanted.sum(), rel=1e-6)
    assert not mesh.X[bottom, 1].any()


def test_a_lone_vertex_of_a_curve_stays():
    """No neighbours on the curve, as where all its edges were frozen away: no step, no nonsense."""
    mesh = built(*zoo.perturb(*zoo.icosphere(1), amount=0.1))
    mesh.kind[7] = CURVE
    before = mesh.X[7].copy()
    relax_vertices(mesh, one_block(mesh), 0.0, False)
    assert np.array_equal(mesh.X[7], before)


def chevron():
    """One inner vertex in an arrow head whose middle lies outside: below vertex 1."""
    V = np.array([[-3, -2, 0], [0, 0, 0], [3, -2, 0], [0, 1, 0], [0, 0.5, 0]], float)
    return V, zoo.fan(np.array([0, 1, 2, 3]), 4)


def test_no_fold_beside_a_concave_boundary():
    V, F = chevron()
    assert min(naive.normal(V, f)[2] for f in naive.tuples(F)) > 0
    areas = naive.voronoi_areas(V, F)[:4]
    assert (areas @ V[:4])[1] / areas.sum() < 0  # the step without a guard
    W = relaxed(V, F, fixed=range(4))
    assert min(naive.normal(W, f)[2] for f in naive.tuples(F)) > 0
    assert W[4, 1] < 0.5  # a part of the way
    assert np.array_equal(W[:4], V[:4])


def corner_of_an_l(seed):
    """Square, and a feature curve in it that turns once: an L on one side, a square on the other."""
    V, F = zoo.upsampled(*zoo.grid(9, 9, seed), n=1, noise=0.0)
    at = {tuple(p): v for v, p in enumerate(V[:, :2].tolist())}
    steps = np.arange(0, 4, 0.5)
    path = [(4.0, y) for y in steps] + [(4.0 - x, 4.0) for x in steps] + [(0.0, 4.0)]
    path = np.array([at[p] for p in path])
    free = np.setdiff1d(np.arange(len(V)), path)
    free = free[(V[free, :2] > 0).all(axis=1) & (V[free, :2] < 8).all(axis=1)]
    noise = np.random.default_rng(seed).uniform(-0.16, 0.16, (len(free), 2))
    V[free, :2] += noise
    return V, F, np.stack([path[:-1], path[1:]], axis=1), at[4.0, 4.0]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("side", ["inside", "outside"])
def test_no_fold_beside_a_corner_of_a_curve(seed, side):
    """Lengths that grow away from it pull vertices towards it, on the concave side over it."""
    V, F, edges, corner = corner_of_an_l(seed)
    mesh = built(V, F)
    featured(mesh, feature_edges=edges, fixed_vertices=[corner, edges[0, 0], edges[-1, -1]])
    away = np.linalg.norm(V[:, :2] - ([0, 0] if side == "inside" else [8, 8]), axis=1)
    mesh.X[:, 3] = 1 + 0.2 * away
    for _ in range(30):
        relax_vertices(mesh, one_block(mesh), 0.0, False)
        normals = np.array([naive.normal(mesh.X[:, :3], f) for f in naive.tuples(F)])
        assert (normals[:, 2] > 0).all()
    assert zoo.area(mesh.X[:, :3], F) == pytest.approx(64)
    assert np.array_equal(mesh.X[corner, :3], V[corner])
    assert mesh.curve[half_edge(mesh, *edges[0])] != NONE
