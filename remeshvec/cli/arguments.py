"""The arguments of the shell command."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from ..core.version import __version__
from ..core.vocabulary import DEFAULT_LENGTH_FACTOR
from ..errors import OptionError
from ..files.data_files import COMMON_SUFFIXES
from ..files.mesh_files import MeshFile
from ..input.options import CLEARANCE, OPTION_NAMES
from ..measures.quality import quality
from ..sizing.adaptive import Adaptive
from .flags import (
    add_constraints,
    add_files_of_constraints,
    add_remesh_options,
    add_repair_options,
    add_report_options,
    add_size_options,
    at_least_one,
    positive_number,
)
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
    add_repair_options(result.add_argument_group("what to repair first"))
    lengths = add_size_options(result.add_argument_group("how long edges become"))
    lengths.add_argument("--lengths", metavar="FILE", help="target edge length at every vertex")
    keep = result.add_argument_group("what to keep")
    add_constraints(keep)
    add_files_of_constraints(keep)
    add_remesh_options(result.add_argument_group("how to remesh"))
    add_report_options(result.add_argument_group("what to show and save"))
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
        "--workers", type=at_least_one, metavar="N", help="meshes at a time (default: all cores)"
    )
    crew.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="let the workers of a Dask cluster do it, which see the same files: tcp://HOST:8786",
    )
    result.add_argument(
        "--timeout",
        type=positive_number,
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
    add_size_options(result.add_argument_group("how long edges become"))
    add_constraints(result.add_argument_group("what to keep"))
    add_remesh_options(result.add_argument_group("how to remesh"))
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
    add("-l", "--length", type=positive_number, metavar="L", help="target edge length")
    add("--lengths", metavar="FILE", help="target edge length at every vertex")
    add(
        "--gradation",
        type=positive_number,
        metavar="X",
        help="largest ratio of the lengths at the ends of an edge (default 1.5)",
    )
    add("--scratch", metavar="DIR", help="folder for the work (default OUT.scratch)")
    who = result.add_mutually_exclusive_group()
    who.add_argument(
        "--workers", type=at_least_one, metavar="N", help="processes (default: all cores)"
    )
    who.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask scheduler, whose workers do the work"
    )
    add("--part-faces", type=at_least_one, metavar="N", help="faces in a part (default 2000000)")
    add("--restart", action="store_true", help="do not go on with a call that was interrupted")
    add("--quiet", action="store_true", help="show errors only")
    add("--version", action="version", version=f"remeshvec {__version__}")
    keep = result.add_argument_group("what to keep")
    add_constraints(keep)
    add_files_of_constraints(keep)
    add_remesh_options(result.add_argument_group("how to remesh"))
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
    if getattr(options, "clearance", CLEARANCE) is None:
        given["clearance"] = None
    if options.no_project:
        given["project"] = False
    return given
