"""A mesh as callers give it: two arrays, a pair, an object of another library, or a result."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import numpy as np

from .objects import is_mesh_object, read_object

__all__ = ["MeshObject", "has_arrays", "is_pair", "is_whole", "takes_meshes", "whole_arrays"]

MeshObject = Any  # of another library, a pair, or a result
Function = TypeVar("Function", bound=Callable[..., Any])


def is_pair(V: Any) -> bool:
    """Tell the arrays of a whole mesh from two vertices."""
    if not isinstance(V, tuple | list) or len(V) != 2:
        return False
    try:
        return all(len(np.shape(x)) == 2 for x in V)
    except ValueError:  # rows of unequal length
        return False


def has_arrays(value: Any) -> bool:
    """Recognise what has a mesh as V and F: results, and what `read_mesh` returns."""
    return hasattr(value, "V") and hasattr(value, "F")


def is_whole(V: Any) -> bool:
    """Tell whether a value is a whole mesh, and not the vertices of one."""
    return is_pair(V) or has_arrays(V) or is_mesh_object(V)


def whole_arrays(mesh: Any) -> tuple[Any, Any]:
    """Return the arrays of a whole mesh.

    Raises
    ------
    MeshInputError
        The object does not hold a surface, or its type is unknown.
    """
    if is_pair(mesh):
        return mesh[0], mesh[1]
    if has_arrays(mesh):
        return mesh.V, mesh.F
    data = read_object(mesh)
    return data.V, data.F


def takes_meshes(function: Function) -> Function:
    """Let a function of ``V, F`` take a whole mesh in the place of both; the rest follows it."""

    @wraps(function)
    def called(V: Any = None, F: Any = None, *rest: Any, **keywords: Any) -> Any:
        if is_whole(V):
            after = rest if F is None else (F, *rest)
            return function(*whole_arrays(V), *after, **keywords)
        if F is None and not (hasattr(V, "__array__") or isinstance(V, tuple | list)):
            read_object(V)  # which says what this is instead
        return function(V, F, *rest, **keywords)

    return called  # type: ignore[return-value]
