"""Arrays for a mesh on the command line: indices, labels and lengths in, results out."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshFormatError
from ..files.disk import write_file
from ..output.result import RemeshResult

__all__ = ["read_array", "write_arrays"]

# Attributes of a result that `write_arrays` saves under the same names.
_SAVED = (
    "birth_face",
    "birth_barycentric",
    "face_birth",
    "corner_birth_face",
    "corner_birth_barycentric",
    "image_face",
    "image_barycentric",
    "face_labels",
    "vertex_map",
    "face_map",
    "feature_edges",
    "corners",
    "lengths",
)


def read_array(path: str, columns: int = 1, whole: bool = True) -> NDArray[np.generic]:
    """Read numbers from a text file (white space or commas, # starts a comment) or a ``.npy`` file.

    Parameters
    ----------
    path : str
    columns : int
        Numbers per row: the result has shape (k,) for one and (k, columns) for more.
    whole : bool
        Whether the numbers must be whole.

    Raises
    ------
    MeshFormatError
        The file cannot be read, or does not hold such numbers.
    """
    try:
        if Path(path).suffix == ".npy":
            values = np.load(path, allow_pickle=False)
        else:
            lines = Path(path).read_text(encoding="utf-8").split("\n")
            words = [w for line in lines for w in line.split("#")[0].replace(",", " ").split()]
            values = np.array([float(word) for word in words])
    except (OSError, ValueError, EOFError) as error:
        raise MeshFormatError(f"cannot read numbers from {path}: {error}") from error
    if values.dtype == np.bool_:
        return values
    if values.dtype.kind not in "iuf":
        raise MeshFormatError(f"{path} holds {values.dtype}, not numbers")
    if whole:
        if not (np.isfinite(values).all() and (values == np.rint(values)).all()):
            raise MeshFormatError(f"{path} must hold whole numbers")
        values = values.astype(np.int64)
    if columns > 1:
        if values.size % columns:
            raise MeshFormatError(
                f"{path} must hold {columns} numbers per row; it has {values.size}"
            )
        values = values.reshape(-1, columns)
    return values


def write_arrays(path: str, result: RemeshResult) -> None:
    """Save all arrays of a result except the mesh, as ``.npz``."""
    arrays = {name: getattr(result, name) for name in _SAVED}
    buffer = io.BytesIO()
    np.savez(buffer, **{name: array for name, array in arrays.items() if array is not None})
    write_file(path, buffer.getvalue())
