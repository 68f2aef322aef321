"""Reading and writing meshes: OBJ, OFF, PLY, STL and JSON.

A file passes a guard (`_file_guards`, `_ply_guard`), then libigl reads the checked copy, then the
arrays are checked; only JSON is read here. Whatever goes wrong is a `MeshFormatError` that names
the file and the reason. Files are written under another name and renamed when complete.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core import arguments
from ..core.vocabulary import FloatArray, IntArray
from ..errors import MeshFormatError
from .guards import MeshCopy, check_obj, check_off, check_stl, checked_bytes
from .ply_guard import check_ply, parse_header
from .writers import WRITERS

__all__ = [
    "SUFFIXES",
    "MeshFile",
    "check_writable",
    "read_mesh",
    "reason",
    "write_file",
    "write_mesh",
]


PATHS = str | os.PathLike[str]


class MeshFile(NamedTuple):
    """A mesh from a file.

    Parameters
    ----------
    V : (n, 3) float64
        Vertex positions.
    F : (m, 3) int64
        Faces, 0-based.
    notices : list of str
        What the reader did beyond reading: polygons cut into triangles, corners welded.
    """

    V: FloatArray
    F: IntArray
    notices: list[str]


class _Raw(NamedTuple):
    """What a library returned, and how many faces the file has."""

    V: FloatArray
    F: IntArray
    faces: int


def read_mesh(path: PATHS) -> MeshFile:
    """Read a triangle mesh from an OBJ, OFF, PLY, STL or JSON file.

    Polygons are cut into fans from their first corner, which suits convex ones. Texture
    coordinates, normals and colours are ignored and never split a vertex. The triangles of an STL
    file, which shares no vertices, are joined where corners are exactly equal. JSON is
    ``{"verts": [[x, y, z], ...], "faces": [[i, j, k], ...]}``, 0-based.

    Parameters
    ----------
    path : str or path
        The file; its suffix gives the format, in capitals or not.

    Returns
    -------
    MeshFile
        ``V, F, notices``.

    Raises
    ------
    MeshFormatError
        The file cannot be read as what its suffix says, or holds no valid mesh.

    Notes
    -----
    Binary PLY files whose faces differ in their number of corners, and PLY files with unusual
    columns, need the package plyfile.
    """
    path = Path(arguments.path(path, "path"))
    try:
        reader = _READERS[_known_suffix(path)]
        raw = reader(checked_bytes(path))
        V, F = _checked_mesh(raw)
    except Exception as error:  # of whatever kind: libraries raise all sorts on a broken file
        raise MeshFormatError(f"cannot read {path}: {reason(error)}") from error
    notices = []
    if len(F) > raw.faces:
        notices.append(f"polygons were cut: {raw.faces:,} faces became {len(F):,} triangles")
    if path.suffix.lower() == ".stl":
        V, F = _welded(V, F)
        notices.append(f"{3 * len(F):,} corners of triangles were welded to {len(V):,} vertices")
    return MeshFile(V, F, notices)


def write_mesh(path: PATHS, V: ArrayLike, F: ArrayLike) -> None:
    """Write a triangle mesh to an OBJ, OFF, PLY, STL or JSON file.

    All formats but STL keep every bit of float64 coordinates; STL (binary) holds float32. A file
    of this name is replaced when the new one is complete, and stays as it is if anything fails.

    Parameters
    ----------
    path : str or path
        The file; its suffix gives the format.
    V : (n, 3) float
        Vertex positions.
    F : (m, 3) int
        Faces, 0-based.

    Raises
    ------
    MeshFormatError
        The suffix is unknown, the mesh is not valid, or the file cannot be written.
    """
    path = Path(arguments.path(path, "path"))
    try:
        to_bytes = WRITERS[_known_suffix(path)]
        content = to_bytes(*_checked_mesh(_Raw(np.asarray(V), np.asarray(F), 0)))
    except Exception as error:
        raise MeshFormatError(f"cannot write {path}: {reason(error)}") from error
    write_file(path, content)


def write_file(path: PATHS, content: bytes) -> None:
    """Write a file under another name beside it, then rename: nobody sees a half-written file.

    Raises
    ------
    MeshFormatError
        The file cannot be written.
    """
    try:
        target = Path(path).resolve()  # a link stays a link
        part = target.with_name(f".{secrets.token_hex(8)}.part")
    except (OSError, RuntimeError, ValueError) as error:
        raise MeshFormatError(f"cannot write {path}: {reason(error)}") from error
    try:
        with open(part, "xb") as file:
            file.write(content)
        if target.exists():
            shutil.copymode(target, part)
        os.replace(part, target)
    except BaseException as error:
        part.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise MeshFormatError(f"cannot write {path}: {reason(error)}") from error
        raise


def check_writable(path: PATHS, suffixes: Sequence[str] = ()) -> None:
    """Refuse a path that cannot be written, before long work is done for it.

    Parameters
    ----------
    path : str or path
        The file to be.
    suffixes : sequence of str
        Allowed suffixes, in lower case; empty for any.

    Raises
    ------
    MeshFormatError
        The suffix is not allowed, the folder is not there or cannot be written to, or a folder has
        this name.
    """
    try:
        obstacle = _obstacle(Path(path).resolve(), suffixes)
    except (OSError, RuntimeError, ValueError) as error:  # too long, a ring of links, a null byte
        obstacle = reason(error)
    if obstacle:
        raise MeshFormatError(f"cannot write {path}: {obstacle}")


def _obstacle(target: Path, suffixes: Sequence[str]) -> str | None:
    if suffixes and target.suffix.lower() not in suffixes:
        return f"the suffix {target.suffix!r} is none of {', '.join(suffixes)}"
    if not target.parent.is_dir():
        return f"there is no folder {target.parent}"
    if target.is_dir():
        return "it is a folder"
    if target.exists() and not target.is_file():
        return "it is not a regular file"
    if not os.access(target.parent, os.W_OK | os.X_OK):
        return f"the folder {target.parent} cannot be written to"
    return None


def _known_suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"the suffix {path.suffix!r} is none of {', '.join(SUFFIXES)}")
    return suffix


def _with_libigl(copy: MeshCopy) -> _Raw:
    """Let libigl read a checked copy; it reads from files only."""
    import igl

    if copy.faces == 0:
        raise ValueError("it has no faces")
    with tempfile.TemporaryDirectory(prefix="remeshvec-") as folder:
        file = os.path.join(folder, "mesh" + copy.suffix)
        Path(file).write_bytes(copy.content)
        V, F = igl.read_triangle_mesh(file)
    if F.shape[1] > 3:  # polygons of one size in PLY come back as they are
        F = igl.polygons_to_triangles(*igl.polygon_corners(F))[0]
    if len(F) < copy.faces:
        raise ValueError(f"only {len(F):,} of {copy.faces:,} faces could be read")
    return _Raw(V, F, copy.faces)


def _read_obj(data: bytes) -> _Raw:
    return _with_libigl(check_obj(data))


def _read_off(data: bytes) -> _Raw:
    return _with_libigl(check_off(data))


def _read_stl(data: bytes) -> _Raw:
    return _with_libigl(check_stl(data))


def _read_ply(data: bytes) -> _Raw:
    copy = check_ply(data)
    return _with_plyfile(data) if copy is None else _with_libigl(copy)


def _with_plyfile(data: bytes) -> _Raw:
    import io

    try:
        from plyfile import PlyData
    except ImportError:
        raise ValueError(
            "it is cut short, or has polygons of several sizes or unusual columns, which only "
            "plyfile reads (pip install plyfile)"
        ) from None
    tables = PlyData.read(io.BytesIO(data), mmap=False)
    vertex, face = tables["vertex"], tables["face"]
    lists = {p.name for p in parse_header(data).element("face").properties if p.length}
    corners = face["vertex_indices" if "vertex_indices" in lists else "vertex_index"]
    V = np.stack([np.asarray(vertex[axis], dtype=np.float64) for axis in "xyz"], axis=1)
    return _fanned(V, [np.asarray(polygon) for polygon in corners])


def _read_json(data: bytes) -> _Raw:
    try:
        content = json.loads(data.decode("utf-8-sig"))
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if not isinstance(content, dict) or not {"verts", "faces"} <= content.keys():
        raise ValueError('it is not of the form {"verts": [...], "faces": [...]}')
    points, polygons = content["verts"], content["faces"]
    if not _is_table(points, (int, float)) or any(len(point) != 3 for point in points):
        raise ValueError('"verts" must be a list of [x, y, z]')
    if not _is_table(polygons, (int,)):
        raise ValueError('"faces" must be a list of lists of integers')
    V = np.array(points, dtype=np.float64).reshape(-1, 3)
    return _fanned(V, [np.array(polygon, dtype=np.int64) for polygon in polygons])


def _is_table(value: Any, kinds: tuple[type, ...]) -> bool:
    """Whether this is a list of lists of these types; true and false are no numbers."""
    return isinstance(value, list) and all(
        isinstance(row, list) and all(type(entry) in kinds for entry in row) for row in value
    )


def _fanned(V: FloatArray, polygons: Sequence[NDArray[Any]]) -> _Raw:
    """Cut polygons into triangles."""
    import igl

    sizes = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    if len(sizes) == 0:
        raise ValueError("it has no faces")
    if sizes.min() < 3:
        raise ValueError(f"face {sizes.argmin()} has fewer than 3 corners")
    corners = np.concatenate(polygons).astype(np.int64)
    return _Raw(V, igl.polygons_to_triangles(corners, np.r_[0, np.cumsum(sizes)])[0], len(sizes))


def _checked_mesh(raw: _Raw) -> tuple[FloatArray, IntArray]:
    """Refuse arrays that are no triangle mesh, whoever made them."""
    V, F = raw.V, raw.F
    if V.ndim != 2 or V.shape[1] != 3 or len(V) == 0:
        raise ValueError(f"vertices of shape (n, 3) are needed, not {V.shape}")
    if F.ndim != 2 or F.shape[1] != 3 or len(F) == 0:
        raise ValueError(f"faces of shape (m, 3) are needed, not {F.shape}")
    if V.dtype.kind not in "fiu":
        raise ValueError(f"vertices must be real numbers, not {V.dtype}")
    if F.dtype.kind not in "iu":
        raise ValueError(f"faces must be integers, not {F.dtype}")
    V = V.astype(np.float64, copy=False)
    if not np.isfinite(V).all():
        bad = int(np.flatnonzero(~np.isfinite(V).all(axis=1))[0])
        raise ValueError(f"vertex {bad} (counted from 0) is not finite")
    wrong = ((F < 0) | (len(V) <= F)).any(axis=1)
    if wrong.any():
        bad = int(np.flatnonzero(wrong)[0])
        raise ValueError(
            f"face {bad} (counted from 0) names a vertex outside the {len(V):,} there are"
        )
    return np.ascontiguousarray(V), np.ascontiguousarray(F, dtype=np.int64)


def _welded(V: FloatArray, F: IntArray) -> tuple[FloatArray, IntArray]:
    """Join vertices that are exactly equal, numbered by their first appearance."""
    import igl

    _, _, group = igl.remove_duplicate_vertices(V, 0.0)
    first = np.empty(group.max() + 1, dtype=np.int64)
    first[group[::-1]] = np.arange(len(V))[::-1]
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return V[first[order]], rank[group][F]


def reason(error: Exception) -> str:
    """Say in one line what went wrong."""
    if isinstance(error, MemoryError):
        return "there is not enough memory"
    if isinstance(error, json.JSONDecodeError):
        return f"it is not JSON: {error}"
    if isinstance(error, UnicodeDecodeError):
        return "it is not UTF-8"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return " ".join(str(error).split()) or type(error).__name__


_READERS: dict[str, Callable[[bytes], _Raw]] = {
    ".obj": _read_obj,
    ".off": _read_off,
    ".ply": _read_ply,
    ".stl": _read_stl,
    ".json": _read_json,
}
SUFFIXES = tuple(_READERS)
