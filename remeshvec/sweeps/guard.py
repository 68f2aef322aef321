"""Guards of a sweep: what follows the splits is tried on a copy, and tried again with more of it held.

So no phase needs to know what must not happen, whichever of them would do it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..core.vocabulary import Mesh
from .work import Work

__all__ = ["Guard", "HoldingGuard"]

# Times that a sweep is tried, with more of the mesh held each time, before it is left out.
_ATTEMPTS = 8


class Guard:
    """Lets everything pass."""

    def attempts(self, work: Work, is_compact: bool = False) -> Iterator[Work]:
        """Yield the work to be changed, once or several times, and judge it after each."""
        yield work


class HoldingGuard(Guard):
    """Changes copies of a mesh until one is good; subclasses say what is good, and what to hold."""

    def remember(self, mesh: Mesh) -> None:
        """Take in a compact mesh before it is changed."""
        raise NotImplementedError

    def offenders(self, mesh: Mesh) -> Any:
        """Return what is wrong with a changed mesh; nothing where its length is 0."""
        raise NotImplementedError

    def hold(self, mesh: Mesh, offenders: Any, attempt: int) -> None:
        """Hold the mesh before the change where offenders came from it, more so in later attempts."""
        raise NotImplementedError

    def release(self, mesh: Mesh) -> None:
        """Let go of all that was held since the mesh was remembered."""
        raise NotImplementedError

    def attempts(self, work: Work, is_compact: bool = False) -> Iterator[Work]:
        """Yield copies of the work; the first good one becomes the work, which else stays as it is."""
        monitor = work.monitor
        if not is_compact:
            work.compact()
        with monitor.watch.time("deviation"):
            self.remember(work.mesh)
        counts = dict(monitor.counts[-1])
        for attempt in range(_ATTEMPTS):
            monitor.counts[-1] = dict(counts)
            trial = work.trial()
            yield trial
            with monitor.watch.time("deviation"):
                offenders = self.offenders(trial.mesh)
                if not len(offenders):
                    self.release(trial.mesh)
                    work.adopt(trial)
                    return
                if monitor.is_cancelled:
                    break
                self.hold(work.mesh, offenders, attempt)
        self.release(work.mesh)
        work.step = np.inf
        monitor.counts[-1] = counts | {
            name: 0 for name in ("collapse", "flip") if name not in counts
        }
