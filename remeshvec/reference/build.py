"""Build the reference surface: the cleaned and cut input with its feature curves.

Constraints become the arrays that all phases read: kinds of vertices, curves of edges, births.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.compiler import kernel
from ..core.vocabulary import (
    CURVE,
    FIXED,
    FROZEN,
    INNER,
    NON_MANIFOLD,
    NONE,
    BoolArray,
    IndexArray,
    IntArray,
    Mesh,
)
from ..features.corners import find_corners
from ..features.creases import find_creases, least_turn
from ..features.curves import link_chains
from ..features.dihedral import find_dihedral_angles
from ..features.polyline import find_siblings, join_edges, measure_arcs, name_edges
from ..features.tips import LEAST_TURN, hold_tips
from ..input.constraints import ConstraintMasks
from ..mesh.walk import ends_of, next_halfedge
from .bvh import Surface
from .long_rims import LongRims, lengthen_rims
from .surface import Reference

__all__ = ["FeaturedReference", "build_reference"]


class FeaturedReference(NamedTuple):
    """The reference, with what the sweeps need to know besides."""

    reference: Reference
    on_non_manifold: (
        BoolArray | None
    )  # (n,) vertices of the reference where sheets meet; None for none
    held: BoolArray | None  # (m,) faces of the reference that stay; None for none
    long_rims: LongRims | None  # edges that must stay and are longer than asked for; None for none
    features: IndexArray  # half-edges of the reference on features
    names: IndexArray  # of their edges, see `polyline.name_edges`
    counts: dict[str, int]  # of features

    @property
    def has_curves(self) -> bool:
        """Whether there are features or boundaries."""
        return len(self.features) > 0


def build_reference(
    mesh: Mesh,
    vertex_source: IndexArray,
    feature_angle: float | str | None,
    marks: ConstraintMasks,
    mean_edge: float,
    parallel: bool,
    corner_angle: float | None = None,
) -> FeaturedReference:
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
    mean_edge : float
        Mean length of the edges.
    parallel : bool
    corner_angle : float, optional
        Degrees by which a curve turns at a corner; by default ``feature_angle`` where that is a number,
        else 50.
    """
    origin, twin = mesh.origin.copy(), mesh.twin.copy()
    arrays = mesh.X, origin, twin
    turns = find_dihedral_angles(*arrays, min(LEAST_TURN, least_turn(feature_angle)), parallel)
    is_feature, counts = find_creases(
        *arrays, mesh.vertex_halfedge, marks.hard, feature_angle, mean_edge, turns, parallel
    )
    curves = link_chains(origin, twin, is_feature, len(mesh.X))
    members, group = find_siblings(mesh.X, origin, curves.edges[twin[curves.edges] == NONE])
    names = name_edges(twin, curves.edges, members, group, mesh.curve)
    fixed = marks.fixed | find_corners(
        *arrays, curves, feature_angle if corner_angle is None else corner_angle
    )
    on_non_manifold = None
    if len(members):
        on_non_manifold = np.zeros(len(mesh.X), np.bool_)
        on_non_manifold[ends_of(origin, members)] = True
        fixed |= _junctions(origin, curves.edges, mesh.curve, vertex_source, on_non_manifold)
        fixed = _agree_across_copies(fixed, vertex_source, on_non_manifold)
    feature_names = mesh.curve[curves.edges]
    counts["corners"] = int(np.count_nonzero(fixed & (curves.degree > 0)))
    row, neighbours = join_edges(mesh.curve, curves, origin, fixed)
    _mark(mesh, curves.edges, fixed)
    mesh.curve[members] += NON_MANIFOLD
    mesh.curve[marks.frozen] = FROZEN
    hold_tips(mesh, turns)
    X = mesh.X.copy()
    arcs = measure_arcs(X, origin, names, row, neighbours)
    if marks.held is not None:
        twin[_walls(twin, marks.held)] = NONE
    twin[curves.edges] = NONE
    surface = Surface(X, origin, twin, parallel)
    reference = Reference(surface, X, origin, row, neighbours, arcs)
    long_rims = lengthen_rims(mesh, vertex_source, marks.frozen)
    return FeaturedReference(
        reference, on_non_manifold, marks.held, long_rims, curves.edges, feature_names, counts
    )


def _walls(twin: IndexArray, held: BoolArray) -> IntArray:
    """Half-edges between faces that stay and faces that do not."""
    h = np.flatnonzero(np.repeat(held, 3) & (twin != NONE))
    h = h[~held[twin[h] // 3]]
    return np.concatenate([h, twin[h]])


def _junctions(
    origin: IndexArray,
    edges: IndexArray,
    name: IndexArray,
    vertex_source: IndexArray,
    on_non_manifold: BoolArray,
) -> BoolArray:
    """Vertices where seams end, branch, or change the number of their sheets.

    Elsewhere exactly two edges of curves meet, and every sheet has both.
    """
    ends = ends_of(origin, edges).ravel()
    names = np.concatenate([name[edges], name[edges]])
    per_copy = np.unique(np.stack([ends, names]), axis=1)[0]
    per_source = np.unique(np.stack([vertex_source[ends], names]), axis=1)[0]
    n = int(vertex_source.max()) + 1
    at_copy = np.bincount(per_copy, minlength=len(vertex_source))
    at_source = np.bincount(per_source, minlength=n)[vertex_source]
    return on_non_manifold & ((at_copy != 2) | (at_source != 2))


def _agree_across_copies(
    fixed: BoolArray, vertex_source: IndexArray, on_non_manifold: BoolArray
) -> BoolArray:
    """Fix all copies of a vertex on a seam if one is fixed, including a copy off all seams."""
    n = int(vertex_source.max()) + 1
    at_seam = np.zeros(n, np.bool_)
    at_seam[vertex_source[on_non_manifold]] = True
    is_fixed = np.zeros(n, np.bool_)
    is_fixed[vertex_source[fixed]] = True
    is_fixed[vertex_source[at_seam[vertex_source] & ~on_non_manifold]] = True
    return fixed | (at_seam & is_fixed)[vertex_source]


def _mark(mesh: Mesh, edges: IndexArray, fixed: BoolArray) -> None:
    """Set kinds and births; the copies of a vertex on a seam get the same birth."""
    mesh.kind.fill(INNER)
    mesh.birth[:] = mesh.vertex_halfedge
    if len(edges):
        _mark_curves(mesh, edges)
    v = np.flatnonzero(fixed)
    mesh.kind[v] = FIXED
    mesh.birth[v] = mesh.vertex_halfedge[v]


@kernel
def _mark_curves(mesh, edges):
    """Give each vertex on curves the birth of its edge with the smallest name."""
    for h in edges:
        for v in (mesh.origin[h], mesh.origin[next_halfedge(h)]):
            if mesh.kind[v] != CURVE or mesh.curve[h] < mesh.birth[v]:
                mesh.kind[v] = CURVE
                mesh.birth[v] = mesh.curve[h]
