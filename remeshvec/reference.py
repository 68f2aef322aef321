"""The reference surface: the input as the sweeps look back at it, with its feature curves.

Here constraints become the arrays that all phases read: kinds of vertices, curves of edges, births.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._types import CURVE, FIXED, FROZEN, HELD, INNER, NONE, SEAM, IndexArray, Mesh
from .bvh import Surface
from .constraints import Marks
from .corners import find_corners
from .creases import find_creases
from .curves import link_chains
from .features import apexes
from .halfedge import ends_of
from .operations.project import Reference
from .polyline import find_siblings, join_edges, measure_arcs, name_edges

__all__ = ["Built", "build_reference"]

BoolArray = NDArray[np.bool_]


class Built(NamedTuple):
    """The reference, and what the policy needs to know besides."""

    reference: Reference
    on_seam: BoolArray | None  # (n,) vertices of the reference where sheets meet; None for none
    held: BoolArray | None  # (m,) faces of the reference that stay; None for none
    feature_keys: NDArray[np.int64]  # edges on features: smaller end times n, plus the larger one
    counts: dict[str, int]  # of features

    @property
    def has_curves(self) -> bool:
        """Whether there are features or boundaries."""
        return len(self.feature_keys) > 0


def build_reference(
    mesh: Mesh,
    vertex_source: IndexArray,
    feature_angle: float | str | None,
    marks: Marks,
    parallel: bool,
) -> Built:
    """Find the features of a mesh before its first sweep, mark them in it, and build the reference.

    Parameters
    ----------
    mesh : Mesh
        Target lengths in the last column of ``X``; ``kind``, ``curve`` and ``birth`` are set.
    vertex_source : (n,) int32
        Equal for vertices that were one before the surface was cut.
    feature_angle : float, "auto" or None
    marks : Marks
        What the caller wants to stay.
    parallel : bool
    """
    origin, twin = mesh.origin.copy(), mesh.twin.copy()
    members, group = find_siblings(mesh.X, origin, np.flatnonzero(twin == NONE).astype(np.int32))
    arrays = (mesh.X, origin, twin, mesh.vertex_halfedge)
    is_feature, counts = find_creases(*arrays, marks.hard, feature_angle)
    links = link_chains(origin, twin, mesh.vertex_halfedge, is_feature)
    name = name_edges(twin, is_feature, members, group)
    fixed = marks.fixed | find_corners(*arrays, is_feature, links, feature_angle)
    on_seam = None
    if len(members):
        on_seam = np.zeros(len(mesh.X), np.bool_)
        on_seam[_ends(origin, members)] = True
        fixed |= _junctions(origin, name, vertex_source, on_seam)
        fixed = _agree(fixed, vertex_source, on_seam)

    counts["corners"] = int((fixed & _touched(origin, is_feature, len(fixed))).sum())
    beside = join_edges(name, links, origin, fixed)
    _mark(mesh, origin, is_feature, marks.frozen, name, members, fixed)
    mesh.kind[apexes(mesh)] = HELD
    is_wall = is_feature if marks.held is None else is_feature | _walls(twin, marks.held)
    arcs = measure_arcs(mesh.X, origin, name, beside)
    X = mesh.X.copy()
    twin[is_wall] = NONE
    surface = Surface(X, origin, twin, parallel)
    reference = Reference(surface, X, origin, beside, arcs)
    _lengthen_beside(mesh, vertex_source, marks.frozen)
    keys = _edge_keys(origin, is_feature, len(fixed))
    return Built(reference, on_seam, marks.held, keys, counts)


def _ends(origin: IndexArray, which: NDArray[Any]) -> IndexArray:
    """Both ends of half-edges, given as a mask or as indices."""
    h: NDArray[Any] = np.flatnonzero(which) if which.dtype == np.bool_ else which
    return ends_of(origin, h).ravel()


def _edge_keys(origin: IndexArray, which: BoolArray, n: int) -> NDArray[np.int64]:
    ends = np.sort(_ends(origin, which).reshape(2, -1).astype(np.int64), axis=0)
    return ends[0] * n + ends[1]


def _lengthen_beside(mesh: Mesh, vertex_source: IndexArray, frozen: BoolArray) -> None:
    """Let the target length at the ends of an edge that must not be split reach that of the edge.

    The other edges of its faces cannot all be shorter than half of it: they would be split for ever.
    In the mesh only: elsewhere the reference says what was asked for.
    """
    h = np.flatnonzero(frozen)
    if len(h):
        a, b = _ends(mesh.origin, h).reshape(2, -1)
        length = np.linalg.norm(mesh.X[a, :3] - mesh.X[b, :3], axis=1)
        longest = np.zeros(int(vertex_source.max()) + 1)  # the same on all sheets
        np.maximum.at(longest, vertex_source[a], length)
        np.maximum.at(longest, vertex_source[b], length)
        np.maximum(mesh.X[:, 3], longest[vertex_source], out=mesh.X[:, 3])


def _touched(origin: IndexArray, is_feature: BoolArray, n: int) -> BoolArray:
    touched = np.zeros(n, np.bool_)
    touched[_ends(origin, is_feature)] = True
    return touched


def _walls(twin: IndexArray, held: BoolArray) -> BoolArray:
    """Half-edges between faces that stay and faces that do not."""
    h = np.flatnonzero(twin != NONE)
    wall = np.zeros(len(twin), np.bool_)
    wall[h] = held[h // 3] != held[twin[h] // 3]
    return wall


def _junctions(
    origin: IndexArray, name: IndexArray, vertex_source: IndexArray, on_seam: BoolArray
) -> BoolArray:
    """Vertices where seams end, branch, or change the number of their sheets.

    Elsewhere exactly two edges of curves meet, and every sheet has both.
    """
    edges = np.flatnonzero(name != NONE)
    ends = _ends(origin, edges)
    names = np.concatenate([name[edges], name[edges]])
    per_copy = np.unique(np.stack([ends, names]), axis=1)[0]
    per_source = np.unique(np.stack([vertex_source[ends], names]), axis=1)[0]
    n = int(vertex_source.max()) + 1
    at_copy = np.bincount(per_copy, minlength=len(vertex_source))
    at_source = np.bincount(per_source, minlength=n)[vertex_source]
    return on_seam & ((at_copy != 2) | (at_source != 2))


def _agree(fixed: BoolArray, vertex_source: IndexArray, on_seam: BoolArray) -> BoolArray:
    """Fix all copies of a vertex on a seam where one is fixed; a copy off all seams stays with them."""
    n = int(vertex_source.max()) + 1
    at_seam = np.zeros(n, np.bool_)
    at_seam[vertex_source[on_seam]] = True
    is_fixed = np.zeros(n, np.bool_)
    is_fixed[vertex_source[fixed]] = True
    is_fixed[vertex_source[at_seam[vertex_source] & ~on_seam]] = True
    return fixed | (at_seam & is_fixed)[vertex_source]


def _mark(
    mesh: Mesh,
    origin: IndexArray,
    is_feature: BoolArray,
    is_frozen: BoolArray,
    name: IndexArray,
    members: IndexArray,
    fixed: BoolArray,
) -> None:
    """Set kinds, curves and births; the copies of a vertex on a seam get the same birth."""
    edges = np.flatnonzero(is_feature)
    mesh.curve[:] = name
    mesh.curve[members] += SEAM
    mesh.curve[is_frozen] = FROZEN
    mesh.kind[:] = INNER
    ends = _ends(origin, edges)
    mesh.kind[ends] = CURVE
    mesh.kind[fixed] = FIXED
    mesh.birth[:] = mesh.vertex_halfedge
    smallest = np.full(len(fixed), np.iinfo(np.int32).max, np.int32)
    np.minimum.at(smallest, ends, np.concatenate([name[edges], name[edges]]))
    on_curve = mesh.kind == CURVE
    mesh.birth[on_curve] = smallest[on_curve]
