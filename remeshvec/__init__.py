"""Isotropic remeshing of triangle meshes, fast, deterministic, with provenance.

>>> V2, F2 = remesh(V, F, L)  # doctest: +SKIP
"""

from .distance import SurfaceDistance, surface_distance
from .errors import MeshFormatError, MeshInputError, OptionError, RemeshvecError
from .mesh_files import MeshFile, read_mesh, write_mesh
from .quality import Quality, quality
from .remesh import remesh
from .report import RemeshResult, Report
from .sizing import Adaptive

__version__ = "0.1.0"

__all__ = [
    "Adaptive",
    "MeshFile",
    "MeshFormatError",
    "MeshInputError",
    "OptionError",
    "Quality",
    "RemeshResult",
    "RemeshvecError",
    "Report",
    "SurfaceDistance",
    "quality",
    "read_mesh",
    "remesh",
    "surface_distance",
    "write_mesh",
]
