"""Sheets a fifth of L apart: no vertex jumps to the other one."""

import numpy as np
import pytest
from helpers import zoo
from helpers.complexes import grouped, shape
from helpers.invariants import assert_clean
from helpers.measures import ON, boundary_edges, diagonal, face_points, to_surface, unit_normals

from data.shapes.solids import uv_sphere
from remeshvec import remesh


def joined(*parts):
    """Several meshes as one."""
    shifts = np.cumsum([0, *[len(V) for V, _ in parts[:-1]]])
    faces = [F + shift for (_, F), shift in zip(parts, shifts, strict=True)]
    return np.vstack([V for V, _ in parts]), np.vstack(faces)


def components(V, F):
    """Vertices of every component, and its faces, the component of the input's first part first."""
    count, label = grouped(len(V), F.ravel(), np.roll(F, -1, axis=1).ravel())
    return [(np.flatnonzero(label == k), F[label[F[:, 0]] == k]) for k in range(count)]


def noisy_grid(n, seed):
    """Unit square with noise along its plane."""
    V, F = zoo.grid(n, n, seed)
    V = V / (n - 1)
    inner = np.setdiff1d(np.arange(len(V)), boundary_edges(F))
    V[inner, :2] += np.random.default_rng(seed).uniform(-0.25, 0.25, (len(inner), 2)) / (n - 1)
    return V, F


@pytest.mark.parametrize("L", [0.05, 0.12])
@pytest.mark.parametrize("facing", ["same", "opposite"])
@pytest.mark.parametrize("n", [9, 25])
def test_two_parallel_squares(n, facing, L):
    gap = 0.2 * L
    V, F = noisy_grid(n, 0)
    W, G = noisy_grid(n, 1)
    V, F = joined((V, F), (W + np.array([0, 0, gap]), G if facing == "same" else G[:, ::-1]))
    result = remesh(V, F, L)
    assert_clean(*result)
    assert shape(result.F) == shape(F)
    parts = components(*result)
    assert len(parts) == 2
    heights = []
    for vertices, faces in parts:
        z = result.V[vertices, 2]
        height = gap * (z.mean() > gap / 2)
        heights.append(height)
        assert np.abs(z - height).max() < ON
        assert zoo.area(result.V, faces) == pytest.approx(1, rel=ON)
        up = 1 if height == 0 or facing == "same" else -1
        assert (up * unit_normals(result.V, faces)[:, 2] > 0.999).all()
    assert sorted(heights) == [0, gap]


@pytest.mark.parametrize("L", [0.12, 0.25, 0.6])
@pytest.mark.parametrize("facing", ["same", "opposite"])
def test_two_spheres(facing, L):
    """Radii a fifth of L apart: vertices keep their radius, faces do not reach the other sphere."""
    gap = 0.2 * L
    V, F = zoo.upsampled(*zoo.icosphere(4), n=0, noise=0.2)
    V /= np.linalg.norm(V, axis=1, keepdims=True)
    W, G = uv_sphere(90, 45)
    own = 0.004  # what the faces of either input are below its sphere, at most
    assert all(to_surface(0 * P[:1], P, T)[0] > 1 - own for P, T in ((V, F), (W, G)))
    V, F = joined((V, F), (W * (1 - gap), G if facing == "same" else G[:, ::-1]))
    result = remesh(V, F, L)
    assert shape(result.F) == shape(F)
    parts = components(*result)
    assert len(parts) == 2
    found = []
    for vertices, faces in parts:
        r = np.linalg.norm(result.V[vertices], axis=1)
        radius = 1.0 if r.mean() > 1 - gap / 2 else 1 - gap
        found.append(radius)
        assert r.max() < radius + ON and r.min() > radius - own
        inward = radius < 1 and facing == "opposite"
        middles = result.V[faces].mean(axis=1)
        along = (unit_normals(result.V, faces) * middles).sum(axis=1)
        assert ((-along if inward else along) > 0.8 * radius).all()
    assert sorted(found) == [1 - gap, 1.0]


def waves(P):
    return 0.12 * np.sin(5 * P[:, 0]) * np.cos(4 * P[:, 1])


@pytest.mark.parametrize("L", [0.1, 0.3])
def test_two_wavy_sheets(L):
    """At the longer L waves bend within an edge: vertices stray farther than the gap."""
    gap, own = 0.2 * L, 0.0  # how far the input's faces are off the waves
    parts = []
    for seed, height in ((0, 0.0), (1, gap)):
        V, F = noisy_grid(41, seed)
        V = V * [2, 2, 0]
        V[:, 2] = waves(V) + height
        inner = face_points(V, F, per_face=10).reshape(-1, 3)
        own = max(own, 1.1 * np.abs(inner[:, 2] - waves(inner) - height).max())
        parts.append((V, F))
    V, F = joined(*parts)
    result = remesh(V, F, L)
    assert shape(result.F) == shape(F)
    assert own < 0.25 * gap
    found = []
    for vertices, _ in components(*result):
        above = result.V[vertices, 2] - waves(result.V[vertices])
        height = gap * (np.median(above) > gap / 2)
        found.append(height)
        assert np.abs(above - height).max() < own
    assert sorted(found) == [0, gap]


@pytest.mark.parametrize("form", ["as it is", "finer"])
def test_a_closed_thin_box(form):
    """9 x 9 x 0.2 at L = 1: both sides keep their heights and the volume is that of the box."""
    V, F = zoo.thin_sheet(10, thickness=0.2)
    if form == "finer":
        V, F = zoo.upsampled(V, F, n=1, noise=0)
    result = remesh(V, F, 1.0, feature_angle=60)
    assert_clean(*result)
    assert shape(result.F) == shape(F)
    assert zoo.volume(*result) == pytest.approx(81 * 0.2, rel=1e-9)
    assert to_surface(result.V, V, F).max() < ON * diagonal(V)
    N, corners = unit_normals(*result), result.V[result.F]
    for height, sign in ((0.0, 1), (-0.2, -1)):
        side = np.abs(corners[:, :, 2] - height).max(axis=1) < 1e-9
        assert (sign * N[side, 2] > 1 - 1e-9).all()
        assert zoo.area(result.V, result.F[side]) == pytest.approx(81, rel=1e-9)


@pytest.mark.parametrize("L", [0.7, 1.0])
def test_a_thin_box_without_an_angle(L):
    """By default: the rim is a crease of 90 degrees twice, 0.2 L apart."""
    V, F = zoo.upsampled(*zoo.thin_sheet(10, thickness=0.2 * L), n=1, noise=0)
    result = remesh(V, F, L)
    assert shape(result.F) == shape(F)
    z = result.V[:, 2]
    inside = (np.abs(result.V[:, :2] - 4.5) < 4.2).all(axis=1)
    assert (np.minimum(np.abs(z), np.abs(z + 0.2 * L))[inside] < 1e-9).all()
    assert zoo.volume(*result) == pytest.approx(81 * 0.2 * L, rel=1e-6)


def test_own_thin_sheet():
    """A curved sheet with two sides a fifth of an edge apart, and a rim."""
    V, F = zoo.read(zoo.DATA / "thin_sheet.obj")
    L = zoo.mean_edge(V, F)
    result = remesh(V, F, L)
    assert shape(result.F) == shape(F)
    assert to_surface(result.V, V, F).max() < ON * diagonal(V)
    assert zoo.area(*result) == pytest.approx(zoo.area(V, F), rel=0.02)
    assert zoo.volume(*result) == pytest.approx(zoo.volume(V, F), rel=0.05)
