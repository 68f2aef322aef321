"""Readers of ``Mesh.curve``: what the number on a half-edge says of its edge.

``NONE`` is an edge off all feature curves. A number from 0 up names a half-edge of the reference on the
same curve; `NON_MANIFOLD` is added to it where more sheets than two, or two of the same direction, meet.
`FROZEN` and `HALTED` edges are locked: never split, collapsed or flipped.

All take one number, in kernels, or an array of them.
"""

from __future__ import annotations

from ..core.compiler import shared
from ..core.vocabulary import FROZEN, NON_MANIFOLD, NONE

__all__ = ["curve_name", "is_feature", "is_locked", "is_named", "is_non_manifold"]


@shared
def is_feature(curve):
    """Tell whether an edge lies on a feature curve, or is locked."""
    return curve != NONE


@shared
def is_locked(curve):
    """Tell whether an edge must stay as it is, for good or until the end of the sweep."""
    return curve <= FROZEN


@shared
def is_named(curve):
    """Tell whether an edge names the curve that it lies on."""
    return curve >= 0


@shared
def is_non_manifold(curve):
    """Tell whether an edge has siblings on other sheets, which must do what it does."""
    return curve >= NON_MANIFOLD


@shared
def curve_name(curve):
    """Name the curve of an edge that is on one and not locked: a half-edge of the reference."""
    return curve & (NON_MANIFOLD - 1)
