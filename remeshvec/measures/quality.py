"""Quality of a triangle mesh: edge lengths, angles, valences, areas, topology.

Shares and relative figures are fractions (0 to 1), angles are degrees, lengths are those of the
input.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..core.arguments import number
from ..core.check import as_mesh
from ..core.vocabulary import BoolArray, FloatArray, IntArray
from ..interop.given import MeshObject, takes_meshes
from .record import Quality

__all__ = ["Elements", "elements", "quality"]


SHORTEST_IN_BAND, LONGEST_IN_BAND = 4 / 5, 4 / 3  # the thresholds of Botsch and Kobbelt [2004]
NARROW_ANGLE = 30.0  # degrees; below it a triangle counts as narrow


@takes_meshes
def quality(V: ArrayLike | MeshObject, F: Any = None, L: float | None = None) -> Quality:
    """Measure a triangle mesh.

    Dirty meshes are measured too: degenerate, duplicated and unreferenced elements, non-manifold
    edges and vertices and inconsistent orientation are counted, not refused.

    Parameters
    ----------
    V : (n, 3) float, or a mesh
        Vertex positions; or a whole mesh as for `remesh`, or a result, with ``L`` after it.
    F : (m, 3) int
        Faces, 0-based.
    L : float, optional
        Edge length that `edge_in_band` refers to; the mean edge length by default.

    Returns
    -------
    Quality
        The measures; ``print`` shows them as a table.

    Raises
    ------
    MeshInputError
        The arrays cannot be a triangle mesh.
    OptionError
        `L` is not a positive number.

    Notes
    -----
    The mixed Voronoi areas [Meyer et al. 2003, section 3.3] are libigl's.
    """
    if L is not None:
        L = number(L, "L", above=0.0, unit="units of V")
    V, F = as_mesh(V, F)
    repeated = _is_repeated(F)
    used, F = _referenced(F[~repeated], len(V))
    X, unit = _unit_box(V[used])
    corners = _corner_geometry(X, F)
    edges = _build_edges(X, F)
    return Quality(
        vertices=len(X),
        faces=len(F),
        edges=len(edges.lengths),
        unreferenced_vertices=len(V) - len(X),
        degenerate_faces=int(repeated.sum() + corners.is_flat.sum()),
        **_edge_measures(edges.lengths * unit, L),
        **_shape_measures(corners),
        **_valence_measures(edges, len(X)),
        area_error_face=_relative_mean_error(corners.area),
        area_error_voronoi=_relative_mean_error(_voronoi_areas(X, F, corners)),
        **_topology_measures(edges, F, len(X)),
        area=float(corners.area.sum()) * unit * unit,
        volume=_enclosed_volume(X, F, edges, unit),
    )


class Elements(NamedTuple):
    """Measures of every single edge and face, for histograms and pictures."""

    V: FloatArray  # (n, 3), vertices that a face uses, in the units of the input
    F: IntArray  # (m, 3), faces that name three vertices, as indices into V
    edge_lengths: FloatArray  # (e,)
    angles: FloatArray  # (m, 3), degrees
    areas: FloatArray  # (m,)
    radius_ratios: FloatArray  # (m,), 2 r_in / R_circ: 1 equilateral, 0 degenerate


def elements(V: ArrayLike, F: ArrayLike) -> Elements:
    """Measure every edge and face; parameters and errors are those of `quality`.

    Faces that name a vertex twice and unreferenced vertices are left out there too.
    """
    V, F = as_mesh(V, F)
    used, F = _referenced(F[~_is_repeated(F)], len(V))
    X, unit = _unit_box(V[used])
    corners, edges = _corner_geometry(X, F), _build_edges(X, F)
    return Elements(
        V[used],
        F,
        edges.lengths * unit,
        corners.angle,
        corners.area * unit * unit,
        _radius_ratios(corners),
    )


class _Corners(NamedTuple):
    """Shape of the faces: squared edge lengths and angles by corner, areas by face."""

    squared: FloatArray  # (m, 3), of the edge opposite each corner
    angle: FloatArray  # (m, 3), degrees
    area: FloatArray  # (m,)
    is_flat: BoolArray  # (m,), no area beyond rounding


class _Edges(NamedTuple):
    """The undirected edges, and how half-edges (3 f + c) pair up on them."""

    ends: IntArray  # (e, 2)
    lengths: FloatArray  # (e,)
    uses: IntArray  # (e,), faces at each edge
    net: IntArray  # (e,), uses in one direction minus uses in the other
    boundary: IntArray  # half-edges of edges with one face
    pairs: IntArray  # (p, 2), half-edges that share an edge with two faces
    neighbours: IntArray  # (q, 2), half-edges that follow each other on any edge


def _is_repeated(F: IntArray) -> BoolArray:
    return (F[:, 0] == F[:, 1]) | (F[:, 1] == F[:, 2]) | (F[:, 2] == F[:, 0])


def _referenced(F: IntArray, n: int) -> tuple[BoolArray, IntArray]:
    """Return the mask of the vertices that a face uses, and the faces renumbered to them."""
    used = np.zeros(n, dtype=bool)
    used[F] = True
    return used, (np.cumsum(used) - 1)[F]


def _unit_box(X: FloatArray) -> tuple[FloatArray, float]:
    """Move and scale into a unit box, so that products of lengths neither underflow nor overflow."""
    if len(X) == 0:
        return X, 1.0
    low, high = X.min(axis=0), X.max(axis=0)
    unit = float((high - low).max()) or 1.0
    return (X - (low + high) / 2) / unit, unit


def _corner_geometry(X: FloatArray, F: IntArray) -> _Corners:
    P = X[F]
    opposite = P[:, [2, 0, 1]] - P[:, [1, 2, 0]]  # (m, 3, 3), edge facing a corner
    squared = np.einsum("fci,fci->fc", opposite, opposite)
    double_area = np.linalg.norm(np.cross(opposite[:, 0], opposite[:, 1]), axis=1)
    # 0 - x, not -x: a zero-length edge must give +0, because arctan2(0, -0) is 180 degrees.
    cosine = 0 - np.einsum("fci,fci->fc", opposite[:, [1, 2, 0]], opposite[:, [2, 0, 1]])
    angle = np.degrees(np.arctan2(double_area[:, None], cosine))
    # In the unit box, coordinates and hence heights carry a rounding error of about one epsilon;
    # heights of 8 epsilon or less count as 0.
    is_flat = double_area <= 8 * np.finfo(float).eps * np.sqrt(squared.max(axis=1, initial=0))
    return _Corners(squared, angle, double_area / 2, is_flat)


def _build_edges(X: FloatArray, F: IntArray) -> _Edges:
    start, end = F.ravel(), F[:, [1, 2, 0]].ravel()
    key = np.minimum(start, end) * len(X) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    same = key[order[1:]] == key[order[:-1]]
    first = np.flatnonzero(np.r_[True, ~same][: len(order)])
    uses = np.diff(np.r_[first, len(order)])
    direction = np.where(start < end, 1, -1)[order]
    ends = np.stack([start, end], axis=1)[order[first]]
    return _Edges(
        ends=ends,
        lengths=np.linalg.norm(X[ends[:, 1]] - X[ends[:, 0]], axis=1),
        uses=uses,
        net=np.add.reduceat(direction, first) if len(first) else uses,
        boundary=order[first[uses == 1]],
        pairs=np.stack([order[first[uses == 2]], order[first[uses == 2] + 1]], axis=1),
        neighbours=np.stack([order[:-1][same], order[1:][same]], axis=1),
    )


def _edge_measures(lengths: FloatArray, L: float | None) -> dict[str, Any]:
    mean = float(lengths.mean()) if len(lengths) else 0.0
    target = mean if L is None else float(L)
    in_band = (lengths >= SHORTEST_IN_BAND * target) & (lengths <= LONGEST_IN_BAND * target)
    return {
        "target_length": target,
        "edge_mean": mean,
        "edge_min": float(lengths.min(initial=np.inf)) if len(lengths) else 0.0,
        "edge_max": float(lengths.max(initial=0)),
        "edge_cv": float(lengths.std() / mean) if mean else 0.0,
        "edge_in_band": _share_of(in_band),
    }


def _shape_measures(corners: _Corners) -> dict[str, Any]:
    if len(corners.area) == 0:
        names = "min_angle min_angle_p1 min_angle_mean max_angle faces_below_30 radius_ratio_min"
        return dict.fromkeys([*names.split(), "radius_ratio_mean"], 0.0)
    smallest = corners.angle.min(axis=1)
    ratio = _radius_ratios(corners)
    return {
        "min_angle": float(smallest.min()),
        "min_angle_p1": float(np.percentile(smallest, 1)),
        "min_angle_mean": float(smallest.mean()),
        "max_angle": float(corners.angle.max()),
        "faces_below_30": _share_of(smallest < NARROW_ANGLE),
        "radius_ratio_min": float(ratio.min()),
        "radius_ratio_mean": float(ratio.mean()),
    }


def _radius_ratios(corners: _Corners) -> FloatArray:
    """2 r / R = 16 A^2 / (abc (a + b + c)), 0 for a face that is a point."""
    lengths = np.sqrt(corners.squared)
    below = lengths.prod(axis=1) * lengths.sum(axis=1)
    ratio = np.zeros(len(below))
    np.divide(16 * corners.area**2, below, out=ratio, where=below > 0)
    return np.minimum(ratio, 1.0)  # rounding may exceed 1


def _valence_measures(edges: _Edges, n: int) -> dict[str, Any]:
    valence = np.bincount(edges.ends.ravel(), minlength=n)
    on_boundary = _touched(edges.ends[edges.uses == 1], n)
    inner = ~_touched(edges.ends[edges.uses != 2], n)
    values, counts = np.unique(valence[inner], return_counts=True)
    return {
        "inner_vertices": int(inner.sum()),
        "boundary_vertices": int(on_boundary.sum()),
        "valence6_inner": _share_of(valence[inner] == 6),
        "valence4_boundary": _share_of(valence[on_boundary] == 4),
        "valence_histogram": dict(zip(values.tolist(), counts.tolist(), strict=True)),
    }


def _topology_measures(edges: _Edges, F: IntArray, n: int) -> dict[str, Any]:
    fans, fan = _fans(edges, F)
    vertex_of_fan = np.empty(fans, dtype=np.int64)
    vertex_of_fan[fan] = F.ravel()
    border = np.stack([fan[edges.boundary], fan[_next(edges.boundary)]], axis=1)
    on_border, border = np.unique(border, return_inverse=True)
    return {
        "boundary_edges": len(edges.boundary),
        "boundary_loops": _components(border.reshape(-1, 2), len(on_border))[0],
        "nonmanifold_edges": int((edges.uses > 2).sum()),
        "nonmanifold_vertices": int((np.bincount(vertex_of_fan, minlength=n) > 1).sum()),
        "misoriented_edges": int(((edges.uses == 2) & (edges.net != 0)).sum()),
        "components": _components(edges.neighbours // 3, len(F))[0],
        "euler_number": n - len(edges.uses) + len(F),
    }


def _fans(edges: _Edges, F: IntArray) -> tuple[int, IntArray]:
    """Label every corner with its fan: corners of one vertex, joined across two-faced edges."""
    vertex = F.ravel()
    h, k = edges.pairs[:, 0], edges.pairs[:, 1]
    same_way = vertex[h] == vertex[k]
    starts = np.stack([h, np.where(same_way, k, _next(k))], axis=1)
    ends = np.stack([_next(h), np.where(same_way, _next(k), k)], axis=1)
    return _components(np.concatenate([starts, ends]), len(vertex))


def _components(links: IntArray, n: int) -> tuple[int, IntArray]:
    """Count the connected components of `n` nodes with these links, and label the nodes."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    ones = np.ones(len(links), dtype=np.int8)
    graph = coo_matrix((ones, (links[:, 0], links[:, 1])), shape=(n, n))
    return connected_components(graph, directed=False)


def _next(h: IntArray) -> IntArray:
    return np.where(h % 3 == 2, h - 2, h + 1)


def _touched(index: IntArray, n: int) -> BoolArray:
    mask = np.zeros(n, dtype=bool)
    mask[index] = True
    return mask


def _share_of(mask: BoolArray) -> float:
    return float(mask.mean()) if len(mask) else 0.0


def _voronoi_areas(X: FloatArray, F: IntArray, corners: _Corners) -> FloatArray:
    """Mixed Voronoi areas of the vertices [Meyer et al. 2003]; faces without area add nothing."""
    import igl

    F = F[~corners.is_flat]  # libigl gives NaN at their vertices
    if len(F) == 0:
        return np.zeros(len(X))
    return igl.massmatrix(X, F, igl.MASSMATRIX_TYPE_VORONOI).diagonal()


def _relative_mean_error(areas: FloatArray) -> float:
    """Mean |A - A_mean| / A_mean; 0 where there is no area."""
    mean = areas.mean() if len(areas) else 0.0
    return float(np.abs(areas - mean).mean() / mean) if mean else 0.0


def _enclosed_volume(X: FloatArray, F: IntArray, edges: _Edges, unit: float) -> float | None:
    """Signed volume; None unless faces run along each edge equally often in both directions."""
    if len(F) == 0 or edges.net.any():
        return None
    a, b, c = X[F[:, 0]], X[F[:, 1]], X[F[:, 2]]
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6) * unit * unit * unit
