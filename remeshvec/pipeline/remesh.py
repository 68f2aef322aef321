"""Isotropic remeshing [Botsch and Kobbelt 2004]: the public function."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeVar, overload

from numpy.typing import ArrayLike

from ..core.arguments import flag
from ..errors import OptionError
from ..input.options import RemeshKeywords, read_options, with_options
from ..interop.given import MeshObject, has_arrays, is_pair, whole_arrays
from ..output.result import RemeshResult
from ..output.transfer import in_kind_of, is_tensor, like, to_numpy
from .arrays import remesh_arrays
from .job import Lengths
from .objects import are_arrays, only_length, remesh_object

__all__ = ["remesh"]

M = TypeVar("M")

if TYPE_CHECKING:
    from typing import Unpack


@overload
def remesh(
    V: ArrayLike, F: ArrayLike, L: Lengths | None = None, **options: Unpack[RemeshKeywords]
) -> RemeshResult: ...


@overload
def remesh(
    V: M,
    F: Lengths | str | None = None,
    L: Lengths | str | None = None,
    *,
    return_result: Literal[True],
    **options: Unpack[RemeshKeywords],
) -> tuple[M, RemeshResult]: ...


@overload
def remesh(
    V: M,
    F: Lengths | str | None = None,
    L: Lengths | str | None = None,
    **options: Unpack[RemeshKeywords],
) -> M: ...


@with_options
def remesh(
    V: ArrayLike | MeshObject,
    F: ArrayLike | Lengths | None = None,
    L: Lengths | str | None = None,
    *,
    return_result: bool = False,
    **options: Any,
) -> RemeshResult | MeshObject:
    """Remesh a surface to well-shaped triangles with edges of length ``L``.

    Every sweep splits long edges, collapses short ones, flips edges towards valence 6 and relaxes
    vertices in their tangent planes; the last sweeps project vertices onto the input. Creases,
    boundaries and other curves keep their place: their vertices slide along them, their corners stay.
    The result is the same, bit for bit, on any number of threads.

    Options come in groups: how long edges become (``n_faces`` to ``max_deviation``), what to keep
    (``feature_angle`` to ``boundary``), how to remesh (``preset`` to ``fit``), and limits (``tol`` to
    ``callback``).

    Parameters
    ----------
    V : (n, 3) float or int, or a mesh
        Vertices; any array-like, never modified. Or a whole mesh, with ``L`` after it: a pair ``(V,
        F)``, an earlier result, a ``trimesh.Trimesh``, ``pyvista.PolyData``, ``meshio.Mesh`` or
        ``open3d.geometry.TriangleMesh``. Objects come back as objects of the same type, with colours,
        texture coordinates, fields and groups; seams of textures and borders of groups are kept.
        Tensors of PyTorch come back as tensors.
    F : (m, 3) int
        Triangles as 0-based indices; any array-like, never modified. Boundaries, several components,
        any genus, and edges with three or more faces are welcome: sheets share their vertices on such
        edges before and after. Degenerate, duplicate and unreferenced elements, inconsistent
        winding and pinched vertices are handled and listed in ``report.dirt``.
    L : float, (n,) array, callable or Adaptive, optional
        Target edge length in the units of ``V``: for all edges, at each input vertex, as a function of
        points (k, 3), or from the curvature. 0.9 times the mean edge length by default. For objects,
        this and the options that take data on faces may name data that the object carries.
    return_result : bool
        With a mesh object, return a pair of the new object and the `RemeshResult`.
    n_faces, n_vertices : int, optional
        Number of faces or vertices instead of ``L``. Vertices are met exactly, faces within one: a closed
        mesh has an even number. ``report.stop`` says where edges that must stay do not allow it.
    gradation : float
        Largest ratio of the target lengths at the ends of an edge, where ``L`` varies.
    max_deviation : float, optional
        Largest distance between input and result, both ways, in the units of ``V``. Edges become
        shorter than ``L`` where that needs it. See ``report.deviation`` for what was measured; a
        `RemeshWarning` says where the bound is not met.
    clearance : float or None
        Largest share of the gap between two sheets that face each other which chords may take. Near
        places where faces come to cross or to fold, edges that would take more become shorter than
        ``L``, by a factor of 4 at most. Where a closed surface of thin parts loses a tenth of its
        volume, they do everywhere, and edges there that turn by more than 40 degrees become creases
        (with ``feature_angle="auto"``). ``report.clearance`` says at how many vertices, and how much.
        Not with ``n_faces`` and ``n_vertices``. None: lengths stay as they are.
    feature_angle : "auto", float or None
        Which creases to keep. ``"auto"``: those that turn more than their surroundings at the scale of
        ``L``, so that a part keeps its edges and a scan does not freeze its noise. Degrees: all edges
        whose faces turn by more. None: no creases.
    corner_angle : float, optional
        Degrees by which a curve (a crease, boundary or border of labels) must turn, at the scale of
        ``L``, for a corner that stays. 50 by default, or ``feature_angle`` where that is a number. Ends
        and junctions of curves stay whatever their angle.
    feature_edges : (k, 2) int, optional
        Edges of the input, as vertices, to keep as creases.
    fixed_vertices : (k,) int, optional
        Input vertices that stay, bit for bit; ``vertex_map`` tells where they went.
    fixed_faces : (k,) int or (m,) bool, optional
        Input faces that stay, bit for bit; ``face_map`` tells where they went.
    face_labels : (m,) int, optional
        Borders between labels are kept as creases, and every new face gets its label.
    preserve : (m, 3, ...) or (m,) array, or a list of such arrays, optional
        Data on corners of faces, as texture coordinates are, or on faces. Edges across which they
        differ are kept as creases, so that no new face mixes two charts; `RemeshResult.transfer` brings
        them over. Numbers that differ by less than 1e-6 of their range count as equal.
    selection : (k,) int or (m,) bool, optional
        Input faces to remesh. All others stay, and come first in the result, in their order.
    boundary : {"free", "split", "fixed"}
        ``"free"``: boundary vertices slide along the boundary of the input, corners stay. ``"split"``:
        boundary vertices of the input stay, long edges between them are split. ``"fixed"``: boundary
        edges stay.
    preset : {"default", "even", "fast", "fine"}
        ``"default"``: eight sweeps with loosening thresholds, then twenty rounds that move vertices to
        the centroids of their cells; vertices on the input. ``"even"``: up to five hundred rounds,
        until the areas settle, as even as can be. ``"fast"``: the published algorithm, five sweeps.
        ``"fine"``: sixteen sweeps, twenty rounds, and the fit.
    iterations : int, optional
        Sweeps at most; threshold schedules are stretched over them.
    split, collapse : float or sequence of float, optional
        Edges longer than ``split * L`` are split, shorter than ``collapse * L`` collapsed; a sequence
        gives one factor a sweep. 4/3 and 4/5 in the paper.
    foldover : float, optional
        Degrees that a face normal may turn in a collapse; 20 by default.
    sliver_check : bool, optional
        Refuse collapses and flips that make the worst triangle around them worse. Off by default: it
        keeps bad input bad.
    project : bool, optional
        Whether vertices end on the input surface; True by default. ``False`` is the algorithm as
        published, which lets them drift.
    untangle_angle : float, optional
        Degrees; triangles with a smaller angle are improved at the end. 43.8 by default; the preset
        ``"fast"`` does so only if asked.
    fit : bool, optional
        Let vertices leave the input by up to 0.2 L so that faces straddle it: less RMS
        distance. On in ``"fine"``.
    avoid_intersections : bool
        Hold the mesh where faces would come to cross others. ``report.stop`` says where this was not
        enough; parts that touch in the input may still cross by rounding. Such calls take many times
        as long.
    tol : float, optional
        Stop after a sweep that changed less than this share of the edges and moved vertices by less
        than ``tol * L`` (root mean square). By default all sweeps are run.
    max_faces : int
        An ``L`` that would give more faces than this is refused: before any work where the area says
        so, else before the splits that lead too far, or at the end. At most 357,913,941, which is what
        32-bit indices hold.
    threads : int, optional
        Threads to use at most; all by default. Meshes below 50,000 faces use one.
    callback : callable, optional
        Called as ``callback(sweep, phase, count)`` after each phase, and as phase ``"even out"`` in the
        rounds after the last sweep; returning False (Python's or NumPy's; not None or 0) ends the call
        with the mesh as it is then.

    Returns
    -------
    RemeshResult
        Unpacks as ``V2, F2``; holds births, labels, features, maps and a report too, and transfers
        data. For a mesh object an object of its type.

    Raises
    ------
    MeshInputError
        The arrays cannot be a triangle mesh.
    OptionError
        An option cannot work.

    Warns
    -----
    RemeshWarning
        The result does not keep ``max_deviation``.

    References
    ----------
    Botsch and Kobbelt, A Remeshing Approach to Multiresolution Modeling, SGP 2004, section 4.
    """
    wanted = read_options("remesh", options)
    with_result = flag(return_result, "return_result")
    mesh: Any = V
    if is_pair(mesh) or has_arrays(mesh):
        (V, F), L = whole_arrays(mesh), only_length(F, L)
    elif not are_arrays(V, F):
        new, result = remesh_object(mesh, only_length(F, L), wanted)
        return (new, result) if with_result else new
    if with_result:
        raise OptionError("return_result goes with mesh objects; arrays give the result anyway")
    given = V, F
    V, F = (to_numpy(x) if is_tensor(x) else x for x in given)
    result = remesh_arrays(V, F, L, wanted)
    if any(map(is_tensor, given)):
        result.V, result.F = (like(x, y) for x, y in zip(given, result, strict=True))
        mesh = result.V, result.F
        result.lengths = in_kind_of(mesh, result.lengths)
        if result.face_labels is not None:
            result.face_labels = in_kind_of(mesh, result.face_labels)
    return result
