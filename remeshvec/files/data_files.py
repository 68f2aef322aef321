"""Reading and writing meshes with their data: texture coordinates, colours, fields, groups.

The package reads and writes OBJ and PLY files with data by itself; OFF, STL and JSON hold only a mesh.
All other formats are left to meshio, pyvista and trimesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..core import arguments
from ..core.check import as_mesh
from ..errors import MeshFormatError
from ..interop.mesh_data import MeshData
from .disk import (
    FilePath,
    check_regular,
    check_writable,
    checked_bytes,
    format_suffix,
    named_errors,
    reason,
    write_file,
)
from .foreign import can_write, read_foreign, write_foreign
from .materials import known_materials, with_library
from .mesh_files import SUFFIXES, array_bytes, read_mesh
from .obj import OBJ_DATA, ObjFile, obj_bytes
from .ply import PlyFile, ply_bytes
from .polygon_mesh import check_polygons, triangulated

__all__ = [
    "COMMON_SUFFIXES",
    "check_data_writable",
    "check_format_writable",
    "data_bytes",
    "read_data",
    "write_data",
]

WITH_LIBRARY = (".obj", ".ply", ".vtp", ".vtu")  # name a material library beside them
WITH_IMAGES = (".glb", ".gltf")
# Suffixes that patterns match; files with other suffixes are read if they are named.
COMMON_SUFFIXES = (*SUFFIXES, ".vtk", ".vtu", ".vtp", ".msh", ".xdmf", ".glb", ".gltf")


def read_data(path: FilePath) -> tuple[MeshData, list[str]]:
    """Read a mesh with its data; returns also notices of what the reader changed.

    Raises
    ------
    MeshFormatError
        The file is not in the format of its suffix, or does not hold a valid mesh.
    OptionError
        ``path`` is not a path.
    """
    path = Path(arguments.path(path, "path"))
    suffix = format_suffix(path)
    with named_errors("read", path):
        if suffix == ".obj":
            return _read_own(ObjFile(checked_bytes(path)), path)
        if suffix == ".ply":
            return _read_own(PlyFile(checked_bytes(path)), path)
        if suffix not in SUFFIXES:
            check_regular(path)
            data, notices = read_foreign(path)
            as_mesh(data.V, data.F)
            return data, notices
    V, F, notices = read_mesh(path)
    return MeshData(V, F), notices


def _read_own(file: ObjFile | PlyFile, path: Path) -> tuple[MeshData, list[str]]:
    """Read a mesh with its data; only the mesh, with a notice, if the data are not valid."""
    mesh = file.mesh()
    check_polygons(mesh)
    triangles = triangulated(mesh)
    try:
        return file.data(mesh.V, triangles, path.parent), triangles.notices
    except ValueError as error:
        notice = f"only the mesh was read, without its data: {reason(error)}"
        return MeshData(mesh.V, triangles.F), [*triangles.notices, notice]


def check_data_writable(path: FilePath, suffixes: Sequence[str] = ()) -> None:
    """Refuse a path that `write_data` cannot write, before long work starts.

    Raises
    ------
    MeshFormatError
    OptionError
        ``path`` is not a path.
    """
    arguments.path(path, "path")
    check_writable(path, suffixes)
    check_format_writable(path)


def check_format_writable(path: FilePath) -> None:
    """Refuse a format that no library here writes.

    Raises
    ------
    MeshFormatError
    """
    suffix = format_suffix(path)
    obstacle = None if suffix in SUFFIXES else can_write(suffix)
    if obstacle:
        raise MeshFormatError(f"cannot write {path}: {obstacle}")


def write_data(path: FilePath, data: MeshData) -> list[str]:
    """Write a mesh with its data, as far as the format can hold them.

    Returns
    -------
    list of str
        Names of data that the format cannot hold.

    Raises
    ------
    MeshFormatError
        The file cannot be written; an existing file of that name stays as it is.
    OptionError
        ``path`` is not a path, or ``data`` is not a `MeshData`.
    """
    path = Path(arguments.path(path, "path"))
    arguments.instance(data, "data", MeshData, "a MeshData")
    with named_errors("write", path):
        if format_suffix(path) in WITH_LIBRARY:
            data = with_library(data, path)
    content, lost = data_bytes(path, data)
    write_file(path, content)
    return lost


def data_bytes(path: Path, data: MeshData) -> tuple[bytes, list[str]]:
    """Return the content of a file of a mesh with its data, and the names of data that it cannot hold.

    Parameters
    ----------
    path : Path
        Its suffix gives the format; libraries and images are named as seen from its folder.
    data : MeshData

    Raises
    ------
    MeshFormatError
        The mesh cannot be written in this format.
    """
    suffix = format_suffix(path)
    carried = {*data.on_vertices, *data.on_faces, *data.on_corners}
    with named_errors("write", path):
        if suffix in SUFFIXES and (suffix not in (".obj", ".ply") or not carried):
            content, held = array_bytes(path, data.V, data.F), set()
        elif suffix == ".obj":
            content, held = obj_bytes(data, path), {*OBJ_DATA}
        elif suffix == ".ply":
            content, held = ply_bytes(data, path), carried - (set(data.on_corners) - {"uv"})
        else:
            content, held = write_foreign(path, data)
    return content, sorted((carried - held) | _lost_images(data, suffix))


def _lost_images(data: MeshData, suffix: str) -> set[str]:
    """Name the images of materials, if a file can neither hold nor name one of them."""
    if suffix in WITH_IMAGES or (suffix in WITH_LIBRARY and "mtllib" in data.extra):
        return set()
    images = [material.image for material in known_materials(data)]
    kept = Path if suffix == ".ply" else ()  # which names files itself
    has_lost = any(image is not None and not isinstance(image, kept) for image in images)
    return {"images of materials"} if has_lost else set()
