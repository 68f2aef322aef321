"""Files with all that they carry: read, remeshed, written.

Plain meshes go the way of `mesh_files`. Where an OBJ or PLY file holds more, that is read besides; all
other formats are those of meshio, pyvista and trimesh.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.check import as_mesh
from ..errors import MeshFormatError
from ..interop.mesh_data import MeshData
from .foreign import can_write, read_foreign, write_foreign
from .obj_data import has_obj_data, obj_bytes, read_obj_data
from .plain import SUFFIXES, check_writable, read_mesh, reason, write_file, write_mesh
from .ply_data import ply_bytes, read_ply_data

if TYPE_CHECKING:
    pass

__all__ = [
    "COMMON_SUFFIXES",
    "check_data_writable",
    "read_data",
    "write_data",
]

PATHS = str | os.PathLike[str]

# What patterns look for; files of other suffixes are read if they are named.
COMMON_SUFFIXES = (*SUFFIXES, ".vtk", ".vtu", ".vtp", ".msh", ".xdmf", ".glb", ".gltf")


def read_data(path: PATHS) -> tuple[MeshData, list[str]]:
    """Read a mesh with what it carries, and notices of what the reader did.

    Raises
    ------
    MeshFormatError
        The file cannot be read as what its suffix says, or holds no valid mesh.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in SUFFIXES:
        V, F, notices = read_mesh(path)
        data = MeshData(V, F)
        if suffix in (".obj", ".ply"):
            data = _with_data(path, data, notices)
        return data, notices
    try:
        _check_there(path)
        data, notices = read_foreign(path)
        as_mesh(data.V, data.F)
        return data, notices
    except Exception as error:  # of whatever kind: libraries raise all sorts on a broken file
        raise MeshFormatError(f"cannot read {path}: {reason(error)}") from error


def _with_data(path: Path, data: MeshData, notices: list[str]) -> MeshData:
    """Read what an OBJ or PLY file holds besides a mesh that has been read."""
    content = path.read_bytes()
    try:
        if path.suffix.lower() == ".obj":
            return read_obj_data(path, data.V) if has_obj_data(content) else data
        return read_ply_data(content, data.V, data.F) or data
    except ImportError:
        if _has_ply_data(content):
            notices.append("properties beyond the mesh are left out (pip install plyfile)")
    except Exception as error:
        notices.append(f"only the mesh was read, not what it carries: {reason(error)}")
    return data


def _has_ply_data(content: bytes) -> bool:
    header = content.partition(b"end_header")[0]
    return header.count(b"\nproperty") > 4


def _check_there(path: Path) -> None:
    if not path.exists():
        raise ValueError("there is no such file")
    if path.is_dir():
        raise ValueError("it is a folder")


def check_data_writable(path: PATHS, suffixes: Sequence[str] = ()) -> None:
    """Refuse a path that `write_data` could not write, before long work is done for it.

    Raises
    ------
    MeshFormatError
    """
    suffix = Path(path).suffix.lower()
    check_writable(path, suffixes)
    obstacle = None if suffix in SUFFIXES else can_write(suffix)
    if obstacle:
        raise MeshFormatError(f"cannot write {path}: {obstacle}")


def write_data(path: PATHS, data: MeshData) -> list[str]:
    """Write a mesh with what it carries, as far as the format can hold it.

    Returns
    -------
    list of str
        Names of data that the format cannot hold.

    Raises
    ------
    MeshFormatError
        The file cannot be written; one of that name stays as it is.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    carried = {*data.on_vertices, *data.on_faces, *data.on_corners}
    if suffix in SUFFIXES and (suffix not in (".obj", ".ply") or not carried):
        write_mesh(path, data.V, data.F)
        return sorted(carried)
    try:
        if suffix == ".obj":
            content, held = obj_bytes(data, path), {"uv", "color", "object", "group", "material"}
        elif suffix == ".ply":
            content, held = ply_bytes(data), carried - (set(data.on_corners) - {"uv"})
        else:
            content, held = write_foreign(path, data)
    except Exception as error:
        raise MeshFormatError(f"cannot write {path}: {reason(error)}") from error
    write_file(path, content)
    return sorted(carried - held)
