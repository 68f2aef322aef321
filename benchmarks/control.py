"""What control costs and how well it is kept: ``python -m benchmarks.control [--rotations 5]``.

Features found without being asked for against none, on organic meshes and on a part; lengths from a
tolerance, on a sphere; bounded deviation. Writes ``docs/control.md``.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from statistics import median
from time import perf_counter
from typing import Any

import igl
import numpy as np
from scipy.spatial.transform import Rotation

from remeshvec import Adaptive, quality, remesh, surface_distance

from .meshes import load, small_meshes
from .tables import DOCS, machine, machine_line, page, table, write_page

ROUNDS = 7
TOLERANCES = (0.005, 0.02)
SHARES = (0.01, 0.003)  # of the diagonal


def turned(V: Any, rotations: int) -> list[Any]:
    """The mesh as it is, and rotated."""
    turns = Rotation.random(rotations - 1, random_state=1) if rotations > 1 else []
    return [V, *(turn.apply(V) for turn in turns)]


def timed(V: Any, F: Any, cases: Sequence[dict[str, Any]], length: float) -> list[float]:
    """Median seconds of every case, interleaved, on one thread."""
    seconds: list[list[float]] = [[] for _ in cases]
    for _ in range(ROUNDS):
        for case, one in zip(cases, seconds, strict=True):
            start = perf_counter()
            remesh(V, F, length, threads=1, **case)
            one.append(perf_counter() - start)
    return [median(one[1:]) for one in seconds]


def cost_row(name: str, rotations: int) -> list[str]:
    """What ``feature_angle="auto"`` changes: edges, area errors, valence, time."""
    sample = load(name)
    changes, creases = [], 0
    for V in turned(sample.V, rotations):
        figures = []
        for angle in (None, "auto"):
            result = remesh(V, sample.F, sample.length, feature_angle=angle, threads=1)
            q = quality(*result, L=sample.length)
            figures.append([q.area_error_voronoi, q.area_error_face, q.valence6_inner])
            creases = result.report.features["crease_edges"]
        changes.append(100.0 * (np.array(figures[1]) - figures[0]))
    mean, spread = np.mean(changes, axis=0), np.std(changes, axis=0)
    without, with_features, neither = timed(
        sample.V,
        sample.F,
        [{"feature_angle": None}, {}, {"feature_angle": None, "project": False}],
        sample.length,
    )
    edges = 1.5 * len(sample.F)
    return [
        name,
        f"{100 * creases / edges:.2f}",
        *(f"{m:+.2f} ± {s:.2f}" for m, s in zip(mean, spread, strict=True)),
        f"{with_features / without:.2f}",
        f"{with_features / neither:.2f}",
    ]


def sphere_rows(rotations: int) -> list[list[str]]:
    """Faces against the optimum, and the largest error against the tolerance."""
    V, F = igl.icosahedron() if hasattr(igl, "icosahedron") else _icosahedron()
    for _ in range(6):
        V, F = igl.upsample(V, F)
        V = V / np.linalg.norm(V, axis=1, keepdims=True)
    grid = np.array([[i, j, 12 - i - j] for i in range(13) for j in range(13 - i)]) / 12.0
    rows = []
    for tolerance in TOLERANCES:
        ideal = 4 * np.pi / (np.sqrt(3) / 4 * (6 * tolerance - 3 * tolerance**2))
        faces, worst, share, steep = [], [], [], []
        for W in turned(V, rotations):
            result = remesh(W, F, Adaptive(tolerance), threads=1)
            points = np.einsum("kc,mcx->mkx", grid, result.V[result.F])
            error = np.abs(1 - np.linalg.norm(points, axis=2)) / tolerance
            faces.append(len(result.F) / ideal)
            worst.append(error.max())
            share.append(100 * (error <= 1).mean())
            a, b = result.lengths[result.F], result.lengths[np.roll(result.F, 1, axis=1)]
            steep.append(np.maximum(a / b, b / a).max())
        rows.append(
            [
                f"{tolerance:g}",
                f"{np.mean(faces):.3f} ({max(faces):.3f})",
                f"{np.mean(worst):.3f} ({max(worst):.3f})",
                f"{min(share):.2f}",
                f"{max(steep):.3f}",
            ]
        )
    return rows


def _icosahedron() -> tuple[Any, Any]:
    g = (1 + 5**0.5) / 2
    V = np.array(
        [(0, s, t * g) for s in (-1, 1) for t in (-1, 1)]
        + [(s, t * g, 0) for s in (-1, 1) for t in (-1, 1)]
        + [(t * g, 0, s) for s in (-1, 1) for t in (-1, 1)]
    )
    V = V / np.linalg.norm(V, axis=1, keepdims=True)
    D = np.linalg.norm(V[:, None] - V[None], axis=2)
    near = D < 1.1
    F = [
        (a, b, c) if np.linalg.det(V[[a, b, c]]) > 0 else (a, c, b)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if near[a, b] and near[b, c] and near[c, a]
    ]
    return V, np.array(F)


def deviation_row(name: str, share: float) -> list[str]:
    """Distance both ways against what was allowed, and what that takes."""
    sample = load(name)
    diagonal = float(np.linalg.norm(np.ptp(sample.V[np.unique(sample.F)], axis=0)))
    start = perf_counter()
    result = remesh(sample.V, sample.F, 2 * sample.length, max_deviation=share * diagonal)
    seconds = perf_counter() - start
    found = surface_distance(sample.V, sample.F, *result, samples=200_000)
    loose = remesh(sample.V, sample.F, 2 * sample.length)
    far = surface_distance(sample.V, sample.F, *loose, samples=200_000).hausdorff
    return [
        name,
        f"{100 * share:g}",
        f"{100 * far / diagonal:.2f}",
        f"{found.max_1_to_2 / share / diagonal:.2f}",
        f"{found.max_2_to_1 / share / diagonal:.2f}",
        f"{len(loose.F):,}",
        f"{len(result.F):,}",
        f"{seconds:.1f}",
    ]


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rotations", type=int, default=5)
    options = parser.parse_args(argv)
    names = small_meshes()
    text = page(
        "Control, measured",
        machine_line(machine()),
        f"Default preset, L = 0.9 x the mean edge. Effect of `feature_angle=\"auto\"` against "
        f"`None`: percentage points, mean and standard deviation over {options.rotations} "
        "orientations. The rule's constants were chosen on a corpus that holds the samples. Last "
        "columns, one thread: time with features and projection over that without features, and over "
        "that without both.",
        table(
            (
                "mesh", "edges kept %", "E Voronoi", "E face", "valence 6",
                "time / no features", "time / neither",
            ),
            [cost_row(name, options.rotations) for name in names],
        ),
        f"`Adaptive(tolerance)` on a unit sphere of 81,920 faces, {options.rotations} orientations, "
        "mean (worst): faces over the optimum, which is the number of equilateral faces whose "
        "centres are off by the tolerance; largest distance from the sphere of 91 samples per face, in "
        "tolerances; smallest share of samples within it; largest ratio of target lengths along an "
        "edge (at most 1.5).",
        table(
            ("tolerance", "faces / optimum", "error / tolerance", "within %", "gradation"),
            sphere_rows(options.rotations),
        ),
        "`max_deviation` at twice that L, in % of the diagonal; distances from 200,000 samples each way, "
        "in units of the bound.",
        table(
            (
                "mesh", "allowed %", "without bound %", "input to result", "result to input",
                "faces without", "faces", "seconds",
            ),
            [deviation_row(name, share) for name in names for share in SHARES],
        ),
        "\n\n".join(f"![{alt}](pictures/{name}.png)" for name, alt in PICTURES.items()),
    )  # fmt: skip
    write_page(DOCS, "control.md", text)


PICTURES = {
    "features": "A part keeps its creases; without features they crumble",
    "boundary": "Boundary free, split and fixed",
    "adaptive": "Lengths from the curvature",
    "labels": "Borders between labels are kept",
    "selection": "Only a part is remeshed",
    "non_manifold": "Sheets that meet stay joined",
    "max_deviation": "A bound for the distance from the input",
    "thin_sheet": "Both sides of a thin sheet stay apart",
}


if __name__ == "__main__":
    main()
