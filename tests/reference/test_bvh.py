"""The tree over the input: the closest face, against libigl and against looking at every face."""

import igl
import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import built, faces_of, referenced, tree_of

from remeshvec.core.compiler import kernel
from remeshvec.core.geometry import point
from remeshvec.core.vocabulary import NONE
from remeshvec.reference.bvh import STACK, closest_face, closest_faces, search_face

RNG = np.random.default_rng(11)


@kernel
def query(tree, P, hints, trust, faces, weights, squared):
    stack = np.empty((2, STACK), np.int64)
    for i in range(len(P)):
        f, s, t, d = closest_face(tree, point(P, i), hints[i], trust, stack)
        faces[i], weights[i, 0], weights[i, 1], squared[i] = f, s, t, d


def closest(mesh, P, hints=None, trust=0.0):
    """Faces, points and distances."""
    F = mesh.origin.reshape(-1, 3)
    faces, weights, squared = np.empty(len(P), int), np.empty((len(P), 2)), np.empty(len(P))
    if hints is None:
        hints = RNG.integers(len(F), size=len(P))
    query(tree_of(mesh), P, np.asarray(hints, np.int64), trust, faces, weights, squared)
    assert weights.min() >= -1e-12 and weights.sum(axis=1).max() <= 1 + 1e-12
    a, b, c = np.moveaxis(mesh.X[F[faces], :3], 1, 0)
    s, t = weights[:, :1], weights[:, 1:]
    return faces, a + s * (b - a) + t * (c - a), np.sqrt(squared)


def truth(mesh, P, faces=slice(None)):
    """Distances and points by libigl."""
    V, F = mesh.X[:, :3].copy(), faces_of(mesh)[faces].astype(np.int64)
    squared, _, points = igl.point_mesh_squared_distance(P, V, F)
    return np.sqrt(squared), points


NAMES = [
    "triangle",
    "square",
    "tetrahedron",
    "torus",
    "genus_3",
    "thin_sheet",
    "bipyramid",
    "bowtie",
]


@pytest.mark.parametrize("name", NAMES)
def test_distance_agrees_with_libigl(name):
    mesh = built(*zoo.ZOO[name].make(), ordered=True)
    size = np.ptp(mesh.X[:, :3], axis=0).max()
    P = mesh.X[:, :3].mean(axis=0) + size * RNG.normal(size=(400, 3))
    _, points, distance = closest(mesh, P)
    expected, places = truth(mesh, P)
    assert distance == pytest.approx(expected, rel=1e-9)
    assert np.linalg.norm(P - points, axis=1) == pytest.approx(distance, rel=1e-9)
    near = np.linalg.norm(points - places, axis=1) < 1e-7 * size
    assert near.mean() > 0.9  # the others are as near to two places


@pytest.mark.parametrize("seed", range(3))
def test_on_the_surface_and_near_it(seed):
    mesh = built(*zoo.perturb(*zoo.icosphere(3), amount=0.1, seed=seed), ordered=True)
    F = faces_of(mesh)
    corners = RNG.dirichlet((1, 1, 1), size=len(F))
    P = np.einsum("fc,fcx->fx", corners, mesh.X[F, :3])
    assert closest(mesh, P)[2].max() < 1e-13
    P += 1e-3 * RNG.normal(size=P.shape)
    assert closest(mesh, P)[2] == pytest.approx(truth(mesh, P)[0], rel=1e-7, abs=1e-13)


def test_faces_without_area():
    """One face squeezed to a line, one to a point; the rest by looking at every face."""
    V, F = zoo.torus(9, 6)
    V[F[0, 2]] = (V[F[0, 0]] + V[F[0, 1]]) / 2
    V[F[50, 1]] = V[F[50, 2]] = V[F[50, 0]]
    mesh = built(V, F, ordered=True)
    P = RNG.normal(size=(100, 3))
    expected = [naive.distance_to_mesh(p, mesh.X[:, :3], faces_of(mesh)) for p in P]
    assert closest(mesh, P)[2] == pytest.approx(expected)


def test_the_distance_does_not_depend_on_the_hint():
    mesh = built(*zoo.genus_2(), ordered=True)
    P = RNG.normal(scale=2, size=(50, 3))
    hints = range(0, len(faces_of(mesh)), 7)
    distances = [closest(mesh, P, np.full(len(P), hint))[2] for hint in hints]
    assert all(distance == pytest.approx(distances[0], rel=1e-13) for distance in distances)


@pytest.mark.parametrize("count", [1, 2, 4, 5, 16, 17, 64, 65, 257])
def test_every_size_of_tree(count):
    """A soup of separate triangles: walks end where they start, the search does it all."""
    mesh = built(RNG.random((3 * count, 3)), np.arange(3 * count).reshape(-1, 3), ordered=True)
    tree = tree_of(mesh)
    assert tree.level[-1] == len(tree.boxes) and tree.level[-1] - tree.level[-2] == 1
    whole = np.r_[mesh.X[:, :3].min(axis=0), mesh.X[:, :3].max(axis=0)]
    assert np.array_equal(tree.boxes[-1], whole)
    P = RNG.normal(size=(30, 3))
    assert closest(mesh, P)[2] == pytest.approx(truth(mesh, P)[0])


@pytest.mark.parametrize("name", ["torus", "planar_delaunay", "cylinder", "genus_3", "sliver_fan"])
def test_a_walk_ends_no_farther_than_it_starts(name):
    mesh = built(*zoo.ZOO[name].make(), ordered=True)
    size = np.ptp(mesh.X[:, :3], axis=0).max()
    P = mesh.X[:, :3].mean(axis=0) + size * RNG.normal(size=(200, 3))
    hints = RNG.integers(len(faces_of(mesh)), size=len(P))
    _, points, walked = closest(mesh, P, hints, trust=np.inf)
    corners = mesh.X[faces_of(mesh)[hints], :3]
    start = [naive.closest_on_triangle(p, *T)[1] for p, T in zip(P, corners, strict=True)]
    assert (walked <= np.array(start) * (1 + 1e-12)).all()
    assert (walked >= truth(mesh, P)[0] * (1 - 1e-12)).all()
    assert np.linalg.norm(P - points, axis=1) == pytest.approx(walked, rel=1e-9)


def test_a_walk_finds_the_closest_face_of_a_convex_surface():
    mesh = built(*zoo.icosphere(3), ordered=True)
    P = RNG.normal(size=(300, 3))
    P *= 1.3 / np.linalg.norm(P, axis=1, keepdims=True)
    distance = truth(mesh, P)[0]
    near = np.linalg.norm(mesh.X[faces_of(mesh), :3].mean(axis=1) - P[:, None], axis=2)
    hints = np.argsort(near, axis=1)[:, 20]  # a few faces away
    found = closest(mesh, P, hints, trust=np.inf)[2]
    assert found == pytest.approx(distance, rel=1e-9)


def test_parallel_is_the_same():
    mesh = built(*zoo.icosphere(3), ordered=True)
    for one, two in zip(tree_of(mesh), tree_of(mesh, True), strict=True):
        assert one.tobytes() == two.tobytes()


# --- patches -------------------------------------------------------------------------------------


def near(mesh, count=200, scale=0.7):
    """Points around a mesh."""
    size = np.ptp(mesh.X[:, :3], axis=0).max()
    return mesh.X[:, :3].mean(axis=0) + scale * size * RNG.normal(size=(count, 3))


@pytest.mark.parametrize("name", ["cube", "genus_2", "closed_cylinder", "two_components"])
def test_search_and_walk_stay_in_the_patch_of_the_hint(name):
    mesh = built(*zoo.upsampled(*zoo.ZOO[name].make(), n=1, noise=0.0), ordered=True)
    tree = referenced(mesh, 1.0, feature_angle=40.0).tree
    assert tree.patch.max() > 0
    P = near(mesh)
    hints = RNG.integers(len(tree.patch), size=len(P))
    for trust in (0.0, np.inf):
        faces, weights, squared = np.empty(len(P), int), np.empty((len(P), 2)), np.empty(len(P))
        query(tree, P, hints, trust, faces, weights, squared)
        assert np.array_equal(tree.patch[faces], tree.patch[hints])
        for k in range(tree.patch.max() + 1):
            mine = tree.patch[hints] == k
            expected = truth(mesh, P[mine], tree.patch == k)[0]
            assert (np.sqrt(squared[mine]) >= expected * (1 - 1e-9)).all()
            if trust == 0.0:
                assert np.sqrt(squared[mine]) == pytest.approx(expected, rel=1e-9)


@kernel
def search(tree, P, start, N, faces, squared):
    stack = np.empty((2, STACK), np.int64)
    for i in range(len(P)):
        faces[i], _, _, squared[i] = search_face(tree, point(P, i), start[i], point(N, i), stack)


@pytest.mark.parametrize("name", ["torus", "thin_sheet", "genus_3", "bipyramid"])
def test_a_search_with_a_normal_skips_faces_that_look_away(name):
    """All but the one where it starts, which may look anywhere."""
    mesh = built(*zoo.ZOO[name].make(), ordered=True)
    V, F = mesh.X[:, :3], faces_of(mesh)
    P, N = near(mesh, 150), RNG.normal(size=(150, 3))
    start = RNG.integers(len(F), size=len(P))
    faces, squared = np.empty(len(P), int), np.empty(len(P))
    search(tree_of(mesh), P, start, N, faces, squared)
    vectors = np.array([naive.normal(V, f) for f in F])
    for i, (p, n) in enumerate(zip(P, N, strict=True)):
        allowed = vectors @ n >= 0
        allowed[start[i]] = True
        assert allowed[faces[i]]
        expected = truth(mesh, P[i : i + 1], allowed)[0]
        assert np.sqrt(squared[i]) == pytest.approx(expected[0], rel=1e-9), p


def test_a_search_without_a_normal_sees_all():
    mesh = built(*zoo.torus(), ordered=True)
    P = near(mesh)
    faces, squared = np.empty(len(P), int), np.empty(len(P))
    search(tree_of(mesh), P, np.zeros(len(P), np.int64), np.zeros((len(P), 3)), faces, squared)
    assert np.sqrt(squared) == pytest.approx(truth(mesh, P)[0], rel=1e-9)


# --- many points ---------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 255, 256, 257, 1500])
@pytest.mark.parametrize("hinted", [False, True])
def test_many_points(count, hinted):
    mesh = built(*zoo.genus_3(), ordered=True)
    P = near(mesh, count)
    hint = np.full(count, NONE, np.int32)
    if hinted:
        hint = RNG.integers(len(faces_of(mesh)), size=count).astype(np.int32)
    faces, distance = closest_faces(tree_of(mesh), P, hint, 0.0, False)
    assert faces.dtype == np.int32 and faces.shape == distance.shape == (count,)
    assert distance == pytest.approx(truth(mesh, P)[0], rel=1e-9)
    corners = mesh.X[faces_of(mesh)[faces], :3]
    there = [naive.closest_on_triangle(p, *T)[1] for p, T in zip(P, corners, strict=True)]
    assert distance == pytest.approx(there, rel=1e-9)
    for one, two in zip(
        (faces, distance), closest_faces(tree_of(mesh), P, hint, 0.0, True), strict=True
    ):
        assert one.tobytes() == two.tobytes()


def test_many_points_within_trust_are_not_searched():
    """An upper bound within the trust, else exact."""
    mesh = built(*zoo.upsampled(*zoo.thin_sheet(8, 0.3), n=0, noise=0.2), ordered=True)
    P = near(mesh, 400, 0.3)
    hint = RNG.integers(len(faces_of(mesh)), size=len(P)).astype(np.int32)
    _, distance = closest_faces(tree_of(mesh), P, hint, 1.0, False)
    expected = truth(mesh, P)[0]
    assert (distance >= expected * (1 - 1e-9)).all()
    far = distance > 1.0
    assert far.any() and distance[far] == pytest.approx(expected[far], rel=1e-9)


def test_many_points_stay_in_the_patch_of_their_hint():
    mesh = built(*zoo.upsampled(*zoo.cube(), n=2, noise=0.0), ordered=True)
    tree = referenced(mesh, 1.0, feature_angle=40.0).tree
    P = near(mesh)
    hint = RNG.integers(len(tree.patch), size=len(P)).astype(np.int32)
    faces, distance = closest_faces(tree, P, hint, 0.0, False)
    assert np.array_equal(tree.patch[faces], tree.patch[hint])
    for k in range(6):
        mine = tree.patch[hint] == k
        assert distance[mine] == pytest.approx(truth(mesh, P[mine], tree.patch == k)[0], rel=1e-9)
