"""Target lengths grow no faster than told, and are otherwise nearly as large as they may be."""

import numpy as np
import pytest
from helpers import zoo
from helpers.structure import built
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from remeshvec.sizing import gradation as gradation_module
from remeshvec.sizing.gradation import _limit, _steepest, gradation_slope, limit_gradation


def arrays(mesh):
    return mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge


def slopes(mesh, u):
    """Gradients of the linear interpolant, by least squares in every face; 0 where it has no area."""
    found = []
    for f in mesh.origin.reshape(-1, 3):
        A, d = mesh.X[f[1:], :3] - mesh.X[f[0], :3], u[f[1:]] - u[f[0]]
        has_area = np.linalg.norm(np.cross(*A)) > 1e-9 * np.linalg.norm(A, axis=1).max() ** 2
        found.append(np.linalg.norm(np.linalg.lstsq(A, d, rcond=None)[0]) if has_area else 0.0)
    return np.array(found)


def edge_slopes(mesh, u):
    a, b = mesh.origin, np.roll(mesh.origin.reshape(-1, 3), -1, axis=1).ravel()
    lengths = np.linalg.norm(mesh.X[a, :3] - mesh.X[b, :3], axis=1)
    return (np.abs(u[a] - u[b])[lengths > 0] / lengths[lengths > 0], u[a] - u[b], lengths)


def bellman_ford(mesh, u, slope):
    """Largest field below ``u`` that no edge is too steep for, slowly."""
    u = u.copy()
    heads = np.roll(mesh.origin.reshape(-1, 3), -1, axis=1).ravel()
    while True:
        before = u.copy()
        for a, b in [*zip(mesh.origin, heads, strict=True), *zip(heads, mesh.origin, strict=True)]:
            u[b] = min(u[b], u[a] + slope * np.linalg.norm(mesh.X[a, :3] - mesh.X[b, :3]))
        if np.array_equal(u, before):
            return u


def limited_by_edges(mesh, u, slope):
    u, n = u.copy(), len(u)
    heap, place = np.empty(n, np.int32), np.full(n, -1, np.int32)
    assert _limit(*arrays(mesh), slope, u, False, 10 * n, heap, place)
    assert (place == -1).all()
    return u


def random_lengths(mesh, kind, seed, size):
    rng, n = np.random.default_rng(seed), len(mesh.X)
    if kind == "spread":
        return size * 10 ** rng.uniform(-1.5, 1.5, n)
    found = np.full(n, 1e3 * size)
    found[rng.integers(0, n, 1 if kind == "point" else 3)] = size * 10 ** rng.uniform(-1, 0)
    return found


FIELDS = st.fixed_dictionaries(
    {
        "name": st.sampled_from([*zoo.TIDY, "flat_cap", "coincident_vertices"]),
        "amount": st.sampled_from([0.0, 0.1, 0.4]),
        "kind": st.sampled_from(["spread", "point", "few"]),
        "gradation": st.sampled_from([1.01, 1.2, 1.5, 3.0, 100.0]),
        "seed": st.integers(0, 10**6),
    }
)


def made(field):
    mesh = built(*zoo.perturb(*zoo.ZOO[field["name"]].make(), field["amount"], field["seed"]))
    size = zoo.mean_edge(mesh.X[:, :3], mesh.origin.reshape(-1, 3))
    return mesh, random_lengths(mesh, field["kind"], field["seed"], size)


def test_slope_and_gradation():
    """Lengths at the ends of an edge of 4/3 of their mean, if they differ by the slope."""
    for gradation in (1.01, 1.5, 4.0):
        ends = 1.0, gradation
        assert gradation - 1 == pytest.approx(gradation_slope(gradation) * 4 / 3 * np.mean(ends))


@given(FIELDS)
def test_limited_fields(field):
    mesh, given_lengths = made(field)
    before, slope = given_lengths.copy(), gradation_slope(field["gradation"])
    found = limit_gradation(*arrays(mesh), given_lengths, field["gradation"])
    assert np.array_equal(given_lengths, before)
    assert (found <= before).all() and found.min() == before.min()
    assert slopes(mesh, found).max() <= slope * (1 + 1e-9) + 1e-12
    _, steps, lengths = edge_slopes(mesh, found)
    assert (np.abs(steps) <= slope * lengths * (1 + 1e-9) + 1e-14 * found.max()).all()
    again = limit_gradation(*arrays(mesh), found, field["gradation"])
    assert again.tobytes() == found.tobytes()


@given(FIELDS)
def test_edges_alone_are_the_naive_twin(field):
    mesh, lengths = made(field)
    slope = gradation_slope(field["gradation"])
    expected = bellman_ford(mesh, lengths, slope)
    assert limited_by_edges(mesh, lengths, slope) == pytest.approx(expected, rel=1e-12)
    assert (limit_gradation(*arrays(mesh), lengths, field["gradation"]) <= expected * 1.0001).all()


def test_edges_alone_are_not_enough():
    """From one vertex of a grid, edge by edge, the slope inside faces is up to 1.41 of that allowed."""
    mesh = built(*zoo.grid(15, 15))
    lengths = np.full(225, 100.0)
    lengths[112] = 0.1
    slope = gradation_slope(1.5)
    assert slopes(mesh, limited_by_edges(mesh, lengths, slope)).max() > 1.3 * slope


def largest_sum(mesh, lengths, slope, directions=32):
    """Largest sum of a limited field, by linear programming with 32 directions of the gradient."""
    F, n = mesh.origin.reshape(-1, 3), len(lengths)
    rows = []
    for f in F:
        T = mesh.X[f, :3]
        A = T[1:] - T[0]
        u = A[0] / np.linalg.norm(A[0])
        w = np.cross(np.cross(A[0], A[1]), u)
        w /= np.linalg.norm(w)
        G = np.linalg.inv(A @ np.stack([u, w], axis=1)) @ [[-1, 1, 0], [-1, 0, 1]]
        for angle in zoo.turn(directions):
            row = np.zeros(n)
            row[f] = np.array([np.cos(angle), np.sin(angle)]) @ G
            rows.append(row)
    bounds = np.stack([np.full(n, lengths.min()), lengths], axis=1)
    return -linprog(-np.ones(n), np.array(rows), np.full(len(rows), slope), bounds=bounds).fun


@pytest.mark.parametrize("name", ["icosphere", "planar_delaunay", "torus", "bipyramid", "l_prism"])
@pytest.mark.parametrize("kind", ["spread", "point"])
def test_nearly_the_largest_field(name, kind):
    mesh, lengths = made({"name": name, "amount": 0.0, "kind": kind, "seed": 4})
    found = limit_gradation(*arrays(mesh), lengths, 1.5)
    assert found.sum() > 0.9 * largest_sum(mesh, lengths, gradation_slope(1.5))


def test_linear_fields_at_the_limit_stay():
    """In whatever direction, on whatever triangles; a little steeper, and they are lowered."""
    V, F = zoo.planar_delaunay(400)
    mesh = built(V, F)
    slope = gradation_slope(1.4)
    for angle in zoo.turn(7):
        lengths = 2 + slope * (V[:, :2] @ [np.cos(angle), np.sin(angle)])
        assert np.array_equal(limit_gradation(*arrays(mesh), lengths, 1.4), lengths)
        steeper = 2 + (1 + 1e-8) * (lengths - 2)
        assert (limit_gradation(*arrays(mesh), steeper, 1.4) < steeper).mean() > 0.5


def test_rounding_in_faces_without_height_lowers_nothing():
    V, F = zoo.upsampled(*zoo.flat_cap(), 3, 0.0)
    mesh = built(zoo.rotate(V), F)
    for angle in zoo.turn(7):
        lengths = 2 + 0.99 * gradation_slope(1.4) * (V[:, :2] @ [np.cos(angle), np.sin(angle)])
        assert np.array_equal(limit_gradation(*arrays(mesh), lengths, 1.4), lengths)


def test_growth_goes_with_the_distance_on_the_surface():
    V, F = zoo.icosphere(4)
    mesh = built(V, F)
    lengths = np.full(len(V), 10.0)
    lengths[50] = 0.05
    found = limit_gradation(*arrays(mesh), lengths, 1.5)
    away = np.arccos(np.clip(V @ V[50], -1, 1))
    expected = 0.05 + gradation_slope(1.5) * away
    assert (found <= expected * 1.01).all()
    assert (found / expected).min() > 0.75 and (found / expected).mean() > 0.9


def test_lengths_scale_with_the_mesh_when_limited():
    mesh, lengths = made({"name": "torus", "amount": 0.1, "kind": "spread", "seed": 1})
    expected = limit_gradation(*arrays(mesh), lengths, 1.3)
    mesh.X[:] *= 2.0**-20
    assert np.array_equal(
        limit_gradation(*arrays(mesh), lengths * 2.0**-20, 1.3), expected * 2.0**-20
    )


def test_what_is_left_when_visits_run_out(monkeypatch):
    monkeypatch.setattr(gradation_module, "_VISITS", 0)
    for kind in ("spread", "point"):
        mesh, lengths = made({"name": "torus", "amount": 0.4, "kind": kind, "seed": 1})
        found = limit_gradation(*arrays(mesh), lengths, 1.5)
        assert (found <= lengths).all() and found.min() == lengths.min()
        assert 0.99 < slopes(mesh, found).max() / gradation_slope(1.5) <= 1 + 1e-9


def test_visits_are_few_on_slivers():
    """Every edge of a squeezed, perturbed torus is a sliver's; ten visits a vertex are enough."""
    V, F = zoo.perturb(*zoo.torus(60, 30), 0.4)
    V[:, 2] *= 1e-3
    mesh = built(V, F)
    lengths = random_lengths(mesh, "spread", 0, 0.1)
    slope, n = gradation_slope(1.5), len(V)
    found = limited_by_edges(mesh, lengths, slope)
    heap, place = np.empty(n, np.int32), np.full(n, -1, np.int32)
    assert _limit(*arrays(mesh), slope, found, True, 10 * n, heap, place)
    assert _steepest(mesh.X, mesh.origin, found) <= slope * (1 + 1e-9)
