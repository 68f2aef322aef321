"""One item of a batch, of any kind: remeshed, and kept or written where the work is done."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..core import arguments
from ..errors import OptionError
from ..files.disk import FilePath
from ..files.mesh_files import MeshFile, read_mesh
from ..input.options import RemeshKeywords
from ..output.light import LIGHT_SUFFIX, LightResult
from ..output.result import RemeshResult
from ..pipeline.job import Lengths
from ..pipeline.remesh import remesh

if TYPE_CHECKING:
    from typing import Unpack

__all__ = ["StoredItem", "as_mesh", "is_pair", "remesh_any", "remesh_item", "remesh_to_file"]


def remesh_item(
    mesh: Any,
    L: Lengths | None = None,
    store: FilePath | None = None,
    **options: Unpack[RemeshKeywords],
) -> LightResult | str:
    """Remesh one mesh of a data set, as a task of a cluster: what comes back is light.

    For ``client.map``, bags and ``delayed`` of Dask, executors and the like; workers import it by its
    name.

    Parameters
    ----------
    mesh : str, path, (V, F), or a mesh
        The path of a file, arrays, a result of `read_mesh` or `remesh`, or any other object that `remesh`
        accepts. Where other machines do the work, paths are full ones, of files that all of them see.
    L : float, (n,) array, callable or Adaptive, optional
        Target edge length, as in `remesh`.
    store : str or path, optional
        Folder to write the result to, as `LightResult.save` does, so that only a path comes back. Its
        name is that of the input, with a digest of the result. Or a file that ends in ``.npz``.
    **options
        Options of `remesh`.

    Returns
    -------
    LightResult or str
        Arrays, labels and figures; with ``store`` the path of the file that holds them.

    Raises
    ------
    MeshInputError, MeshFormatError
        The item cannot be read as a triangle mesh, or the result cannot be written.
    OptionError
        An option cannot work, or there is no such folder.

    Examples
    --------
    >>> futures = client.map(remesh_item, paths, L=0.1, store="/shared/out")  # doctest: +SKIP
    """
    target = None if store is None else _target(arguments.path(store, "store"))
    mesh = as_mesh(mesh)
    light = _light(mesh, {"L": L, **options})
    if target is None:
        return light
    if target.suffix.lower() != LIGHT_SUFFIX:
        stem = Path(mesh).stem if isinstance(mesh, str) else "mesh"
        target = target / f"{stem}-{_digest(light)}{LIGHT_SUFFIX}"
    light.save(target)
    return str(target)


class StoredItem(NamedTuple):
    """An item, and the file that its result goes to."""

    mesh: Any
    path: str


def remesh_to_file(item: StoredItem, options: dict[str, Any]) -> str:
    """Remesh an item and write the result; return the path."""
    _light(item.mesh, options).save(item.path)
    return item.path


def remesh_any(mesh: Any, options: dict[str, Any]) -> Any:
    """Remesh a file, a pair of arrays or an object."""
    if isinstance(mesh, str):
        mesh = read_mesh(mesh)[:2]
    if is_pair(mesh):
        return remesh(*mesh, **options)
    call: Any = remesh
    return call(mesh, **options)


def as_mesh(item: Any) -> Any:
    """Return ``(V, F)``, a path, or an object that `remesh` has to read."""
    if isinstance(item, MeshFile | RemeshResult | LightResult):
        return item.V, item.F
    if isinstance(item, list) and len(item) == 2:
        return tuple(item)
    return os.fspath(item) if isinstance(item, os.PathLike) else item


def is_pair(mesh: Any) -> bool:
    """Tell arrays from paths and objects."""
    return isinstance(mesh, tuple) and len(mesh) == 2


def _light(mesh: Any, options: dict[str, Any]) -> LightResult:
    if isinstance(mesh, str):
        mesh = read_mesh(mesh)[:2]
    if is_pair(mesh):
        return remesh(*mesh, **options).light()
    call: Any = remesh
    _, result = call(mesh, return_result=True, **options)  # objects have no labels or figures
    return result.light()


def _target(store: str) -> Path:
    """Refuse a store that is not there, before the work."""
    path = Path(store)
    folder = path.parent if path.suffix.lower() == LIGHT_SUFFIX else path
    if not folder.is_dir():
        raise OptionError(f"store: there is no folder {folder} here; make it first")
    return path


def _digest(light: LightResult) -> str:
    """Return a name for a mesh that no other mesh has: the same again when a task runs again."""
    sha = hashlib.sha256()
    for array in light:
        sha.update(np.ascontiguousarray(array).tobytes())
    return sha.hexdigest()[:12]
