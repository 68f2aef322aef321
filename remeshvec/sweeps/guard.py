"""Guards of a sweep: what follows the splits is tried on a copy, and tried again with more of it held.

So no phase needs to know what must not happen, whichever of them would do it. What must not happen is
said by checks: each remembers a mesh, and names places where a later mesh is not as it should be.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from ..core.lazy import Lazy
from ..core.vocabulary import DEAD, NONE, BoolArray, FloatArray, IndexArray, Mesh, Tree
from ..reference.bvh import build_tree, closest_faces
from .holding import hold, let_go, rings_around
from .work import Work

__all__ = ["Check", "Guard", "HoldingGuard", "LazyTree", "Offenders", "lazy_tree", "tree_of"]

# Rings of faces that are held around what is wrong, in every attempt; then a sweep is left out.
_RINGS = (0, 1, 1, 2, 2, 3, 4, 6, 8, 12)


# Not all checks need a tree, which takes about as long as a phase.
LazyTree = Lazy[Tree]


class Offenders(NamedTuple):
    """Where a mesh is not good."""

    points: FloatArray  # (k, 3) places
    vertices: (
        IndexArray  # (j,) vertices of the changed mesh, which may say better where this came from
    )

    @property
    def size(self) -> int:
        """Number of places and vertices."""
        return len(self.points) + len(self.vertices)


class Check(Protocol):
    """Says where a mesh is worse than an earlier one, or than it may be."""

    def remember(self, mesh: Mesh, tree: LazyTree) -> None:
        """Take in a compact mesh before it is changed; ``tree()`` is the tree over its faces."""

    def offenders(self, mesh: Mesh, tree: LazyTree) -> Offenders:
        """Return where the changed mesh is not good; ``tree()`` is over its faces."""


class Guard:
    """Lets everything pass."""

    def attempts(self, work: Work, is_compact: bool = False) -> Iterator[Work]:
        """Yield the work to be changed, once or several times, and judge it after each."""
        yield work


class HoldingGuard(Guard):
    """Changes copies of a mesh until one is good; holds the mesh before where a check says so.

    Parameters
    ----------
    checks : sequence of Check
    parallel : bool
    """

    def __init__(self, checks: Sequence[Check], parallel: bool) -> None:
        self.checks = checks
        self.parallel = parallel

    def attempts(self, work: Work, is_compact: bool = False) -> Iterator[Work]:
        """Yield copies of the work; the first good one becomes the work, which else stays as it is."""
        monitor = work.monitor
        if not is_compact:
            work.compact()
        with monitor.watch.time("guard"):
            tree = lazy_tree(work.mesh, self.parallel)
            for check in self.checks:
                check.remember(work.mesh, tree)
        held = np.zeros(len(work.mesh.X), np.bool_)
        counts = dict(monitor.counts[-1])
        for attempt in range(len(_RINGS)):
            monitor.counts[-1] = dict(counts)
            trial = work.trial()
            yield trial
            with monitor.watch.time("guard"):
                offenders = self._offenders(trial.mesh)
                if not offenders.size:
                    let_go(trial.mesh, held)
                    work.adopt(trial)
                    return
                if monitor.is_cancelled:
                    break
                work.was_guarded = True
                held |= self._hold(work.mesh, tree, offenders, attempt)
        let_go(work.mesh, held)
        work.step = np.inf
        monitor.counts[-1] = counts | {
            name: 0 for name in ("collapse", "flip") if name not in counts
        }

    def _offenders(self, mesh: Mesh) -> Offenders:
        """Return what the first check finds that finds something; cheap ones come first."""
        tree = lazy_tree(mesh, self.parallel)
        for check in self.checks:
            found = check.offenders(mesh, tree)
            if found.size:
                break
        return found

    def _hold(self, mesh: Mesh, tree: LazyTree, offenders: Offenders, attempt: int) -> BoolArray:
        """Hold a compact mesh around offenders, and rings of faces more; returns what is new.

        Trials keep the numbers of vertices, so these say where an offender came from even on a thin
        part, the other side of which may be closer.
        """
        at = [offenders.vertices]
        if len(offenders.points):
            anywhere = np.full(len(offenders.points), NONE, np.int32)
            faces, _ = closest_faces(tree(), offenders.points, anywhere, 0.0, self.parallel)
            at.append(mesh.origin.reshape(-1, 3)[faces].ravel())
        return hold(mesh, rings_around(mesh, np.concatenate(at), _RINGS[attempt]))


def lazy_tree(mesh: Mesh, parallel: bool) -> LazyTree:
    """Return the tree over the faces of a mesh, to be built where a check asks for it."""
    return Lazy(lambda: tree_of(mesh, parallel))


def tree_of(mesh: Mesh, parallel: bool) -> Tree:
    """Build a tree over the faces of a mesh that are left, as one patch."""
    alive = mesh.origin[::3] != DEAD
    F = mesh.origin.reshape(-1, 3)[alive]
    new = np.cumsum(alive) - 1
    twin = mesh.twin.reshape(-1, 3)[alive].ravel()
    twin = np.where(twin == NONE, NONE, 3 * new[twin // 3] + twin % 3).astype(np.int32)
    return build_tree(mesh.X, F, twin, np.zeros(len(F), np.int32), parallel)
