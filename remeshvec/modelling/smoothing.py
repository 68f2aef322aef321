"""Implicit fairing: steps of mean curvature flow, stable for any step length."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from ..core.arguments import choice, count, flag, number
from ..core.vocabulary import BoolArray, FloatArray, IntArray
from ..errors import MeshInputError, OptionError
from ..interop.given import MeshObject, takes_meshes
from ..mesh.edges import components, halfedge_ends, lengths_in_triangles, used_vertices
from .laplacians import AREAS, Area, cotangent_matrix, vertex_areas
from .movable import Movable, as_movable, double_areas, keep_vanished, warn_if_idle
from .solver import LaplacianSolver

__all__ = ["smooth"]

# Faces lower than this share of their longest edge have no cotangents that a solution could bear.
_FLAT = 1e-8

# A step that leaves less of a volume has taken the component to a point, or to threads.
_VANISHED_VOLUME = 1e-3


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
    ``2 pi sqrt(step)`` vanish. The system is symmetric and positive definite for any step. The flow
    shrinks what it smooths, and pinches thin handles off: for noise on scans, `denoise` is better.

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
        Whether boundary vertices stay; free ones shrink into the surface, as a soap film would. Boundary
        vertices in exactly one place move as one, so triangles that are not joined stay together.
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
        V and F are not a mesh, or ``keep_volume`` is set for a surface that is not closed.
    OptionError
        ``step`` is not positive, or another option is invalid.

    Warns
    -----
    RemeshWarning
        Components would vanish, and stay as they are; or no vertex can move.
    """
    surface = as_movable(V, F, boundary, fixed)
    time = _smoothing_step(step, surface)
    steps = count(iterations, "iterations")
    choice(area, "area", AREAS)
    parts = []
    if flag(keep_volume, "keep_volume"):
        parts = _closed_parts(surface.V, surface.F)
        if surface.stays[surface.F].any():
            raise OptionError("keep_volume moves all vertices; it cannot hold some fixed")
    warn_if_idle(surface)
    x = surface.V.copy()
    gone = np.empty(0, np.int64)
    for _ in range(steps):
        gone = np.union1d(gone, _vanishing(surface, x, time))
        stays = surface.stays | np.isin(surface.part, gone)
        x = _flow(x, surface.F, stays, time, area)
        for part, volume in parts:
            if not stays[surface.F[part[0], 0]] and not _restore(x, surface.F[part], volume):
                gone = np.union1d(gone, surface.part[surface.F[part[0], 0]])
    keep_vanished(surface, x, gone)
    return surface.spread(x)


def _smoothing_step(step: float | None, surface: Movable) -> float:
    if step is None:
        return float(lengths_in_triangles(surface.V[surface.F]).mean() ** 2)
    return number(step, "step", above=0.0, unit="squared units of V")


def _vanishing(surface: Movable, x: FloatArray, time: float) -> IntArray:
    """Return the components that one step shrinks to nothing: smaller than it, and held nowhere.

    A sphere of radius R shrinks by ``1 + 2 time / R^2``: to .4 % if its area is the step.
    """
    n = int(surface.part.max()) + 1
    double_area = np.bincount(surface.part[surface.F[:, 0]], double_areas(x, surface.F), n)
    held = np.zeros(n, np.bool_)
    held[surface.part[surface.stays & used_vertices(surface.F, len(x))]] = True
    return np.flatnonzero(~held & (double_area > 0.0) & (double_area < 2.0 * time))


def _flow(x: FloatArray, F: IntArray, stays: BoolArray, time: float, area: Area) -> FloatArray:
    """Take one implicit step; faces without area pull at nothing, and their own vertices stay."""
    longest = lengths_in_triangles(x[F]).max(axis=1)
    F = F[double_areas(x, F) > _FLAT * longest**2]
    stays = stays | ~used_vertices(F, len(x))
    if stays.all():
        return x
    # Vertices between vanishing faces may have an area of 0; they are already fair.
    mass = np.maximum(vertex_areas(x, F, area), np.finfo(float).tiny)
    A = sp.diags_array(mass) - time * cotangent_matrix(x, F)
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


def _restore(x: FloatArray, F: IntArray, volume: float) -> bool:
    """Scale a component to its former volume, in place; False if it has vanished or turned inside out."""
    now = _volume(x, F)
    if volume == 0.0 or not now / volume > _VANISHED_VOLUME:
        return False
    a, b, c = (x[F[:, i]] for i in range(3))
    weight = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    centre = (weight @ (a + b + c)) / (3.0 * weight.sum())
    vertices = np.unique(F)
    x[vertices] = centre + (x[vertices] - centre) * np.cbrt(volume / now)
    return True
