"""Dirt in the input: find and mend faces and vertices that a manifold mesh cannot have."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import FloatArray, IndexArray
from .edges import components, edge_keys, halfedge_ends

__all__ = [
    "count_used",
    "drop_degenerate_faces",
    "drop_duplicate_faces",
    "weld_points",
    "weld_vertices",
]

Indices = NDArray[np.intp]

# Weights of y and z in the sums that tell points apart.
_WEIGHTS = 0.7320508075688772, 0.23606797749978969


def count_used(F: IndexArray, n: int) -> int:
    """Count how many of ``n`` vertices are used by a face."""
    used = np.zeros(n, np.bool_)
    used[F.ravel()] = True
    return int(np.count_nonzero(used))


def drop_degenerate_faces(F: IndexArray) -> Indices | None:
    """Return the faces with three different corners; None if all have them."""
    bad = (F[:, 0] == F[:, 1]) | (F[:, 1] == F[:, 2]) | (F[:, 2] == F[:, 0])
    return np.flatnonzero(~bad) if bad.any() else None


def drop_duplicate_faces(F: IndexArray, candidates: NDArray[Any] | None = None) -> Indices | None:
    """Return the faces that are left of those with the same corners; None if all differ.

    The first one of the winding that prevails stays. Where as many face either way, all go if they
    hang on a surface that is whole without them, as a fin without volume does. Elsewhere the surface is
    modelled on both sides, and one side stays. Only ``candidates`` (all by default) may be duplicates.
    """
    among = np.arange(len(F)) if candidates is None else np.sort(candidates)
    corners = np.sort(F[among], axis=1)
    order = np.lexsort(corners.T)
    is_new = np.ones(len(order), np.bool_)
    is_new[1:] = (corners[order[1:]] != corners[order[:-1]]).any(axis=1)
    if is_new.all():
        return None
    group = np.empty(len(order), np.int64)
    group[order] = np.cumsum(is_new) - 1
    winding = _windings(F[among])
    balance = np.bincount(group, winding)
    size = np.bincount(group)
    # The first face of the winding that prevails, or of both.
    prevails = balance[group] * winding >= 0
    first = np.full(len(size), len(among))
    np.minimum.at(first, group[prevails], np.flatnonzero(prevails))
    kept = np.ones(len(F), np.bool_)
    kept[among[size[group] > 1]] = False
    kept[among[first]] = True
    doubled = among[first[(size > 1) & (balance == 0)]]
    kept[_fins(F, kept, doubled)] = False
    return np.flatnonzero(kept)


def _windings(F: IndexArray) -> NDArray[np.int64]:
    """Return 1 for faces whose corners ascend cyclically, -1 for the others."""
    a, b, c = F.T
    return np.where((a < b) ^ (b < c) ^ (c < a), -1, 1)


def _fins(F: IndexArray, kept: NDArray[np.bool_], doubled: Indices) -> Indices:
    """Those of the doubled faces whose parts hang on edges that have two single faces without them.

    Where more of the edges around a part have one single face, the part fills a hole.
    """
    if not len(doubled):
        return doubled
    single = kept.copy()
    single[doubled] = False
    n = int(F.max()) + 1
    edges, place = np.unique(edge_keys(halfedge_ends(F[doubled]), n), return_inverse=True)
    face = np.arange(len(doubled)).repeat(3)
    count, label = components(len(doubled) + len(edges), face, len(doubled) + place.reshape(-1))
    others = edge_keys(halfedge_ends(F[single]), n)
    others = others[np.isin(others, edges)]
    uses = np.bincount(np.searchsorted(edges, others), minlength=len(edges))
    part = label[len(doubled) :]
    whole = np.bincount(part, (uses > 0) & (uses % 2 == 0), count)
    open_ = np.bincount(part, uses % 2, count)
    return doubled[(whole > open_)[label[: len(doubled)]]]


def weld_vertices(V: FloatArray, candidates: NDArray[Any]) -> IndexArray | None:
    """Map candidates with the same coordinates to the first of them; None if all differ.

    Returns
    -------
    (n,) int32
        New index of every vertex.
    """
    return weld_points(V[candidates], candidates, len(V))


def weld_points(points: FloatArray, candidates: NDArray[Any], n: int) -> IndexArray | None:
    """Weld candidates among ``n`` vertices by their coordinates (k, 3), as `weld_vertices` does."""
    # One number per point sorts 5 times faster than three, and few different points have the same one.
    x, y, z = points.T
    sums = x + _WEIGHTS[0] * y + _WEIGHTS[1] * z
    order = np.argsort(sums)
    tied = sums[order[1:]] == sums[order[:-1]]
    if not tied.any():
        return None
    same = tied & (points[order[1:]] == points[order[:-1]]).all(axis=1)
    if not np.array_equal(same, tied):
        order = np.lexsort((x, y, z))
        same = (points[order[1:]] == points[order[:-1]]).all(axis=1)
    if not same.any():
        return None
    starts = np.flatnonzero(np.append(True, ~same))
    first = np.minimum.reduceat(order, starts)
    target = np.arange(n, dtype=np.int32)
    target[candidates[order]] = candidates[np.repeat(first, np.diff(starts, append=len(order)))]
    return target
