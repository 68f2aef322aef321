"""A zoo of small meshes for property tests, and slow, obvious topology to check them with.

`ZOO` maps a name to a `Shape`: a function that makes (V, F), and what is true of the mesh.  `TIDY`
names the oriented manifolds without dirt, `DIRTY` the others.  Nothing here uses the library; the
names of `topology.py` and `perturb.py` are at hand here too (``zoo.euler_number``).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from data.shapes.basic import (  # noqa: F401  (so that tests need one import)
    Arrays,
    annulus,
    arrays,
    bipyramid,
    bowtie,
    closed_cylinder,
    coincident_vertices,
    cone,
    cube,
    cylinder,
    disc,
    duplicate_face,
    fan,
    fan_inside,
    flat_cap,
    genus_2,
    genus_3,
    grid,
    icosahedron,
    icosphere,
    inconsistent_winding,
    joined,
    l_prism,
    moebius,
    octahedron,
    outward,
    pinched_tetrahedra,
    planar_delaunay,
    polygon,
    repeated_index,
    sliver_fan,
    square,
    tetrahedron,
    thin_sheet,
    three_half_discs,
    torus,
    triangle,
    turn,
    two_components,
    two_cubes_on_an_edge,
    unreferenced_vertices,
    voxels,
    wrapped_grid,
)
from data.shapes.perturb import mean_edge, perturb, rotate, scale, translate, upsampled  # noqa: F401
from data.shapes.topology import (  # noqa: F401  (so that tests need one import)
    area,
    boundary_loops,
    components,
    degenerate_faces,
    duplicate_faces,
    edge_faces,
    euler_number,
    is_closed,
    is_edge_manifold,
    is_oriented,
    is_vertex_manifold,
    pinched_vertices,
    unreferenced,
    volume,
)


@dataclass(frozen=True)
class Shape:
    """How to make a mesh, and what to expect of it (faces that repeat a vertex left out)."""

    make: Callable[[], Arrays]
    euler: int
    loops: int  # boundary loops after pinched vertices are parted
    components: int  # of faces joined along edges
    edge_manifold: bool = True
    vertex_manifold: bool = True
    oriented: bool = True
    clean: bool = True  # no degenerate, duplicated or unreferenced element

    @property
    def is_tidy(self) -> bool:
        """Whether the mesh is an oriented manifold without dirt."""
        return self.edge_manifold and self.vertex_manifold and self.oriented and self.clean


ZOO: dict[str, Shape] = {
    "triangle": Shape(triangle, 1, 1, 1),
    "square": Shape(square, 1, 1, 1),
    "tetrahedron": Shape(tetrahedron, 2, 0, 1),
    "cube": Shape(cube, 2, 0, 1),
    "octahedron": Shape(octahedron, 2, 0, 1),
    "icosahedron": Shape(icosahedron, 2, 0, 1),
    "icosphere": Shape(icosphere, 2, 0, 1),
    "torus": Shape(torus, 0, 0, 1),
    "grid": Shape(grid, 1, 1, 1),
    "annulus": Shape(annulus, 0, 2, 1),
    "cylinder": Shape(cylinder, 0, 2, 1),
    "closed_cylinder": Shape(closed_cylinder, 2, 0, 1),
    "cone": Shape(cone, 2, 0, 1),
    "bipyramid": Shape(bipyramid, 2, 0, 1),
    "sliver_fan": Shape(sliver_fan, 1, 1, 1),
    "l_prism": Shape(l_prism, 2, 0, 1),
    "genus_2": Shape(genus_2, -2, 0, 1),
    "genus_3": Shape(genus_3, -4, 0, 1),
    "two_components": Shape(two_components, 4, 0, 2),
    "thin_sheet": Shape(thin_sheet, 2, 0, 1),
    "planar_delaunay": Shape(planar_delaunay, 1, 1, 1),
    "moebius": Shape(moebius, 0, 1, 1, oriented=False),
    "inconsistent_winding": Shape(inconsistent_winding, 1, 1, 1, oriented=False),
    "bowtie": Shape(bowtie, 1, 2, 2, vertex_manifold=False),
    "pinched_tetrahedra": Shape(pinched_tetrahedra, 3, 0, 2, vertex_manifold=False),
    "three_half_discs": Shape(three_half_discs, 1, 3, 1, False, False, False),
    "two_cubes_on_an_edge": Shape(two_cubes_on_an_edge, 3, 0, 1, False, False, False),
    "duplicate_face": Shape(duplicate_face, 3, 0, 1, False, False, False, False),
    "repeated_index": Shape(repeated_index, 1, 1, 1, clean=False),
    "flat_cap": Shape(flat_cap, 1, 1, 1, clean=False),
    "coincident_vertices": Shape(coincident_vertices, 1, 1, 1, clean=False),
    "unreferenced_vertices": Shape(unreferenced_vertices, 2, 0, 1, clean=False),
}
TIDY = [name for name, shape in ZOO.items() if shape.is_tidy]
DIRTY = [name for name, shape in ZOO.items() if not shape.is_tidy]


# --- real meshes ---------------------------------------------------------------------------------

DATA = Path(__file__).resolve().parents[2] / "data"
SAMPLE_FOLDER = Path(__file__).resolve().parents[3] / "shared" / "data" / "samples"
SAMPLES = ("cat.obj", "cow.obj", "iphi_bad10k.off", "phands.obj", "wolf_head.obj")
DIRTY_SAMPLES = ("sample1.json", "sample2.json", "sample3.json")


def sample(name: str) -> Arrays:
    """Read one of the sample meshes; the test is skipped where they are absent."""
    return read(sample_path(name))


def sample_path(name: str) -> Path:
    """Return the file of a sample mesh; the test is skipped where it is absent."""
    if not (SAMPLE_FOLDER / name).is_file():
        pytest.skip(f"needs the sample mesh {name}, which is not part of the project")
    return SAMPLE_FOLDER / name


def samples() -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield name, V, F of the triangle samples; the test is skipped where they are absent."""
    return ((name, *sample(name)) for name in SAMPLES)


def read(path: Path) -> Arrays:
    """Read OBJ, OFF or the report's JSON."""
    import igl

    if path.suffix == ".json":
        content = json.loads(path.read_text())
        return arrays(content["verts"], content["faces"])
    return igl.read_triangle_mesh(str(path))
