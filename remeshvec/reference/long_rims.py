"""Edges that must stay and are much longer than asked for: lengths grow towards them."""

from __future__ import annotations

import numpy as np

from ..core.vocabulary import DEAD, FIXED, BoolArray, FloatArray, IndexArray, Mesh
from ..mesh.walk import ends_of

__all__ = ["LongRims", "lengthen_rims"]

# Lengths fall by so much per unit of distance from such an edge. With less, the inside of a square whose
# sides stay never comes to the length that was asked for; with more, faces at the sides become needles.
_SLOPE = 2.5

# Only edges longer than so many target lengths count: others fit between edges of that length.
_LONG = 4.0 / 3.0

# Points along an edge: distances from it are off by no more than this share of its length.
_MOST_STEPS = 32

# Edges whose lengths differ by less than this factor are looked up together.
_OCTAVE = 1.5


class LongRims:
    """Edges that must stay and are longer than asked for.

    Parameters
    ----------
    starts, ends : (k, 3) float64
    lengths : (n,) float64
        At the vertices of the reference: those of the edges that end there, or what was asked for.
    """

    def __init__(self, starts: FloatArray, ends: FloatArray, lengths: FloatArray) -> None:
        from scipy.spatial import cKDTree

        self.starts, self.ends, self.lengths = starts, ends, lengths
        length = np.linalg.norm(ends - starts, axis=1)
        octave = np.floor(np.log(length / length.min()) / np.log(_OCTAVE))
        self.trees = []
        for n in np.unique(octave):
            points = _along(starts[octave == n], ends[octave == n])
            self.trees.append((cKDTree(points), float(length[octave == n].max())))

    def lengthen(self, mesh: Mesh, corners: IndexArray, weights: FloatArray) -> None:
        """Raise the target lengths of vertices that may move and lie near the edges.

        On a face of the input no higher than the edges at its corners ask for: so lengths stay as they
        are across a narrow face whose longest edge must stay.

        Parameters
        ----------
        mesh : Mesh
        corners : (n, 3) int32
            Vertices of the reference around every vertex.
        weights : (n, 3) float64
            Of the corners.
        """
        v = np.flatnonzero((mesh.vertex_halfedge != DEAD) & (mesh.kind != FIXED))
        near = np.zeros(len(v))
        for tree, length in self.trees:
            distance, _ = tree.query(mesh.X[v, :3], distance_upper_bound=length / _SLOPE)
            np.maximum(near, length - _SLOPE * distance, out=near)
        most = (self.lengths[corners[v]] * weights[v]).sum(axis=1)
        mesh.X[v, 3] = np.maximum(mesh.X[v, 3], np.minimum(near, most))


def lengthen_rims(mesh: Mesh, vertex_source: IndexArray, frozen: BoolArray) -> LongRims | None:
    """Raise the target length at the ends of an edge that must not be split to the edge's length.

    Otherwise the other edges of its faces would be split for ever: they cannot all be shorter than half
    of it. Only the mesh changes; the reference keeps the lengths that were asked for.
    """
    h = np.flatnonzero(frozen)
    if not len(h):
        return None
    a, b = ends_of(mesh.origin, h)
    length = np.linalg.norm(mesh.X[a, :3] - mesh.X[b, :3], axis=1)
    is_long = length > _LONG * 0.5 * (mesh.X[a, 3] + mesh.X[b, 3])
    longest = np.zeros(int(vertex_source.max()) + 1)  # the same on all sheets
    np.maximum.at(longest, vertex_source[a], length)
    np.maximum.at(longest, vertex_source[b], length)
    np.maximum(mesh.X[:, 3], longest[vertex_source], out=mesh.X[:, 3])
    if not is_long.any():
        return None
    return LongRims(mesh.X[a[is_long], :3], mesh.X[b[is_long], :3], mesh.X[:, 3].copy())


def _along(starts: FloatArray, ends: FloatArray) -> FloatArray:
    """Points along edges, with their ends."""
    share = np.linspace(0.0, 1.0, _MOST_STEPS + 1)[:, None, None]
    return np.asarray(starts + share * (ends - starts)).reshape(-1, 3)
