"""Files that other libraries read and write: meshio, pyvista and trimesh, each if it is installed."""

from __future__ import annotations

import importlib
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..interop.mesh_data import MeshData, with_data_at_vertices, with_uv_at_corners
from ..interop.meshio_data import read_meshio, write_meshio
from ..interop.objects import read_pyvista
from ..processes.pool import StandingWorker
from .disk import checked_bytes, format_suffix
from .scene import read_scene, scene_bytes
from .vtk_materials import material_fields, read_materials, with_fields

__all__ = ["can_write", "read_foreign", "with_uv", "write_foreign"]

_OWN = ".obj, .off, .ply, .stl, .json"
# meshio reads these too, but as a drawing or a table, or only together with a second file.
_NOT_MESHIO = (".svg", ".xml", ".dat", ".post", ".post.gz", ".ele", ".node")
_PYVISTA = (".vtp",)
_TRIMESH = (".glb", ".gltf", ".3mf", ".dae")
_READ_ONLY = (".3mf", ".dae")  # trimesh writes them without the data

# Formats of meshio that hold any data on points and cells, with the numbers of components allowed.
_WITH_DATA = ("vtk", "vtu", "xdmf", "gmsh22")
_COLUMNS: dict[str | None, tuple[int, ...]] = {"xdmf": (1, 3, 6, 9), "gmsh22": (1, 3, 9)}

# What programs call texture coordinates in files whose format has no place for them.
_TEXTURE_COORDINATES = ("uv", "TCoords", "Texture Coordinates", "TextureCoordinates")

# Some readers never finish a damaged file. The slowest reads 1 MB of text per second.
_SECONDS, _BYTES_PER_SECOND = 60.0, 200_000


def _library(suffix: str) -> tuple[str, Any]:
    """Name the library for a suffix and import it.

    Raises
    ------
    ValueError
        No library knows the suffix, or the one that does is not installed.
    """
    name = "pyvista" if suffix in _PYVISTA else "trimesh" if suffix in _TRIMESH else "meshio"
    try:
        library = importlib.import_module(name)
    except ImportError:
        raise ValueError(
            f"the suffix {suffix!r} is not one of {_OWN}; {name}, which may read it, is not installed "
            f"(pip install {name})"
        ) from None
    known = name != "meshio" or (
        suffix in library.extension_to_filetypes and suffix not in _NOT_MESHIO
    )
    if not known:
        raise ValueError(
            f"the suffix {suffix!r} is not one of {_OWN}, {', '.join(_PYVISTA + _TRIMESH)}, "
            "and meshio does not know it"
        )
    return name, library


def can_write(suffix: str) -> str | None:
    """Return the reason why a file with this suffix cannot be written; None if it can."""
    try:
        name, library = _library(suffix)
    except ValueError as error:
        return str(error)
    if suffix in _READ_ONLY or (name == "meshio" and _writer(library, suffix) is None):
        return f"{suffix} files can be read only"
    return None


def _writer(meshio: Any, suffix: str) -> str | None:
    """Return the format of meshio that can be written under a suffix and holds the most data."""
    if suffix == ".msh":
        return "gmsh22"  # format 4.1 needs an entity for every tag
    kinds = meshio.extension_to_filetypes[suffix]
    known = [kind for kind in kinds if kind in meshio._helpers._writer_map]
    return min(known, key=lambda kind: (kind not in _WITH_DATA, kinds.index(kind)), default=None)


def read_foreign(path: Path) -> tuple[MeshData, list[str]]:
    """Read a file with the library that knows it; returns also notices of data left out.

    The library runs in a separate process, with a time limit of a minute plus a share for the size of
    the file: on damaged files meshio may read for ever, and VTK ends its process if a file asks for
    more memory than there is. The first file waits about a second for the process and the import; the
    process then stays for the next file.

    Raises
    ------
    WorkerError
        The library took too long, or its process died.
    """
    suffix = format_suffix(path)
    name, _ = _library(suffix)
    with tempfile.TemporaryDirectory(prefix="remeshvec-") as folder:
        plain = path.resolve()
        if suffix != path.suffix.lower():
            plain = Path(folder) / f"mesh{suffix}"
            plain.write_bytes(checked_bytes(path))
        limit = _SECONDS + plain.stat().st_size // _BYTES_PER_SECOND
        return _reader((name, plain, path.resolve().parent), limit)


def _read_here(task: tuple[str, Path, Path], _: None) -> tuple[MeshData, list[str]]:
    """Read in this process; materials are looked for in the folder that comes last."""
    name, path, folder = task
    library = importlib.import_module(name)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # pyvista reports errors of VTK as warnings
        if name == "trimesh":
            found = library.load(str(path), force="scene", process=False)
        else:
            found = library.read(str(path)) if name == "pyvista" else _read_meshio(library, path)
    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("always")
        read = {"trimesh": read_scene, "pyvista": read_pyvista, "meshio": read_meshio}[name]
        data = read(found)
    data.wrap = None
    if name != "trimesh":
        data = with_uv(data)
        read_materials(data, found.field_data, folder)
    return data, [str(warning.message) for warning in noticed]


_reader = StandingWorker(_read_here)


def _read_meshio(meshio: Any, path: Path) -> Any:
    """Try the formats of a suffix; ``meshio.read`` would end the process if none fits."""
    problem: Exception = ValueError("it is empty")
    for kind in meshio.extension_to_filetypes[path.suffix.lower()]:
        try:
            return meshio._helpers.reader_map[kind](str(path))
        except Exception as error:  # on a broken file, readers raise errors of any type
            problem = error
    raise problem


def with_uv(data: MeshData) -> MeshData:
    """Find texture coordinates by the name or the role of their data on vertices."""
    for name in (*data.feature_data, *_TEXTURE_COORDINATES):
        values = data.on_vertices.get(name)
        if values is not None and values.ndim == 2 and values.shape[1] in (2, 3):
            return with_uv_at_corners(data, name)
    return data


def write_foreign(path: Path, data: MeshData) -> tuple[bytes, set[str]]:
    """Return a file as the library that knows its suffix writes it, and the names of data in it."""
    suffix = format_suffix(path)
    name, library = _library(suffix)
    held = {*data.on_vertices, *data.on_faces, *data.on_corners}
    data = with_data_at_vertices(data)
    if name == "trimesh":
        return scene_bytes(library, data, suffix[1:])
    fields = material_fields(data, path)
    with tempfile.TemporaryDirectory(prefix="remeshvec-") as folder:
        file = str(Path(folder) / f"mesh{suffix}")
        if name == "pyvista":
            mesh = _polydata(library, data)
            for field, lines in fields.items():
                mesh.field_data[field] = lines
            mesh.save(file)
        else:
            kind = _writer(library, suffix)
            data = replace(data, on_vertices=dict(data.on_vertices), on_faces=dict(data.on_faces))
            lost = _fit(data, kind)
            _write_meshio(library, write_meshio(library.Mesh, data), file, kind)
            held = held - lost if kind in _WITH_DATA else set()
            if kind == "vtu":
                return with_fields(Path(file).read_bytes(), fields), held
        return Path(file).read_bytes(), held


def _fit(data: MeshData, kind: str | None) -> set[str]:
    """Reshape data for a format of meshio, and drop data that it cannot hold; returns their names."""
    lost = set()
    for table in (data.on_vertices, data.on_faces):
        for name, values in list(table.items()):
            flat = values.reshape(len(values), -1) if values.ndim > 1 else values
            if flat.ndim == 2 and flat.shape[1] == 2:  # VTK and Gmsh have vectors of three
                flat = np.column_stack([flat, np.zeros(len(flat), flat.dtype)])
            columns = 1 if flat.ndim == 1 else flat.shape[1]
            small = flat.dtype.kind in "iub" and flat.dtype.itemsize < 4
            table[name] = flat.astype(np.int32) if small else flat  # XDMF has no smaller integers
            if flat.dtype.kind not in "fiub" or columns not in _COLUMNS.get(kind, (columns,)):
                lost.add(name)
                del table[name]
    return lost


def _write_meshio(meshio: Any, mesh: Any, file: str, kind: str | None) -> None:
    options = {"data_format": "XML"} if kind == "xdmf" else {}  # one file, no HDF5 file beside it
    meshio.write(file, mesh, file_format=kind, **options)


def _polydata(pyvista: Any, data: MeshData) -> Any:
    mesh = pyvista.PolyData.from_regular_faces(data.V, data.F)
    for name, values in data.on_vertices.items():
        mesh.point_data[name] = values
    for name, values in data.on_faces.items():
        mesh.cell_data[name] = values
    if "uv" in data.on_vertices:
        mesh.point_data.active_texture_coordinates_name = "uv"
    return mesh
