"""Project vertices onto the reference surface, and say where on it they lie.

Inner vertices go to the closest point of the surface, found from the face of the last time; boundary
vertices to the closest point of their own stretch of the boundary, so that a border does not shrink
and its vertices do not leave it; fixed vertices stay.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange

from .._jit import driver
from .._types import BOUNDARY, DEAD, INNER, NONE, Blocks, FloatArray, IndexArray, Mesh, Tree
from ..boundary import closest_on_boundary
from ..bvh import STACK, closest_face, point_on_face
from ..halfedge import following

__all__ = ["Reference", "locate_vertices", "project_boundary", "project_vertices"]


class Reference(NamedTuple):
    """The input surface: what vertices are projected onto and born on."""

    tree: Tree
    X: FloatArray  # (n, 4)
    origin: IndexArray  # (3 m,)
    links: IndexArray  # (2, 3 m), see `boundary.link_boundary`


def project_vertices(
    mesh: Mesh, blocks: Blocks, reference: Reference, trust: float, parallel: bool
) -> None:
    """Move inner and boundary vertices to the closest points of the reference surface.

    Inner vertices walk there from where they were the last time; the whole surface is searched for
    those that end farther than ``trust`` from it.
    """
    _project_inner(parallel, mesh, blocks, reference.tree, trust * trust, mesh.X, mesh.birth)
    project_boundary(mesh, blocks, reference, parallel)


def project_boundary(mesh: Mesh, blocks: Blocks, reference: Reference, parallel: bool) -> None:
    """Move boundary vertices only: they slide in every sweep, the others drift for some."""
    if reference.links.shape[1]:
        _project_boundary(parallel, mesh, blocks, *reference[1:], mesh.X, mesh.birth)


def locate_vertices(
    mesh: Mesh, blocks: Blocks, reference: Reference, trust: float, parallel: bool
) -> FloatArray:
    """Find where every vertex lies without moving it; sets ``mesh.birth``.

    ``trust`` as in `project_vertices`: inf for vertices that were just projected.

    Returns
    -------
    barycentric : (n, 3) float64
        Weights of the corners of the face of ``mesh.birth``: the point of the reference closest to
        the vertex.
    """
    barycentric = np.zeros((mesh.vertex_halfedge.size, 3))
    _locate(parallel, mesh, blocks, *reference, trust * trust, mesh.birth, barycentric)
    return barycentric


@driver
def _project_inner(mesh, blocks, tree, trust, X, birth):
    for k in prange(blocks.vertex.size - 1):
        stack = np.empty((2, STACK), np.int64)
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != INNER:
                continue
            hint = np.int64(birth[v]) // 3
            f, s, t, _ = closest_face(tree, X[v, 0], X[v, 1], X[v, 2], hint, trust, stack)
            birth[v] = 3 * f
            X[v, 0], X[v, 1], X[v, 2] = point_on_face(tree.corners, f, s, t)


@driver
def _project_boundary(mesh, blocks, X_in, origin, links, X, birth):
    for k in prange(blocks.vertex.size - 1):
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != BOUNDARY:
                continue
            h, s, _ = closest_on_boundary(
                X_in, origin, links, np.int64(birth[v]), X[v, 0], X[v, 1], X[v, 2]
            )
            birth[v] = h
            a = origin[h]
            b = origin[following(h)]
            for i in range(3):
                X[v, i] = X_in[a, i] + s * (X_in[b, i] - X_in[a, i])


@driver
def _locate(mesh, blocks, tree, X_in, origin, links, trust, birth, barycentric):
    for k in prange(blocks.vertex.size - 1):
        stack = np.empty((2, STACK), np.int64)
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD:
                continue
            x, y, z = mesh.X[v, 0], mesh.X[v, 1], mesh.X[v, 2]
            hint = np.int64(birth[v])
            if mesh.twin[mesh.vertex_halfedge[v]] != NONE:
                f, s, t, _ = closest_face(tree, x, y, z, hint // 3, trust, stack)
                birth[v] = 3 * f
                barycentric[v, 0] = 1.0 - s - t
                barycentric[v, 1] = s
                barycentric[v, 2] = t
                continue
            h, s, _ = closest_on_boundary(X_in, origin, links, hint, x, y, z)
            birth[v] = h
            corner = h - 3 * (h // 3)
            barycentric[v, corner] = 1.0 - s
            barycentric[v, (corner + 1) % 3] = s
