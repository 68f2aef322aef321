"""What `remesh_large` returns: maps of files, read where they are used."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from ..core import arguments
from ..core.vocabulary import FloatArray, IntArray
from ..errors import OptionError
from ..files.disk import check_writable, named_errors
from ..output.transfer import TRANSFER_METHODS, as_values, interpolate
from .scratch import load, read_json

__all__ = ["LargePart", "LargeResult", "open_result"]

_AT_ONCE = 1 << 20  # rows in memory at a time


class LargePart(NamedTuple):
    """Some faces of a large result, with the vertices that they use.

    Parameters
    ----------
    V : (k, 3) float
    F : (j, 3) int64
        Faces, as rows of ``V``.
    vertices, faces : slice of int64
        Numbers of both in the whole: ``vertices (k,)`` and ``faces (j,)``.
    birth_face : (k,) int64
    birth_barycentric : (k, 3) float64
    """

    V: NDArray[Any]
    F: IntArray
    vertices: IntArray
    faces: IntArray
    birth_face: IntArray
    birth_barycentric: FloatArray


@dataclass(frozen=True)
class LargeResult:
    """A remeshed surface in files; unpacks as ``V, F = result``.

    The arrays are maps of ``.npy`` files in ``folder``: what is read of them is loaded, and no more.

    Attributes
    ----------
    folder : Path
        Folder with the arrays and ``report.json``.
    V : (n, 3)
        Vertices, in the dtype of the input (float64 for integers).
    F : (m, 3)
        Faces.
    birth_face : (n,) int64
        Input face on which each vertex lies.
    birth_barycentric : (n, 3) float64
        Where on its birth face each vertex lies.
    lengths : (n,) float64
        Target edge length at every vertex.
    face_labels : (m,) int, or None
        Label of every face, where the input had labels.
    report : dict
        ``target_length``; ``faces`` and ``vertices``; ``rounds``, each with its name, parts, faces that
        were in them, and seconds; ``dirt`` and ``features`` as in `Report`.
    """

    folder: Path
    V: NDArray[Any] = field(repr=False)
    F: NDArray[Any] = field(repr=False)
    birth_face: IntArray = field(repr=False)
    birth_barycentric: FloatArray = field(repr=False)
    lengths: FloatArray = field(repr=False)
    face_labels: NDArray[Any] | None = field(repr=False)
    report: dict[str, Any] = field(repr=False)
    _input_faces: NDArray[Any] = field(repr=False, compare=False)
    _n_in: int = field(repr=False, compare=False)

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return iter((self.V, self.F))

    def parts(self, faces: int = 2_000_000) -> Iterator[LargePart]:
        """Yield the result in runs of so many faces, in order.

        Raises
        ------
        OptionError
            ``faces`` is not a whole number of at least 1.
        """
        return self._parts(arguments.count(faces, "faces"))

    def _parts(self, size: int) -> Iterator[LargePart]:
        for start in range(0, len(self.F), size):
            F = np.asarray(self.F[start : start + size], np.int64)
            vertices, corners = np.unique(F, return_inverse=True)
            yield LargePart(
                np.asarray(self.V[vertices]),
                corners.reshape(-1, 3).astype(np.int64),
                vertices,
                np.arange(start, start + len(F)),
                np.asarray(self.birth_face[vertices]),
                np.asarray(self.birth_barycentric[vertices]),
            )

    def transfer(self, values: Any, out: Any = None, method: str = "auto") -> NDArray[Any]:
        """Bring data on the vertices of the input to the result.

        Parameters
        ----------
        values : (n_in, ...) array, or path of a ``.npy`` file
            One entry, of any shape, for every vertex of the input; a file is read where it is used.
        out : path, optional
            ``.npy`` file to write. Without it, the values come back in memory.
        method : {"auto", "linear", "nearest"}
            As in `RemeshResult.transfer`.

        Returns
        -------
        (n, ...)
            In the dtype of ``values``: an array, or the map of the file.

        Raises
        ------
        OptionError
            The shape does not fit, or there is no such ``method``.
        MeshFormatError
            A file cannot be read or written.
        """
        method = arguments.choice(method, "method", TRANSFER_METHODS)
        if isinstance(values, str | Path):
            with named_errors("read", Path(values)):
                values = np.load(values, mmap_mode="r", allow_pickle=False)
        values = as_values(values, (self._n_in,), "vertices")
        shape = (len(self.V), *values.shape[1:])
        if out is None:
            return self._filled(np.empty(shape, values.dtype), values, method)
        path = Path(arguments.path(out, "out"))
        check_writable(path, (".npy",))
        part = path.with_name(f".{path.name}.part")
        with named_errors("write", path):
            file = open_memmap(part, "w+", values.dtype, shape)
            self._filled(file, values, method).flush()  # type: ignore[attr-defined]
            del file
            part.replace(path)
            return np.load(path, mmap_mode="r")

    def _filled(self, into: NDArray[Any], values: NDArray[Any], method: str) -> NDArray[Any]:
        for start in range(0, len(into), _AT_ONCE):
            rows = slice(start, start + _AT_ONCE)
            corners = np.asarray(self._input_faces[self.birth_face[rows]], np.int64)
            # The values of few vertices at a time: a file of them is not read as a whole.
            used, index = np.unique(corners, return_inverse=True)
            weights = np.asarray(self.birth_barycentric[rows])
            into[rows] = interpolate(
                np.asarray(values[used]), index.reshape(-1, 3), weights, method
            )
        return into


def open_result(folder: Path, F: NDArray[Any], n: int) -> LargeResult:
    """Map the arrays of a folder; ``F`` and ``n`` are the faces and number of vertices of the input."""
    names = ["V", "F", "birth_face", "birth_barycentric", "lengths"]
    labels = ["face_labels"] if (folder / "face_labels.npy").is_file() else []
    arrays = load(folder, *names, *labels)
    report = read_json(folder / "report.json")
    if report is None:
        raise OptionError(f"{folder} does not hold a result of remesh_large")
    return LargeResult(
        folder,
        **{name: arrays[name] for name in names},
        face_labels=arrays.get("face_labels"),
        report=report,
        _input_faces=F,
        _n_in=n,
    )
