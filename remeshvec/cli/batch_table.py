"""The table of results of a batch, which also tells what is done.

A row is appended in one write when a mesh is done, so a killed run loses at most its last row; an
incomplete line at the end is dropped. The end of a run sorts the rows, one per mesh.
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

Row = dict[str, Any]


class ResultTable:
    """Rows, keyed by the name of their output, and the CSV file that holds them."""

    def __init__(self, path: str) -> None:
        """Read the rows that the file holds already.

        Raises
        ------
        OptionError
            The file is not a table of a batch.
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
        self._parse(content[: content.rfind(b"\n") + 1].decode("utf-8", "surrogateescape"))
        if not self.rows and content and not content.startswith(b"input,output,"):
            raise OptionError(f"{path} is not a table of a batch; name another one with --table")

    def _parse(self, text: str) -> None:
        for row in csv.DictReader(io.StringIO(text, newline="")):
            if row.get("output") and None not in row and None not in row.values():
                self.rows[row["output"]] = {name: row.get(name, "") for name in COLUMNS}

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
        """Close the file and write all rows anew, sorted."""
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


def _lines(rows: Iterable[Row]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, restval="", lineterminator="\n")
    writer.writerows(rows)
    return text.getvalue()


def write_parquet(path: str, rows: list[Row]) -> None:
    """Write rows to a Parquet file, with numbers as numbers and nulls for unknown entries."""
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
