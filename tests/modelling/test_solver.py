"""The solver: solutions, which factorisation, and errors before factoring."""

import sys
from importlib.util import find_spec

import numpy as np
import pytest
import scipy.sparse as sp
from helpers import zoo

from remeshvec import (
    LaplacianSolver,
    MeshInputError,
    OptionError,
    SingularSystemError,
    cotangent_matrix,
    laplacian,
    vertex_areas,
)

needs_cholespy = pytest.mark.skipif(not find_spec("cholespy"), reason="cholespy is not installed")


@pytest.fixture(scope="module")
def mesh():
    V, F = zoo.upsampled(*zoo.torus(24, 12), noise=0.3)
    return V, np.asarray(F, np.int64)


def residual(A, x, b, free):
    A = sp.csr_array(A)
    return np.abs((A @ x - b)[free]).max() / abs(A).max()


@pytest.mark.parametrize("columns", [(), (1,), (3,)])
@pytest.mark.parametrize(
    ("area", "method", "expected"),
    [
        ("uniform", "auto", "cholesky"),
        ("uniform", "lu", "lu"),
        ("uniform", "cholesky", "cholesky"),
        pytest.param("uniform", "cholmod", "cholmod", marks=needs_cholespy),
        ("voronoi", "auto", "lu"),
    ],
)
def test_solutions(mesh, area, method, expected, columns):
    A = laplacian(*mesh, area)
    n = A.shape[0]
    rng = np.random.default_rng(0)
    fixed = np.sort(rng.choice(n, 9, replace=False))
    free = np.setdiff1d(np.arange(n), fixed)
    solver = LaplacianSolver(A, fixed, method)
    assert solver.method == expected and solver.n_free == len(free)
    assert np.array_equal(solver.fixed, fixed) and np.array_equal(solver.free, free)
    b, given = rng.normal(size=(n, *columns)), rng.normal(size=(9, *columns))
    before = b.copy(), given.copy(), A.copy()
    for right, values in ((b, given), (b, None), (None, given)):
        x = solver.solve(right, values)
        wanted = np.zeros_like(b) if right is None else b
        assert x.shape == b.shape
        assert residual(A, x, wanted, free) < 1e-10
        assert np.array_equal(x[fixed], np.zeros_like(given) if values is None else given)
    assert np.array_equal(b, before[0]) and np.array_equal(given, before[1])
    assert abs(A - before[2]).max() == 0


def test_both_factorisations_agree(mesh):
    A = laplacian(*mesh, "uniform")
    b = np.random.default_rng(0).normal(size=A.shape[0])
    one, two = (LaplacianSolver(A, [5], method).solve(b) for method in ("cholesky", "lu"))
    assert one == pytest.approx(two, rel=1e-9, abs=1e-9)


def test_shifted_matrices_need_nothing_fixed(mesh):
    A = sp.diags_array(vertex_areas(*mesh)) - 0.1 * cotangent_matrix(*mesh)
    solver = LaplacianSolver(A)
    assert solver.method == "cholesky" and solver.fixed.size == 0
    b = np.random.default_rng(0).normal(size=A.shape[0])
    assert residual(A, solver.solve(b), b, slice(None)) < 1e-12
    assert np.array_equal(solver.solve(), np.zeros(len(b)))


def test_everything_may_be_fixed(mesh):
    A = laplacian(*mesh, "uniform")
    values = np.random.default_rng(0).normal(size=(A.shape[0], 2))
    solver = LaplacianSolver(A, np.ones(A.shape[0], bool))
    assert np.array_equal(solver.solve(None, values), values)


def test_nothing_fixed_is_an_error_before_factoring(mesh, monkeypatch):
    def never(*_):
        raise AssertionError("factored")

    monkeypatch.setattr("remeshvec.modelling.solver._factorise", never)
    for area in ("uniform", "voronoi"):
        with pytest.raises(SingularSystemError, match=r"nothing is fixed.*fix at least one"):
            LaplacianSolver(laplacian(*mesh, area))


def test_parts_without_fixed_vertices_are_named():
    one = zoo.torus(12, 6)
    V, F = zoo.joined(one, one, shift=5.0)
    n = len(one[0])
    A = laplacian(V, F, "uniform")
    with pytest.raises(SingularSystemError, match=rf"1 parts.*\({n}\)"):
        LaplacianSolver(A, [3])
    assert LaplacianSolver(A, [3, n + 3]).n_free == 2 * n - 2
    W = np.vstack([V, [[9.0, 9, 9]]])
    with pytest.raises(SingularSystemError, match=rf"\({2 * n}\)"):
        LaplacianSolver(laplacian(W, F, "uniform"), [3, n + 3])


def test_singular_matrices_that_constants_do_not_solve(mesh):
    with pytest.raises(SingularSystemError, match=r"singular|definite"):
        LaplacianSolver(laplacian(*mesh, symmetric=True))


@needs_cholespy
def test_cholmod_says_what_is_wrong(mesh):
    A = laplacian(*mesh, "uniform")
    b = np.random.default_rng(0).normal(size=(A.shape[0], 200))
    one, two = (LaplacianSolver(A, [5], method).solve(b) for method in ("cholesky", "cholmod"))
    assert one == pytest.approx(two, rel=1e-9, abs=1e-9)
    with pytest.raises(OptionError, match="symmetric"):
        LaplacianSolver(laplacian(*mesh), [0], "cholmod")
    with pytest.raises(SingularSystemError):
        LaplacianSolver(laplacian(*mesh, symmetric=True), None, "cholmod")
    coupled = sp.coo_array(([1e3, 1e3], ([0, 1], [1, 0])), A.shape)
    indefinite = coupled - cotangent_matrix(*mesh) + 0.1 * sp.eye_array(A.shape[0])
    with pytest.raises(SingularSystemError):
        LaplacianSolver(indefinite, None, "cholmod")
    with pytest.raises(SingularSystemError):
        LaplacianSolver(indefinite, None, "cholesky")


def test_cholmod_may_be_absent(mesh, monkeypatch):
    monkeypatch.setitem(sys.modules, "cholespy", None)
    with pytest.raises(OptionError, match="pip install cholespy"):
        LaplacianSolver(laplacian(*mesh, "uniform"), [0], "cholmod")


def test_bad_input(mesh):
    A = laplacian(*mesh, "uniform")
    n = A.shape[0]
    with pytest.raises(MeshInputError, match="square"):
        LaplacianSolver(A[:, :-1], [0])
    broken = A.copy()
    broken.data[3] = np.nan
    with pytest.raises(MeshInputError, match="NaN"):
        LaplacianSolver(broken, [0])
    with pytest.raises(OptionError, match="fixed"):
        LaplacianSolver(A, [n])
    with pytest.raises(OptionError, match="auto, cholesky, cholmod, lu"):
        LaplacianSolver(A, [0], "qr")
    with pytest.raises(OptionError, match="symmetric"):
        LaplacianSolver(laplacian(*mesh), [0], "cholesky")
    solver = LaplacianSolver(A, [0, 1])
    for b, given in (
        (np.zeros(n - 1), None),
        (None, np.zeros(3)),
        (np.zeros(n), np.zeros((2, 3))),
        (np.full(n, np.nan), None),
        (np.zeros((n, 1, 1)), None),
        (np.zeros(n, complex), None),
    ):
        with pytest.raises(OptionError):
            solver.solve(b, given)
