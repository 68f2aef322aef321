"""STL files, ASCII and binary: separate triangles, welded where corners are equal."""

from __future__ import annotations

from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import FloatArray, IntArray
from ..mesh.repair import weld_points
from .polygon_mesh import PolygonMesh
from .text import check_room, points, shown

__all__ = ["FACET", "check_facets", "facets_of", "parse_stl", "stl_bytes"]

FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_LINES = ((b"facet",), (b"outer", b"loop"), *[(b"vertex",)] * 3, (b"endloop",), (b"endfacet",))
_LARGEST = np.finfo(np.float32).max


def parse_stl(data: bytes) -> PolygonMesh:
    """Read the facets; vertices are numbered by their first appearance.

    A binary file may begin with ``solid`` too, so the size decides.

    Raises
    ------
    ValueError
        It is neither ASCII nor binary STL, is cut short, or holds a number that is not finite.
    """
    corners = _facets(data)
    check_facets(corners)
    V, F = _welded(corners.reshape(-1, 3))
    notice = f"{F.size:,} corners of triangles were welded to {len(V):,} vertices"
    return PolygonMesh(V, F, np.full(len(corners), 3), [notice])


def check_facets(corners: NDArray[np.floating]) -> None:
    """Refuse triangles (m, 3, 3) with a corner that is not finite.

    Raises
    ------
    ValueError
    """
    if not np.isfinite(corners).all():
        bad = int(np.flatnonzero(~np.isfinite(corners).all(axis=(1, 2)))[0])
        raise ValueError(f"facet {bad} (counted from 0) has a corner that is NaN or infinite")


def _facets(data: bytes) -> FloatArray:
    """Return the corners of all triangles, (m, 3, 3)."""
    claimed = int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0
    size = FACET.itemsize * claimed
    fits = claimed > 0 and len(data) == 84 + size
    if not fits and data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        return _ascii_facets(data)
    if len(data) < 84 or (not fits and b"\0" not in data):
        raise ValueError("it neither starts with 'solid' nor has the header of a binary STL")
    check_room(size, len(data) - 84, "bytes")
    with np.errstate(invalid="ignore"):  # some NaN warn when they are cast; they are refused later
        return np.frombuffer(data, FACET, claimed, 84)["corners"].astype(np.float64)


def _ascii_facets(data: bytes) -> FloatArray:
    """Read facets of seven lines each; the facets of all solids are joined, their names dropped."""
    lines = [line for line in map(bytes.strip, data.lower().splitlines()) if line]
    if lines[-1].split()[0] != b"endsolid":
        raise ValueError("it does not end with 'endsolid': the file is cut short")
    facets = [line for line in lines if line.split(None, 1)[0] not in (b"solid", b"endsolid")]
    for line, words in zip(facets, cycle(_LINES), strict=False):
        if tuple(line.split(None, len(words))[: len(words)]) != words:
            raise ValueError(f"{shown(line)} was found where {shown(b' '.join(words))} is expected")
    if len(facets) % 7:
        raise ValueError("the last facet is not complete")
    vertices = [[line[6:] for line in facets[k::7]] for k in (2, 3, 4)]
    return np.stack([points(lines, b"vertex")[:, :3] for lines in vertices], axis=1)


def _welded(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the distinct points, and the index of the point of every corner."""
    target = weld_points(corners, np.arange(len(corners)), len(corners))
    if target is None:
        return corners, np.arange(len(corners))
    is_first = target == np.arange(len(corners))
    return corners[is_first], (np.cumsum(is_first) - 1)[target]


def stl_bytes(V: FloatArray, F: IntArray) -> bytes:
    """Write a binary file, which holds float32, with unit normals, or zeros for faces without area."""
    return b"remeshvec".ljust(80) + len(F).to_bytes(4, "little") + facets_of(V, F).tobytes()


def facets_of(V: FloatArray, F: IntArray) -> NDArray[np.void]:
    """Return the rows of a binary file."""
    if np.abs(V[F]).max() > _LARGEST:
        raise ValueError("a coordinate is too large for STL, which holds float32")
    facets = np.zeros(len(F), FACET)
    a, b, c = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    with np.errstate(all="ignore"):
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    facets["normal"], facets["corners"] = np.nan_to_num(normal, posinf=0, neginf=0), V[F]
    return facets
