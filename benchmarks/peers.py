"""How each peer is called, as its documentation says: V, F, length -> V, F.

A peer is imported when it is first called: every one is optional.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from remeshvec import read_mesh, write_mesh

from .meshes import FloatArray, IntArray

Arrays = tuple[FloatArray, IntArray]

ITERATIONS = 5
PMP_VARIABLE = "REMESHVEC_PMP"


def trueform(V: FloatArray, F: IntArray, length: float, parallel: bool) -> Arrays:
    """Isotropic remeshing without projection; ``parallel=False`` still starts a pool of threads."""
    import trueform

    faces, points = trueform.isotropic_remeshed(
        (F.astype(np.int32), V),
        length,
        iterations=ITERATIONS,
        relaxation_iters=1,
        lambda_=1.0,
        parallel=parallel,
    )
    return points, faces


def meshlib(
    V: FloatArray, F: IntArray, length: float, relaxations: int = 0, project: bool = False
) -> Arrays:
    """Subdivision, then decimation; optionally relaxation at the end."""
    from meshlib import mrmeshnumpy, mrmeshpy

    mesh = mrmeshnumpy.meshFromFacesVerts(F.astype(np.int32), V)
    settings = mrmeshpy.RemeshSettings()
    settings.targetEdgeLen = length
    settings.maxEdgeSplits = np.iinfo(np.int32).max  # ten million by default
    settings.packMesh = True
    settings.projectOnOriginalMesh = project
    settings.finalRelaxIters = relaxations
    settings.finalRelaxNoShrinkage = relaxations > 0
    mrmeshpy.remesh(mesh, settings)
    return mrmeshnumpy.getNumpyVerts(mesh), mrmeshnumpy.getNumpyFaces(mesh.topology)


def gpytoolbox(V: FloatArray, F: IntArray, length: float) -> Arrays:
    """Botsch and Kobbelt's remeshing with projection."""
    import gpytoolbox

    return gpytoolbox.remesh_botsch(V, F.astype(np.int32), ITERATIONS, length, project=True)


def pymeshlab(V: FloatArray, F: IntArray, length: float, **options: Any) -> Arrays:
    """Explicit isotropic remeshing."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(V, F.astype(np.int32)))
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=ITERATIONS, targetlen=pymeshlab.PureValue(length), **options
    )
    mesh = meshes.current_mesh()
    return mesh.vertex_matrix(), mesh.face_matrix()


def compas_cgal(V: FloatArray, F: IntArray, length: float) -> Arrays:
    """CGAL's isotropic remeshing with projection."""
    from compas_cgal.meshing import trimesh_remesh

    return trimesh_remesh((V, F.astype(np.int32)), length, ITERATIONS, do_project=True)


def mmgpy(V: FloatArray, F: IntArray, length: float) -> Arrays:
    """MMG's surface remesher with a constant size, its own limits out of the way."""
    import mmgpy

    mesh = mmgpy.MmgMeshS(V, F.astype(np.int32))
    mesh.remesh(hsiz=length, hausd=length, angle=0, verbose=-1)
    return mesh.get_vertices(), mesh.get_triangles()


def mmgpy_adaptive(V: FloatArray, F: IntArray, bound: float) -> Arrays:
    """MMG's surface remesher with sizes from a bound for the distance."""
    import mmgpy

    mesh = mmgpy.MmgMeshS(V, F.astype(np.int32))
    mesh.remesh(hausd=bound, hgrad=1.5, angle=0, verbose=-1)
    return mesh.get_vertices(), mesh.get_triangles()


def pyacvd(V: FloatArray, F: IntArray, length: float) -> Arrays:
    """Clusters of vertices, triangulated; it takes a number of clusters instead of a length."""
    import pyacvd
    import pyvista

    mesh = pyvista.PolyData.from_regular_faces(V, F.astype(np.int32))
    clusters = round(mesh.area / (np.sqrt(0.75) * length**2))  # a hexagonal cell each
    clustering = pyacvd.Clustering(mesh)
    while clustering.mesh.n_points < 10 * clusters:
        clustering.subdivide(1)
    clustering.cluster(clusters)
    result = clustering.create_mesh()
    return np.asarray(result.points, float), result.regular_faces


def pyinstantmeshes(V: FloatArray, F: IntArray, length: float) -> Arrays:
    """Triangles along a field of directions; it takes no number of iterations."""
    import pyinstantmeshes

    points, faces = pyinstantmeshes.remesh(
        V.astype(np.float32),
        F.astype(np.int32),
        target_edge_length=length,
        rosy=6,
        posy=3,
        deterministic=True,
    )
    return points.astype(float), faces


class InFile(NamedTuple):
    """A result in a file, and the seconds that it took as the executable says."""

    path: Path
    seconds: float

    def read(self) -> Arrays:
        """Read the arrays."""
        V, F, _ = read_mesh(self.path)
        return V, F


def find_pmp() -> str | None:
    """Find the executable that the environment variable names."""
    return shutil.which(os.environ.get(PMP_VARIABLE, ""))


def pmp(V: FloatArray, F: IntArray, length: float, project: bool) -> InFile:
    """Run the executable: ``INPUT OUTPUT LENGTH ITERATIONS PROJECT``; it prints the seconds."""
    executable = find_pmp()
    if executable is None:
        raise FileNotFoundError(f"{PMP_VARIABLE} names no executable")
    path = _files.input(V, F)
    output = path.with_name("output.off")
    done = subprocess.run(
        [executable, path, output, repr(length), str(ITERATIONS), str(int(project))],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"exit code {done.returncode}: {done.stderr.strip()[-200:]}")
    return InFile(output, float(done.stdout))


class _Files:
    """The input of the executable, written once a mesh."""

    def __init__(self) -> None:
        self._folder: Any = None
        self._written: Any = None

    def input(self, V: FloatArray, F: IntArray) -> Path:
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="remeshvec-pmp-")
        path = Path(self._folder.name) / "input.off"
        if self._written is not V:
            write_mesh(path, V, F)
            self._written = V
        return path


_files = _Files()
