"""Adaptive lengths, corrected by the faces that they led to."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import FIXED
from .deviation import shortened_lengths
from .work import Work

__all__ = ["correct_lengths"]


def correct_lengths(work: Work) -> None:
    """Shorten target lengths where faces made for them lie too far from the input.

    Nothing happens where lengths do not follow from the curvature.
    """
    adaptation = work.plan.adaptation
    if adaptation is None:
        return
    work.compact()
    mesh, featured = work.mesh, work.featured
    with work.monitor.watch.time("deviation"):
        lengths = shortened_lengths(mesh, featured, adaptation.tolerance, work.is_parallel)
        X = featured.reference.X
        old = X[:, 3].copy()
        X[:, 3] = adaptation.limit(np.maximum(lengths, np.minimum(old, adaptation.shortest)))
        # Fixed vertices keep their length, which may be that of an edge that must not be split.
        v = np.flatnonzero(mesh.kind == FIXED)
        at = featured.reference.origin[mesh.birth[v]]
        mesh.X[v, 3] = np.where(mesh.X[v, 3] == old[at], X[at, 3], mesh.X[v, 3])
