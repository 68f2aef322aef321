"""Pictures of what the controls do, one a feature, into ``docs/pictures``.

``python -m benchmarks.pictures [NAME ...] [--output FOLDER]``

Thick lines are the edges that had to stay (creases, borders of labels, boundaries), dots the vertices
that were held.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from data.shapes.drawn import double_bubble, flag, half_discs, notched_sheet
from remeshvec import Adaptive, remesh
from remeshvec.files.data_files import read_data

from . import creases, scan_scenes
from .films import catenoid, cube, rings, splitting
from .meshes import load_arrays
from .panels import (
    FloatArray,
    IntArray,
    Panel,
    Picture,
    borders,
    by_amount,
    by_label,
    cut_open,
    draw,
    face_distances,
    kept_faces,
    read_arguments,
)
from .scenes import bend, bump, smoothing, twist
from .tables import DOCS

DATA = Path(__file__).resolve().parents[1] / "data"


def main(argv: Sequence[str] | None = None) -> int:
    """Make the pictures asked for."""
    arguments = read_arguments(argv, "benchmarks.pictures", __doc__, PICTURES, DOCS / "pictures")
    for name in arguments.names or PICTURES:
        path = arguments.output / f"{name}.png"
        draw(path, PICTURES[name]())
        print(f"wrote {path} ({path.stat().st_size / 1000:.0f} KB)", file=sys.stderr)
    return 0


def features() -> Picture:
    """Creases of a CAD part, found or not."""
    V, F = load_arrays("bracket")
    panels = [Panel("input", V, F)]
    for angle in ("auto", None):
        result = remesh(V, F, 3.0, feature_angle=angle)
        panels.append(_panel(f"feature_angle={angle!r}", result))
    return Picture(panels, view=(35.0, 30.0))


def boundary() -> Picture:
    """The three modes for an open boundary."""
    V, F = notched_sheet()
    rim = borders(F)
    panels = [Panel("input", V, F, lines=rim, dots=np.unique(rim))]
    for mode in ("free", "split", "fixed"):
        result = remesh(V, F, 0.09, boundary=mode)
        panels.append(_panel(f"boundary={mode!r}", result))
    return Picture(panels, view=(0.0, 62.0), columns=2)


def adaptive() -> Picture:
    """Edge lengths that follow curvature."""
    V, F = load_arrays("creature")
    panels = [_panel("L=0.05", remesh(V, F, 0.05))]
    for tolerance in (0.01, 0.003):
        result = remesh(V, F, Adaptive(tolerance))
        panels.append(_panel(f"Adaptive({tolerance})", result))
    return Picture(panels, view=(20.0, 15.0))


def labels() -> Picture:
    """Borders of labels, straight and curved, on an open sheet."""
    V, F, given = flag()
    result = remesh(V, F, 0.1, face_labels=given)
    panels = [
        Panel("face_labels of the input", V, F, by_label(given), borders(F, given)),
        _panel("result.face_labels", result, by_label(result.face_labels)),
    ]
    return Picture(panels, view=(0.0, 50.0), columns=2)


def selection() -> Picture:
    """Only a part is remeshed."""
    V, F = load_arrays("creature")
    centres = V[F].mean(axis=1)
    chosen = (centres[:, 0] > 0.38) & (centres[:, 2] > 0.85)
    result = remesh(V, F, 0.03, selection=chosen)
    is_new = ~kept_faces(result, ~chosen)
    panels = [
        Panel("selection", V, F, by_label(np.where(chosen, 1, -1)), borders(F, chosen)),
        Panel("remeshed", *result, by_label(np.where(is_new, 1, -1)), borders(result.F, is_new)),
    ]
    return Picture(panels, view=(20.0, 15.0), columns=2)


def non_manifold() -> Picture:
    """Sheets that meet three at a line stay joined."""
    V, F = half_discs()
    panels = _films("three half-discs", V, F, 0.12)
    V, F = double_bubble()
    V = V * 0.85  # as large as the others in the picture
    front = np.array([0.25, -1.0, 0.35])
    cut = [cut_open(panel, front, 0.3) for panel in _films("double bubble", V, F, 0.13)]
    return Picture([*panels, *cut], view=(25.0, 25.0), columns=2)


def max_deviation() -> Picture:
    """Faces as large as asked for, but where these would leave the input."""
    V, F = load_arrays("creature")
    panels = []
    for bound in (None, 0.008):
        result = remesh(V, F, 0.16, max_deviation=bound)
        away = face_distances(V, F, result)
        note = f", at most {away.max():.3f} away from the input"
        colours = by_amount(away, 0.03)
        panels.append(_panel(f"L=0.16, max_deviation={bound}", result, colours, note=note))
    return Picture(panels, view=(20.0, 15.0), columns=2)


def thin_sheet() -> Picture:
    """Two sides a fifth of an edge apart."""
    V, F = load_arrays("thin_sheet")
    result = remesh(V, F, 0.08)
    near = (result.V * [1.0, -1.0, 0.0]).sum(axis=1).argmax()  # the corner at the right in front
    after = _panel("remeshed, L=0.08", result)
    corner = after._replace(caption="its rim", close_up=(result.V[near] + [-0.1, 0.2, 0.0], 5.0))
    return Picture([Panel("input", V, F), after, corner], view=(20.0, 25.0))


def texture() -> Picture:
    """A texture stays where it was, and its seam, at the right, a seam."""
    data, _ = read_data(DATA / "vase.obj")
    V, F, uv = data.V, data.F, data.on_corners["uv"]
    image = np.asarray(Image.open(DATA / "vase.png").convert("RGB"))
    result = remesh(V, F, 0.06, preserve=uv)
    seam = np.sort(result.feature_edges, axis=1)
    at_zero = (abs(result.V[seam][:, :, 1]) < 1e-3).all(axis=1) & (result.V[seam][:, 0, 0] > 0)
    panels = [
        Panel("input", V, F, texture=(uv, image)),
        Panel(
            "remesh(V, F, 0.06, preserve=uv)",
            result.V,
            result.F,
            lines=seam[at_zero],
            texture=(result.transfer(uv, on="corners"), image),
        ),
    ]
    return Picture(panels, view=(70.0, 20.0), columns=2, width=900)


# --- parts of pictures ---------------------------------------------------------------------------


def _panel(
    caption: str,
    result: Any,
    colours: Any = None,
    lines: IntArray | None = None,
    note: str = "",
) -> Panel:
    """Show a result with its feature edges (or the lines given) and its corners."""
    edges = result.feature_edges if lines is None else lines
    return Panel(caption, result.V, result.F, colours, edges, result.corners, note)


def _films(name: str, V: FloatArray, F: IntArray, length: float) -> list[Panel]:
    """Show films before and after, each patch in one colour."""
    result = remesh(V, F, length)
    given = _patches(F)
    found = _like(V, F, given, result)
    return [
        Panel(name, V, F, by_label(given), borders(F)),
        _panel(f"remeshed, L={length}", result, by_label(found)),
    ]


def _patches(F: IntArray) -> IntArray:
    """Number the parts that hang together across edges of two faces."""
    import igl

    return np.asarray(igl.extract_manifold_patches(F)[1], np.int64)


def _like(V: FloatArray, F: IntArray, given: IntArray, result: Any) -> IntArray:
    """Give the patches of a result the numbers of those of the input that most of their faces lie on."""
    import igl

    centres = result.V[result.F].mean(axis=1)
    nearest = given[igl.point_mesh_squared_distance(centres, V, F)[1]]
    found = _patches(result.F)
    votes = np.zeros((found.max() + 1, given.max() + 1), np.int64)
    np.add.at(votes, (found, nearest), 1)
    return votes.argmax(axis=1)[found]


PICTURES: dict[str, Callable[[], Picture]] = {
    function.__name__: function
    for function in (
        features,
        boundary,
        adaptive,
        labels,
        selection,
        non_manifold,
        max_deviation,
        thin_sheet,
        texture,
        bump,
        twist,
        bend,
        smoothing,
        cube,
        catenoid,
        rings,
        splitting,
        *creases.PICTURES,
        *scan_scenes.PICTURES,
    )
}


if __name__ == "__main__":
    sys.exit(main())
