"""A start with shorter edges and more creases where sheets are near."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..core.vocabulary import BoolArray, FloatArray, Mesh
from ..features.dihedral import find_dihedral_angles
from ..input.constraints import ConstraintMasks
from ..reference.build import FeaturedReference
from ..reference.clearance import clearance_lengths
from ..sweeps.flaws import find_flaws
from ..sweeps.swept import Start, Swept

__all__ = ["clear", "clearance_in_words", "near_flaws"]

# Where sheets are near, lengths fall to this share of what was asked for at most: 16 times the faces.
_LEAST_LENGTH = 1.0 / 4.0

# Lengths become shorter within so many of them from a flaw. Bounding them everywhere gave three times the
# faces on a part with one place where faces crossed.
_NEAR = 2.0

# Degrees from which edges are creases there, whatever stands out at the scale of the lengths.
_SHARP = 40.0


def clear(
    start: Start,
    share: float,
    near: BoolArray | None,
    finds_creases: bool,
    limit: Callable[[Mesh, FloatArray], FloatArray],
    build: Callable[[Mesh, ConstraintMasks], FeaturedReference],
) -> Start | None:
    """Shorten lengths where sheets are near; None where nothing changes.

    On a rod thinner than the lengths no edge stands out at their scale. So edges that turn sharply there
    become creases; between them the rod may be flat, and then needs no shorter edges.

    Parameters
    ----------
    start : Start
        With the lengths asked for in the reference; unchanged.
    share : float
        Of the gap, that chords may take.
    near : (n,) bool, optional
        Where lengths may become shorter; everywhere by default.
    finds_creases : bool
        Whether edges may become creases.
    limit : callable
        Bounds the growth of lengths over a mesh.
    build : callable
        Marks the features of a mesh that has its lengths, and builds the reference.
    """
    gap = start.gap
    assert gap is not None
    asked = start.featured.reference.X[:, 3]
    mesh = start.mesh.copy()
    is_feature = np.zeros(len(mesh.origin), np.bool_)
    is_feature[start.featured.features] = True
    n_creases = int(is_feature.sum())
    if finds_creases:
        is_feature |= _sharp_edges(start, gap)
    bound = clearance_lengths(mesh, is_feature, gap, share)
    lengths = np.minimum(asked, np.maximum(bound, _LEAST_LENGTH * asked))
    if near is not None:
        lengths[~near] = asked[~near]
    is_shorter = lengths < asked
    n_new = int(is_feature.sum()) - n_creases
    if not (is_shorter.any() or n_new):
        return None
    mesh.X[:, 3] = limit(mesh, lengths)
    assert start.marks is not None
    marks = start.marks._replace(hard=start.marks.hard | is_feature)
    featured = build(mesh, marks)
    clearance = {
        "vertices": int(is_shorter.sum()),
        "shortest": float((lengths / asked).min()),
        "new_crease_edges": n_new // 2,
    }
    return Start(mesh, featured, marks, gap, clearance)


def near_flaws(swept: Swept, parallel: bool) -> BoolArray:
    """Tell which vertices of the input are near new flaws, or corners of faces they are born on."""
    mesh, start = swept.work.mesh, swept.start
    v = find_flaws(start.mesh, mesh, parallel)
    X, F = start.featured.reference.X, start.featured.reference.origin.reshape(-1, 3)
    near = np.zeros(len(X), np.bool_)
    if len(v):
        from scipy.spatial import cKDTree

        near |= cKDTree(mesh.X[v, :3]).query(X[:, :3])[0] <= _NEAR * X[:, 3]
        near[F[mesh.birth[v] // 3]] = True
    return near


def clearance_in_words(clearance: dict[str, float]) -> str:
    """Say what was done where sheets are near."""
    words = []
    if clearance["vertices"]:
        words.append(
            f"lengths fall to {clearance['shortest']:.2g} of what was asked for, at "
            f"{clearance['vertices']:,} vertices of the input"
        )
    if clearance["new_crease_edges"]:
        words.append(f"{clearance['new_crease_edges']:,} more edges are creases")
    return f"where sheets are near (clearance), {' and '.join(words)}"


def _sharp_edges(start: Start, gap: FloatArray) -> BoolArray:
    """Tell which half-edges turn sharply beside a face with a sheet near."""
    X, origin, twin = start.mesh.X, start.mesh.origin, start.mesh.twin
    edges = find_dihedral_angles(X, origin, twin, _SHARP, parallel=False).edges
    is_near = np.isfinite(gap)
    edges = edges[is_near[edges // 3] | is_near[twin[edges] // 3]]
    is_sharp = np.zeros(len(origin), np.bool_)
    is_sharp[edges] = True
    is_sharp[twin[edges]] = True
    return is_sharp
