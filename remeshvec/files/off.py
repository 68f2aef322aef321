"""OFF files, including COFF, NOFF and STOFF: points and faces; colours and normals are ignored."""

from __future__ import annotations

import re

from ..core.vocabulary import FloatArray, IntArray
from .polygon_mesh import PolygonMesh
from .text import check_room, points, polygons, shown, text_lines

__all__ = ["off_bytes", "parse_off"]

_KEYWORD = re.compile(rb"(?:ST)?C?N?OFF")
_COUNT = re.compile(rb"\d{1,9}")


def parse_off(data: bytes) -> PolygonMesh:
    """Read a text with one line per vertex and one per face.

    Raises
    ------
    ValueError
        The header is not valid or does not match the number of lines, or a line is wrong.
    """
    lines = text_lines(data)
    keyword, *counts = lines[0].split() if lines else [b""]
    if not _KEYWORD.fullmatch(keyword):
        raise ValueError(f"it starts with {shown(keyword)}, not with OFF, COFF or NOFF")
    if counts[:1] == [b"BINARY"]:
        raise ValueError("binary OFF is not supported")
    body = lines[1:] if counts else lines[2:]
    counts = counts or b" ".join(lines[1:2]).split()
    if len(counts) < 2 or not all(map(_COUNT.fullmatch, counts[:2])):
        raise ValueError("the numbers of vertices and faces are missing or wrong")
    n, m = int(counts[0]), int(counts[1])
    check_room(n + m, len(body), "lines")
    if len(body) > n + m:
        raise ValueError(f"{len(body):,} lines follow where the header says {n + m:,}")
    return PolygonMesh(points(body[:n])[:, :3], *polygons(body[n:]), [])


def off_bytes(V: FloatArray, F: IntArray) -> bytes:
    """Write vertices and triangles; every coordinate keeps all its bits."""
    rows = [f"{x!r} {y!r} {z!r}\n" for x, y, z in V.tolist()]
    faces = [f"3 {i} {j} {k}\n" for i, j, k in F.tolist()]
    return "".join([f"OFF\n{len(V)} {len(F)} 0\n", *rows, *faces]).encode()
