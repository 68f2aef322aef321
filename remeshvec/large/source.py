"""Where the surface comes from: arrays, ``.npy`` files, or a mesh file that is mapped, not read whole."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import FloatArray
from ..errors import MeshInputError
from ..files.disk import check_regular, named_errors
from ..files.mesh_files import read_mesh
from ..files.ply_header import BYTE_ORDER, Element, PlyHeader, parse_header
from ..files.stl import FACET, check_facets

__all__ = ["Source", "digest", "read_source"]

_AT_ONCE = 1 << 20  # rows in memory at a time
_HEADER = 1 << 20  # bytes in which a header must end


class Source(NamedTuple):
    """A surface, and what tells whether it is the same as that of an earlier call."""

    V: NDArray[Any]  # (n, 3)
    F: NDArray[Any]  # (m, 3)
    stamp: dict[str, Any]


def read_source(source: Any) -> Source:
    """Open a surface.

    Parameters
    ----------
    source : path, or (V, F)
        A mesh file; a folder with ``V.npy`` and ``F.npy``; or two arrays, mapped or not, or paths of
        ``.npy`` files.

    Raises
    ------
    MeshFormatError
        A file cannot be read.
    MeshInputError
        ``source`` is none of these.
    """
    if isinstance(source, str | os.PathLike):
        return _read_path(Path(source))
    if isinstance(source, tuple | list) and len(source) == 2:
        V, F = (_array(part) for part in source)
        return Source(V, F, {"V": _stamp(source[0], V), "F": _stamp(source[1], F)})
    raise MeshInputError(
        "source must be a path or a pair (V, F) of arrays or of .npy files; got "
        f"{type(source).__name__}"
    )


def _read_path(path: Path) -> Source:
    if path.is_dir():
        return read_source((path / "V.npy", path / "F.npy"))
    with named_errors("read", path):
        check_regular(path)
    suffix = path.suffix.lower()
    mapped = None
    with named_errors("read", path):
        if suffix == ".ply":
            mapped = _map_ply(path)
        elif suffix == ".stl":
            mapped = _map_stl(path)
    V, F = read_mesh(path)[:2] if mapped is None else mapped
    return Source(V, F, {"file": _state(path)})


def _array(given: Any) -> NDArray[Any]:
    if not isinstance(given, str | os.PathLike):
        return np.asarray(given)
    with named_errors("read", Path(given)):
        check_regular(Path(given))
        return np.load(given, mmap_mode="r", allow_pickle=False)


def _stamp(given: Any, array: NDArray[Any]) -> Any:
    return _state(Path(given)) if isinstance(given, str | os.PathLike) else digest(array)


def _state(path: Path) -> list[Any]:
    found = path.stat()
    return [str(path.resolve()), found.st_size, found.st_mtime_ns]


def digest(array: NDArray[Any]) -> str:
    """Digest of the shape, type and numbers of an array."""
    found = hashlib.blake2b(f"{array.dtype.str} {array.shape}".encode(), digest_size=16)
    for start in range(0, len(array) if array.ndim else 0, _AT_ONCE):
        found.update(np.ascontiguousarray(array[start : start + _AT_ONCE]).data)
    if not array.ndim:
        found.update(array.tobytes())
    return found.hexdigest()


# -- PLY --------------------------------------------------------------------------------------


def _map_ply(path: Path) -> tuple[NDArray[Any], NDArray[Any]] | None:
    """Map a binary file of triangles with rows of one size; None for any other."""
    with open(path, "rb") as file:
        header = parse_header(file.read(_HEADER))
    if header.format == "ascii":
        return None
    rows = {name: _row_type(header, name) for name in ("vertex", "face")}
    names = [element.name for element in header.elements]
    if names[:2] != ["vertex", "face"] or None in rows.values():
        return None
    vertex, face = (header.element(name) for name in ("vertex", "face"))
    _check_size(path, header.start, [(vertex, rows["vertex"]), (face, rows["face"])])
    start = header.start + vertex.rows * np.dtype(rows["vertex"]).itemsize
    vertices = np.memmap(path, rows["vertex"], "r", header.start, (vertex.rows,))
    faces = np.memmap(path, rows["face"], "r", start, (face.rows,))
    size = next(name for name in faces.dtype.names or () if name.startswith("size of"))
    for k in range(0, face.rows, _AT_ONCE):
        if (faces[size][k : k + _AT_ONCE] != 3).any():
            return None
    V = np.empty((vertex.rows, 3))
    for i, axis in enumerate("xyz"):
        V[:, i] = vertices[axis]
    return V, faces[size.removeprefix("size of ")]


def _row_type(header: PlyHeader, name: str) -> Any:
    """Type of a row of a table, if lists of faces are triangles; None where rows differ in size."""
    order: Any = BYTE_ORDER[header.format]
    fields: list[Any] = []
    lists = 0
    for p in header.element(name).properties:
        kind = np.dtype(p.dtype).newbyteorder(order)
        if p.length is None:
            fields.append((p.name, kind))
            continue
        lists += 1
        if p.name not in ("vertex_indices", "vertex_index"):
            return None
        fields += [(f"size of {p.name}", np.dtype(p.length).newbyteorder(order)), (p.name, kind, 3)]
    axes = {"x", "y", "z"} <= {field[0] for field in fields}
    return fields if (lists == 0 and axes if name == "vertex" else lists == 1) else None


def _check_size(path: Path, start: int, tables: list[tuple[Element, Any]]) -> None:
    promised = start + sum(element.rows * np.dtype(row).itemsize for element, row in tables)
    size = path.stat().st_size
    # Polygons make rows longer, and are found by their sizes later.
    if promised > size:
        raise ValueError(f"the header promises {promised:,} bytes; the file has {size:,}")


# -- STL --------------------------------------------------------------------------------------


def _map_stl(path: Path) -> tuple[FloatArray, NDArray[np.int64]] | None:
    """Weld the corners of a binary file where they are equal; None for text."""
    with open(path, "rb") as file:
        head = file.read(84)
    count = int.from_bytes(head[80:84], "little") if len(head) == 84 else 0
    if not count or path.stat().st_size != 84 + FACET.itemsize * count:
        return None
    facets = np.memmap(path, FACET, "r", 84, (count,))
    corners = np.empty((count, 3, 3), np.float32)
    for k in range(0, count, _AT_ONCE):
        corners[k : k + _AT_ONCE] = facets["corners"][k : k + _AT_ONCE]
    check_facets(corners)
    return _welded(corners.reshape(-1, 3))


def _welded(points: NDArray[np.float32]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Distinct points in the order of their first use, and the faces between them."""
    order = np.lexsort(points.T)  # to which -0 and 0 are one place
    is_new = np.ones(len(order), np.bool_)
    is_new[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    place = np.cumsum(is_new) - 1
    first = order[is_new]  # lexsort is stable: the first of its equals
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first, kind="stable")] = np.arange(len(first))
    F = np.empty(len(points), np.int64)
    F[order] = rank[place]
    return points[np.sort(first)].astype(np.float64), F.reshape(-1, 3)
