"""The arguments of the shell command."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any, get_args

from ..core.version import __version__
from ..core.vocabulary import DEFAULT_LENGTH_FACTOR
from ..errors import OptionError
from ..files.data_files import COMMON_SUFFIXES
from ..files.mesh_files import MeshFile
from ..input.options import CLEARANCE, OPTION_NAMES, Boundary, Preset
from ..measures.quality import quality
from ..sizing.adaptive import Adaptive
from .parser import OneLineParser

__all__ = [
    "FILE_OPTIONS",
    "batch_parser",
    "given_options",
    "large_parser",
    "parse",
    "parser",
    "target_length",
]


EPILOG = """\
examples:
  remeshvec cat.obj                                   show the effect of remeshing
  remeshvec cat.obj -o even.obj                       write the new mesh
  remeshvec part.stl -o part.ply --length 0.5         edges of length 0.5
  remeshvec cat.obj -o even.obj --picture even.png    and a picture of both
  remeshvec cat.obj --html report.html                a page to read and to share
  remeshvec part.stl -o part.ply --feature-angle 30   keep edges that turn by more than 30 degrees
  remeshvec cat.obj -o fine.obj --adaptive 0.001      short edges where the surface is curved
  remeshvec scan.stl -o clean.ply --keep-largest --fill-holes 100 --denoise 20
                                                      one clean, closed surface of a raw one
  remeshvec - --format ply -o - < a.ply | program     from and to other programs
  remeshvec batch 'in/*.obj' --out even               many meshes; see remeshvec batch --help

FILE of numbers: text (white space or commas, # starts a comment) or .npy; indices count from 0.
"""

BATCH_EPILOG = """\
examples:
  remeshvec batch 'in/*.obj' --out even                 all OBJ files of a folder
  remeshvec batch 'in/**/*.stl' --out even --format ply --table even.parquet
  remeshvec batch 'in/*.obj' --out even --scheduler tcp://10.0.0.1:8786

Run the same command again to continue after an interrupt. It repeats meshes that failed, and those made
from another input or with other options.

exit status: 0 all meshes are done, 3 some failed, 2 bad arguments, 130 interrupted
"""

LARGE_EPILOG = """\
examples:
  remeshvec large scan.ply -l 0.1 -o even.ply --workers 2
  remeshvec large scan.ply -l 0.1 -o even.ply --scheduler tcp://host:8786 --scratch /shared/work

Run the same command again to continue after an interrupt. Flags that have no meaning for a surface in
parts are refused, with the reason.
"""

# Options of `remesh` whose flags name files of numbers, and the number of columns of these files.
FILE_OPTIONS = {
    "feature_edges": 2,
    "fixed_vertices": 1,
    "fixed_faces": 1,
    "selection": 1,
    "face_labels": 1,
}


def parser() -> argparse.ArgumentParser:
    """Return the parser of the shell command's arguments."""
    result = OneLineParser(
        prog="remeshvec",
        description="Remesh a triangle mesh to even triangles.\n"
        "Reads and writes OBJ, OFF, PLY, STL, and JSON with the keys verts and faces; and the formats\n"
        "of meshio (VTK, VTU, Gmsh, XDMF, ...), pyvista (VTP) and trimesh (glTF), if installed.\n"
        "Colours, texture coordinates, fields and groups are kept if the format can hold them.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    result.add_argument("input", metavar="INPUT", help="mesh file; - reads standard input")
    result.add_argument(
        "-o", "--output", metavar="OUTPUT", help="mesh file to write; - writes to standard output"
    )
    result.add_argument(
        "--format", choices=[suffix[1:] for suffix in COMMON_SUFFIXES], help="format of -"
    )
    _add_repair_options(result.add_argument_group("what to repair first"))
    lengths = _add_size_options(result.add_argument_group("how long edges become"))
    lengths.add_argument("--lengths", metavar="FILE", help="target edge length at every vertex")
    keep = result.add_argument_group("what to keep")
    _add_constraints(keep)
    _add_files_of_constraints(keep)
    _add_remesh_options(result.add_argument_group("how to remesh"))
    _add_report_options(result.add_argument_group("what to show and save"))
    return result


def batch_parser() -> argparse.ArgumentParser:
    """Return the parser of ``remeshvec batch``: all arguments except elements of a single mesh."""
    result = OneLineParser(
        prog="remeshvec batch",
        description="Remesh many triangle meshes, several at a time.",
        epilog=BATCH_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    result.add_argument(
        "inputs",
        metavar="INPUT",
        nargs="+",
        help="mesh files, or patterns in quotes; ** stands for any folders",
    )
    result.add_argument(
        "--out",
        metavar="DIR",
        required=True,
        help="folder to write to; keeps the folders of the inputs below it",
    )
    result.add_argument(
        "--format",
        choices=[suffix[1:] for suffix in COMMON_SUFFIXES],
        help="format to write (default: that of each input)",
    )
    crew = result.add_mutually_exclusive_group()
    crew.add_argument(
        "--workers", type=_at_least_one, metavar="N", help="meshes at a time (default: all cores)"
    )
    crew.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="let the workers of a Dask cluster do it, which see the same files: tcp://HOST:8786",
    )
    result.add_argument(
        "--timeout",
        type=_positive_number,
        metavar="S",
        help="most seconds for a mesh; then it counts as failed",
    )
    result.add_argument("--force", action="store_true", help="repeat meshes that are done, too")
    result.add_argument(
        "--table",
        metavar="FILE",
        help="table of results: .csv (default DIR/results.csv), or .parquet in addition",
    )
    result.add_argument("--quiet", action="store_true", help="show errors only")
    result.add_argument("--version", action="version", version=f"remeshvec {__version__}")
    _add_size_options(result.add_argument_group("how long edges become"))
    _add_constraints(result.add_argument_group("what to keep"))
    _add_remesh_options(result.add_argument_group("how to remesh"))
    return result


def large_parser() -> argparse.ArgumentParser:
    """Return the parser of ``remeshvec large``."""
    result = argparse.ArgumentParser(
        prog="remeshvec large",
        description="Remesh one large surface in parts, in several processes or on a cluster.",
        epilog=LARGE_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = result.add_argument
    add("input", metavar="INPUT", help="mesh file, or a folder with V.npy and F.npy")
    add(
        "-o",
        "--out",
        metavar="OUT",
        required=True,
        help="PLY or STL file to write, with a folder of arrays beside it; or that folder alone",
    )
    add("-l", "--length", type=_positive_number, metavar="L", help="target edge length")
    add("--lengths", metavar="FILE", help="target edge length at every vertex")
    add(
        "--gradation",
        type=_positive_number,
        metavar="X",
        help="largest ratio of the lengths at the ends of an edge (default 1.5)",
    )
    add("--scratch", metavar="DIR", help="folder for the work (default OUT.scratch)")
    who = result.add_mutually_exclusive_group()
    who.add_argument(
        "--workers", type=_at_least_one, metavar="N", help="processes (default: all cores)"
    )
    who.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask scheduler, whose workers do the work"
    )
    add("--part-faces", type=_at_least_one, metavar="N", help="faces in a part (default 2000000)")
    add("--restart", action="store_true", help="do not go on with a call that was interrupted")
    add("--quiet", action="store_true", help="show errors only")
    add("--version", action="version", version=f"remeshvec {__version__}")
    keep = result.add_argument_group("what to keep")
    _add_constraints(keep)
    _add_files_of_constraints(keep)
    _add_remesh_options(result.add_argument_group("how to remesh"))
    return result


def parse(parser: argparse.ArgumentParser, words: Sequence[str]) -> argparse.Namespace:
    """Parse arguments and refuse empty ones: most often a variable of a script was not set."""
    options = parser.parse_args(words)
    for name, value in vars(options).items():
        if value == "" or (isinstance(value, list) and "" in value):
            parser.error(f"argument {name.replace('_', '-')}: the name is empty")
    return options


def target_length(options: argparse.Namespace, mesh: MeshFile) -> Any:
    """Return the target length; None for the library's default, or if a count is given."""
    if options.adaptive is not None:
        return Adaptive(options.adaptive, options.min_length, options.max_length)
    if options.min_length is not None or options.max_length is not None:
        raise OptionError("--min-length and --max-length need --adaptive")
    if options.length is not None or options.l_factor == DEFAULT_LENGTH_FACTOR:
        return options.length
    return options.l_factor * quality(mesh.V, mesh.F).edge_mean


def given_options(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options of `remesh` that were given, so that the preset sets the others."""
    given = {
        name: getattr(options, name)
        for name in OPTION_NAMES
        if name not in FILE_OPTIONS and getattr(options, name, None) is not None
    }
    if options.feature_angle is None:  # "none" differs from the default
        given["feature_angle"] = None
    if options.clearance is None:
        given["clearance"] = None
    if options.no_project:
        given["project"] = False
    return given


def _add_size_options(
    group: argparse._ArgumentGroup,
) -> argparse._MutuallyExclusiveGroup:
    """Add the flags; returns the group of those that exclude each other."""
    length = group.add_mutually_exclusive_group()
    length.add_argument("--length", type=_positive_number, metavar="L", help="target edge length")
    length.add_argument(
        "--l-factor",
        type=_positive_number,
        default=DEFAULT_LENGTH_FACTOR,
        metavar="X",
        help="target edge length as a multiple of the mean edge length (default %(default)s)",
    )
    length.add_argument(
        "--adaptive",
        type=_positive_number,
        metavar="TOL",
        help="edge length from the curvature, so that faces stay within TOL of the surface",
    )
    length.add_argument("--n-faces", type=_at_least_one, metavar="N", help="number of faces wanted")
    length.add_argument(
        "--n-vertices", type=_at_least_one, metavar="N", help="number of vertices wanted"
    )
    group.add_argument(
        "--min-length", type=_positive_number, metavar="L", help="shortest length for --adaptive"
    )
    group.add_argument(
        "--max-length", type=_positive_number, metavar="L", help="longest length for --adaptive"
    )
    group.add_argument(
        "--gradation",
        type=_positive_number,
        metavar="X",
        help="largest ratio of the lengths at the ends of an edge (default 1.5)",
    )
    group.add_argument(
        "--max-deviation",
        type=_positive_number,
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


def _add_constraints(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--feature-angle",
        type=_angle_or_word,
        default="auto",
        metavar="DEG",
        help="keep edges that turn by more; auto: edges that stand out (default), none: no edges",
    )
    group.add_argument(
        "--corner-angle",
        type=_positive_number,
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


def _add_files_of_constraints(group: argparse._ArgumentGroup) -> None:
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


def _add_remesh_options(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--preset",
        choices=get_args(Preset),
        default="default",
        help="fast: the published algorithm; even: the most even areas; fine: a closer fit",
    )
    group.add_argument(
        "--iterations", type=_at_least_one, metavar="N", help="largest number of sweeps"
    )
    group.add_argument(
        "--tol",
        type=_positive_number,
        metavar="X",
        help="stop when a sweep changes less than this share of the edges and moves vertices by less "
        "than this multiple of the target length",
    )
    group.add_argument(
        "--split",
        type=_positive_number,
        metavar="X",
        help="split edges longer than this multiple of the target length",
    )
    group.add_argument(
        "--collapse",
        type=_positive_number,
        metavar="X",
        help="collapse edges shorter than this multiple of the target length",
    )
    group.add_argument(
        "--foldover",
        type=_positive_number,
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
    group.add_argument("--threads", type=_at_least_one, metavar="N", help="number of threads")


def _add_repair_options(group: argparse._ArgumentGroup) -> None:
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
        type=_at_least_one,
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
        type=_positive_number,
        metavar="D",
        help="join vertices of the boundary up to this distance apart",
    )
    group.add_argument(
        "--denoise",
        type=_at_least_one,
        metavar="N",
        help="remove noise in so many iterations, and keep the volume; 10 to 40 suit scans",
    )


def _number_or_all(text: str) -> int | str:
    return text if text == "all" else _at_least_one(text)


def _add_report_options(group: argparse._ArgumentGroup) -> None:
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


def _positive_number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (value > 0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value


def _positive_or_none(text: str) -> float | None:
    return None if text == "none" else _positive_number(text)


def _at_least_one(text: str) -> int:
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
    return _positive_number(text)
