"""A mesh with its data, taken from an object or a file, and the transfer of the data to a result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import EQUAL_DATA
from ..mesh.edges import components, edge_keys, halfedge_ends

__all__ = [
    "Data",
    "MeshData",
    "carry",
    "corner_values",
    "split_vertices",
    "with_data_at_vertices",
    "with_uv_at_corners",
]

Data = dict[str, NDArray[Any]]


@dataclass
class MeshData:
    """Arrays of a mesh and of its data.

    Attributes
    ----------
    V : (n, 3)
    F : (m, 3)
    on_vertices, on_faces, on_corners : dict of arrays
        By name: (n, ...), (m, ...), (m, 3, ...).
    feature_data : tuple of str
        Names of data whose jumps or borders are features, such as texture coordinates and groups.
    directions : tuple of str
        Names of data on vertices that are unit vectors.
    wrap : callable, optional
        Makes an object of the same type as the one that was read.
    extra : dict
        Further information that file readers pass to writers, such as textures and materials.
    """

    V: NDArray[Any]
    F: NDArray[Any]
    on_vertices: Data = field(default_factory=dict)
    on_faces: Data = field(default_factory=dict)
    on_corners: Data = field(default_factory=dict)
    feature_data: tuple[str, ...] = ()
    directions: tuple[str, ...] = ()
    wrap: Callable[[MeshData], Any] | None = None
    extra: dict[str, Any] = field(default_factory=dict)

    def preserved(self, requested: Any = None) -> list[Any] | None:
        """Return the argument ``preserve`` of ``remesh``: the feature data, then those requested."""
        several = (
            requested
            if isinstance(requested, list | tuple)
            else []
            if requested is None
            else [requested]
        )
        return [*map(self.find, self.feature_data), *several] or None

    def find(self, name: str) -> NDArray[Any]:
        """Return data by name on faces or corners; data on vertices are spread to corners."""
        for data in (self.on_faces, self.on_corners):
            if name in data:
                return data[name]
        return corner_values(self.on_vertices[name], self.F)


def corner_values(values: NDArray[Any], F: NDArray[Any]) -> NDArray[Any]:
    """Spread data on vertices (n, ...) to corners (m, 3, ...)."""
    return np.asarray(values)[F]


def with_uv_at_corners(data: MeshData, name: str) -> MeshData:
    """Return a mesh whose texture coordinates, data on vertices of that name, are ``"uv"`` on corners."""
    on_vertices = dict(data.on_vertices)
    uv = corner_values(on_vertices.pop(name), data.F)[..., :2]
    uv = np.ascontiguousarray(uv, uv.dtype.newbyteorder("="))
    features = [known for known in data.feature_data if known != name]
    return replace(
        data,
        on_vertices=on_vertices,
        on_corners={**data.on_corners, "uv": uv},
        feature_data=("uv", *features),
    )


def with_data_at_vertices(data: MeshData) -> MeshData:
    """Return a mesh whose data on corners are on vertices; those whose corners differ are doubled."""
    if not data.on_corners:
        return data
    corner, F = split_vertices(data.F, list(data.on_corners.values()))
    old = data.F.ravel()[corner]
    on_vertices = {name: x[old] for name, x in data.on_vertices.items()}
    on_vertices |= {
        name: x.reshape(-1, *x.shape[2:])[corner] for name, x in data.on_corners.items()
    }
    return replace(data, V=data.V[old], F=F, on_vertices=on_vertices, on_corners={})


def carry(data: MeshData, result: Any) -> MeshData:
    """Transfer all data of a mesh to the result of ``remesh``.

    Where several vertices lie in one place with different data, as at texture seams, the new vertices on
    the same curves are doubled.
    """
    F = np.asarray(result.F)
    out = replace(
        data,
        V=np.asarray(result.V),
        F=F,
        on_vertices={},
        on_faces={k: result.transfer(x, on="faces") for k, x in data.on_faces.items()},
        on_corners={
            k: result.transfer(x, on="corners", method=_method(x))
            for k, x in data.on_corners.items()
        },
    )
    welded = result.report.dirt.get("welded_vertices", 0)
    if welded and data.on_vertices:
        at_corners = {
            k: result.transfer(corner_values(x, data.F), on="corners", method=_method(x))
            for k, x in data.on_vertices.items()
        }
        vertex_of, out.F = split_vertices(F, list(at_corners.values()))
        out.V = out.V[F.ravel()[vertex_of]]
        out.on_vertices = {k: x.reshape(-1, *x.shape[2:])[vertex_of] for k, x in at_corners.items()}
    else:
        out.on_vertices = {
            k: result.transfer(x, method=_method(x)) for k, x in data.on_vertices.items()
        }
    for name in data.directions:
        out.on_vertices[name] = _unit_rows(out.on_vertices[name])
    return out


def split_vertices(
    F: NDArray[Any], at_corners: list[NDArray[Any]]
) -> tuple[NDArray[np.int64], NDArray[Any]]:
    """Split vertices whose corners have different data.

    Parameters
    ----------
    F : (m, 3) int
    at_corners : list of (m, 3, ...)

    Returns
    -------
    corner : (k,) int64
        One corner ``3 f + c`` of every new vertex.
    F : (m, 3)
        Faces of the new vertices, in the dtype of the old.
    """
    h = np.arange(F.size)
    after = h + 1 - 3 * (h % 3 == 2)
    # Half-edges of one edge follow each other; the corners at both ends of the edge are compared.
    key = edge_keys(halfedge_ends(F), int(F.max()) + 1)
    order = np.argsort(key, kind="stable")
    one, two = order[:-1], order[1:]
    same_edge = key[one] == key[two]
    one, two = one[same_edge], two[same_edge]
    turned = F.ravel()[one] != F.ravel()[two]
    pairs = np.concatenate(
        [
            np.stack([one, np.where(turned, after[two], two)]),
            np.stack([after[one], np.where(turned, two, after[two])]),
        ],
        axis=1,
    )
    joined = np.ones(pairs.shape[1], np.bool_)
    for values in at_corners:
        joined &= _data_agree(values.reshape(F.size, -1), *pairs)
    _, label = components(F.size, *pairs[:, joined])
    # New vertices in the order of the old ones.
    _, corner = np.unique(label, return_index=True)
    corner = corner[np.lexsort((corner, F.ravel()[corner]))]
    number = np.empty(len(corner), np.int64)
    number[label[corner]] = np.arange(len(corner))
    return corner, number[label].reshape(F.shape).astype(F.dtype)


def _data_agree(values: NDArray[Any], one: NDArray[Any], two: NDArray[Any]) -> NDArray[np.bool_]:
    if values.dtype.kind not in "fc":
        return np.asarray((values[one] == values[two]).all(axis=1))
    near = EQUAL_DATA * np.ptp(values) if np.isfinite(values).all() else 0.0
    with np.errstate(invalid="ignore"):
        is_near = abs(values[one] - values[two]) <= near
    return np.asarray(
        (is_near | ((values[one] != values[one]) & (values[two] != values[two]))).all(1)
    )


def _method(values: NDArray[Any]) -> str:
    """Choose how to transfer data: colours in bytes are interpolated, other integers are labels."""
    is_colour = values.dtype.kind == "u" and values.ndim == 2 and values.shape[1] in (3, 4)
    return "linear" if is_colour else "auto"


def _unit_rows(values: NDArray[Any]) -> NDArray[Any]:
    length = np.linalg.norm(values, axis=1, keepdims=True)
    return np.asarray(values / np.where(length > 0.0, length, 1.0), values.dtype)
