"""The problem: a surface under tension, what it encloses, and what holds it."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.csgraph import connected_components

from ..core.check import as_array, as_indices, as_mask, as_mesh, positive_number, which
from ..core.vocabulary import FloatArray, IntArray
from ..errors import MeshInputError, OptionError
from ..mesh.repair import count_edges
from .energies import areas, gradients, hessian, potentials, volumes

__all__ = ["CapillaryProblem", "Forces"]


@dataclass(frozen=True)
class Forces:
    """First derivatives at all vertices."""

    energy: FloatArray  # (n, 3) gradient of the energy
    volume: FloatArray  # (g, n, 3) gradient of the volume of every body


class CapillaryProblem:
    """A capillary surface: the energy to be minimised, the volume to be kept, and the wires.

    The energy is ``tension * area + energy of the fluid in gravity + energy_offset``. The fluid fills
    what the surface encloses; its energy is ``-density * gravity . x`` integrated over that, as a surface
    integral that is exact on flat triangles. For a surface that is not closed, area, volume and energy
    are those of its faces, as seen from the origin; what is missing (flat caps that do not move, say) is
    a constant, which the offsets add.

    Parameters
    ----------
    V : (n, 3) float
        Vertices, in any unit of length.
    F : (m, 3) int
        Faces, of one winding; the volume is positive where they run counterclockwise from outside.
    fixed : (k,) int or (n,) bool, optional
        Vertices that never move. The ends of fixed edges are fixed besides.
    fixed_edges : (k, 2) int, optional
        Wires: edges that are never moved, split or collapsed. By default, the boundary.
    tension : float
        Energy per area.
    volume : float, optional
        What has to be enclosed, offset included; by default nothing is prescribed.
    volume_offset, energy_offset : float
        Added to the volume and the energy of the faces.
    density : float
        Mass per volume of the fluid minus that of what is around it.
    gravity : (3,) float
        Acceleration.
    bodies : {"shared", "per_component"}
        Whether the volume is that of all components together (they are connected, as by a pipe, and have
        one pressure), or whether each keeps its own.

    Attributes
    ----------
    V, F, fixed, fixed_edges, tension, volume, ...
        As given; ``fixed`` is a mask (n,).
    body : (m,) int64
        The body that every face belongs to.
    targets : (g,) float64
        Prescribed volume of every body, without the offset; empty where none is prescribed.

    Raises
    ------
    MeshInputError
        V and F are no mesh; or they enclose nothing in particular, because two faces run an edge the
        same way, where a volume or a density is given.
    OptionError
        Indices out of range, numbers that are not positive or finite.
    """

    def __init__(
        self,
        V: ArrayLike,
        F: ArrayLike,
        fixed: ArrayLike | None = None,
        fixed_edges: ArrayLike | None = None,
        *,
        tension: float = 1.0,
        volume: float | None = None,
        volume_offset: float = 0.0,
        energy_offset: float = 0.0,
        density: float = 0.0,
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        bodies: Literal["shared", "per_component"] = "shared",
    ) -> None:
        vertices, faces = as_mesh(V, F)
        n = len(vertices)
        if fixed_edges is None:
            edges, uses = count_edges(faces)
            edges = edges[uses == 1]
        else:
            edges = _edges(fixed_edges, n)
        mask = np.zeros(n, np.bool_) if fixed is None else as_mask(fixed, n, "fixed", "vertex")
        mask[edges] = True
        mask |= np.bincount(faces.ravel(), minlength=n) == 0
        self.V, self.F = vertices.copy(), faces.copy()
        self.fixed, self.fixed_edges = mask, edges
        self.tension = positive_number(tension, "tension", "energy per area")
        self.volume = None if volume is None else _finite(volume, "volume")
        self.volume_offset = _finite(volume_offset, "volume_offset")
        self.energy_offset = _finite(energy_offset, "energy_offset")
        self.density = _finite(density, "density")
        self.gravity = np.array([_finite(g, "gravity") for g in as_array(gravity, "gravity")])
        if self.gravity.shape != (3,):
            raise OptionError(f"gravity must have 3 components; got {self.gravity.shape}")
        if bodies not in ("shared", "per_component"):
            raise OptionError(f"bodies must be one of shared, per_component; got {bodies!r}")
        if self.volume is not None or self.density:
            _check_winding(faces)
        self.body = np.zeros(len(faces), np.int64)  # of every face
        # Volume of every body without the offset.
        self.targets = np.empty(0)
        if self.volume is not None:
            self.targets = np.array([self.volume - self.volume_offset])
            if bodies == "per_component":
                apart = self.taken_apart()
                self.body, self.targets = apart.body, apart.targets

    @property
    def potential(self) -> FloatArray:
        """Gradient of the fluid's energy density, ``-density * gravity``."""
        return -self.density * self.gravity

    @property
    def free(self) -> NDArray[np.bool_]:
        """Vertices that move."""
        return ~self.fixed

    def area(self, V: FloatArray | None = None) -> float:
        """Area of the faces."""
        return float(areas(self._corners(V)).sum())

    def energy(self, V: FloatArray | None = None) -> float:
        """Energy, offset included."""
        T = self._corners(V)
        total = self.tension * areas(T).sum() + potentials(T, self.potential).sum()
        return float(total) + self.energy_offset

    def total_volume(self, V: FloatArray | None = None) -> float:
        """Volume of all bodies together, offset included."""
        return float(volumes(self._corners(V)).sum()) + self.volume_offset

    def body_volumes(self, V: FloatArray | None = None) -> FloatArray:
        """Volume (g,) of the faces of every body with a prescribed one."""
        count = len(self.targets)
        found = np.bincount(self.body, volumes(self._corners(V)), count)
        return np.asarray(found[:count], np.float64)

    def forces(self, V: FloatArray | None = None) -> Forces:
        """Gradients of energy and volumes."""
        area, volume, potential = gradients(self._corners(V), self.potential)
        n = len(self.V)
        energy = _at_vertices(self.F, self.tension * area + potential, n)
        each = np.stack(
            [
                _at_vertices(self.F[self.body == g], volume[self.body == g], n)
                for g in range(len(self.targets))
            ]
            or [np.empty((0, n, 3))]
        ).reshape(-1, n, 3)
        return Forces(energy, each)

    def hessian(
        self, directions: FloatArray, pressure: FloatArray, V: FloatArray | None = None
    ) -> sp.csr_array:
        """Second derivatives of ``energy - pressure . volumes`` along directions (n, d, 3)."""
        X = self.V if V is None else V
        each = np.append(pressure, 0.0)[np.minimum(self.body, len(pressure))]
        return hessian(X, self.F, directions, self.potential, self.tension, each)

    def with_mesh(self, V: FloatArray, **changes: Any) -> CapillaryProblem:
        """Return the problem with other vertices, and perhaps other faces."""
        problem = copy(self)
        for name, value in {"V": V, **changes}.items():
            setattr(problem, name, value)
        return problem

    def components(self) -> tuple[int, IntArray]:
        """Count the components, and number them for every face."""
        i, j = self.F[:, [0, 1, 2]].ravel(), self.F[:, [1, 2, 0]].ravel()
        graph = sp.coo_array((np.ones(len(i)), (i, j)), (len(self.V), len(self.V)))
        label = connected_components(graph, directed=False)[1][self.F[:, 0]]
        names, body = np.unique(label, return_inverse=True)
        return len(names), body

    def taken_apart(self) -> CapillaryProblem:
        """Return the problem with a body a component, which keep the share of volume they have now."""
        count, body = self.components()
        now = np.bincount(body, volumes(self._corners(None)), count)
        if not len(self.targets):
            return self
        # What is missing or too much is distributed by area.
        missing = self.targets.sum() - now.sum()
        share = np.bincount(body, areas(self._corners(None)), count)
        targets = now + missing * share / share.sum()
        return self.with_mesh(self.V, body=body, targets=targets)

    def _corners(self, V: FloatArray | None) -> FloatArray:
        return (self.V if V is None else V)[self.F]


def _check_winding(F: IntArray) -> None:
    """Refuse faces that run an edge the same way: there is no inside then."""
    half = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    key = half[:, 0] * (F.max() + 1) + half[:, 1]
    _, index, count = np.unique(key, return_index=True, return_counts=True)
    bad = np.unique(index[count > 1] % len(F))
    if len(bad):
        raise MeshInputError(
            f"{which(bad, 'face')} of F run an edge the same way as another, so that no volume is "
            "enclosed; remesh turns them where the surface is a manifold"
        )


def _at_vertices(F: IntArray, corners: FloatArray, n: int) -> FloatArray:
    """Add up vectors (m, 3, 3) of corners at their vertices."""
    index = F.ravel()
    flat = corners.reshape(-1, 3)
    return np.stack([np.bincount(index, flat[:, c], n) for c in range(3)], axis=1)


def _edges(value: ArrayLike, n: int) -> IntArray:
    array = as_array(value, "fixed_edges")
    if array.size == 0:
        return np.empty((0, 2), np.int64)
    if array.ndim != 2 or array.shape[1] != 2:
        raise OptionError(f"fixed_edges must have shape (k, 2); got {array.shape}")
    ends = [as_indices(array[:, i], n, f"fixed_edges[:, {i}]", "vertex") for i in (0, 1)]
    return np.stack(ends, axis=1)


def _finite(value: Any, name: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if isinstance(value, bool) or not np.isfinite(number):
        raise OptionError(f"{name} must be a finite number; got {value!r}")
    return number
