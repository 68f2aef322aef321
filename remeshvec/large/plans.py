"""What each round changes, and in which parts.

Round 1 remeshes everything in boxes. What lies along their cuts is bad then, because a frozen line has
kept its edges: round 2 remeshes bands around the cuts, in boxes of a turned frame, and round 3 what lies
around the cuts of these, in whole components, so that no cut is left. Lines that were frozen last keep
slightly uneven areas (E + 0.3 to 1.3 %); round 4 moves the vertices around them, with an overlap that is
thrown away and so leaves no line of its own. Round 5 remeshes around the few faces that are still thin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, radians
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import BoolArray, FloatArray, IndexArray, IntArray
from .geometry import smallest_angle_cosines
from .partition import (
    border_of,
    centroids_of,
    cut_into_boxes,
    face_weights,
    group_components,
    make_parts,
    near_faces,
)
from .scratch import load, save_arrays
from .tasks import MOVE, OVERLAP, REPAIR, SWEEP
from .vocabulary import Parts, SurfaceMesh, group_rows, mark

__all__ = ["ROUNDS", "Plan", "Round", "even_runs", "points_of", "save_plan"]

# Target lengths around cuts within which everything is remeshed; 8 cost .5 of the area error there.
_BAND = 12.0

# Around frozen lines within which vertices are moved.
_SETTLED = 8.0

# Around thin faces within which everything is remeshed, and the angle below which a face is thin.
_BALL = 6.0
_THIN = 40.0


@dataclass(frozen=True)
class Plan:
    """What all rounds need to know to cut a mesh into parts."""

    folder: Path
    part_faces: int
    n_reference: int  # faces of the reference
    area: float  # of the reference

    def weights(self, mesh: SurfaceMesh) -> FloatArray:
        """Work that every face stands for."""
        return face_weights(mesh, self.n_reference, self.area)


@dataclass(frozen=True)
class Round:
    """One round: a name, what its tasks do, and how it is cut."""

    name: str
    kind: str
    cut: Callable[[Plan, SurfaceMesh], Parts]


def _everything(plan: Plan, mesh: SurfaceMesh) -> Parts:
    """All faces, in boxes."""
    weights = plan.weights(mesh)
    part, count = cut_into_boxes(centroids_of(mesh), weights, plan.part_faces, 0)
    return make_parts(mesh.F, part, count, len(mesh.X))


def _bands(plan: Plan, mesh: SurfaceMesh) -> Parts:
    """Bands around the cuts of the round before, in boxes of a turned frame."""
    centroids = centroids_of(mesh)
    band = near_faces(mesh, centroids, points_of(plan, "everything", "cuts"), _BAND)
    part = np.full(len(mesh.F), -1, np.int32)
    part[band], count = cut_into_boxes(
        centroids[band], plan.weights(mesh)[band], plan.part_faces, 1
    )
    return make_parts(mesh.F, part, count if band.any() else 0, len(mesh.X))


def _crossings(plan: Plan, mesh: SurfaceMesh) -> Parts:
    """Take what lies around the cuts of the bands, in whole components."""
    region = near_faces(mesh, centroids_of(mesh), points_of(plan, "bands", "cuts"), _BAND)
    return _components(plan, mesh, region)


def _repairs(plan: Plan, mesh: SurfaceMesh) -> Parts:
    """Take what lies around thin faces near lines that were frozen, in whole components."""
    centroids = centroids_of(mesh)
    faces = np.flatnonzero(near_faces(mesh, centroids, _frozen_lines(plan), _SETTLED))
    thin = faces[smallest_angle_cosines(mesh.X[mesh.F[faces]][:, :, :3]) > cos(radians(_THIN))]
    return _components(plan, mesh, near_faces(mesh, centroids, centroids[thin], _BALL))


def _components(plan: Plan, mesh: SurfaceMesh, region: BoolArray) -> Parts:
    part = np.full(len(mesh.F), -1, np.int32)
    faces = np.flatnonzero(region)
    count = 0
    if len(faces):
        part[faces], count = group_components(mesh.F, faces, plan.weights(mesh), plan.part_faces)
    return make_parts(mesh.F, part, count, len(mesh.X))


def _frozen_lines(plan: Plan) -> FloatArray:
    """Vertices of the lines that were frozen in the last rounds that changed edges there."""
    return np.concatenate([points_of(plan, name, "rims") for name in ("bands", "crossings")])


def _settling(plan: Plan, mesh: SurfaceMesh) -> Parts:
    """Vertices around frozen lines, in boxes, each with an overlap of faces."""
    region = near_faces(mesh, centroids_of(mesh), _frozen_lines(plan), _SETTLED)
    n = len(mesh.X)
    border = border_of(mesh.F, region.astype(np.int32), n)
    inner = np.flatnonzero(mark(n, mesh.F[region]) & ~border)
    owner = np.full(n, -1, np.int32)
    owner[inner], count = cut_into_boxes(
        mesh.X[inner, :3], np.full(len(inner), 2.0), plan.part_faces, 2
    )
    return _overlapping_parts(mesh.F, region, owner, count if len(inner) else 0)


def _overlapping_parts(
    F: IndexArray, region: BoolArray, owner: NDArray[np.int32], count: int
) -> Parts:
    """List the vertices of every part, the faces of the region around them, and the ring."""
    n = len(owner)
    moved, moved_start = group_rows(owner, count)
    inside = np.flatnonzero(region)
    F_inside = np.asarray(F[inside])
    touched = mark(n, F_inside)
    around = np.flatnonzero(touched[F].any(axis=1))
    F_around = np.asarray(F[around])
    cores, rings = [], []
    for k in range(count):
        reached = mark(n, moved[moved_start[k] : moved_start[k + 1]])
        is_core: Any = None
        for _ in range(OVERLAP):
            is_core = reached[F_inside].any(axis=1)
            reached[F_inside[is_core]] = True
        cores.append(inside[is_core])
        seen = around[mark(n, F_inside[is_core])[F_around].any(axis=1)]
        rings.append(np.setdiff1d(seen, cores[-1], assume_unique=True))
    none = np.empty(0, np.int64)
    return Parts(
        np.concatenate([none, *cores]),
        _starts(cores),
        np.concatenate([none, *rings]),
        _starts(rings),
        moved,
        moved_start,
        none,
    )


def _starts(rows: list[Any]) -> IntArray:
    return np.concatenate([[0], np.cumsum([len(row) for row in rows], dtype=np.int64)]).astype(
        np.int64
    )


ROUNDS = (
    Round("everything", SWEEP, _everything),
    Round("bands", SWEEP, _bands),
    Round("crossings", SWEEP, _crossings),
    Round("settling", MOVE, _settling),
    Round("repairs", REPAIR, _repairs),
)


def even_runs(n: int, most: int) -> Parts:
    """Cut vertices into runs, as parts without faces."""
    count = max(1, -(-n // most))
    start = np.arange(count + 1, dtype=np.int64) * n // count
    none, zeros = np.empty(0, np.int64), np.zeros(count + 1, np.int64)
    return Parts(none, zeros, none, zeros, np.arange(n), start, none)


def save_plan(folder: Path, mesh: SurfaceMesh, parts: Parts) -> None:
    """Write the parts of a round, and where its cuts and rims lie."""
    n = len(mesh.X)
    core = mark(len(mesh.F), parts.core)
    rim = mark(n, mesh.F[core]) & mark(n, mesh.F[~core])
    points = {"cuts": mesh.X[parts.shared, :3], "rims": mesh.X[rim, :3]}
    save_arrays(folder / "parts", {**parts._asdict(), **points})


def points_of(plan: Plan, name: str, noun: str) -> FloatArray:
    """Points that an earlier round has left: its ``"cuts"`` or ``"rims"``."""
    return np.asarray(load(plan.folder / name / "parts", noun)[noun])
