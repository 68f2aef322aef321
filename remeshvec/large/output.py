"""The result in files: arrays that can be mapped, and a mesh file written row by row."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from ..core.vocabulary import FloatArray
from ..files.disk import named_errors
from ..files.stl import facets_of
from .index import Index, load_index
from .scratch import write_json
from .vocabulary import SurfaceMesh

__all__ = ["SUFFIXES", "arrays_folder", "write_arrays", "write_mesh_file", "write_result"]

SUFFIXES = (".ply", ".stl")

_AT_ONCE = 1 << 20  # rows in memory at a time
_FACE = np.dtype([("size", "u1"), ("corners", "<i4", 3)])


def arrays_folder(out: Path) -> Path:
    """Folder of the arrays: ``out`` itself, or beside a mesh file."""
    return out.with_name(f"{out.name}.arrays") if out.suffix.lower() in SUFFIXES else out


def write_result(
    scratch: Path,
    mesh: SurfaceMesh,
    births: Sequence[Path],
    frame: tuple[float, FloatArray],
    dtypes: tuple[np.dtype[Any], np.dtype[Any]],
    target: Path,
    report: dict[str, Any],
) -> None:
    """Write the arrays of a mesh in the units of the caller into a folder.

    Parameters
    ----------
    scratch : Path
    mesh : SurfaceMesh
        The last one.
    births : sequence of path
        Results of `tasks.LOCATE`, by part.
    frame : float, (3,) float64
        Scale and centre of the frame of the mesh.
    dtypes : pair of dtype
        Of ``V`` and ``F``.
    target : Path
    report : dict
    """
    index = load_index(scratch / "index")
    n, m = len(mesh.X), len(mesh.F)
    shapes: dict[str, tuple[tuple[int, ...], Any]] = {
        "V": ((n, 3), dtypes[0]),
        "F": ((m, 3), dtypes[1]),
        "birth_face": ((n,), np.int64),
        "birth_barycentric": ((n, 3), np.float64),
        "lengths": ((n,), np.float64),
    }
    if len(index.labels):
        shapes["face_labels"] = (m,), index.labels.dtype

    def fill(arrays: dict[str, NDArray[Any]]) -> None:
        _fill_vertices(arrays, births, *frame)
        _fill_faces(arrays, mesh, index)

    _write_folder(target, shapes, fill, report)


def _fill_vertices(
    arrays: dict[str, NDArray[Any]], births: Sequence[Path], scale: float, centre: FloatArray
) -> None:
    start = 0
    for path in births:
        with np.load(path) as part:
            V = part["V"] / scale + centre
            V[part["fixed"]] = part["fixed_points"]
            rows = slice(start, start + len(V))
            arrays["V"][rows] = V
            arrays["birth_face"][rows] = part["face"]
            arrays["birth_barycentric"][rows] = part["weights"]
            arrays["lengths"][rows] = part["lengths"] / scale
        start = rows.stop


def _fill_faces(arrays: dict[str, NDArray[Any]], mesh: SurfaceMesh, index: Index) -> None:
    for k in range(0, len(mesh.F), _AT_ONCE):
        rows = slice(k, k + _AT_ONCE)
        arrays["F"][rows] = mesh.F[rows]
        if "face_labels" in arrays:
            arrays["face_labels"][rows] = index.labels[mesh.source[rows]]


def write_arrays(target: Path, arrays: dict[str, NDArray[Any]], report: dict[str, Any]) -> None:
    """Write arrays in memory as the arrays of a result."""

    def fill(files: dict[str, NDArray[Any]]) -> None:
        for name, array in arrays.items():
            files[name][:] = array

    _write_folder(target, {k: (a.shape, a.dtype) for k, a in arrays.items()}, fill, report)


def _write_folder(
    target: Path,
    shapes: dict[str, tuple[tuple[int, ...], Any]],
    fill: Callable[[dict[str, NDArray[Any]]], None],
    report: dict[str, Any],
) -> None:
    """Write a folder of arrays under another name, then let it take the place of ``target``."""
    with named_errors("write", target):
        part = target.with_name(f".{target.name}.{secrets.token_hex(8)}.part")
        part.mkdir()
        try:
            files: dict[str, NDArray[Any]] = {
                name: open_memmap(part / f"{name}.npy", "w+", np.dtype(dtype), shape)
                for name, (shape, dtype) in shapes.items()
            }
            fill(files)
            for file in files.values():
                file.flush()  # type: ignore[attr-defined]
            del files
            write_json(part / "report.json", report)
            _replace_folder(part, target)
        except BaseException:
            shutil.rmtree(part, ignore_errors=True)
            raise


def _replace_folder(part: Path, target: Path) -> None:
    """Give a folder its name; one that has the name already goes when the new one is there."""
    if not target.exists():
        os.replace(part, target)
        return
    old = target.with_name(f".{target.name}.{secrets.token_hex(8)}.old")
    os.replace(target, old)
    os.replace(part, target)
    shutil.rmtree(old, ignore_errors=True)


def write_mesh_file(path: Path, V: NDArray[Any], F: NDArray[Any]) -> None:
    """Write a binary PLY or STL file row by row; it appears when it is complete.

    Raises
    ------
    MeshFormatError
        It cannot be written, or a coordinate is too large for STL.
    """
    write = _write_stl if path.suffix.lower() == ".stl" else _write_ply
    with named_errors("write", path):
        part = path.with_name(f".{secrets.token_hex(8)}.part")
        try:
            with open(part, "xb") as file:
                write(file, V, F)
                file.flush()
                os.fsync(file.fileno())
            os.replace(part, path)
        except BaseException:
            part.unlink(missing_ok=True)
            raise


def _write_ply(file: BinaryIO, V: NDArray[Any], F: NDArray[Any]) -> None:
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(V)}"]
    lines += [f"property double {axis}" for axis in "xyz"]
    lines += [f"element face {len(F)}", "property list uchar int vertex_indices", "end_header\n"]
    file.write("\n".join(lines).encode())
    for k in range(0, len(V), _AT_ONCE):
        file.write(np.ascontiguousarray(V[k : k + _AT_ONCE], "<f8").data)
    for k in range(0, len(F), _AT_ONCE):
        rows = np.empty(len(F[k : k + _AT_ONCE]), _FACE)
        rows["size"], rows["corners"] = 3, F[k : k + _AT_ONCE]
        file.write(rows.tobytes())


def _write_stl(file: BinaryIO, V: NDArray[Any], F: NDArray[Any]) -> None:
    file.write(b"remeshvec".ljust(80) + len(F).to_bytes(4, "little"))
    for k in range(0, len(F), _AT_ONCE):
        file.write(facets_of(V, np.asarray(F[k : k + _AT_ONCE])).tobytes())
