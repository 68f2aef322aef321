"""Collapse siblings: the copies of one non-manifold edge on its several sheets.

All edges of a group collapse, or none does. They are few, and no block owns them: one thread takes them
in order, with the guards of every other collapse.
"""

from __future__ import annotations

import numpy as np

from ..core.compiler import inlined, kernel
from ..core.vocabulary import DEAD, FIXED, NONE, IndexArray, Mesh
from ..mesh.walk import next_halfedge, previous_halfedge
from .collapse import CollapseLimits, examine_edge, remove_edge
from .outcomes import COLLAPSED
from .rings import make_rings

__all__ = ["collapse_siblings"]


def collapse_siblings(
    mesh: Mesh, members: IndexArray, group: IndexArray, limits: CollapseLimits
) -> int:
    """Collapse short edges with siblings, all of a group or none; returns the number of groups.

    Parameters
    ----------
    members : (k,) int32
        Half-edges; those of a group stand together.
    group : (g + 1,) int32
        Where the groups start.
    """
    return int(_collapse_siblings(mesh, members, group, limits, make_rings()))


@kernel
def _collapse_siblings(mesh, members, group, limits, rings):
    """Ask for every group all guards of all its edges, then collapse it."""
    touched = np.full(mesh.vertex_halfedge.size, NONE, np.int32)
    everywhere = 0, mesh.vertex_halfedge.size
    done = 0
    for g in range(group.size - 1):
        agreed = True
        for i in range(group[g], group[g + 1]):
            h = members[i]
            if mesh.origin[h] == DEAD:
                agreed = False
                break
            outcome, _ = examine_edge(mesh, h, everywhere, limits, rings)
            # Where the rings of two siblings meet, on one sheet that meets itself, all stay.
            if outcome != COLLAPSED or _claim_rings(mesh, rings, touched, group[g], i):
                agreed = False
                break
        if not agreed:
            continue
        done += 1
        for i in range(group[g], group[g + 1]):
            h = members[i]
            _, place = examine_edge(mesh, h, everywhere, limits, rings)
            remove_edge(mesh, h, place, rings)
    return done


@inlined
def _claim_rings(mesh, rings, touched, first, mine):
    """Mark the vertices around an edge; tells whether a sibling has marked one of them.

    Fixed vertices do not count: where a non-manifold edge ends inside a sheet, the rings of both sides
    hold that end.
    """
    met = False
    for side in range(2):
        for i in range(rings.size[side, 0]):
            h = rings.face[side, i]
            for g in (h, next_halfedge(h), previous_halfedge(h)):
                v = mesh.origin[g]
                if mesh.kind[v] != FIXED:
                    met |= touched[v] >= first and touched[v] < mine
                    touched[v] = mine
    return met
