"""Lloyd rounds against the formula: centroids of clipped Voronoi cells, momentum, the bound of a step."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import assert_valid, blocks_of, built, one_block

from remeshvec.core.vocabulary import INNER
from remeshvec.operations.frames import FRAME_SIZE, measure_frames
from remeshvec.operations.lloyd import Pace, run_lloyd_round

PLAIN = Pace(gain=1.0, momentum=0.0, reach=1e9)
FREE = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])  # a frame that lets every step be
MESHES = ["icosphere", "torus", "planar_delaunay", "annulus", "genus_2", "two_components"]


def bumpy(name):
    """Mesh with obtuse faces."""
    return zoo.perturb(*zoo.ZOO[name].make(), amount=0.25, seed=3)


def moved(mesh, blocks, pace=PLAIN, velocity=None, varies=False):
    """Where vertices go in one round without frames."""
    start = mesh.X.copy()
    frames = np.tile(FREE, (len(mesh.X), 1))
    velocity = np.zeros((len(mesh.X), 3)) if velocity is None else velocity
    run_lloyd_round(mesh, blocks, frames, velocity, pace, varies, False)
    assert np.array_equal(mesh.X[:, 3], start[:, 3])
    return mesh.X[:, :3] - start[:, :3]


@pytest.mark.parametrize("varies", [False, True])
@pytest.mark.parametrize("per_block", [9, 100_000])
@pytest.mark.parametrize("name", MESHES)
def test_vertices_go_to_the_centroids_of_their_cells(name, per_block, varies, monkeypatch):
    mesh = built(*bumpy(name), ordered=True)
    V, F = mesh.X[:, :3].copy(), mesh.origin.reshape(-1, 3)
    obtuse = [f for f in naive.tuples(F) if naive.circumcentre(*V[list(f)]) in middles(V, f)]
    assert obtuse and len(obtuse) < len(F)
    lengths = np.exp(np.random.default_rng(5).normal(scale=0.4, size=len(V)))
    mesh.X[:, 3] = lengths
    expected = naive.centroid_steps(V, F, lengths if varies else None)
    found = moved(mesh, blocks_of(mesh, per_block, monkeypatch), varies=varies)
    assert found == pytest.approx(expected, rel=1e-7, abs=1e-10)
    if varies:
        assert not np.allclose(found, naive.centroid_steps(V, F), atol=1e-3)


class middles:
    """Middles of the sides of a face."""

    def __init__(self, V, f):
        self.points = [(V[f[i]] + V[f[i - 1]]) / 2 for i in range(3)]

    def __contains__(self, point):
        return any(np.allclose(point, middle, atol=1e-12) for middle in self.points)


def test_a_part_of_the_velocity_stays():
    mesh = built(*bumpy("torus"))
    V, F = mesh.X[:, :3].copy(), mesh.origin.reshape(-1, 3)
    velocity = np.random.default_rng(0).normal(scale=0.1, size=V.shape)
    expected = 0.7 * velocity + 1.5 * naive.centroid_steps(V, F)
    found = moved(mesh, one_block(mesh), Pace(1.5, 0.7, 1e9), velocity)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert velocity == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_steps_are_bounded():
    """In target lengths; their direction stays, and so does the shorter velocity."""
    mesh = built(*bumpy("torus"), length=0.5)
    V, F = mesh.X[:, :3].copy(), mesh.origin.reshape(-1, 3)
    velocity = np.zeros(V.shape)
    wanted = naive.centroid_steps(V, F)
    size = np.linalg.norm(wanted, axis=1)
    limit = float(np.median(size))
    found = moved(mesh, one_block(mesh), Pace(1.0, 0.9, 2 * limit), velocity)
    expected = wanted * np.minimum(1.0, limit / size)[:, None]
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert velocity == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_frames_turn_and_stop_steps():
    V, F = bumpy("torus")
    mesh = built(V, F)
    still = np.arange(len(V)) % 4 == 0
    mesh.kind[still] = INNER + 1
    frames = np.empty((len(V), FRAME_SIZE))
    measure_frames(mesh, one_block(mesh), 400.0, frames, False)
    run_lloyd_round(mesh, one_block(mesh), frames, np.zeros(V.shape), PLAIN, False, False)
    steps = naive.centroid_steps(V, F)
    for v in range(0, len(V), 3):
        step = np.zeros(3) if still[v] else naive.tangential(V, F, v, steps[v], 400.0)
        assert mesh.X[v, :3] - V[v] == pytest.approx(step, rel=1e-7, abs=1e-10)


def test_areas_become_even_and_momentum_helps():
    """On a sphere whose vertices lie denser towards a pole: long waves decay slowly without momentum."""
    V, F = zoo.icosphere(3)
    V = V + np.array([0.0, 0.0, 0.3])
    V /= np.linalg.norm(V, axis=1)[:, None]
    spread = lambda W: np.std(naive.voronoi_areas(W, F)) / np.mean(naive.voronoi_areas(W, F))  # noqa: E731
    after = []
    for pace in (Pace(1.0, 0.0, 0.05), Pace(3.0, 0.85, 0.05)):
        mesh = built(V, F, length=zoo.mean_edge(V, F))
        frames, velocity = np.empty((len(V), FRAME_SIZE)), np.zeros(V.shape)
        for _ in range(20):
            measure_frames(mesh, one_block(mesh), 0.0, frames, False)
            run_lloyd_round(mesh, one_block(mesh), frames, velocity, pace, False, False)
            mesh.X[:, :3] /= np.linalg.norm(mesh.X[:, :3], axis=1)[:, None]
        assert_valid(mesh)
        after.append(spread(mesh.X[:, :3]))
    assert after[0] < 0.95 * spread(V)
    assert after[1] < 0.7 * after[0]


def test_degenerate_faces_count_for_nothing():
    for name in ("flat_cap", "coincident_vertices"):
        mesh = built(*zoo.ZOO[name].make())
        assert np.isfinite(moved(mesh, one_block(mesh))).all()


def test_tiny_lengths_do_not_overflow():
    """The density is relative: its fourth power of a tiny length alone would be infinite."""
    V, F = bumpy("torus")
    near, tiny = built(V, F, length=1.0), built(V, F, length=1e-90)
    near.X[::2, 3] *= 1.5
    tiny.X[::2, 3] *= 1.5
    one = moved(near, one_block(near), varies=True)
    two = moved(tiny, one_block(tiny), Pace(1.0, 0.0, 1e300), varies=True)
    assert two == pytest.approx(one, rel=1e-9, abs=1e-12)
