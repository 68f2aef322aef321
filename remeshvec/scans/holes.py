"""Boundary loops of a manifold surface, and the faces that close them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.vocabulary import FloatArray, IntArray
from ..mesh.edges import edge_keys, halfedge_ends
from ..mesh.singles import single_halfedges
from .triangulate import triangulate

__all__ = ["Filled", "fill_loops"]

# Time grows with the third power of the length of a loop, memory with the second; longer ones are cut.
_LONGEST = 300


class Filled(NamedTuple):
    """Faces that close loops."""

    F: IntArray  # (k, 3)
    closed: int  # loops that are closed
    left: int  # loops that are not


def fill_loops(V: FloatArray, F: IntArray, longest: int) -> Filled:
    """Close the boundary loops of up to so many edges; faces are oriented as their neighbours are.

    Loops stay open where every choice of faces would have an edge that exists already.
    """
    rims = _boundary_loops(F, len(V))
    normals = _unit_normals(V, F)
    taken = _chords(F, rims, len(V))
    new, closed = [np.empty((0, 3), np.int64)], 0
    for k, halfedges in enumerate(rims):
        loop = F.ravel()[halfedges]
        if len(loop) > longest or len(np.unique(halfedges // 3)) == 1:  # a face alone
            continue
        faces = _close(V[loop], normals[halfedges // 3], taken[k])
        if faces is not None:
            new.append(loop[faces])
            closed += 1
    return Filled(np.concatenate(new), closed, len(rims) - closed)


def _boundary_loops(F: IntArray, n: int) -> list[IntArray]:
    """Half-edges without twin, one array per loop, each from its smallest half-edge on."""
    start, end = halfedge_ends(F)
    alone = single_halfedges(F, n)
    leaving = np.full(n, -1, np.int64)
    leaving[start[alone]] = alone
    seen = np.zeros(F.size, np.bool_)
    loops = []
    for first in alone.tolist():
        if seen[first]:
            continue
        loop, h = [], first
        while h >= 0 and not seen[h]:
            seen[h] = True
            loop.append(h)
            h = int(leaving[end[h]])
        if h == first:
            loops.append(np.array(loop))
    return loops


def _chords(F: IntArray, rims: list[IntArray], n: int) -> list[IntArray]:
    """Edges (k, 2) between vertices of the same loop, as places in it, one array per loop."""
    loop_of, place = np.full(n, -1, np.int64), np.zeros(n, np.int64)
    for k, halfedges in enumerate(rims):
        loop = F.ravel()[halfedges]
        loop_of[loop], place[loop] = k, np.arange(len(loop))
    ends = halfedge_ends(F)
    ends = ends[:, (loop_of[ends[0]] >= 0) & (loop_of[ends[0]] == loop_of[ends[1]])]
    of = loop_of[ends[0]]
    order = np.argsort(of, kind="stable")
    cuts = np.searchsorted(of[order], np.arange(1, len(rims)))
    return np.split(place[ends[:, order]].T, cuts)


def _close(P: FloatArray, outer: FloatArray, taken: IntArray) -> IntArray | None:
    """Triangulate a loop; a long one as a loop of chords, and the pieces that these cut off."""
    n = len(P)
    if n <= _LONGEST:
        return _close_among(np.arange(n), P, outer, taken)
    step = -(-n // (_LONGEST // 2))
    ends = np.append(np.arange(0, n, step), n)
    corners, after = ends[:-1], ends[1:] % n
    is_chord = np.diff(ends) > 1
    chords = edge_keys(np.stack([corners, after])[:, is_chord], n)
    if np.isin(chords, edge_keys(taken.T, n)).any():
        return None
    # A chord bends with faces that are not there yet: nothing is known about their normals.
    unknown = np.where(is_chord[:, None], 0.0, outer[corners])
    parts = [_close_among(corners, P, unknown, taken)]
    for a, b in zip(ends[:-1][is_chord], ends[1:][is_chord], strict=True):
        piece = np.arange(a, b + 1) % n
        known = np.vstack([outer[piece[:-1]], np.zeros(3)])
        parts.append(_close_among(piece, P, known, taken))
    found = [part for part in parts if part is not None]
    return np.concatenate(found) if len(found) == len(parts) else None


def _close_among(
    places: IntArray, P: FloatArray, outer: FloatArray, taken: IntArray
) -> IntArray | None:
    """Triangulate the loop of some of the points; returns faces among all points."""
    number = np.full(len(P), -1, np.int64)
    number[places] = np.arange(len(places))
    chords = number[taken]
    chords = chords[(chords >= 0).all(axis=1)]
    table = np.zeros((len(places), len(places)), np.bool_)
    table[chords[:, 0], chords[:, 1]] = table[chords[:, 1], chords[:, 0]] = True
    faces = triangulate(P[places], outer, table)
    return None if faces is None else places[faces]


def _unit_normals(V: FloatArray, F: IntArray) -> FloatArray:
    a, b, c = (V[F[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None])
