"""Implicit fairing: steps of mean curvature flow, stable for any step length."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from ..core.arguments import choice, count, flag, number
from ..core.check import as_mask, as_mesh
from ..core.vocabulary import BoolArray, FloatArray, IntArray
from ..errors import MeshInputError, OptionError
from ..interop.given import MeshObject, takes_meshes
from ..mesh.edges import components, count_edges, halfedge_ends, lengths_in_triangles, used_vertices
from .laplacians import AREAS, Area, cotangent_matrix, vertex_areas
from .solver import LaplacianSolver

__all__ = ["smooth"]

BOUNDARIES = ("fixed", "free")


@takes_meshes
def smooth(
    V: ArrayLike | MeshObject,
    F: Any = None,
    step: float | None = None,
    iterations: int = 1,
    *,
    keep_volume: bool = False,
    boundary: Literal["fixed", "free"] = "fixed",
    fixed: ArrayLike | None = None,
    area: Area = "voronoi",
) -> FloatArray:
    """Smooth a surface by mean curvature flow, with implicit steps.

    Each step solves ``(M - step C) x' = M x`` [Desbrun et al. 1999, section 2.3], where M are the
    vertex areas and C is the cotangent matrix of the surface before the step. Waves shorter than about
    ``2 pi sqrt(step)`` vanish. The system is symmetric and positive definite for any step.

    Parameters
    ----------
    V : (n, 3) float, or a mesh
        Or a whole mesh as for `remesh`, or a result; what comes back are its vertices.
    F : (m, 3) int
    step : float, optional
        Time per step, in squared units of V. By default the squared mean edge length.
    iterations : int
        Number of steps.
    keep_volume : bool
        Scale every component about its centre of area after each step, so that it encloses the same
        volume as before [Desbrun et al. 1999, section 3.3]. Only for closed, oriented surfaces.
    boundary : {"fixed", "free"}
        Whether boundary vertices stay; free ones shrink into the surface, as a soap film would.
    fixed : (k,) int or (n,) bool, optional
        Vertices that stay.
    area : {"voronoi", "uniform"}
        See `vertex_areas`.

    Returns
    -------
    (n, 3) float64
        Vertices; those that stay, and those that no face uses, are as in ``V``, bit for bit.

    Raises
    ------
    MeshInputError
        V and F are not a mesh; a face has no area, or lost it in a step in which a thin part vanishes
        (remesh between steps, or take fewer); or ``keep_volume`` is set for a surface that is not closed.
    OptionError
        ``step`` is not positive, or another option is invalid.
    """
    vertices, faces = as_mesh(V, F)
    time = _smoothing_step(step, vertices, faces)
    steps = count(iterations, "iterations")
    choice(area, "area", AREAS)
    stays = _staying(len(vertices), faces, choice(boundary, "boundary", BOUNDARIES), fixed)
    parts = []
    if flag(keep_volume, "keep_volume"):
        parts = _closed_parts(vertices, faces)
        if stays[faces].any():
            raise OptionError("keep_volume moves all vertices; it cannot hold some fixed")
    x = vertices.copy()
    for i in range(steps):
        x = _flow(x, faces, stays, time, area, i)
        for part, volume in parts:
            _restore(x, faces[part], volume)
    return x


def _smoothing_step(step: float | None, V: FloatArray, F: IntArray) -> float:
    if step is None:
        return float(lengths_in_triangles(V[F]).mean() ** 2)
    return number(step, "step", above=0.0, unit="squared units of V")


def _staying(n: int, F: IntArray, boundary: str, fixed: ArrayLike | None) -> BoolArray:
    """Mask of the vertices that do not move, including those that no face uses."""
    stays = ~used_vertices(F, n)
    if fixed is not None:
        stays |= as_mask(fixed, n, "fixed", "vertex")
    if boundary == "fixed":
        edges, uses = count_edges(F)
        stays[edges[uses == 1]] = True
    return stays


def _flow(
    x: FloatArray, F: IntArray, stays: BoolArray, time: float, area: Area, i: int
) -> FloatArray:
    """Take one implicit step; i counts the steps before it, for messages."""
    try:
        C = cotangent_matrix(x, F)
    except MeshInputError as error:
        if i == 0:
            raise
        raise MeshInputError(f"after {i} steps: {error}") from error
    # Vertices between vanishing faces may have an area of 0; they are already fair.
    mass = np.maximum(vertex_areas(x, F, area), np.finfo(float).tiny)
    A = sp.diags_array(mass) - time * C
    solved = LaplacianSolver(A, stays).solve(mass[:, None] * x, x[stays])
    solved[stays] = x[stays]
    return solved


def _closed_parts(V: FloatArray, F: IntArray) -> list[tuple[NDArray[np.intp], float]]:
    """Return the faces and the volume of every component; refuses surfaces that are not closed."""
    n = len(V)
    start, end = halfedge_ends(F)
    if not np.array_equal(np.sort(start * n + end), np.sort(end * n + start)):
        raise MeshInputError(
            "keep_volume needs a closed surface with faces of one winding; remesh turns them, and "
            'boundary="fixed" keeps an open one from shrinking'
        )
    part = components(n, start, end)[1][F[:, 0]]
    order = np.argsort(part, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(part[order])) + 1)
    return [(group, _volume(V, F[group])) for group in groups]


def _volume(V: FloatArray, F: IntArray) -> float:
    """Volume that a closed component encloses."""
    a, b, c = (V[F[:, i]] - V[F[0, 0]] for i in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6.0)


def _restore(x: FloatArray, F: IntArray, volume: float) -> None:
    """Scale a component to its former volume, in place."""
    now = _volume(x, F)
    if volume == 0.0 or not now / volume > 0.0:
        raise MeshInputError("a component turned inside out or vanished; take smaller steps")
    a, b, c = (x[F[:, i]] for i in range(3))
    weight = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    centre = (weight @ (a + b + c)) / (3.0 * weight.sum())
    vertices = np.unique(F)
    x[vertices] = centre + (x[vertices] - centre) * np.cbrt(volume / now)
