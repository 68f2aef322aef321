"""Round 0: the input as files that every task can read a piece of, with all that is decided once.

The input is prepared, and its creases, curves, corners, tips and target lengths are found, by the same
code as in `remesh`, on the whole surface at once. So no part decides differently from another. This is
the one step that needs memory for the whole input.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import FIXED, HELD, FloatArray, IndexArray, Mesh
from ..errors import OptionError
from ..input.constraints import Constraints
from ..input.prepare import Prepared
from ..pipeline.job import Job
from ..reference.build import FeaturedReference
from .scratch import load, remove, save_arrays
from .vocabulary import SurfaceMesh, save_mesh

__all__ = ["CELL", "Index", "boxes_of", "load_index", "write_index"]

# Faces of the reference in a cell, the unit in which pieces of it are chosen. Cells are runs along the
# Morton curve, about 32 edges across.
CELL = 1024


class Index(NamedTuple):
    """The reference of the whole surface, in files.

    Parameters
    ----------
    X : (n, 4) float64
        Vertices in the frame of the prepared input, and target lengths.
    origin, twin : (3 m,) int32
        ``twin`` is ``NONE`` on curves.
    cells : (k, 6) float64
        Lower and upper corners of the boxes around `CELL` faces each.
    names : (j,) int32
        Half-edges that name the edges of curves, in ascending order.
    neighbours : (2, j) int32
        See `polyline.join_edges`, at the names only.
    arcs : (3, j) float64
        See `polyline.measure_arcs`, likewise.
    tips : (t, 3) float64
        Places of the tips.
    spare_valence : (t,) int32
        What is added to their valence.
    face_source : (m,) int
        Face of the input.
    flipped : (m,) bool, or (0,)
        Whether corners 1 and 2 of the input face were swapped.
    cut_row : (m,) int32, or (0,)
    cut_weights : (c, 3, 3) float64
        See `FaceCuts`.
    labels : (m,), or (0,)
        Labels of the faces.
    fixed : (f,) int32
        Half-edges of the reference that leave fixed vertices.
    fixed_points : (f, 3) float64
        Where the caller has these vertices.
    """

    X: FloatArray
    origin: IndexArray
    twin: IndexArray
    cells: FloatArray
    names: IndexArray
    neighbours: IndexArray
    arcs: FloatArray
    tips: FloatArray
    spare_valence: IndexArray
    face_source: NDArray[Any]
    flipped: NDArray[np.bool_]
    cut_row: IndexArray
    cut_weights: FloatArray
    labels: NDArray[Any]
    fixed: IndexArray
    fixed_points: FloatArray


def load_index(folder: Path) -> Index:
    """Map the reference of a folder."""
    return Index(**load(folder, *Index._fields))


def write_index(job: Job, constraints: Constraints, index_folder: Path, mesh_folder: Path) -> None:
    """Mark the features of a prepared mesh; write it, and the reference that it is remeshed on.

    Raises
    ------
    OptionError
        The surface has non-manifold edges.
    """
    mesh, prepared = job.prepared.mesh, job.prepared
    bare = mesh.valence_excess.copy()
    featured, length = job.build_reference(mesh, job.sizing.L)
    if featured.on_non_manifold is not None:
        raise OptionError(
            "the surface has edges with three faces or more, or with two that run it in the same "
            "direction; remesh_large keeps them only where the surface is one part: raise "
            "part_faces, or call remesh"
        )
    remove(mesh_folder)  # a call may have ended between the two folders
    save_mesh(
        mesh_folder,
        SurfaceMesh(
            mesh.origin.reshape(-1, 3),
            mesh.X,
            mesh.kind,
            mesh.birth,
            mesh.curve.reshape(-1, 3),
            mesh.source,
        ),
    )
    index = _index(mesh, mesh.valence_excess - bare, prepared, featured, constraints, job.V)
    size = {
        "length": length / prepared.scale,
        "scale": prepared.scale,
        "centre": prepared.centre.tolist(),
        "area": job.size.area,
        "faces": len(prepared.mesh.source),
        "dirt": prepared.dirt,
        "features": featured.counts,
    }
    save_arrays(index_folder, index._asdict(), size)


def _index(
    mesh: Mesh,
    spare_valence: IndexArray,
    prepared: Prepared,
    featured: FeaturedReference,
    constraints: Constraints,
    V: FloatArray,
) -> Index:
    reference, nothing = featured.reference, np.empty(0, np.int32)
    has_curves = reference.curve_neighbours.shape[1] > 0
    names = np.unique(featured.names).astype(np.int32)
    tips = np.flatnonzero(spare_valence * (mesh.kind == HELD))
    fixed = np.flatnonzero(mesh.kind == FIXED)
    cuts, source = prepared.cuts, prepared.face_source
    return Index(
        X=reference.X,
        origin=reference.origin,
        twin=reference.surface.twin,
        cells=boxes_of(reference.X, reference.origin.reshape(-1, 3), CELL),
        names=names,
        neighbours=reference.curve_neighbours[:, reference.curve_row[names]]
        if has_curves
        else np.empty((2, 0), np.int32),
        arcs=reference.arcs[:, reference.curve_row[names]] if has_curves else np.empty((3, 0)),
        tips=mesh.X[tips, :3],
        spare_valence=spare_valence[tips],
        face_source=source,
        flipped=np.empty(0, np.bool_) if prepared.flipped is None else prepared.flipped[source],
        cut_row=nothing if cuts is None else cuts.row,
        cut_weights=np.empty((0, 3, 3)) if cuts is None else cuts.weights,
        labels=nothing if constraints.labels is None else constraints.labels[source],
        fixed=mesh.birth[fixed],
        fixed_points=V[prepared.vertex_source[fixed]],
    )


def boxes_of(X: FloatArray, F: IndexArray, size: int) -> FloatArray:
    """Boxes (k, 6) around so many faces each, in their order."""
    starts = np.arange(0, len(F), size)
    boxes = np.empty((len(starts), 6))
    for k, start in enumerate(starts.tolist()):
        points = X[F[start : start + size].ravel(), :3]
        boxes[k, :3], boxes[k, 3:] = points.min(axis=0), points.max(axis=0)
    return boxes
