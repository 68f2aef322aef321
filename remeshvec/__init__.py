"""Isotropic remeshing of triangle meshes, fast, deterministic, with provenance.

>>> V2, F2 = remesh(V, F, L)  # doctest: +SKIP
"""

from typing import TYPE_CHECKING, Any

from .distance import SurfaceDistance, surface_distance
from .errors import (
    BatchError,
    MeshFormatError,
    MeshInputError,
    OptionError,
    RemeshvecError,
    SingularSystemError,
    WorkerError,
)
from .mesh_files import MeshFile, read_mesh, write_mesh
from .quality import Quality, quality
from .remesh import remesh
from .report import Report
from .result import RemeshResult
from .sizing import Adaptive

if TYPE_CHECKING:
    from .batch import BatchItem, remesh_many
    from .data_files import remesh_file
    from .editing import Editor, deform
    from .fairing import fair
    from .html_page import html_report, show_html, write_html
    from .laplacians import cotangent_matrix, laplacian, vertex_areas
    from .multiresolution import EditedSurface, MultiresolutionEditor
    from .smoothing import smooth
    from .solver import LaplacianSolver

__version__ = "0.1.0"

__all__ = [
    "Adaptive",
    "BatchError",
    "BatchItem",
    "EditedSurface",
    "Editor",
    "LaplacianSolver",
    "MeshFile",
    "MeshFormatError",
    "MeshInputError",
    "MultiresolutionEditor",
    "OptionError",
    "Quality",
    "RemeshResult",
    "RemeshvecError",
    "Report",
    "SingularSystemError",
    "SurfaceDistance",
    "WorkerError",
    "cotangent_matrix",
    "deform",
    "fair",
    "html_report",
    "laplacian",
    "quality",
    "read_mesh",
    "remesh",
    "remesh_file",
    "remesh_many",
    "show_html",
    "smooth",
    "surface_distance",
    "vertex_areas",
    "write_html",
    "write_mesh",
]

# Imported when first asked for: they need scipy.sparse, which remeshing does not, or start processes.
_LATE = {
    "BatchItem": "batch",
    "EditedSurface": "multiresolution",
    "Editor": "editing",
    "LaplacianSolver": "solver",
    "MultiresolutionEditor": "multiresolution",
    "cotangent_matrix": "laplacians",
    "deform": "editing",
    "fair": "fairing",
    "html_report": "html_page",
    "laplacian": "laplacians",
    "remesh_file": "data_files",
    "remesh_many": "batch",
    "show_html": "html_page",
    "smooth": "smoothing",
    "vertex_areas": "laplacians",
    "write_html": "html_page",
}


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f".{_LATE[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_LATE})
