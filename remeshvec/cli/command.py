"""The shell command: read a mesh, remesh it, compare its quality before and after, write it."""

from __future__ import annotations

import argparse
import json
import math
import os
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, TextIO

import remeshvec

from ..batch.one_file import with_feature_data
from ..errors import OptionError, RemeshvecError
from ..files.data_files import check_data_writable, read_data, write_data
from ..files.disk import check_writable, format_suffix, write_file
from ..files.mesh_files import MeshFile
from ..interop.mesh_data import MeshData, carry
from ..output.result import RemeshResult
from .arguments import FILE_OPTIONS, given_options, parse, parser, target_length
from .array_files import read_array, write_arrays
from .repair_step import check_repair, is_asked_for, repaired
from .streams import STREAM, check_streams, read_stream, write_stream

__all__ = ["main"]

PATIENCE = 1.0  # seconds of silence before progress is shown
EXIT_ERROR, EXIT_FAILURE, EXIT_INTERRUPTED = 2, 1, 130  # 130 = 128 + SIGINT, as in shells


def main(argv: Sequence[str] | None = None) -> int:
    """Run the shell command.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; by default those of the process.

    Returns
    -------
    int
        Exit status: 0 for success, 2 for bad input, 130 after Ctrl-C, 1 if memory or the terminal
        failed, 3 if some meshes of a batch failed.
    """
    words = sys.argv[1:] if argv is None else list(argv)
    if words[:1] == ["batch"]:  # a file of this name can be given as ./batch
        from . import batch_command as _batch_command

        return _ends(_batch_command.run, _batch_command.parsed(words[1:]))
    if words[:1] == ["completions"]:
        return _show_completions(words[1:])
    if words[:1] == ["large"]:
        from . import large_command as _large_command

        return _ends(_large_command.run, _large_command.parsed(words[1:]))
    options = parse(parser(), words)
    options.call = shlex.join(["remeshvec", *words])
    return _ends(_run, options)


def _show_completions(words: list[str]) -> int:
    """Print what a shell reads to complete flags."""
    from . import completions

    if len(words) != 1 or words[0] not in completions.SHELLS:
        shells = " or ".join(completions.SHELLS)
        return _failed(f"completions are for one shell: {shells}", EXIT_ERROR)
    print(completions.completion_script(words[0]), end="")
    return 0


def _ends(work: Callable[[argparse.Namespace], int], options: argparse.Namespace) -> int:
    """Do the work and return the exit status; errors are printed on one line."""
    try:
        status = work(options)
        sys.stdout.flush()
    except RemeshvecError as error:
        return _failed(str(error), EXIT_ERROR)
    except KeyboardInterrupt:
        return _failed("interrupted, nothing more was written", EXIT_INTERRUPTED)
    except MemoryError:
        return _failed("there is not enough memory", EXIT_FAILURE)
    except BrokenPipeError:  # the reader of the pipe, such as `head`, has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_FAILURE
    return status


def _failed(reason: str, status: int) -> int:
    print(f"remeshvec: {reason}", file=sys.stderr)
    return status


def _run(options: argparse.Namespace) -> int:
    """Read, remesh, write and show, according to the arguments."""
    _check_outputs(options)
    seconds: dict[str, float] = {}
    with _timed(seconds, "read"):
        is_stream = options.input == STREAM
        data, notices = read_stream(options.format) if is_stream else read_data(options.input)
    raw = MeshFile(data.V, data.F, notices)
    with _timed(seconds, "repair"):
        data, repairs = repaired(options, data)
    mesh = MeshFile(data.V, data.F, notices)
    if repairs:
        notices.append(f"repaired: {repairs}")
    with _progress(options.quiet) as callback:
        result = remeshvec.remesh(
            mesh.V,
            mesh.F,
            _length(options, mesh),
            callback=callback,
            **with_feature_data(data, _library_options(options)),
        )
    seconds |= result.report.seconds
    if options.output:
        with _timed(seconds, "write"):
            lost = _write(options, carry(data, result))
        if lost:
            kind = options.format if options.output == STREAM else format_suffix(options.output)[1:]
            notices.append(f".{kind} files cannot hold: {', '.join(lost)}")
    if options.save_stats:
        _save_stats(options, mesh, result)
    if options.save_arrays:
        write_arrays(options.save_arrays, result)
    if options.picture:
        _make_picture(options, raw, result)
    if options.html:
        _write_page(options, result)
    if not options.quiet:
        # Standard output is the mesh alone if it is written there.
        with redirect_stdout(sys.stderr if options.output == STREAM else sys.stdout):
            _print_report(options, mesh, result, seconds)
    if options.visualize:
        from .. import viz

        lines = _lines(options, result)
        viz.show((raw.V, raw.F), (result.V, result.F), lines=lines, up=options.up)
    return 0


def _check_outputs(options: argparse.Namespace) -> None:
    """Refuse outputs that cannot be written or shown, before the work starts."""
    check_repair(options)
    check_streams(options)
    if options.output and options.output != STREAM:
        check_data_writable(options.output)
    for path in (options.save_stats, options.save_arrays):
        if path:
            check_writable(path)
    if options.picture or options.visualize:
        from .. import viz

        viz.require_viewer(window=options.visualize)
        if options.picture:
            check_writable(options.picture, viz.PICTURE_SUFFIXES)
    if options.html:
        from .. import html_page

        html_page.require_plotly()
        check_writable(options.html, html_page.PAGE_SUFFIXES)
    paths = [os.path.realpath(name) for name in _outputs(options)]
    if len(set(paths)) < len(paths):
        raise OptionError("two outputs have the same name; give each output its own")
    if os.path.realpath(options.input) in paths[bool(options.output) :]:
        raise OptionError(f"an output beside the mesh would replace the input {options.input}")


def _write(options: argparse.Namespace, data: MeshData) -> list[str]:
    """Write the mesh; returns the names of data that the format cannot hold."""
    if options.output == STREAM:
        return write_stream(options.format, data)
    return write_data(options.output, data)


def _outputs(options: argparse.Namespace) -> list[str]:
    """Return the paths of all outputs, the mesh first."""
    named = [options.output, options.save_stats, options.save_arrays, options.picture, options.html]
    return [name for name in named if name]


def _length(options: argparse.Namespace, mesh: MeshFile) -> Any:
    """Return the target length; None for the library's default, or if a count is given."""
    length = target_length(options, mesh)
    return length if options.lengths is None else read_array(options.lengths, whole=False)


def _library_options(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options that were given, with arrays read from the files they name."""
    given = given_options(options)
    for name, columns in FILE_OPTIONS.items():
        path = getattr(options, name)
        if path is not None:
            given[name] = read_array(path, columns)
    return given


@contextmanager
def _timed(seconds: dict[str, float], name: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[name] = time.perf_counter() - start


class ProgressLine:
    """Shows progress on a stream once the work has taken longer than `PATIENCE`.

    On a terminal it rewrites one line; in a log it prints one line per sweep.
    """

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream
        self.rewrites = stream.isatty()
        self.start = time.perf_counter()
        self.shown = -1  # the last sweep that was shown

    def __call__(self, sweep: int, phase: str, count: int) -> None:
        """Show a finished phase; `remesh` calls this."""
        passed = time.perf_counter() - self.start
        if passed < PATIENCE or (sweep == self.shown and not self.rewrites):
            return
        self.shown = sweep
        text = f"sweep {sweep + 1}, {passed:.0f} s"
        if self.rewrites:
            print(f"\r\x1b[K{text}, {phase} {count:,}", end="", file=self.stream, flush=True)
        else:
            print(text, file=self.stream, flush=True)

    def clear(self) -> None:
        """Erase the line."""
        if self.rewrites and self.shown >= 0:
            print("\r\x1b[K", end="", file=self.stream, flush=True)


@contextmanager
def _progress(quiet: bool) -> Iterator[ProgressLine | None]:
    if quiet:
        yield None
        return
    progress = ProgressLine(sys.stderr)
    try:
        yield progress
    finally:
        progress.clear()


def _make_picture(options: argparse.Namespace, raw: MeshFile, result: RemeshResult) -> None:
    from .. import viz

    before, after = (raw.V, raw.F), (result.V, result.F)
    viz.picture(options.picture, before, after, lines=_lines(options, result), up=options.up)


def _lines(options: argparse.Namespace, result: RemeshResult) -> tuple[Any, Any]:
    """Return the edges to draw in red; a repair numbers vertices anew, so the raw mesh has none."""
    before = None if is_asked_for(options) else result.input_feature_edges
    return before, result.feature_edges


def _write_page(options: argparse.Namespace, result: RemeshResult) -> None:
    from .. import html_page

    title = Path(options.input).name
    html_page.write_html(options.html, result, title=title, command=options.call, up=options.up)


def _save_stats(options: argparse.Namespace, mesh: MeshFile, result: RemeshResult) -> None:
    content = {
        "input": options.input,
        "output": options.output,
        "notices": mesh.notices,
        **result.report.to_dict(),
    }
    write_file(options.save_stats, (json.dumps(_plain(content), indent=2) + "\n").encode())


def _plain(value: Any) -> Any:
    """Return a value that JSON can represent; NaN and infinity become null."""
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _print_report(
    options: argparse.Namespace, mesh: MeshFile, result: RemeshResult, seconds: dict[str, float]
) -> None:
    for notice in mesh.notices:
        print(f"note: {notice}")
    print(result.report)
    print()
    if options.timing:
        for name, passed in seconds.items():
            print(f"{'remesh, total' if name == 'total' else name:<31}{passed:>12.3f} s")
        print()
    for path in _outputs(options):
        print(f"written: {path}")
    if not options.output:
        print("no mesh was written; -o FILE writes it")
