"""Evolve a capillary surface: minimise, remesh, cut necks, through a schedule of edge lengths."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

from ..core.arguments import (
    asks_to_stop,
    choice,
    count,
    flag,
    function,
    instance,
    items,
    number,
    path,
)
from ..core.vocabulary import FloatArray, IntArray
from ..errors import MeshFormatError, OptionError
from ..files.disk import reason
from ..files.write import write_mesh
from .minimize import Minimum, minimize, unmoved
from .problem import VOLUMES, CapillaryProblem, as_problem, is_held
from .reshape import remeshed, with_cut_necks, without_crumbs, without_parts
from .room import find_lost, found_lost, room_of
from .steps import with_restored_volumes

__all__ = ["Evolution", "Frame", "evolve", "write_frames"]

Backend = Callable[..., Minimum]
FrameCallback = Callable[["Frame"], object]

# Steps of the flow between two remeshings.
_FLOW_STEPS = 4

# A length is done after this many consecutive sweeps that lower the energy by less than this relative
# amount, unless forces grow: they grow for a long time where a surface is about to break.
_SETTLED, _PATIENCE = 1e-5, 3

# Steps of Newton's method at the end, and how often they may move the surface so far that it must be
# remeshed.
_NEWTON_STEPS, _RETURNS = 15, 6


@dataclass(frozen=True)
class Frame:
    """The surface after a sweep.

    Attributes
    ----------
    V, F : (n, 3) float64, (m, 3) int64
    length : float
        Edge length of the last remeshing.
    energy, residual : float
    components : int
    event : str
        "sweep", "cut", "dropped", "fell" or "newton".
    """

    V: FloatArray
    F: IntArray
    length: float
    energy: float
    residual: float
    components: int
    event: str


@dataclass
class Evolution:
    """Result of an evolution; unpacks as ``V, F = evolution``.

    Attributes
    ----------
    minimum : Minimum
        The surface at the end.
    n_cuts : int
        Number of necks that were cut.
    frames : list of Frame
        One per sweep with ``frames=True``, else empty.
    history : list of dict
        "length", "energy", "residual", "faces", "components" after every sweep.
    """

    minimum: Minimum
    n_cuts: int = 0
    frames: list[Frame] = field(default_factory=list)
    history: list[dict[str, float]] = field(default_factory=list)

    def __iter__(self) -> Any:
        """Unpack into V and F."""
        return iter((self.minimum.V, self.minimum.F))


def evolve(
    problem: CapillaryProblem,
    lengths: Sequence[float],
    *,
    sweeps: int = 40,
    split: float = 1.5,
    collapse: float = 0.5,
    remeshing: bool = True,
    cut_necks: bool = True,
    volume: Literal["shared", "per_component"] = "shared",
    tol: float = 1e-8,
    backend: Backend = minimize,
    frames: bool = False,
    callback: Callable[[Frame], object] | None = None,
) -> Evolution:
    """Minimise the energy of a surface that may stretch, break and be refined on the way.

    For each length in turn, sweeps remesh the surface, restore its volumes, let it flow and cut its
    necks, until the energy settles. Newton's method then finds the minimum on the last triangles.

    Parameters
    ----------
    problem : CapillaryProblem
        Not changed. Its wires are never moved, split or collapsed.
    lengths : sequence of float
        Target edge lengths, usually falling. Near wires with shorter edges the length is graded.
    sweeps : int
        The most sweeps per length.
    split, collapse : float
        Edges longer than ``split`` times the length are split, edges shorter than ``collapse`` times the
        length are collapsed.
    remeshing : bool
        Without remeshing, the triangles stay as they are, however bad they become, and no neck is cut.
    cut_necks : bool
        Cut necks that have thinned to three edges.
    volume : {"shared", "per_component"}
        Whether pieces share their volume (and pressure) after a cut, or keep the volumes they have.
    tol : float
        Residual for Newton's method at the end.
    backend : callable
        Minimiser on given triangles: `minimize`, or an `EvolverBackend`.
    frames : bool
        Keep the surface after every sweep.
    callback : callable, optional
        Called with a `Frame` after every sweep; if it returns False, the evolution ends.

    Returns
    -------
    Evolution

    Raises
    ------
    OptionError
        A word is unknown, a number is out of range, or an argument has the wrong type.
    """
    factors = _as_factors(split, collapse)
    plan = _Plan(
        lengths=_as_lengths(lengths),
        sweeps=count(sweeps, "sweeps"),
        factors=factors if flag(remeshing, "remeshing") else None,
        cuts=flag(cut_necks, "cut_necks") and remeshing,
        is_apart=choice(volume, "volume", VOLUMES) == "per_component",
        tol=number(tol, "tol", above=0.0),
        backend=function(backend, "backend"),
    )
    log = _Log(flag(frames, "frames"), None if callback is None else function(callback, "callback"))
    run = _Run(as_problem(problem), plan, log)
    last = plan.lengths[-1]
    for L in plan.lengths:
        run.settle(L)
    for _ in range(_RETURNS):
        if run.finish(last) or plan.factors is None:
            break
        run.settle(last)
    return Evolution(run.minimum, run.n_cuts, log.frames, log.history)


def _as_lengths(value: Iterable[float]) -> tuple[float, ...]:
    lengths = items(value, "lengths", "edge lengths")
    if not lengths:
        raise OptionError("lengths is empty: name at least one edge length")
    return tuple(number(L, "lengths", above=0.0, unit="units of V") for L in lengths)


def _as_factors(split: float, collapse: float) -> tuple[float, float]:
    long, short = number(split, "split", above=0.0), number(collapse, "collapse", low=0.0)
    if short >= long:
        raise OptionError(f"collapse must be below split; they are {short:g} and {long:g}")
    return long, short


@dataclass(frozen=True)
class _Plan:
    """The options of one evolution, checked."""

    lengths: tuple[float, ...]
    sweeps: int  # per length, at most
    factors: tuple[float, float] | None  # of the length: edges are split above, collapsed below
    cuts: bool
    is_apart: bool  # pieces keep their own volumes
    tol: float
    backend: Backend


@dataclass
class _Log:
    """Record of all sweeps; passes every frame to the caller, who may cancel."""

    keeps_frames: bool
    callback: FrameCallback | None
    frames: list[Frame] = field(default_factory=list)
    history: list[dict[str, float]] = field(default_factory=list)
    is_cancelled: bool = False

    def note(self, problem: CapillaryProblem, L: float, residual: float, event: str) -> None:
        """Record the surface after a sweep, and call the callback with it."""
        parts, _ = problem.components()
        V, F = problem.V.copy(), problem.F.copy()
        frame = Frame(V, F, L, problem.energy(), residual, parts, event)
        self.history.append(
            {
                "length": L,
                "energy": frame.energy,
                "residual": residual,
                "faces": len(F),
                "components": parts,
            }
        )
        if self.keeps_frames:
            self.frames.append(frame)
        if self.callback is not None and asks_to_stop(self.callback(frame)):
            self.is_cancelled = True

    def is_about_to_break(self) -> bool:
        """Tell whether forces grow while the energy keeps falling, even if only a little."""
        last = self.history[-1 - _PATIENCE :]
        return last[-1]["residual"] > 1.02 * last[0]["residual"] and all(
            two["energy"] < one["energy"] for one, two in pairwise(last)
        )


class _Run:
    """State of one evolution: the current surface, and the last minimum."""

    def __init__(self, problem: CapillaryProblem, plan: _Plan, log: _Log) -> None:
        self.now = problem.taken_apart() if plan.is_apart else problem
        self.plan, self.log = plan, log
        self.minimum = unmoved(self.now, "nothing is left")
        self.n_cuts = 0
        self.room = room_of(self.now)
        self.is_lost = False

    def is_over(self) -> bool:
        """Tell whether the caller has cancelled, no face is left, or there is no equilibrium."""
        return self.log.is_cancelled or self.is_lost or not len(self.now.F)

    def settle(self, L: float) -> None:
        """Remesh and sweep until the energy changes little."""
        best, idle = float("inf"), 0
        for _ in range(self.plan.sweeps):
            if self.is_over():
                return
            if self.plan.factors is not None:
                self.now = remeshed(self.now, L, *self.plan.factors)
            event = self.sweep(L)
            energy = self.now.energy()
            if event != "sweep" or not energy >= best - _SETTLED * abs(energy):
                best, idle = energy, 0
            else:
                idle += 1
            if idle >= _PATIENCE and not self.log.is_about_to_break():
                return

    def finish(self, L: float) -> bool:
        """Run Newton's method; returns whether it found a minimum, or no lower energy.

        The flow settles at saddles too; Newton's method leads away from them.
        """
        if self.is_over():
            return True
        before = self.now.energy()
        self._minimise("newton", tol=self.plan.tol, steps=_NEWTON_STEPS)
        self.log.note(self.now, L, self.minimum.residual, "newton")
        is_lower = self.now.energy() < before - _SETTLED * abs(before)
        return self.minimum.converged or not is_lower

    def sweep(self, L: float) -> str:
        """Let the surface flow, and cut its necks; returns what happened, as `Frame.event` does."""
        self._minimise("flow", steps=_FLOW_STEPS)
        event = self._cut(L) if self.plan.cuts else "sweep"
        event = self._let_fall() or event
        self.log.note(self.now, L, self.minimum.residual, event)
        return event

    def _let_fall(self) -> str:
        """Drop what has come off and left; says that there is no equilibrium if wires hold it."""
        lost = find_lost(self.now, self.room)
        if not len(lost):
            return ""
        kept = without_parts(self.now, lost)
        if kept is None:
            self.is_lost = True
            self.minimum = replace(
                self.minimum, converged=False, stop=found_lost(self.now, self.room)
            )
            return ""
        self.now = kept
        return "fell"

    def _minimise(self, method: str, **options: Any) -> None:
        if not is_held(self.now):
            self.minimum = unmoved(self.now, "nothing holds the surface")
            return
        found = self.plan.backend(self.now, method, **options)
        self.minimum = instance(found, "the result of backend", Minimum, "a Minimum")
        self.now = self.minimum.problem

    def _cut(self, L: float) -> str:
        """Cut necks and drop crumbs; returns the event."""
        cut, n_cuts = with_cut_necks(self.now, L)
        kept = without_crumbs(cut, L)
        if kept is self.now:
            return "sweep"
        self.n_cuts += n_cuts
        if not len(kept.F):
            self.now = kept
            self.minimum = replace(
                self.minimum, problem=kept, energy=kept.energy(), area=0.0,
                volume=kept.total_volume(), stop="nothing is left",
            )  # fmt: skip
            return "dropped"
        self.now = with_restored_volumes(kept.taken_apart() if self.plan.is_apart else kept)
        return "cut" if n_cuts else "dropped"


def write_frames(folder: str | Path, frames: Sequence[Frame]) -> list[Path]:
    """Write a sequence of meshes, ``frame_0000.ply`` and so on, that viewers can play.

    Parameters
    ----------
    folder : str or path
        Created if it does not exist.
    frames : sequence of Frame
        Frames of an `Evolution` with ``frames=True``.

    Returns
    -------
    list of Path

    Raises
    ------
    MeshFormatError
        A file cannot be written.
    """
    target = Path(path(folder, "folder"))
    known = items(frames, "frames", "Frame")
    for frame in known:
        instance(frame, "frames", Frame, "a sequence of Frame")
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise MeshFormatError(f"cannot write {target}: {reason(error)}") from error
    written = [target / f"frame_{k:04d}.ply" for k in range(len(known))]
    for file, frame in zip(written, known, strict=True):
        write_mesh(file, frame.V, frame.F)
    return written
