"""OBJ files: vertices and faces; on request texture coordinates, colours, groups and materials.

One parser serves both. It sorts statements by keyword and remembers their positions in the file, because
negative indices and groups depend on them.
"""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import FloatArray, IntArray
from ..interop.mesh_data import MeshData
from ..mesh.polygons import fan_triangles
from .materials import in_line, relative
from .polygon_mesh import PolygonMesh, Triangles
from .text import floats, integers, number_table, points, shown, text_lines, word_counts

__all__ = ["OBJ_DATA", "ObjFile", "obj_bytes"]


# Statements that name parts of a mesh, and what their data are called here.
_PARTS = {"o": "object", "g": "group", "usemtl": "material"}
OBJ_DATA = frozenset({"uv", "color", *_PARTS.values()})

# All keywords of the format; those of curves, free-form surfaces and rendering are left out.
_KEYWORD = re.compile(
    "v[tnp]?|[flposg]|mg|usemtl|mtllib|usemap|maplib|lod|bevel|[cd]_interp|(shadow|trace)_obj|"
    "deg|bmat|step|cstype|curv2?|surf|parm|trim|hole|scrv|sp|end|con|[cs]tech"
)
_CORNER = re.compile(rb"(-?\d{1,9})(?:/(-?\d*)(?:/-?\d*)?)?")
_ABSENT = (None, b"", b"-")  # a corner without texture coordinate


class _FaceIndices(NamedTuple):
    """Indices as the file has them; 0 where a corner has no texture coordinate."""

    vertices: IntArray
    textures: IntArray | None
    sizes: IntArray


class ObjFile:
    """The statements of an OBJ file.

    Raises
    ------
    ValueError
        A vertex has fewer than three finite numbers, a face has fewer than three indices, or a face
        holds something else.
    """

    def __init__(self, content: bytes) -> None:
        self._lines = text_lines(content, continued=True)
        places: defaultdict[bytes, list[int]] = defaultdict(list)
        for i, line in enumerate(self._lines):
            places[line.split(None, 1)[0]].append(i)
        self._places = {keyword.decode("latin-1"): np.array(at) for keyword, at in places.items()}
        self._vertices = points(self._operands("v"), b"v")
        self._faces = _parse_faces(self._operands("f"))

    def _at(self, keyword: str) -> IntArray:
        """Return the positions of the statements with a keyword among all statements."""
        return self._places.get(keyword, np.empty(0, np.int64))

    def _operands(self, keyword: str) -> list[bytes]:
        """Return the statements with a keyword, without the keyword."""
        return [self._lines[i][len(keyword) :] for i in self._at(keyword).tolist()]

    def _zero_based(self, indices: IntArray, keyword: str) -> IntArray:
        """Turn indices of corners, which count from 1 or backwards from the face, into 0-based ones."""
        if (indices > 0).all():
            return indices - 1
        known = np.searchsorted(self._at(keyword), self._at("f"))  # statements before each face
        count = np.repeat(known, self._faces.sizes)
        return np.where(indices < 0, count + indices, indices - 1)

    def mesh(self) -> PolygonMesh:
        """Return the vertices and polygons."""
        corners = self._zero_based(self._faces.vertices, "v")
        return PolygonMesh(
            self._vertices[:, :3].copy(), corners, self._faces.sizes, self._notices()
        )

    def _notices(self) -> list[str]:
        """Report lines that were left out for an unknown keyword: one of them may be a face."""
        unknown = [at for keyword, at in self._places.items() if not _KEYWORD.fullmatch(keyword)]
        if not unknown:
            return []
        places = np.concatenate(unknown)
        first = shown(self._lines[int(places.min())])
        return [
            f"{len(places):,} lines without a keyword of OBJ were left out; the first is {first}"
        ]

    def data(self, V: FloatArray, triangles: Triangles, folder: Path) -> MeshData:
        """Return the mesh with everything else the file holds.

        Parameters
        ----------
        V : (n, 3)
        triangles : Triangles
            The polygons, cut.
        folder : Path
            Folder that names of material libraries are relative to.

        Raises
        ------
        ValueError
            A texture coordinate is not a number, or does not exist.
        """
        data = MeshData(V, triangles.F)
        uv = self._texture_coordinates()
        if uv is not None:
            data.on_corners["uv"] = uv
        for keyword, kind in _PARTS.items():
            names, part = self._parts(keyword)
            if any(names):
                data.on_faces[kind] = part[triangles.polygon]
                data.extra[kind] = names
        data.feature_data = (*data.on_corners, *data.on_faces)
        if self._vertices.shape[1] >= 6:
            data.on_vertices["color"] = self._vertices[:, 3:6].copy()
        if len(self._at("mtllib")):
            names = [_decoded(operand) for operand in self._operands("mtllib")]
            data.extra["mtllib"] = [os.path.realpath(folder / name) for name in names]
        return data

    def _texture_coordinates(self) -> FloatArray | None:
        """Return texture coordinates (t, 3, 2) of triangles, None unless all corners have them."""
        known = _parse_textures(self._operands("vt"))
        if self._faces.textures is None or not len(known):
            return None
        at = self._zero_based(self._faces.textures, "vt")
        if at.min() < 0:
            return None
        if at.max() >= len(known):
            raise ValueError(
                f"a face names texture coordinate {at.max() + 1}; there are {len(known)}"
            )
        return known[fan_triangles(at, self._faces.sizes)[0]]

    def _parts(self, keyword: str) -> tuple[list[str], IntArray]:
        """Return the names of parts by first appearance, and the part of each face, -1 for none."""
        names = [_decoded(operand) for operand in self._operands(keyword)]
        number = {name: i for i, name in enumerate(dict.fromkeys(names))}
        label = np.array([*(number[name] for name in names), -1])
        latest = np.searchsorted(self._at(keyword), self._at("f")) - 1  # -1, the last, if none
        return list(number), label[latest]


def _decoded(operand: bytes) -> str:
    return operand.decode("utf-8", "replace").strip()


def _parse_textures(lines: Sequence[bytes]) -> FloatArray:
    """Return the first two of the numbers in each line; the second is 0 where it is missing."""
    table = number_table(lines)
    if table is not None and table.shape[1] >= 2:
        return table[:, :2].astype(np.float64)
    rows = [floats(b" ".join([*line.split(), b"0"][:2])) for line in lines]
    for line, row in zip(lines, rows, strict=True):
        if row is None or len(row) < 2:
            raise ValueError(f"{shown(line)} is not a texture coordinate")
    return np.array(rows).reshape(-1, 2)


def _parse_faces(lines: Sequence[bytes]) -> _FaceIndices:
    """Read faces whose corners have the form v, v/t, v/t/n or v//n."""
    text = b"\n".join(lines)
    sizes = word_counts(text) if lines else np.empty(0, np.int64)
    has_textures = b"/" in text and b"//" not in text
    text = text.replace(b"//", b"/")
    slashes = set(text.translate(None, b"0123456789-").split())
    columns = 1 + max(map(len, slashes), default=0)
    numbers = integers(text.replace(b"/", b" "))
    is_regular = (
        numbers is not None
        and len(slashes) <= 1
        and columns <= 3
        and len(numbers) == columns * sizes.sum()
        and sizes.min(initial=3) >= 3
    )
    if numbers is None or not is_regular:
        return _parse_mixed_faces(lines)
    table = numbers.reshape(-1, columns)
    return _FaceIndices(table[:, 0], table[:, 1] if has_textures else None, sizes)


def _parse_mixed_faces(lines: Sequence[bytes]) -> _FaceIndices:
    """Read faces word by word, if their corners differ in form or one of them is wrong."""
    vertices, textures, sizes = [], [], []
    for line in lines:
        corners = [_CORNER.fullmatch(word) for word in line.split()]
        if len(corners) < 3 or None in corners:
            raise ValueError(
                f"{shown(b'f' + line)} is not a face: three or more indices are needed"
            )
        vertices += [int(corner[1]) for corner in corners if corner]
        textures += [
            int(corner[2]) if corner[2] not in _ABSENT else 0 for corner in corners if corner
        ]
        sizes.append(len(corners))
    return _FaceIndices(
        np.array(vertices, np.int64), np.array(textures, np.int64), np.array(sizes, np.int64)
    )


def obj_bytes(data: MeshData, path: Path) -> bytes:
    """Write a mesh with all data that OBJ can hold; every coordinate keeps all its bits."""
    colours = data.on_vertices.get("color")
    if colours is not None and colours.dtype.kind == "u":
        colours = colours / np.iinfo(colours.dtype).max
    points = data.V if colours is None else np.column_stack([data.V, colours[:, :3]])
    lines = [f"mtllib {in_line(relative(lib, path))}" for lib in data.extra.get("mtllib", [])]
    lines += _statements("v", np.asarray(points, float))
    F = data.F + 1
    if "uv" in data.on_corners:
        uv = np.asarray(data.on_corners["uv"], float).reshape(-1, 2)
        known, at = np.unique(uv, axis=0, return_inverse=True)
        lines += _statements("vt", known)
        pairs = np.stack([F, at.reshape(F.shape) + 1], axis=2).tolist()
        faces = ["f " + " ".join(f"{v}/{t}" for v, t in face) for face in pairs]
    else:
        faces = _statements("f", F)
    _add_parts(faces, data)
    return "\n".join([*lines, *faces, ""]).encode()


def _statements(keyword: str, table: NDArray[Any]) -> list[str]:
    """Return one statement per row."""
    pattern = " ".join([keyword, *["{!r}"] * table.shape[1]])
    return [pattern.format(*row) for row in table.tolist()]


def _add_parts(faces: list[str], data: MeshData) -> None:
    """Put the names of parts before the faces where they begin."""
    for keyword, kind in reversed(_PARTS.items()):
        if kind not in data.on_faces:
            continue
        part = data.on_faces[kind]
        names = data.extra.get(kind)
        for f in np.flatnonzero(np.diff(part, prepend=-2)):
            label = int(part[f])
            if names is None or 0 <= label < len(names):
                name = str(label) if names is None else names[label]
                faces[f] = f"{keyword} {in_line(name)}\n{faces[f]}"
