"""Mesh objects through the pipeline: read, remeshed, and made anew with the data that they carried."""

from __future__ import annotations

from dataclasses import replace
from numbers import Real
from typing import Any

from ..errors import OptionError
from ..input.options import RemeshOptions
from ..interop.mesh_data import MeshData, carry
from ..interop.objects import is_mesh_object, read_object
from ..output.result import RemeshResult
from ..sizing.adaptive import Adaptive
from .arrays import remesh_arrays

__all__ = ["are_arrays", "only_length", "remesh_object", "with_named_data"]


def are_arrays(V: Any, F: Any) -> bool:
    """Tell two arrays from a mesh object and, perhaps, a length; not for pairs and results."""
    is_length = F is None or isinstance(F, Real | str | Adaptive) or callable(F)
    is_array = hasattr(V, "__array__") or isinstance(V, tuple | list)
    return not (is_mesh_object(V) or (is_length and not is_array))


def only_length(F: Any, L: Any) -> Any:
    """Return the length that follows a mesh object, in the place of the faces or after it."""
    if F is not None and L is not None:
        raise OptionError("a mesh object is followed by the length alone")
    return L if F is None else F


def remesh_object(mesh: Any, L: Any, options: RemeshOptions) -> tuple[Any, RemeshResult]:
    """Remesh an object; returns a new one of its type with the same data, and the result."""
    data = read_object(mesh)
    result = remesh_arrays(data.V, data.F, *with_named_data(data, L, options))
    assert data.wrap is not None
    return data.wrap(carry(data, result)), result


def with_named_data(data: MeshData, L: Any, options: RemeshOptions) -> tuple[Any, RemeshOptions]:
    """Put data of an object in the place of their names, and keep those that are features."""
    if isinstance(L, str):
        if L not in data.on_vertices:
            raise OptionError(f"there are no data {L!r} on vertices; {_names_of(data.on_vertices)}")
        L = data.on_vertices[L]
    changes = {
        name: _named(data, value, name)
        for name in ("fixed_faces", "face_labels", "selection")
        if isinstance(value := getattr(options, name), str)
    }
    preserve = options.preserve
    if preserve is None:
        several: Any = []
    else:
        several = preserve if isinstance(preserve, list | tuple) else [preserve]
    found = [_named(data, x, "preserve") if isinstance(x, str) else x for x in several]
    return L, replace(options, preserve=data.preserved(found), **changes)


def _named(data: MeshData, name: str, option: str) -> Any:
    known = {
        **data.on_faces,
        **(data.on_corners | data.on_vertices if option == "preserve" else {}),
    }
    if name not in known:
        raise OptionError(f"{option}: there are no data {name!r}; {_names_of(known)}")
    return data.find(name)


def _names_of(data: dict[str, Any]) -> str:
    return "there are " + ", ".join(map(repr, data)) if data else "the mesh carries none"
