"""``polydata.remeshvec``: PyVista loads this module on first use, through its entry point."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pyvista

from .input.options import RemeshKeywords
from .measures.quality import Quality, quality
from .pipeline.remesh import remesh

if TYPE_CHECKING:
    from typing import Unpack

__all__ = ["RemeshvecAccessor"]


@pyvista.register_dataset_accessor("remeshvec", pyvista.PolyData)
class RemeshvecAccessor:
    """Remeshing and measures of a ``pyvista.PolyData``."""

    def __init__(self, mesh: Any) -> None:
        self._mesh = mesh

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

    def quality(self) -> Quality:
        """Measure edges, areas, angles and valences; polygons are triangulated."""
        surface = self._mesh if self._mesh.is_all_triangles else self._mesh.triangulate()
        return quality(surface.points, surface.regular_faces)
