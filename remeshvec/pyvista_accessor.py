"""``polydata.remeshvec``: PyVista loads this module on first use, through its entry point."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyvista

from .core.vocabulary import IntArray
from .files.write import write_mesh
from .input.options import RemeshKeywords
from .measures.distance import SurfaceDistance, surface_distance
from .measures.quality import quality
from .measures.record import Quality
from .pipeline.creases import find_creases
from .pipeline.remesh import remesh

if TYPE_CHECKING:
    from typing import Unpack

__all__ = ["RemeshvecAccessor"]


@pyvista.register_dataset_accessor("remeshvec", pyvista.PolyData)
class RemeshvecAccessor:
    """The functions of remeshvec for a ``pyvista.PolyData``; polygons are triangulated."""

    def __init__(self, mesh: Any) -> None:
        self._mesh = mesh

    def __repr__(self) -> str:
        return f"<remeshvec of a PolyData with {self._mesh.n_cells:,} cells>"

    def remesh(self, L: Any = None, **options: Unpack[RemeshKeywords]) -> Any:
        """Return a remeshed surface with the same point, cell and field data.

        Parameters
        ----------
        L : float, str, array, callable or Adaptive, optional
            Target edge length, or the name of point data that hold one per vertex.
        **options
            See `remeshvec.remesh`.
        """
        return remesh(self._mesh, L, **options)

    def find_creases(self, L: Any = None, **options: Unpack[RemeshKeywords]) -> IntArray:
        """Return the edges that `remesh` would keep; see `remeshvec.find_creases`."""
        return find_creases(self._mesh, L, **options)

    def quality(self, L: float | None = None) -> Quality:
        """Measure edges, areas, angles and valences; see `remeshvec.quality`."""
        return quality(self._mesh, L)

    def surface_distance(self, other: Any, *, samples: int = 100_000) -> SurfaceDistance:
        """Measure how far another mesh is away, both ways; see `remeshvec.surface_distance`."""
        return surface_distance(self._mesh, other, samples=samples)

    def smooth(self, **options: Any) -> Any:
        """Return a smoothed copy; ``options`` are those of `remeshvec.smooth`."""
        from .modelling.smoothing import smooth

        new = self._mesh if self._mesh.is_all_triangles else self._mesh.triangulate()
        new = new.copy()
        new.points = smooth(new, **options)
        return new

    def laplacian(self, **options: Any) -> Any:
        """Return the discrete Laplacian; ``options`` are those of `remeshvec.laplacian`."""
        from .modelling.laplacians import laplacian

        return laplacian(self._mesh, **options)

    def write(self, path: Any) -> None:
        """Write the surface with its data to a file; see `remeshvec.write_mesh`."""
        write_mesh(path, self._mesh)
