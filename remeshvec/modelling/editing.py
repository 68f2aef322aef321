"""Edit a surface by a handle: displacements solve ``Delta^k d = 0`` between handle and fixed part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..core.arguments import choice, count
from ..core.check import as_array, as_mask, as_mesh, which
from ..core.vocabulary import BoolArray, FloatArray, IntArray
from ..errors import OptionError
from ..mesh.edges import used_vertices
from .fairing import HIGHEST_ORDER, Polyharmonic
from .laplacians import AREAS, Area

__all__ = ["Editor", "Region", "Transform", "as_transform", "deform"]

Transform = ArrayLike | Callable[[FloatArray], ArrayLike]


def deform(
    V: ArrayLike,
    F: ArrayLike,
    handle: ArrayLike,
    fixed: ArrayLike,
    transform: Transform,
    k: int = 2,
    *,
    area: Area = "voronoi",
) -> FloatArray:
    """Move a handle, hold some vertices, and let the others follow smoothly.

    Makes an `Editor` and calls `Editor.move` once, with the same parameters and errors.

    Returns
    -------
    (n, 3) float64
        Vertices.
    """
    return Editor(V, F, handle, fixed, k, area=area).move(transform)


class Editor:
    """Deform a surface many times with the same handle: the system is factored once.

    The support consists of the vertices that are neither in the handle nor fixed. Its displacement d
    solves ``Delta^k d = 0`` [Botsch and Kobbelt 2004, An intuitive framework for real-time freeform
    modeling, sections 3 and 4]. If handle and fixed part are k rings wide, the surface stays smooth of
    order k - 1 across their borders. Details of the surface move with it but do not turn with it;
    `MultiresolutionEditor` turns them.

    Parameters
    ----------
    V : (n, 3) float
    F : (m, 3) int
    handle, fixed : (k,) int or (n,) bool
        Vertices that are moved, and vertices that stay. They must not overlap.
    k : {1, 2, 3}
        Order; 1: membrane, 2: thin plate, 3: minimal variation of curvature.
    area : {"voronoi", "uniform"}
        See `vertex_areas`.

    Attributes
    ----------
    V : (n, 3) float64
        The surface at rest.
    handle, fixed, support : (n,) bool

    Raises
    ------
    MeshInputError
        V and F are not a mesh, or faces of the support have no area.
    OptionError
        Handle and fixed part overlap or leave no support, the handle is empty, an index is out of range,
        or the order or the area is not allowed.
    SingularSystemError
        A component of the mesh has neither handle nor fixed vertices.

    Examples
    --------
    >>> editor = Editor(V, F, handle, fixed, k=2)  # doctest: +SKIP
    >>> for step in range(100):  # doctest: +SKIP
    ...     show(editor.move(rotation(step)), F)
    """

    def __init__(
        self,
        V: ArrayLike,
        F: ArrayLike,
        handle: ArrayLike,
        fixed: ArrayLike,
        k: int = 2,
        *,
        area: Area = "voronoi",
    ) -> None:
        region = Region.of(V, F, handle, fixed)
        self.V = region.V
        self.handle, self.fixed, self.support = region.handle, region.fixed, region.support
        self._system = region.polyharmonic(self.V, k, area)
        self._basis: FloatArray | None = None

    def move(self, transform: Transform) -> FloatArray:
        """Return the surface with its handle moved from its place at rest.

        Parameters
        ----------
        transform : (4, 4) or (3, 4) float, (h, 3) float, or callable
            An affine map as a matrix for column vectors; or the new positions of the handle's vertices,
            in the order of their indices; or a function from the old positions (h, 3) to the new ones.
            Affine maps are linear in four solutions, so only the first one needs a solve [the same,
            section 4].

        Returns
        -------
        (n, 3) float64
            Vertices; fixed ones are as in ``V``, bit for bit.

        Raises
        ------
        OptionError
            The transform has a wrong shape, is not affine, or is not finite.
        """
        affine, target = as_transform(transform, self.V[self.handle])
        if affine is None:
            d = np.zeros_like(self.V)
            d[self.handle] = target - self.V[self.handle]
            moved = self.V + self._system.solve(d)
        else:
            moved = self.V + self._affine_basis() @ (affine - np.eye(3, 4)).T
        moved[self.handle] = target
        moved[self.fixed] = self.V[self.fixed]
        return moved

    def _affine_basis(self) -> FloatArray:
        """Solutions (n, 4) for the coordinates of the handle, and for 1 at the handle."""
        if self._basis is None:
            values = np.zeros((len(self.V), 4))
            values[self.handle] = np.column_stack([self.V[self.handle], np.ones(self.handle.sum())])
            self._basis = self._system.solve(values)
        return self._basis


@dataclass(frozen=True)
class Region:
    """A mesh with masks of the vertices in the handle, fixed, and in the support."""

    V: FloatArray
    F: IntArray
    handle: BoolArray
    fixed: BoolArray
    support: BoolArray

    @classmethod
    def of(cls, V: ArrayLike, F: ArrayLike, handle: ArrayLike, fixed: ArrayLike) -> Region:
        """Check and copy the arrays; vertices that no face uses count as fixed."""
        vertices, faces = as_mesh(V, F)
        n = len(vertices)
        is_handle = as_mask(handle, n, "handle", "vertex")
        is_fixed = as_mask(fixed, n, "fixed", "vertex")
        both = np.flatnonzero(is_handle & is_fixed)
        if len(both):
            raise OptionError(f"{which(both, 'vertex')} are in the handle and fixed; choose one")
        if not is_handle.any():
            raise OptionError("handle is empty: there is nothing to move")
        is_fixed |= ~(used_vertices(faces, n) | is_handle)
        support = ~(is_handle | is_fixed)
        if not support.any():
            raise OptionError("all vertices are in the handle or fixed: none is left to follow")
        return cls(vertices.copy(), faces.copy(), is_handle, is_fixed, support)

    def polyharmonic(
        self, V: FloatArray, k: int, area: Area, length: float | None = None
    ) -> Polyharmonic:
        """Return the system of the support, with vertices at V; checks the order and the area."""
        order = count(k, "k", high=HIGHEST_ORDER)
        choice(area, "area", AREAS)
        return Polyharmonic(V, self.F, self.support, order, area, length)


def as_transform(transform: Transform, points: FloatArray) -> tuple[FloatArray | None, FloatArray]:
    """Return the affine map (3, 4), or None if there is none, and the new positions of the points."""
    value = transform(points.copy()) if callable(transform) else transform
    array = as_array(value, "transform")
    if array.dtype.kind not in "fiu" or not np.isfinite(array).all():
        raise OptionError("transform must hold finite numbers")
    array = array.astype(np.float64)
    if array.shape == (4, 4) and not callable(transform):
        if not np.array_equal(array[3], [0.0, 0.0, 0.0, 1.0]):
            raise OptionError(
                f"the last row of an affine transform is 0 0 0 1; got {array[3].tolist()}"
            )
        array = array[:3]
    if array.shape == (3, 4) and not callable(transform):
        return array, points @ array[:, :3].T + array[:, 3]
    if array.shape != points.shape:
        raise OptionError(
            f"transform must be a (4, 4) or (3, 4) matrix, or the new positions {points.shape} of the "
            f"handle's vertices, or a function that returns them; got shape {array.shape}"
        )
    return None, array
