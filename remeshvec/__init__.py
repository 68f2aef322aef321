"""Isotropic remeshing of triangle meshes, fast, deterministic, with provenance.

>>> V2, F2 = remesh(V, F, L)  # doctest: +SKIP
"""

from typing import TYPE_CHECKING, Any

from .core.version import __version__ as __version__
from .errors import (
    BatchError,
    MeshFormatError,
    MeshInputError,
    OptionError,
    RemeshvecError,
    RemeshWarning,
    SingularSystemError,
    WorkerError,
)
from .files.mesh_files import MeshFile, read_mesh
from .files.write import write_mesh
from .measures.distance import SurfaceDistance, surface_distance
from .measures.quality import quality
from .measures.record import Quality
from .output.defects import Defects
from .output.light import LightResult
from .output.report import Report
from .output.result import RemeshResult
from .pipeline.creases import find_creases
from .pipeline.remesh import remesh
from .sizing.adaptive import Adaptive

if TYPE_CHECKING:
    from .batch.many import BatchItem, remesh_many
    from .batch.one_file import remesh_file
    from .batch.one_item import remesh_item
    from .html_page.page import html_report, show_html, write_html
    from .large.remesh_large import remesh_large
    from .large.result import LargePart, LargeResult
    from .modelling.denoising import denoise
    from .modelling.editing import Editor, deform
    from .modelling.fairing import fair
    from .modelling.laplacians import cotangent_matrix, laplacian, vertex_areas
    from .modelling.multiresolution import EditedSurface, MultiresolutionEditor
    from .modelling.smoothing import smooth
    from .modelling.solver import LaplacianSolver
    from .scans.repair import repair
    from .scans.report import RepairReport, RepairResult

__all__ = [
    "Adaptive",
    "BatchError",
    "BatchItem",
    "Defects",
    "EditedSurface",
    "Editor",
    "LaplacianSolver",
    "LargePart",
    "LargeResult",
    "LightResult",
    "MeshFile",
    "MeshFormatError",
    "MeshInputError",
    "MultiresolutionEditor",
    "OptionError",
    "Quality",
    "RemeshResult",
    "RemeshWarning",
    "RemeshvecError",
    "RepairReport",
    "RepairResult",
    "Report",
    "SingularSystemError",
    "SurfaceDistance",
    "WorkerError",
    "cotangent_matrix",
    "deform",
    "denoise",
    "fair",
    "find_creases",
    "html_report",
    "laplacian",
    "quality",
    "read_mesh",
    "remesh",
    "remesh_file",
    "remesh_item",
    "remesh_large",
    "remesh_many",
    "repair",
    "show_html",
    "smooth",
    "surface_distance",
    "vertex_areas",
    "write_html",
    "write_mesh",
]

# Imported on first use: these need scipy.sparse, which remeshing does not, or start processes.
_LAZY = {
    "BatchItem": "batch.many",
    "EditedSurface": "modelling.multiresolution",
    "Editor": "modelling.editing",
    "LaplacianSolver": "modelling.solver",
    "LargePart": "large.result",
    "LargeResult": "large.result",
    "MultiresolutionEditor": "modelling.multiresolution",
    "RepairReport": "scans.report",
    "RepairResult": "scans.report",
    "cotangent_matrix": "modelling.laplacians",
    "deform": "modelling.editing",
    "denoise": "modelling.denoising",
    "fair": "modelling.fairing",
    "html_report": "html_page",
    "laplacian": "modelling.laplacians",
    "remesh_file": "batch.one_file",
    "remesh_item": "batch.one_item",
    "remesh_large": "large.remesh_large",
    "remesh_many": "batch.many",
    "repair": "scans.repair",
    "show_html": "html_page",
    "smooth": "modelling.smoothing",
    "vertex_areas": "modelling.laplacians",
    "write_html": "html_page",
}
_FOLDERS = ("evolver", "html_page", "viz")  # public, each with names of its own


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name in _FOLDERS:
        return import_module(f".{name}", __name__)
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_LAZY[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, *_FOLDERS, "__version__"])
