"""Reading and writing meshes: OBJ, OFF, PLY, STL and JSON.

Each format has one writer and one parser, which refuses anything it does not understand. Every failure
is a `MeshFormatError` that names the file and the reason.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core import arguments
from ..core.vocabulary import FloatArray, IntArray
from ..interop.mesh_data import MeshData
from .disk import FilePath, checked_bytes, format_suffix, named_errors
from .json_format import json_bytes, parse_json
from .obj import ObjFile, obj_bytes
from .off import off_bytes, parse_off
from .ply import PlyFile, ply_bytes
from .polygon_mesh import PolygonMesh, check_polygons, triangulated
from .stl import parse_stl, stl_bytes

__all__ = ["SUFFIXES", "MeshFile", "array_bytes", "checked_arrays", "read_mesh"]


class MeshFile(NamedTuple):
    """A mesh from a file.

    Parameters
    ----------
    V : (n, 3) float64
        Vertex positions.
    F : (m, 3) int64
        Faces, 0-based.
    notices : list of str
        Changes that the reader made: polygons cut into triangles, corners welded.
    """

    V: FloatArray
    F: IntArray
    notices: list[str]


def read_mesh(path: FilePath) -> MeshFile:
    """Read a triangle mesh from an OBJ, OFF, PLY, STL or JSON file.

    Polygons are cut into fans from their first corner, which suits convex ones. Texture
    coordinates, normals and colours are ignored and never split a vertex. The triangles of an STL
    file, which do not share vertices, are joined where corners are exactly equal. JSON is
    ``{"verts": [[x, y, z], ...], "faces": [[i, j, k], ...]}``, 0-based.

    Parameters
    ----------
    path : str or path
        The file; its suffix gives the format, in upper or lower case. ``.gz`` after it is unpacked.

    Returns
    -------
    MeshFile
        ``V, F, notices``.

    Raises
    ------
    MeshFormatError
        The file is not in the format of its suffix, or does not hold a valid mesh.
    OptionError
        ``path`` is not a path.
    """
    path = Path(arguments.path(path, "path"))
    with named_errors("read", path):
        mesh = _PARSERS[_known_suffix(path)](checked_bytes(path))
        check_polygons(mesh)
        triangles = triangulated(mesh)
        return MeshFile(np.ascontiguousarray(mesh.V), triangles.F, triangles.notices)


def array_bytes(path: Path, V: ArrayLike, F: ArrayLike) -> bytes:
    """Return a file of a mesh without data, in one of the package's own formats.

    Raises
    ------
    ValueError
        The suffix is unknown, or the mesh is not valid.
    """
    to_bytes = _WRITERS[_known_suffix(path)]
    return to_bytes(*checked_arrays(np.asarray(V), np.asarray(F)), path)


def _known_suffix(path: Path) -> str:
    suffix = format_suffix(path)
    if suffix not in SUFFIXES:
        raise ValueError(f"the suffix {suffix!r} is not one of {', '.join(SUFFIXES)}")
    return suffix


def checked_arrays(V: NDArray, F: NDArray) -> tuple[FloatArray, IntArray]:
    """Refuse arrays that are not a triangle mesh."""
    if V.ndim != 2 or V.shape[1] != 3 or len(V) == 0:
        raise ValueError(f"vertices of shape (n, 3) are needed, not {V.shape}")
    if F.ndim != 2 or F.shape[1] != 3 or len(F) == 0:
        raise ValueError(f"faces of shape (m, 3) are needed, not {F.shape}")
    if V.dtype.kind not in "fiu":
        raise ValueError(f"vertices must be real numbers, not {V.dtype}")
    if F.dtype.kind not in "iu":
        raise ValueError(f"faces must be integers, not {F.dtype}")
    V = np.ascontiguousarray(V, np.float64)
    check_polygons(PolygonMesh(V, F.ravel(), np.full(len(F), 3), []))
    return V, np.ascontiguousarray(F, np.int64)


_PARSERS: dict[str, Callable[[bytes], PolygonMesh]] = {
    ".obj": lambda content: ObjFile(content).mesh(),
    ".off": parse_off,
    ".ply": lambda content: PlyFile(content).mesh(),
    ".stl": parse_stl,
    ".json": parse_json,
}
_WRITERS: dict[str, Callable[[FloatArray, IntArray, Path], bytes]] = {
    ".obj": lambda V, F, path: obj_bytes(MeshData(V, F), path),
    ".off": lambda V, F, _: off_bytes(V, F),
    ".ply": lambda V, F, path: ply_bytes(MeshData(V, F), path),
    ".stl": lambda V, F, _: stl_bytes(V, F),
    ".json": lambda V, F, _: json_bytes(V, F),
}
SUFFIXES = tuple(_PARSERS)
