"""Flags of the shell commands, in the groups that their help shows, and the words they take."""

from __future__ import annotations

import argparse
import math
from typing import get_args

from ..core.version import __version__
from ..core.vocabulary import DEFAULT_LENGTH_FACTOR
from ..input.options import CLEARANCE, Boundary, Preset

__all__ = [
    "add_constraints",
    "add_files_of_constraints",
    "add_remesh_options",
    "add_repair_options",
    "add_report_options",
    "add_size_options",
    "at_least_one",
    "positive_number",
]


def add_size_options(
    group: argparse._ArgumentGroup,
) -> argparse._MutuallyExclusiveGroup:
    """Add the flags; returns the group of those that exclude each other."""
    length = group.add_mutually_exclusive_group()
    length.add_argument("--length", type=positive_number, metavar="L", help="target edge length")
    length.add_argument(
        "--l-factor",
        type=positive_number,
        default=DEFAULT_LENGTH_FACTOR,
        metavar="X",
        help="target edge length as a multiple of the mean edge length (default %(default)s)",
    )
    length.add_argument(
        "--adaptive",
        type=positive_number,
        metavar="TOL",
        help="edge length from the curvature, so that faces stay within TOL of the surface",
    )
    length.add_argument("--n-faces", type=at_least_one, metavar="N", help="number of faces wanted")
    length.add_argument(
        "--n-vertices", type=at_least_one, metavar="N", help="number of vertices wanted"
    )
    group.add_argument(
        "--min-length", type=positive_number, metavar="L", help="shortest length for --adaptive"
    )
    group.add_argument(
        "--max-length", type=positive_number, metavar="L", help="longest length for --adaptive"
    )
    group.add_argument(
        "--gradation",
        type=positive_number,
        metavar="X",
        help="largest ratio of the lengths at the ends of an edge (default 1.5)",
    )
    group.add_argument(
        "--max-deviation",
        type=positive_number,
        metavar="D",
        help="largest distance between the input and the result",
    )
    group.add_argument(
        "--clearance",
        type=_positive_or_none,
        default=CLEARANCE,
        metavar="X",
        help="shorten edges where faces cross or fold and chords take more than this share of the gap to "
        "the next sheet (default %(default)s); none: nowhere",
    )
    return length


def add_constraints(group: argparse._ArgumentGroup) -> None:
    """Add the flags of what must stay."""
    group.add_argument(
        "--feature-angle",
        type=_angle_or_word,
        default="auto",
        metavar="DEG",
        help="keep edges that turn by more; auto: edges that stand out (default), none: no edges",
    )
    group.add_argument(
        "--corner-angle",
        type=positive_number,
        metavar="DEG",
        help="keep corners where an edge, border or boundary turns by more over L (default 50)",
    )
    group.add_argument(
        "--boundary",
        choices=get_args(Boundary),
        default="free",
        help="boundary vertices slide along it (free), stay with new ones between them (split), or "
        "stay as they are (fixed)",
    )


def add_files_of_constraints(group: argparse._ArgumentGroup) -> None:
    """Add the flags that name files of numbers."""
    group.add_argument("--feature-edges", metavar="FILE", help="edges to keep, two vertices each")
    group.add_argument("--fixed-vertices", metavar="FILE", help="vertices that stay")
    group.add_argument("--fixed-faces", metavar="FILE", help="faces that stay")
    group.add_argument(
        "--selection", metavar="FILE", help="faces to remesh; the others stay and come first"
    )
    group.add_argument(
        "--face-labels",
        metavar="FILE",
        help="a whole number per face; borders between different numbers are kept",
    )


def add_remesh_options(group: argparse._ArgumentGroup) -> None:
    """Add the flags of how the sweeps work."""
    group.add_argument(
        "--preset",
        choices=get_args(Preset),
        default="default",
        help="fast: the published algorithm; even: the most even areas; fine: a closer fit",
    )
    group.add_argument(
        "--iterations", type=at_least_one, metavar="N", help="largest number of sweeps"
    )
    group.add_argument(
        "--tol",
        type=positive_number,
        metavar="X",
        help="stop when a sweep changes less than this share of the edges and moves vertices by less "
        "than this multiple of the target length",
    )
    group.add_argument(
        "--split",
        type=positive_number,
        metavar="X",
        help="split edges longer than this multiple of the target length",
    )
    group.add_argument(
        "--collapse",
        type=positive_number,
        metavar="X",
        help="collapse edges shorter than this multiple of the target length",
    )
    group.add_argument(
        "--foldover",
        type=positive_number,
        metavar="DEG",
        help="largest angle that a normal may turn by in a collapse, in degrees",
    )
    group.add_argument(
        "--sliver-check",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="refuse flips and collapses that make the shapes of triangles worse",
    )
    group.add_argument(
        "--no-project",
        action="store_true",
        help="do not put the vertices back onto the input surface",
    )
    group.add_argument(
        "--fit",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="let vertices leave the input a little so that faces lie closer to it",
    )
    group.add_argument(
        "--avoid-intersections",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="hold the mesh where faces would come to cross others",
    )
    group.add_argument("--threads", type=at_least_one, metavar="N", help="number of threads")


def add_repair_options(group: argparse._ArgumentGroup) -> None:
    """Add the flags of what is repaired before."""
    group.add_argument(
        "--repair",
        action="store_true",
        help="join, orient and part the faces of a raw surface; the flags below do this too",
    )
    group.add_argument(
        "--keep-largest", action="store_true", help="remove all but the largest component"
    )
    group.add_argument(
        "--min-component",
        type=at_least_one,
        metavar="N",
        help="remove components of fewer faces",
    )
    group.add_argument(
        "--fill-holes",
        type=_number_or_all,
        metavar="N",
        help="close holes of up to so many edges; all: every hole",
    )
    group.add_argument(
        "--weld",
        type=positive_number,
        metavar="D",
        help="join vertices of the boundary up to this distance apart",
    )
    group.add_argument(
        "--denoise",
        type=at_least_one,
        metavar="N",
        help="remove noise in so many iterations, and keep the volume; 10 to 40 suit scans",
    )


def _number_or_all(text: str) -> int | str:
    return text if text == "all" else at_least_one(text)


def add_report_options(group: argparse._ArgumentGroup) -> None:
    """Add the flags of what is written beside the mesh, and shown."""
    group.add_argument(
        "--save-stats", metavar="FILE", help="write the measures before and after, as JSON"
    )
    group.add_argument(
        "--save-arrays",
        metavar="FILE",
        help="write births of vertices, faces and corners, images of the input's vertices, labels, maps, "
        "feature edges, corners and lengths, as .npz",
    )
    group.add_argument(
        "--picture", metavar="FILE", help="render both meshes side by side (PNG or JPEG)"
    )
    group.add_argument(
        "--html",
        metavar="FILE",
        help="write a page that shows both meshes, histograms and measures",
    )
    group.add_argument("--visualize", action="store_true", help="show both meshes in a window")
    group.add_argument(
        "--up",
        choices=("y", "z"),
        default="y",
        help="axis that points up in what is shown (default y)",
    )
    group.add_argument("--timing", action="store_true", help="show the seconds of every phase")
    group.add_argument("--quiet", action="store_true", help="show errors only")
    group.add_argument("--version", action="version", version=f"remeshvec {__version__}")


def positive_number(text: str) -> float:
    """Read a number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (value > 0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value


def _positive_or_none(text: str) -> float | None:
    return None if text == "none" else positive_number(text)


def at_least_one(text: str) -> int:
    """Read a whole number from 1."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a whole number, at least 1")
    return value


def _angle_or_word(text: str) -> float | str | None:
    if text in ("auto", "none"):
        return None if text == "none" else text
    return positive_number(text)
