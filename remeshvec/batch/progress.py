"""Progress of a batch on the error stream: a bar if the package rich is installed, else plain lines."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any, Protocol, TextIO, TypeVar

__all__ = ["bar"]

Item = TypeVar("Item")

SECONDS = 10.0  # between two lines in a log
BLINK = 0.1  # between two updates on a terminal


class Display(Protocol):
    """A function that shows progress."""

    def __call__(self, done: int, failed: int) -> None:
        """Show how many items are done, including those that failed."""


def bar(
    items: Iterable[Item],
    total: int | None,
    has_failed: Callable[[Item], bool],
    stream: TextIO | None = None,
    noun: str = "meshes",
) -> Iterator[Item]:
    """Yield the items, and show their number on a stream; ``noun`` says what they are."""
    stream = sys.stderr if stream is None else stream
    failed = 0
    try:
        with _display(stream, total, noun) as show:
            for done, item in enumerate(items, 1):
                failed += has_failed(item)
                show(done, failed)
                yield item
                del item
    finally:
        close = getattr(items, "close", None)
        if close is not None:
            close()


@contextmanager
def _display(stream: TextIO, total: int | None, noun: str) -> Iterator[Display]:
    progress = _rich_progress(stream, total, noun) if stream.isatty() else None
    if progress is not None:
        with progress:
            yield lambda done, failed: progress.update(
                progress.task_ids[0], completed=done, failed=f"{failed:,} failed" if failed else ""
            )
        return
    lines = Lines(stream, total, noun)
    try:
        yield lines
    finally:
        lines.end()


def _rich_progress(stream: TextIO, total: int | None, noun: str) -> Any:
    """Return a bar, or None if the package rich is not installed."""
    try:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )
    except ImportError:
        return None
    progress = Progress(
        TextColumn(noun),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("[red]{task.fields[failed]}"),
        console=Console(file=stream),
    )
    progress.add_task("", total=total, failed="")
    return progress


class Lines:
    """Plain text: one line that is rewritten on a terminal, or one line per `SECONDS` in a log."""

    def __init__(self, stream: TextIO, total: int | None, noun: str = "meshes") -> None:
        self.stream, self.total, self.noun = stream, total, noun
        self.rewrites = stream.isatty()
        self.start = self.shown = perf_counter()
        self.last = (0, 0)
        self.told = (0, 0)

    def __call__(self, done: int, failed: int) -> None:
        """Note the state, and print it if the last line is old enough."""
        self.last = done, failed
        now = perf_counter()
        if now - self.shown >= (BLINK if self.rewrites else SECONDS):
            self.shown = now
            self._tell()

    def end(self) -> None:
        """Print the last state."""
        if self.last != self.told:
            self._tell()
        if self.rewrites and self.told != (0, 0):
            print(file=self.stream, flush=True)

    def _tell(self) -> None:
        self.told = self.last
        done, failed = self.last
        passed = perf_counter() - self.start
        text = f"{done:,} of {self.total:,}" if self.total else f"{done:,}"
        text += f" {self.noun}"
        text += f", {failed:,} failed" if failed else ""
        text += f", {passed:.0f} s"
        if self.total and done < self.total:
            text += f", about {passed * (self.total - done) / done:.0f} s left"
        if self.rewrites:
            print(f"\r\x1b[K{text}", end="", file=self.stream, flush=True)
        else:
            print(text, file=self.stream, flush=True)
