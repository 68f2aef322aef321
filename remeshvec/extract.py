"""From the last mesh to the caller's arrays: units, sheets welded, held faces first, maps and labels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._types import FIXED, FROZEN, NONE, FloatArray, Mesh
from .clean import weld_vertices
from .constraints import Constraints
from .halfedge import ends_of
from .prepare import Prepared
from .reference import Built
from .seams import seam_vertices

__all__ = ["Output", "extract"]

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Output:
    """The arrays of a `RemeshResult`, see there."""

    V: NDArray[Any]
    F: NDArray[Any]
    birth_face: IntArray
    birth_barycentric: FloatArray
    face_labels: NDArray[Any] | None
    vertex_map: IntArray
    face_map: IntArray
    feature_edges: IntArray
    corners: IntArray
    lengths: FloatArray


def extract(
    mesh: Mesh,
    barycentric: FloatArray,
    prepared: Prepared,
    built: Built,
    constraints: Constraints,
    V: FloatArray,
    n_faces: int,
) -> Output:
    """Turn a compact mesh into the caller's arrays.

    Parameters
    ----------
    mesh : Mesh
    barycentric : (n, 3) float64
        Where on the face of ``mesh.birth`` each vertex lies.
    prepared, built, constraints
    V : (n_in, 3) float64
        The caller's vertices: fixed ones are copied from there, bit for bit.
    n_faces : int
        Faces of the input.
    """
    reference = built.reference
    born_at = prepared.vertex_source[reference.origin[mesh.birth]]
    is_fixed = mesh.kind == FIXED
    points = mesh.X[:, :3] / prepared.scale + prepared.centre
    points[is_fixed] = V[born_at[is_fixed]]
    birth_face = prepared.face_source[mesh.birth // 3].astype(np.int64)
    barycentric = barycentric.copy()
    if prepared.flipped is not None:
        flipped = prepared.flipped[birth_face]
        barycentric[flipped] = barycentric[flipped][:, [0, 2, 1]]

    kept, new = _weld(mesh, built)
    F = new[mesh.origin.reshape(-1, 3)]
    source = prepared.face_source[mesh.source]
    if built.held is not None:
        held = built.held[mesh.source]
        if constraints.unselected is not None:
            first = constraints.unselected[source] & held
            order = np.lexsort((np.where(first, source, 0), ~first))
            F, source, held = F[order], source[order], held[order]
    face_map = np.full(n_faces, -1, np.int64)
    if built.held is not None:
        face_map[source[held]] = np.flatnonzero(held)
    vertex_map = np.full(len(V), -1, np.int64)
    vertex_map[born_at[is_fixed]] = new[is_fixed]
    if prepared.same is not None:
        vertex_map = vertex_map[prepared.same]
    return Output(
        points[kept],
        F,
        birth_face[kept],
        barycentric[kept],
        None if constraints.labels is None else constraints.labels[source],
        vertex_map,
        face_map,
        _feature_edges(mesh, built, new),
        np.unique(new[is_fixed]).astype(np.int64),
        mesh.X[kept, 3] / prepared.scale,
    )


def _weld(mesh: Mesh, built: Built) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Vertices that stay, and the new number of each: sheets share theirs again."""
    target = None
    if built.on_seam is not None:
        target = weld_vertices(mesh.X[:, :3], seam_vertices(mesh, built))
    if target is None:
        everything = np.arange(len(mesh.X))
        return everything, everything
    kept = np.flatnonzero(target == np.arange(len(target)))
    new = np.full(len(target), -1, np.int64)
    new[kept] = np.arange(len(kept))
    return kept, new[target]


def _feature_edges(mesh: Mesh, built: Built, new: NDArray[np.int64]) -> IntArray:
    """Edges on curves; of the frozen ones those that were features of the input."""
    h = np.flatnonzero((mesh.curve != NONE) & (mesh.twin < np.arange(len(mesh.twin))))
    ends = ends_of(mesh.origin, h)
    if (mesh.curve[h] == FROZEN).any():
        at = np.sort(built.reference.origin[mesh.birth[ends]].astype(np.int64), axis=0)
        is_feature = np.isin(at[0] * len(built.reference.X) + at[1], built.feature_keys)
        is_feature &= (mesh.kind[ends] == FIXED).all(axis=0)
        ends = ends[:, (mesh.curve[h] != FROZEN) | is_feature]
    if not ends.size:
        return np.empty((0, 2), np.int64)
    return np.unique(np.sort(new[ends], axis=0), axis=1).T.copy()
