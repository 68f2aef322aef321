"""Records of the rounds: the mesh between them, and the parts of one."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import BoolArray, FloatArray, IndexArray, IntArray
from .scratch import load, save_arrays

__all__ = ["Parts", "SurfaceMesh", "group_rows", "load_mesh", "mark", "save_mesh"]


class SurfaceMesh(NamedTuple):
    """The mesh of the whole surface between two rounds; half-edges of the reference are global.

    Parameters
    ----------
    F : (m, 3) int32
    X : (n, 4) float64
        Coordinates in the frame of the prepared input, and target lengths.
    kind : (n,) uint8
    birth : (n,) int32
        Half-edge of the reference.
    curve : (m, 3) int32
        As `Mesh.curve`, of the half-edge that leaves each corner.
    source : (m,) int32
        Face of the reference.
    """

    F: IndexArray
    X: FloatArray
    kind: NDArray[np.uint8]
    birth: IndexArray
    curve: IndexArray
    source: IndexArray


def save_mesh(folder: Path, mesh: SurfaceMesh) -> None:
    """Write a mesh into a folder."""
    save_arrays(folder, mesh._asdict())


def load_mesh(folder: Path) -> SurfaceMesh:
    """Map the mesh of a folder."""
    return SurfaceMesh(**load(folder, *SurfaceMesh._fields))


class Parts(NamedTuple):
    """The tasks of a round: faces that a task may change, and faces around them that it only sees.

    Parameters
    ----------
    core : (k,) int64
        Faces, part after part.
    core_start : (p + 1,) int64
    ring : (j,) int64
        Faces, part after part.
    ring_start : (p + 1,) int64
    moved : (i,) int64
        Vertices that a task of moves owns, part after part; none in other rounds.
    moved_start : (p + 1,) int64
    shared : (s,) int64
        Vertices of two parts or more, in ascending order.
    """

    core: IntArray
    core_start: IntArray
    ring: IntArray
    ring_start: IntArray
    moved: IntArray
    moved_start: IntArray
    shared: IntArray

    @property
    def number(self) -> int:
        """Number of parts."""
        return len(self.core_start) - 1

    def of(self, name: str, k: int) -> IntArray:
        """Return what part ``k`` has of ``core``, ``ring`` or ``moved``."""
        rows: IntArray = getattr(self, name)
        start: IntArray = getattr(self, f"{name}_start")
        return np.asarray(rows[start[k] : start[k + 1]])


def group_rows(group: NDArray[Any], count: int) -> tuple[IntArray, IntArray]:
    """Sort row numbers by their group, those below 0 left out; returns rows and where groups start."""
    rows = np.flatnonzero(group >= 0)
    rows = rows[np.argsort(group[rows], kind="stable")]
    start = np.zeros(count + 1, np.int64)
    np.cumsum(np.bincount(group[rows], minlength=count), out=start[1:])
    return rows, start


def mark(n: int, rows: NDArray[Any]) -> BoolArray:
    """Mask of n elements with some of them marked."""
    mask = np.zeros(n, np.bool_)
    mask[rows] = True
    return mask
