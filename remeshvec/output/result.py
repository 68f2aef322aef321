"""What a call returns: the mesh, and what connects it with the input."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.arguments import choice
from ..core.lazy import Lazy, LazyRecipe
from ..core.shown import one_line
from ..core.vocabulary import FloatArray, IntArray
from ..errors import OptionError
from ..files.data_files import write_data
from ..files.disk import FilePath
from ..interop.mesh_data import MeshData
from .light import LightResult
from .records import Births
from .report import Report
from .transfer import (
    TRANSFER_METHODS,
    as_matrix,
    as_values,
    in_kind_of,
    interpolate,
    pick,
    to_numpy,
)

__all__ = ["RemeshResult"]

_PLACES = ("vertices", "faces", "corners")


@dataclass(repr=False, eq=False)
class RemeshResult:
    """A remeshed surface; unpacks as ``V, F = result``, and goes wherever a mesh goes.

    What few callers read is computed when it is first asked for. Until then a result holds the faces
    of the input and its own once more in memory. It keeps a copy of the input, so the caller may go on to
    change those arrays in place. Where V or F are tensors of PyTorch, everything else is a tensor too,
    on the same device, floating-point numbers in the dtype of V.

    Attributes
    ----------
    V : (n, 3)
        Vertices, in the dtype of the input (float64 for integers).
    F : (m, 3)
        Faces, in the dtype of the input.
    report : Report
    face_labels : (m,) int, or None
        Label of every face, where the input had labels.
    lengths : (n,) float64
        Target edge length at every vertex.
    """

    V: Any
    F: Any
    report: Report
    face_labels: NDArray[Any] | None
    lengths: FloatArray
    _births: Lazy[Births]
    _face_births: LazyRecipe[IntArray]
    _corner_births: LazyRecipe[Births]
    _images: LazyRecipe[Births]
    _vertex_map: Lazy[IntArray]
    _face_map: Lazy[IntArray]
    _feature_edges: Lazy[IntArray]
    _input_feature_edges: Lazy[IntArray]
    _corners: Lazy[IntArray]

    def __iter__(self) -> Iterator[NDArray[Any]]:
        return iter((self.V, self.F))

    def __repr__(self) -> str:
        return one_line("RemeshResult", f"{len(self.V):,} vertices", *self.report.facts())

    def _repr_html_(self) -> str:
        return self.report._repr_html_()

    def summary(self) -> str:
        """Return what happened, and the measures before and after, as a table to print."""
        return str(self.report)

    @property
    def vertices(self) -> Any:
        """The same as ``V``."""
        return self.V

    @property
    def faces(self) -> Any:
        """The same as ``F``."""
        return self.F

    def to_trimesh(self) -> Any:
        """Return a ``trimesh.Trimesh``, with ``face_labels`` as a face attribute if there are any.

        Raises
        ------
        OptionError
            trimesh is not installed.
        """
        mesh = _library("trimesh").Trimesh(to_numpy(self.V), to_numpy(self.F), process=False)
        mesh.face_attributes.update(self._labels())
        return mesh

    def to_pyvista(self) -> Any:
        """Return a ``pyvista.PolyData``, with ``face_labels`` as cell data if there are any.

        Raises
        ------
        OptionError
            PyVista is not installed.
        """
        mesh = _library("pyvista").PolyData.from_regular_faces(to_numpy(self.V), to_numpy(self.F))
        mesh.cell_data.update(self._labels())
        return mesh

    def save(self, path: FilePath) -> None:
        """Write the mesh to a file, with ``face_labels`` if there are any and the format holds them.

        Parameters
        ----------
        path : str or path
            The file; its suffix gives the format, as for `write_mesh`.

        Raises
        ------
        MeshFormatError
            The suffix is unknown, or the file cannot be written.
        OptionError
            ``path`` is not a path.
        """
        V = np.ascontiguousarray(to_numpy(self.V), np.float64)
        F = to_numpy(self.F).astype(np.int64)
        write_data(path, MeshData(V, F, on_faces=self._labels()))

    def _labels(self) -> dict[str, NDArray[Any]]:
        return {} if self.face_labels is None else {"face_labels": to_numpy(self.face_labels)}

    def show(self, *, title: str = "", up: str = "y") -> None:
        """Show a page with both meshes, histograms and measures (the extra ``[html]``).

        In a Jupyter notebook it appears below the cell, about 5 MB of output; elsewhere it opens in
        the browser, from a file in the folder for temporary files.

        Parameters
        ----------
        title : str
            Heading, such as the name of the mesh.
        up : {"y", "z"}
            Axis that points up in the first view.

        Raises
        ------
        PlotlyMissingError
            Plotly is not installed.
        OptionError
            `up` is no such axis.
        """
        from ..html_page import show_html

        show_html(self, title=title, up=up)

    def light(self) -> LightResult:
        """Return the arrays, labels and figures, without what connects them with the input.

        A pickled result also holds the last mesh and the reference, from which births, maps and transfers
        are made: about six times its arrays. This is what to send, to keep or to save.

        Returns
        -------
        LightResult
            Shares its arrays with this result. Quality and defects are measured now.
        """
        figures = json.loads(json.dumps(self.report.to_dict()))  # as a file would give them back
        return LightResult(to_numpy(self.V), to_numpy(self.F), self.face_labels, figures)

    # -- where things lie -------------------------------------------------------------------

    @property
    def birth_face(self) -> IntArray:
        """Input face on which each vertex lies, (n,)."""
        return self._as_given(self._births()[0])

    @property
    def birth_barycentric(self) -> FloatArray:
        """Where on its birth face each vertex lies, (n, 3).

        ``V = sum(birth_barycentric[:, i] * V_in[F_in[birth_face, i]])`` for vertices that lie on the
        input; otherwise that is the point of the input closest to the vertex, among those that a walk
        over the input sees where it ends within 0.05 L.
        """
        return self._as_given(self._births()[1])

    @property
    def face_birth(self) -> IntArray:
        """Input face closest to the centroid of each face, (m,), between the same creases."""
        return self._as_given(self._face_births())

    @property
    def corner_birth_face(self) -> IntArray:
        """Input face on which each corner of each face lies, (m, 3).

        Where `birth_face` names one side of a crease, seam or border, this names the side of the face.
        """
        return self._as_given(self._corner_births()[0])

    @property
    def corner_birth_barycentric(self) -> FloatArray:
        """Where on its birth face each corner of each face lies, (m, 3, 3)."""
        return self._as_given(self._corner_births()[1])

    @property
    def image_face(self) -> IntArray:
        """Output face closest to each input vertex, (n_in,); -1 for vertices that no face uses."""
        return self._as_given(self._images()[0])

    @property
    def image_barycentric(self) -> FloatArray:
        """Where on its image face each input vertex lies, (n_in, 3)."""
        return self._as_given(self._images()[1])

    @property
    def vertex_map(self) -> IntArray:
        """For every input vertex the output vertex that is the same, bit for bit; -1 for none."""
        return self._as_given(self._vertex_map())

    @property
    def face_map(self) -> IntArray:
        """For every input face that had to stay the output face; -1 for the others."""
        return self._as_given(self._face_map())

    @property
    def feature_edges(self) -> IntArray:
        """Edges on creases, boundaries, borders of labels, and where sheets meet, (k, 2)."""
        return self._as_given(self._feature_edges())

    @property
    def input_feature_edges(self) -> IntArray:
        """The same of the input: its edges that were kept, (k, 2), as vertices of the input."""
        return self._as_given(self._input_feature_edges())

    @property
    def corners(self) -> IntArray:
        """Vertices that did not move, (k,)."""
        return self._as_given(self._corners())

    # -- data -------------------------------------------------------------------------------

    def transfer(self, values: Any, on: str = "vertices", method: str = "auto") -> Any:
        """Bring data of the input to the result.

        Parameters
        ----------
        values : array or tensor
            One entry, of any shape, for every input vertex (n_in, ...), face (m_in, ...) or corner of a
            face (m_in, 3, ...) or (3 m_in, ...). With tensors of PyTorch, gradients flow back.
        on : {"vertices", "faces", "corners"}
            What the values belong to. Faces take the value of the input face on which their centroid
            lies, between the same creases and borders. Corners take that of their own side: values that
            jump at a crease or at a seam given as ``preserve=`` jump there afterwards.
        method : {"auto", "linear", "nearest"}
            How to find values inside input faces: linear in barycentric coordinates, or the value at
            the corner with the largest of them. ``"auto"``: linear for floating point numbers, nearest
            for all else. Whole numbers that are interpolated linearly (colours) are rounded.

        Returns
        -------
        (n, ...), (m, ...) or (m, 3, ...)
            In the dtype of ``values``.

        Raises
        ------
        OptionError
            The shape does not fit, or there is no such ``on`` or ``method``.
        """
        on = choice(on, "on", _PLACES)
        method = choice(method, "method", TRANSFER_METHODS)
        m = len(self._input_faces)
        if on == "faces":
            values = as_values(values, (m,), on)
            return pick(values, self._face_births())
        if on == "vertices":
            values = as_values(values, (self._n_in,), on)
            return interpolate(values, *self._vertex_weights(), method)
        values = as_values(values, (), on)
        is_flat = values.shape[:1] == (3 * m,) and values.shape[:2] != (m, 3)
        values = as_values(values, (3 * m,) if is_flat else (m, 3), on)
        flat = values.reshape(3 * m, *values.shape[1 if is_flat else 2 :])
        out = interpolate(flat, *self._corner_weights(), method)
        return out if is_flat else out.reshape(-1, 3, *out.shape[1:])

    def matrix(self, on: str = "vertices") -> Any:
        """Return the sparse matrix P with ``values_out = P @ values_in``.

        Parameters
        ----------
        on : {"vertices", "faces", "corners"}
            As in `transfer`; corners are numbered ``3 * face + corner``.

        Returns
        -------
        scipy.sparse.csr_array
            (n, n_in), (m, m_in) or (3 m, 3 m_in) float64; the rows sum to 1. For tensors of PyTorch a
            coalesced ``torch.sparse_coo_tensor`` in the dtype of V, on its device: gradients flow
            through ``P @ x``.
        """
        m = len(self._input_faces)
        if choice(on, "on", _PLACES) == "faces":
            births = self._face_births()
            return self._as_given(as_matrix(births[:, None], np.ones((len(births), 1)), m))
        if on == "vertices":
            return self._as_given(as_matrix(*self._vertex_weights(), self._n_in))
        return self._as_given(as_matrix(*self._corner_weights(), 3 * m))

    def transfer_back(self, values: Any, on: str = "vertices", method: str = "auto") -> Any:
        """Bring data of the result back to the vertices of the input.

        Parameters
        ----------
        values : (n, ...) or (m, ...) array or tensor
        on : {"vertices", "faces"}
            Whether the values belong to vertices or faces of the result.
        method : {"auto", "linear", "nearest"}
            As in `transfer`, at the point of the result closest to each input vertex.

        Returns
        -------
        (n_in, ...)
            NaN, or 0 for types without it, at vertices that no face uses.
        """
        on = choice(on, "on", ("vertices", "faces"))
        method = choice(method, "method", TRANSFER_METHODS)
        if on == "faces":
            return pick(as_values(values, (len(self.F),), on), self._images()[0])
        values = as_values(values, (len(self.V),), on)
        return interpolate(values, *self._image_weights(), method)

    def back_matrix(self) -> Any:
        """Return the sparse matrix (n_in, n) with ``transfer_back(x) = B @ x``; rows sum to 1 or 0.

        For tensors a sparse tensor, as `matrix`.
        """
        return self._as_given(as_matrix(*self._image_weights(), len(self.V)))

    @property
    def _input_faces(self) -> NDArray[Any]:
        return to_numpy(self.report.before[1])

    @property
    def _n_in(self) -> int:
        return len(to_numpy(self.report.before[0]))

    def _vertex_weights(self) -> tuple[IntArray, FloatArray]:
        face, weights = self._births()
        return self._input_faces[face].astype(np.int64), weights

    def _corner_weights(self) -> tuple[IntArray, FloatArray]:
        face, weights = self._corner_births()
        return 3 * face.reshape(-1, 1) + np.arange(3), weights.reshape(-1, 3)

    def _image_weights(self) -> tuple[IntArray, FloatArray]:
        face, weights = self._images()
        index = to_numpy(self.F)[face].astype(np.int64)
        index[face < 0] = -1
        return index, weights

    def _as_given(self, value: Any) -> Any:
        return in_kind_of((self.V, self.F), value)


def _library(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise OptionError(f"to_{name} needs {name}: pip install {name}") from None
