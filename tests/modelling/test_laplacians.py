"""Laplacians: libigl's entries, symmetry, exactness on flat parts, spheres' eigenvalues, errors."""

from itertools import pairwise

import igl
import numpy as np
import pytest
import scipy.sparse as sp
from helpers import zoo
from scipy.sparse.linalg import eigsh

from remeshvec import MeshInputError, OptionError, cotangent_matrix, laplacian, remesh, vertex_areas

MESHES = {
    "noisy torus": lambda: zoo.upsampled(*zoo.torus(24, 12), noise=0.3),
    "open": lambda: zoo.upsampled(*zoo.annulus(24, 5), noise=0.3),
    "moebius": lambda: zoo.moebius(30, 6),
}


@pytest.fixture(params=MESHES)
def mesh(request):
    V, F = MESHES[request.param]()
    return np.asarray(V, float), np.asarray(F, np.int64)


def largest(A):
    return float(abs(A).max())


def test_entries_are_those_of_libigl(mesh):
    V, F = mesh
    C, M = igl.cotmatrix(V, F), igl.massmatrix(V, F, igl.MASSMATRIX_TYPE_VORONOI)
    assert largest(cotangent_matrix(V, F) - C) <= 1e-14 * largest(C)
    expected = sp.diags_array(1 / M.diagonal()) @ C
    assert largest(laplacian(V, F) - expected) <= 1e-14 * largest(expected)
    assert vertex_areas(V, F) == pytest.approx(M.diagonal(), rel=1e-15)
    mean = M.diagonal().mean()
    assert largest(laplacian(V, F, "uniform") - C / mean) <= 1e-13 * largest(C / mean)
    assert vertex_areas(V, F, "uniform") == pytest.approx(np.full(len(V), mean), rel=1e-13)
    assert np.asarray(laplacian(V, F).sum(axis=1)) == pytest.approx(0, abs=1e-9 * largest(expected))


def test_symmetry(mesh):
    for A in (
        cotangent_matrix(*mesh),
        laplacian(*mesh, "uniform"),
        laplacian(*mesh, symmetric=True),
        laplacian(*mesh, "uniform", symmetric=True),
    ):
        assert largest(A - A.T) <= 1e-14 * largest(A)
    A = laplacian(*mesh)
    assert largest(A - A.T) > 0.05 * largest(A)


def test_the_symmetric_form_has_the_same_eigenvalues(mesh):
    plain = np.linalg.eigvals(laplacian(*mesh).toarray())
    symmetric = np.linalg.eigvalsh(laplacian(*mesh, symmetric=True).toarray())
    assert np.sort(plain.real) == pytest.approx(np.sort(symmetric), abs=1e-8 * largest(plain))
    assert symmetric.max() < 1e-10 * -symmetric.min()


def test_flat_parts_are_exact():
    V, F = zoo.upsampled(*zoo.grid(9, 9), n=1, noise=0.0)
    V = V[:, :3] * [2.0, 2.0, 0.0] + np.random.default_rng(0).normal(size=3)
    inner = np.setdiff1d(np.arange(len(V)), igl.boundary_facets(F)[0])
    A = laplacian(V, F)
    assert (A @ V)[inner] == pytest.approx(0, abs=1e-9)
    uneven = V.copy()
    uneven[inner, :2] += np.random.default_rng(1).uniform(-0.02, 0.02, (len(inner), 2))
    assert (laplacian(uneven, F) @ uneven)[inner] == pytest.approx(0, abs=1e-9)
    assert (A @ (V[:, 0] ** 2))[inner] == pytest.approx(2, abs=1e-8)  # its sign


def test_spheres_are_bent_inwards():
    V, F = zoo.icosphere(4)
    V = 2.0 * V / np.linalg.norm(V, axis=1)[:, None]
    # -2 H n, with mean curvature 1 / R
    assert laplacian(V, F) @ V == pytest.approx(-2 * V / 4, abs=0.02)


def eigenvalues(V, F, area, count):
    C, M = cotangent_matrix(V, F), sp.diags_array(vertex_areas(V, F, area))
    found = eigsh(
        sp.csc_matrix(-C), count, sp.csc_matrix(M), sigma=-0.1, return_eigenvectors=False,
        v0=np.ones(len(V)),
    )  # fmt: skip
    return np.sort(found)[1:]


def test_eigenvalues_of_a_remeshed_sphere_converge():
    """To l (l + 1), (2 l + 1) times, by the square of the edge length."""
    V, F = zoo.icosphere(6)
    V /= np.linalg.norm(V, axis=1)[:, None]
    degree = np.repeat(np.arange(1, 5), 2 * np.arange(1, 5) + 1)
    exact = degree * (degree + 1)
    errors, uniform = [], []
    for L in (0.24, 0.12, 0.06):
        W, G = remesh(V, F, L)
        found = eigenvalues(W, G, "voronoi", 1 + len(exact))
        errors.append(np.abs(found / exact - 1)[3:].max())
        uniform.append(np.abs(eigenvalues(W, G, "uniform", 1 + len(exact)) / exact - 1)[3:].max())
    assert errors[-1] < 0.005
    for coarse, fine in pairwise(errors):
        assert 3.3 < coarse / fine < 5.0
    assert uniform[-1] < 0.02


def test_remeshing_makes_uniform_areas_good():
    V, F = zoo.upsampled(*zoo.icosphere(3), noise=0.0)
    V /= np.linalg.norm(V, axis=1)[:, None]
    squeezed = V + 0.6 * np.array([1.0, 0, 0])  # vertices crowd on one side
    squeezed /= np.linalg.norm(squeezed, axis=1)[:, None]
    exact = np.repeat([2, 6], [3, 5])

    def error(W, G):
        return np.abs(eigenvalues(W, G, "uniform", 9) / exact - 1).max()

    before, after = error(squeezed, F), error(*remesh(squeezed, F, 0.12))
    assert before > 0.1 and after < 0.02


def test_vertices_without_faces_have_empty_rows():
    V, F = zoo.torus(12, 6)
    W = np.vstack([V, [[7.0, 7, 7]]])
    for area in ("voronoi", "uniform"):
        A = laplacian(W, F, area)
        assert A.shape == (len(W), len(W)) and abs(A).sum(axis=1)[-1] == 0
        assert largest(A[: len(V), : len(V)] - laplacian(V, F, area)) < 1e-10
        assert vertex_areas(W, F, area)[-1] == 0
        assert vertex_areas(W, F, area).sum() == pytest.approx(zoo.area(V, F))


def test_bad_input():
    V, F = zoo.torus(12, 6)
    with pytest.raises(OptionError, match="voronoi, uniform"):
        laplacian(V, F, "mean")
    bad = V.copy()
    bad[F[7]] = bad[F[7, 0]]
    with pytest.raises(MeshInputError, match=r"face.* of F have no area"):
        laplacian(bad, F)
    with pytest.raises(MeshInputError, match="NaN"):
        cotangent_matrix(np.full_like(V, np.nan), F)
    with pytest.raises(MeshInputError):
        vertex_areas(V, F + 1)
