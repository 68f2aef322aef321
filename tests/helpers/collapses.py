"""Collapse limits that only the guards of topology and curves restrict, for tests to tighten."""

from remeshvec.core.vocabulary import DEAD, Mesh
from remeshvec.operations.collapse import CollapseLimits

LOOSE = CollapseLimits(
    shortest=2e-3, longest=1e9, foldover_cosine=0.0, quadric_reach=0.0, sliver_check=False
)


def survivor_of(mesh: Mesh, a: int, b: int) -> int:
    """Vertex that a collapse of the edge a-b has left."""
    return a if mesh.vertex_halfedge[a] != DEAD else b
