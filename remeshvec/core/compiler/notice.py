"""What happens during a slow first call, while Numba compiles kernels; lines that say it."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event

__all__ = ["compile_notice", "print_once"]

_printed: set[str] = set()


def print_once(line: str) -> None:
    """Print a line for the user, unless one that begins with the same words was printed before."""
    start = " ".join(line.split()[:5])
    if start not in _printed:
        _printed.add(start)
        print(f"remeshvec: {line}", file=sys.stderr, flush=True)


class _Listener(event.Listener):
    """Notices when Numba compiles our kernels (not when it loads them from its cache).

    Prints one line if a call asked for that. Pauses the garbage collector meanwhile: a compilation makes
    millions of objects that live until it ends, and scanning them again and again takes a fifth of the
    time.
    """

    def __init__(self) -> None:
        self.requested = 0
        self.depth = 0
        self.paused = False

    def on_start(self, event: Any) -> None:
        if not _is_ours(event):
            return
        self.depth += 1
        if self.depth == 1 and gc.isenabled():
            self.paused = True
            gc.disable()
        if self.requested:
            print_once("compiling kernels for this machine (once, about 20 s; then cached)")

    def on_end(self, event: Any) -> None:
        if not _is_ours(event):
            return
        self.depth -= 1
        if self.depth == 0 and self.paused:
            self.paused = False
            gc.enable()


def _is_ours(event: Any) -> bool:
    """Tell whether an event is about a kernel of ours.

    Numba compiles one kernel at a time, and its helpers within.
    """
    dispatcher = (event.data or {}).get("dispatcher")
    module = getattr(getattr(dispatcher, "py_func", None), "__module__", None) or ""
    return module.startswith("remeshvec")


_listener = _Listener()
event.register("numba:compile", _listener)


@contextmanager
def compile_notice() -> Iterator[None]:
    """Print one line if the code inside has to compile kernels."""
    _listener.requested += 1
    try:
        yield
    finally:
        _listener.requested -= 1
