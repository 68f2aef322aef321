"""Meshes as the bytes of a file, one function a format.

Our own, because libigl's writers do not notice a full disk, and print 16 digits in OFF.
"""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np

from ..core.vocabulary import FloatArray, IntArray

__all__ = ["WRITERS"]


MAX_STL = np.finfo(np.float32).max


def _obj(V: FloatArray, F: IntArray) -> bytes:
    points = [f"v {x!r} {y!r} {z!r}\n" for x, y, z in V.tolist()]
    faces = [f"f {i} {j} {k}\n" for i, j, k in (F + 1).tolist()]
    return "".join(points + faces).encode()


def _off(V: FloatArray, F: IntArray) -> bytes:
    points = [f"{x!r} {y!r} {z!r}\n" for x, y, z in V.tolist()]
    faces = [f"3 {i} {j} {k}\n" for i, j, k in F.tolist()]
    return "".join([f"OFF\n{len(V)} {len(F)} 0\n", *points, *faces]).encode()


def _ply(V: FloatArray, F: IntArray) -> bytes:
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(V)}\nproperty double x\n"
        f"property double y\nproperty double z\nelement face {len(F)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(F), dtype=[("length", "u1"), ("corners", "<i4", 3)])
    faces["length"], faces["corners"] = 3, F
    return header.encode() + V.astype("<f8").tobytes() + faces.tobytes()


def _stl(V: FloatArray, F: IntArray) -> bytes:
    if np.abs(V[F]).max() > MAX_STL:
        raise ValueError("a coordinate is too large for STL, which holds float32")
    kind = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    facets = np.zeros(len(F), dtype=kind)
    a, b, c = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    with np.errstate(all="ignore"):
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    facets["normal"], facets["corners"] = np.nan_to_num(normal, posinf=0, neginf=0), V[F]
    return b"remeshvec".ljust(80) + len(F).to_bytes(4, "little") + facets.tobytes()


def _as_json(V: FloatArray, F: IntArray) -> bytes:
    return json.dumps({"verts": V.tolist(), "faces": F.tolist()}).encode()


WRITERS: dict[str, Callable[[FloatArray, IntArray], bytes]] = {
    ".obj": _obj,
    ".off": _off,
    ".ply": _ply,
    ".stl": _stl,
    ".json": _as_json,
}
