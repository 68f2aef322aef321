"""Changes between two minimisations: remesh the surface, cut its necks, drop its crumbs."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import FloatArray, IntArray
from ..mesh.edges import count_edges, edge_keys
from ..pipeline.remesh import remesh
from .energies import volumes
from .necks import cut_necks
from .problem import CapillaryProblem, with_surface
from .steps import with_restored_volumes

__all__ = ["remeshed", "with_cut_necks", "without_crumbs", "without_parts"]

# A component without wires and with less volume than this many cubed edge lengths is dropped.
_CRUMB = 0.5


def remeshed(
    problem: CapillaryProblem, L: float, split: float, collapse: float
) -> CapillaryProblem:
    """Remesh all but the wires, and restore the volumes before anything else."""
    result = remesh(
        problem.V,
        problem.F,
        _graded(problem, L),
        preset="fast",
        iterations=2,
        split=split,
        collapse=collapse,
        feature_angle=None,
        feature_edges=_inner_wires(problem),
        fixed_vertices=np.flatnonzero(problem.fixed),
        boundary="fixed",
        face_labels=problem.body,
    )
    fixed = np.zeros(len(result.V), np.bool_)
    mapped = result.vertex_map
    fixed[mapped[problem.fixed & (mapped >= 0)]] = True
    return with_restored_volumes(
        with_surface(
            problem,
            result.V,
            result.F,
            fixed=fixed,
            fixed_edges=mapped[problem.fixed_edges],
            body=result.face_labels,
        )
    )


def _graded(problem: CapillaryProblem, L: float) -> float | FloatArray:
    """Target lengths: L, but at wires the lengths of their edges, so that wires need not be split."""
    edges = problem.fixed_edges
    if not len(edges):
        return L
    size = np.linalg.norm(problem.V[edges[:, 0]] - problem.V[edges[:, 1]], axis=1)
    lengths = np.full(len(problem.V), float(L))
    lengths[edges.ravel()] = 0.0
    np.maximum.at(lengths, edges.ravel(), np.repeat(size, 2))
    return np.minimum(lengths, L) if (size <= 1.2 * L).all() else lengths


def _inner_wires(problem: CapillaryProblem) -> IntArray | None:
    """Wires with faces on both sides."""
    if not len(problem.fixed_edges):
        return None
    n = len(problem.V)
    edges, uses = count_edges(problem.F)
    wires = np.sort(problem.fixed_edges, axis=1)
    is_inner = np.isin(edge_keys(wires.T, n), edge_keys(edges[uses > 1].T, n))
    return wires[is_inner] if is_inner.any() else None


def with_cut_necks(problem: CapillaryProblem, L: float) -> tuple[CapillaryProblem, int]:
    """Cut necks of three edges, and those of four with a perimeter up to 2 L; also counts them."""
    found = cut_necks(problem.V, problem.F, problem.fixed, perimeter=2.0 * L)
    if not found.n_cuts:
        return problem, 0
    caps = np.zeros(len(found.F) - len(problem.F), np.int64)
    body = np.append(problem.body, caps)
    fixed = problem.fixed[found.source]
    return with_surface(problem, found.V, found.F, fixed=fixed, body=body), found.n_cuts


def without_crumbs(problem: CapillaryProblem, L: float) -> CapillaryProblem:
    """Drop small components without wires; returns the problem itself if there are none."""
    _, part = problem.components()
    held = np.unique(part[problem.fixed[problem.F].any(axis=1)])
    size = np.abs(np.bincount(part, volumes(problem.V[problem.F])))
    is_crumb = (size < _CRUMB * L**3) | (len(problem.targets) == 0)
    is_crumb[held] = False
    if not is_crumb.any():
        return problem
    kept = ~is_crumb[part]
    return with_surface(problem, problem.V, problem.F[kept], body=problem.body[kept])


def without_parts(problem: CapillaryProblem, names: IntArray) -> CapillaryProblem | None:
    """Drop components, and their volumes with them; None if a wire holds one, or nothing were left."""
    count, part = problem.components()
    goes = np.isin(part, names)
    if len(names) == count or problem.fixed[problem.F[goes]].any():
        return None
    kept, body, targets = problem.F[~goes], problem.body[~goes], problem.targets
    if len(targets):
        gone = np.bincount(problem.body[goes], volumes(problem.V[problem.F[goes]]), len(targets))
        bodies, body = np.unique(body, return_inverse=True)
        targets = (targets - gone)[bodies]
    return with_surface(problem, problem.V, kept, body=body, targets=targets)
