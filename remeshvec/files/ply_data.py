"""What PLY files hold besides vertices and faces: any properties of vertices and faces, with plyfile."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..interop.mesh_data import Data, MeshData

__all__ = ["ply_bytes", "read_ply_data"]

# Properties that belong together, in the order of their names: what they go by here.
_COLOURS = [("red", "green", "blue", "alpha"), ("red", "green", "blue")]
_VECTORS: dict[str, list[tuple[str, ...]]] = {
    "color": _COLOURS,
    "normal": [("nx", "ny", "nz")],
    "uv": [("s", "t"), ("u", "v"), ("texture_u", "texture_v")],
}
_INDICES = ("vertex_indices", "vertex_index")


def read_ply_data(content: bytes, V: NDArray[Any], F: NDArray[Any]) -> MeshData | None:
    """Read all properties of a PLY file whose triangles are known; None where there are no others.

    Polygons of more corners are cut already: their data are left to the caller to miss.
    """
    from plyfile import PlyData

    tables = PlyData.read(io.BytesIO(content), mmap=False)
    vertex, face = tables["vertex"].data, tables["face"]
    data = MeshData(V, F)
    names = [name for name in vertex.dtype.names if name not in ("x", "y", "z")]
    _read_table(vertex, names, data.on_vertices, data.extra)
    lists = {p.name for p in face.properties if hasattr(p, "len_dtype")}
    if len(face.data) == len(F):
        names = [name for name in face.data.dtype.names if name not in lists]
        _read_table(face.data, names, data.on_faces, {})
        if "texcoord" in lists:
            rows = [np.asarray(row) for row in face["texcoord"]]
            if all(len(row) == 6 for row in rows):
                data.on_corners["uv"] = np.array(rows, dtype=float).reshape(-1, 3, 2)
    found = [*data.on_vertices, *data.on_faces, *data.on_corners]
    if not found:
        return None
    data.feature_data = tuple(
        name for name in ("uv", "texnumber", "material_index") if name in found
    )
    data.directions = ("normal",) if "normal" in data.on_vertices else ()
    data.extra["comments"] = list(tables.comments)
    return data


def _read_table(table: NDArray[Any], names: list[str], into: Data, extra: dict[str, Any]) -> None:
    rest = list(names)
    for name, choices in _VECTORS.items():
        for columns in choices:
            if set(columns) <= set(rest):
                into[name] = np.stack([table[column] for column in columns], axis=1)
                extra[f"columns:{name}"] = columns
                rest = [column for column in rest if column not in columns]
                break
    for name in rest:
        if table.dtype[name].kind != "O":
            into[name] = np.ascontiguousarray(table[name])


def ply_bytes(data: MeshData) -> bytes:
    """Write a mesh with all data on vertices and faces, and texture coordinates on corners, binary."""
    from plyfile import PlyData, PlyElement

    vertex = {"x": data.V[:, 0], "y": data.V[:, 1], "z": data.V[:, 2]}
    vertex |= _columns(data.on_vertices, data.extra)
    face: Data = {"vertex_indices": data.F.astype(np.int32)}
    if "uv" in data.on_corners:
        face["texcoord"] = data.on_corners["uv"].reshape(len(data.F), 6).astype(np.float64)
    face |= _columns(data.on_faces, {})
    elements = []
    for name, columns in (("vertex", vertex), ("face", face)):
        kinds = [(k, x.dtype.newbyteorder("<"), x.shape[1:]) for k, x in columns.items()]
        table = np.empty(len(columns[next(iter(columns))]), dtype=kinds)
        for k, x in columns.items():
            table[k] = x
        elements.append(PlyElement.describe(table, name))
    buffer = io.BytesIO()
    comments = data.extra.get("comments", [])
    PlyData(elements, text=False, byte_order="<", comments=comments).write(buffer)
    return buffer.getvalue()


def _columns(data: Data, extra: dict[str, Any]) -> Data:
    """Columns of one number each."""
    columns: Data = {}
    for name, values in data.items():
        values = _storable(values)
        if values.ndim == 1:
            columns[name] = values
            continue
        flat = values.reshape(len(values), -1)
        names = extra.get(f"columns:{name}") or _property_names(name, flat.shape[1])
        columns |= {column: flat[:, i] for i, column in enumerate(names)}
    return columns


def _property_names(name: str, count: int) -> tuple[str, ...]:
    for choice in _VECTORS.get(name, []):
        if len(choice) == count:
            return choice
    return tuple(f"{name}_{i}" for i in range(count))


def _storable(values: NDArray[Any]) -> NDArray[Any]:
    """PLY knows whole numbers of up to 32 bits, and no truth values."""
    if values.dtype.kind == "b":
        return values.astype(np.uint8)
    if values.dtype.kind in "iu" and values.dtype.itemsize == 8:
        low, high = (values.min(), values.max()) if values.size else (0, 0)
        if low < -(2**31) or high >= 2**31:
            return values.astype(np.float64)
        return values.astype(np.int32)
    return values
