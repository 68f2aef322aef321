"""What a result remembers, to tell later where things lie on the input."""

from __future__ import annotations

from typing import Any, NamedTuple

from numpy.typing import NDArray

from ..core.lazy import Lazy
from ..core.vocabulary import BoolArray, FloatArray, IndexArray, Mesh
from ..input.prepare import FaceCuts
from ..reference.surface import Reference

__all__ = ["Births", "Provenance"]


# Faces or half-edges, and weights of the three corners of their faces.
Births = tuple[NDArray[Any], FloatArray]


class Provenance(NamedTuple):
    """The last mesh of a call and the reference, with what leads from them to the caller's numbers."""

    mesh: Mesh
    births: Lazy[Births]  # half-edges and weights, of all vertices of the mesh
    rows: IndexArray  # (m,) faces of the mesh in the order of the result
    vertices: IndexArray  # (n,) vertices of the mesh in the order of the result; nothing: all
    reference: Reference
    features: IndexArray  # (k,) half-edges of the reference on curves
    names: IndexArray  # (k,) of those curves' edges
    face_source: NDArray[Any]  # faces of the reference in the input
    vertex_source: IndexArray  # vertices of the reference in the input
    flipped: BoolArray | None  # faces of the input whose corners 1 and 2 were swapped
    cuts: FaceCuts | None  # faces of the reference that are parts of input faces
    representative: IndexArray | None  # the vertex that stands for each of the input; None: itself
    n_in: int
    trust: float
    threads: int
