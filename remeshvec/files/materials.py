"""Materials: names, colours and images, in MTL libraries beside a mesh or inside a glTF file.

A mesh names its materials in ``extra["material"]``, in the order of the numbers on its faces. What they
look like is in libraries (``extra["mtllib"]``, paths) or, where a file held it itself, in
``extra["materials"]``. Libraries and images are named by relative paths and stay where they are; only
what came out of a glTF file is written beside the mesh, never over a file with another content.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..interop.mesh_data import MeshData
from .disk import check_regular, format_suffix, write_file

__all__ = [
    "WHITE",
    "Material",
    "image_bytes",
    "in_line",
    "known_materials",
    "relative",
    "unique_names",
    "with_library",
]

WHITE = (1.0, 1.0, 1.0, 1.0)

# The formats in which images come, by their first bytes. Nothing else that a library names is opened
# and copied: it may come from strangers.
_IMAGES = {
    ".png": b"\x89PNG", ".jpg": b"\xff\xd8\xff", ".bmp": b"BM", ".gif": b"GIF8", ".webp": b"RIFF",
    ".tif": b"II*\0", ".tiff": b"MM\0*",
}  # fmt: skip
_MOST_BYTES = 1 << 30

_NOT_IN_NAMES = re.compile(r"[\r\n\0#]")
# Options that come before the name of an image, with their numbers.
_MAP_OPTION = re.compile(r"-(?:blend[uv]|cc|clamp|bm|boost|mm|[ost]|texres|imfchan|type)\s")
_WORD = re.compile(r"(?:on|off|[rgbmlz]|[-+.\deE]+)\s")


@dataclass(frozen=True)
class Material:
    """How faces look.

    Attributes
    ----------
    name : str
    color : (red, green, blue, alpha)
        From 0 to 1.
    image : path, bytes or None
        A file, or its content.
    native : object
        The same as the library that read it has it, with everything that has no place here.
    """

    name: str
    color: tuple[float, ...] = WHITE
    image: Path | bytes | None = None
    native: Any = None


def known_materials(data: MeshData) -> list[Material]:
    """Return the materials of a mesh in the order of their numbers; plain ones where nothing is known."""
    own = data.extra.get("materials")
    if own is not None:
        return list(own)
    known: dict[str, Material] = {}
    for library in reversed(data.extra.get("mtllib", [])):
        known |= _read_library(Path(library))
    names = data.extra.get("material", [])
    return [known.get(name, Material(name)) for name in names]


def unique_names(names: Iterable[str]) -> list[str]:
    """Return names that differ, for those that are empty or come twice."""
    taken: list[str] = []
    for name in names:
        new, k = name or "material", 1
        while new in taken:
            k += 1
            new = f"{name or 'material'}-{k}"
        taken.append(new)
    return taken


def image_bytes(material: Material) -> bytes | None:
    """Return the image of a material as it is stored; None where there is none that can be read."""
    if not isinstance(material.image, Path):
        return material.image
    try:
        check_regular(material.image)
        if material.image.stat().st_size > _MOST_BYTES:
            return None
        content = material.image.read_bytes()
    except (OSError, ValueError):
        return None
    return content if _suffix(content) else None


def with_library(data: MeshData, path: Path) -> MeshData:
    """Write the materials that are in no library beside a mesh file; returns the mesh that names them.

    Raises
    ------
    MeshFormatError
        A file cannot be written.
    """
    own = data.extra.get("materials")
    if "mtllib" in data.extra or not own or "material" not in data.on_faces:
        return data
    if format_suffix(path) == ".ply" and all(map(_is_image_file, own)):
        return data  # PLY names images itself
    materials = [_with_image_file(material, path) for material in own]
    library = _place(_beside(path, ".mtl"), _library_bytes(materials, path))
    return replace(data, extra={**data.extra, "materials": materials, "mtllib": [str(library)]})


def in_line(name: str) -> str:
    """Return a name on one line, so that the next statement is still read."""
    return _NOT_IN_NAMES.sub(" ", name).rstrip("\\ \t")


def relative(target: str | Path, path: Path) -> str:
    """Return the path of a file as seen from the folder of another."""
    try:
        return Path(os.path.relpath(target, os.path.dirname(os.path.realpath(path)))).as_posix()
    except ValueError:  # on another drive
        return str(target)


def _is_image_file(material: Material) -> bool:
    return isinstance(material.image, Path) and material.color == WHITE


def _read_library(path: Path) -> dict[str, Material]:
    """Read the colours and images of an MTL file; nothing from one that is missing or damaged."""
    try:
        check_regular(path)
        text = path.read_bytes().decode("utf-8", "replace")
    except (OSError, ValueError):
        return {}
    known: dict[str, Material] = {}
    name = None
    for line in text.splitlines():
        keyword, _, operand = line.strip().partition(" ")
        if keyword == "newmtl":
            name = operand.strip()
            known[name] = Material(name)
        elif name is not None:
            known[name] = _with_statement(known[name], keyword, operand.strip(), path.parent)
    return known


def _with_statement(material: Material, keyword: str, operand: str, folder: Path) -> Material:
    """Return a material with one more statement of its library."""
    if keyword == "map_Kd" and operand:
        return replace(material, image=folder / _image_name(operand).replace("\\", "/"))
    try:
        numbers = tuple(min(max(float(word), 0.0), 1.0) for word in operand.split())
    except ValueError:
        return material
    if keyword == "Kd" and len(numbers) == 3:
        return replace(material, color=(*numbers, material.color[3]))
    if keyword in ("d", "Tr") and len(numbers) == 1:
        alpha = numbers[0] if keyword == "d" else 1.0 - numbers[0]
        return replace(material, color=(*material.color[:3], alpha))
    return material


def _image_name(operand: str) -> str:
    """Return the name in the operand of a map, which may hold blanks, without the options before it."""
    while option := _MAP_OPTION.match(operand):
        operand = operand[option.end() :].lstrip()
        while word := _WORD.match(operand):
            operand = operand[word.end() :].lstrip()
    return operand


def _library_bytes(materials: list[Material], path: Path) -> bytes:
    lines = []
    for material in materials:
        red, green, blue, alpha = material.color
        lines += [f"newmtl {in_line(material.name)}", f"Kd {red:g} {green:g} {blue:g}"]
        lines += [f"d {alpha:g}"] * (alpha < 1.0)
        if isinstance(material.image, Path):
            lines.append(f"map_Kd {in_line(relative(material.image, path))}")
    return "\n".join([*lines, ""]).encode()


def _with_image_file(material: Material, path: Path) -> Material:
    """Write the image of a material that is in no file."""
    if not isinstance(material.image, bytes):
        return material
    name = _beside(path, _suffix(material.image) or ".png")
    return replace(material, image=_place(name, material.image))


def _beside(path: Path, suffix: str) -> Path:
    """Name a file beside a mesh file after it."""
    plain = path.with_suffix("") if path.suffix.lower() == ".gz" else path
    return plain.with_suffix(suffix)


def _place(path: Path, content: bytes) -> Path:
    """Write a file under the first name that is free, or that holds the same already."""
    k, place = 1, path
    while place.exists():
        if place.is_file() and place.read_bytes() == content:
            return place
        k += 1
        place = path.with_stem(f"{path.stem}-{k}")
    write_file(place, content)
    return place


def _suffix(content: bytes) -> str | None:
    """Return the suffix of an image, by its first bytes; None for anything else."""
    return next((s for s, start in _IMAGES.items() if content.startswith(start)), None)
