"""What the shell command does before it remeshes: repair, and remove noise."""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from ..errors import OptionError
from ..interop.mesh_data import MeshData, corner_values
from ..modelling.denoising import denoise
from ..scans.repair import repair
from ..scans.report import RepairReport, RepairResult
from .arguments import FILE_OPTIONS

__all__ = ["check_repair", "is_asked_for", "repaired"]


def check_repair(options: argparse.Namespace) -> None:
    """Refuse files that number elements of the input, which a repair numbers anew."""
    if not is_asked_for(options):
        return
    for name in (*FILE_OPTIONS, "lengths"):
        if getattr(options, name) is not None:
            raise OptionError(
                f"--{name.replace('_', '-')} numbers what is in INPUT, and a repair numbers it anew; "
                "repair in Python with remeshvec.repair, and write the files for its result"
            )


def repaired(options: argparse.Namespace, data: MeshData) -> tuple[MeshData, RepairReport | None]:
    """Return the mesh that is to be remeshed, with its data, and what was done to it if anything was."""
    report = None
    if is_asked_for(options):
        result = repair(
            data.V,
            data.F,
            weld=0.0 if options.weld is None else options.weld,
            min_component=options.min_component or 0,
            keep_largest=options.keep_largest,
            fill_holes=options.fill_holes or 0,
        )
        data, report = _with_data(data, result), result.report
    if options.denoise:
        data = replace(data, V=denoise(data.V, data.F, options.denoise))
    return data, report


def is_asked_for(options: argparse.Namespace) -> bool:
    """Tell whether any of the flags wants a repair."""
    return bool(
        options.repair
        or options.keep_largest
        or options.weld is not None
        or options.min_component is not None
        or options.fill_holes is not None
    )


def _with_data(data: MeshData, result: RepairResult) -> MeshData:
    """Take the data along; faces that fill holes have those of corners beside them."""
    F, corners = result.F, result.corner_source
    old = corners[:, 0] >= 0
    beside = np.zeros(len(result.V), np.int64)
    beside[F[old]] = corners[old]
    corners = np.where(old[:, None], corners, beside[F])
    on_corners = dict(data.on_corners)
    # Welding takes the data of one vertex; at seams all of them are needed.
    for name in data.on_vertices.keys() & set(data.feature_data):
        on_corners[name] = corner_values(data.on_vertices[name], data.F)
    return replace(
        data,
        V=result.V,
        F=F,
        on_vertices={
            name: x[result.vertex_source]
            for name, x in data.on_vertices.items()
            if name not in on_corners
        },
        on_faces={name: x[corners[:, 0] // 3] for name, x in data.on_faces.items()},
        on_corners={name: x.reshape(-1, *x.shape[2:])[corners] for name, x in on_corners.items()},
    )
