"""Consistent winding: neighbouring faces run their common edge in opposite directions.

A breadth-first walk over the surface, as in ``bfs_orient`` of libigl, with two additional rules: it
crosses only edges that exactly two faces share, and the majority of each component keeps its winding.
Volume plays no part: a closed component whose faces point inwards stays so.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import kernel
from ..core.vocabulary import NONE, BoolArray, IndexArray
from .twins import match_halfedges

__all__ = ["orient_faces"]

_UNSEEN = -1


def orient_faces(F: IndexArray, n: int) -> tuple[IndexArray, BoolArray]:
    """Give the same winding to the two faces of every edge that has exactly two.

    In each component (faces connected through edges of exactly two faces) most faces keep their winding;
    where there are as many of both, the first face keeps its own. Edges of three or more faces impose
    nothing.

    A component that is not orientable, like a Möbius strip, is oriented along a breadth-first tree from
    its first face. Edges remain inconsistent where the two ways around meet: on a Möbius strip along one
    line, across the strip or once around it. Which edges these are does not depend on the windings of
    the input.

    Parameters
    ----------
    F : (m, 3) int32
        Faces of three different corners, from 0 to n - 1.
    n : int
        Number of vertices.

    Returns
    -------
    F : (m, 3) int32
        The faces, with corners 1 and 2 of the flipped ones swapped; F itself if none is flipped.
    flipped : (m,) bool
        Which faces are flipped.
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
    """Mark the faces that a breadth-first tree says to flip, or all others if these are fewer."""
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
            # Around the face from corner 0 towards the smaller of the others: a flip does not change
            # this order, so the tree of a component is the same for all its windings.
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
