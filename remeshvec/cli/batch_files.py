"""The files that a batch reads and writes: patterns, output names, collisions."""

from __future__ import annotations

import glob
import os
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from ..errors import OptionError
from ..files.data_files import COMMON_SUFFIXES
from ..files.disk import format_suffix

__all__ = ["FileJob", "find_jobs", "refuse_collisions"]


class FileJob(NamedTuple):
    """One mesh of a batch."""

    input: str  # as found
    output: str  # relative to the folder of results, with slashes; identifies the job
    path: str  # where the output goes


class _Found(NamedTuple):
    path: str
    root: str  # the folders before the first wildcard


def find_jobs(
    patterns: Sequence[str], folder: str, suffix: str | None, made: Collection[str] = ()
) -> list[FileJob]:
    """Find the inputs and name their outputs.

    Output names leave out the folders that all patterns share before their first wildcard, and keep
    the others: ``in/a/x.obj`` and ``in/b/x.obj`` become ``a/x.obj`` and ``b/x.obj``.

    Parameters
    ----------
    patterns : sequence of str
        Paths, or patterns for `glob`.
    folder : str
        Folder for the outputs.
    suffix : str, optional
        Suffix of the outputs; by default, outputs keep the suffixes of the inputs.
    made : collection of str
        Full paths of outputs of earlier runs; patterns skip them.

    Raises
    ------
    OptionError
        A pattern matches nothing or names a folder, or the inputs have no folder in common.
    """
    found = [file for pattern in patterns for file in _files(pattern, made)]
    if not found:  # everything was made by earlier runs
        raise OptionError(f"{' '.join(patterns)}: only results of earlier runs")
    try:
        root = os.path.commonpath([os.path.abspath(file.root) for file in found])
    except ValueError as error:
        raise OptionError(f"the inputs have no folder in common: {error}") from error
    jobs: dict[str, FileJob] = {}
    for path, _ in found:
        name = Path(os.path.relpath(os.path.abspath(path), root))
        if suffix is not None:
            plain = name.with_suffix("") if name.suffix.lower() == ".gz" else name
            name = plain.with_suffix(suffix)
        output = name.as_posix()
        jobs.setdefault(os.path.realpath(path), FileJob(path, output, os.path.join(folder, output)))
    return list(jobs.values())


def _files(pattern: str, made: Collection[str]) -> list[_Found]:
    if os.path.isfile(pattern):
        return [_Found(pattern, os.path.dirname(pattern))]
    if os.path.isdir(pattern):
        raise OptionError(
            f"{pattern} is a folder; use '{os.path.join(pattern, '*.obj')}' in quotes"
        )
    names = sorted(glob.glob(pattern, recursive=True))
    files = [
        name for name in names if format_suffix(name) in COMMON_SUFFIXES and os.path.isfile(name)
    ]
    if not files:
        raise OptionError(f"{pattern}: there is no such mesh file")
    root = _root(pattern)
    return [_Found(name, root) for name in files if os.path.realpath(name) not in made]


def _root(pattern: str) -> str:
    """Return the folders before the first wildcard."""
    parts = Path(pattern).parts
    fixed = next(i for i, part in enumerate(parts) if glob.has_magic(part))
    return os.path.join(*parts[:fixed]) if fixed else ""


def refuse_collisions(jobs: Iterable[FileJob], others: Iterable[str]) -> None:
    """Refuse an output that would replace an input, another output, or another file of the batch.

    Raises
    ------
    OptionError
        An output would replace another file.
    """
    jobs = list(jobs)
    taken = {os.path.realpath(path): "the batch itself writes it" for path in others}
    for job in jobs:
        if os.path.realpath(job.input) in taken:
            raise OptionError(
                f"{job.input} would be replaced: the batch writes a file of this name"
            )
    taken |= {os.path.realpath(job.input): f"{job.input} is an input" for job in jobs}
    for job in jobs:
        reason = taken.setdefault(os.path.realpath(job.path), "")
        if reason:
            raise OptionError(f"{job.input} cannot be written to {job.path}: {reason}")
        taken[os.path.realpath(job.path)] = f"{job.input} goes there"
