"""`write_mesh`: a mesh, with what it carries, to a file of any format."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from ..core import arguments
from ..core.check import as_array
from ..errors import MeshInputError
from ..interop.given import MeshObject, has_arrays, is_pair, is_whole, whole_arrays
from ..interop.mesh_data import MeshData
from ..interop.objects import COLOUR, MATERIAL, UV, read_object
from .data_files import write_data
from .disk import FilePath, named_errors
from .foreign import with_uv
from .mesh_files import checked_arrays
from .scene import read_parts

__all__ = ["write_mesh"]


def write_mesh(path: FilePath, V: ArrayLike | MeshObject, F: Any = None) -> None:
    """Write a triangle mesh to a file.

    OBJ, OFF, PLY, STL and JSON are the package's own; the formats of meshio (VTK, VTU, ...), pyvista
    (VTP) and trimesh (glTF) need these packages. All own formats but STL keep every bit of float64
    coordinates; STL (binary) holds float32. A file of this name is replaced when the new one is complete,
    and stays as it is if anything fails.

    Parameters
    ----------
    path : str or path
        The file; its suffix gives the format. It is packed if ``.gz`` follows.
    V : (n, 3) float, or a mesh
        Vertex positions. Or a whole mesh as for `remesh`, or a result: objects are written with their
        colours, texture coordinates, materials and fields, as far as the format holds them.
    F : (m, 3) int
        Faces, 0-based.

    Raises
    ------
    MeshFormatError
        The suffix is unknown, the mesh is not valid, or the file cannot be written.
    MeshInputError
        ``V`` is an object that does not hold a mesh.
    OptionError
        ``path`` is not a path.
    """
    path = Path(arguments.path(path, "path"))
    if F is None and is_whole(V):
        data = _whole_data(V)
    elif F is None and not (hasattr(V, "__array__") or isinstance(V, tuple | list)):
        data = read_object(V)  # raises, and says what this is instead
    else:
        data = _mesh_data(V, F)
    with named_errors("write", path):
        data.V, data.F = checked_arrays(data.V, data.F)
    write_data(path, data)


def _whole_data(mesh: Any) -> MeshData:
    """Return a mesh with its data under the names that files use."""
    if is_pair(mesh) or has_arrays(mesh):
        return _mesh_data(*whole_arrays(mesh))
    data = read_object(mesh)
    if hasattr(mesh, "visual"):
        return read_parts([mesh])
    for old, new in ((UV, "uv"), (COLOUR, "color"), (MATERIAL, "material")):
        for table in (data.on_vertices, data.on_faces, data.on_corners):
            if old in table:
                table[new] = table.pop(old)
    return with_uv(data)


def _mesh_data(V: Any, F: Any) -> MeshData:
    return MeshData(as_array(V, "V", MeshInputError), as_array(F, "F", MeshInputError))
