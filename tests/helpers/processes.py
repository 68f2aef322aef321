"""Child processes in tests: how long to wait for them, which are alive, and what ends a worker."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 60.0  # seconds after which a call hangs

needs_proc = pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs /proc")


class Fatal:
    """Ends the process that unpickles it, as a crash does."""

    def __init__(self, how: Callable, *args: object) -> None:
        self.call = how, args

    def __reduce__(self):
        return self.call


EXIT, KILLED = Fatal(os._exit, 7), Fatal(signal.raise_signal, getattr(signal, "SIGKILL", 15))
SLEEPS = Fatal(time.sleep, 10 * PATIENCE)


def run_python(
    *arguments: object, env: dict[str, str] | None = None, timeout: float | None = None
) -> subprocess.CompletedProcess[str]:
    """Run Python in the root of this checkout and check that it succeeds; ``env`` as it is."""
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        env=surroundings() if env is None else env,
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done


def eventually(condition: Callable[[], bool]) -> bool:
    """Wait until another thread or process makes a condition true; returns whether it did."""
    deadline = time.monotonic() + PATIENCE
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
    return condition()


def children_of(pid: int | str) -> list[str]:
    """Processes that a process has started: those alive, and those that nobody has waited for."""
    found: list[str] = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        with suppress(OSError):  # a thread that has ended
            found += (task / "children").read_text().split()
    return found


def alive(pid: int | str) -> bool:
    """Whether a process exists and is not a zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def surroundings(*paths: object) -> dict[str, str]:
    """Environment of a process that imports this checkout, and modules in other folders."""
    return os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (ROOT, *paths)))}
