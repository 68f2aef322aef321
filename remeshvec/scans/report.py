"""What a repair did, and the surface that it made."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from ..core.vocabulary import FloatArray, IntArray

__all__ = ["RepairReport", "RepairResult"]


@dataclass(frozen=True)
class RepairReport:
    """Counts of what a repair found and did, each explained in a comment; all 0 for a clean surface."""

    welded_vertices: int = 0  # vertices of the boundary that were joined with another one
    degenerate_faces: int = 0  # faces removed because they name a vertex twice
    duplicate_faces: int = 0  # faces removed because others have the same corners
    flipped_faces: int = 0  # faces turned to the winding of their neighbours
    turned_components: int = 0  # closed components turned inside out, to face outwards
    split_vertices: int = 0  # vertices added where edges or vertices were not manifold
    removed_components: int = 0  # components that were too small, or not the largest
    removed_faces: int = 0  # their faces
    filled_holes: int = 0  # boundary loops closed
    filling_faces: int = 0  # faces that close them
    holes_left: int = 0  # boundary loops that are longer than asked for, or that no faces can close
    unused_vertices: int = 0  # vertices removed because no face used them

    def to_dict(self) -> dict[str, int]:
        """Return all counts as a JSON-ready dict."""
        return asdict(self)

    def __str__(self) -> str:
        done = [f"{name.replace('_', ' ')} {n:,}" for name, n in asdict(self).items() if n]
        return ", ".join(done) if done else "nothing to repair"


@dataclass(frozen=True, eq=False)
class RepairResult:
    """A repaired surface; unpacks as ``V, F``.

    Attributes
    ----------
    V : (n, 3) float64
        Vertices, all of them used; coordinates are those of the input, bit for bit.
    F : (m, 3) int64
        Faces; those that fill holes come last.
    vertex_source : (n,) int64
        Vertex of the input of every vertex.
    corner_source : (m, 3) int64
        Corner of the input of every corner, ``3 f + c`` for corner c of face f; -1 in faces that fill
        holes.
    face_source : (m,) int64
        Face of the input of every face; -1 for those that fill holes.
    report : RepairReport
        What was done.
    """

    V: FloatArray
    F: IntArray
    vertex_source: IntArray
    corner_source: IntArray
    report: RepairReport

    @property
    def face_source(self) -> IntArray:
        """Face of the input of every face; -1 for those that fill holes."""
        return self.corner_source[:, 0] // 3

    def __iter__(self) -> Iterator[Any]:
        return iter((self.V, self.F))

    def __repr__(self) -> str:
        return f"RepairResult({len(self.V):,} vertices, {len(self.F):,} faces: {self.report})"
