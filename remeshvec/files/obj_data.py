"""What OBJ files hold besides vertices and faces: texture coordinates, colours, groups, materials."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..interop.mesh_data import MeshData

__all__ = ["has_obj_data", "obj_bytes", "read_obj_data"]

# Statements that name parts of a mesh, with the names that their data go by.
PARTS = {"o": "object", "g": "group", "usemtl": "material"}

_MARKS = re.compile(rb"^[ \t]*(?:vt|g|o|usemtl|mtllib)[ \t]", re.MULTILINE)
_COLOURED = re.compile(rb"^[ \t]*v(?:[ \t]+[^\s]+){6,}[ \t]*\r?$", re.MULTILINE)


class _ObjFaces(NamedTuple):
    vertices: list[tuple[int, ...]]
    textures: list[tuple[int, ...]]
    parts: dict[str, list[int]]


def has_obj_data(content: bytes) -> bool:
    """Tell whether there is more than vertices and faces in a file."""
    return bool(_MARKS.search(content) or _COLOURED.search(content))


def read_obj_data(path: Path, V: NDArray[Any]) -> MeshData:
    """Read an OBJ file whose vertices are known and whose statements have been checked.

    Raises
    ------
    ValueError
        An index that names nothing.
    """
    text = path.read_bytes().decode("utf-8", "replace").replace("\\\n", " ")
    names: dict[str, list[str]] = {kind: [] for kind in PARTS.values()}
    current = dict.fromkeys(PARTS.values(), -1)
    rows = _ObjFaces([], [], {kind: [] for kind in PARTS.values()})
    textures: list[list[float]] = []
    colours: list[list[float]] = []
    libraries: list[str] = []
    n = 0
    for line in text.splitlines():
        word, _, rest = line.partition("#")[0].strip().partition(" ")
        if word == "v":
            n += 1
            colours.append([float(x) for x in rest.split()[3:6]])
        elif word == "vt":
            textures.append([float(x) for x in [*rest.split(), "0"][:2]])
        elif word in PARTS:
            kind, name = PARTS[word], rest.strip()
            if name not in names[kind]:
                names[kind].append(name)
            current[kind] = names[kind].index(name)
        elif word == "mtllib":
            libraries.append(rest.strip())
        elif word == "f":
            _add_fan(rows, rest.split(), n, len(textures), current)
    data = MeshData(V, np.array(rows.vertices, dtype=np.int64))
    feature_data = []
    at = np.array(rows.textures, dtype=np.int64)
    if textures and (at >= 0).all():
        if at.max() >= len(textures):
            raise ValueError(
                f"a face names texture coordinate {at.max() + 1}; there are {len(textures)}"
            )
        data.on_corners["uv"] = np.array(textures)[at]
        feature_data.append("uv")
    for kind, values in rows.parts.items():
        if len(set(values)) > 1 or names[kind]:
            data.on_faces[kind] = np.array(values, dtype=np.int64)
            data.extra[kind] = names[kind]
            feature_data.append(kind)
    if colours and all(len(colour) == 3 for colour in colours):
        data.on_vertices["color"] = np.array(colours)
    if libraries:
        data.extra["mtllib"] = [str((path.parent / name).resolve()) for name in libraries]
    data.feature_data = tuple(feature_data)
    return data


def _add_fan(
    rows: _ObjFaces, corners: list[str], n: int, n_textures: int, current: dict[str, int]
) -> None:
    """Cut one face into triangles; -1 for a corner without texture."""
    split = [corner.split("/") for corner in corners]
    v = [_index(parts[0], n) for parts in split]
    t = [_index(parts[1], n_textures) if len(parts) > 1 and parts[1] else -1 for parts in split]
    for k in range(1, len(v) - 1):
        rows.vertices.append((v[0], v[k], v[k + 1]))
        rows.textures.append((t[0], t[k], t[k + 1]))
        for kind, values in rows.parts.items():
            values.append(current[kind])


def _index(word: str, count: int) -> int:
    """Turn an index that counts from 1, or back from the last one read, to one from 0."""
    i = int(word)
    return i - 1 if i > 0 else count + i


def obj_bytes(data: MeshData, path: Path) -> bytes:
    """Write a mesh with all that OBJ can hold."""
    colours = data.on_vertices.get("color")
    if colours is not None and colours.dtype.kind == "u":
        colours = colours / np.iinfo(colours.dtype).max
    points = data.V if colours is None else np.column_stack([data.V, colours[:, :3]])
    lines = [f"mtllib {_relative(name, path)}" for name in data.extra.get("mtllib", [])]
    lines += ["v " + " ".join(map(repr, row)) for row in np.asarray(points, float).tolist()]
    F = data.F + 1
    if "uv" in data.on_corners:
        uv = np.asarray(data.on_corners["uv"], float).reshape(-1, 2)
        known, at = np.unique(uv, axis=0, return_inverse=True)
        lines += [f"vt {s!r} {t!r}" for s, t in known.tolist()]
        pairs = np.stack([F, at.reshape(F.shape) + 1], axis=2).tolist()
        faces = ["f " + " ".join(f"{v}/{t}" for v, t in face) for face in pairs]
    else:
        faces = [f"f {i} {j} {k}" for i, j, k in F.tolist()]
    _add_parts(faces, data)
    return ("\n".join(lines + faces) + "\n").encode()


def _add_parts(faces: list[str], data: MeshData) -> None:
    """Put the names of parts before the faces where they begin."""
    for word, kind in reversed(PARTS.items()):
        if kind not in data.on_faces:
            continue
        part = data.on_faces[kind]
        names = data.extra.get(kind)
        for f in np.flatnonzero(np.diff(part, prepend=-2)):
            label = int(part[f])
            if names is None or 0 <= label < len(names):
                name = str(label) if names is None else names[label]
                faces[f] = f"{word} {name}\n{faces[f]}"


def _relative(target: str, path: Path) -> str:
    try:
        return Path(os.path.relpath(target, path.resolve().parent)).as_posix()
    except ValueError:  # on another drive
        return target
