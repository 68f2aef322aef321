"""Data of the 3D views of the HTML page: compact arrays, colours of faces, and the first camera."""

from __future__ import annotations

import base64
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.vocabulary import EQUILATERAL_AREA, FloatArray, IntArray
from ..measures.quality import Elements
from ..measures.record import Quality
from ..viz.pictures import UP, Camera, three_quarter_view

__all__ = ["COLOURINGS", "MOST_EDGED", "MOST_FACES", "Views", "build_views"]


# At these limits Chromium takes 4 to 7 seconds to draw a page on two cores without a graphics card, and
# the page has 16 MB.
MOST_FACES = 200_000  # of a mesh shown as a whole
MOST_EDGED = 50_000  # faces drawn with edges, and faces shown of a larger mesh

# Red to blue [ColorBrewer, RdYlBu] and brown to green [BrBG]: safe for the colour-blind.
_SHAPE_COLOURS = ("#7d0a1e", "#c8282c", "#ee6a43", "#fbb165", "#fdebb0", "#cfe6f0", "#8dbfdd")
_AREA_COLOURS = ("#7a4a0c", "#c9964a", "#f0dcae", "#f4f4f2", "#b9e2da", "#4fa99c", "#0a5c54")

COLOURINGS: tuple[dict[str, Any], ...] = (
    {
        "key": "shape",
        "name": "shape",
        "title": "2 × inradius / circumradius: 1 is equilateral, 0 means no area",
        "colours": _SHAPE_COLOURS,
        "ticks": ("0", "0.25", "0.5", "0.75", "1"),
    },
    {
        "key": "angle",
        "name": "smallest angle",
        "title": "smallest angle of the triangle; 60° is equilateral",
        "colours": _SHAPE_COLOURS,
        "ticks": ("0°", "15°", "30°", "45°", "60°"),
    },
    {
        "key": "area",
        "name": "area",
        "title": "area relative to an equilateral triangle with edges L",
        "colours": _AREA_COLOURS,
        "ticks": ("¼ and less", "½", "1", "2", "4 and more"),
    },
)


class Views(NamedTuple):
    """The scene, with notes for the reader."""

    scene: dict[str, Any]  # JSON-ready
    notes: list[str]


def build_views(
    meshes: tuple[Elements, Elements],
    curves: tuple[IntArray, IntArray],
    qualities: tuple[Quality, Quality],
    length: float,
    up: str,
) -> Views:
    """Make the scene of two meshes under one camera.

    Parameters
    ----------
    meshes : (Elements, Elements)
        The meshes before and after.
    curves : ((k, 2) int, (j, 2) int)
        Their edges on creases and other curves, which are drawn in red.
    qualities : (Quality, Quality)
        Measures of the same meshes; the sign of the volume shows which side is outside.
    length : float
        The target length L, the unit of areas.
    up : {"y", "z"}
        Axis that points up.

    Returns
    -------
    Views
        Coordinates are float32, relative to the middle of the shown part and at most 1 from it, so that
        neither size nor position costs digits.
    """
    camera = three_quarter_view(meshes[0].V, meshes[0].F, UP[up])
    shown = _shown_faces(meshes, camera)
    corners = [
        mesh.V[mesh.F[kept]].reshape(-1, 3) for mesh, kept in zip(meshes, shown, strict=True)
    ]
    middle = _middle(np.concatenate(corners))
    reach = max(float(np.linalg.norm(P - middle, axis=1).max(initial=0)) for P in corners) or 1.0
    faces = max(map(len, shown))
    scene = {
        "meshes": [
            {
                **_mesh(mesh, kept, middle, reach, length),
                "curves": _shown_curves(edges, mesh.F[kept]),
                "sides": _sides(quality),
            }
            for mesh, edges, kept, quality in zip(meshes, curves, shown, qualities, strict=True)
        ],
        "camera": {
            "eye": camera.eye.tolist(),
            "right": camera.right.tolist(),
            "up": camera.up.tolist(),
        },
        "edges": faces <= MOST_EDGED,
        "colourings": COLOURINGS,
    }
    return Views(scene, _notes(meshes, shown, faces <= MOST_EDGED))


def _shown_faces(meshes: tuple[Elements, Elements], camera: Camera) -> list[IntArray]:
    """Choose the faces to show: all, or those around the point nearest to the eye."""
    if max(len(mesh.F) for mesh in meshes) <= MOST_FACES:
        return [np.arange(len(mesh.F)) for mesh in meshes]
    first = meshes[0].V[meshes[0].F].mean(axis=1)
    near = first[np.argmax(first @ camera.eye)]
    distances = [np.linalg.norm(mesh.V[mesh.F].mean(axis=1) - near, axis=1) for mesh in meshes]
    radius = min(np.sort(d)[MOST_EDGED] for d in distances if len(d) > MOST_EDGED)
    return [np.flatnonzero(d < radius) for d in distances]


def _middle(points: FloatArray) -> FloatArray:
    return (points.min(axis=0) + points.max(axis=0)) / 2 if len(points) else np.zeros(3)


def _mesh(
    mesh: Elements, kept: IntArray, middle: FloatArray, reach: float, length: float
) -> dict[str, Any]:
    """Return one mesh in base64: coordinates, indices, and one byte per face for each colouring."""
    used, F = np.unique(mesh.F[kept], return_inverse=True)
    with np.errstate(divide="ignore"):  # a face without area gets the smallest level
        doublings = np.log2(mesh.areas[kept] / (EQUILATERAL_AREA * length**2))
    levels = {
        "shape": mesh.radius_ratios[kept],
        "angle": mesh.angles[kept].min(axis=1, initial=60.0) / 60,
        "area": (doublings + 2) / 4,
    }
    return {
        "vertices": _packed((mesh.V[used] - middle) / reach, "<f4"),
        "faces": _packed(F, "<u4"),
        "levels": {
            name: _packed(np.rint(255 * np.clip(level, 0, 1)), "u1")
            for name, level in levels.items()
        },
    }


def _shown_curves(edges: IntArray, F: IntArray) -> str:
    """Return the edges whose ends are shown, in the numbers of `_mesh`."""
    used = np.unique(F)
    place = np.minimum(np.searchsorted(used, edges), max(len(used) - 1, 0))
    is_shown = (used[place] == edges).all(axis=1) if len(used) else np.zeros(len(edges), np.bool_)
    return _packed(place[is_shown], "<u4")


def _sides(quality: Quality) -> list[int]:
    """Return the sides on which edges are drawn: 1 for the side of the normals, -1 for the other."""
    if quality.volume is None:
        return [1, -1]
    return [1] if quality.volume >= 0 else [-1]


def _packed(array: NDArray[Any], dtype: str) -> str:
    return base64.b64encode(np.ascontiguousarray(array.astype(dtype)).tobytes()).decode("ascii")


def _notes(meshes: tuple[Elements, Elements], shown: list[IntArray], with_edges: bool) -> list[str]:
    notes = []
    if any(len(kept) < len(mesh.F) for mesh, kept in zip(meshes, shown, strict=True)):
        notes.append(
            f"The views show a part of the surface, {len(shown[0]):,} faces before and "
            f"{len(shown[1]):,} after, so that browsers can turn it; all numbers and histograms refer to "
            "the whole surface."
        )
    if not with_edges:
        notes.append(f"Edges are left out because more than {MOST_EDGED:,} faces are shown.")
    return notes
