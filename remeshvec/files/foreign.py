"""Files that other libraries read and write: meshio, pyvista and trimesh, each if it is installed."""

from __future__ import annotations

import importlib
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ..interop.mesh_data import MeshData, split_vertices
from ..interop.meshio_data import read_meshio, write_meshio
from ..interop.objects import COLOUR, UV, read_pyvista, read_trimesh
from ..processes.pool import StandingWorker

__all__ = ["can_write", "read_foreign", "write_foreign"]

_OWN = ".obj, .off, .ply, .stl, .json"
# meshio reads these too, but as a drawing or a table, or only together with a second file.
_NOT_MESHIO = (".svg", ".xml", ".dat", ".post", ".post.gz", ".ele", ".node")
_PYVISTA = (".vtp",)
_TRIMESH = (".glb", ".gltf", ".3mf", ".dae")
_READ_ONLY = (".3mf", ".dae")  # trimesh writes them without the data

# Formats of meshio that hold any data on points and cells, with the numbers of components allowed.
_WITH_DATA = ("vtk", "vtu", "xdmf", "gmsh22")
_COLUMNS: dict[str | None, tuple[int, ...]] = {"xdmf": (1, 3, 6, 9), "gmsh22": (1, 3, 9)}

_SCENE = "scene:geometry"

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
    name, _ = _library(path.suffix.lower())
    limit = _SECONDS + path.stat().st_size // _BYTES_PER_SECOND
    return _reader((name, path.resolve()), limit)


def _read_here(task: tuple[str, Path], _: None) -> tuple[MeshData, list[str]]:
    """Read in this process."""
    name, path = task
    library = importlib.import_module(name)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # pyvista reports errors of VTK as warnings
        if name == "trimesh":
            found = library.load(str(path), force="scene", process=False)
        else:
            found = library.read(str(path)) if name == "pyvista" else _read_meshio(library, path)
    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("always")
        read = {"trimesh": _read_scene, "pyvista": read_pyvista, "meshio": read_meshio}[name]
        data = read(found)
    data.wrap = None
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


def _read_scene(scene: Any) -> MeshData:
    """Join all meshes of a scene in place; each becomes a group of faces."""
    parts = [mesh for mesh in scene.dump(concatenate=False) if hasattr(mesh, "faces")]
    if not parts:
        raise ValueError("it holds no triangle mesh")
    read = [read_trimesh(mesh) for mesh in parts]
    start = np.cumsum([0, *(len(part.V) for part in read)])
    out = MeshData(
        np.concatenate([part.V for part in read]),
        np.concatenate([part.F + n for part, n in zip(read, start, strict=False)]),
    )
    out.extra["scene"] = parts
    if len(parts) > 1:
        out.on_faces[_SCENE] = np.repeat(np.arange(len(parts)), [len(part.F) for part in read])
    for side in ("on_vertices", "on_faces"):
        counts = [len(part.V if side == "on_vertices" else part.F) for part in read]
        tables = [getattr(part, side) for part in read]
        for name in dict.fromkeys(name for table in tables for name in table):
            values = _joined([table.get(name) for table in tables], counts)
            if values is not None:
                getattr(out, side)[name] = values
    feature_data = [
        name
        for part in read
        for name in part.feature_data
        if name in out.on_vertices | out.on_faces
    ]
    out.feature_data = (*dict.fromkeys(feature_data), *([_SCENE] if len(parts) > 1 else []))
    return out


def _joined(arrays: list[Any], counts: list[int]) -> Any:
    """Concatenate arrays, with zeros for missing ones; None if their shapes differ."""
    known = [x for x in arrays if x is not None]
    if len({x.shape[1:] for x in known}) > 1:
        return None
    blank = [np.zeros((n, *known[0].shape[1:]), known[0].dtype) for n in counts]
    return np.concatenate([b if x is None else x for x, b in zip(arrays, blank, strict=True)])


def write_foreign(path: Path, data: MeshData) -> tuple[bytes, set[str]]:
    """Return a file as the library that knows its suffix writes it, and the names of data in it."""
    suffix = path.suffix.lower()
    name, library = _library(suffix)
    held = {*data.on_vertices, *data.on_faces, *data.on_corners}
    data = _vertex_values(data)
    with tempfile.TemporaryDirectory(prefix="remeshvec-") as folder:
        file = str(Path(folder) / f"mesh{suffix}")
        if name == "trimesh":
            held -= set(data.on_faces) - {_SCENE, COLOUR, "color"}
            return bytes(_as_scene(library, data).export(file_type=suffix[1:])), held
        if name == "pyvista":
            _polydata(library, data).save(file)
        else:
            kind = _writer(library, suffix)
            data = _plain_names(data)
            lost = _fit(data, kind)
            _write_meshio(library, write_meshio(library.Mesh, data), file, kind)
            held = held - lost if kind in _WITH_DATA else set()
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


def _vertex_values(data: MeshData) -> MeshData:
    """Move data on corners to vertices; vertices whose corners differ are doubled."""
    if not data.on_corners:
        return data
    corner, F = split_vertices(data.F, list(data.on_corners.values()))
    old = data.F.ravel()[corner]
    on_vertices = {name: x[old] for name, x in data.on_vertices.items()}
    on_vertices |= {
        name: x.reshape(-1, *x.shape[2:])[corner] for name, x in data.on_corners.items()
    }
    return MeshData(data.V[old], F, on_vertices, data.on_faces, extra=data.extra)


_PLAIN = {UV: "uv", COLOUR: "color"}


def _plain_names(data: MeshData) -> MeshData:
    """Replace names that stand for a scene or its visuals by the names that files use."""
    vertices = {_PLAIN.get(name, name): x for name, x in data.on_vertices.items()}
    faces = {_PLAIN.get(name, name): x for name, x in data.on_faces.items() if name != _SCENE}
    return MeshData(data.V, data.F, vertices, faces, extra=data.extra)


def _polydata(pyvista: Any, data: MeshData) -> Any:
    data = _plain_names(data)
    mesh = pyvista.PolyData.from_regular_faces(data.V, data.F)
    for name, values in data.on_vertices.items():
        mesh.point_data[name] = values
    for name, values in data.on_faces.items():
        mesh.cell_data[name] = values
    if "uv" in data.on_vertices:
        mesh.point_data.active_texture_coordinates_name = "uv"
    return mesh


def _as_scene(trimesh: Any, data: MeshData) -> Any:
    """Make a scene with one mesh per part, each with the visuals of the part that was read."""
    parts = data.extra.get("scene", [None])
    member = data.on_faces.get(_SCENE, np.zeros(len(data.F), np.int64))
    meshes = []
    for k, part in enumerate(parts):
        rows = np.flatnonzero(member == k)
        if len(rows):
            used, F = np.unique(data.F[rows], return_inverse=True)
            vertices = {name: x[used] for name, x in data.on_vertices.items()}
            faces = {name: x[rows] for name, x in data.on_faces.items()}
            meshes.append(_trimesh(trimesh, part, MeshData(
                data.V[used], F.reshape(-1, 3), vertices, faces, extra=data.extra
            )))  # fmt: skip
    return trimesh.Scene(meshes)


def _trimesh(trimesh: Any, part: Any, data: MeshData) -> Any:
    mesh = trimesh.Trimesh(data.V, data.F, process=False)
    if part is not None:
        mesh.metadata.update(part.metadata)
    looks = _plain_names(data)
    uv, colour = looks.on_vertices.get("uv"), looks.on_vertices.get("color")
    has_texture = part is None or part.visual.kind == "texture"
    if uv is not None and has_texture:
        material = None if part is None else part.visual.material
        mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    elif colour is not None and (part is None or part.visual.kind == "vertex"):
        mesh.visual.vertex_colors = _bytes(colour)
    elif "color" in looks.on_faces and (part is None or part.visual.kind == "face"):
        mesh.visual.face_colors = _bytes(looks.on_faces["color"])
    for name, values in looks.on_vertices.items():
        if name not in ("uv", "color", "normal") and values.dtype.kind in "fiub":
            plain = values.astype(np.uint8) if values.dtype.kind == "b" else values
            mesh.vertex_attributes[name if name.startswith("_") else f"_{name}"] = plain
    return mesh


def _bytes(colour: Any) -> Any:
    return np.rint(255 * colour).astype(np.uint8) if colour.dtype.kind == "f" else colour
