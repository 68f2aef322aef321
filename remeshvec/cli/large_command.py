"""``remeshvec large``: remesh one large surface in parts; continue an interrupted run."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import remeshvec

from ..errors import OptionError
from .arguments import FILE_OPTIONS, given_options, large_parser, parse
from .array_files import read_array

__all__ = ["parsed", "run"]


def parsed(words: Sequence[str]) -> argparse.Namespace:
    """Parse the arguments after ``large``."""
    return parse(large_parser(), words)


def run(options: argparse.Namespace) -> int:
    """Remesh the surface; return the exit status."""
    if options.length is not None and options.lengths is not None:
        raise OptionError("--length and --lengths exclude each other; give one of them")
    L = options.length
    if options.lengths is not None:
        L = read_array(options.lengths, whole=False)
    with _client(options.scheduler) as client:
        result = remeshvec.remesh_large(
            options.input,
            L,
            out=options.out,
            scratch=options.scratch,
            client=client,
            workers=options.workers,
            resume=not options.restart,
            progress=not options.quiet,
            **_library_options(options),
        )
    if not options.quiet:
        _print_report(result)
    return 0


def _library_options(options: argparse.Namespace) -> dict[str, Any]:
    given = given_options(options)
    for name, columns in FILE_OPTIONS.items():
        path = getattr(options, name)
        if path is not None:
            given[name] = read_array(path, columns)
    if options.part_faces is not None:
        given["part_faces"] = options.part_faces
    return given


@contextmanager
def _client(address: str | None) -> Iterator[Any]:
    """Connect with a Dask scheduler; None without an address."""
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise OptionError(
            "--scheduler needs the package distributed (pip install 'remeshvec[cluster]')"
        ) from None
    try:
        client = Client(address)
    except (OSError, ValueError) as error:
        raise OptionError(f"there is no scheduler at {address}: {error}") from error
    with client:
        yield client


def _print_report(result: remeshvec.LargeResult) -> None:
    report = result.report
    for name, count in report["dirt"].items():
        print(f"note: {name.replace('_', ' ')}: {count:,}")
    for step in report["rounds"]:
        print(
            f"{step['name']:<12}{step['parts']:>6,} parts {step['faces']:>14,} faces "
            f"{step['seconds']:>9.1f} s"
        )
    print(
        f"{report['vertices']:,} vertices, {report['faces']:,} faces, target length "
        f"{report['target_length']:.4g}, {report['seconds']:.1f} s"
    )
    print(f"written: {result.folder}")
