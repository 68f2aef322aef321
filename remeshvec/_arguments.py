"""The arguments of the shell command."""

from __future__ import annotations

import argparse
import math

from . import __version__

__all__ = ["DEFAULT_FACTOR", "parser"]

DEFAULT_FACTOR = 0.9  # of the mean edge length; what the library takes when no length is given

EPILOG = """\
examples:
  remeshvec cat.obj                                   show what remeshing brings
  remeshvec cat.obj -o even.obj                       write the new mesh
  remeshvec part.stl -o part.ply --length 0.5         edges of length 0.5
  remeshvec cat.obj -o even.obj --picture even.png    and a picture of both
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of the shell command's arguments."""
    result = argparse.ArgumentParser(
        prog="remeshvec",
        description="Remesh a triangle mesh to even triangles.\n"
        "Reads and writes OBJ, OFF, PLY, STL, and JSON with the keys verts and faces.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    result.add_argument("input", metavar="INPUT", help="mesh file")
    result.add_argument("-o", "--output", metavar="OUTPUT", help="mesh file to write")
    _add_remesh_options(result.add_argument_group("how to remesh"))
    _add_report_options(result.add_argument_group("what to show and save"))
    return result


def _add_remesh_options(group: argparse._ArgumentGroup) -> None:
    length = group.add_mutually_exclusive_group()
    length.add_argument("--length", type=_positive, metavar="L", help="target edge length")
    length.add_argument(
        "--l-factor",
        type=_positive,
        default=DEFAULT_FACTOR,
        metavar="X",
        help="target edge length as a multiple of the mean edge length (default %(default)s)",
    )
    group.add_argument(
        "--preset",
        choices=("default", "fast", "fine"),
        default="default",
        help="fast: the published algorithm; fine: more sweeps and a closer fit",
    )
    group.add_argument("--iterations", type=_at_least_one, metavar="N", help="number of sweeps")
    group.add_argument(
        "--split",
        type=_positive,
        metavar="X",
        help="split edges longer than this multiple of the target length",
    )
    group.add_argument(
        "--collapse",
        type=_positive,
        metavar="X",
        help="collapse edges shorter than this multiple of the target length",
    )
    group.add_argument(
        "--foldover",
        type=_positive,
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
    group.add_argument("--threads", type=_at_least_one, metavar="N", help="number of threads")


def _add_report_options(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--save-stats", metavar="FILE", help="write the measures before and after, as JSON"
    )
    group.add_argument(
        "--picture", metavar="FILE", help="render both meshes side by side (PNG or JPEG)"
    )
    group.add_argument("--visualize", action="store_true", help="show both meshes in a window")
    group.add_argument(
        "--up", choices=("y", "z"), default="y", help="axis that points up in pictures (default y)"
    )
    group.add_argument("--timing", action="store_true", help="show the seconds of every phase")
    group.add_argument("--quiet", action="store_true", help="show errors only")
    group.add_argument("--version", action="version", version=f"remeshvec {__version__}")


def _positive(text: str) -> float:
    value = float(text)
    if not (value > 0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value


def _at_least_one(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{text} is less than 1")
    return value
