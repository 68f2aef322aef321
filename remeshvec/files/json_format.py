"""Meshes as JSON: ``{"verts": [[x, y, z], ...], "faces": [[i, j, k], ...]}``."""

from __future__ import annotations

import json
from itertools import chain
from typing import Any

import numpy as np

from ..core.vocabulary import FloatArray, IntArray
from .polygon_mesh import PolygonMesh

__all__ = ["json_bytes", "parse_json"]


def parse_json(data: bytes) -> PolygonMesh:
    """Read vertices and polygons; other keys are ignored.

    Raises
    ------
    ValueError
        It is not JSON, or not of this form.
    """
    try:
        content = json.loads(data.decode("utf-8-sig"))
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if not isinstance(content, dict) or not {"verts", "faces"} <= content.keys():
        raise ValueError('it is not of the form {"verts": [...], "faces": [...]}')
    rows, faces = content["verts"], content["faces"]
    if not _is_table(rows, {int, float}) or set(map(len, rows)) - {3}:
        raise ValueError('"verts" must be a list of [x, y, z]')
    if not _is_table(faces, {int}):
        raise ValueError('"faces" must be a list of lists of integers')
    return PolygonMesh(
        np.array(rows, np.float64).reshape(-1, 3),
        np.array(list(chain.from_iterable(faces)), np.int64),
        np.array(list(map(len, faces)), np.int64),
        [],
    )


def _is_table(value: Any, kinds: set[type]) -> bool:
    """Tell whether this is a list of lists of these types; true and false are not numbers."""
    return (
        isinstance(value, list)
        and all(isinstance(row, list) for row in value)
        and set(map(type, chain.from_iterable(value))) <= kinds
    )


def json_bytes(V: FloatArray, F: IntArray) -> bytes:
    """Write vertices and triangles; every coordinate keeps all its bits."""
    return json.dumps({"verts": V.tolist(), "faces": F.tolist()}).encode()
