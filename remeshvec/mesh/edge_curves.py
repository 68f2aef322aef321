"""Readers of ``Mesh.curve``, the number on a half-edge that tells which curve its edge lies on.

An edge off all feature curves has ``NONE``. A number from 0 up is the name of a curve: a half-edge of the
reference on it. A non-manifold edge, where three or more faces meet, or two that run it in the same
direction, has `NON_MANIFOLD` added to its name. `FROZEN` and `HALTED` edges are locked: never split,
collapsed or flipped.

Each reader takes one number, in kernels, or an array of numbers.
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
    """Return the name of the curve of an edge that has one (`is_named`): a half-edge of the reference."""
    return curve & (NON_MANIFOLD - 1)
