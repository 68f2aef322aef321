"""The guard for PLY files: which way a file may take, or why it may not.

libigl reads a binary file safely when its faces all have the same number of corners, the bytes are
all there, and there is nothing else: on faces of several sizes or columns beside the mesh it aborts the
process, of a file that is cut short it returns memory that was never written. So it gets a copy that
holds the mesh alone. An ASCII file with the usual columns goes the way of OFF. Everything else needs
plyfile, which is pure Python and slower by far, but reads it all.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from .guards import MeshCopy, check_room, off_copy, text_lines

__all__ = ["PlyHeader", "check_ply", "parse_header"]

MAX_HEADER_BYTES = 1 << 20
MAX_UNIFORM_CORNERS = 1000  # more is no mesh but a misread length
BYTE_ORDER = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
DTYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
}
INDEX_LISTS = ("vertex_indices", "vertex_index")


class Property(NamedTuple):
    """One column; `length` is the dtype of a list's length, None for a scalar."""

    name: str
    dtype: str
    length: str | None


class Element(NamedTuple):
    """One table of the file."""

    name: str
    rows: int
    properties: list[Property]

    @property
    def least_bytes(self) -> int:
        """Bytes of a row in a binary file whose lists are all empty."""
        return sum(np.dtype(p.length or p.dtype).itemsize for p in self.properties)


class PlyHeader(NamedTuple):
    """The header: format, tables, and where the body starts."""

    format: str
    elements: list[Element]
    start: int

    def element(self, name: str) -> Element:
        """Return the table of this name, which must be there."""
        for element in self.elements:
            if element.name == name:
                return element
        raise ValueError(f"the header names no element {name!r}")


def check_ply(data: bytes) -> MeshCopy | None:
    """Return the copy that libigl may read, or None where only plyfile can read the file.

    Raises
    ------
    ValueError
        The header cannot be understood, lacks vertices or faces, or promises more than the file
        can hold; or a line of an ASCII file is wrong.
    """
    header = parse_header(data)
    _check_tables(header)
    if header.format == "ascii":
        lines = text_lines(data[header.start :])
        check_room(sum(element.rows for element in header.elements), len(lines), "lines")
        n, m = header.element("vertex").rows, header.element("face").rows
        return off_copy(lines, n, m) if _has_body_of_off(header) else None
    least = sum(element.rows * element.least_bytes for element in header.elements)
    check_room(least, len(data) - header.start, "bytes")
    tables = _uniform_tables(data, header)
    if tables is None:
        return None
    return MeshCopy(_plain_ply(header, *tables), ".ply", header.element("face").rows)


def parse_header(data: bytes) -> PlyHeader:
    """Read the header, which is text in every PLY file."""
    end = re.search(rb"^end_header[ \t]*\r?\n", data[:MAX_HEADER_BYTES], re.MULTILINE)
    if end is None:
        raise ValueError("the header has no end: the file is cut short, or not PLY")
    form, elements = "", []
    for line in data[: end.start()].decode("latin-1").splitlines()[1:]:
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                continue
            case ["format", str(name), _] if name in BYTE_ORDER:
                form = name
            case ["element", name, rows] if re.fullmatch(r"\d{1,18}", rows):
                elements.append(Element(name, int(rows), []))
            case ["property", "list", count, kind, name] if elements and _is_length(count, kind):
                elements[-1].properties.append(Property(name, DTYPES[kind], DTYPES[count]))
            case ["property", kind, name] if elements and kind in DTYPES:
                elements[-1].properties.append(Property(name, DTYPES[kind], None))
            case _:
                raise ValueError(f"the header has a line that is not PLY: {line[:60]!r}")
    if not form:
        raise ValueError("the header does not say whether the file is ASCII or binary")
    return PlyHeader(form, elements, end.end())


def _is_length(count: str, kind: str) -> bool:
    return DTYPES.get(count, "f")[0] in "iu" and kind in DTYPES


def _check_tables(header: PlyHeader) -> None:
    names = [element.name for element in header.elements]
    if len(set(names)) < len(names):
        raise ValueError("the header names an element twice")
    columns = {p.name for p in header.element("vertex").properties if p.length is None}
    if not {"x", "y", "z"} <= columns:
        raise ValueError("its vertices lack x, y or z")
    lists = {p.name for p in header.element("face").properties if p.length is not None}
    if not lists.intersection(INDEX_LISTS):
        raise ValueError("its faces lack the list 'vertex_indices'")


def _has_body_of_off(header: PlyHeader) -> bool:
    """Whether x, y, z and the list of indices come first in the first two tables."""
    if [element.name for element in header.elements[:2]] != ["vertex", "face"]:
        return False
    vertex, face = header.elements[:2]
    scalars = [p.name for p in vertex.properties[:3] if p.length is None]
    return scalars == ["x", "y", "z"] and face.properties[0].name in INDEX_LISTS


def _uniform_tables(data: bytes, header: PlyHeader) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the rows of vertices and faces, if all are there, and of types that libigl knows."""
    position, tables = header.start, {}
    for element in header.elements:
        row = _row_dtype(data, header.format, element, position)
        if row is None or position + element.rows * row.itemsize > len(data):
            return None
        table = np.frombuffer(data, row, element.rows, position)
        if row.names and "length" in row.names and element.rows:
            lengths = table["length"]
            if lengths[0] < 3 or (lengths != lengths[0]).any():
                return None
        tables[element.name] = table
        position += element.rows * row.itemsize
    points = [p.dtype for p in header.element("vertex").properties if p.name in ("x", "y", "z")]
    is_known = points in (["f4"] * 3, ["f8"] * 3)
    return (tables["vertex"], tables["face"]) if is_known else None


def _plain_ply(header: PlyHeader, vertex: np.ndarray, face: np.ndarray) -> bytes:
    """Write vertices and corners of faces alone."""
    columns = [p.name for p in header.element("vertex").properties]
    points = np.stack([vertex[f"scalar{columns.index(axis)}"] for axis in "xyz"], axis=1)
    corners = face["corners"].reshape(len(face), -1)
    rows = np.empty(len(face), [("length", "<u2"), ("corners", "<i4", corners.shape[1:])])
    rows["length"], rows["corners"] = corners.shape[1], corners
    kind = "float" if points.dtype.itemsize == 4 else "double"
    text = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
        + "".join(f"property {kind} {axis}\n" for axis in "xyz")
        + f"element face {len(face)}\nproperty list ushort int vertex_indices\nend_header\n"
    )
    return text.encode() + points.astype(f"<f{points.dtype.itemsize}").tobytes() + rows.tobytes()


def _row_dtype(data: bytes, form: str, element: Element, position: int) -> np.dtype | None:
    """Return the layout of a table's rows, taking the first row's list for all; None if unknown."""
    order, fields = BYTE_ORDER[form], []
    lists = [p for p in element.properties if p.length is not None]
    if lists and (element.name != "face" or len(lists) > 1 or lists[0].dtype not in ("i4", "u4")):
        return None
    for k, column in enumerate(element.properties):
        if column.length is None:
            fields.append((f"scalar{k}", order + column.dtype))
            continue
        length = np.dtype(order + column.length)
        at = position + sum(np.dtype(kind[1]).itemsize for kind in fields)
        corners = int(np.frombuffer(data, length, 1, at)[0]) if element.rows else 3
        if not 3 <= corners <= MAX_UNIFORM_CORNERS:
            return None
        fields += [("length", order + column.length), ("corners", f"({corners},){order}i4")]
    return np.dtype(fields)
