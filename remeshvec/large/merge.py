"""Put a round together: what its tasks wrote, and what they left alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import BoolArray, IntArray
from .scratch import Arrays
from .vocabulary import SurfaceMesh, mark

__all__ = ["merge_changes", "merge_moves"]


def merge_changes(mesh: SurfaceMesh, changed: BoolArray, files: Sequence[Path]) -> SurfaceMesh:
    """Return the mesh with the changed faces replaced; parts come in their order, after the others.

    Parameters
    ----------
    mesh : SurfaceMesh
    changed : (m,) bool
        Faces of the cores of all parts.
    files : sequence of path
        Results of `tasks.SWEEP`, by part.
    """
    stays = np.flatnonzero(~changed)
    arrays = [_read(path) for path in files]
    F = _in_one_numbering(mesh, stays, arrays)
    used = mark(len(mesh.X) + sum(len(part["X"]) for part in arrays), F)
    number = np.cumsum(used, dtype=np.int32) - 1
    old, new = used[: len(mesh.X)], used[len(mesh.X) :]

    def vertices(name: str) -> NDArray[Any]:
        of_parts = np.concatenate([part[name] for part in arrays])
        return np.concatenate([getattr(mesh, name)[old], of_parts[new]])

    def faces(name: str) -> NDArray[Any]:
        return np.concatenate([getattr(mesh, name)[stays], *(part[name] for part in arrays)])

    return SurfaceMesh(
        np.ascontiguousarray(number[F], np.int32),
        vertices("X"),
        vertices("kind"),
        vertices("birth"),
        faces("curve"),
        faces("source"),
    )


def _in_one_numbering(mesh: SurfaceMesh, stays: IntArray, arrays: Sequence[Arrays]) -> IntArray:
    """Faces that stay, then those of the parts; vertices of each part follow those of the mesh."""
    n = len(mesh.X)
    faces = [np.asarray(mesh.F[stays], np.int64)]
    for part in arrays:
        F = part["F"]
        faces.append(np.where(F < 0, -1 - F, n + F))
        n += len(part["X"])
    return np.concatenate(faces)


def merge_moves(mesh: SurfaceMesh, files: Sequence[Path]) -> SurfaceMesh:
    """Return the mesh with the vertices moved that tasks of moves own."""
    X, birth = np.array(mesh.X), np.array(mesh.birth)
    for path in files:
        part = _read(path)
        X[part["vertices"]], birth[part["vertices"]] = part["X"], part["birth"]
    return mesh._replace(X=X, birth=birth)


def _read(path: Path) -> Arrays:
    with np.load(path) as file:
        return dict(file)
