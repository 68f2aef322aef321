"""Outcomes of a candidate, which are the columns of a phase's tally.

The first four numbers mean the same in collapses and flips; from there each has its own.
"""

from __future__ import annotations

__all__ = [
    "COLLAPSED",
    "FLIPPED",
    "KEPT_CURVE",
    "KEPT_DUPLICATE",
    "KEPT_FOLDOVER",
    "KEPT_LINK",
    "KEPT_NORMAL",
    "KEPT_OVERSHOOT",
    "KEPT_SLIVER",
    "NOT_OWNED",
    "NO_LONGER_WANTED",
    "N_COLLAPSE_OUTCOMES",
    "N_FLIP_OUTCOMES",
]

COLLAPSED = FLIPPED = 0  # applied
NOT_OWNED = 1  # reaches outside the block's vertex range: a later stage tries again
NO_LONGER_WANTED = 2  # earlier operations have changed the edge
KEPT_SLIVER = 3  # the worst triangle would get worse

KEPT_CURVE = 4  # a vertex would leave its curve, or two curves would merge
KEPT_LINK = 5  # the link condition fails, or a ring has too many faces
KEPT_OVERSHOOT = 6  # an edge would become too long
KEPT_FOLDOVER = 7  # a face would turn too far
N_COLLAPSE_OUTCOMES = 8

KEPT_DUPLICATE = 4  # the new edge exists already
KEPT_NORMAL = 5  # a new face would turn too far from the quad's mean normal
N_FLIP_OUTCOMES = 6
