"""Who is timed: our presets and the peers, each as arrays in, arrays out.

Conversions from and to NumPy arrays count. All get the same absolute edge length and, where they
iterate, five iterations as in the paper.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

import numpy as np

import remeshvec

from .meshes import FloatArray, IntArray

Arrays = tuple[FloatArray, IntArray]
Call = Callable[[FloatArray, IntArray, float], Arrays]

ITERATIONS = 5


@dataclass(frozen=True)
class Contender:
    """A way to remesh."""

    name: str
    package: str  # what is imported, and the name on the package index in lower case
    call: Call
    settings: str  # for the reader
    all_cores: bool = False  # otherwise held on one core

    @property
    def is_ours(self) -> bool:
        """Whether it is this library."""
        return self.package == "remeshvec"

    @property
    def is_installed(self) -> bool:
        """Whether it can run here."""
        return find_spec(self.package) is not None

    @property
    def version(self) -> str:
        """Its version, as installed."""
        return remeshvec.__version__ if self.is_ours else version(self.package)


def _ours(**options: Any) -> Call:
    def call(V: FloatArray, F: IntArray, length: float) -> Arrays:
        result = remeshvec.remesh(V, F, length, **options)
        return result.V, result.F

    return call


def _trueform(parallel: bool) -> Call:
    def call(V: FloatArray, F: IntArray, length: float) -> Arrays:
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

    return call


def _gpytoolbox(V: FloatArray, F: IntArray, length: float) -> Arrays:
    import gpytoolbox

    return gpytoolbox.remesh_botsch(V, F.astype(np.int32), ITERATIONS, length, project=True)


def _pymeshlab(**options: Any) -> Call:
    def call(V: FloatArray, F: IntArray, length: float) -> Arrays:
        import pymeshlab

        meshes = pymeshlab.MeshSet()
        meshes.add_mesh(pymeshlab.Mesh(V, F.astype(np.int32)))
        meshes.meshing_isotropic_explicit_remeshing(
            iterations=ITERATIONS, targetlen=pymeshlab.PureValue(length), **options
        )
        mesh = meshes.current_mesh()
        return mesh.vertex_matrix(), mesh.face_matrix()

    return call


_TRUEFORM = (
    "`iterations=5, relaxation_iters=1, lambda_=1`: the published work, one full relaxation an "
    "iteration. The rest are its defaults, `preserve_boundary=True` among them: boundaries are "
    "neither split nor collapsed (`False` did not return from wolf_head). It does not project"
)
FAST, FAST_ALL = "remeshvec fast, no projection", "remeshvec fast, no projection, all cores"
DEFAULT, DEFAULT_ALL = "remeshvec default", "remeshvec default, all cores"
FINE = "remeshvec fine"
TRUEFORM, TRUEFORM_ALL = "trueform", "trueform, all cores"
GPYTOOLBOX, PYMESHLAB, PYMESHLAB_LEAN = "gpytoolbox", "PyMeshLab", "PyMeshLab, lean"

CONTENDERS = {
    contender.name: contender
    for contender in (
        Contender(
            FAST,
            "remeshvec",
            _ours(preset="fast", project=False, threads=1),
            '`preset="fast", project=False, threads=1`: the algorithm as published',
        ),
        Contender(TRUEFORM, "trueform", _trueform(False), f"`parallel=False`, {_TRUEFORM}"),
        Contender(
            FAST_ALL,
            "remeshvec",
            _ours(preset="fast", project=False),
            '`preset="fast", project=False`',
            all_cores=True,
        ),
        Contender(
            TRUEFORM_ALL,
            "trueform",
            _trueform(True),
            "`parallel=True`, otherwise the same",
            all_cores=True,
        ),
        Contender(DEFAULT, "remeshvec", _ours(threads=1), "`threads=1`; vertices on the input"),
        Contender(DEFAULT_ALL, "remeshvec", _ours(), "all defaults", all_cores=True),
        Contender(FINE, "remeshvec", _ours(preset="fine", threads=1), '`preset="fine", threads=1`'),
        Contender(
            GPYTOOLBOX, "gpytoolbox", _gpytoolbox, "`remesh_botsch(V, F, 5, L, project=True)`"
        ),
        Contender(
            PYMESHLAB,
            "pymeshlab",
            _pymeshlab(),
            "`meshing_isotropic_explicit_remeshing`, `iterations=5`, absolute `targetlen`, its "
            "defaults: projects, checks distances, and keeps edges above 30 degrees",
        ),
        Contender(
            PYMESHLAB_LEAN,
            "pymeshlab",
            _pymeshlab(checksurfdist=False, featuredeg=180.0),
            "with `checksurfdist=False, featuredeg=180`: neither distance check nor feature edges, "
            "like the others; the work closest to ours",
        ),
    )
}
