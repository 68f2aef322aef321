"""The header of PLY files: their format, tables and columns."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

__all__ = ["BYTE_ORDER", "TYPE_NAMES", "Element", "PlyHeader", "Property", "parse_header"]

_MAX_BYTES = 1 << 20
BYTE_ORDER = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPE_NAMES = {
    "i1": "char",
    "u1": "uchar",
    "i2": "short",
    "u2": "ushort",
    "i4": "int",
    "u4": "uint",
    "f4": "float",
    "f8": "double",
}
_DTYPES = {name: dtype for dtype, name in TYPE_NAMES.items()} | {
    f"{word}{8 * int(dtype[1])}": dtype
    for dtype in TYPE_NAMES
    for word in [{"i": "int", "u": "uint", "f": "float"}[dtype[0]]]
}


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
    """Format, tables in the order of the file, comments, and where the body starts."""

    format: str
    elements: list[Element]
    comments: list[str]
    start: int

    def element(self, name: str) -> Element:
        """Return the table of this name, which must exist."""
        for element in self.elements:
            if element.name == name:
                return element
        raise ValueError(f"the header does not name an element {name!r}")


def parse_header(data: bytes) -> PlyHeader:
    """Read the header, which is text in every PLY file.

    Raises
    ------
    ValueError
        A line is not valid, or the end is missing.
    """
    end = re.search(rb"^end_header[ \t]*\r?\n", data[:_MAX_BYTES], re.MULTILINE)
    if end is None:
        raise ValueError("the header has no end: the file is cut short, or not PLY")
    form, elements, comments = "", [], []
    for row in data[: end.start()].splitlines()[1:]:  # as bytes: text has more line endings
        line = row.decode("utf-8", "replace")
        match line.split():
            case ["comment", *_]:
                comments.append(line.strip().removeprefix("comment").strip())
            case [] | ["obj_info", *_]:
                continue
            case ["format", str(name), _] if name in BYTE_ORDER:
                form = name
            case ["element", name, rows] if re.fullmatch(r"[0-9]{1,18}", rows):
                elements.append(Element(name, int(rows), []))
            case ["property", "list", count, kind, name] if elements and _is_list(count, kind):
                elements[-1].properties.append(Property(name, _DTYPES[kind], _DTYPES[count]))
            case ["property", kind, name] if elements and kind in _DTYPES:
                elements[-1].properties.append(Property(name, _DTYPES[kind], None))
            case _:
                raise ValueError(f"the header has a line that is not PLY: {line[:60]!r}")
    if not form:
        raise ValueError("the header does not say whether the file is ASCII or binary")
    names = [element.name for element in elements]
    if len(set(names)) < len(names):
        raise ValueError("the header names an element twice")
    return PlyHeader(form, elements, comments, end.end())


def _is_list(count: str, kind: str) -> bool:
    return _DTYPES.get(count, "f")[0] in "iu" and kind in _DTYPES
