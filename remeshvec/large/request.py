"""What is asked for, checked before any work; and the digest by which a later call knows it again."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from ..core.vocabulary import LARGEST_MESH
from ..errors import OptionError
from ..input.options import CLEARANCE, RemeshOptions, read_options
from ..sizing.adaptive import Adaptive, target_lengths
from .scratch import read_json, remove, write_json
from .source import Source, digest
from .tasks import versions

__all__ = ["enter_scratch", "leave_scratch", "read_large_options", "read_lengths", "recipe_of"]

# Options that have a meaning for a surface as a whole, and why parts cannot keep it.
_REFUSED = {
    "n_faces": "the number of faces is known when all parts are done; give a length",
    "n_vertices": "the number of vertices is known when all parts are done; give a length",
    "max_deviation": "lengths would be cut anew in every round",
    "tol": "parts would stop after different sweeps",
    "callback": "tasks run in other processes; progress=True shows what is done",
    "selection": "faces that are not selected would not come first; use fixed_faces",
}

# Options that do not change the result.
_SILENT = ("threads", "max_faces", "callback")


def read_large_options(given: dict[str, Any]) -> RemeshOptions:
    """Check options of `remesh` for a surface in parts.

    Raises
    ------
    OptionError
        An option that has no meaning in parts.
    TypeError
        A keyword that does not exist.
    """
    options = read_options("remesh_large", {"max_faces": LARGEST_MESH, **given})
    for name, why in _REFUSED.items():
        if getattr(options, name) is not None:
            raise OptionError(f"remesh_large does not take {name}: {why}")
    if options.avoid_intersections:
        raise OptionError(
            "remesh_large does not take avoid_intersections: a part does not see faces of others "
            "that it may cross"
        )
    if options.clearance not in (None, CLEARANCE):
        raise OptionError(
            "remesh_large does not take clearance: a part does not see sheets of others that are near"
        )
    if (
        options.project is False
        or options.fit
        or (options.preset == "fine" and options.fit is None)
    ):
        raise OptionError(
            "remesh_large keeps all vertices on the input: project=False, fit=True, and "
            'preset="fine" without fit=False do not work in parts'
        )
    return options


def read_lengths(V: Any, L: Any) -> Any:
    """Turn what is said about lengths into None, a number or an array.

    Raises
    ------
    OptionError
        Lengths from the curvature, or lengths that cannot work.
    """
    if isinstance(L, Adaptive):
        raise OptionError(
            "remesh_large does not take Adaptive lengths: they are corrected on the whole surface "
            "after several sweeps; give a number, an array or a function"
        )
    return None if L is None else target_lengths(np.asarray(V, np.float64), L)


def recipe_of(source: Source, L: Any, options: RemeshOptions, part_faces: int) -> dict[str, Any]:
    """Describe a call, as far as its result depends on it."""
    return {
        "source": source.stamp,
        "L": _described(L),
        "part_faces": part_faces,
        "versions": versions(),
        **{
            field.name: _described(getattr(options, field.name))
            for field in fields(options)
            if field.name not in _SILENT
        },
    }


def _described(value: Any) -> Any:
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, list | tuple) and any(isinstance(x, np.ndarray) for x in value):
        return [digest(np.asarray(x)) for x in value]
    return digest(np.asarray(value))


_RECIPE = "recipe.json"
_NOTE = "scratch of remesh_large"


def enter_scratch(folder: Path, recipe: dict[str, Any], resume: bool) -> None:
    """Make a scratch folder, or go on in that of an earlier call with the same recipe.

    Raises
    ------
    OptionError
        The folder holds something else.
    """
    recipe = {"what": _NOTE, **recipe}
    folder.mkdir(parents=True, exist_ok=True)
    known = read_json(folder / _RECIPE)
    if known is None and any(folder.iterdir()):
        raise OptionError(f"the scratch folder {folder} is not empty; choose another, or empty it")
    if known is not None and (known.get("what") != _NOTE or (resume and known != recipe)):
        differ = ", ".join(sorted(k for k in recipe if known.get(k) != recipe[k]))
        raise OptionError(
            f"the scratch folder {folder} belongs to another call ({differ} differ); choose another "
            "folder, or start again in it with resume=False"
        )
    if known is not None and not resume:
        leave_scratch(folder)
        folder.mkdir(exist_ok=True)
    write_json(folder / _RECIPE, recipe)


def leave_scratch(folder: Path) -> None:
    """Remove a scratch folder."""
    remove(folder)
