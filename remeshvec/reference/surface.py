"""The reference surface that the sweeps project onto."""

from __future__ import annotations

from typing import NamedTuple

from ..core.vocabulary import FloatArray, IndexArray, Tree
from ..features.polyline import Polylines
from .bvh import Surface

__all__ = ["Reference"]


class Reference(NamedTuple):
    """The input surface: what vertices are projected onto and born on."""

    surface: Surface  # gets its tree when it is first projected onto
    X: FloatArray  # (n, 4), target lengths in the last column
    origin: IndexArray  # (3 m,)
    curve_row: IndexArray  # (3 m,), see `polyline.join_edges`
    curve_neighbours: IndexArray  # (2, 1 + j)
    arcs: FloatArray  # (3, 1 + j), see `polyline.measure_arcs`

    @property
    def tree(self) -> Tree:
        """The tree over its faces, built on first use."""
        return self.surface.tree

    @property
    def polylines(self) -> Polylines:
        """The polylines of its feature curves, for kernels."""
        return Polylines(self.X, self.origin, self.curve_row, self.curve_neighbours, self.arcs)
