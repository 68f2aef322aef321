"""`repair`: join, orient, part, drop and close, one after the other."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..core.arguments import count, flag, number
from ..core.check import as_mesh
from ..core.vocabulary import FloatArray, IntArray
from ..errors import MeshInputError
from ..interop.given import MeshObject, takes_meshes
from ..mesh.edges import components, halfedge_ends
from ..mesh.orient import orient_faces
from ..mesh.repair import drop_degenerate_faces, drop_duplicate_faces
from ..mesh.singles import match
from .holes import fill_loops
from .outward import turn_outwards
from .report import RepairReport, RepairResult
from .weld import weld_boundary

__all__ = ["repair"]


@takes_meshes
def repair(
    V: ArrayLike | MeshObject,
    F: Any = None,
    *,
    weld: float | None = 0.0,
    min_component: int = 0,
    keep_largest: bool = False,
    fill_holes: int | Literal["all"] = 0,
    orient: bool = True,
) -> RepairResult:
    """Make a raw surface clean: joined, oriented, manifold, without crumbs and holes.

    The steps, in this order: boundary vertices are welded; faces that name a vertex twice, and copies of
    others, go; faces are turned to the winding of their neighbours; edges and vertices that are not
    manifold are parted into sheets, so that closed parts that touch stay closed; small components go;
    holes are closed; closed components are turned outwards; unused vertices go. No vertex moves, and
    handles stay: `denoise` and `remesh` come next.

    Parameters
    ----------
    V : (n, 3) float
    F : (m, 3) int
    weld : float, optional
        Boundary vertices up to this distance apart, in units of V, become one: the first of them. 0 by
        default: those in exactly one place. None welds nothing. Distances above the length of edges at
        the boundary collapse faces, which are removed and counted.
    min_component : int
        Components of fewer faces are removed.
    keep_largest : bool
        Keep the component of the largest area only.
    fill_holes : int or "all"
        Close boundary loops of up to so many edges. The new faces use the vertices of the loop alone, so
        that they bend as little as possible, and their edges are as short as that allows [Liepa 2003,
        section 3]; remeshing makes them even.
    orient : bool
        Whether faces may be turned. Closed components enclose positive volumes then; those inside the
        box of another one are turned as that one is, so that cavities stay cavities.

    Returns
    -------
    RepairResult
        ``V, F = repair(...)`` works; ``report`` has what was done. The same input gives the same bits.

    Raises
    ------
    MeshInputError
        V and F are not a mesh, or nothing is left of it.
    OptionError
        An option is invalid.
    """
    surface = _Surface(*as_mesh(V, F))
    reach = None if weld is None else number(weld, "weld", low=0.0, unit="units of V")
    least = count(min_component, "min_component", low=0)
    only_largest = flag(keep_largest, "keep_largest")
    longest = _longest_loop(fill_holes)
    may_turn = flag(orient, "orient")
    surface.drop_degenerate()
    if reach is not None:
        surface.weld(reach)
        surface.drop_degenerate()
    surface.drop_duplicates()
    if may_turn:
        surface.orient()
    surface.part()
    surface.drop_components(least, only_largest)
    surface.fill(longest)
    if may_turn:
        surface.turn()
    return surface.result()


def _longest_loop(fill_holes: Any) -> int:
    if isinstance(fill_holes, str) and fill_holes == "all":
        return int(np.iinfo(np.int64).max)
    return count(fill_holes, 'fill_holes (or "all")', low=0)


class _Surface:
    """The surface between the steps, with what was done so far."""

    def __init__(self, V: FloatArray, F: IntArray) -> None:
        self.V_in = V
        self.F = F
        self.vertex_source: IntArray = np.arange(len(V))
        self.corner_source: IntArray = np.arange(F.size).reshape(-1, 3)
        self.done: dict[str, int] = {}

    @property
    def V(self) -> FloatArray:
        return self.V_in[self.vertex_source]

    def weld(self, reach: float) -> None:
        representative = weld_boundary(self.V_in, self.F, reach)
        self.done["welded_vertices"] = int((representative != self.vertex_source).sum())
        self.F = representative[self.F]

    def drop_degenerate(self) -> None:
        self._drop("degenerate_faces", drop_degenerate_faces(self.F.astype(np.int32)))

    def drop_duplicates(self) -> None:
        self._drop("duplicate_faces", drop_duplicate_faces(self.F.astype(np.int32)))

    def orient(self) -> None:
        turned, flipped = orient_faces(self.F.astype(np.int32), len(self.V_in))
        self.F = turned.astype(np.int64)
        self.corner_source[flipped] = self.corner_source[flipped][:, [0, 2, 1]]
        self.done["flipped_faces"] = int(flipped.sum())

    def part(self) -> None:
        """Give sheets that meet in non-manifold edges and vertices vertices of their own."""
        import igl

        found = match(self.F, len(self.vertex_source)).found
        if not (found.non_manifold_edges or found.inconsistent_edges or found.pinched_vertices):
            return
        used = np.unique(self.F)
        F, source = igl.split_nonmanifold(self.F)
        # libigl numbers the vertices anew; the first copy of each keeps the old number, so that
        # nothing but copies is added.
        first = np.unique(source, return_index=True)[1]
        number = np.empty(len(source), np.int64)
        copies = np.setdiff1d(np.arange(len(source)), first)
        number[first] = used
        number[copies] = len(self.vertex_source) + np.arange(len(copies))
        self.F = number[F]
        self.vertex_source = np.concatenate([self.vertex_source, source[copies]])
        self.done["split_vertices"] = len(copies)

    def drop_components(self, least: int, only_largest: bool) -> None:
        if not (least or only_largest):
            return
        n, part = self._parts()
        size = np.bincount(part, minlength=n)
        kept = size >= least
        if only_largest:
            area = np.bincount(part, _double_areas(self.V, self.F), n)
            kept &= np.arange(n) == np.argmax(np.where(kept, area, -1.0))
        self.done["removed_components"] = int((~kept).sum())
        self.done["removed_faces"] = int(size[~kept].sum())
        if not kept.any():
            raise MeshInputError(
                f"min_component = {least} leaves nothing: the largest of {n} components has "
                f"{size.max()} faces"
            )
        self._keep(np.flatnonzero(kept[part]))

    def fill(self, longest: int) -> None:
        filled = fill_loops(self.V, self.F, longest)
        self.done["filled_holes"], self.done["holes_left"] = filled.closed, filled.left
        self.done["filling_faces"] = len(filled.F)
        self.F = np.concatenate([self.F, filled.F])
        self.corner_source = np.concatenate([self.corner_source, np.full_like(filled.F, -1)])

    def turn(self) -> None:
        n, part = self._parts()
        turned = turn_outwards(self.V, self.F, n, part)
        self.done["turned_components"] = int(turned.sum())
        inside_out = turned[part]
        self.F[inside_out] = self.F[inside_out][:, ::-1]
        self.corner_source[inside_out] = self.corner_source[inside_out][:, ::-1]

    def result(self) -> RepairResult:
        used = np.unique(self.F)
        self.done["unused_vertices"] = len(self.V_in) - len(np.unique(self.vertex_source[used]))
        self.done["unused_vertices"] -= self.done.get("welded_vertices", 0)
        number = np.zeros(len(self.vertex_source), np.int64)
        number[used] = np.arange(len(used))
        source = self.vertex_source[used]
        return RepairResult(
            self.V_in[source], number[self.F], source, self.corner_source, RepairReport(**self.done)
        )

    def _parts(self) -> tuple[int, IntArray]:
        """Count the components, and label the faces."""
        _, label = components(len(self.vertex_source), *halfedge_ends(self.F))
        names, part = np.unique(label[self.F[:, 0]], return_inverse=True)
        return len(names), part.reshape(-1)

    def _drop(self, name: str, kept: IntArray | None) -> None:
        """Keep some faces and count the others; None keeps all."""
        if kept is None:
            return
        self.done[name] = self.done.get(name, 0) + len(self.F) - len(kept)
        self._keep(kept)
        if not len(kept):
            raise MeshInputError(
                "no face has three different corners: there is no surface to repair; is weld, a distance "
                "in units of V, larger than the edges?"
            )

    def _keep(self, rows: IntArray) -> None:
        self.F, self.corner_source = self.F[rows], self.corner_source[rows]


def _double_areas(V: FloatArray, F: IntArray) -> FloatArray:
    a, b, c = (V[F[:, k]] for k in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1))
