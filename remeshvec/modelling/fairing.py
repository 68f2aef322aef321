"""Fair surfaces: ``Delta^k x = 0`` in a region that joins its surroundings with continuity C^(k-1)."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from ..core.arguments import choice, count
from ..core.check import as_mask, as_mesh, which
from ..core.vocabulary import BoolArray, FloatArray, IntArray
from ..errors import OptionError
from ..mesh.edges import used_vertices
from .laplacians import AREAS, Area, cotangent_matrix, polyharmonic_matrix, vertex_areas
from .solver import LaplacianSolver

__all__ = ["HIGHEST_ORDER", "Polyharmonic", "fair"]

HIGHEST_ORDER = 3  # of the Laplacian: 1 membrane, 2 thin plate, 3 minimal variation of curvature


def fair(
    V: ArrayLike,
    F: ArrayLike,
    region: ArrayLike,
    k: int = 2,
    *,
    area: Area = "voronoi",
    iterations: int = 1,
) -> FloatArray:
    """Replace a region by the smoothest surface that joins its surroundings.

    Solves ``Delta^k x = 0`` for the vertices of the region, with the k rings around it fixed [Botsch
    and Kobbelt 2004, An intuitive framework for real-time freeform modeling, section 3; Kobbelt et al.
    1998]: a membrane (k = 1, joins with C0), a thin plate (2, C1), or the surface of minimal variation
    of curvature (3, C2).

    Parameters
    ----------
    V : (n, 3) float
    F : (m, 3) int
    region : (r,) int or (n,) bool
        Vertices that move. Within k rings of a boundary of the mesh, the natural conditions of the energy
        replace the missing rings.
    k : {1, 2, 3}
        Order.
    area : {"voronoi", "uniform"}
        See `vertex_areas`.
    iterations : int
        Number of solves. The first has the Laplacian of ``V``, each later one that of the surface before
        it. With k = 1 they lead to a minimal surface [Pinkall and Polthier 1993].

    Returns
    -------
    (n, 3) float64
        Vertices; outside the region they are those of ``V``, bit for bit.

    Raises
    ------
    MeshInputError
        V and F are not a mesh, or faces in the region have no area.
    OptionError
        The region has an index out of range, or an order, an area or a number is not allowed.
    SingularSystemError
        The region holds a whole component of the mesh.
    """
    vertices, faces = as_mesh(V, F)
    free = as_mask(region, len(vertices), "region", "vertex")
    order = count(k, "k", high=HIGHEST_ORDER)
    choice(area, "area", AREAS)
    solves = count(iterations, "iterations")
    x = vertices.copy()
    if not free.any():
        return x
    for _ in range(solves):
        x = Polyharmonic(x, faces, free, order, area).solve(x)
    return x


class Polyharmonic:
    """The system ``Delta^k x = 0`` at some vertices of a mesh, factored.

    With a length it is ``x + (-length^2 Delta)^k x = y``: waves much longer than ``2 pi length`` remain,
    shorter ones vanish [Desbrun et al. 1999, section 4.2]. The system contains only the faces around the
    free vertices.
    """

    def __init__(
        self,
        V: FloatArray,
        F: IntArray,
        free: BoolArray,
        k: int,
        area: Area = "voronoi",
        length: float | None = None,
    ) -> None:
        near = _faces_around(F, free, k - 1)
        used = used_vertices(F[near], len(V))
        lonely = np.flatnonzero(free & ~used)
        if len(lonely):
            raise OptionError(
                f"{which(lonely, 'vertex')} that should move do not belong to a face of F"
            )
        self.vertices = np.flatnonzero(used)
        number = np.full(len(V), -1, np.int64)
        number[self.vertices] = np.arange(len(self.vertices))
        X, inner = V[self.vertices], number[F[near]]
        areas = vertex_areas(X, inner, area)
        A = polyharmonic_matrix(cotangent_matrix(X, inner), areas, k)
        self._pull = np.zeros(len(X))
        if length is not None:
            self._pull = areas
            A = sp.diags_array(areas) + (-(length**2)) ** k * A
        self._is_free = free[self.vertices]
        self.solver = LaplacianSolver(A, ~self._is_free)

    def solve(self, values: FloatArray) -> FloatArray:
        """Return values (n, c) at all vertices, with those at free vertices replaced by the solution."""
        result = values.copy()
        given = values[self.vertices]
        found = self.solver.solve(self._pull[:, None] * given, given[~self._is_free])
        result[self.vertices[self._is_free]] = found[self._is_free]
        return result


def _faces_around(F: IntArray, vertices: BoolArray, rings: int) -> NDArray[np.intp]:
    """Faces that touch some vertices, or as many rings around them as are asked for."""
    reached = vertices.copy()
    for _ in range(rings):
        reached[F[reached[F].any(axis=1)]] = True
    return np.flatnonzero(reached[F].any(axis=1))
