"""The record of a mesh's quality, and how it is shown.

Shares and relative figures are fractions (0 to 1), angles are degrees, lengths are those of the input.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from ..core.shown import html_table, one_line

__all__ = ["HIGHLIGHTS", "Quality", "side_by_side"]

# The rows that say most, for small tables.
HIGHLIGHTS = (
    "vertices",
    "faces",
    "edge length, mean",
    "edges in 4/5 to 4/3 L",
    "smallest angle",
    "smallest angle, 1st percentile",
    "valence 6 (inner)",
    "area error, faces",
)


@dataclass(frozen=True, repr=False)
class Quality:
    """Measures of one triangle mesh, each explained in a comment.

    A vertex is *inner* when every edge at it has two faces, a *boundary* vertex when an edge at it
    has one face.  Faces that name a vertex twice are counted in `degenerate_faces` and left out of
    everything else, and so are unreferenced vertices.
    """

    vertices: int  # those that a face uses
    faces: int  # without those that name a vertex twice
    edges: int
    unreferenced_vertices: int
    degenerate_faces: int  # a repeated vertex, or no area
    target_length: float  # the L of `edge_in_band`
    edge_mean: float
    edge_min: float
    edge_max: float
    edge_cv: float  # standard deviation / mean
    edge_in_band: float  # share of edges in [4/5 L, 4/3 L]
    min_angle: float
    min_angle_p1: float  # first percentile of the faces' smallest angles
    min_angle_mean: float  # mean of the faces' smallest angles
    max_angle: float
    faces_below_30: float  # share of faces with an angle below 30 degrees
    radius_ratio_min: float  # 2 r_in / R_circ: 1 equilateral, 0 degenerate
    radius_ratio_mean: float
    inner_vertices: int
    boundary_vertices: int
    valence6_inner: float  # share of the inner vertices; 0 where there is none
    valence4_boundary: float  # share of the boundary vertices; 0 where there is none
    valence_histogram: dict[int, int]  # valence -> inner vertices
    area_error_face: float  # mean |A_f - A_mean| / A_mean over faces
    area_error_voronoi: float  # the same over vertices, with mixed Voronoi areas
    boundary_edges: int  # edges with one face
    boundary_loops: int  # counted after pinched vertices are parted into their fans
    nonmanifold_edges: int  # edges with more than two faces
    nonmanifold_vertices: int  # vertices whose faces form more than one fan
    misoriented_edges: int  # edges that two faces run along in the same direction
    components: int  # of faces joined along edges
    euler_number: int  # vertices - edges + faces
    area: float
    volume: float | None  # signed, positive for outward normals; None for an open surface

    @property
    def is_closed(self) -> bool:
        """Whether the surface encloses a volume."""
        return self.volume is not None

    def to_dict(self) -> dict[str, Any]:
        """Return all measures as a JSON-ready dict."""
        return {
            **asdict(self),
            "valence_histogram": {str(k): n for k, n in self.valence_histogram.items()},
        }

    def rows(self) -> list[tuple[str, str]]:
        """Return the table: a label and a formatted value per row."""
        valence6 = _percent(self.valence6_inner) if self.inner_vertices else "-"
        valence4 = _percent(self.valence4_boundary) if self.boundary_vertices else "-"
        return [
            ("vertices", f"{self.vertices:,}"),
            ("faces", f"{self.faces:,}"),
            ("Euler number", str(self.euler_number)),
            ("components", str(self.components)),
            ("boundary loops", str(self.boundary_loops)),
            ("non-manifold edges", str(self.nonmanifold_edges)),
            ("non-manifold vertices", str(self.nonmanifold_vertices)),
            ("degenerate faces", str(self.degenerate_faces)),
            ("area", f"{self.area:.5g}"),
            ("volume", "open" if self.volume is None else f"{self.volume:.5g}"),
            ("edge length, mean", f"{self.edge_mean:.4g}"),
            ("edge length, min", f"{self.edge_min:.4g}"),
            ("edge length, max", f"{self.edge_max:.4g}"),
            ("edge length, deviation / mean", f"{self.edge_cv:.3f}"),
            ("edges in 4/5 to 4/3 L", _percent(self.edge_in_band)),
            ("smallest angle", f"{self.min_angle:.1f} deg"),
            ("smallest angle, 1st percentile", f"{self.min_angle_p1:.1f} deg"),
            ("smallest angle, mean", f"{self.min_angle_mean:.1f} deg"),
            ("largest angle", f"{self.max_angle:.1f} deg"),
            ("faces below 30 deg", _percent(self.faces_below_30)),
            ("radius ratio, min", f"{self.radius_ratio_min:.3f}"),
            ("radius ratio, mean", f"{self.radius_ratio_mean:.3f}"),
            ("valence 6 (inner)", valence6),
            ("valence 4 (boundary)", valence4),
            ("area error, faces", _percent(self.area_error_face)),
            ("area error, Voronoi", _percent(self.area_error_voronoi)),
        ]

    def __str__(self) -> str:
        return "\n".join(f"{label:<31}{value:>14}" for label, value in self.rows())

    def __repr__(self) -> str:
        return one_line(
            "Quality",
            f"{self.vertices:,} vertices",
            f"{self.faces:,} faces",
            f"edges of {self.edge_mean:.4g}",
            f"smallest angle {self.min_angle:.1f} deg",
            "closed" if self.is_closed else f"{self.boundary_loops} boundary loops",
        )

    def _repr_html_(self) -> str:
        return html_table(row for row in self.rows() if row[0] in HIGHLIGHTS)


def side_by_side(before: Quality, after: Quality) -> str:
    """Return one table of two measured meshes, `before` on the left."""
    lines = [f"{'':<31}{'before':>14}{'after':>14}"]
    for (label, old), (_, new) in zip(before.rows(), after.rows(), strict=True):
        lines.append(f"{label:<31}{old:>14}{new:>14}")
    return "\n".join(lines)


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"
