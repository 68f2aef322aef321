"""What has no size goes, and the surface stays: caps, flaps, short edges, fins."""

from itertools import pairwise

import numpy as np
import pytest
from helpers import naive, zoo

from remeshvec import remesh
from remeshvec.input.prepare import Kept, prepare
from remeshvec.mesh.edges import unique_edges
from remeshvec.mesh.repair import drop_duplicate_faces


def edges_of(f):
    return list(zip(f, f[1:] + f[:1], strict=True))


def with_caps(fractions, seed=0, count=4):
    """A cube with points on some of its edges, tied to the face across by faces without area."""
    V, F = zoo.cube()
    V, F = V.tolist(), [tuple(f) for f in F.tolist()]
    rng = np.random.default_rng(seed)
    edges = sorted({tuple(sorted(e)) for f in F for e in edges_of(f)})
    straight = [e for e in edges if np.isclose(np.linalg.norm(np.subtract(V[e[0]], V[e[1]])), 1)]
    for k in rng.choice(len(straight), count, replace=False):
        a, b = straight[k]
        f = next(f for f in F if (a, b) in edges_of(f))
        apex = next(v for v in f if v not in (a, b))
        F.remove(f)
        line = [a, *range(len(V), len(V) + len(fractions)), b]
        V += [np.add(V[a], t * np.subtract(V[b], V[a])).tolist() for t in fractions]
        F += [(p, q, apex) for p, q in pairwise(line)]
        F += [(a, q, p) for p, q in pairwise(line[1:])]
    return np.array(V), np.array(F)


def mended(V, F, **options):
    return prepare(np.asarray(V, float), np.asarray(F, np.int64), False, **options)


def euler(F):
    return len(np.unique(F)) - len(unique_edges(F)) + len(F)


def areas(mesh):
    X, F = mesh.X[:, :3], mesh.origin.reshape(-1, 3)
    return np.linalg.norm(np.cross(X[F[:, 1]] - X[F[:, 0]], X[F[:, 2]] - X[F[:, 0]]), axis=1) / 2


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "fractions", [(0.5,), (0.3, 0.6), (0.2, 0.5, 0.9), (0.01,), (0.5, 0.5), (0.0, 0.5)]
)
def test_caps_give_their_apex_to_the_face_across(fractions, seed):
    V, F = with_caps(fractions, seed)
    result = mended(V, F)
    G = result.mesh.origin.reshape(-1, 3)
    assert areas(result.mesh).min() > 1e-6
    assert not naive.boundary_edges(G)
    assert euler(G) == 2
    assert zoo.volume(result.mesh.X[:, :3] / result.scale, G) == pytest.approx(1, abs=1e-12)
    # Every corner lies where the weights of its input face say.
    row, weights = result.cuts.row, result.cuts.weights
    assert (row >= 0).sum() == len(weights) > 0
    cut = np.flatnonzero(row >= 0)
    at = np.einsum("fij,fjk->fik", weights[row[cut]], V[F[result.face_source[cut]]])
    assert at == pytest.approx(result.mesh.X[G[cut], :3] / result.scale, abs=1e-12)


@pytest.mark.parametrize("fractions", [(0.5,), (0.2, 0.5, 0.9), (0.5, 0.5)])
def test_births_lie_on_the_input(fractions):
    V, F = with_caps(fractions)
    result = remesh(V, F, 0.2)
    born = np.einsum("nc,ncx->nx", result.birth_barycentric, V[F[result.birth_face]])
    assert born == pytest.approx(result.V, abs=1e-9)
    assert zoo.volume(*result) == pytest.approx(1, abs=1e-9)
    assert result.report.quality_after.min_angle > 20


@pytest.mark.parametrize("faces", [1, 2])
def test_a_flap_on_a_crease_goes(faces):
    """One face makes an edge of three, two faces hang on an edge of four."""
    V, F = zoo.cube()
    a, b = 0, next(v for v in F[F[:, 0] == 0][0] if np.isclose(np.linalg.norm(V[v] - V[0]), 1))
    V = np.vstack([V, (V[a] + V[b]) / 2])
    m = len(V) - 1
    result = mended(V, np.vstack([F, [(a, b, m), (b, a, m)][:faces]]))
    G = result.mesh.origin.reshape(-1, 3)
    assert euler(G) == 2 and not naive.boundary_edges(G)
    assert "non_manifold_edges" not in result.dirt
    assert zoo.volume(result.mesh.X[:, :3] / result.scale, G) == pytest.approx(1)


def test_short_edges_are_welded_and_long_chains_of_them_are_not():
    V, F = zoo.grid(6, 6)
    V = V.astype(float)
    V[8] = V[7] + [1e-9, 0, 0]
    result = mended(V, F)
    assert result.dirt["short_edges"] == 1
    assert result.representative[8] == 7
    fine = np.linspace(0, 4e-5, 401)  # steps of a tenth of the tolerance
    strip = np.vstack([np.c_[fine, 0 * fine, 0 * fine], np.c_[fine, 0 * fine + 1, 0 * fine]])
    i = np.arange(400)
    G = np.vstack([np.c_[i, i + 1, i + 402], np.c_[i, i + 402, i + 401]])
    assert "short_edges" not in mended(strip, G).dirt


def test_small_parts_stay():
    V, F = zoo.icosphere(2)
    W, G = zoo.tetrahedron()
    both = np.vstack([V, 1e-8 * W + 3.0]), np.vstack([F, G + len(V)])
    result = mended(*both)
    assert len(result.mesh.origin) // 3 == len(F) + len(G)


def spiked_ball(height):
    """A ball and a vertex of it that stands on a ring which has shrunk to a thread."""
    V, F = zoo.icosphere(2)
    tip = 0
    ring = np.setdiff1d(F[(tip == F).any(axis=1)], tip)
    foot = V[tip].copy()
    V[ring] = foot + 1e-9 * (V[ring] - foot)
    V[tip] *= 1 + height
    return V, F, tip, ring


@pytest.mark.parametrize("height", [1e-5, 0.1])
def test_a_spike_without_thickness_goes(height):
    V, F, _, ring = spiked_ball(height)
    result = mended(V, F)
    G = result.mesh.origin.reshape(-1, 3)
    assert len(np.unique(result.representative[ring])) == 1
    assert len(result.mesh.X) == len(V) - len(ring)  # its tip is gone, its foot is one vertex
    assert not naive.boundary_edges(G) and euler(G) == 2


def test_a_spike_whose_tip_is_kept_stays():
    V, F, tip, _ = spiked_ball(0.1)
    kept = Kept(np.arange(len(V)) == tip, np.zeros(len(F), bool))
    result = mended(V, F, find_kept=lambda: kept)
    assert len(result.mesh.origin) // 3 == len(F)
    assert "short_edges" not in result.dirt


def test_what_must_stay_does():
    V, F = with_caps((0.5,))
    n, m = len(V), len(F)
    kept = Kept(np.zeros(n, bool), np.ones(m, bool))
    assert len(mended(V, F, find_kept=lambda: kept).mesh.origin) // 3 == m
    V, F = with_caps((0.5, 0.5))
    kept = Kept(np.ones(len(V), bool), np.zeros(len(F), bool))
    result = mended(V, F, find_kept=lambda: kept)
    assert len(result.mesh.X) >= len(V)
    assert "short_edges" not in result.dirt


@pytest.mark.parametrize("unit", [1e-150, 1e-12, 1e9, 1e150])
def test_any_unit(unit):
    V, F = with_caps((0.3, 0.6))
    result = mended(unit * V, F)
    assert result.dirt == mended(V, F).dirt
    assert np.array_equal(result.mesh.origin, mended(V, F).mesh.origin)


# --- pairs of opposite faces ---------------------------------------------------------------------


def test_a_fin_goes_and_a_doubled_face_stays_once():
    """A fin has a whole surface below it; the face of a cube that is there both ways fills a hole."""
    _, F = zoo.cube()
    a, b, m = F[0, 0], F[0, 1], F.max() + 1
    fin = np.vstack([F, [(a, m, b), (b, m, a)]])
    assert drop_duplicate_faces(fin).tolist() == list(range(len(F)))
    doubled = np.vstack([F, F[3:4, ::-1]])
    assert drop_duplicate_faces(doubled).tolist() == list(range(len(F)))


def test_both_sides_of_everything_leave_one():
    _, F = zoo.grid(4, 4)
    kept = drop_duplicate_faces(np.vstack([F, F[:, ::-1]]))
    assert kept.tolist() == list(range(len(F)))


def test_the_winding_that_prevails_stays():
    F = np.array([[2, 1, 0], [0, 1, 2], [1, 2, 0]])
    assert drop_duplicate_faces(F).tolist() == [1]
