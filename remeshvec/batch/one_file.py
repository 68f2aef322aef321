"""`remesh_file`: read one file with all its data, remesh it, write it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..core import arguments
from ..files.data_files import check_data_writable, read_data, write_data
from ..files.disk import FilePath
from ..input.options import RemeshKeywords
from ..interop.mesh_data import MeshData, carry
from ..output.result import RemeshResult
from ..pipeline.remesh import remesh

if TYPE_CHECKING:
    from typing import Unpack

__all__ = ["remesh_file", "with_feature_data"]


def remesh_file(
    source: FilePath, target: FilePath, L: Any = None, **options: Unpack[RemeshKeywords]
) -> RemeshResult:
    """Remesh a file with the colours, texture coordinates, fields and groups that its format holds.

    Parameters
    ----------
    source, target : str or path
        Files; their suffixes give the formats: OBJ, OFF, PLY, STL and JSON, and those of meshio (VTK,
        VTU, Gmsh, XDMF, ...), pyvista (VTP) and trimesh (glTF) if these packages are installed.
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
    source, target = arguments.path(source, "source"), arguments.path(target, "target")
    check_data_writable(target)
    data, _ = read_data(source)
    result = remesh(data.V, data.F, L, **with_feature_data(data, options))
    write_data(target, carry(data, result))
    return result


def with_feature_data(data: MeshData, options: Any) -> dict[str, Any]:
    """Return the options, with ``preserve`` extended by the seams and borders of the data."""
    kept = data.preserved(options.get("preserve"))
    return {**options, "preserve": kept} if kept else dict(options)
