"""Who is timed: our presets and the peers, each as arrays in, arrays out.

Conversions from and to NumPy arrays count. All get the same absolute edge length and, where they
iterate, five iterations as in the paper. How each peer is called is in `peers`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

import remeshvec

from . import peers
from .meshes import FloatArray, IntArray


@dataclass(frozen=True)
class Contender:
    """A way to remesh."""

    name: str
    package: str  # what is imported, and the name on the package index; or the executable's name
    call: Callable[..., Any]  # V, F, length, options -> V, F; a function of a module, to be pickled
    settings: str  # for the reader
    projects: str  # yes, no, or what it does
    options: dict[str, Any] = field(default_factory=dict)
    all_cores: bool = False  # otherwise held on one core

    def __call__(self, V: FloatArray, F: IntArray, length: float) -> Any:
        """Remesh."""
        return self.call(V, F, length, **self.options)

    @property
    def is_ours(self) -> bool:
        """Whether it is this library."""
        return self.package == "remeshvec"

    @property
    def is_executable(self) -> bool:
        """Whether it runs outside Python."""
        return self.package == "PMP"

    @property
    def is_installed(self) -> bool:
        """Whether it can run here."""
        if self.is_executable:
            return peers.find_pmp() is not None
        return find_spec(self.package) is not None

    @property
    def version(self) -> str:
        """Its version, as installed."""
        if self.is_executable:
            return "as built"
        return remeshvec.__version__ if self.is_ours else version(self.package)


def ours(V: FloatArray, F: IntArray, length: float, **options: Any) -> Any:
    """Remesh with this library."""
    return remeshvec.remesh(V, F, length, **options)


RECIPES: dict[str, dict[str, Any]] = {
    "default": {},
    "fast, no projection": {"preset": "fast", "project": False},
    "fast, no projection, no features": {
        "preset": "fast",
        "project": False,
        "feature_angle": None,
    },
    "fine": {"preset": "fine"},
}


def on_threads(recipe: str, count: int) -> Contender:
    """Ours on so many threads."""
    return Contender(
        f"remeshvec {recipe}, {count} thread{'s' * (count > 1)}",
        "remeshvec",
        ours,
        f"`threads={count}`",
        _projects(recipe),
        {**RECIPES[recipe], "threads": count},
        all_cores=count > 1,
    )


def _projects(recipe: str) -> str:
    return "yes" if RECIPES[recipe].get("project", True) else "no"


def _one_core(recipe: str, settings: str) -> Contender:
    options = {**RECIPES[recipe], "threads": 1}
    return Contender(f"remeshvec {recipe}", "remeshvec", ours, settings, _projects(recipe), options)


def _all_cores(recipe: str, settings: str) -> Contender:
    name, options = f"remeshvec {recipe}, all cores", RECIPES[recipe]
    return Contender(name, "remeshvec", ours, settings, _projects(recipe), options, True)


_TRUEFORM = (
    "`isotropic_remeshed`, `iterations=5, relaxation_iters=1, lambda_=1`: the published work, one "
    "full relaxation per iteration. The rest are its defaults, `preserve_boundary=True` among them: "
    "boundaries are neither split nor collapsed (`False` did not return from wolf_head)"
)
_MESHLIB = "`remesh`, `targetEdgeLen`, `packMesh`; it does not iterate"

FAST_PLAIN = "remeshvec fast, no projection, no features"
FAST, FAST_ALL = "remeshvec fast, no projection", "remeshvec fast, no projection, all cores"
DEFAULT, DEFAULT_ALL = "remeshvec default", "remeshvec default, all cores"
FINE = "remeshvec fine"
TRUEFORM, TRUEFORM_ALL = "trueform", "trueform, all cores"
PMP, PMP_PROJECTED = "PMP, no projection", "PMP"
MESHLIB, MESHLIB_ALL, MESHLIB_EVEN = "MeshLib", "MeshLib, all cores", "MeshLib, relaxed"
CGAL, MMG, ACVD, FIELD = "compas_cgal", "mmgpy", "pyacvd", "pyinstantmeshes"
GPYTOOLBOX, PYMESHLAB, PYMESHLAB_LEAN = "gpytoolbox", "PyMeshLab", "PyMeshLab, lean"

CONTENDERS = {
    contender.name: contender
    for contender in (
        _one_core(
            "fast, no projection",
            '`preset="fast", project=False, threads=1`: the algorithm as published; it finds creases '
            "and keeps them",
        ),
        _one_core("fast, no projection, no features", "with `feature_angle=None`"),
        Contender(
            TRUEFORM,
            "trueform",
            peers.trueform,
            f"{_TRUEFORM}; `parallel=False`",
            "no",
            {"parallel": False},
        ),
        _all_cores("fast, no projection", '`preset="fast", project=False`'),
        Contender(
            TRUEFORM_ALL,
            "trueform",
            peers.trueform,
            "`parallel=True`, otherwise the same",
            "no",
            {"parallel": True},
            all_cores=True,
        ),
        Contender(
            PMP,
            "PMP",
            peers.pmp,
            "`uniform_remeshing`, 5 iterations, single precision as built by default; the seconds "
            "of that call alone, without files and start of the process",
            "no",
            {"project": False},
        ),
        Contender(MESHLIB, "meshlib", peers.meshlib, f"{_MESHLIB}; no final relaxation", "no"),
        Contender(
            MESHLIB_ALL,
            "meshlib",
            peers.meshlib,
            "the same on all cores",
            "no",
            all_cores=True,
        ),
        _one_core("default", "`threads=1`; vertices on the input"),
        _all_cores("default", "all defaults"),
        _one_core("fine", '`preset="fine", threads=1`'),
        Contender(
            PMP_PROJECTED,
            "PMP",
            peers.pmp,
            "the same with projection, its default",
            "yes",
            {"project": True},
        ),
        Contender(
            MESHLIB_EVEN,
            "meshlib",
            peers.meshlib,
            f"{_MESHLIB}; `projectOnOriginalMesh`, `finalRelaxIters=5`, `finalRelaxNoShrinkage`: "
            "the closest to the work of the others",
            "new vertices, before relaxing",
            {"relaxations": 5, "project": True},
        ),
        Contender(
            GPYTOOLBOX,
            "gpytoolbox",
            peers.gpytoolbox,
            "`remesh_botsch(V, F, 5, L, project=True)`",
            "yes",
        ),
        Contender(
            CGAL,
            "compas_cgal",
            peers.compas_cgal,
            "`trimesh_remesh`, 5 iterations, `do_project=True`: CGAL's `isotropic_remeshing`",
            "yes",
        ),
        Contender(
            PYMESHLAB,
            "pymeshlab",
            peers.pymeshlab,
            "`meshing_isotropic_explicit_remeshing`, `iterations=5`, absolute `targetlen`, its "
            "defaults: checks distances, and keeps edges above 30 degrees",
            "yes",
        ),
        Contender(
            PYMESHLAB_LEAN,
            "pymeshlab",
            peers.pymeshlab,
            "with `checksurfdist=False, featuredeg=180`: neither distance check nor feature edges, "
            "like the others; the work closest to ours",
            "yes",
            {"checksurfdist": False, "featuredeg": 180.0},
        ),
        Contender(
            MMG,
            "mmgpy",
            peers.mmgpy,
            "`MmgMeshS.remesh(hsiz=L, hausd=L, angle=0)`: no ridges; by default `hausd` is 0.01 in the "
            "units of the mesh, which refines to it whatever L is",
            "onto its own smooth surface",
        ),
        Contender(
            ACVD,
            "pyacvd",
            peers.pyacvd,
            "`Clustering.cluster` into as many clusters as equilateral faces with edges L have "
            "vertices, after `subdivide` until the mesh has ten vertices per cluster",
            "yes",
        ),
        Contender(
            FIELD,
            "pyinstantmeshes",
            peers.pyinstantmeshes,
            "`remesh(target_edge_length=L, rosy=6, posy=3, deterministic=True)`: Instant Meshes, "
            "triangles aligned with a field of directions; boundaries are not aligned by default",
            "yes",
        ),
    )
}
