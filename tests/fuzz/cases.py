"""A case: a mesh, a length and options, all from one number; and how to make it smaller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator

from data.shapes.perturb import mean_edge

from .shapes import KINDS, distorted, log_uniform, size

# Lengths are chosen so that neither the area nor the edges alone ask for more faces than this.
MOST_FACES = 20_000

PER_FACE = ("fixed_faces", "face_labels", "selection", "preserve")


@dataclass(frozen=True)
class Case:
    """Arguments of one call. Options per face are masks or arrays of one row per face."""

    number: int
    kind: str
    V: np.ndarray
    F: np.ndarray
    L: Any  # None, number, array, or ("adaptive", tolerance)
    options: dict[str, Any]
    threads: bool  # compare one thread with two, in small blocks

    def __str__(self) -> str:
        options = ", ".join(f"{name}={_shown(value)}" for name, value in self.options.items())
        return (
            f"{self.kind}, {len(self.V)} vertices, {len(self.F)} faces, L={_shown(self.L)}, "
            f"{options or 'no options'}{'; on two threads too' if self.threads else ''}"
        )


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        if value.dtype == bool:
            return f"{int(value.sum())} of {len(value)}"
        return f"array{value.shape}"
    return f"{value:.6g}" if isinstance(value, float) else repr(value)


def make_case(number: int) -> Case:
    """Make the case with this number."""
    rng = np.random.default_rng(number)
    kind = list(KINDS)[rng.integers(len(KINDS))]
    V, F = distorted(rng, *KINDS[kind](rng))
    options = _options(rng, V, F)
    L = None if {"n_faces", "n_vertices"} & options.keys() else _length(rng, V, F)
    return Case(number, kind, V, F, L, options, bool(rng.random() < 0.3))


def edge_sum(V: np.ndarray, F: np.ndarray) -> float:
    return float(np.linalg.norm(V[F] - V[F[:, [1, 2, 0]]], axis=2).sum())


def area_of(V: np.ndarray, F: np.ndarray) -> float:
    size = max(float(np.ptp(V, axis=0).max()), 1e-300)
    W = (V - V[F[0, 0]]) / size
    normals = np.cross(W[F[:, 1]] - W[F[:, 0]], W[F[:, 2]] - W[F[:, 0]])
    return 0.5 * size * size * float(np.linalg.norm(normals, axis=1).sum())


def expected_faces(V: np.ndarray, F: np.ndarray, L: float) -> float:
    """Faces that the area needs, and those that edges need where no face is as wide as L."""
    return area_of(V, F) / L / (0.433 * L) + edge_sum(V, F) / L


def _length(rng: Generator, V: np.ndarray, F: np.ndarray) -> Any:
    base = mean_edge(V, F)
    if not base > 0:
        return 1.0
    L = base * log_uniform(rng, 0.15, 6)
    while expected_faces(V, F, L) > MOST_FACES:
        L *= 1.3
    way = rng.random()
    if way < 0.15:
        return None if expected_faces(V, F, 0.9 * base) < MOST_FACES else L
    if way < 0.3:  # an array that jumps from vertex to vertex
        return L * np.exp(np.abs(rng.normal(size=len(V))) * rng.choice([0.3, 1.0, 2.0]))
    if way < 0.4:  # one that varies slowly
        x = (V[:, 0] - V[:, 0].min()) / max(np.ptp(V[:, 0]), 1e-300)
        return L * (1.5 + 0.5 * np.sin(6 * x))
    if way < 0.47 and len(F) < 1500:
        return ("adaptive", 0.1 * L)
    return L


def _options(rng: Generator, V: np.ndarray, F: np.ndarray) -> dict[str, Any]:
    m, n = len(F), len(V)
    maybe: dict[str, tuple[float, Callable[[], Any]]] = {
        "preset": (0.6, lambda: str(rng.choice(["fast", "fine", "even"]))),
        "n_faces": (0.04, lambda: size(rng, 4, 3000)),
        "n_vertices": (0.02, lambda: size(rng, 4, 1500)),
        "gradation": (0.1, lambda: float(rng.uniform(1.05, 3))),
        "max_deviation": (0.06, lambda: mean_edge(V, F) * log_uniform(rng, 0.02, 1)),
        "clearance": (0.1, lambda: [None, float(rng.uniform(0.05, 1))][rng.integers(2)]),
        "feature_angle": (0.4, lambda: [None, float(rng.uniform(10, 120))][rng.integers(2)]),
        "boundary": (0.4, lambda: str(rng.choice(["split", "fixed"]))),
        "feature_edges": (0.1, lambda: _some_edges(rng, F)),
        "fixed_vertices": (0.15, lambda: rng.integers(n, size=size(rng, 1, n))),
        "fixed_faces": (0.15, lambda: rng.random(m) < rng.choice([0.02, 0.3, 0.9])),
        "face_labels": (0.1, lambda: rng.integers(3, size=m)),
        "preserve": (0.05, lambda: rng.random((m, 3, 2)).round(rng.integers(3))),
        "selection": (0.1, lambda: _near_one(rng, V, F)),
        "iterations": (0.15, lambda: int(rng.integers(1, 25))),
        "tol": (0.1, lambda: log_uniform(rng, 1e-4, 0.1)),
        "sliver_check": (0.15, lambda: True),
        "foldover": (0.05, lambda: float(rng.uniform(1, 89))),
        "untangle_angle": (0.05, lambda: float(rng.uniform(5, 60))),
        "fit": (0.1, lambda: bool(rng.integers(2))),
        "project": (0.05, lambda: False),
    }
    options = {name: make() for name, (chance, make) in maybe.items() if rng.random() < chance}
    if "n_faces" in options:
        options.pop("n_vertices", None)
    return {name: value for name, value in options.items() if not _is_empty(value)}


def _is_empty(value: Any) -> bool:
    return isinstance(value, np.ndarray) and (
        value.size == 0 or not (value.dtype != bool or value.any())
    )


def _some_edges(rng: Generator, F: np.ndarray) -> np.ndarray:
    good = F[(np.roll(F, 1, axis=1) != F).all(axis=1)]
    return good[rng.random(len(good)) < rng.choice([0.02, 0.3])][:, :2]


def _near_one(rng: Generator, V: np.ndarray, F: np.ndarray) -> np.ndarray:
    middle = V[F].mean(axis=1)
    away = np.linalg.norm(middle - middle[rng.integers(len(F))], axis=1)
    return away <= np.quantile(away, rng.uniform(0.1, 0.9))


# --- smaller ones ---------------------------------------------------------------------------------


def with_faces(case: Case, chosen: np.ndarray) -> Case:
    """Keep some of the faces, with what belongs to them."""
    options = dict(case.options)
    for name in PER_FACE:
        if name in options:
            options[name] = options[name][chosen]
    F = case.F[chosen]
    if "feature_edges" in options:
        ends = np.sort(np.vstack([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1)
        known = {tuple(edge) for edge in ends.tolist()}
        edges = options["feature_edges"]
        is_known = [tuple(edge) in known for edge in np.sort(edges, axis=1).tolist()]
        options["feature_edges"] = edges[np.array(is_known, dtype=bool)]
    return replace(case, F=F, options=options)


def shrunk(case: Case, still_fails: Callable[[Case], bool]) -> Case:
    """Leave out options, then faces, as long as the case fails in the same way."""
    for name in list(case.options):
        fewer = {key: value for key, value in case.options.items() if key != name}
        smaller = replace(case, options=fewer)
        if still_fails(smaller):
            case = smaller
    step = len(case.F) // 2
    while step >= 1:
        start = 0
        while start < len(case.F) and len(case.F) > 1:
            chosen = np.ones(len(case.F), bool)
            chosen[start : start + step] = False
            if chosen.any() and still_fails(smaller := with_faces(case, chosen)):
                case = smaller
            else:
                start += step
        step //= 2
    return case
