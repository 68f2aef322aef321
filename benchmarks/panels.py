"""Panels side by side: meshes with edges, coloured faces, thick feature lines and dots at corners."""

from __future__ import annotations

import argparse
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from remeshvec.files.disk import write_file
from remeshvec.interop.mesh_data import split_vertices
from remeshvec.viz import pictures, require_viewer

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

WIDTH = 1400  # pixels of a picture
CAPTION, TEXT_SIZE = 60, 20  # pixels: height of the captions (two lines), size of their letters
LOWEST, HIGHEST = 0.45, 1.1  # height of a panel without its caption, in widths
OVERSAMPLING = 2  # rendered larger and scaled down: smooth lines of any width
MARGIN = 1.06
LINE, DOT = 3.0, 9.0  # pixels
LIFT = np.array([0.0, 0.0, 0.004])  # of lines and dots towards the eye, in half widths of a panel
COLOURS = 96  # in the palette of a PNG
LARGEST = 400_000  # bytes of a file

FACES = ("#d3e3f3", "#f6d3b3", "#cfe6c8", "#f0c9d6", "#f1e6b0", "#d8d0ee")  # by label
PLAIN, LOUD = "#e6e6e6", "#e0702f"  # faces left alone; the upper end of a scale
DOTS = "#c2185b"
KEPT = pictures.KEPT  # an ink for creases


class Panel(NamedTuple):
    """A mesh and what is drawn on it."""

    caption: str  # a second line says how many faces there are, and `note`, or how much larger
    V: FloatArray  # (n, 3)
    F: IntArray  # (m, 3)
    colours: NDArray[np.uint8] | None = None  # (m, 3) of every face
    lines: IntArray | None = None  # (k, 2) edges drawn thick
    dots: IntArray | None = None  # (k,) vertices
    note: str = ""
    ink: str = pictures.EDGE  # of the lines
    texture: tuple[FloatArray, NDArray[np.uint8]] | None = None  # (m, 3, 2) on corners; the image
    close_up: tuple[FloatArray, float] | None = (
        None  # middle of what is seen; how many times larger
    )


class Picture(NamedTuple):
    """Panels under one camera."""

    panels: list[Panel]
    view: tuple[float, float] = (30.0, 25.0)  # degrees: to the right of the front (-y), upwards
    columns: int = 3
    width: int = WIDTH  # pixels


class Frame(NamedTuple):
    """What the panels show, without perspective."""

    axes: FloatArray  # (3, 3): right, up, and to the eye
    middle: FloatArray  # (3,)
    half_width: float
    pixels: tuple[int, int]  # of one panel, without its caption


def draw(path: Path, picture: Picture, largest: int = LARGEST) -> None:
    """Render a picture into a PNG file with a palette, without a window.

    Raises
    ------
    SystemExit
        The file would be larger than ``largest`` bytes.
    """
    from PIL import Image, ImageDraw, ImageFont

    frame = _frame(picture)
    width, height = frame.pixels
    rows = -(-len(picture.panels) // picture.columns)
    page = Image.new(
        "RGB", (picture.columns * width, rows * (height + CAPTION)), pictures.BACKGROUND
    )
    pen = ImageDraw.Draw(page)
    font = ImageFont.load_default(size=TEXT_SIZE)
    for k, panel in enumerate(picture.panels):
        x, y = k % picture.columns * width, k // picture.columns * (height + CAPTION)
        page.paste(Image.fromarray(_render(panel, frame)).resize(frame.pixels), (x, y + CAPTION))
        text = f"{panel.caption}\n{_second_line(panel)}"
        place = (x + width / 2, y + CAPTION / 2)
        pen.multiline_text(place, text, pictures.TEXT, font, "mm", align="center")
    content = io.BytesIO()
    page.quantize(COLOURS, dither=Image.Dither.NONE).save(content, "PNG", optimize=True)
    if content.tell() > largest:
        raise SystemExit(f"{path.name}: {content.tell():,} bytes, more than {largest:,}")
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, content.getvalue())


def read_arguments(
    argv: Sequence[str] | None, prog: str, about: str | None, known: Iterable[str], folder: Path
) -> argparse.Namespace:
    """Read the names of pictures, each of which must be known, and the folder to write them to."""
    parser = argparse.ArgumentParser(prog=f"python -m {prog}", description=about)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(known))
    parser.add_argument("--output", type=Path, default=folder)
    arguments = parser.parse_args(argv)
    unknown = set(arguments.names) - set(known)
    if unknown:
        parser.error(f"no picture {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    return arguments


# --- colours -------------------------------------------------------------------------------------


def by_label(labels: Any) -> NDArray[np.uint8]:
    """Colour faces by small integers; -1 is `PLAIN`."""
    table = np.array([_rgb(name) for name in (*FACES, PLAIN)], np.uint8)
    return table[np.where(labels < 0, len(FACES), labels % len(FACES))]


def by_amount(amounts: FloatArray, largest: float) -> NDArray[np.uint8]:
    """Colour faces from white (0) to `LOUD`."""
    share = np.clip(amounts / largest, 0.0, 1.0)[:, None]
    return (255 + share * (np.array(_rgb(LOUD)) - 255.0)).astype(np.uint8)


def _rgb(name: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(name[1:]))


# --- what is on a mesh ---------------------------------------------------------------------------


def borders(F: IntArray, labels: NDArray[Any] | None = None) -> IntArray:
    """Return the edges (k, 2) that have not two faces, or two faces of different labels."""
    edges = np.sort(np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1)
    unique, index, uses = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    chosen = uses != 2
    if labels is not None:
        label = np.tile(labels, 3).astype(np.float64)
        total = np.bincount(index.ravel(), label, len(unique))
        squares = np.bincount(index.ravel(), label**2, len(unique))
        chosen |= total**2 != uses * squares  # equal only where all labels are
    return unique[chosen]


def kept_faces(result: Any, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the faces of a result that are chosen faces of the input, untouched."""
    kept = np.zeros(len(result.F), np.bool_)
    kept[result.face_map[chosen]] = True
    return kept


def face_distances(V: FloatArray, F: IntArray, result: Any) -> FloatArray:
    """Distance of every face from the input: at its middle or at that of an edge, the largest."""
    corners = result.V[result.F]
    points = [corners.mean(axis=1), *np.moveaxis(corners + np.roll(corners, 1, axis=1), 1, 0) / 2]
    return np.max([distances(P, V, F) for P in points], axis=0)


def distances(P: FloatArray, V: FloatArray, F: IntArray) -> FloatArray:
    """Distance of points from a mesh."""
    import igl

    return np.sqrt(igl.point_mesh_squared_distance(np.ascontiguousarray(P), V, F)[0])


def cut_open(panel: Panel, normal: FloatArray, level: float) -> Panel:
    """Take away the faces on the far side of a plane, to look inside."""
    kept = panel.V[panel.F].mean(axis=1) @ normal < level
    F = panel.F[kept]
    lines, dots = panel.lines, panel.dots
    if lines is not None:
        lines = lines[np.isin(lines, F).all(axis=1)]
    if dots is not None:
        dots = dots[np.isin(dots, F)]
    colours = None if panel.colours is None else panel.colours[kept]
    note = f"{panel.note} seen, {(~kept).sum():,} in front taken away"
    return panel._replace(F=F, colours=colours, lines=lines, dots=dots, note=note)


# --- rendering -----------------------------------------------------------------------------------


def _second_line(panel: Panel) -> str:
    if panel.close_up is not None:
        return f"{panel.close_up[1]:g} times larger"
    return f"{len(panel.F):,} faces{panel.note}"


def _frame(picture: Picture) -> Frame:
    """Fit the panels to all meshes."""
    turn, rise = np.radians(picture.view)
    front = np.array([np.sin(turn), -np.cos(turn), 0.0])
    right = np.array([np.cos(turn), np.sin(turn), 0.0])
    eye = np.cos(rise) * front + np.sin(rise) * np.array([0.0, 0.0, 1.0])
    axes = np.stack([right, np.cross(eye, right), eye])
    points = np.concatenate([p.V[np.unique(p.F)] for p in picture.panels if p.close_up is None])
    low, high = (points @ axes.T).min(axis=0), (points @ axes.T).max(axis=0)
    across, upwards = MARGIN * (high - low)[:2] / 2
    shape = float(np.clip(upwards / across, LOWEST, HIGHEST))
    width = picture.width // picture.columns
    pixels = (width, round(shape * width))
    return Frame(axes, (low + high) / 2 @ axes, max(across, upwards / shape), pixels)


def _render(panel: Panel, frame: Frame) -> NDArray[np.uint8]:
    pyvista = require_viewer()
    middle, half_width = frame.middle, frame.half_width
    if panel.close_up is not None:
        middle, half_width = panel.close_up[0], half_width / panel.close_up[1]
    points = (panel.V - middle) @ frame.axes.T / half_width
    size = [OVERSAMPLING * side for side in frame.pixels]
    with pyvista.vtk_verbosity("off"):  # VTK would warn that there is no X server
        plotter = pyvista.Plotter(off_screen=True, window_size=size)
        try:
            plotter.set_background(pictures.BACKGROUND)
            _add(plotter, pyvista, panel, points, size[0])
            plotter.camera.parallel_projection = True
            plotter.camera.parallel_scale = size[1] / size[0]
            plotter.camera.focal_point, plotter.camera.up = (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)
            plotter.camera.position = (0.0, 0.0, 10.0)
            plotter.reset_camera_clipping_range()
            return np.asarray(plotter.screenshot(return_img=True))
        finally:
            plotter.close()


def _add(plotter: Any, pyvista: Any, panel: Panel, points: FloatArray, width: int) -> None:
    """Add the faces, and lines and dots a little nearer to the eye; the x of `points` is -1 to 1."""
    edges = points[panel.F] - points[np.roll(panel.F, 1, axis=1)]
    pixels = float(np.median(np.linalg.norm(edges, axis=2))) * width / 2 / OVERSAMPLING
    surface = pyvista.PolyData.from_regular_faces(points, panel.F)
    colours: dict[str, Any] = {"color": pictures.FRONT, "backface_params": {"color": pictures.BACK}}
    if panel.colours is not None:
        colours = {"scalars": panel.colours, "rgb": True}
    if panel.texture is not None:
        corner, F = split_vertices(panel.F, [panel.texture[0]])
        surface = pyvista.PolyData.from_regular_faces(points[panel.F.ravel()[corner]], F)
        surface.active_texture_coordinates = panel.texture[0].reshape(-1, 2)[corner]
        colours = {"texture": pyvista.Texture(panel.texture[1])}
    plotter.add_mesh(
        surface,
        **colours,
        smooth_shading=False,
        ambient=0.35,
        diffuse=0.75,
        specular=0.0,
        show_edges=True,
        edge_color=pictures.EDGE,
        line_width=OVERSAMPLING * float(np.clip(pixels / 18, 0.5, 1.0)),
        edge_opacity=float(np.clip(pixels / pictures.CLEAR_EDGE, 0.3, 0.9)),
    )
    nearer = points + LIFT
    if panel.lines is not None and len(panel.lines):
        pairs = np.insert(panel.lines, 0, 2, axis=1).ravel()
        lines = pyvista.PolyData(nearer, lines=pairs)
        plotter.add_mesh(lines, color=panel.ink, line_width=OVERSAMPLING * LINE, lighting=False)
    if panel.dots is not None and len(panel.dots):
        dots = pyvista.PolyData(nearer[panel.dots] + LIFT)
        size = OVERSAMPLING * DOT
        plotter.add_mesh(dots, color=DOTS, point_size=size, render_points_as_spheres=True)
