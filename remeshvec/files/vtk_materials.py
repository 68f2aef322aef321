"""Materials in VTP and VTU files: their names and libraries are field data, as VTK's OBJ reader has them.

VTP holds texts. In VTU files a text is an array of its UTF-8 codes, because meshio cannot read others.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from ..interop.mesh_data import MeshData
from .materials import in_line, relative

__all__ = ["material_fields", "read_materials", "with_fields"]

_LIBRARIES, _NAMES = "MaterialLibraries", "MaterialNames"

_FIELD = (
    '<DataArray type="UInt8" Name="{}" NumberOfComponents="1" NumberOfTuples="{}" format="ascii">'
    "{}</DataArray>"
)


def material_fields(data: MeshData, path: Path) -> dict[str, list[str]]:
    """Return the field data that name the materials and libraries of a mesh."""
    names = data.extra.get("material")
    if not names or "material" not in data.on_faces:
        return {}
    libraries = [in_line(relative(library, path)) for library in data.extra.get("mtllib", [])]
    fields = {_LIBRARIES: libraries, _NAMES: [in_line(name) for name in names]}
    return {field: lines for field, lines in fields.items() if lines}


def read_materials(data: MeshData, field_data: Any, folder: Path) -> None:
    """Put the materials that field data name into a mesh."""
    names = _lines(field_data, _NAMES)
    if not names or "material" not in data.on_faces:
        return
    data.extra["material"] = names
    libraries = _lines(field_data, _LIBRARIES)
    if libraries:
        data.extra["mtllib"] = [os.path.realpath(folder / name) for name in libraries]
    if "material" not in data.feature_data:
        data.feature_data = (*data.feature_data, "material")


def with_fields(content: bytes, fields: dict[str, list[str]]) -> bytes:
    """Return a VTU file with field data, which meshio does not write."""
    if not fields:
        return content
    arrays = []
    for name, lines in fields.items():
        codes = "\n".join(lines).encode()
        arrays.append(_FIELD.format(name, len(codes), " ".join(map(str, codes))))
    mark = b"<UnstructuredGrid>"
    field_data = f"<FieldData>{''.join(arrays)}</FieldData>".encode()
    return content.replace(mark, mark + field_data, 1)


def _lines(field_data: Any, name: str) -> list[str]:
    """Return a text of field data, or its codes, as lines."""
    if name not in field_data:
        return []
    values = np.asarray(field_data[name])
    if values.dtype.kind in "iu":
        return values.astype(np.uint8).tobytes().decode("utf-8", "replace").split("\n")
    return [str(value) for value in values.ravel()]
