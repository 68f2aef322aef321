"""Files with all that they carry: read, remeshed, written.

Plain meshes go the way of `mesh_files`. Where an OBJ or PLY file holds more, that is read besides; all
other formats are those of meshio, pyvista and trimesh.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._check import as_mesh
from ._foreign_files import can_write, read_foreign, write_foreign
from ._obj_data import has_obj_data, obj_bytes, read_obj_data
from ._ply_data import ply_bytes, read_ply_data
from .errors import MeshFormatError
from .mesh_data import MeshData, carry
from .mesh_files import SUFFIXES, check_writable, read_mesh, reason, write_file, write_mesh
from .remesh import RemeshOptions, remesh
from .result import RemeshResult

if TYPE_CHECKING:
    from typing import Unpack

__all__ = [
    "COMMON_SUFFIXES",
    "check_data_writable",
    "read_data",
    "remesh_file",
    "with_kept",
    "write_data",
]

PATHS = str | os.PathLike[str]

# What patterns look for; files of other suffixes are read if they are named.
COMMON_SUFFIXES = (*SUFFIXES, ".vtk", ".vtu", ".vtp", ".msh", ".xdmf", ".glb", ".gltf")


def remesh_file(
    source: PATHS, target: PATHS, L: Any = None, **options: Unpack[RemeshOptions]
) -> RemeshResult:
    """Remesh a file with its colours, texture coordinates, fields and groups, where formats hold them.

    Parameters
    ----------
    source, target : str or path
        Files; their suffixes give the formats. OBJ, OFF, PLY, STL and JSON, and what meshio (VTK, VTU,
        Gmsh, XDMF, ...), pyvista (VTP) and trimesh (glTF) know, where these are installed.
    L : float, array, callable or Adaptive, optional
    **options
        See `remesh`.

    Returns
    -------
    RemeshResult

    Raises
    ------
    MeshFormatError
        A file cannot be read or written.
    """
    check_data_writable(target)
    data, _ = read_data(source)
    result = remesh(data.V, data.F, L, **with_kept(data, options))
    write_data(target, carry(data, result))
    return result


def with_kept(data: MeshData, options: Any) -> dict[str, Any]:
    """Return the options, with what the data want to be kept."""
    kept = data.preserved(options.get("preserve"))
    return {**options, "preserve": kept} if kept else dict(options)


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
