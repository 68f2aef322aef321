"""The tables of PLY files, as text and binary.

A table is read as one array if the lists of all rows are as long as those of the first row.
Otherwise it is read row by row.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import IntArray
from .ply_header import BYTE_ORDER, Element, PlyHeader, Property
from .text import check_room, number_table, shown, text_lines

__all__ = ["PlyTable", "read_tables"]

_LONGEST_LIST = 1 << 20  # in the first row; a longer one is probably a misread length

# The values of each column, row after row, with their number per row; and where the table ends.
_Columns = tuple[list[tuple[Any, IntArray]], int]


class PlyTable(NamedTuple):
    """Columns by name. Values are arrays, or lists of words if not all words of a text are numbers.

    Parameters
    ----------
    scalars : dict
        One value per row.
    lists : dict of pairs
        The values of all rows, row after row, and their number per row.
    """

    scalars: dict[str, Any]
    lists: dict[str, tuple[Any, IntArray]]


def read_tables(data: bytes, header: PlyHeader) -> dict[str, PlyTable]:
    """Read the tables of vertices and faces; others are skipped.

    Raises
    ------
    ValueError
        The header promises more than the file holds, or a row does not match the header.
    """
    read = _text_tables if header.format == "ascii" else _binary_tables
    return read(data, header)


def _text_tables(data: bytes, header: PlyHeader) -> dict[str, PlyTable]:
    lines = text_lines(data[header.start :])
    check_room(sum(element.rows for element in header.elements), len(lines), "lines")
    tables, start = {}, 0
    for element in header.elements:
        if element.name in ("vertex", "face"):
            tables[element.name] = _text_table(lines[start : start + element.rows], element)
        start += element.rows
    return tables


def _text_table(lines: Sequence[bytes], element: Element) -> PlyTable:
    rows = number_table(lines)
    table = None if rows is None else _even_text(rows, element)
    return _walk_lines(lines, element) if table is None else table


def _even_text(rows: NDArray[Any], element: Element) -> PlyTable | None:
    """Split rows of numbers into columns; None unless all rows have lists of the same lengths."""
    table, at = PlyTable({}, {}), 0
    for column in element.properties:
        if at >= rows.shape[1]:
            return None
        values, at = rows[:, at], at + 1
        if column.length is None:
            table.scalars.setdefault(column.name, values)
            continue
        if not 0 <= values[0] <= rows.shape[1] - at or (values != int(values[0])).any():
            return None
        k = int(values[0])
        table.lists.setdefault(column.name, (rows[:, at : at + k].ravel(), np.full(len(rows), k)))
        at += k
    return table


def _walk_lines(lines: Sequence[bytes], element: Element) -> PlyTable:
    """Split rows into columns word by word."""
    columns: list[tuple[list[bytes], list[int]]] = [([], []) for _ in element.properties]
    for line in lines:
        words, at = line.split(), 0
        for column, (values, sizes) in zip(element.properties, columns, strict=True):
            k, at = (1, at) if column.length is None else (_list_length(words, at), at + 1)
            if k < 0 or at + k > len(words):
                raise ValueError(
                    f"{shown(line)} does not have the columns of the element {element.name!r}"
                )
            values += words[at : at + k]
            sizes.append(k)
            at += k
    return _by_name(element, [(values, np.array(sizes, np.int64)) for values, sizes in columns])


def _list_length(words: list[bytes], at: int) -> int:
    return int(words[at]) if at < len(words) and words[at].isdigit() else -1


def _by_name(element: Element, columns: Sequence[tuple[Any, IntArray]]) -> PlyTable:
    table = PlyTable({}, {})
    for column, (values, sizes) in zip(element.properties, columns, strict=True):
        if column.length is None:
            table.scalars.setdefault(column.name, values)
        else:
            table.lists.setdefault(column.name, (values, sizes))
    return table


def _binary_tables(data: bytes, header: PlyHeader) -> dict[str, PlyTable]:
    least = sum(element.rows * element.least_bytes for element in header.elements)
    check_room(least, len(data) - header.start, "bytes")
    order, position, tables = BYTE_ORDER[header.format], header.start, {}
    for element in header.elements:
        if not element.properties:
            continue
        even = _even_rows(data, element, order, position)
        columns, position = even or _walk_rows(data, element, order, position)
        tables[element.name] = _by_name(element, columns)
    return tables


def _first_row(data: bytes, element: Element, order: str, position: int) -> np.dtype[Any] | None:
    """Return the layout of a table's first row, None if the file is too short for it."""
    fields: list[Any] = []
    for i, column in enumerate(element.properties):
        if column.length is not None:
            length = np.dtype(order + column.length)
            at = position + np.dtype(fields).itemsize
            if at + length.itemsize > len(data):
                return None
            k = int(np.frombuffer(data, length, 1, at)[0]) if element.rows else 0
            if not 0 <= k <= _LONGEST_LIST:
                return None
            fields += [(f"length {i}", length), (f"values {i}", order + column.dtype, (k,))]
        else:
            fields.append((f"values {i}", order + column.dtype))
    return np.dtype(fields)


def _even_rows(data: bytes, element: Element, order: str, position: int) -> _Columns | None:
    """Return the columns of a table; None unless all rows have the layout of the first."""
    kind = _first_row(data, element, order, position)
    if kind is None or position + element.rows * kind.itemsize > len(data):
        return None
    rows = np.frombuffer(data, kind, element.rows, position)
    columns = []
    for i, column in enumerate(element.properties):
        values = rows[f"values {i}"]
        k = 1 if column.length is None else values.shape[1]
        if column.length is not None and (rows[f"length {i}"] != k).any():
            return None
        columns.append((_native(values).ravel(), np.full(len(rows), k)))
    return columns, position + rows.nbytes


def _walk_rows(data: bytes, element: Element, order: str, position: int) -> _Columns:
    """Read a table row by row."""
    kinds = [np.dtype(order + column.dtype) for column in element.properties]
    lengths = [_length_of(column, order) for column in element.properties]
    places: list[tuple[list[int], list[int]]] = [([], []) for _ in kinds]
    steps = [(k, d.itemsize, *place) for k, d, place in zip(lengths, kinds, places, strict=True)]
    try:
        for _ in range(element.rows):
            for length, size, starts, counts in steps:
                k = 1
                if length is not None:
                    (k,) = length.unpack_from(data, position)
                    position += length.size
                starts.append(position)
                counts.append(k)
                position += k * size
                if k < 0 or position > len(data):
                    raise struct.error
    except struct.error:
        raise ValueError(
            f"it is cut short within the element {element.name!r}, or a list has a wrong length"
        ) from None
    columns = [_gathered(data, kind, *place) for kind, place in zip(kinds, places, strict=True)]
    return columns, position


def _length_of(column: Property, order: str) -> struct.Struct | None:
    return None if column.length is None else struct.Struct(order + np.dtype(column.length).char)


def _gathered(
    data: bytes, kind: np.dtype[Any], starts: list[int], sizes: list[int]
) -> tuple[NDArray[Any], IntArray]:
    """Return the values of lists, or of single scalars, that start at these bytes."""
    size = np.array(sizes, np.int64)
    within = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
    at = np.repeat(np.array(starts, np.int64), size) + kind.itemsize * within
    spread = np.frombuffer(data, np.uint8)[at[:, None] + np.arange(kind.itemsize)]
    return _native(spread.view(kind).ravel()), size


def _native(values: NDArray[Any]) -> NDArray[Any]:
    """Return a copy in the byte order of this machine."""
    return values.astype(values.dtype.newbyteorder("="))
