"""What each ingredient of the default recipe brings, over rotated copies of every mesh.

``python -m benchmarks.ablation [--rotations 5]``

The outcome of a sweep is sensitive to rounding, so one run of a variant says little: each mesh is
remeshed as it is and rotated, and means are shown. Constants of the recipe were chosen on the
samples, never on the meshes in ``data/``; the two are kept apart.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from remeshvec import quality, remesh, surface_distance
from remeshvec.input.recipe import PRESETS, Recipe, Rounds

from .meshes import LENGTH_FACTOR, load, small_meshes
from .quality import TARGETS
from .tables import DOCS, machine, machine_line, page, table, write_page

TUNED_ON = ("cat", "iphi_bad10k", "phands", "cow", "wolf_head")
# A CAD part whose creases are rounded: its figures say how, not how well the recipe works.
LEFT_OUT = ("bracket",)

DEFAULT = PRESETS["default"]
VARIANTS: dict[str, Recipe] = {
    "default": DEFAULT,
    "stiffness 20": replace(DEFAULT, stiffness=20.0),
    "no stiffness": replace(DEFAULT, stiffness=0.0),
    "midpoint collapses": replace(DEFAULT, quadric_reach=0.0),
    "flips by valence only": replace(DEFAULT, delaunay_ties=False),
    "flip normals within 45 degrees": replace(DEFAULT, flip_normal=45.0),
    "thresholds 4/5, 4/3 throughout": replace(DEFAULT, collapse=(0.8,) * 8, split=(4 / 3,) * 8),
    "twelve sweeps": replace(DEFAULT, iterations=12),
    "no rounds, four relaxations at the end": replace(DEFAULT, rounds=(), last_relaxations=4),
    "ten rounds": replace(DEFAULT, rounds=(Rounds(10),)),
    "forty rounds": replace(DEFAULT, rounds=(Rounds(40),)),
    "rounds without momentum": replace(DEFAULT, rounds=(Rounds(20, gain=1.0, momentum=0.0),)),
    "rounds with stiffness 60": replace(DEFAULT, rounds=(Rounds(20, stiffness=60.0),)),
    "trades for 10 degrees": replace(DEFAULT, rounds=(Rounds(20, trade_angle=10.0),)),
    "untangling below 41.5 degrees": replace(DEFAULT, untangle_angle=41.5),
    "no untangling": replace(DEFAULT, untangle_rounds=0),
    "projection in 3 sweeps": replace(DEFAULT, projected_sweeps=3),
    "projection in 5 sweeps": replace(DEFAULT, projected_sweeps=5),
    "sliver check": replace(DEFAULT, sliver_check=True),
}
COLUMNS = (
    "E Voronoi %",
    "E face %",
    "valence 6 %",
    "p1",
    "min",
    "in band %",
    "Hausdorff %",
    "RMS %",
)

KEYS = (
    "area_error_voronoi", "area_error_face", "valence6", "min_angle_p1",
    "min_angle", "in_band", "hausdorff", "rms",
)  # fmt: skip


def measures(V: Any, F: Any, length: float) -> list[float]:
    """Remesh once; figures in the order of the columns."""
    result = remesh(V, F, length, threads=1)
    q = quality(*result, L=length)
    d = surface_distance(V, F, *result, samples=30_000)
    shares = (q.area_error_voronoi, q.area_error_face, q.valence6_inner)
    return [
        *(100 * share for share in shares),
        q.min_angle_p1,
        q.min_angle,
        100 * q.edge_in_band,
        100 * d.hausdorff_relative,
        100 * d.rms_relative,
    ]


def over(names: Sequence[str], rotations: int) -> Any:
    """Figures of every mesh in every orientation: (meshes, rotations, columns)."""
    return np.array(
        [
            [
                measures(
                    Rotation.random(random_state=seed).apply(sample.V) if seed else sample.V,
                    sample.F,
                    sample.length,
                )
                for seed in range(rotations)
            ]
            for sample in map(load, names)
        ]
    )


def targets_met(names: Sequence[str], found: Any) -> list[list[str]]:
    """Count the orientations in which each target of a mesh is met."""
    rows = []
    for name, figures in zip(names, found, strict=True):
        if name not in TARGETS:
            continue
        row = [name]
        for column, key in enumerate(KEYS):
            if key not in TARGETS[name]:
                row.append("")
                continue
            bound, is_most = TARGETS[name][key]
            values = figures[:, column]
            row.append(str(int((values <= bound if is_most else values >= bound).sum())))
        rows.append(row)
    return rows


def main(argv: Sequence[str] | None = None) -> int:
    """Measure all variants and write ``docs/ablation.md``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rotations", type=int, default=5)
    rotations = parser.parse_args(argv).rotations
    present = [name for name in small_meshes() if name not in LEFT_OUT]
    groups = {
        "Meshes that no constant was chosen on": [n for n in present if n not in TUNED_ON],
        "Meshes that constants were chosen on": [n for n in present if n in TUNED_ON],
    }
    sections: list[str] = []
    met: list[list[str]] = []
    for title, names in groups.items():
        if not names:
            continue
        rows = []
        for variant, options in VARIANTS.items():
            PRESETS["default"] = options
            found = over(names, rotations)
            rows.append([variant, *(f"{x:.3g}" for x in found.mean(axis=(0, 1)))])
            if variant == "default":
                spread = found.std(axis=1, ddof=1).mean(axis=0)
                rows.append(["spread of one run of it", *(f"{x:.2g}" for x in spread)])
                met += targets_met(names, found)
            print(" | ".join(rows[-1]), flush=True)
        PRESETS["default"] = DEFAULT
        sections += [f"## {title}", ", ".join(names), table(["variant", *COLUMNS], rows)]
    intro = (
        f"L = {LENGTH_FACTOR} x the mean edge length. Means over the meshes named and {rotations} "
        "orientations of each. Spread: standard deviation over the orientations of one mesh, mean "
        "over meshes. Hausdorff and RMS are sampled, in % of the diagonal."
    )
    if met:
        sections += [
            "## Targets of the default preset",
            f"In how many of {rotations} orientations the default meets the targets of quality.md.",
            table(["mesh", *COLUMNS], met),
        ]
    write_page(DOCS, "ablation.md", page("Ablation", intro, machine_line(machine()), *sections))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
