"""What stays: creases, drawn curves, vertices, faces, borders of labels and of the surface."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from benchmarks.meshes import load_arrays
from benchmarks.panels import (
    FloatArray,
    IntArray,
    Panel,
    Picture,
    borders,
    by_amount,
    by_label,
    kept_faces,
)
from data.shapes.drawn import flag, notched_sheet, tiles
from remeshvec import remesh

from .scene import BRACKET, CREATURE, SHEET, panel, side_by_side


def feature_angle() -> Picture:
    """Creases of a part, found or not."""
    V, F = load_arrays("bracket")
    panels = [
        panel(f"feature_angle={angle!r}", remesh(V, F, 4.0, feature_angle=angle))
        for angle in ("auto", None)
    ]
    return side_by_side(panels, BRACKET)


def corner_angle() -> Picture:
    """Corners of a hexagon, which turn by 60 degrees, and of a square, 90."""
    V, F, labels = tiles()
    panels = []
    for angle in (None, 75.0, 180.0):
        result = remesh(V, F, 0.14, face_labels=labels, corner_angle=angle)
        colours = by_label(result.face_labels)
        caption = f"corner_angle={angle}"
        panels.append(panel(caption, result, colours, dots=result.corners))
    return side_by_side(panels, SHEET, 3)


def feature_edges() -> Picture:
    """Keep a path drawn on the surface."""
    V, F = load_arrays("wavy_sheet")
    start, end = (np.linalg.norm(V[:, :2] - P, axis=1).argmin() for P in ([0.6, 0.5], [6.4, 3.4]))
    path = shortest_path(V, F, int(start), int(end))
    result = remesh(V, F, 0.25, feature_edges=path)
    panels = [
        Panel("feature_edges on the input", V, F, lines=path),
        panel("feature_edges=path", result),
    ]
    return side_by_side(panels, SHEET)


def fixed_vertices() -> Picture:
    """Vertices that keep their places."""
    V, F = load_arrays("wavy_sheet")
    turn = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    places = np.column_stack([3.5 + 1.8 * np.cos(turn), 0.8 + 0.6 * np.sin(turn)])
    chosen = np.unique([np.linalg.norm(V[:, :2] - P, axis=1).argmin() for P in places])
    result = remesh(V, F, 0.25, fixed_vertices=chosen)
    panels = [
        Panel("fixed_vertices on the input", V, F, dots=chosen),
        panel("result.vertex_map[fixed_vertices]", result, dots=result.vertex_map[chosen]),
    ]
    return side_by_side(panels, SHEET)


def fixed_faces() -> Picture:
    """Faces that stay as they are."""
    V, F = load_arrays("creature")
    middles = V[F].mean(axis=1)
    chosen = middles[:, 2] < 0.35
    result = remesh(V, F, 0.1, fixed_faces=chosen)
    stayed = kept_faces(result, chosen)
    panels = [
        Panel("fixed_faces on the input", V, F, by_label(np.where(chosen, 1, -1))),
        panel("result.face_map[fixed_faces]", result, by_label(np.where(stayed, 1, -1))),
    ]
    return side_by_side(panels, CREATURE)


def face_labels() -> Picture:
    """Borders of labels."""
    V, F, given = flag()
    panels = []
    for labels in (None, given):
        result = remesh(V, F, 0.14, face_labels=labels)
        if labels is None:
            colours = by_label(given[result.birth_face[result.F].min(axis=1)])
            panels.append(panel("without: colours of the input bleed", result, colours))
        else:
            panels.append(panel("face_labels=labels", result, by_label(result.face_labels)))
    return side_by_side(panels, SHEET)


def preserve() -> Picture:
    """Keep the seams of texture coordinates; the stripe of a texture at every face's middle."""
    V, F, uv = torus()
    panels = []
    for given, caption in ((None, "preserve=None"), (uv, "preserve=uv")):
        result = remesh(V, F, 0.28, preserve=given)
        middles = result.transfer(uv, on="corners").mean(axis=1)
        panels.append(panel(caption, result, by_label((5 * middles[:, 0]).astype(int))))
    return side_by_side(panels, (75.0, 40.0))


def return_result() -> Picture:
    """Remesh an object of trimesh, which carries a field; the field in colour."""
    import trimesh

    V, F = load_arrays("creature")
    before = trimesh.Trimesh(V, F, process=False)
    before.vertex_attributes["field"] = np.cos(8 * V[:, 0]) ** 2
    after, result = remesh(before, 0.08, return_result=True)
    panels = []
    for name, it, lines in (("mesh", before, None), ("even", after, result.feature_edges)):
        vertices, faces = np.asarray(it.vertices), np.asarray(it.faces)
        field = it.vertex_attributes["field"][faces].mean(axis=1)
        caption = f"{name}.vertex_attributes['field']"
        panels.append(Panel(caption, vertices, faces, by_amount(field, 1.0), lines))
    return side_by_side(panels, CREATURE)


def torus(nu: int = 60, nv: int = 24) -> tuple[FloatArray, IntArray, FloatArray]:
    """Torus with texture coordinates (m, 3, 2) from 0 to 1 around it, that jump at two seams."""
    i, j = (k.ravel() for k in np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij"))
    corners = np.stack([[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]])
    places = np.concatenate([corners[[0, 1, 2]], corners[[0, 2, 3]]], axis=2).transpose(2, 0, 1)
    a, b = 2 * np.pi * i / nu, 2 * np.pi * j / nv
    r = 2.0 + 0.8 * np.cos(b)
    V = np.stack([r * np.cos(a), r * np.sin(a), 0.8 * np.sin(b)], axis=1)
    return V, places[..., 0] % nu * nv + places[..., 1] % nv, places / [nu, nv]


def selection() -> Picture:
    """Only a part is remeshed."""
    V, F = load_arrays("creature")
    middles = V[F].mean(axis=1)
    chosen = (middles[:, 0] > 0.38) & (middles[:, 2] > 0.85)
    result = remesh(V, F, 0.05, selection=chosen)
    is_new = ~kept_faces(result, ~chosen)
    panels = [
        Panel("selection on the input", V, F, by_label(np.where(chosen, 1, -1))),
        panel("selection=chosen", result, by_label(np.where(is_new, 1, -1))),
    ]
    return side_by_side(panels, CREATURE)


def boundary() -> Picture:
    """Show the three modes for the rim of an open surface."""
    V, F = notched_sheet()
    rim = borders(F)
    panels = [Panel("input", V, F, lines=rim, dots=np.unique(rim))]
    for mode in ("free", "split", "fixed"):
        result = remesh(V, F, 0.16, boundary=mode)
        panels.append(panel(f"boundary={mode!r}", result, dots=result.corners))
    return side_by_side(panels, (0.0, 62.0))._replace(width=740)


def shortest_path(V: FloatArray, F: IntArray, start: int, end: int) -> IntArray:
    """Edges (k, 2) of the shortest way along edges from one vertex to another."""
    i, j = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]).T
    weights = coo_array((np.linalg.norm(V[i] - V[j], axis=1), (i, j)), (len(V), len(V))).tocsr()
    before = dijkstra(weights, directed=False, indices=start, return_predecessors=True)[1]
    way = [end]
    while way[-1] != start:
        way.append(int(before[way[-1]]))
    return np.column_stack([way[:-1], way[1:]])


PICTURES = (
    feature_angle, corner_angle, feature_edges, fixed_vertices, fixed_faces, face_labels, preserve,
    selection, boundary, return_result,
)  # fmt: skip
