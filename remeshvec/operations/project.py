"""Project vertices onto the reference surface, and say where on it they lie."""

from __future__ import annotations

import numpy as np
from numba import prange

from .._jit import driver
from .._types import DEAD, INNER, Blocks, FloatArray, Mesh, Tree
from ..bvh import closest_face

__all__ = ["locate_vertices", "project_vertices"]


def project_vertices(mesh: Mesh, blocks: Blocks, tree: Tree, parallel: bool) -> None:
    """Move every inner vertex to the closest point of the reference surface."""
    _project(parallel, mesh, blocks, tree)


def locate_vertices(mesh: Mesh, blocks: Blocks, tree: Tree, parallel: bool) -> FloatArray:
    """Find the birth of every vertex without moving it.

    Returns
    -------
    barycentric : (n, 3) float64
        Weights of the corners of face ``mesh.birth[v]``, the point of the reference closest to v.
    """
    barycentric = np.empty((mesh.vertex_halfedge.size, 3))
    _locate(parallel, mesh, blocks, tree, barycentric)
    return barycentric


@driver
def _project(mesh, blocks, tree):  # type: ignore[no-untyped-def]
    for k in prange(blocks.vertex.size - 1):
        node = np.empty(64, np.int64)
        depth = np.empty(64, np.int64)
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD or mesh.kind[v] != INNER:
                continue
            f, s, t, _ = closest_face(
                tree, mesh.X[v, 0], mesh.X[v, 1], mesh.X[v, 2], mesh.birth[v], node, depth
            )
            mesh.birth[v] = f
            for i in range(3):
                a = tree.corners[f, i]
                mesh.X[v, i] = (
                    a + s * (tree.corners[f, 3 + i] - a) + t * (tree.corners[f, 6 + i] - a)
                )


@driver
def _locate(mesh, blocks, tree, barycentric):  # type: ignore[no-untyped-def]
    for k in prange(blocks.vertex.size - 1):
        node = np.empty(64, np.int64)
        depth = np.empty(64, np.int64)
        for v in range(blocks.vertex[k], blocks.vertex[k + 1]):
            if mesh.vertex_halfedge[v] == DEAD:
                continue
            f, s, t, _ = closest_face(
                tree, mesh.X[v, 0], mesh.X[v, 1], mesh.X[v, 2], mesh.birth[v], node, depth
            )
            mesh.birth[v] = f
            barycentric[v, 0] = 1.0 - s - t
            barycentric[v, 1] = s
            barycentric[v, 2] = t
