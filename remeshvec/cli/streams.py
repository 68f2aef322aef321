"""Meshes from standard input and to standard output, whose format a flag names."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from ..errors import OptionError
from ..files.data_files import check_format_writable, data_bytes, read_data
from ..interop.mesh_data import MeshData

__all__ = ["STREAM", "check_streams", "read_stream", "write_stream"]

STREAM = "-"


def check_streams(options: argparse.Namespace) -> None:
    """Refuse streams without a format, and a format without streams.

    Raises
    ------
    OptionError
    MeshFormatError
        The format cannot be written.
    """
    uses_streams = STREAM in (options.input, options.output)
    if uses_streams and options.format is None:
        raise OptionError("- needs --format, the format of what is read or written there")
    if options.format is not None and not uses_streams:
        raise OptionError("--format is that of -; files have theirs in their names")
    if options.output == STREAM:
        check_format_writable(_path(options.format))


def read_stream(file_format: str) -> tuple[MeshData, list[str]]:
    """Read a mesh from standard input, with its data; returns also notices.

    Material libraries are looked for in the current folder.
    """
    with tempfile.TemporaryDirectory(prefix="remeshvec-") as folder:
        path = Path(folder) / f"standard input.{file_format}"
        path.write_bytes(sys.stdin.buffer.read())
        data, notices = read_data(path)
        if "mtllib" in data.extra:
            inside = os.path.realpath(folder)
            names = [os.path.relpath(library, inside) for library in data.extra["mtllib"]]
            data.extra["mtllib"] = [os.path.realpath(name) for name in names]
    return data, notices


def write_stream(file_format: str, data: MeshData) -> list[str]:
    """Write a mesh to standard output; returns the names of data that it cannot hold."""
    content, lost = data_bytes(_path(file_format), data)
    sys.stdout.buffer.write(content)
    sys.stdout.buffer.flush()
    return lost


def _path(file_format: str) -> Path:
    """Name a file in the current folder, from which libraries and images are seen."""
    return Path.cwd() / f"standard output.{file_format}"
