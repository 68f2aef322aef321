"""What the caller wants kept: checked, then turned from indices of the input to masks on the mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from ..core.arguments import choice, number
from ..core.check import as_array, as_indices, as_mask
from ..core.vocabulary import EQUAL_DATA, NONE, BoolArray, IndexArray, Mesh
from ..errors import OptionError
from ..mesh.edges import count_edges, edge_keys
from ..mesh.mend import Kept
from ..mesh.walk import ends_of
from .options import Boundary, RemeshOptions

__all__ = ["ConstraintMasks", "Constraints", "corners_at", "make_constraints"]


class ConstraintMasks(NamedTuple):
    """What must stay, on a mesh."""

    hard: BoolArray  # (3 m,) half-edges that are features whatever their angle
    held: BoolArray | None  # (m,) faces that stay as they are; None for none
    frozen: BoolArray  # (3 m,) half-edges that stay as they are
    fixed: BoolArray  # (n,) vertices that stay where they are


@dataclass(frozen=True)
class Constraints:
    """What must stay, in terms of the input's vertices and faces."""

    feature_angle: float | str | None  # "auto", degrees, or None
    corner_angle: float | None  # degrees, or None
    boundary: str
    feature_edges: NDArray[np.int64]  # (k, 2)
    fixed_vertices: NDArray[np.int64]  # (k,)
    fixed_faces: BoolArray | None  # (m,)
    labels: NDArray[Any] | None  # (m,)
    on_corners: list[NDArray[Any]]  # (m, 3, k) each, or (m, 1, k): whose jumps are kept
    unselected: BoolArray | None  # (m,) fixed faces that come first in the result, in their order
    F: NDArray[np.int64]  # (m, 3)

    def on_mesh(
        self,
        mesh: Mesh,
        vertex_source: IndexArray,
        face_source: NDArray[np.intp],
        representative: Any,
    ) -> ConstraintMasks:
        """Turn the constraints into masks on a mesh made from the input's elements.

        Parameters
        ----------
        mesh : Mesh
        vertex_source : (n,) int32
        face_source : (m,) int
        same : (n_in,) int32, optional
            The vertex that stands for each of the input, where some were welded.
        """
        hard = np.zeros(mesh.origin.size, np.bool_)
        edges, vertices = self.feature_edges, self.fixed_vertices
        if representative is not None:
            edges, vertices = representative[edges], representative[vertices]
        if len(edges):
            hard[_halfedges_between(mesh.origin, vertex_source, edges.T)] = True
        if self.labels is not None:
            hard |= _borders(mesh.twin, self.labels[face_source])
        if self.on_corners:
            hard |= self._jumps(mesh, vertex_source, face_source, representative)
        fixed = np.zeros(len(vertex_source), np.bool_)
        if len(vertices):
            fixed = np.isin(vertex_source, vertices)
        held = None if self.fixed_faces is None else self.fixed_faces[face_source]
        frozen = np.zeros(mesh.origin.size, np.bool_)
        if held is not None and held.any():
            frozen |= np.repeat(held, 3)
        else:
            held = None
        if self.boundary != "free":
            border = _border_edges(mesh, vertex_source)
            fixed[ends_of(mesh.origin, border)] = True
            if self.boundary == "fixed":
                frozen[border] = True
        if frozen.any():  # all sides of an edge, of two faces or more
            ends = vertex_source[ends_of(mesh.origin, np.flatnonzero(frozen))]
            h = _halfedges_between(mesh.origin, vertex_source, ends)
            frozen[h] = True
            fixed[ends_of(mesh.origin, h)] = True
        return ConstraintMasks(hard, held, frozen, fixed)

    def _jumps(
        self,
        mesh: Mesh,
        vertex_source: IndexArray,
        face_source: NDArray[np.intp],
        representative: Any,
    ) -> BoolArray:
        """Half-edges across which the data on corners differ, at one end or both."""
        h = np.flatnonzero(mesh.twin > np.arange(len(mesh.twin)))
        t = mesh.twin[h]
        is_jump = np.zeros(len(h), np.bool_)
        for v in ends_of(mesh.origin, h):
            ours, theirs = (
                corners_at(self.F, face_source[side // 3], vertex_source[v], representative)
                for side in (h, t)
            )
            for values in self.on_corners:
                is_jump |= _differ(values, ours, theirs) & (ours >= 0) & (theirs >= 0)
        jumps = np.zeros(len(mesh.twin), np.bool_)
        jumps[h[is_jump]] = jumps[t[is_jump]] = True
        return jumps

    def kept(self, n: int) -> Kept:
        """Vertices and faces of the input, of ``n`` vertices, that stay exactly as they are."""
        vertices = np.zeros(n, np.bool_)
        vertices[self.fixed_vertices] = True
        faces = np.zeros(len(self.F), np.bool_)
        if self.fixed_faces is not None:
            faces |= self.fixed_faces
            vertices[self.F[faces]] = True
        if self.boundary != "free":
            ends, uses = count_edges(self.F)
            vertices[ends[uses == 1]] = True
            faces |= vertices[self.F].sum(axis=1) >= 2
        return Kept(vertices, faces)


def corners_at(
    F: NDArray[Any], face: NDArray[Any], v: NDArray[Any], representative: Any
) -> NDArray[np.int64]:
    """Corners ``3 * face + c`` of the input at vertices of faces; -1 where a face was cut."""
    corners = F[face] if representative is None else representative[F[face]]
    is_here = corners == v[:, None]
    return np.where(is_here.any(axis=1), 3 * face + is_here.argmax(axis=1), -1)


def _halfedges_between(
    origin: NDArray[Any], vertex_source: NDArray[Any] | None, ends: NDArray[Any]
) -> NDArray[np.int64]:
    """Half-edges that run between the same two vertices as any of these (2, k), either way.

    ``vertex_source`` tells which vertices are the same.
    """
    n = 1 + int(ends.max())
    is_end = np.zeros(n, np.bool_)
    is_end[ends] = True
    at = origin if vertex_source is None else vertex_source[origin]
    is_near = is_end[np.minimum(at, n - 1)] & (at < n)
    h = np.flatnonzero(is_near.reshape(-1, 3) & np.roll(is_near.reshape(-1, 3), -1, axis=1))
    keys = edge_keys(ends_of(at, h), n)
    return h[np.isin(keys, edge_keys(ends, n))]


def _border_edges(mesh: Mesh, vertex_source: IndexArray) -> NDArray[np.int64]:
    """Half-edges without a twin that have no sibling on another sheet either."""
    h = np.flatnonzero(mesh.twin == NONE)
    keys = edge_keys(vertex_source[ends_of(mesh.origin, h)], 1 + int(vertex_source.max()))
    _, place, count = np.unique(keys, return_inverse=True, return_counts=True)
    return np.asarray(h[count[place] == 1])


def _borders(twin: NDArray[np.int32], value: NDArray[Any]) -> BoolArray:
    """Half-edges between faces of different value."""
    h = np.flatnonzero(twin != NONE)
    border = np.zeros(len(twin), np.bool_)
    border[h] = value[h // 3] != value[twin[h] // 3]
    return border


def make_constraints(n: int, F: NDArray[np.int64], options: RemeshOptions) -> Constraints:
    """Check what the caller wants kept against a mesh of ``n`` vertices and faces ``F``.

    Raises
    ------
    OptionError
        An index out of range, an array of the wrong shape, an edge that the mesh does not have, an
        angle or a mode that does not exist.
    """
    fixed, unselected = _kept_faces(options, len(F))
    return Constraints(
        _feature_angle(options.feature_angle),
        _corner_angle(options.corner_angle),
        choice(options.boundary, "boundary", get_args(Boundary)),
        _feature_edges(options.feature_edges, n, F),
        _fixed_vertices(options.fixed_vertices, n),
        fixed,
        _labels(options.face_labels, len(F)),
        _corner_data(options.preserve, len(F)),
        unselected,
        F,
    )


def _fixed_vertices(given: Any, n: int) -> NDArray[np.int64]:
    if given is None:
        return np.empty(0, np.int64)
    return as_indices(given, n, "fixed_vertices", "vertex")


def _kept_faces(options: RemeshOptions, m: int) -> tuple[BoolArray | None, BoolArray | None]:
    """Masks of the faces that stay, and of those that do because they are not selected."""
    fixed = unselected = None
    if options.fixed_faces is not None:
        fixed = as_mask(options.fixed_faces, m, "fixed_faces", "face")
    if options.selection is not None:
        unselected = ~as_mask(options.selection, m, "selection", "face")
        fixed = unselected if fixed is None else fixed | unselected
    return fixed, unselected


def _labels(given: Any, m: int) -> NDArray[Any] | None:
    """Check one whole number per face."""
    if given is None:
        return None
    labels = as_array(given, "face_labels")
    if labels.shape != (m,) or labels.dtype.kind not in "iub":
        raise OptionError(
            f"face_labels must hold one whole number per face, shape ({m},); "
            f"got shape {labels.shape} of {labels.dtype}"
        )
    return labels


def _corner_data(preserve: Any, m: int) -> list[NDArray[Any]]:
    """Return arrays (m, 3, k), or (m, 1, k) for data on faces."""
    if preserve is None:
        return []
    several = preserve if isinstance(preserve, list | tuple) else [preserve]
    arrays = []
    for i, given in enumerate(several):
        name = f"preserve[{i}]" if len(several) > 1 else "preserve"
        array = as_array(given, name)
        if array.ndim == 1 and len(array) == m:
            arrays.append(array.reshape(m, 1, 1))
        elif array.ndim >= 2 and array.shape[:2] == (m, 3):
            arrays.append(array.reshape(m, 3, -1))
        else:
            raise OptionError(
                f"{name} must hold one entry a corner, shape ({m}, 3, ...), or one a face, shape "
                f"({m},); got {array.shape}"
            )
        if array.dtype.kind == "c":
            arrays[-1] = np.concatenate([arrays[-1].real, arrays[-1].imag], axis=2)
        if array.dtype.kind in "fc" and not np.isfinite(array).all():
            raise OptionError(f"{name} holds NaN or infinity, which have no jumps")
    return arrays


def _differ(
    values: NDArray[Any], one: NDArray[np.int64], two: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Tell where data (m, 3, k), or (m, 1, k), differ between corners."""
    step = values.shape[1]
    flat = values.reshape(-1, values.shape[2])
    a, b = (flat[corner // 3 * step + np.minimum(corner % 3, step - 1)] for corner in (one, two))
    if values.dtype.kind != "f":
        return np.asarray((a != b).any(axis=1))
    return np.asarray((abs(a - b) > EQUAL_DATA * np.ptp(values, axis=(0, 1))).any(axis=1))


def _feature_angle(value: Any) -> float | str | None:
    if value is None or (isinstance(value, str) and value == "auto"):
        return value
    try:
        return number(value, "feature_angle", above=0.0, below=180.0)
    except OptionError:
        raise OptionError(
            f'feature_angle must be "auto", None or degrees between 0 and 180; got {value!r}'
        ) from None


def _corner_angle(value: Any) -> float | None:
    return (
        None
        if value is None
        else number(value, "corner_angle", above=0.0, high=180.0, unit="degrees")
    )


def _feature_edges(value: Any, n: int, F: NDArray[np.int64]) -> NDArray[np.int64]:
    if value is None:
        return np.empty((0, 2), np.int64)
    array = as_array(value, "feature_edges")
    if array.size == 0:
        return np.empty((0, 2), np.int64)
    if array.ndim != 2 or array.shape[1] != 2:
        raise OptionError(
            f"feature_edges must have shape (k, 2), two vertices a row; got {array.shape}"
        )
    edges = np.stack(
        [as_indices(array[:, i], n, f"feature_edges[:, {i}]", "vertex") for i in (0, 1)], 1
    )
    known = ends_of(F.ravel(), _halfedges_between(F.ravel(), None, edges.T))
    bad = np.flatnonzero(~np.isin(edge_keys(edges.T, n), edge_keys(known, n)))
    if len(bad):
        a, b = edges[bad[0]]
        raise OptionError(
            f"{len(bad)} rows of feature_edges are no edges of the mesh, the first is row {bad[0]}, "
            f"vertices {a} and {b}"
        )
    return edges
