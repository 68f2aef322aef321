"""Factor a Laplacian once, solve with many right-hand sides."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from ..core.arguments import choice
from ..core.check import as_array, as_mask, as_numbers, which
from ..core.vocabulary import FloatArray
from ..errors import MeshInputError, OptionError, SingularSystemError
from ..mesh.edges import components

__all__ = ["LaplacianSolver"]

FACTORISATIONS = ("auto", "cholesky", "cholmod", "lu")

# Entries of a matrix and its transpose count as equal below this difference, relative to the largest.
_SYMMETRY = 1e-12

# Below this sum, relative to that of absolute values, a row counts as summing to 0: constants solve it.
_ZERO_SUM = 1e-13

# A factor is useless beyond this residual, relative to |A| |x| + |b|.
_RESIDUAL = 1e-6


class LaplacianSolver:
    """Solver for ``A x = b`` at the free vertices, with ``x`` given at the fixed ones.

    Symmetric matrices get a sparse Cholesky factorisation, others SuperLU's. The Laplacian with uniform
    areas is symmetric; so are powers of Laplacians times areas, and ``M - t C``.

    Parameters
    ----------
    A : (n, n) sparse
        `laplacian`, or any matrix with one row per vertex.
    fixed : (k,) int or (n,) bool, optional
        Vertices with given values.
    method : {"auto", "cholesky", "cholmod", "lu"}
        Factorisation. "cholesky" is Eigen's simplicial one, from libigl, which factors fastest. "cholmod"
        is SuiteSparse's, from the package cholespy (``pip install cholespy``): it takes twice
        as long to factor and 0.4 of the time to solve, so it pays from about 15 solves on. "lu" is
        SuperLU, from SciPy. "auto" is "cholesky" where the part of A between free vertices is symmetric
        with diagonal entries of one sign, else "lu".

    Attributes
    ----------
    method : str
        "cholesky", "cholmod" or "lu".
    n_free : int
        Number of unknowns.

    Raises
    ------
    SingularSystemError
        A part of the mesh has no fixed vertex, and constants solve its equations; this is found before
        factoring. Or factoring fails, because the matrix is not definite.
    MeshInputError
        A is not a square matrix of finite real numbers.
    OptionError
        An index is out of range, or the method is unknown or does not suit A.
    """

    def __init__(
        self,
        A: Any,
        fixed: ArrayLike | None = None,
        method: Literal["auto", "cholesky", "cholmod", "lu"] = "auto",
    ) -> None:
        choice(method, "method", FACTORISATIONS)
        matrix = _as_matrix(A)
        n = matrix.shape[0]
        is_fixed = np.zeros(n, np.bool_)
        if fixed is not None:
            is_fixed = as_mask(fixed, n, "fixed", "vertex")
        self.fixed = np.flatnonzero(is_fixed)
        self.free = np.flatnonzero(~is_fixed)
        self.n_free = len(self.free)
        rows = matrix.tocsr()[self.free]
        self._inner = sp.csc_array(rows[:, self.free])
        self._across = sp.csr_array(rows[:, self.fixed])
        _check_parts(self._inner, self._across, self.free)
        self.method = _choose(self._inner, method)
        self._solve = _factorise(self._inner, self.method)
        self._check_factor()

    def solve(self, b: ArrayLike | None = None, x_fixed: ArrayLike | None = None) -> FloatArray:
        """Solve for one or several right-hand sides.

        Parameters
        ----------
        b : (n,) or (n, c) float, optional
            Right-hand sides; only the rows of free vertices are used. 0 by default.
        x_fixed : (k,) or (k, c) float, optional
            Values at the fixed vertices, in the order of their indices; 0 by default.

        Returns
        -------
        (n,) or (n, c) float64
            With as many columns as the right-hand sides or the fixed values.

        Raises
        ------
        OptionError
            A shape does not fit, or a number is not finite.
        """
        n = self.n_free + len(self.fixed)
        k = len(self.fixed)
        right = None if b is None else as_numbers(b, "b", (n,), (n, "c"))
        given = None if x_fixed is None else as_numbers(x_fixed, "x_fixed", (k,), (k, "c"))
        shapes = {part.shape[1:] for part in (right, given) if part is not None} or {()}
        if len(shapes) > 1:
            raise OptionError(f"b and x_fixed differ in their columns: {sorted(shapes)}")
        x = np.zeros((n, *shapes.pop()))
        wanted = np.zeros((self.n_free, *x.shape[1:]))
        if right is not None:
            wanted += right[self.free]
        if given is not None:
            x[self.fixed] = given
            wanted -= self._across @ given
        if self.n_free:
            x[self.free] = self._solve(wanted)
        return x

    def _check_factor(self) -> None:
        """Solve once, to detect nearly singular or indefinite matrices, which give wrong results."""
        if not self.n_free:
            return
        b = np.random.default_rng(0).normal(size=self.n_free)
        with np.errstate(all="ignore"):
            x = self._solve(b)
            scale = float(abs(self._inner).sum(axis=1).max()) * np.abs(x).max() + np.abs(b).max()
            is_good = np.abs(self._inner @ x - b).max() <= _RESIDUAL * scale
            is_good = is_good and np.abs(x).max() < 1e15 * np.abs(b).max() / abs(self._inner).max()
        if not is_good:
            raise SingularSystemError(
                "the matrix is singular, or nearly so, between the free vertices; fix more vertices, "
                "remesh faces of bad shape, or take a smaller order"
            )


def _as_matrix(A: Any) -> sp.csc_array:
    given = A if sp.issparse(A) else as_array(A, "A")
    if given.ndim != 2 or given.shape[0] != given.shape[1]:
        raise MeshInputError(f"A must be square, one row per vertex; got shape {given.shape}")
    if given.dtype.kind not in "fiu":
        raise MeshInputError(f"A must hold real numbers; got dtype {given.dtype}")
    matrix = sp.csc_array(given, dtype=np.float64)
    if not np.isfinite(matrix.data).all():
        bad = np.unique(matrix.tocoo().row[~np.isfinite(matrix.tocoo().data)])
        raise MeshInputError(f"{which(bad, 'row')} of A are NaN or infinite")
    return matrix


def _check_parts(inner: sp.csc_array, across: sp.csr_array, free: NDArray[np.intp]) -> None:
    """Refuse parts whose equations constants solve and that are not coupled to a fixed vertex."""
    if not len(free):
        return
    size = np.asarray(abs(inner).sum(axis=1) + abs(across).sum(axis=1))
    with np.errstate(invalid="ignore"):
        is_held = np.abs(inner.sum(axis=1)) > _ZERO_SUM * size
    entries = inner.tocoo()
    count, part = components(len(free), entries.row, entries.col)
    held = np.zeros(count, np.bool_)
    held[part[is_held]] = True
    if held.all():
        return
    first = free[np.unique(part, return_index=True)[1][~held]]
    what = "nothing is fixed" if not across.shape[1] else f"{(~held).sum()} parts of the mesh"
    raise SingularSystemError(
        f"{what}: solutions are known only up to a constant around {which(np.sort(first), 'vertex')}; "
        "fix at least one vertex of each part"
    )


def _choose(inner: sp.csc_array, method: str) -> str:
    if method == "lu" or not inner.shape[0]:
        return method if method != "auto" else "cholesky"
    largest = abs(inner).max()
    diagonal = inner.diagonal()
    is_definite = bool((diagonal > 0.0).all() or (diagonal < 0.0).all())
    suits = is_definite and abs(inner - inner.T).max() <= _SYMMETRY * largest
    if method == "auto":
        return "cholesky" if suits else "lu"
    if not suits:
        raise OptionError(
            f"method={method!r} needs a symmetric matrix with diagonal entries of one sign; "
            'use laplacian(V, F, area="uniform"), or method="lu"'
        )
    return method


def _factorise(inner: sp.csc_array, method: str) -> Callable[[FloatArray], FloatArray]:
    """Factor; returns a function that solves."""
    if not inner.shape[0]:
        return np.copy
    factor = {"lu": _with_lu, "cholesky": _factor_with_libigl, "cholmod": _with_cholmod}[method]
    return factor(inner)


def _with_lu(inner: sp.csc_array) -> Callable[[FloatArray], FloatArray]:
    from scipy.sparse.linalg import splu

    try:
        return splu(inner).solve
    except RuntimeError as error:
        raise SingularSystemError(f"SuperLU cannot factor the matrix: {error}") from error


def _factor_with_libigl(inner: sp.csc_array) -> Callable[[FloatArray], FloatArray]:
    import igl

    sign = _sign(inner)
    data = igl.min_quad_with_fixed_data()
    nothing = np.empty(0, np.int64)
    constraints = sp.csc_matrix((0, inner.shape[0]))
    try:
        igl.min_quad_with_fixed_precompute(
            sp.csc_matrix(sign * inner), nothing, constraints, True, data
        )
    except (RuntimeError, ValueError) as error:
        raise SingularSystemError(f"the matrix is not definite: {error}") from error

    def solve(b: FloatArray) -> FloatArray:
        columns = np.ascontiguousarray(-sign * b.reshape(len(b), -1))
        none = np.empty((0, columns.shape[1]))
        x = igl.min_quad_with_fixed_solve(data, columns, none, none)
        return np.asarray(x).reshape(b.shape)

    return solve


def _with_cholmod(inner: sp.csc_array) -> Callable[[FloatArray], FloatArray]:
    try:
        from cholespy import CholeskySolverD, MatrixType
    except ImportError as error:
        raise OptionError("method='cholmod' needs cholespy: pip install cholespy") from error
    sign = _sign(inner)
    A = sp.csc_array(sign * inner)
    A.sort_indices()
    indptr, indices = A.indptr.astype(np.int32), A.indices.astype(np.int32)
    try:
        solver = CholeskySolverD(A.shape[0], indptr, indices, A.data, MatrixType.CSC)
    except (RuntimeError, ValueError) as error:
        raise SingularSystemError(f"the matrix is not definite: {error}") from error

    def solve(b: FloatArray) -> FloatArray:
        columns = np.ascontiguousarray(sign * b.reshape(len(b), -1))
        x = np.empty_like(columns)
        solver.solve(columns, x)
        return x.reshape(b.shape)

    return solve


def _sign(inner: sp.csc_array) -> float:
    """Return the sign that makes a definite matrix positive."""
    return 1.0 if inner.diagonal().max() > 0.0 else -1.0
