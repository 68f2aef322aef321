"""Contenders taking turns (A B C A B C ...), so that a disturbance of the machine meets all alike."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from remeshvec import MeshInputError

from .contenders import Contender
from .measures import measure
from .meshes import Sample
from .peers import Arrays
from .workers import Failed, Worker, save_mesh

Row = dict[str, Any]  # of one contender on one mesh


class Effort(NamedTuple):
    """How long to measure."""

    repeat: int = 5  # turns of each; 0: the first call only, one process at a time
    limit: float = 60.0  # seconds that a call may take
    budget: float = 30.0  # seconds of one contender after which it takes no further turn
    has_quality: bool = True  # whether the results are measured: seconds for a million faces


class Entrant(NamedTuple):
    """A contender on a mesh."""

    contender: Contender
    sample: Sample


def race(entrants: Sequence[Entrant], effort: Effort) -> list[Row]:
    """Call each once, measure the quality, then time in turns; one row each, in their order."""
    with tempfile.TemporaryDirectory(prefix="remeshvec-race-") as folder:
        workers = [_worker(entrant, Path(folder)) for entrant in entrants]
        try:
            rows = _first_calls(entrants, workers, effort)
            for _ in range(effort.repeat):
                for worker, row in zip(workers, rows, strict=True):
                    if "failed" not in row and sum(row["seconds"]) < effort.budget:
                        _take_turn(worker, row, effort.limit)
        finally:
            for worker in workers:
                worker.stop()
    for row in rows:
        if row.get("seconds") and "failed" not in row:
            row["median"] = median(row["seconds"])
            row["cpu_median"] = median(row["cpu_seconds"]) if row["cpu_seconds"] else None
    return rows


def _worker(entrant: Entrant, folder: Path) -> Worker:
    place = folder / entrant.sample.name
    if not place.exists():
        save_mesh(place, entrant.sample)
    return Worker(entrant.contender, place, entrant.sample.length)


def _first_calls(
    entrants: Sequence[Entrant], workers: Sequence[Worker], effort: Effort
) -> list[Row]:
    rows: list[Row] = []
    known: dict[str, Any] = {}  # what our result measures, by digest: the same on more threads
    for (contender, sample), worker in zip(entrants, workers, strict=True):
        rows.append(_first_call(worker, sample, effort, known))
        said = rows[-1].get("failed") or f"{rows[-1]['first']:.3f} s"
        print(f"  {sample.name}, {contender.name}: {said}", file=sys.stderr, flush=True)
        if effort.repeat == 0:
            worker.stop()
    return rows


def _first_call(worker: Worker, sample: Sample, effort: Effort, known: dict[str, Any]) -> Row:
    try:
        first, result = worker.first(effort.limit)
        quality = known.get(first.digest, {})
        if effort.has_quality and not quality:
            quality = _measure(sample, result)
    except Failed as reason:
        return {"failed": str(reason)}
    if first.digest:
        known[first.digest] = quality
    return {
        "first": first.seconds,
        "bytes_before": first.bytes_before,
        "bytes_peak": first.bytes_peak,
        "digest": first.digest,
        "seconds": [],
        "cpu_seconds": [],
        "quality": quality,
    }


def _measure(sample: Sample, result: Arrays) -> dict[str, float]:
    try:
        return measure(sample, *result)
    except MeshInputError as error:
        raise Failed(f"its result is no mesh: {error}") from None


def _take_turn(worker: Worker, row: Row, limit: float) -> None:
    try:
        turn = worker.turn(limit)
    except Failed as reason:
        row["failed"] = str(reason)
        return
    row["seconds"].append(turn.seconds)
    if turn.cpu_seconds is not None:
        row["cpu_seconds"].append(turn.cpu_seconds)
