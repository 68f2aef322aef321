"""The report's experiment "Inverting the Laplacian", solvers side by side, and uniform areas.

``python -m benchmarks.laplacians [--meshes cat cow] [--output FOLDER]``
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import eigsh, splu

from remeshvec import LaplacianSolver, cotangent_matrix, laplacian, quality, remesh, vertex_areas

from .meshes import SAMPLES, find_file, load, made
from .panels import FloatArray, IntArray
from .tables import DOCS, machine, machine_line, page, table, write_page

BLOCK = 64  # right-hand sides solved at once
REPEATS = 5
LARGE = 100_000  # faces

# Total times for all right-hand sides that the report gives, in seconds: original, remeshed.
REPORT = {"iphi_bad10k": (59.0, 18.0), "phands": (9.2, 6.4), "cat": (86.0, 84.0)}

N_EIGENVALUES = 20

COLOURS = ("#555555", "#90a4ae", "#f48fb1", "#c2185b")  # of the bars


class Inverted(NamedTuple):
    """One way to invert the Laplacian of one mesh."""

    mesh: str
    way: str
    n: int
    area_error: float  # E, Voronoi
    factor: float  # seconds
    block: float  # seconds of `BLOCK` right-hand sides

    @property
    def total(self) -> float:
        """Seconds for all n right-hand sides."""
        return self.factor + self.block * self.n / BLOCK


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and write ``laplacians.md`` and its plot."""
    arguments = _parse(argv)
    inverted = [entry for name in arguments.meshes for entry in invert(name)]
    solvers = compare_solvers()
    errors = [*sphere_errors(), *(row for name in arguments.meshes for row in sample_errors(name))]
    _plot(arguments.output / "plots" / "laplacians.png", inverted)
    text = _page(inverted, solvers, errors)
    print(text)
    write_page(arguments.output, "laplacians.md", text)
    return 0


# --- inverting -----------------------------------------------------------------------------------


def invert(name: str) -> list[Inverted]:
    """Measure the original in two ways, and the remeshed one, of as many vertices."""
    print(name, file=sys.stderr, flush=True)
    sample = load(name)
    V, F = _usable(sample.V, sample.F)
    result = remesh(V, F, n_vertices=len(V))
    symmetric = laplacian(*result, "uniform")
    entries = [
        _measure(name, "original, LU", V, F, laplacian(V, F), "lu"),
        _measure(name, "original, Cholesky of C", V, F, cotangent_matrix(V, F), "cholesky"),
        _measure(name, "remeshed, Cholesky", *result, symmetric, "cholesky"),
    ]
    if find_spec("cholespy"):
        entries.append(_measure(name, "remeshed, CHOLMOD", *result, symmetric, "cholmod"))
    return entries


def _measure(name: str, way: str, V: Any, F: Any, A: Any, method: Any) -> Inverted:
    fixed = one_of_each_part(A)
    b = np.random.default_rng(0).normal(size=(len(V), BLOCK))
    factor = _seconds(lambda: LaplacianSolver(A, fixed, method))
    solver = LaplacianSolver(A, fixed, method)
    block = _seconds(lambda: solver.solve(b))
    return Inverted(name, way, len(V), quality(V, F).area_error_voronoi, factor, block)


def one_of_each_part(A: Any) -> IntArray:
    """First vertex of every component: fixed, they make the system regular."""
    return np.unique(connected_components(A, directed=False)[1], return_index=True)[1]


def _usable(V: FloatArray, F: IntArray) -> tuple[FloatArray, IntArray]:
    """Drop faces without area and vertices without faces, as any solver must."""
    T = V[F]
    area = np.linalg.norm(np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0]), axis=1)
    used, corners = np.unique(F[area > 0.0], return_inverse=True)
    return V[used], corners.reshape(-1, 3)


# --- solvers -------------------------------------------------------------------------------------


def compare_solvers() -> list[tuple[str, int, float, float]]:
    """Factor and solve three right-hand sides for meshes of `LARGE` faces, interleaved."""
    sample = load(made(9))
    V, F = _usable(sample.V, sample.F)
    result = remesh(V, F, n_faces=LARGE)
    A, plain = laplacian(*result, "uniform"), laplacian(V, F)
    fixed = one_of_each_part(A)
    inner, outer = _inner(A, fixed), _inner(plain, one_of_each_part(plain))
    b, b_outer = (np.random.default_rng(0).normal(size=(n.shape[0], 3)) for n in (inner, outer))
    mode = {"SymmetricMode": True}
    cases: dict[str, tuple[int, FloatArray, Callable[[], Any]]] = {
        "remeshed, LaplacianSolver": (
            len(result.F),
            np.insert(b, fixed, 0.0, axis=0),
            lambda: LaplacianSolver(A, fixed).solve,
        ),
        "remeshed, SuperLU, symmetric mode": (
            len(result.F),
            b,
            lambda: splu(inner, "MMD_AT_PLUS_A", 0.0, options=mode).solve,
        ),
        "original, SuperLU": (len(F), b_outer, lambda: splu(outer).solve),
    }
    if find_spec("cholespy"):
        cases['remeshed, LaplacianSolver, method="cholmod"'] = (
            len(result.F),
            np.insert(b, fixed, 0.0, axis=0),
            lambda: LaplacianSolver(A, fixed, "cholmod").solve,
        )
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in cases}
    for _ in range(REPEATS):
        for name, (_, right, make) in cases.items():
            start = perf_counter()
            solve = make()
            middle = perf_counter()
            solve(right)
            times[name].append((middle - start, perf_counter() - middle))
    return [
        (name, faces, median(t[0] for t in times[name]), median(t[1] for t in times[name]))
        for name, (faces, _, _) in cases.items()
    ]


def _inner(A: Any, fixed: IntArray) -> sp.csc_matrix:
    free = np.setdiff1d(np.arange(A.shape[0]), fixed)
    return sp.csc_matrix(-A.tocsr()[free][:, free])


# --- uniform areas -------------------------------------------------------------------------------


def sphere_errors() -> list[tuple[str, int, float, float]]:
    """Eigenvalues of a sphere, crowded on one side and remeshed, against l (l + 1)."""
    V, F = _crowded_sphere()
    rows = []
    degree = np.repeat(np.arange(1, 5), 2 * np.arange(1, 5) + 1)[:N_EIGENVALUES]
    meshes = {"sphere, crowded on one side": (V, F)}
    for L in (0.16, 0.08, 0.04):
        meshes[f"the same, remeshed, L={L}"] = tuple(remesh(V, F, L))
    for name, (W, G) in meshes.items():
        errors = [
            float(
                np.abs(eigenvalues(W, G, area)[: len(degree)] / (degree * (degree + 1)) - 1).max()
            )
            for area in ("voronoi", "uniform")
        ]
        rows.append((name, len(G), *errors))
    return rows


def sample_errors(name: str) -> list[tuple[str, int, float, float]]:
    """How far uniform areas are from Voronoi areas, before and after; there is no exact answer."""
    sample = load(name)
    V, F = _usable(sample.V, sample.F)
    rows = []
    for label, (W, G) in ((name, (V, F)), (f"{name}, remeshed", remesh(V, F, n_vertices=len(V)))):
        voronoi, uniform = (eigenvalues(W, G, area) for area in ("voronoi", "uniform"))
        rows.append((label, len(G), float("nan"), float(np.abs(uniform / voronoi - 1).max())))
    return rows


def eigenvalues(V: FloatArray, F: IntArray, area: Any) -> FloatArray:
    """First eigenvalues of ``-M^-1 C`` that are not 0, in order."""
    C, areas = cotangent_matrix(V, F), vertex_areas(V, F, area)
    parts = connected_components(C, directed=False)[0]
    # One of them, or libigl's areas of rounding errors, would make M singular.
    M = sp.diags_array(np.maximum(areas, 1e-12 * areas.mean()))
    shift = -1.0 / areas.sum()
    found = eigsh(
        sp.csc_matrix(-C), N_EIGENVALUES + 4 + parts, sp.csc_matrix(M), sigma=shift,
        v0=np.ones(len(V)), return_eigenvectors=False,
    )  # fmt: skip
    return np.sort(found)[parts:]


def _crowded_sphere() -> tuple[FloatArray, IntArray]:
    import igl

    V, F = igl.icosahedron()
    for _ in range(5):
        V, F = igl.upsample(V, F)
        V /= np.linalg.norm(V, axis=1, keepdims=True)
    V = V + np.array([0.6, 0.0, 0.0])
    return V / np.linalg.norm(V, axis=1, keepdims=True), F


# --- output --------------------------------------------------------------------------------------


def _seconds(call: Callable[[], Any]) -> float:
    times = []
    for _ in range(REPEATS):
        start = perf_counter()
        call()
        times.append(perf_counter() - start)
    return median(times)


def _page(
    inverted: list[Inverted],
    solvers: list[tuple[str, int, float, float]],
    errors: list[tuple[str, int, float, float]],
) -> str:
    return page(
        "Laplacians",
        machine_line(machine(("scipy",))),
        "## Inverting the Laplacian",
        "The report's experiment: solve with the Laplacian for as many right-hand sides as there are "
        "vertices. The original is solved with its Voronoi areas, which make the Laplacian unsymmetric, "
        "and SuperLU. The remeshed surface has as many vertices; it is solved with the same area for all "
        "and a sparse Cholesky factorisation, libigl's or CHOLMOD. For comparison, the original is also "
        "solved as `C x = M b`, which is symmetric without remeshing. One vertex per component is fixed. "
        f"Medians of {REPEATS}; totals are the factor and n / {BLOCK} blocks of {BLOCK} columns.",
        table(
            [
                "mesh",
                "way",
                "vertices",
                "E Voronoi %",
                "factor ms",
                "ms per vertex",
                "total s",
                "the report's total s",
            ],
            [_inverted_row(entry) for entry in inverted],
            text_columns=2,
        ),
        "![Seconds for all right-hand sides](plots/laplacians.png)",
        "## Solvers",
        f"Three right-hand sides, interleaved, medians of {REPEATS}. `LaplacianSolver` also checks and "
        "slices the matrix, and solves once to verify the factor. The original is "
        f"{made(9)} of [the benchmarks](benchmarks.md).",
        table(
            ["", "faces", "factor s", "solve ms"],
            [
                [name, f"{faces:,}", f"{factor:.3f}", f"{1e3 * solve:.1f}"]
                for name, faces, factor, solve in solvers
            ],
        ),
        "## The error of uniform areas",
        f"Largest relative error of the first {N_EIGENVALUES} to {N_EIGENVALUES + 4} eigenvalues that "
        "are not 0: for the sphere against l (l + 1); for other meshes, whose exact eigenvalues are "
        "unknown, between uniform and Voronoi areas.",
        table(
            ["mesh", "faces", "Voronoi areas %", "uniform areas %"],
            [
                [
                    name,
                    f"{faces:,}",
                    "" if np.isnan(one) else f"{100 * one:.2f}",
                    f"{100 * two:.2f}",
                ]
                for name, faces, one, two in errors
            ],
        ),
    )


def _inverted_row(entry: Inverted) -> list[str]:
    told = REPORT.get(entry.mesh)
    theirs = {"original, LU": 0, "remeshed, Cholesky": 1}.get(entry.way)
    return [
        entry.mesh,
        entry.way,
        f"{entry.n:,}",
        f"{100 * entry.area_error:.1f}",
        f"{1e3 * entry.factor:.1f}",
        f"{1e3 * entry.block / BLOCK:.3f}",
        f"{entry.total:.2f}",
        "" if told is None or theirs is None else f"{told[theirs]:g}",
    ]


def _plot(path: Path, inverted: list[Inverted]) -> None:
    if find_spec("matplotlib") is None:
        print("matplotlib is not installed: no plot", file=sys.stderr)
        return
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7.6, 4.2), layout="constrained")
    names = list(dict.fromkeys(entry.mesh for entry in inverted))
    ways = list(dict.fromkeys(entry.way for entry in inverted))
    for i, (way, colour) in enumerate(zip(ways, COLOURS, strict=False)):
        heights = [entry.total for entry in inverted if entry.way == way]
        places = np.arange(len(names)) + 0.8 * ((i + 0.5) / len(ways) - 0.5)
        bars = axes.bar(places, heights, 0.75 / len(ways), label=way, color=colour)
        axes.bar_label(bars, fmt="%.1f", fontsize=7)
    axes.set_xticks(range(len(names)), names)
    axes.set_ylabel("seconds")
    axes.set_title("Solving with the Laplacian for n right-hand sides")
    axes.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130, metadata={"Software": None})
    pyplot.close(figure)


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.laplacians", description=__doc__)
    there = [name for name in SAMPLES if find_file(name)] or ["creature", "pretzel"]
    parser.add_argument("--meshes", nargs="+", default=there)
    parser.add_argument("--output", type=Path, default=DOCS)
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
