"""What smoothers share: seams welded, the vertices that stay, and parts that vanish."""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.arguments import choice
from ..core.check import as_mask, as_mesh
from ..core.vocabulary import BoolArray, FloatArray, IntArray
from ..errors import RemeshWarning
from ..mesh.edges import boundary_vertices, components, halfedge_ends, used_vertices
from ..mesh.repair import drop_degenerate_faces, weld_vertices

__all__ = ["BOUNDARIES", "Movable", "as_movable", "double_areas", "keep_vanished", "warn_if_idle"]

BOUNDARIES = ("fixed", "free")

# A part vanishes where less than this share of its area is left: a sphere of a tenth of its radius.
_VANISHED = 0.01


class Movable(NamedTuple):
    """A surface to smooth, with vertices of its boundary that lie in one place joined."""

    V: FloatArray  # (n, 3), the caller's own: never written to
    F: IntArray  # (m, 3), among the representatives
    representative: NDArray[np.signedinteger]  # (n,) the vertex that moves for each
    stays: BoolArray  # (n,) representatives that do not move, and vertices that no face uses
    part: NDArray[np.int32]  # (n,) component of every vertex

    def spread(self, x: FloatArray) -> FloatArray:
        """Return all vertices of the caller, from moved representatives; those that stay as in V."""
        moved = x[self.representative]
        stays = self.stays[self.representative]
        moved[stays] = self.V[stays]
        return moved


def as_movable(V: ArrayLike, F: ArrayLike, boundary: str, fixed: ArrayLike | None) -> Movable:
    """Check a mesh and what is to stay of it, and weld its boundary.

    Only vertices of the boundary are welded: closed parts that touch are apart, as in `remesh`.
    """
    vertices, faces = as_mesh(V, F)
    n = len(vertices)
    choice(boundary, "boundary", BOUNDARIES)
    is_fixed = np.zeros(n, np.bool_) if fixed is None else as_mask(fixed, n, "fixed", "vertex")
    representative, faces = _weld_boundary(vertices, faces)
    stays = ~used_vertices(faces, n)
    stays[representative[is_fixed]] = True
    if boundary == "fixed":
        stays[boundary_vertices(faces, n)] = True
    part = components(n, *halfedge_ends(faces))[1]
    return Movable(vertices, faces, representative, stays, part)


def _weld_boundary(V: FloatArray, F: IntArray) -> tuple[NDArray[np.signedinteger], IntArray]:
    rim = boundary_vertices(F, len(V))
    found = weld_vertices(V, rim) if len(rim) else None
    if found is None:
        return np.arange(len(V)), F
    welded = found[F]
    kept = drop_degenerate_faces(welded)
    return found, (welded if kept is None else welded[kept]).astype(np.int64)


def warn_if_idle(surface: Movable) -> None:
    """Say so if nothing can move, as in a soup of triangles whose corners only nearly meet."""
    if surface.stays.all():
        warnings.warn(
            "no vertex moves: all are fixed or on the boundary; if faces are not joined, join them "
            'first with repair(V, F, weld=...), or let the boundary move with boundary="free"',
            RemeshWarning,
            stacklevel=3,
        )


def keep_vanished(surface: Movable, x: FloatArray, gone: IntArray) -> None:
    """Put parts that vanish back to where they were, in place, and warn of them.

    Parts are those in ``gone``, and those of which less than 1 % of the area is left.
    """
    n = int(surface.part.max()) + 1
    of_face = surface.part[surface.F[:, 0]]
    before = np.bincount(of_face, double_areas(surface.V, surface.F), n)
    after = np.bincount(of_face, double_areas(x, surface.F), n)
    vanished = np.flatnonzero((after < _VANISHED * before) | np.isin(np.arange(n), gone))
    if not len(vanished):
        return
    back = np.isin(surface.part, vanished)
    x[back] = surface.V[back]
    first = np.flatnonzero(back & ~surface.stays)
    warnings.warn(
        f"{len(vanished)} of {len(np.unique(of_face))} components are too small to be smoothed and stay "
        f"as they are ({len(first)} vertices, the first is {first[0] if len(first) else 0}); "
        "repair(V, F, min_component=...) removes small components",
        RemeshWarning,
        stacklevel=3,
    )


def double_areas(x: FloatArray, F: IntArray) -> FloatArray:
    """Twice the area of every face."""
    a, b, c = (x[F[:, k]] for k in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1))
