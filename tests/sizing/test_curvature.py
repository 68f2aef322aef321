"""Largest principal curvature: known shapes, bad triangulations, noise, creases."""

import numpy as np
import pytest
from helpers import zoo
from helpers.structure import built
from scipy.spatial import ConvexHull

from data.shapes.cad_parts import prism
from remeshvec.core.vocabulary import NONE
from remeshvec.sizing.curvature import _part_fans, corner_curvature, largest_curvature


def curvature(V, F):
    mesh = built(V, F)
    return measured(mesh, np.zeros(len(mesh.origin), bool))


def measured(mesh, is_feature):
    return largest_curvature(mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge, is_feature)


def sharp_edges(mesh, degrees=30.0):
    """Half-edges at which the faces turn by more than an angle."""
    T = mesh.X[mesh.origin.reshape(-1, 3), :3]
    N = np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0])
    N /= np.linalg.norm(N, axis=1, keepdims=True)
    across = mesh.twin // 3  # of boundaries the last face; they may be marked or not
    cosine = (np.repeat(N, 3, axis=0) * N[across]).sum(axis=1)
    return (cosine < np.cos(np.radians(degrees))) | (mesh.twin == NONE)


def rms(values):
    return float(np.sqrt((np.asarray(values) ** 2).mean()))


# --- shapes and what is known of them ------------------------------------------------------------


def unit(V):
    return V / np.linalg.norm(V, axis=1, keepdims=True)


def random_sphere(n, seed=0):
    """Convex hull of random points: all valences, needles and caps."""
    V = unit(np.random.default_rng(seed).normal(size=(n, 3)))
    F = ConvexHull(V).simplices.astype(np.int64)
    T = V[F]
    inward = (np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0]) * T.sum(axis=1)).sum(axis=1) < 0
    F[inward] = F[inward, ::-1]
    return V, F


def with_needles(V, F, share=0.4, at=0.03, seed=0):
    """Split random edges next to one of their ends, at 3 % of their lengths."""
    rng = np.random.default_rng(seed)
    V, F, touched = list(V), F.tolist(), set()
    for (a, b), faces in zoo.edge_faces(np.array(F)).items():
        if len(faces) != 2 or rng.random() > share or touched & set(faces):
            continue
        touched |= set(faces)
        V.append((1 - at) * V[a] + at * V[b])
        for f in faces:
            i = next(i for i in range(3) if {F[f][i], F[f][i - 2]} == {a, b})
            p, q, r = F[f][i], F[f][i - 2], F[f][i - 1]
            F[f] = [p, len(V) - 1, r]
            F.append([len(V) - 1, q, r])
    return np.array(V), np.array(F)


def torus_curvature(V, radius=0.4):
    around = np.hypot(V[:, 0], V[:, 1])
    cosine = (around - 1) / np.hypot(around - 1, V[:, 2])
    return np.maximum(1 / radius, np.abs(cosine / (1 + radius * cosine)))


def ellipsoid_curvature(V, axes):
    """From the Hessian of the implicit function, in the tangent plane."""
    found = []
    for gradient in 2 * V / np.square(axes):
        size = np.linalg.norm(gradient)
        P = np.eye(3) - np.outer(gradient, gradient) / size**2
        found.append(np.abs(np.linalg.eigvalsh(P @ np.diag(2 / np.square(axes)) @ P / size)).max())
    return np.array(found)


def saddle(n=41, width=0.2, noise=0.0):
    """Graph of x^2 - y^2 / 2 over a square: curvatures 2 and -1 in the middle."""
    V, F = zoo.grid(n, n)
    V = (V - [(n - 1) / 2, (n - 1) / 2, 0]) * (2 * width / (n - 1))
    V, F = zoo.upsampled(V, F, 0, noise)
    V[:, 2] = V[:, 0] ** 2 - 0.5 * V[:, 1] ** 2
    return V, F


AXES = np.array([1.0, 0.7, 0.4])
SPHERES = {
    "even": (lambda: zoo.icosphere(4), 0.005, 0.01),
    "uneven": (lambda: zoo.upsampled(*zoo.icosphere(4), 0, 0.25), 0.01, 0.03),
    "random": (lambda: random_sphere(2500), 0.05, 0.2),
    "needles": (lambda: with_needles(*zoo.icosphere(4)), 0.01, 0.05),
    "quads": (lambda: zoo.upsampled(*zoo.cube(), 5, 0.0), 0.02, 0.1),
}


@pytest.mark.parametrize("name", SPHERES)
def test_spheres_however_triangulated(name):
    make, typical, worst = SPHERES[name]
    V, F = make()
    V = unit(V - 0.5 if name == "quads" else V)
    error = curvature(V, F) - 1
    assert rms(error) < typical
    assert np.abs(error).max() < worst


def test_open_surfaces_are_as_good_at_the_rim():
    V, F = zoo.icosphere(4)
    half = (V[F, 2] >= 0).all(axis=1)
    used, F = np.unique(F[half], return_inverse=True)
    assert curvature(V[used], F.reshape(-1, 3)) == pytest.approx(1, abs=0.015)
    assert curvature(*zoo.cylinder(48, 15)) == pytest.approx(1, abs=0.01)
    assert curvature(*zoo.cylinder(48, 2)) == pytest.approx(1, abs=0.02)


def test_a_prism_of_eight_sides_is_a_cylinder():
    assert curvature(*zoo.cylinder(8, 12)) == pytest.approx(1, abs=0.06)


@pytest.mark.parametrize("noise", [0.0, 0.25])
def test_torus(noise):
    V, F = zoo.torus(96, 48)
    V, F = zoo.upsampled(V, F, 0, noise)
    around = np.hypot(V[:, 0], V[:, 1])[:, None]
    ring = V * [1, 1, 0] / around
    V = ring + 0.4 * unit(V - ring)
    assert rms(curvature(V, F) / torus_curvature(V) - 1) < (0.005 if noise == 0 else 0.02)


def test_ellipsoid_converges():
    errors = []
    for n in (3, 4, 5):
        V, F = zoo.icosphere(n)
        V = V * AXES
        errors.append(rms(curvature(V, F) / ellipsoid_curvature(V, AXES) - 1))
    assert errors[2] < 0.01
    assert errors[0] / errors[1] > 2.5 and errors[1] / errors[2] > 2.5


@pytest.mark.parametrize("noise", [0.0, 0.25])
def test_the_larger_of_two_signs(noise):
    V, F = saddle(noise=noise)
    middle = np.linalg.norm(V, axis=1) < 0.05
    for faces in (F, F[:, ::-1]):
        assert curvature(V, faces)[middle] == pytest.approx(2, rel=0.03)
    assert curvature(V * [1, 1, -1], F)[middle] == pytest.approx(2, rel=0.03)


def test_planes_have_none():
    for name in ("grid", "annulus", "planar_delaunay", "sliver_fan", "triangle"):
        assert np.abs(curvature(*zoo.ZOO[name].make())).max() < 1e-12, name


def test_scale_and_motion():
    V, F = zoo.perturb(*zoo.torus(40, 20), 0.05)
    expected = curvature(V, F)
    for factor in (1e-6, 3.0, 1e5):
        assert curvature(V * factor, F) * factor == pytest.approx(expected, rel=1e-6)
    assert curvature(zoo.rotate(V), F) == pytest.approx(expected, rel=1e-6)
    assert curvature(zoo.translate(V, (5, -7, 3)), F) == pytest.approx(expected, rel=1e-6)
    order = np.random.default_rng(0).permutation(len(F))
    assert curvature(V, np.roll(F, 1, axis=1)[order]) == pytest.approx(expected, rel=1e-6)


# --- noise and dirt ------------------------------------------------------------------------------


@pytest.mark.parametrize(("amount", "typical"), [(0.02, 0.05), (0.05, 0.1), (0.1, 0.2)])
def test_noise(amount, typical):
    V, F = zoo.perturb(*zoo.icosphere(4), amount)
    found = curvature(V, F)
    assert rms(found - 1) < typical
    assert np.median(found) == pytest.approx(1, abs=typical)


def test_noise_on_needles():
    """Two vertices at 3 % of an edge from each other, each moved by 5 %: their faces mean nothing."""
    V, F = with_needles(*zoo.icosphere(4))
    noise = 0.05 * zoo.mean_edge(*zoo.icosphere(4)) * np.random.default_rng(1).normal(size=V.shape)
    found = curvature(unit(V) + noise, F)
    assert np.median(found) == pytest.approx(1, abs=0.1)
    assert np.quantile(found, 0.95) < 1.5


@pytest.mark.parametrize("at", [0.0, 1e-12, 1e-6])
def test_faces_without_area(at):
    for name in ("flat_cap", "coincident_vertices"):
        assert np.abs(curvature(*zoo.ZOO[name].make())).max() < 1e-12, name
    V, F = with_needles(*zoo.icosphere(3), at=at)
    T = V[F]
    areas = np.linalg.norm(np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0]), axis=1)
    has_area = np.bincount(F.ravel(), np.repeat(areas, 3)) > 0
    assert has_area.all() == (at > 0) and (areas < 1e-5).sum() > 100
    error = curvature(unit(V), F)[has_area] - 1
    # One pair of vertices in the same two faces, whose other faces have no area, is without curvature.
    assert rms(error) < 0.05 and error.max() < 0.15 and (error < -0.15).sum() <= (at == 0)


@pytest.mark.parametrize("name", zoo.TIDY)
def test_everything_gives_a_number(name):
    for amount in (0.0, 0.3):
        V, F = zoo.perturb(*zoo.ZOO[name].make(), amount)
        mesh = built(V, F)
        for is_feature in (np.zeros(len(mesh.origin), bool), sharp_edges(mesh)):
            found = measured(mesh, is_feature)
            assert np.isfinite(found).all() and (found >= 0).all()


# --- creases -------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 2])
def test_a_marked_cube_is_flat(n):
    mesh = built(*zoo.upsampled(*zoo.cube(), n, 0.0))
    marks = sharp_edges(mesh)
    assert 0 < marks.sum() < len(marks)
    assert np.abs(measured(mesh, marks)).max() < 1e-11
    unmarked = measured(mesh, np.zeros_like(marks))
    assert np.median(unmarked[np.unique(mesh.origin[marks])]) > 1


@pytest.mark.parametrize(("n", "m"), [(48, 20), (48, 2)])
def test_a_capped_cylinder(n, m):
    """1 on the wall and on the rims, which take the larger side, and 0 on the caps."""
    V, F = zoo.closed_cylinder(n, m)
    mesh = built(V, F)
    found = measured(mesh, sharp_edges(mesh))
    assert found[:-2] == pytest.approx(1, abs=0.02)
    assert np.abs(found[-2:]).max() < 1e-12
    assert measured(mesh, np.zeros(len(mesh.origin), bool))[-2:].min() > 0.1


def test_one_side_of_a_crease_knows_nothing_of_the_other():
    V, F = zoo.grid(21, 21)
    V = V / 20
    V[:, 2] = -np.abs(V[:, 0] - 0.5)
    mesh = built(V, F)
    marks = sharp_edges(mesh)
    left, right = V[:, 0] < 0.49, V[:, 0] > 0.51
    before = measured(mesh, marks)
    assert before.max() < 1e-12
    V[right, 2] += 0.3 * np.sin(9 * V[right, 1]) * (V[right, 0] - 0.5)
    after = measured(built(V, F), marks)
    assert np.array_equal(after[left], before[left])
    assert np.median(after[right]) > 0.5
    assert measured(built(V, F), np.zeros_like(marks))[left].max() > 0.5


def test_a_crease_may_end_inside():
    """A slit that is marked on a plane changes nothing; on a sphere little."""
    V, F = zoo.icosphere(3)
    mesh = built(V, F)
    marks = np.zeros(len(mesh.origin), bool)
    h = 0
    for _ in range(6):
        marks[[h, mesh.twin[h]]] = True
        h = int(mesh.twin[h + 2 - 3 * (h % 3 > 0)])
    assert measured(mesh, marks) == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize(
    "name", ["icosphere", "cube", "genus_2", "annulus", "bipyramid", "triangle"]
)
@pytest.mark.parametrize("share", [0.0, 0.2, 0.6, 1.0])
def test_sectors_join_what_no_feature_parts(name, share):
    mesh = built(*zoo.ZOO[name].make())
    m = len(mesh.origin)
    marks = np.random.default_rng(3).random(m) < share
    marks |= np.where(mesh.twin == NONE, False, marks[mesh.twin])
    part, owner = np.empty(m, np.int32), np.empty(len(mesh.X) + marks.sum(), np.int32)
    count = _part_fans(mesh.origin, mesh.twin, mesh.vertex_halfedge, marks, part, owner)
    assert np.array_equal(owner[part], mesh.origin)
    assert np.array_equal(np.unique(part), np.arange(count))
    joined = naive_sectors(mesh, marks)
    for sector in joined:
        assert len(set(part[sorted(sector)])) == 1
    assert len(joined) == count


def naive_sectors(mesh, marks):
    """Corners of a vertex, joined across every edge that is no feature."""
    sector = {h: {h} for h in range(len(mesh.origin))}
    for h in range(len(mesh.origin)):
        if mesh.twin[h] == NONE or marks[h]:
            continue
        after = int(mesh.twin[h]) + (1 if mesh.twin[h] % 3 < 2 else -2)  # leaves the same vertex
        whole = sector[h] | sector[after]
        for corner in whole:
            sector[corner] = whole
    return {frozenset(corners) for corners in sector.values()}


def test_at_corners_it_is_that_of_their_side():
    """A can: its lids are flat, also where they meet the wall."""
    mesh = built(*zoo.closed_cylinder(48, 6))
    is_rim = sharp_edges(mesh, 60.0)
    V, F = mesh.X[:, :3], mesh.origin.reshape(-1, 3)
    on_lid = np.ptp(V[F, 2], axis=1) == 0.0
    arrays = mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge, is_rim
    found = corner_curvature(*arrays).reshape(-1, 3)
    radius = np.hypot(*V[:, :2].T).max()
    assert found[on_lid].max() < 1e-6
    assert found[~on_lid] == pytest.approx(1.0 / radius, rel=0.15)
    largest = np.zeros(len(V))
    np.maximum.at(largest, mesh.origin, found.ravel())
    assert np.array_equal(largest, largest_curvature(*arrays))


def test_a_patch_of_two_flat_faces_has_none():
    """Their means lie on a line, but for rounding: it was divided by next to nothing."""
    t = 2 * np.pi * np.arange(8) / 8
    V, F = prism(np.c_[np.cos(t), np.sin(t)], height=200.0)
    mesh = built(V, F)
    is_feature = sharp_edges(mesh, 40.0)
    found = corner_curvature(mesh.X, mesh.origin, mesh.twin, mesh.vertex_halfedge, is_feature)
    assert found.max() < 1e-6
