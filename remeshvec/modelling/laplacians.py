"""Discrete Laplacians of triangle meshes: libigl's cotangents over Voronoi or uniform areas.

The sign is that of the sum of second derivatives: matrices are negative semidefinite. The cotangent
matrix is dimensionless and areas are in squared units of V, so the Laplacian is in their inverse.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from ..core.arguments import choice, flag
from ..core.check import as_mesh, which
from ..core.vocabulary import FloatArray
from ..errors import MeshInputError
from ..interop.given import MeshObject, takes_meshes
from ..mesh.edges import used_vertices

__all__ = ["AREAS", "cotangent_matrix", "laplacian", "polyharmonic_matrix", "vertex_areas"]

Area = Literal["voronoi", "uniform"]
AREAS = ("voronoi", "uniform")


@takes_meshes
def cotangent_matrix(V: ArrayLike | MeshObject, F: Any = None) -> sp.csc_array:
    """Cotangent matrix C, the stiffness matrix of linear elements with the sign of the Laplacian.

    ``C[i, j] = (cot a + cot b) / 2`` with the angles a and b opposite edge ij; rows sum to 0 [Pinkall
    and Polthier 1993, section 2]. It is symmetric, bit for bit.

    Parameters
    ----------
    V : (n, 3) float
        Vertices.
    F : (m, 3) int
        Faces; holes, several components and edges with many faces are allowed.

    Returns
    -------
    (n, n) sparse array
        Negative semidefinite, without units. Rows of vertices that no face uses are empty.

    Raises
    ------
    MeshInputError
        V and F are not a mesh, or a face has no area (the cotangents are infinite).
    """
    import igl

    vertices, faces = as_mesh(V, F)
    C = igl.cotmatrix(vertices, faces)
    if not np.isfinite(C.data).all():
        flat = np.flatnonzero(~np.isfinite(igl.cotmatrix_entries(vertices, faces)).all(axis=1))
        raise MeshInputError(
            f"{which(flat, 'face')} of F have no area beyond rounding errors, so that "
            "cotangents are infinite; remesh first, or drop them"
        )
    # libigl adds up the two halves in different orders, which breaks the symmetry by rounding errors.
    return sp.csc_array((C + C.T) * 0.5)


@takes_meshes
def vertex_areas(V: ArrayLike | MeshObject, F: Any = None, area: Area = "voronoi") -> FloatArray:
    """Area of each vertex: its share of the area of the surface.

    Parameters
    ----------
    V : (n, 3) float, or a mesh
        Or a whole mesh as for `remesh`, or a result.
    F : (m, 3) int
    area : {"voronoi", "uniform"}
        "voronoi": mixed Voronoi areas [Meyer et al. 2003, section 3.3]. "uniform": their mean, for all
        vertices.

    Returns
    -------
    (n,) float64
        In squared units of V; 0 for vertices that no face uses. They add up to the area of the surface.

    Raises
    ------
    MeshInputError
        V and F are not a mesh.
    OptionError
        The area is unknown.
    """
    import igl

    choice(area, "area", AREAS)
    vertices, faces = as_mesh(V, F)
    found = igl.massmatrix(vertices, faces, igl.MASSMATRIX_TYPE_VORONOI).diagonal()
    areas = np.zeros(len(vertices))
    areas[: len(found)] = found  # libigl stops at the last vertex that a face uses
    if area == "uniform":
        is_used = used_vertices(faces, len(vertices))
        areas = np.where(is_used, igl.doublearea(vertices, faces).sum() / 2 / is_used.sum(), 0.0)
    return areas


@takes_meshes
def laplacian(
    V: ArrayLike | MeshObject,
    F: Any = None,
    area: Area = "voronoi",
    symmetric: bool = False,
) -> sp.csc_array:
    """Discrete Laplacian ``M^-1 C``: cotangents over vertex areas.

    With ``area="uniform"`` it is symmetric. On an even mesh, such as a remeshed one, it is close to the
    Laplacian with Voronoi areas.

    Parameters
    ----------
    V : (n, 3) float, or a mesh
        Or a whole mesh as for `remesh`, or a result.
    F : (m, 3) int
    area : {"voronoi", "uniform"}
        See `vertex_areas`.
    symmetric : bool
        Return ``M^-1/2 C M^-1/2``, which has the same eigenvalues, and eigenvectors ``M^1/2 x``. With
        uniform areas it is the same matrix.

    Returns
    -------
    (n, n) sparse array
        With the sign of the sum of second derivatives: its eigenvalues are at most 0. In inverse squared
        units of V. ``laplacian(V, F) @ V`` is ``-2 H n``, the mean curvature normal [Meyer et
        al. 2003, section 3.5]. Rows of vertices that no face uses are empty.

    Raises
    ------
    MeshInputError
        As for `cotangent_matrix`.
    OptionError
        The area is unknown, or ``symmetric`` is not True or False.
    """
    is_symmetric = flag(symmetric, "symmetric")
    areas = vertex_areas(V, F, area)
    C = cotangent_matrix(V, F)
    inverse = _inverse(areas)
    if area == "uniform":
        return sp.csc_array(C * inverse.max())
    if is_symmetric:
        root = np.sqrt(inverse)
        scaled = C.tocoo()
        data = scaled.data * (root[scaled.row] * root[scaled.col])  # symmetric, bit for bit
        return sp.csc_array(sp.coo_array((data, (scaled.row, scaled.col)), C.shape))
    return sp.csc_array(sp.diags_array(inverse) @ C)


def polyharmonic_matrix(C: sp.csc_array, areas: FloatArray, k: int) -> sp.csc_array:
    """Laplacian of order k times areas, ``C (M^-1 C)^(k-1)``: symmetric for any M.

    Times (-1)^k it is positive semidefinite.
    """
    K = C
    step = sp.diags_array(_inverse(areas)) @ C
    for _ in range(k - 1):
        K = K @ step
    return sp.csc_array((K + K.T) * 0.5)


def _inverse(areas: FloatArray) -> NDArray[Any]:
    """Inverse areas; 0 where there is no area."""
    return np.divide(1.0, areas, out=np.zeros_like(areas), where=areas > 0.0)
