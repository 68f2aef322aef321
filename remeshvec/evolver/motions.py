"""In which directions vertices move: along the normal of the surface, and across its lines.

Motions within the surface change neither its energy nor its volume, but for the shape of the triangles.
On lines where sheets meet, and on rims that no wire holds, every motion across the line does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.vocabulary import FloatArray, IntArray
from ..mesh.edges import count_edges
from .energies import double_area_vectors
from .problem import CapillaryProblem

__all__ = ["Motions", "find_motions"]


class Motions(NamedTuple):
    """The degrees of freedom of a surface: a vertex may have several."""

    vertex: IntArray  # (k,) ascending
    direction: FloatArray  # (k, 3) unit vectors, perpendicular where they share a vertex
    area: FloatArray  # (k,) a third of the faces around the vertex
    normal: FloatArray  # (n, 3) unit normals of all vertices

    def along(self, field: FloatArray) -> FloatArray:
        """Components (..., k) of vectors (..., n, 3) at the vertices."""
        return np.asarray((field[..., self.vertex, :] * self.direction).sum(axis=-1))

    def spread(self, amounts: FloatArray) -> FloatArray:
        """Vectors (n, 3) of motions by amounts (k,)."""
        moved = np.zeros_like(self.normal)
        np.add.at(moved, self.vertex, amounts[:, None] * self.direction)
        return moved

    @property
    def is_normal(self) -> bool:
        """Whether every vertex moves along its normal alone."""
        return bool((np.diff(self.vertex) > 0).all()) and np.array_equal(
            self.direction, self.normal[self.vertex]
        )


def find_motions(problem: CapillaryProblem) -> Motions:
    """List the motions of the free vertices that have faces of some area.

    One along the normal inside a sheet, two across a line, three where lines end or meet.
    """
    normal, area = _normals(problem)
    can_move = problem.free & (area > 0.0)
    lines, uses = count_edges(problem.F)
    lines = lines[uses != 2]
    ends = np.bincount(lines.ravel(), minlength=len(problem.V))
    inside = np.flatnonzero(can_move & (ends == 0))
    vertex, direction = [inside], [normal[inside]]
    passing = np.flatnonzero(can_move & (ends == 2))
    if len(passing):
        across = _across(_tangents(problem.V, lines)[passing])
        vertex += [passing, passing]
        direction += [across[:, 0], across[:, 1]]
    ending = np.flatnonzero(can_move & (ends != 0) & (ends != 2))
    for axis in np.eye(3):
        vertex.append(ending)
        direction.append(np.broadcast_to(axis, (len(ending), 3)))
    order = np.argsort(np.concatenate(vertex), kind="stable")
    found = np.concatenate(vertex)[order]
    return Motions(found, np.concatenate(direction)[order], area[found], normal)


def _tangents(V: FloatArray, lines: IntArray) -> FloatArray:
    """Return unit tangents (n, 3) where two edges meet, from one neighbour to the other."""
    # The first edge that names a vertex counts one way, the second the other way.
    sign = np.where(_is_first(lines), 1.0, -1.0)
    tangent = np.zeros_like(V)
    for i, j in ((0, 1), (1, 0)):
        np.add.at(tangent, lines[:, i], sign[:, [i]] * V[lines[:, j]])
    size = np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.asarray(tangent / np.maximum(size, np.finfo(float).tiny))


def _is_first(lines: IntArray) -> np.ndarray:
    """Whether an end of an edge (k, 2) is the first with its vertex."""
    _, first = np.unique(lines.ravel(), return_index=True)
    is_first = np.zeros(lines.size, np.bool_)
    is_first[first] = True
    return is_first.reshape(lines.shape)


def _across(tangent: FloatArray) -> FloatArray:
    """Two unit vectors (k, 2, 3) perpendicular to each tangent and to each other."""
    axis = np.eye(3)[np.abs(tangent).argmin(axis=1)]
    one = np.cross(tangent, axis)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return np.stack([one, np.cross(tangent, one)], axis=1)


def _normals(problem: CapillaryProblem) -> tuple[FloatArray, FloatArray]:
    """Return unit normals (n, 3) and areas (n,) of vertices, from the faces around them."""
    T = problem.V[problem.F]
    N = double_area_vectors(T) / 6.0
    index = problem.F.ravel()
    each = np.repeat(N, 3, axis=0)
    total = np.stack([np.bincount(index, each[:, c], len(problem.V)) for c in range(3)], axis=1)
    size = np.linalg.norm(total, axis=1)
    area = np.bincount(index, np.repeat(np.linalg.norm(N, axis=1), 3), len(problem.V))
    unit = total / np.maximum(size, np.finfo(float).tiny)[:, None]
    return np.asarray(unit), np.asarray(area, np.float64)
