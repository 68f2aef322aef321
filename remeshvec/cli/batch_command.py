"""``remeshvec batch``: remesh many files in parallel; continue an interrupted run."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import statistics
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import remeshvec

from ..batch.many import one_line, warm_up
from ..batch.one_file import with_feature_data
from ..batch.progress import bar
from ..core.threads import available_threads
from ..errors import MeshFormatError, OptionError
from ..files.data_files import check_data_writable, read_data, write_data
from ..files.disk import check_writable, write_file
from ..files.mesh_files import MeshFile
from ..interop.mesh_data import carry
from ..processes.client import check_workers, connected, run_on_client
from ..processes.pool import run_in_processes
from ..processes.tasks import run_here
from .arguments import batch_parser, given_options, parse, target_length
from .batch_files import FileJob, find_jobs, refuse_collisions
from .batch_table import COLUMNS, MEASURES, ResultTable, Row, write_parquet

__all__ = ["EXIT_SOME_FAILED", "parsed", "run"]

EXIT_SOME_FAILED = 3
_SHOWN = 10  # failures in the summary on the terminal; the table lists all

# Arguments that do not influence the resulting meshes.
_NOT_OPTIONS = (
    "inputs",
    "out",
    "format",
    "workers",
    "scheduler",
    "timeout",
    "force",
    "table",
    "quiet",
    "threads",
)


def parsed(words: Sequence[str]) -> argparse.Namespace:
    """Parse the arguments after ``batch``."""
    return parse(batch_parser(), words)


def run(options: argparse.Namespace) -> int:
    """Remesh all files that are not done yet; return the exit status."""
    start = time.perf_counter()
    batch = _prepared(options)
    todo = [job for job in batch.jobs if options.force or not _is_done(job, batch)]
    for job in set(batch.jobs).difference(todo):
        batch.current[job.output] = batch.table.rows[job.output]
    skipped = len(batch.current)
    if skipped and not options.quiet:
        print(f"{skipped:,} of {len(batch.jobs):,} meshes are done already", flush=True)
    with _cluster(todo, options) as client:
        batch.table.open()
        try:
            _run_jobs(todo, batch, client)
        finally:  # after an interrupt too: the table is complete, the summary counts missing meshes
            batch.table.close()
            summary = _summary(batch, skipped, time.perf_counter() - start)
            write_file(_summary_file(options), (json.dumps(summary, indent=2) + "\n").encode())
            if _is_parquet(options):
                write_parquet(options.table, batch.table.in_order())
            if not options.quiet:
                _print(summary, options)
    return EXIT_SOME_FAILED if summary["failed"] else 0


class _Batch(NamedTuple):
    """The jobs of a run, and the rows known so far."""

    options: argparse.Namespace
    jobs: list[FileJob]
    table: ResultTable
    recipe: str  # digest of the options that influence the results
    current: dict[str, Row]  # rows of finished jobs, failed ones included, by output name

    def fresh(self, job: FileJob) -> Row:
        """Return the row of a job before it runs: names, state of the input, options and version."""
        row: Row = dict.fromkeys(COLUMNS, "") | {"input": job.input, "output": job.output}
        try:
            found = os.stat(job.input)
            row |= {"input_bytes": found.st_size, "input_mtime_ns": found.st_mtime_ns}
        except OSError:  # the file is gone; reading it will raise the error
            pass
        return row | {"options": self.recipe, "version": remeshvec.__version__}


def _prepared(options: argparse.Namespace) -> _Batch:
    """Find all files, and refuse invalid arguments before any work starts."""
    _check_arguments(options)
    table = ResultTable(_table_file(options))
    made = {os.path.realpath(os.path.join(options.out, name)) for name in table.rows}
    suffix = f".{options.format}" if options.format else None
    jobs = find_jobs(options.inputs, options.out, suffix, made)
    written = [table.path, _summary_file(options)]
    written += [options.table] if _is_parquet(options) else []
    refuse_collisions(jobs, written)
    for folder in sorted({options.out, *(os.path.dirname(job.path) for job in jobs)}):
        try:
            os.makedirs(folder, exist_ok=True)
        except OSError as error:
            raise MeshFormatError(f"cannot write to {folder}: {error.strerror}") from error
    for path in written:
        check_writable(path)
    for job in {os.path.splitext(job.path)[1]: job for job in jobs}.values():
        check_data_writable(job.path)
    return _Batch(options, jobs, table, _recipe(options), {})


def _check_arguments(options: argparse.Namespace) -> None:
    if options.adaptive is None and (options.min_length or options.max_length):
        raise OptionError("--min-length and --max-length need --adaptive")
    if options.scheduler is not None and options.timeout is not None:
        raise OptionError(
            "--timeout and --scheduler exclude each other: a client cannot end a task"
        )
    if options.table and Path(options.table).suffix.lower() not in (".csv", ".parquet"):
        raise OptionError(f"--table {options.table}: the suffix must be .csv or .parquet")
    if _is_parquet(options):
        try:
            import pyarrow  # noqa: F401
        except ImportError:
            raise OptionError("Parquet needs the package pyarrow (pip install pyarrow)") from None


def _is_parquet(options: argparse.Namespace) -> bool:
    return bool(options.table) and Path(options.table).suffix.lower() == ".parquet"


def _table_file(options: argparse.Namespace) -> str:
    """Return the CSV table that rows are appended to; rows cannot be appended to Parquet files."""
    if options.table and not _is_parquet(options):
        return str(options.table)
    return os.path.join(options.out, "results.csv")


def _summary_file(options: argparse.Namespace) -> str:
    return os.path.join(options.out, "summary.json")


def _recipe(options: argparse.Namespace) -> str:
    """Return a digest of the options that influence the results."""
    chosen = {k: v for k, v in sorted(vars(options).items()) if k not in _NOT_OPTIONS}
    return hashlib.sha256(json.dumps(chosen).encode()).hexdigest()[:12]


def _is_done(job: FileJob, batch: _Batch) -> bool:
    """Tell whether the output exists and was made from this input, these options and this version."""
    row = batch.table.rows.get(job.output)
    if row is None or row["error"] or not os.path.isfile(job.path):
        return False
    same = ("input_bytes", "input_mtime_ns", "options", "version")
    now = batch.fresh(job)
    return all(str(row[name]) == str(now[name]) for name in same)


# -- the work -------------------------------------------------------------------------------------


def _run_jobs(todo: list[FileJob], batch: _Batch, client: Any) -> None:
    """Run the remaining jobs; add every outcome to the table at once."""
    rows = [batch.fresh(job) for job in todo]  # now: a file that changes during the run is redone
    outcomes: Any = _outcomes(todo, batch.options, client)
    if not batch.options.quiet:
        outcomes = bar(outcomes, len(todo), lambda outcome: outcome.error is not None)
    try:
        for outcome in outcomes:
            row = rows[outcome.number] | {"seconds": f"{outcome.seconds:.4f}"}
            if outcome.error is None:
                row |= outcome.value
            else:
                row["error"] = one_line(outcome.error)
            batch.table.add(row)
            batch.current[row["output"]] = row
    finally:
        outcomes.close()


@contextmanager
def _cluster(todo: list[FileJob], options: argparse.Namespace) -> Iterator[Any]:
    """Connect with the cluster, if there is one, and see that its workers can do the jobs."""
    if options.scheduler is None or not todo:
        yield None
        return
    with connected(options.scheduler) as client:
        if not (options.quiet or client.nthreads()):
            print("waiting for a first worker", flush=True)
        seen = [path for job in todo if os.path.exists(path := os.path.abspath(job.input))]
        check_workers(client, options.out, seen[:1])
        yield client


def _outcomes(todo: list[FileJob], options: argparse.Namespace, client: Any) -> Any:
    if client is not None:
        full = [
            job._replace(input=os.path.abspath(job.input), path=os.path.abspath(job.path))
            for job in todo
        ]
        return run_on_client(_remesh_file, full, options, client, ordered=False)
    workers = options.workers or available_threads()
    if workers == 1 and options.timeout is None:
        return run_here(_remesh_file, todo, options)
    workers = max(1, min(workers, len(todo)))
    return run_in_processes(
        _remesh_file, todo, options, workers, False, options.timeout,
        None if options.timeout is None else warm_up,
    )  # fmt: skip


def _remesh_file(job: FileJob, options: argparse.Namespace) -> Row:
    """Read, remesh and write one file; return the results for its row."""
    data, notices = read_data(job.input)
    mesh = MeshFile(data.V, data.F, notices)
    length = target_length(options, mesh)
    result = remeshvec.remesh(
        mesh.V, mesh.F, length, **with_feature_data(data, given_options(options))
    )
    write_data(job.path, carry(data, result))
    report = result.report
    row: Row = {
        "vertices_before": len(mesh.V),
        "faces_before": len(mesh.F),
        "vertices_after": len(result.V),
        "faces_after": len(result.F),
        "target_length": f"{report.target_length:.9g}",
    }
    for when, measured in (("before", report.quality_before), ("after", report.quality_after)):
        for name, attribute in MEASURES.items():
            row[f"{name}_{when}"] = f"{getattr(measured, attribute):.6g}"
    return row


# -- the summary ----------------------------------------------------------------------------------


def _summary(batch: _Batch, skipped: int, seconds: float) -> dict[str, Any]:
    """Sum up all finished jobs, those of earlier runs included."""
    rows = [batch.current[job.output] for job in batch.jobs if job.output in batch.current]
    good = [row for row in rows if not row["error"]]
    failed = [row for row in rows if row["error"]]
    return {
        "meshes": len(batch.jobs),
        "good": len(good),
        "done_before": skipped,
        "failed": len(failed),
        "not_done": len(batch.jobs) - len(rows),
        "seconds": round(seconds, 3),
        "faces_before": sum(int(row["faces_before"]) for row in good),
        "faces_after": sum(int(row["faces_after"]) for row in good),
        "medians": {name: _medians(good, name) for name in MEASURES} if good else {},
        "failures": {row["input"]: row["error"] for row in failed},
        "options": batch.recipe,
        "version": remeshvec.__version__,
    }


def _medians(rows: list[Row], name: str) -> dict[str, float]:
    return {
        when: statistics.median(float(row[f"{name}_{when}"]) for row in rows)
        for when in ("before", "after")
    }


def _print(summary: dict[str, Any], options: argparse.Namespace) -> None:
    print(
        f"{summary['good']:,} of {summary['meshes']:,} meshes are done, {summary['failed']:,} failed, "
        f"in {summary['seconds']:.1f} s"
    )
    if summary["good"]:
        print(f"faces: {summary['faces_before']:,} before, {summary['faces_after']:,} after")
        for name, median in summary["medians"].items():
            label = f"{name.replace('_', ' ')}, median"
            print(f"{label:<24}{median['before']:>10.4g} before{median['after']:>10.4g} after")
    for shown, (path, error) in enumerate(summary["failures"].items()):
        if shown == _SHOWN:
            print(f"and {summary['failed'] - _SHOWN:,} more, in the table")
            break
        print(f"failed: {path}: {error}")
    print(f"written: {_table_file(options)}, {_summary_file(options)}", flush=True)
    if summary["not_done"]:
        print(
            f"{summary['not_done']:,} meshes are not done; run the same command again to continue",
            file=sys.stderr,
        )
