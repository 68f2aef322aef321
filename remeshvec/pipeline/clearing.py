"""What the sweeps start from, and the same with shorter edges where sheets are near."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..core.vocabulary import BoolArray, FloatArray, Mesh
from ..input.constraints import ConstraintMasks
from ..reference.build import FeaturedReference
from ..reference.clearance import clearance_lengths

__all__ = ["Start", "clear"]

# Where sheets are near, lengths fall to this share of what was asked for at most (64 times the faces);
# creases are sought down to a smaller one.
_LEAST_LENGTH = 1.0 / 8.0
_LEAST_SCALE = 1.0 / 64.0


class Start(NamedTuple):
    """What the sweeps start from."""

    mesh: Mesh  # with its lengths and features; sweeps work on copies
    featured: FeaturedReference
    marks: ConstraintMasks
    clearance: dict[str, float] | None = None  # what was done where sheets are near, see `Report`


def clear(
    start: Start,
    gap: FloatArray,
    share: float,
    limit: Callable[[Mesh, FloatArray], FloatArray],
    build: Callable[[Mesh, ConstraintMasks], FeaturedReference],
) -> Start | None:
    """Shorten lengths where sheets are near; None where they need not be.

    Creases are sought again at the scale that the place needs: those of a rod thinner than the lengths
    do not stand out at their scale. Between them the rod may be flat, and needs no shorter edges.

    Parameters
    ----------
    start : Start
        With the lengths asked for in the reference; unchanged.
    gap : (m,) float64
        See `find_gaps`.
    share : float
        Of the gap, that chords may take.
    limit : callable
        Bounds the growth of lengths over a mesh.
    build : callable
        Marks the features of a mesh that has its lengths, and builds the reference.
    """
    asked = start.featured.reference.X[:, 3]
    mesh, featured, marks = start.mesh.copy(), start.featured, start.marks
    for least in (_LEAST_SCALE, _LEAST_LENGTH):
        longest = clearance_lengths(mesh, _is_feature(featured), gap, share)
        lengths = np.minimum(asked, np.maximum(longest, least * asked))
        mesh.X[:, 3] = limit(mesh, lengths)
        featured = build(mesh, marks)
        marks = marks._replace(hard=marks.hard | _is_feature(featured))
    is_shorter = lengths < asked
    n_new = len(featured.names) - len(start.featured.names)
    if not is_shorter.any() and n_new <= 0:
        return None
    clearance = {
        "vertices": int(is_shorter.sum()),
        "shortest": float((lengths / asked).min()),
        "new_crease_edges": n_new,
    }
    return Start(mesh, featured, marks, clearance)


def _is_feature(featured: FeaturedReference) -> BoolArray:
    """Tell which half-edges of the reference are on features."""
    is_feature = np.zeros(len(featured.reference.origin), np.bool_)
    is_feature[featured.features] = True
    return is_feature
