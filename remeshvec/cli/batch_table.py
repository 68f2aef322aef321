"""The table of results of a batch, which also records the meshes that are done.

A row is appended in one write when a mesh is done, so a killed run loses at most its last row; an
incomplete line at the end is dropped. At the end of a run the rows are sorted, one per mesh.

A table saved by a spreadsheet can be read too: with a byte order mark, other separators, quotes, and
numbers in other forms. If the spreadsheet rounded a number, the mesh looks changed and is done again.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..errors import MeshFormatError, OptionError
from ..files.disk import write_file

__all__ = ["COLUMNS", "MEASURES", "ResultTable", "write_parquet"]

# Measures of quality before and after: column names, and attributes of what `quality` returns.
MEASURES = {
    "area_error": "area_error_face",
    "min_angle": "min_angle",
    "min_angle_p1": "min_angle_p1",
    "valence6": "valence6_inner",
    "edges_in_band": "edge_in_band",
}
_TEXT = ("input", "output", "error", "options", "version")
_COUNTS = ("vertices_before", "faces_before", "vertices_after", "faces_after")
_STAMPS = ("input_bytes", "input_mtime_ns")
COLUMNS = (
    "input",
    "output",
    *_COUNTS,
    *(f"{name}_{when}" for name in MEASURES for when in ("before", "after")),
    "target_length",
    "seconds",
    "error",
    *_STAMPS,
    "options",
    "version",
)
_NUMBERS = tuple(name for name in COLUMNS if name not in _TEXT)

Row = dict[str, Any]


class ResultTable:
    """Rows, keyed by the name of their output, and the CSV file that holds them."""

    def __init__(self, path: str) -> None:
        """Read the rows that the file holds already.

        Raises
        ------
        OptionError
            The file is not a table of a batch, or a number in it is not valid.
        MeshFormatError
            The file cannot be read.
        """
        self.path = path
        self.rows: dict[str, Row] = {}
        self._file: int | None = None
        try:
            content = Path(path).read_bytes() if os.path.exists(path) else b""
        except OSError as error:
            raise MeshFormatError(f"cannot read {path}: {error.strerror}") from error
        if not content:
            return
        try:
            self._parse(content.decode("utf-8-sig", "surrogateescape"))
        except (ValueError, csv.Error) as error:
            raise OptionError(
                f"{path} is not a table of a batch ({error}); name another one with --table"
            ) from error

    def _parse(self, text: str) -> None:
        head = text.partition("\n")[0].replace('"', "")
        separator = head.removeprefix("input")[:1]
        if separator not in (",", ";", "\t") or not head.startswith(f"input{separator}output"):
            raise ValueError("it does not begin with the names of its columns")
        whole = io.StringIO(text[: text.rfind("\n") + 1], newline="")
        reader = csv.DictReader(whole, delimiter=separator)
        for line in reader:
            if line.get("output") and None not in line and None not in line.values():
                row = {name: line.get(name, "") for name in COLUMNS}
                _make_numbers_plain(row, reader.line_num)
                if row["error"] or all(row[name] for name in _NUMBERS):
                    self.rows[row["output"]] = row

    def open(self) -> None:
        """Sort the rows that could be read, and open the file for more."""
        self.tidy()
        self._file = os.open(self.path, os.O_WRONLY | os.O_APPEND)

    def add(self, row: Row) -> None:
        """Append a row; it replaces an earlier one with the same output.

        Raises
        ------
        MeshFormatError
            The row cannot be written.
        """
        self.rows[row["output"]] = row
        if self._file is None:
            return
        line = _lines([row]).encode("utf-8", "surrogateescape")
        try:
            written = os.write(self._file, line)
        except OSError as error:
            raise MeshFormatError(f"cannot write {self.path}: {error.strerror}") from error
        if written < len(line):
            raise MeshFormatError(f"cannot write {self.path}: no space is left")

    def close(self) -> None:
        """Close the file and write all rows again, sorted."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
            self.tidy()

    def tidy(self) -> None:
        """Write one sorted row per mesh, all of them or none."""
        head = ",".join(COLUMNS) + "\n"
        write_file(self.path, (head + _lines(self.in_order())).encode("utf-8", "surrogateescape"))

    def in_order(self) -> list[Row]:
        """Return all rows, sorted by the names of their outputs."""
        return [self.rows[name] for name in sorted(self.rows)]


def _make_numbers_plain(row: Row, line: int) -> None:
    """Write the numbers of a row in the usual form: ``0.5`` for ``0,5``, ``100`` for ``1E+02``.

    Raises
    ------
    ValueError
        An entry is not a number, but for example a date, or a number with thousands separators.
    """
    for name in _NUMBERS:
        entry = row[name].strip().replace(",", ".")
        try:
            if name not in _COUNTS + _STAMPS:
                float(entry or 0)
            elif entry and not entry.isdecimal():
                if "e" not in entry.lower():
                    raise ValueError
                entry = str(int(float(entry)))
        except (ValueError, OverflowError):
            raise ValueError(
                f"{row[name]!r} in line {line}, column {name}, is not a number"
            ) from None
        row[name] = entry


def _lines(rows: Iterable[Row]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, restval="", lineterminator="\n")
    writer.writerows(rows)
    return text.getvalue()


def write_parquet(path: str, rows: list[Row]) -> None:
    """Write rows to a Parquet file, with numbers as numbers and null for missing entries."""
    import pyarrow
    import pyarrow.parquet

    kinds = {name: pyarrow.float64() for name in COLUMNS}
    kinds |= dict.fromkeys(_TEXT, pyarrow.string())
    kinds |= dict.fromkeys((*_COUNTS, *_STAMPS), pyarrow.int64())
    columns = {
        name: pyarrow.array([_cell(row[name], name) for row in rows], kind)
        for name, kind in kinds.items()
    }
    buffer = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.table(columns), buffer)
    write_file(path, buffer.getvalue())


def _cell(entry: Any, name: str) -> Any:
    if name in _TEXT:
        return str(entry).encode("utf-8", "replace").decode() or None
    if entry == "":
        return None
    return int(entry) if name in _COUNTS + _STAMPS else float(entry)
