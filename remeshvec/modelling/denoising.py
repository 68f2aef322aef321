"""Removal of noise that keeps the volume: a low-pass filter of the surface."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from ..core.arguments import count
from ..core.vocabulary import FloatArray
from ..interop.given import MeshObject, takes_meshes
from ..mesh.edges import halfedge_ends
from .movable import Movable, as_movable, keep_vanished, warn_if_idle

__all__ = ["denoise"]

# Steps of the filter: one that shrinks, and one that blows up again. The inverses add up to the
# frequency that passes unchanged. On a creature of 35,000 faces .02 keeps the volume within .04 %, where
# the usual .1 gains .3 % to .6 %.
_SHRINK = 0.5
_PASS = 0.02
_GROW = 1.0 / (_PASS - 1.0 / _SHRINK)


@takes_meshes
def denoise(
    V: ArrayLike | MeshObject,
    F: Any = None,
    iterations: int = 20,
    *,
    boundary: Literal["fixed", "free"] = "fixed",
    fixed: ArrayLike | None = None,
) -> FloatArray:
    """Remove noise from a surface and keep its volume and its thin parts.

    Every iteration is a step towards the mean of the neighbours and a longer one back [Taubin 1995,
    section 3]. Together they damp the waves of a few edges and leave all longer ones, so bodies do not
    shrink as in the flow of `smooth`; only what is a few edges thick does, a little: a tube of twelve
    edges around loses 6 % of its volume in 20 iterations. The weights do not depend on the shape of the
    faces: needles and faces without area, as marching cubes leave them, do no harm, and become rounder.

    Parameters
    ----------
    V : (n, 3) float
    F : (m, 3) int
    iterations : int
        How strongly: waves of less than about ``2.5 iterations^(1/4)`` edges lose half or more: 5.3 edges
        by default. 10 suits light noise, 20 to 40 scans and masks of voxels.
    boundary : {"fixed", "free"}
        Whether boundary vertices stay. Boundary vertices in exactly one place move as one, so seams and
        triangles that are not joined stay together.
    fixed : (k,) int or (n,) bool, optional
        Vertices that stay.

    Returns
    -------
    (n, 3) float64
        Vertices; those that stay, and those that no face uses, are as in ``V``, bit for bit.

    Raises
    ------
    MeshInputError
        V and F are not a mesh.
    OptionError
        An option is invalid.

    Warns
    -----
    RemeshWarning
        Components of a few faces would vanish, and stay as they are; or no vertex can move.
    """
    surface = as_movable(V, F, boundary, fixed)
    steps = count(iterations, "iterations")
    warn_if_idle(surface)
    mean = _means_of_neighbours(surface)
    x = surface.V.copy()
    for _ in range(steps):
        for weight in (_SHRINK, _GROW):
            x += weight * (mean @ x)
    keep_vanished(surface, x, np.empty(0, np.int64))
    return surface.spread(x)


def _means_of_neighbours(surface: Movable) -> sp.csr_array:
    """Matrix that leads from every vertex to the mean of its neighbours; zero where it stays."""
    n = len(surface.V)
    start, end = halfedge_ends(surface.F)
    # Entries of one place are added up; every neighbour counts once, however many faces have the edge.
    links = sp.csr_array((np.ones(len(start)), (start, end)), shape=(n, n))
    links = links + links.T
    links.data[:] = 1.0
    moves = np.where(surface.stays, 0.0, 1.0)
    share = moves / np.maximum(links.sum(axis=1), 1.0)
    return sp.csr_array(sp.diags_array(share) @ links - sp.diags_array(moves))
