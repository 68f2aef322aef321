"""The meshes of the benchmarks, by name.

``creature`` is a file; ``creature-x16`` is made from it, with 16 times the faces;
``creature-x16@0.5`` is remeshed to half its mean edge length instead of 0.9 times.
"""

from __future__ import annotations

import re
from functools import cache
from math import isqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from remeshvec import quality
from remeshvec.files.mesh_files import read_mesh

from .generate import cut_finer

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = (ROOT / "data", ROOT.parent / "shared" / "data" / "samples")

DATA = ("creature", "bracket", "wavy_sheet", "pretzel", "linked_rings", "thin_sheet")
SAMPLES = ("cat", "iphi_bad10k", "phands", "cow", "wolf_head")

LENGTH_FACTOR = 0.9  # target length / mean edge length

NAME = re.compile(r"(?P<file>[\w.]+)(-x(?P<times>\d+))?(@(?P<factor>[\d.]+))?")


class Sample(NamedTuple):
    """A mesh and the edge length that it is remeshed to."""

    name: str
    V: FloatArray  # (n, 3)
    F: IntArray  # (m, 3)
    length: float


def small_meshes() -> list[str]:
    """Name the meshes of `data` and the real ones, where these are there."""
    return [name for name in (*DATA, *SAMPLES) if find_file(name)]


def find_file(name: str) -> Path | None:
    """Find the file of a mesh; None where it is absent."""
    return next((path for folder in FOLDERS for path in sorted(folder.glob(f"{name}.o*"))), None)


def made(times: int, factor: float = LENGTH_FACTOR) -> str:
    """Name the mesh with so many times 10,000 faces, of which ``times`` is a square."""
    base = "iphi_bad10k" if find_file("iphi_bad10k") else "creature"
    finer = f"-x{times}" if times > 1 else ""
    return f"{base}{finer}" + (f"@{factor:g}" if factor != LENGTH_FACTOR else "")


def load(name: str) -> Sample:
    """Read or make a mesh.

    Raises
    ------
    SystemExit
        There is no such mesh.
    """
    match = NAME.fullmatch(name)
    if match is None:
        raise SystemExit(f"{name!r} is no name of a mesh, as cat, cat-x16 or cat-x16@0.5")
    V, F, mean = _arrays(match["file"], int(match["times"] or 1))
    return Sample(name, V, F, float(match["factor"] or LENGTH_FACTOR) * mean)


def load_arrays(name: str) -> tuple[FloatArray, IntArray]:
    """Read or make only the vertices and faces of a mesh."""
    sample = load(name)
    return sample.V, sample.F


@cache
def _arrays(file: str, times: int) -> tuple[FloatArray, IntArray, float]:
    """Vertices, faces, and mean edge length."""
    path = find_file(file)
    if path is None:
        raise SystemExit(f"no mesh {file!r} in {' or '.join(f.name for f in FOLDERS)}")
    n = isqrt(times)
    if n * n != times or n == 0:
        raise SystemExit(f"{file}-x{times}: a face is cut into a square number of faces")
    V, F, _ = read_mesh(path)
    if n > 1:
        V, F = cut_finer(V, F, n)
    return V, F, quality(V, F).edge_mean
