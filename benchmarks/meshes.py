"""The meshes of the benchmarks, by name.

``creature`` is a file; ``creature-x16`` is made from it, with 16 times the faces.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from remeshvec import quality
from remeshvec.mesh_files import read_mesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = (ROOT / "data", ROOT.parent / "shared" / "data" / "samples")

DATA = ("creature", "bracket", "wavy_sheet", "pretzel", "linked_rings", "thin_sheet")
SAMPLES = ("cat", "iphi_bad10k", "phands", "cow", "wolf_head")
LARGE = ("creature-x16", "creature-x64")  # 166,400 and 665,600 faces

LENGTH_FACTOR = 0.9  # target length / mean edge length


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


@cache
def load(name: str) -> Sample:
    """Read or make a mesh.

    Raises
    ------
    SystemExit
        There is no such mesh.
    """
    base, _, factor = name.partition("-x")
    path = find_file(base)
    if path is None:
        raise SystemExit(f"no mesh {base!r} in {' or '.join(f.name for f in FOLDERS)}")
    V, F, _ = read_mesh(path)
    if factor:
        V, F = upsampled(V, F, cuts=round(np.log(int(factor)) / np.log(4)))
    return Sample(name, V, F, LENGTH_FACTOR * quality(V, F).edge_mean)


def upsampled(
    V: FloatArray, F: IntArray, cuts: int, noise: float = 0.25, seed: int = 0
) -> tuple[FloatArray, IntArray]:
    """Cut every face into ``4 ** cuts``, then move inner vertices at random in their tangent planes.

    ``noise`` is the largest step in each direction, in mean edge lengths of the result. The noise
    makes the mesh irregular everywhere: without it most vertices would have six equal faces around
    them, and a remesher little to do.
    """
    import igl

    for _ in range(cuts):
        V, F = igl.upsample(V, F)
    normals = np.nan_to_num(igl.per_vertex_normals(V, F))
    step = np.random.default_rng(seed).uniform(-noise, noise, V.shape) * quality(V, F).edge_mean
    step -= (step * normals).sum(axis=1, keepdims=True) * normals
    step[np.unique(igl.boundary_facets(F)[0])] = 0.0
    return V + step, F
