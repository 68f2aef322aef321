"""The options of `remesh`: one record, from which its signature follows."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal, TypedDict

from numpy.typing import ArrayLike

from ..core.shown import given_fields

__all__ = [
    "CLEARANCE",
    "MAX_FACES",
    "OPTION_NAMES",
    "OTHER_NAMES",
    "Boundary",
    "Callback",
    "Preset",
    "RemeshKeywords",
    "RemeshOptions",
    "read_options",
    "with_options",
]

MAX_FACES = 50_000_000
CLEARANCE = 0.4

Preset = Literal["default", "even", "fast", "fine"]
Boundary = Literal["free", "split", "fixed"]
FeatureAngle = float | Literal["auto"] | None  # degrees
Factors = float | Sequence[float]  # of the target length, for all sweeps or stretched over them
FaceChoice = (
    ArrayLike | str
)  # indices or a mask; the name of such data where a mesh object carries them
Labels = ArrayLike | str  # one whole number per face; or a name, likewise
Corners = (
    ArrayLike | Sequence[ArrayLike | str] | str
)  # data on corners or faces; or names, likewise
Callback = Callable[[int, str, int], Any]  # sweep, phase, count; False ends the call


@dataclass(frozen=True, kw_only=True, repr=False, eq=False)
class RemeshOptions:
    """All options of `remesh`, as the caller gives them; `remesh` documents each.

    None means that the preset decides, or that nothing is asked for. The shell command's flags and
    `RemeshKeywords` have the same names and defaults; tests hold that.
    """

    # How long edges become, besides L.
    n_faces: int | None = None
    n_vertices: int | None = None
    gradation: float = 1.5
    max_deviation: float | None = None
    clearance: float | None = CLEARANCE
    # What to keep.
    feature_angle: FeatureAngle = "auto"
    corner_angle: float | None = None
    feature_edges: ArrayLike | None = None
    fixed_vertices: ArrayLike | None = None
    fixed_faces: FaceChoice | None = None
    face_labels: Labels | None = None
    preserve: Corners | None = None
    selection: FaceChoice | None = None
    boundary: Boundary = "free"
    # How to remesh.
    preset: Preset = "default"
    iterations: int | None = None
    split: Factors | None = None
    collapse: Factors | None = None
    foldover: float | None = None
    sliver_check: bool | None = None
    project: bool | None = None
    untangle_angle: float | None = None
    fit: bool | None = None
    avoid_intersections: bool = False
    # Limits.
    tol: float | None = None
    max_faces: int = MAX_FACES
    threads: int | None = None
    callback: Callback | None = None

    def __repr__(self) -> str:
        given = {
            field.name: value
            for field in fields(self)
            if (value := getattr(self, field.name)) is not field.default
        }
        return f"RemeshOptions({', '.join(given_fields(given))})"


class RemeshKeywords(TypedDict, total=False):
    """The fields of `RemeshOptions` as keywords, for type checkers."""

    n_faces: int | None
    n_vertices: int | None
    gradation: float
    max_deviation: float | None
    clearance: float | None
    feature_angle: FeatureAngle
    corner_angle: float | None
    feature_edges: ArrayLike | None
    fixed_vertices: ArrayLike | None
    fixed_faces: FaceChoice | None
    face_labels: Labels | None
    preserve: Corners | None
    selection: FaceChoice | None
    boundary: Boundary
    preset: Preset
    iterations: int | None
    split: Factors | None
    collapse: Factors | None
    foldover: float | None
    sliver_check: bool | None
    project: bool | None
    untangle_angle: float | None
    fit: bool | None
    avoid_intersections: bool
    tol: float | None
    max_faces: int
    threads: int | None
    callback: Callback | None


OPTION_NAMES = tuple(field.name for field in fields(RemeshOptions))

# What other libraries call these options.
OTHER_NAMES = {
    **dict.fromkeys(
        ("edge_length", "edge_len", "edgelen", "length", "target_length", "target_edge_length",
         "targetlen", "h", "size", "mesh_size", "lc", "l"), "L",
    ),
    **dict.fromkeys(
        ("faces", "num_faces", "nfaces", "target_faces", "target_face_num", "face_count", "n_cells"),
        "n_faces",
    ),
    **dict.fromkeys(
        ("vertices", "num_vertices", "nvertices", "nclus", "n_points", "vertex_count"), "n_vertices"
    ),
    **dict.fromkeys(("sweeps", "n_iter", "num_iters", "niter", "n_iterations"), "iterations"),
    **dict.fromkeys(("crease_angle", "dihedral_angle", "sharp_angle", "featuredeg"), "feature_angle"),
    **dict.fromkeys(("tolerance", "hausdorff", "hausd", "max_error", "maxsurfdist"), "max_deviation"),
    **dict.fromkeys(("n_threads", "num_threads", "n_jobs"), "threads"),
    **dict.fromkeys(("hgrad", "grading", "growth"), "gradation"),
    "labels": "face_labels",
    "features": "feature_edges",
}  # fmt: skip


def read_options(caller: str, given: dict[str, Any]) -> RemeshOptions:
    """Make the record from keywords.

    Raises
    ------
    TypeError
        A keyword that does not exist, as Python itself raises it.
    """
    for name in given:
        if name not in OPTION_NAMES:
            raise TypeError(
                f"{caller}() got an unexpected keyword argument {name!r}{_did_you_mean(name)}"
            )
    return RemeshOptions(**given)


def _did_you_mean(name: str) -> str:
    """Suggest a keyword: the one that other libraries call so, or else one that is spelt like it."""
    other = OTHER_NAMES.get(name.lower())
    near = [other] if other else difflib.get_close_matches(name, OPTION_NAMES, 1)
    return f"; did you mean {near[0]!r}?" if near else ""


class _Annotation(str):
    """The text of an annotation, which `help` shows without quotes."""

    def __repr__(self) -> str:
        return str(self)


def with_options(function: Any) -> Any:
    """Give a function with ``**options`` the signature that names them all, for `help` and editors."""
    own = inspect.signature(function)
    parameters = [
        p.replace(annotation=_Annotation(p.annotation))
        for p in own.parameters.values()
        if p.kind is not inspect.Parameter.VAR_KEYWORD
    ]
    named = [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=field.default,
            annotation=_Annotation(field.type),
        )
        for field in fields(RemeshOptions)
    ]
    returns = _Annotation(own.return_annotation)
    function.__signature__ = own.replace(
        parameters=[*parameters, *named], return_annotation=returns
    )
    return function
