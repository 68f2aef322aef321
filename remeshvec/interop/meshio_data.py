"""Meshes of meshio: blocks of cells, with data per block."""

from __future__ import annotations

import warnings
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import IntArray
from ..errors import MeshInputError
from ..mesh.polygons import fan_triangles
from .mesh_data import Data, MeshData

__all__ = ["is_meshio", "read_meshio", "write_meshio"]

# Cells that make up surfaces, and cells that may lie on them and are left out.
_FACE_CELLS = ("triangle", "quad", "polygon")
_LOWER = ("vertex", "line")

# Names of cell data in which programs number the parts of a mesh.
GROUPS = ("gmsh:physical", "gmsh:geometrical", "medit:ref", "cell_tags", "group", "material")

_BLOCK, _SET = "meshio:block", "meshio:set:"


def is_meshio(value: Any) -> bool:
    """Recognise a ``meshio.Mesh`` by its attributes."""
    return all(hasattr(value, name) for name in ("points", "cells", "point_data", "cell_data"))


def read_meshio(mesh: Any) -> MeshData:
    """Read a ``meshio.Mesh`` of triangles, quadrilaterals or polygons, in the plane or in space.

    Cell data, cell sets and blocks become data on faces. Blocks, sets, and groups under the names that
    mesh generators use are feature data: their borders are kept.
    """
    blocks = [(i, block) for i, block in enumerate(mesh.cells) if block.type in _FACE_CELLS]
    _check_blocks(mesh, blocks)
    F, cell, source = [], [], []
    for i, block in blocks:
        faces, of = _triangles(block.data)
        F.append(faces)
        cell.append(of)
        source.append(np.full(len(faces), i))
    on_faces: Data = {}
    for name, values in mesh.cell_data.items():
        parts = [np.asarray(values[i])[of] for (i, _), of in zip(blocks, cell, strict=True)]
        on_faces[name] = np.concatenate(parts)
    for name, members in mesh.cell_sets.items():
        parts = [np.isin(of, members[i]) for (i, _), of in zip(blocks, cell, strict=True)]
        on_faces[_SET + name] = np.concatenate(parts)
    if len(blocks) > 1:
        on_faces[_BLOCK] = np.concatenate(source)
    V = np.asarray(mesh.points)
    is_plane = V.ndim == 2 and V.shape[1] == 2
    if is_plane:
        V = np.column_stack([V, np.zeros(len(V), V.dtype)])
    feature_data = [name for name in on_faces if name in (*GROUPS, _BLOCK) or name.startswith(_SET)]
    on_points = {name: np.asarray(values) for name, values in mesh.point_data.items()}
    return MeshData(
        V, np.concatenate(F), on_points, on_faces, {}, tuple(feature_data), (),
        partial(_to_meshio, mesh, is_plane),
    )  # fmt: skip


def _check_blocks(mesh: Any, blocks: list[Any]) -> None:
    kinds = {block.type for block in mesh.cells}
    solid = kinds - {*_FACE_CELLS, *_LOWER}
    if solid or not blocks:
        raise MeshInputError(
            f"the meshio mesh has cells of type {', '.join(sorted(kinds)) or '(none)'}; a surface of "
            "triangles, quads or polygons is needed, such as the boundary of a solid"
        )
    left_out = [*(kinds & set(_LOWER)), *(["point sets"] if mesh.point_sets else [])]
    if left_out:
        warnings.warn(
            f"{', '.join(sorted(left_out))} are not remeshed and are left out", stacklevel=6
        )


def _triangles(cells: Any) -> tuple[IntArray, IntArray]:
    """Cut the cells of a block into triangles; returns also the cell of each."""
    if isinstance(cells, np.ndarray) and cells.ndim == 2:
        corners, sizes = cells.ravel(), np.full(len(cells), cells.shape[1])
    else:
        corners = np.concatenate([*cells]) if len(cells) else np.empty(0, np.int64)
        sizes = np.array([len(cell) for cell in cells], np.int64)
    if corners.dtype.kind not in "iu":
        raise MeshInputError(f"cells of meshio must hold integers; got dtype {corners.dtype}")
    return fan_triangles(corners, sizes)


def _to_meshio(mesh: Any, is_plane: bool, data: MeshData) -> Any:
    return write_meshio(type(mesh), data, is_plane, dict(mesh.field_data))


def write_meshio(
    mesh_type: Any, data: MeshData, is_plane: bool = False, field_data: Any = None
) -> Any:
    """Make a ``meshio.Mesh``, with the blocks and sets that `read_meshio` turned into data."""
    F, on_faces = data.F, dict(data.on_faces)
    block = on_faces.pop(_BLOCK, np.zeros(len(F), np.int64))
    members = [np.flatnonzero(block == b) for b in np.unique(block)]
    sets = _sets(on_faces, members)
    return mesh_type(
        data.V[:, :2] if is_plane else data.V,
        [("triangle", F[rows]) for rows in members],
        point_data=data.on_vertices,
        cell_data={name: [x[rows] for rows in members] for name, x in on_faces.items()},
        field_data=field_data,
        cell_sets=sets,
    )


def _sets(on_faces: Data, members: list[NDArray[Any]]) -> dict[str, list[NDArray[Any]]]:
    sets = {}
    for name in [name for name in on_faces if name.startswith(_SET)]:
        mask = on_faces.pop(name)
        sets[name.removeprefix(_SET)] = [np.flatnonzero(mask[rows]) for rows in members]
    return sets
