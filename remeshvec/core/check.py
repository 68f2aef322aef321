"""Checks and casts of the caller's arrays, and the wording of input errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import MeshInputError, OptionError, RemeshvecError

__all__ = [
    "as_array",
    "as_faces",
    "as_indices",
    "as_mask",
    "as_mesh",
    "as_numbers",
    "as_vertices",
    "which",
]

_NO_ARRAY = "is not a rectangular array of numbers (rows of unequal length?)"


def as_mesh(
    V: ArrayLike, F: ArrayLike, names: tuple[str, str] = ("V", "F")
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Check and cast a triangle mesh.

    Parameters
    ----------
    V : (n, 3) float or int, array or nested lists
    F : (m, 3) int, array or nested lists
    names : (str, str)
        What the caller's arguments are called, for messages.

    Returns
    -------
    V : (n, 3) float64, C-contiguous
        The caller's own array if it needs no cast: never write to it.
    F : (m, 3) int64, C-contiguous
        Likewise.

    Raises
    ------
    MeshInputError
        The shape or the dtype is wrong, there are no faces, or a face names a vertex that is not finite
        or does not exist.
    """
    vertices = as_vertices(V, names[0])
    faces = as_faces(F, len(vertices), names[1])
    _check_finite(vertices, faces, names[0])
    return vertices, faces


def as_vertices(V: ArrayLike, name: str = "V") -> NDArray[np.float64]:
    """Cast to (n, 3) float64."""
    array = as_array(V, name, MeshInputError)
    if array.ndim == 2 and array.shape[1] == 2:
        raise MeshInputError(
            f"{name} has shape {array.shape}, two coordinates per vertex; "
            f"add a third: np.column_stack([{name}, np.zeros(len({name}))])"
        )
    if array.ndim != 2 or array.shape[1] != 3:
        raise MeshInputError(
            f"{name} must have shape (n, 3), one vertex per row; got {array.shape}"
        )
    if array.dtype.kind not in "fiu":
        raise MeshInputError(f"{name} must hold real numbers; got dtype {array.dtype}")
    return np.ascontiguousarray(array, dtype=np.float64)


def as_faces(F: ArrayLike, n_vertices: int, name: str = "F") -> NDArray[np.int64]:
    """Cast to (m, 3) int64 with indices in ``range(n_vertices)``."""
    array = as_array(F, name, MeshInputError)
    if array.size == 0:
        raise MeshInputError(f"{name} is empty: the mesh has no faces")
    if array.ndim == 2 and array.shape[1] > 3:
        raise MeshInputError(
            f"{name} has shape {array.shape}: polygons with {array.shape[1]} corners; "
            "triangulate them first"
        )
    if array.ndim != 2 or array.shape[1] != 3:
        raise MeshInputError(
            f"{name} must have shape (m, 3), one triangle per row; got {array.shape}"
        )
    if array.dtype.kind == "f" and np.isfinite(array).all() and (array == np.rint(array)).all():
        array = array.astype(np.int64)
    if array.dtype.kind not in "iu":
        raise MeshInputError(f"{name} must hold integer vertex indices; got dtype {array.dtype}")
    faces = np.ascontiguousarray(array, dtype=np.int64)
    if faces.view(np.uint64).max() >= n_vertices:  # or negative
        low, high = int(array.min()), int(array.max())
        bad = np.flatnonzero(((array < 0) | (array >= n_vertices)).any(axis=1))
        raise MeshInputError(
            f"{which(bad, 'face')} of {name} name vertices outside 0 to {n_vertices - 1} "
            f"(indices run from {low} to {high}); indices are 0-based"
        )
    return faces


def as_mask(value: Any, count: int, name: str, noun: str) -> NDArray[np.bool_]:
    """Return a new mask of faces or vertices, from a mask or from indices."""
    array = as_array(value, name)
    if array.dtype == np.bool_:
        if array.shape != (count,):
            raise OptionError(f"{name} as a mask must have shape ({count},); got {array.shape}")
        return array.copy()
    mask = np.zeros(count, np.bool_)
    mask[as_indices(array, count, name, noun)] = True
    return mask


def as_indices(value: Any, count: int, name: str, noun: str) -> NDArray[np.int64]:
    """Check an option that holds indices below ``count``."""
    array = as_array(value, name)
    if array.size == 0:
        return np.empty(0, np.int64)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise OptionError(
            f"{name} must hold {noun} indices; got shape {array.shape} of {array.dtype}"
        )
    bad = np.flatnonzero((array < 0) | (array >= count))
    if len(bad):
        raise OptionError(
            f"{name}[{bad[0]}] = {array[bad[0]]} is not a {noun} index; they run from 0 to {count - 1}"
        )
    return array.astype(np.int64)


def as_numbers(value: Any, name: str, *shapes: tuple[int | str, ...]) -> NDArray[np.float64]:
    """Check finite real numbers of one of several shapes, and cast them to float64; always a copy.

    Parameters
    ----------
    value : object
        What the caller gave.
    name : str
        Name of the argument, for the message.
    *shapes : tuple
        Shapes that are allowed; a letter stands for any length: ``(n, "c")``.
    """
    array = as_array(value, name)
    if array.dtype.kind not in "fiu" or not any(_fits(array.shape, shape) for shape in shapes):
        wanted = " or ".join(_shape_text(shape) for shape in shapes)
        raise OptionError(
            f"{name} must hold real numbers in shape {wanted}; got {array.shape} of {array.dtype}"
        )
    if not np.isfinite(array).all():
        bad = np.flatnonzero(~np.isfinite(array.reshape(len(array), -1)).all(axis=1))
        raise OptionError(f"{which(bad, 'row')} of {name} are NaN or infinite")
    return array.astype(np.float64, order="C")


def _fits(shape: tuple[int, ...], wanted: tuple[int | str, ...]) -> bool:
    return len(shape) == len(wanted) and all(
        isinstance(b, str) or a == b for a, b in zip(shape, wanted, strict=True)
    )


def _shape_text(shape: tuple[int | str, ...]) -> str:
    return f"({', '.join(str(length) for length in shape)}{',' * (len(shape) == 1)})"


def as_array(value: Any, name: str, error: type[RemeshvecError] = OptionError) -> NDArray[Any]:
    """Check that an argument is an array of numbers, a tensor or nested lists; raises ``error``."""
    try:
        array = np.asarray(value.detach().cpu() if hasattr(value, "detach") else value)
    except (ValueError, TypeError) as problem:
        raise error(f"{name} {_NO_ARRAY}") from problem
    if array.dtype == object:
        raise error(f"{name} {_NO_ARRAY}")
    return array


def _check_finite(V: NDArray[np.float64], F: NDArray[np.int64], name: str) -> None:
    """Refuse NaN and infinity, except at vertices that no face uses."""
    with np.errstate(invalid="ignore", over="ignore"):
        if np.isfinite(V.sum()):  # 5 times faster than a look at each number
            return
    is_bad = ~np.isfinite(V).all(axis=1)
    bad = np.flatnonzero(is_bad & (np.bincount(F.ravel(), minlength=len(V)) > 0))
    if len(bad):
        raise MeshInputError(
            f"{which(bad, 'vertex')} of {name} are NaN or infinite; "
            "remove them and their faces, or repair the coordinates"
        )


def which(indices: NDArray[np.intp], noun: str) -> str:
    """Name some elements: ``3 faces (12, 40, 41)``."""
    shown = ", ".join(str(i) for i in indices[:5]) + (", ..." if len(indices) > 5 else "")
    plural = {"vertex": "vertices"}.get(noun, noun + "s")
    return f"{len(indices)} {plural if len(indices) > 1 else noun} ({shown})"
