"""Multiresolution editing: details turn with the smooth base they lie on, and the base is remeshed.

A surface is split into a base, where the support is fair, and details, the difference from the surface
[Kobbelt et al. 1998]. The base follows the handle, and is remeshed where its triangles stretch [Botsch
and Kobbelt 2004, A remeshing approach to multiresolution modeling, section 5]. Then the details are added
again, turned as the base has turned. The birth of a new vertex is its place on the base at rest: it gives
the displacement and the detail of the vertex.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.arguments import flag, number
from ..core.vocabulary import BoolArray, FloatArray, IntArray
from ..mesh.edges import lengths_in_triangles
from ..pipeline.remesh import remesh
from .editing import Region, Transform, as_transform
from .laplacians import Area
from .motion import part_of_motion, rotations_between

__all__ = ["EditedSurface", "MultiresolutionEditor"]


# The base is remeshed when the length of an edge of the support leaves this range [the report's
# thresholds], or an angle falls below this number of degrees.
_SHORT, _LONG = 0.5, 1.5
_SMALL_ANGLE = 28.0

# Most remeshings of the base in one move: where triangles are long at rest, new vertices come to lie
# beside the triangles that they were made on.
_MOST_REMESHINGS = 4


@dataclass(frozen=True)
class EditedSurface:
    """A surface after a move; unpacks as ``V, F = surface``.

    Attributes
    ----------
    V : (n, 3) float64
    F : (m, 3) int64
    base : (n, 3) float64
        The smooth surface without the details.
    birth_face, birth_barycentric : (n,) int64, (n, 3) float64
        Place of each vertex on the surface at rest: a face, and the weights of its corners.
    support : (n,) bool
        Vertices that are neither handle nor fixed.
    remeshed : int
        Number of remeshings of the support since the surface was at rest.
    """

    V: FloatArray
    F: IntArray
    base: FloatArray
    birth_face: IntArray
    birth_barycentric: FloatArray
    support: BoolArray
    remeshed: int

    def __iter__(self) -> Iterator[NDArray[np.generic]]:
        """Unpack into V and F."""
        return iter((self.V, self.F))


class MultiresolutionEditor:
    """Deform a detailed surface: details turn with it, and stretched triangles are replaced.

    The base of the support moves by a share w of the motion of the handle, with ``Delta^k w = 0`` between
    0 at the fixed part and 1 at the handle. The share of a rigid motion is that of its screw, so that
    bars bend and twist by any angle without getting thinner.

    Parameters
    ----------
    V, F, handle, fixed, k, area
        As for `Editor`; k is the order of the base, and of the shares.
    detail_size : float, optional
        Waves of the support shorter than about this, in units of V, are details. By default, details are
        all that `fair` removes: this suits a patch, but the fair surface of a long tube has no volume.
    length : float, optional
        Edge length to which the support is remeshed, in units of V. By default the mean length of its
        edges at rest.
    remesh : bool
        Whether to remesh.

    Attributes
    ----------
    base : (n, 3) float64
        The smooth base at rest.
    details : (n, 3) float64
        Difference from the surface: ``V - base``.

    Raises
    ------
    MeshInputError, OptionError, SingularSystemError
        As for `Editor`; OptionError also if a length is not positive.
    """

    def __init__(
        self,
        V: ArrayLike,
        F: ArrayLike,
        handle: ArrayLike,
        fixed: ArrayLike,
        k: int = 2,
        *,
        detail_size: float | None = None,
        length: float | None = None,
        remesh: bool = True,
        area: Area = "voronoi",
    ) -> None:
        region = Region.of(V, F, handle, fixed)
        self._V, self._F = region.V, region.F
        self._handle = np.flatnonzero(region.handle)
        self._remesh = flag(remesh, "remesh")
        cutoff = None
        if detail_size is not None:
            size = number(detail_size, "detail_size", above=0.0, unit="units of V")
            cutoff = size / (2.0 * np.pi)
        if length is None:
            T = self._V[self._F[region.support[self._F].any(axis=1)]]
            self._length = float(lengths_in_triangles(T).mean())
        else:
            self._length = number(length, "length", above=0.0, unit="units of V")
        self.base = region.polyharmonic(self._V, k, area, cutoff).solve(self._V)
        self.details = self._V - self.base
        self._follow = region.polyharmonic(self.base, k, area)
        self._share = self._follow.solve(region.handle[:, None].astype(np.float64))
        fixed_vertices = np.flatnonzero(region.fixed)
        births = _own_births(len(self._V), self._F)
        self._now = _Current(self._F, self._handle, fixed_vertices, region.support, *births)

    def move(self, *transforms: Transform) -> EditedSurface:
        """Return the surface with its handle moved from its place at rest.

        Parameters
        ----------
        *transforms : (4, 4) or (3, 4) float, (h, 3) float, or callable
            As for `Editor.move`. Several are a path: each starts from the result of the one before, so
            that four quarter turns are a full turn.

        Returns
        -------
        EditedSurface
            The next move starts with its triangles.
        """
        motion = self._motion(transforms)
        now = self._now
        base = self._placed(now, motion)
        for _ in range(_MOST_REMESHINGS):
            if not self._remesh or not self._is_stretched(now, base):
                break
            now = self._remeshed(now, base)
            base = self._placed(now, motion)
        self._now = now
        return EditedSurface(
            self._with_details(now, base), now.F.copy(), base, now.birth_face.copy(),
            now.birth_barycentric.copy(), now.support.copy(), now.remeshed,
        )  # fmt: skip

    def _motion(self, path: Sequence[Transform]) -> list[_Step]:
        """Turn the path of the handle into motions of the base."""
        points = self._V[self._handle]
        steps: list[_Step] = []
        for transform in path:
            affine, target = as_transform(transform, points)
            if affine is not None:
                centre = points.mean(axis=0)
                steps.append(partial(self._moved_by_share, affine, centre))
            else:
                d = np.zeros_like(self._V)
                d[self._handle] = target - points
                steps.append(partial(self._displaced, self._follow.solve(d)))
            points = target
        return steps

    def _moved_by_share(
        self, affine: FloatArray, centre: FloatArray, now: _Current, x: FloatArray
    ) -> FloatArray:
        return part_of_motion(affine, centre, x, self._at_rest(now, self._share)[:, 0])

    def _displaced(self, displacement: FloatArray, now: _Current, x: FloatArray) -> FloatArray:
        return x + self._at_rest(now, displacement)

    def _placed(self, now: _Current, motion: list[_Step]) -> FloatArray:
        """Return the base after a motion, at the current vertices."""
        x = self._at_rest(now, self.base)
        for step in motion:
            x = step(now, x)
        return x

    def _is_stretched(self, now: _Current, base: FloatArray) -> bool:
        T = base[now.F[now.support[now.F].any(axis=1)]]
        edges = lengths_in_triangles(T)
        if edges.max() > _LONG * self._length or edges.min() < _SHORT * self._length:
            return True
        return bool(_smallest_angles(T).min() < _SMALL_ANGLE)

    def _remeshed(self, now: _Current, base: FloatArray) -> _Current:
        """Remesh the support; births are places on the surface at rest."""
        held = np.concatenate([now.handle, now.fixed])
        result = remesh(
            base,
            now.F,
            self._length,
            selection=now.support[now.F].any(axis=1),
            fixed_vertices=held,
            feature_angle=None,
        )
        at = result.vertex_map[held]
        support = np.ones(len(result.V), np.bool_)
        support[at] = False
        face, weights = self._located(now, result.birth_face, result.birth_barycentric)
        # Held vertices keep their own births, which lie on corners.
        face[at], weights[at] = now.birth_face[held], now.birth_barycentric[held]
        handle, fixed = np.split(at, [len(now.handle)])
        return _Current(result.F, handle, fixed, support, face, weights, now.remeshed + 1)

    def _located(
        self, now: _Current, face: IntArray, weights: FloatArray
    ) -> tuple[IntArray, FloatArray]:
        """Turn births on the surface before remeshing into births on the surface at rest."""
        if now.remeshed == 0:
            return face.copy(), weights.copy()
        import igl

        corners = self._at_rest(now, self.base)[now.F[face]]
        points = np.einsum("vc,vcx->vx", weights, corners)
        _, born, closest = igl.point_mesh_squared_distance(points, self.base, self._F)
        a, b, c = (np.ascontiguousarray(self.base[self._F[born, i]]) for i in range(3))
        return born, np.asarray(igl.barycentric_coordinates(closest, a, b, c))

    def _at_rest(self, now: _Current, values: FloatArray) -> FloatArray:
        """Values (n, c) on the surface at rest, interpolated at the current vertices."""
        corners = values[self._F[now.birth_face]]
        return np.asarray(np.einsum("vc,vcx->vx", now.birth_barycentric, corners))

    def _with_details(self, now: _Current, base: FloatArray) -> FloatArray:
        """Add the details, turned as the base has turned."""
        details = self._at_rest(now, self.details)
        turn = rotations_between(self._at_rest(now, self.base), base, now.F)[now.support]
        V = base.copy()
        V[now.support] += np.einsum("vxy,vy->vx", turn, details[now.support])
        return V


@dataclass(frozen=True)
class _Current:
    """The triangles after the last move, and the places of their vertices at rest."""

    F: IntArray
    handle: NDArray[np.intp]  # in the order at rest
    fixed: NDArray[np.intp]
    support: BoolArray
    birth_face: IntArray
    birth_barycentric: FloatArray
    remeshed: int = 0


_Step = Callable[[_Current, FloatArray], FloatArray]


def _own_births(n: int, F: IntArray) -> tuple[IntArray, FloatArray]:
    """Births at the vertices of a mesh: a face and its corner; arbitrary for vertices without a face."""
    face, corner = np.zeros(n, np.int64), np.zeros(n, np.int64)
    for c in range(3):
        face[F[:, c]] = np.arange(len(F))
        corner[F[:, c]] = c
    return face, np.eye(3)[corner]


def _smallest_angles(T: FloatArray) -> FloatArray:
    """Smallest angle in degrees of triangles (m, 3, 3)."""
    squared = ((T - np.roll(T, 1, axis=1)) ** 2).sum(axis=2)
    a, b, c = np.sort(squared, axis=1).T
    cosine = (b + c - a) / (2.0 * np.sqrt(np.maximum(b * c, np.finfo(float).tiny)))
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
