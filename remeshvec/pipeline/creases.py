"""Which edges of a mesh a call would keep, found without remeshing it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.arguments import flag
from ..core.check import as_mesh
from ..core.compiler import compile_notice
from ..core.stopwatch import Stopwatch
from ..core.threads import thread_scope
from ..core.vocabulary import NONE, IntArray
from ..input.constraints import make_constraints
from ..input.options import RemeshKeywords, RemeshOptions, read_options, with_options
from ..input.prepare import prepare
from ..input.recipe import make_recipe
from ..interop.given import MeshObject, has_arrays, is_pair, whole_arrays
from ..interop.objects import read_object
from ..output.input_edges import input_numbers, vertices_of_edges
from ..output.transfer import is_tensor, to_numpy
from ..sweeps.monitor import Monitor
from ..sweeps.work import is_large
from .arrays import read_sizing
from .job import Job, Lengths
from .objects import are_arrays, only_length, with_named_data

__all__ = ["find_creases"]

if TYPE_CHECKING:
    from typing import Unpack


@overload
def find_creases(
    V: ArrayLike | MeshObject,
    F: Any = None,
    L: Lengths | str | None = None,
    *,
    return_dropped: Literal[False] = False,
    **options: Unpack[RemeshKeywords],
) -> IntArray: ...


@overload
def find_creases(
    V: ArrayLike | MeshObject,
    F: Any = None,
    L: Lengths | str | None = None,
    *,
    return_dropped: Literal[True],
    **options: Unpack[RemeshKeywords],
) -> tuple[IntArray, dict[str, IntArray]]: ...


@with_options
def find_creases(
    V: ArrayLike | MeshObject,
    F: Any = None,
    L: Lengths | str | None = None,
    *,
    return_dropped: bool = False,
    **options: Any,
) -> IntArray | tuple[IntArray, dict[str, IntArray]]:
    """Find the edges that `remesh` would keep as creases, without remeshing.

    Look at them, add some or take some away, and pass them on: ``remesh(V, F, L, feature_angle=None,
    feature_edges=edges)`` keeps exactly these.

    Parameters
    ----------
    V : (n, 3) float or int, or a mesh
        Vertices; any array-like. Or a whole mesh as for `remesh`, with ``L`` after it.
    F : (m, 3) int
        Triangles as 0-based indices.
    L : float, (n,) array, callable or Adaptive, optional
        Target edge length as for `remesh`: what is a crease depends on it.
    return_dropped : bool
        Also return the edges that turn by 25 degrees or more but are none.
    **options
        Options of `remesh`. Those that say what to keep matter, and ``n_faces`` and ``n_vertices``,
        which stand for the length that the area gives.

    Returns
    -------
    edges : (k, 2) int64
        Vertices of the input, the smaller first, in ascending order: creases, edges asked for by
        ``feature_edges``, borders of labels, and jumps of data in ``preserve``. The boundary is not
        among them, it is kept anyway.
    dropped : dict of (j, 2) int64
        With ``return_dropped``, and only for ``feature_angle="auto"``: edges by the reason why they are
        no creases. ``"noise"``: they do not stand out of the noise around them. ``"echo"``: the turn
        repeats beside them, as on a cylinder or a fillet. ``"terrace"``: steps of voxels. ``"short"``:
        their chain is too short or unsure. ``"crowded"``: a surer crease meets them at an acute angle.

    Raises
    ------
    MeshInputError
        The arrays cannot be a triangle mesh.
    OptionError
        An option cannot work.

    Examples
    --------
    >>> edges = find_creases(V, F, L)  # doctest: +SKIP
    >>> edges = edges[V[edges].mean(axis=1)[:, 2] > 0]  # doctest: +SKIP
    >>> V2, F2 = remesh(V, F, L, feature_angle=None, feature_edges=edges)  # doctest: +SKIP
    """
    wanted = read_options("find_creases", options)
    with_dropped = flag(return_dropped, "return_dropped")
    V, F, L, wanted = _with_arrays(V, F, L, wanted)
    recipe = make_recipe(wanted)
    sizing, count = read_sizing(L, wanted)
    vertices, faces = as_mesh(_as_array(V), _as_array(F))
    constraints = make_constraints(len(vertices), faces, wanted)
    with compile_notice(), thread_scope(recipe.threads) as may_run_parallel:
        find_kept = partial(constraints.kept, len(vertices))
        prepared = prepare(vertices, faces, may_run_parallel and is_large(len(faces)), find_kept)
        monitor = Monitor(Stopwatch(), None)
        job = Job(prepared, constraints, vertices, sizing, recipe, monitor, may_run_parallel)
        creases = job.find_creases(None if count is None else job.first_length(*count))
    origin, twin = prepared.mesh.origin, prepared.mesh.twin
    numbers = input_numbers(prepared, faces)

    def edges_of(h: NDArray[Any]) -> IntArray:
        return vertices_of_edges(origin, np.unique(np.minimum(h, twin[h])), numbers)

    edges = edges_of(np.flatnonzero(creases.is_feature & (twin != NONE)))
    if not with_dropped:
        return edges
    return edges, {name: edges_of(h) for name, h in creases.dropped.items()}


def _with_arrays(
    V: Any, F: Any, L: Any, wanted: RemeshOptions
) -> tuple[Any, Any, Any, RemeshOptions]:
    """Return the arrays of a mesh, the length, and the options with the data that they name."""
    if is_pair(V) or has_arrays(V):
        return *whole_arrays(V), only_length(F, L), wanted
    if are_arrays(V, F):
        return V, F, L, wanted
    data = read_object(V)
    return data.V, data.F, *with_named_data(data, only_length(F, L), wanted)


def _as_array(given: Any) -> Any:
    return to_numpy(given) if is_tensor(given) else given
