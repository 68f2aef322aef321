"""PLY files: ASCII and binary of both byte orders, with any properties of vertices and faces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..interop.mesh_data import Data, MeshData, with_data_at_vertices, with_uv_at_corners
from ..mesh.polygons import fan_triangles
from .ply_header import TYPE_NAMES, parse_header
from .ply_materials import read_materials, written_materials
from .ply_tables import PlyTable, read_tables
from .polygon_mesh import PolygonMesh, Triangles
from .text import floats, shown

__all__ = ["PlyFile", "ply_bytes"]

# Names of vectors, and of their components in PLY files.
_VECTORS: dict[str, list[tuple[str, ...]]] = {
    "color": [("red", "green", "blue", "alpha"), ("red", "green", "blue")],
    "normal": [("nx", "ny", "nz")],
    "uv": [("s", "t"), ("u", "v"), ("texture_u", "texture_v")],
}
_INDEX_LISTS = ("vertex_indices", "vertex_index")
_FEATURES = ("uv", "texnumber", "material_index", "material")
_AT_VERTICES = "uv at vertices"  # so that a file gets its texture coordinates where they were


class PlyFile:
    """The tables of vertices and faces in a PLY file.

    Raises
    ------
    ValueError
        The header is not valid, lacks vertices or faces, or promises more than the file holds; or a row
        does not match the header.
    """

    def __init__(self, content: bytes) -> None:
        self._header = parse_header(content)
        scalars = {p.name for p in self._header.element("vertex").properties if p.length is None}
        if not {"x", "y", "z"} <= scalars:
            raise ValueError("its vertices lack x, y or z")
        lists = {p.name for p in self._header.element("face").properties if p.length is not None}
        names = [name for name in _INDEX_LISTS if name in lists]
        if not names:
            raise ValueError("its faces lack the list 'vertex_indices'")
        tables = read_tables(content, self._header)
        self._vertices, self._faces = tables["vertex"], tables["face"]
        self._indices = names[0]

    def mesh(self) -> PolygonMesh:
        """Return the vertices and polygons."""
        axes = [_as_numbers(self._vertices.scalars[axis], axis) for axis in "xyz"]
        indices, sizes = self._faces.lists[self._indices]
        return PolygonMesh(
            _cast(np.stack(axes, axis=1), np.float64, "x, y, z"),
            _cast(_as_numbers(indices, self._indices), np.int64, self._indices),
            sizes,
            [],
        )

    def data(self, V: NDArray[Any], triangles: Triangles, folder: Path) -> MeshData:
        """Return the mesh with all other properties of its vertices and faces.

        Parameters
        ----------
        V : (n, 3)
        triangles : Triangles
            The polygons, cut.
        folder : Path
            Folder that names of images and material libraries are relative to.

        Raises
        ------
        ValueError
            A value does not have the type that the header states.
        """
        data = MeshData(V, triangles.F)
        vertex = self._columns("vertex", self._vertices)
        _join_vectors(vertex, data.on_vertices, data.extra)
        _join_vectors(self._columns("face", self._faces), data.on_faces, {})
        data.on_faces = {name: x[triangles.polygon] for name, x in data.on_faces.items()}
        uv = self._texture_coordinates()
        if uv is not None:
            data.on_corners["uv"] = uv
        elif "uv" in data.on_vertices:
            data = with_uv_at_corners(data, "uv")
            data.extra[_AT_VERTICES] = True
        if data.on_vertices or data.on_faces or data.on_corners:
            read_materials(data, self._header.comments, folder)
        names = [*data.on_vertices, *data.on_faces, *data.on_corners]
        data.feature_data = tuple(name for name in _FEATURES if name in names)
        data.directions = ("normal",) if "normal" in data.on_vertices else ()
        return data

    def _columns(self, element: str, table: PlyTable) -> Data:
        """Return the columns of a table except coordinates, in the types of the header."""
        return {
            p.name: _cast(_as_numbers(table.scalars[p.name], p.name), p.dtype, p.name)
            for p in self._header.element(element).properties
            if p.name in table.scalars and p.name not in ("x", "y", "z")
        }

    def _texture_coordinates(self) -> NDArray[np.float64] | None:
        """Return texture coordinates (t, 3, 2) of triangles, None unless all corners have them."""
        values, counts = self._faces.lists.get("texcoord", ((), ()))
        sizes = self._faces.lists[self._indices][1]
        if not np.array_equal(counts, 2 * sizes):
            return None
        uv = _cast(_as_numbers(values, "texcoord"), np.float64, "texcoord").reshape(-1, 2)
        return uv[fan_triangles(np.arange(len(uv)), sizes)[0]]


def _as_numbers(values: Any, name: str) -> NDArray[Any]:
    """Return a column as numbers, NaN and infinity among them."""
    if not isinstance(values, list):
        return np.asarray(values)
    numbers = floats(b" ".join(values))
    return np.array([_number(word, name) for word in values]) if numbers is None else numbers


def _number(word: bytes, name: str) -> float:
    try:
        return float(word.replace(b"_", b"?"))  # Python takes 1_000 for a number
    except ValueError:
        raise ValueError(f"{shown(word)} in the column {name!r} is not a number") from None


def _cast(values: NDArray[Any], dtype: Any, name: str) -> NDArray[Any]:
    """Return values in the type that the header states; integers must fit it."""
    kind = np.dtype(dtype)
    with np.errstate(invalid="ignore", over="ignore"):  # some NaN warn when they are cast
        cast = values.astype(kind, copy=False)
    if kind.kind in "iu" and not np.array_equal(cast, values):
        raise ValueError(f"the column {name!r} holds values that are not integers of its type")
    return cast


def _join_vectors(columns: Data, into: Data, extra: dict[str, Any]) -> None:
    """Join the components of vectors into one array each, and note their names."""
    rest = dict(columns)
    for name, choices in _VECTORS.items():
        for choice in choices:
            if set(choice) <= set(rest):
                into[name] = np.stack([rest.pop(column) for column in choice], axis=1)
                extra[f"columns:{name}"] = choice
                break
    into |= rest


def ply_bytes(data: MeshData, path: Path) -> bytes:
    """Write a binary file: a mesh, all data on vertices and faces, texture coordinates on corners."""
    if _AT_VERTICES in data.extra:
        data = with_data_at_vertices(data)
    comments, on_faces = written_materials(data, path)
    vertex = {axis: data.V[:, i] for i, axis in enumerate("xyz")}
    vertex |= _scalars(data.on_vertices, data.extra)
    lists = {"vertex_indices": data.F.astype(np.int32)}
    if "uv" in data.on_corners:
        lists["texcoord"] = data.on_corners["uv"].reshape(len(data.F), 6).astype(np.float64)
    tables = [
        _written("vertex", vertex, {}, len(data.V)),
        _written("face", _scalars(on_faces, {}), lists, len(data.F)),
    ]
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += [f"comment {line}" for line in comments]
    header = "\n".join([*lines, *(line for head, _ in tables for line in head), "end_header\n"])
    return header.encode() + b"".join(rows for _, rows in tables)


def _written(name: str, scalars: Data, lists: Data, count: int) -> tuple[list[str], bytes]:
    """Return the lines of the header and the rows of a table, lists first."""
    head, fields = [f"element {name} {count}"], []
    for column, values in lists.items():
        head.append(f"property list uchar {TYPE_NAMES[values.dtype.str[1:]]} {column}")
        kind = values.dtype.newbyteorder("<")
        fields += [(f"length of {column}", "u1"), (column, kind, values.shape[1:])]
    for column, values in scalars.items():
        if len(column.split()) != 1:
            raise ValueError(f"PLY cannot hold a column named {column!r}: a blank ends the name")
        head.append(f"property {TYPE_NAMES[values.dtype.str[1:]]} {column}")
        fields.append((column, values.dtype.newbyteorder("<")))
    rows = np.empty(count, fields)
    for column, values in lists.items():
        rows[f"length of {column}"] = values.shape[1]
    for column, values in {**lists, **scalars}.items():
        rows[column] = values
    return head, rows.tobytes()


def _scalars(data: Data, extra: dict[str, Any]) -> Data:
    """Return data as columns of scalars."""
    columns: Data = {}
    for name, values in data.items():
        values = _storable(values, name)
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


def _storable(values: NDArray[Any], name: str) -> NDArray[Any]:
    """Return values in a type that PLY knows: no booleans, no integers beyond 32 bits."""
    if values.dtype.kind == "b":
        return values.astype(np.uint8)
    if values.dtype.kind in "iu" and values.dtype.itemsize == 8:
        low, high = (values.min(), values.max()) if values.size else (0, 0)
        return values.astype(np.float64 if low < -(2**31) or high >= 2**31 else np.int32)
    if values.dtype.str[1:] not in TYPE_NAMES:
        raise ValueError(f"PLY cannot hold values of type {values.dtype}, as {name!r} has")
    return values
