"""Consistent winding: neighbouring faces run their common edge in opposite directions.

The usual walk over the surface (for example ``bfs_orient`` of libigl), with two rules of its own: only
edges that exactly two faces share are crossed, and in each component the majority keeps its winding.
Volume decides nothing: a closed part whose faces point inwards stays so.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import kernel
from ..core.vocabulary import NONE, BoolArray, IndexArray
from .twins import match_halfedges

__all__ = ["orient_faces"]

_UNSEEN = -1


def orient_faces(F: IndexArray, n: int) -> tuple[IndexArray, BoolArray]:
    """Give faces that share an edge with nobody else the same winding.

    In each component (faces connected through edges of exactly two faces) the winding of most of its
    faces stays, or that of its first face where there are as many of both. Edges of three faces and
    more impose nothing.

    A component without orientation, like a Möbius strip, is oriented along a breadth-first tree from
    its first face. The edges that remain inconsistent are those where the two ways around meet: on a
    Möbius strip one line, across the strip or once around it. Which ones they are does not depend on
    the windings before.

    Parameters
    ----------
    F : (m, 3) int32
        Faces of three different corners, from 0 to n - 1.
    n : int
        Number of vertices.

    Returns
    -------
    F : (m, 3) int32
        The faces with corners 1 and 2 of the flipped ones swapped; F itself where none is flipped.
    flipped : (m,) bool
        Which faces were flipped.
    """
    corners = np.ascontiguousarray(F).reshape(-1)
    pairs = match_halfedges(corners, n, False, by_winding=False)
    turned = np.zeros(len(F), np.int8)
    if pairs.found.inconsistent_edges:
        _turn_faces(corners, pairs.twin, turned)
    flipped = turned == 1
    if not flipped.any():
        return F, flipped
    F = F.copy()
    F[flipped] = F[flipped][:, [0, 2, 1]]
    return F, flipped


@kernel
def _turn_faces(corners, mate, turned):
    """Mark the faces to flip: as a breadth-first tree says, then all others if these are fewer."""
    n_faces = turned.size
    turned[:] = _UNSEEN
    queue = np.empty(n_faces, np.int32)
    end = 0
    for first in range(n_faces):
        if turned[first] != _UNSEEN:
            continue
        start = end
        head = start
        queue[end] = first
        end += 1
        turned[first] = 0
        count = 0
        while head < end:
            f = np.int64(queue[head])
            head += 1
            count += np.int64(turned[f])
            # Around the face from corner 0 towards the smaller of the others: an order that a flip
            # does not change, so that the tree of a component is the same for all its windings.
            backwards = corners[3 * f + 1] > corners[3 * f + 2]
            for k in range(3):
                h = 3 * f + (2 - k if backwards else k)
                g = mate[h]
                if g == NONE or turned[g // 3] != _UNSEEN:
                    continue
                turned[g // 3] = turned[f] ^ (corners[g] == corners[h])
                queue[end] = g // 3
                end += 1
        if 2 * count > end - start:
            for k in range(start, end):
                turned[queue[k]] ^= 1
