"""Pictures of a mesh before and after, with PyVista (the extra ``[viz]``).

`picture` renders to a file without a window, `show` opens a window. Both show the two meshes side by
side with one camera.
"""

from __future__ import annotations

import importlib
import io
import os
import sys
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..core import arguments
from ..core.check import as_array, as_indices, as_mesh
from ..core.vocabulary import FloatArray, IntArray
from ..errors import OptionError, RemeshvecError
from ..files.disk import check_writable, write_file

__all__ = [
    "PICTURE_SUFFIXES",
    "ViewerMissingError",
    "picture",
    "require_viewer",
    "show",
    "three_quarter_view",
]

Arrays = tuple[ArrayLike, ArrayLike]  # V (n, 3), F (m, 3)

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg")

BACKGROUND, FRONT, BACK, EDGE, TEXT = "white", "#d3e3f3", "#ecd5b8", "#1c2a3a", "#1c2a3a"
KEPT = "#c8102e"  # curves that stay
# Towards the eye, in half heights of the picture, so that faces do not hide the lines on them.
LIFT = 0.004
# The view is from the side that shows most, turned by a third of a right angle and slightly from above:
# this shows depth and hides hardly any of the silhouette.
TURN, ELEVATION = np.radians(28.0), np.radians(17.0)
# A surface lower than this share of its largest extent lies flat like a map and is seen from high above.
FLAT, FLAT_ELEVATION = 0.25, np.radians(50.0)
UP = {"y": np.eye(3), "z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])}  # x, up, front
VIEW_ANGLE = 20.0  # degrees; a long lens, so that near triangles hardly look larger
MARGIN = 1.06
TITLE_BAND = 0.04  # height of the titles, in widths of the picture
LOWEST, HIGHEST = 0.25, 0.6  # height of a picture without the titles, in widths
CLEAR_EDGE, FAINTEST = 11.0, 0.25  # pixel length of edges drawn fully opaque; least opacity


class ViewerMissingError(RemeshvecError, ImportError):
    """PyVista is not installed, or there is no display to open a window on."""


class Camera(NamedTuple):
    """Direction of view: unit vectors from the object to the eye, to the right, and up."""

    eye: FloatArray
    right: FloatArray
    up: FloatArray


class CameraFrame(NamedTuple):
    """The visible part of space: its middle, half width and half height, and the size in pixels."""

    middle: FloatArray
    half_width: float
    half_height: float
    pixels: tuple[int, int]


class PictureScene(NamedTuple):
    """Two meshes with their titles, the direction of view and the visible part of space."""

    meshes: tuple[tuple[FloatArray, IntArray], tuple[FloatArray, IntArray]]
    lines: tuple[IntArray, IntArray]  # (k, 2) edges of either that are drawn in red
    titles: tuple[str, str]
    camera: Camera
    frame: CameraFrame


def picture(
    path: str | os.PathLike[str],
    before: Arrays,
    after: Arrays,
    *,
    lines: tuple[ArrayLike | None, ArrayLike | None] = (None, None),
    titles: tuple[str, str] = ("before", "after"),
    width: int = 1600,
    up: str = "y",
) -> None:
    """Render two meshes side by side into a picture file, without a window.

    Parameters
    ----------
    path : str or path
        PNG or JPEG file; an existing file is replaced when the new one is complete.
    before, after : ((n, 3) float, (m, 3) int)
        Vertices and faces of the two meshes.
    lines : ((k, 2) int or None, (j, 2) int or None)
        Edges of the two meshes to draw in red, as vertices: ``(result.input_feature_edges,
        result.feature_edges)`` shows which curves were kept.
    titles : (str, str)
        Titles above the meshes, before their numbers of faces.
    width : int
        Width in pixels; the height follows from the shape of the object.
    up : {"y", "z"}
        Axis that points up: y in most models of figures, z in most models of buildings and machine parts.

    Raises
    ------
    ViewerMissingError
        PyVista is not installed.
    MeshFormatError
        The file cannot be written.
    MeshInputError
        The arrays cannot be triangle meshes.
    OptionError
        Another argument is invalid.
    """
    path = arguments.path(path, "path")
    scene = _picture_scene((before, after), lines, titles, width, up)
    pyvista = require_viewer()
    check_writable(path, PICTURE_SUFFIXES)
    from PIL import Image

    # VTK warns on stderr that there is no X server, then renders without one.
    with pyvista.vtk_verbosity("off"):
        plotter = _plotter(pyvista, scene, off_screen=True)
        try:
            image = plotter.screenshot(return_img=True)
        finally:
            plotter.close()
    content = io.BytesIO()
    form = "PNG" if os.fspath(path).lower().endswith(".png") else "JPEG"
    Image.fromarray(np.asarray(image)).save(content, form, optimize=True, quality=92)
    write_file(path, content.getvalue())


def show(
    before: Arrays,
    after: Arrays,
    *,
    lines: tuple[ArrayLike | None, ArrayLike | None] = (None, None),
    titles: tuple[str, str] = ("before", "after"),
    width: int = 1600,
    up: str = "y",
) -> None:
    """Open a window with two meshes side by side and linked cameras; return when it is closed.

    Parameters are those of `picture` except the path.

    Raises
    ------
    ViewerMissingError
        PyVista is not installed, or there is no display.
    MeshInputError
        The arrays cannot be triangle meshes.
    OptionError
        Another argument is invalid.
    """
    scene = _picture_scene((before, after), lines, titles, width, up)
    pyvista = require_viewer(window=True)
    _plotter(pyvista, scene, off_screen=False).show()


def require_viewer(*, window: bool = False) -> Any:
    """Import PyVista and return it; call this before long work for a picture.

    Parameters
    ----------
    window : bool
        Also check that there is a display, which a window needs.

    Raises
    ------
    ViewerMissingError
        PyVista is not installed, or there is no display.
    """
    window = arguments.flag(window, "window")
    try:
        pyvista = importlib.import_module("pyvista")
    except ImportError as error:
        raise ViewerMissingError(
            "pictures and the viewer need PyVista: pip install pyvista"
        ) from error
    has_display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if window and sys.platform.startswith("linux") and not has_display:
        raise ViewerMissingError("there is no display to open a window on; make a picture instead")
    return pyvista


def _picture_scene(
    given: tuple[Arrays, Arrays], lines: Any, titles: tuple[str, str], width: int, up: str
) -> PictureScene:
    """Check the arguments of a picture, and place the camera."""
    meshes = (_as_arrays(given[0], "before"), _as_arrays(given[1], "after"))
    if not isinstance(lines, tuple | list) or len(lines) != 2:
        raise OptionError(f"lines must be two arrays of edges; got {lines!r}")
    edges = (
        _as_edges(lines[0], len(meshes[0][0]), "lines[0]"),
        _as_edges(lines[1], len(meshes[1][0]), "lines[1]"),
    )
    axes = UP[arguments.choice(up, "up", UP)]
    width = arguments.count(width, "width")
    if not isinstance(titles, tuple | list) or len(titles) != 2:
        raise OptionError(f"titles must be two strings; got {titles!r}")
    names = (arguments.text(titles[0], "titles[0]"), arguments.text(titles[1], "titles[1]"))
    camera = three_quarter_view(*meshes[0], axes)
    frame = _frame(np.concatenate([V[F].reshape(-1, 3) for V, F in meshes]), camera, width)
    return PictureScene(meshes, edges, names, camera, frame)


def _plotter(pyvista: Any, scene: PictureScene, *, off_screen: bool) -> Any:
    """Build the scene: two meshes, one camera for both."""
    meshes, lines, titles, camera, frame = scene
    plotter = pyvista.Plotter(
        shape=(1, 2), border=False, window_size=list(frame.pixels), off_screen=off_screen
    )
    plotter.set_background(BACKGROUND)
    for k, ((V, F), edges, title) in enumerate(zip(meshes, lines, titles, strict=True)):
        plotter.subplot(0, k)
        # Graphics cards use float32: with scaled points, neither size nor position costs digits.
        points = (V - frame.middle) / frame.half_height
        surface = pyvista.PolyData.from_regular_faces(points, F)
        _add_surface(plotter, surface, _mean_edge(points, F) * frame.pixels[1] / 2)
        if len(edges):
            _add_lines(plotter, pyvista, points + LIFT * camera.eye, edges)
        _add_title(plotter, f"{title}: {len(F):,} faces", frame)
        _aim(plotter, camera)
    plotter.link_views()
    plotter.enable_anti_aliasing("ssaa")
    return plotter


def _add_surface(plotter: Any, surface: Any, edge_pixels: float) -> None:
    """Add flat-shaded faces with thin edges, fainter where they are too dense to tell apart."""
    plotter.add_mesh(
        surface,
        color=FRONT,
        backface_params={"color": BACK},
        smooth_shading=False,
        ambient=0.3,
        diffuse=0.8,
        specular=0.0,
        show_edges=True,
        edge_color=EDGE,
        line_width=float(np.clip(edge_pixels / 40, 1.0, 2.0)),
        edge_opacity=float(np.clip(edge_pixels / CLEAR_EDGE, FAINTEST, 1.0)),
    )


def _add_lines(plotter: Any, pyvista: Any, points: FloatArray, edges: IntArray) -> None:
    """Add edges in red."""
    pairs = np.column_stack([np.full(len(edges), 2), edges])
    curves = pyvista.PolyData(points, lines=pairs.ravel())
    plotter.add_mesh(curves, color=KEPT, line_width=3.0, lighting=False)


def _add_title(plotter: Any, text: str, frame: CameraFrame) -> None:
    width, height = frame.pixels
    title = plotter.add_text(text, position=(0.5, 1.0), viewport=True, color=TEXT)
    style = title.prop
    style.font_size = round(TITLE_BAND * width / 2)
    style.justification_horizontal, style.justification_vertical = "center", "top"
    title.position = (0.5, 1 - TITLE_BAND * width / height / 4)


def _aim(plotter: Any, camera: Camera) -> None:
    """Set the camera on the scaled scene; the picture shows heights from -1 to 1."""
    distance = 1 / np.tan(np.radians(VIEW_ANGLE / 2))
    plotter.camera.focal_point = (0.0, 0.0, 0.0)
    plotter.camera.position = tuple(camera.eye * distance)
    plotter.camera.up = tuple(camera.up)
    plotter.camera.view_angle = VIEW_ANGLE
    plotter.reset_camera_clipping_range()


def three_quarter_view(V: ArrayLike, F: ArrayLike, axes: ArrayLike) -> Camera:
    """Choose a three-quarter view of the side that shows most area.

    Parameters
    ----------
    V, F : (n, 3) float, (m, 3) int
        Vertices and faces.
    axes : (3, 3) float
        The rows are unit vectors: to the right of the object, up, and to its front.

    Returns
    -------
    Camera

    Raises
    ------
    MeshInputError
        The arrays cannot be a triangle mesh.
    OptionError
        ``axes`` is not a (3, 3) array of finite numbers.
    """
    V, F = as_mesh(V, F)
    axes = _as_axes(axes)
    normals = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]) @ axes.T
    angles = np.radians(sorted(range(-85, 90, 5), key=abs))  # half a circle, front first
    sides = np.stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)])
    shown = np.abs(normals @ sides).sum(axis=0)
    best = angles[np.flatnonzero(shown >= (1 - 1e-6) * shown.max())[0]]  # rounding breaks no ties
    extent = np.ptp(V[F].reshape(-1, 3) @ axes.T, axis=0)
    elevation = FLAT_ELEVATION if extent[1] < FLAT * extent.max() else ELEVATION
    turned = best - TURN if best > 0 else best + TURN  # towards the front
    level = np.array([np.sin(turned), 0.0, np.cos(turned)])
    right = np.array([np.cos(turned), 0.0, -np.sin(turned)])
    eye = np.cos(elevation) * level + np.sin(elevation) * np.array([0.0, 1.0, 0.0])
    return Camera(eye @ axes, right @ axes, np.cross(eye, right) @ axes)


def _as_axes(axes: ArrayLike) -> FloatArray:
    array = as_array(axes, "axes")
    if array.shape != (3, 3) or array.dtype.kind not in "fiu" or not np.isfinite(array).all():
        raise OptionError(
            "axes must be three rows of three finite numbers; "
            f"got shape {array.shape} of {array.dtype}"
        )
    return array.astype(np.float64)


def _frame(points: FloatArray, camera: Camera, width: int) -> CameraFrame:
    """Fit the picture to the points: both panels show all of them below the titles."""
    axes = np.stack([camera.right, camera.up, camera.eye])
    along = points @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    extent = high - low
    across, upwards, near = np.maximum(extent, 1e-6 * extent.max() or 1.0) / 2
    # Parts nearer than the middle look larger; they are nearer by at most half of the depth.
    zoom = MARGIN * (1 + near * np.tan(np.radians(VIEW_ANGLE / 2)) / max(across, upwards))
    object_height = width / 2 * np.clip(upwards / across, 2 * LOWEST, 2 * HIGHEST)
    height = object_height + TITLE_BAND * width
    unit = zoom * max(2 * upwards / object_height, 2 * across / (width / 2))  # of one pixel
    middle = (low + high) / 2
    middle[1] += TITLE_BAND * width * unit / 2  # the titles are above the object
    return CameraFrame(middle @ axes, unit * width / 4, unit * height / 2, (width, round(height)))


def _mean_edge(V: FloatArray, F: IntArray) -> float:
    return float(np.linalg.norm(V[F] - V[np.roll(F, 1, axis=1)], axis=2).mean())


def _as_edges(edges: ArrayLike | None, n: int, name: str) -> IntArray:
    """Check edges between ``n`` vertices; None for none."""
    array = np.empty((0, 2), np.int64) if edges is None else as_array(edges, name)
    if array.ndim != 2 or array.shape[1] != 2:
        raise OptionError(f"{name} must have shape (k, 2), two vertices a row; got {array.shape}")
    return np.stack([as_indices(array[:, i], n, f"{name}[:, {i}]", "vertex") for i in (0, 1)], 1)


def _as_arrays(mesh: Arrays, name: str) -> tuple[FloatArray, IntArray]:
    """Check vertices and faces; errors name the argument that holds them."""
    try:
        V, F = mesh[0], mesh[1]
    except (TypeError, LookupError):
        raise OptionError(
            f"{name} must be a pair of vertices and faces; got an object of type {type(mesh).__name__}"
        ) from None
    return as_mesh(V, F, (f"{name}[0]", f"{name}[1]"))
