"""What is measured of a result: the columns that the pages show."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from remeshvec import RemeshResult, quality, surface_distance
from remeshvec.measures.record import Quality

from .meshes import FloatArray, IntArray, Sample


class Column(NamedTuple):
    """A measure as the pages show it."""

    key: str
    title: str
    digits: int


COLUMNS = (
    Column("area_error_voronoi", "E Voronoi %", 1),
    Column("area_error_face", "E face %", 1),
    Column("valence6", "valence 6 %", 1),
    Column("min_angle_p1", "p1 angle", 1),
    Column("min_angle", "min angle", 1),
    Column("in_band", "in band %", 1),
    Column("hausdorff", "Hausdorff %", 2),
    Column("rms", "RMS %", 3),
    Column("faces", "faces", 0),
)
LEGEND = (
    "E: mean relative area error, of the mixed Voronoi areas and of the faces. Valence 6: share of "
    "the inner vertices. p1, min: first percentile and smallest of the faces' smallest angles, "
    "degrees. In band: edges in [4/5, 4/3] L. Hausdorff, RMS: sampled, two-sided, in % of the "
    "diagonal."
)


def measure(sample: Sample, V: FloatArray, F: IntArray) -> dict[str, float]:
    """Measure a result by `COLUMNS`; shares and relative errors in percent."""
    after = quality(V, F, sample.length)
    distance = surface_distance(sample.V, sample.F, V, F)
    return {
        "area_error_voronoi": 100.0 * after.area_error_voronoi,
        "area_error_face": 100.0 * after.area_error_face,
        "valence6": 100.0 * after.valence6_inner,
        "min_angle_p1": after.min_angle_p1,
        "min_angle": after.min_angle,
        "in_band": 100.0 * after.edge_in_band,
        "hausdorff": 100.0 * distance.hausdorff_relative,
        "rms": 100.0 * distance.rms_relative,
        "faces": float(after.faces),
    }


def cells(measures: dict[str, float]) -> list[str]:
    """Format measures by `COLUMNS`."""
    return [f"{measures[column.key]:,.{column.digits}f}" for column in COLUMNS]


def topology_changes(before: Quality, after: Quality) -> list[str]:
    """Say what a result lost or gained: non-manifold parts may vanish, the rest must stay."""
    kept = ("components", "boundary_loops", "euler_number")
    not_more = (
        "nonmanifold_edges",
        "nonmanifold_vertices",
        "misoriented_edges",
        "degenerate_faces",
        "unreferenced_vertices",
    )
    pairs = {key: (getattr(before, key), getattr(after, key)) for key in (*kept, *not_more)}
    changed = [key for key in kept if pairs[key][0] != pairs[key][1]]
    changed += [key for key in not_more if pairs[key][0] < pairs[key][1]]
    return [f"{key.replace('_', ' ')} {pairs[key][0]} -> {pairs[key][1]}" for key in changed]


def turned_faces(sample: Sample, result: RemeshResult) -> int:
    """Count faces that point against all the input faces on which their corners lie."""
    normals = _area_vectors(sample.V, sample.F)[result.birth_face][np.asarray(result.F)]
    own = _area_vectors(result.V, result.F)
    return int((np.einsum("fci,fi->fc", normals, own) < 0.0).all(axis=1).sum())


def _area_vectors(V: Any, F: Any) -> FloatArray:
    a, b, c = (np.asarray(V, dtype=float)[corner] for corner in np.asarray(F).T)
    return np.cross(b - a, c - a)
