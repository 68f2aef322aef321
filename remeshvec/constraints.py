"""What the caller wants kept: checked, and then turned from input indices to arrays on the mesh."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._types import NONE, IndexArray, Mesh
from .errors import OptionError

__all__ = ["BOUNDARY_MODES", "Constraints", "Marks", "make_constraints"]

BOUNDARY_MODES = ("free", "split", "fixed")

BoolArray = NDArray[np.bool_]


class Marks(NamedTuple):
    """What must stay, on a mesh."""

    hard: BoolArray  # (3 m,) half-edges that are features whatever their angle
    held: BoolArray | None  # (m,) faces that stay as they are; None for none
    frozen: BoolArray  # (3 m,) half-edges that stay as they are
    fixed: BoolArray  # (n,) vertices that stay where they are


@dataclass(frozen=True)
class Constraints:
    """What must stay, in terms of the input's vertices and faces."""

    feature_angle: float | str | None  # "auto", degrees, or None
    boundary: str
    feature_edges: NDArray[np.int64]  # (k, 2)
    fixed_vertices: NDArray[np.int64]  # (k,)
    fixed_faces: BoolArray | None  # (m,)
    labels: NDArray[Any] | None  # (m,)
    unselected: BoolArray | None  # (m,) those of the fixed faces that are to come first, in order

    def on_mesh(
        self, mesh: Mesh, vertex_source: IndexArray, face_source: NDArray[np.intp], same: Any
    ) -> Marks:
        """Turn the wishes to masks of a mesh whose elements come from the input's.

        Parameters
        ----------
        mesh : Mesh
        vertex_source : (n,) int32
        face_source : (m,) int
        same : (n_in,) int32, optional
            The vertex that stands for each of the input, where some were welded.
        """
        # A vertex that no face uses any more may have any index.
        n = 1 + max(int(vertex_source.max()), int(self.feature_edges.max(initial=0)))
        ends = vertex_source[mesh.origin].astype(np.int64).reshape(-1, 3)
        keys = _edge_keys(ends.ravel(), np.roll(ends, -1, axis=1).ravel(), n)
        edges, vertices = self.feature_edges, self.fixed_vertices
        if same is not None:
            edges, vertices = same[edges].astype(np.int64), same[vertices]
        hard = np.zeros(len(keys), np.bool_)
        if len(edges):
            hard |= np.isin(keys, _edge_keys(edges[:, 0], edges[:, 1], n))
        if self.labels is not None:
            hard |= _borders(mesh.twin, self.labels[face_source])
        fixed = np.zeros(max(n, int(vertices.max(initial=0)) + 1), np.bool_)
        fixed[vertices] = True
        fixed = fixed[vertex_source]
        held = None if self.fixed_faces is None else self.fixed_faces[face_source]
        frozen = np.zeros(len(keys), np.bool_)
        if held is not None and held.any():
            frozen |= np.repeat(held, 3)
        else:
            held = None
        if self.boundary != "free":
            border = _border_edges(mesh.twin, keys)
            fixed[mesh.origin[border]] = True
            fixed[mesh.origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()[border]] = True
            if self.boundary == "fixed":
                frozen |= border
        if frozen.any():  # all sides of an edge, of two faces or more
            frozen = np.isin(keys, np.unique(keys[frozen]))
            fixed[mesh.origin[frozen]] = True
            fixed[mesh.origin.reshape(-1, 3)[:, [1, 2, 0]].ravel()[frozen]] = True
        return Marks(hard, held, frozen, fixed)


def _border_edges(twin: IndexArray, keys: NDArray[np.int64]) -> BoolArray:
    """Half-edges without a twin that have no sibling on another sheet either."""
    h = np.flatnonzero(twin == NONE)
    _, place, count = np.unique(keys[h], return_inverse=True, return_counts=True)
    border = np.zeros(len(twin), np.bool_)
    border[h[count[place] == 1]] = True
    return border


def _borders(twin: NDArray[np.int32], value: NDArray[Any]) -> BoolArray:
    """Half-edges between faces of different value."""
    h = np.flatnonzero(twin != NONE)
    border = np.zeros(len(twin), np.bool_)
    border[h] = value[h // 3] != value[twin[h] // 3]
    return border


def make_constraints(
    n: int,
    F: NDArray[np.int64],
    *,
    feature_angle: Any = "auto",
    boundary: Any = "free",
    feature_edges: Any = None,
    fixed_vertices: Any = None,
    fixed_faces: Any = None,
    face_labels: Any = None,
    selection: Any = None,
) -> Constraints:
    """Check the caller's wishes against a mesh of ``n`` vertices and faces ``F``.

    Raises
    ------
    OptionError
        An index out of range, an array of the wrong shape, an edge that the mesh does not have, an
        angle or a mode that does not exist.
    """
    fixed = None if fixed_faces is None else _face_mask(fixed_faces, len(F), "fixed_faces")
    unselected = None
    if selection is not None:
        unselected = ~_face_mask(selection, len(F), "selection")
        fixed = unselected if fixed is None else fixed | unselected
    labels = None
    if face_labels is not None:
        labels = _array(face_labels, "face_labels")
        if labels.shape != (len(F),) or labels.dtype.kind not in "iub":
            raise OptionError(
                f"face_labels must hold one whole number a face, shape ({len(F)},); "
                f"got shape {labels.shape} of {labels.dtype}"
            )
    return Constraints(
        _angle(feature_angle),
        _mode(boundary),
        _edges(feature_edges, n, F),
        np.empty(0, np.int64)
        if fixed_vertices is None
        else _indices(fixed_vertices, n, "fixed_vertices", "vertex"),
        fixed,
        labels,
        unselected,
    )


def _angle(value: Any) -> float | str | None:
    if value is None or (isinstance(value, str) and value == "auto"):
        return value
    is_number = isinstance(value, Real) and not isinstance(value, bool | np.bool_)
    if not is_number or not 0.0 < float(value) < 180.0:
        raise OptionError(
            f'feature_angle must be "auto", None or degrees between 0 and 180; got {value!r}'
        )
    return float(value)


def _mode(value: Any) -> str:
    if not isinstance(value, str) or value not in BOUNDARY_MODES:
        raise OptionError(f"boundary must be one of {', '.join(BOUNDARY_MODES)}; got {value!r}")
    return value


def _face_mask(value: Any, m: int, name: str) -> BoolArray:
    """Mask of faces from a mask or from indices."""
    array = _array(value, name)
    if array.dtype == np.bool_:
        if array.shape != (m,):
            raise OptionError(f"{name} as a mask must have shape ({m},); got {array.shape}")
        return array.copy()
    mask = np.zeros(m, np.bool_)
    mask[_indices(array, m, name, "face")] = True
    return mask


def _edges(value: Any, n: int, F: NDArray[np.int64]) -> NDArray[np.int64]:
    if value is None:
        return np.empty((0, 2), np.int64)
    array = _array(value, "feature_edges")
    if array.size == 0:
        return np.empty((0, 2), np.int64)
    if array.ndim != 2 or array.shape[1] != 2:
        raise OptionError(
            f"feature_edges must have shape (k, 2), two vertices a row; got {array.shape}"
        )
    edges = np.stack(
        [_indices(array[:, i], n, f"feature_edges[:, {i}]", "vertex") for i in (0, 1)], 1
    )
    known = _edge_keys(F.ravel(), np.roll(F, -1, axis=1).ravel(), n)
    bad = np.flatnonzero(~np.isin(_edge_keys(edges[:, 0], edges[:, 1], n), known))
    if len(bad):
        a, b = edges[bad[0]]
        raise OptionError(
            f"{len(bad)} rows of feature_edges are no edges of the mesh, the first is row {bad[0]}, "
            f"vertices {a} and {b}"
        )
    return edges


def _edge_keys(a: NDArray[np.int64], b: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """One number an edge, whichever way it runs."""
    return np.minimum(a, b) * n + np.maximum(a, b)


def _indices(value: Any, count: int, name: str, noun: str) -> NDArray[np.int64]:
    array = _array(value, name)
    if array.size == 0:
        return np.empty(0, np.int64)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise OptionError(
            f"{name} must hold {noun} indices; got shape {array.shape} of {array.dtype}"
        )
    bad = np.flatnonzero((array < 0) | (array >= count))
    if len(bad):
        raise OptionError(
            f"{name}[{bad[0]}] = {array[bad[0]]} is no {noun} index; they run from 0 to {count - 1}"
        )
    return array.astype(np.int64)


def _array(value: Any, name: str) -> NDArray[Any]:
    try:
        array = np.asarray(value)
    except (ValueError, TypeError) as error:
        raise OptionError(f"{name} is no rectangular array: {error}") from error
    if array.dtype == object:
        raise OptionError(f"{name} is no rectangular array of numbers")
    return array
