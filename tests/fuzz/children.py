"""A process of its own for the calls, with limits of time and memory: it may hang, die or eat memory."""

from __future__ import annotations

import os
import pickle
import resource
import select
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

from .cases import Case

ROOT = Path(__file__).resolve().parents[2]

# Address space of the child: threads and compiled code take 2 GB of it before the first call.
MEMORY = 8 << 30
# Seconds for one call and its checks; a child that has still to load and compile kernels gets more.
SECONDS = 30.0
FIRST_SECONDS = 300.0


class Child:
    """Runs cases one after the other; is started again after it has died."""

    def __init__(self, bounds: bool = False) -> None:
        self.environment = {**os.environ, "NUMBA_NUM_THREADS": "2", "PYTHONPATH": str(ROOT)}
        if bounds:  # compiled otherwise: its cache must not meet that of others
            cache = Path(os.environ.get("NUMBA_CACHE_DIR", ROOT / ".numba_cache"))
            self.environment |= {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": f"{cache}_bounds"}
        self.bounds = bounds
        self.process: Any = None

    def run(self, case: Case, seconds: float | None = None) -> dict[str, str]:
        """Return what is wrong, by invariant."""
        is_first = self.process is None
        if is_first:
            self._start()
        limit = seconds or (FIRST_SECONDS if is_first else SECONDS * (4 if self.bounds else 1))
        try:
            # As a dict: in a test run the class has another name than in the child.
            _send(self.process.stdin, vars(case))
            if not select.select([self.process.stdout], [], [], limit)[0]:
                self.stop()
                return {"time": f"more than {limit:g} s"}
            found: dict[str, str] = _receive(self.process.stdout)
        except (BrokenPipeError, EOFError):
            code = self.process.wait()
            self.process = None
            return {"crash": f"the process ended with {code}"}
        if "memory" in found:
            self.stop()
        return found

    def _start(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.fuzz.children"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=ROOT,
            env=self.environment,
        )

    def stop(self) -> None:
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process.stdin.close()
            self.process.stdout.close()
            self.process = None


def _send(stream: Any, value: Any) -> None:
    data = pickle.dumps(value)
    stream.write(struct.pack("<q", len(data)) + data)
    stream.flush()


def _receive(stream: Any) -> Any:
    head = stream.read(8)
    if len(head) < 8:
        raise EOFError
    return pickle.loads(stream.read(*struct.unpack("<q", head)))


def main() -> None:
    """Answer one case after the other."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what anything prints must not mix with the answers
    from .checks import failures

    while True:
        try:
            case = Case(**_receive(sys.stdin.buffer))
        except EOFError:
            return
        _send(answers, failures(case))


if __name__ == "__main__":
    main()
