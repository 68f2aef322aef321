"""Evolve a capillary surface: minimise, remesh, cut necks, through a schedule of edge lengths."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..core.check import positive_count, positive_number
from ..core.vocabulary import FloatArray
from ..errors import OptionError
from ..files.plain import write_mesh
from ..mesh.repair import count_edges
from ..pipeline.remesh import remesh
from .energies import areas
from .minimize import Minimum, minimize, restore_volumes
from .necks import cut_necks as cut
from .problem import CapillaryProblem

__all__ = ["Evolution", "Frame", "evolve", "write_frames"]

Backend = Callable[..., Minimum]

# Steps of the flow between two remeshings.
_FLOW_STEPS = 4

# Sine of the smallest angle below which triangles have to be replaced before the flow goes on.
_THIN_FACE = 0.2

# So many sweeps in a row that lower the energy by less, relative to it, are the last ones of a length;
# unless forces grow, as they do for long where a surface is about to break.
_SETTLED, _PATIENCE = 1e-5, 3

# Steps of Newton's method at the end, and times that they may lead so far away that the surface has to be
# remeshed.
_NEWTON_STEPS, _RETURNS = 15, 6

# A component without wires and with less volume than this many cubed edge lengths is dropped.
_CRUMB = 0.5


@dataclass(frozen=True)
class Frame:
    """The surface after a sweep.

    Attributes
    ----------
    V, F : (n, 3) float64, (m, 3) int64
    length : float
        Edge length it was remeshed to.
    energy, residual : float
    components : int
    event : str
        "sweep", "cut", "dropped" or "newton".
    """

    V: FloatArray
    F: NDArray[np.int64]
    length: float
    energy: float
    residual: float
    components: int
    event: str


@dataclass
class Evolution:
    """How an evolution went; unpacks as ``V, F = evolution``.

    Attributes
    ----------
    minimum : Minimum
        Where it ended.
    n_cuts : int
        Necks cut.
    frames : list of Frame
        One a sweep, where ``frames=True``.
    history : list of dict
        "length", "energy", "residual", "faces", "components" after every sweep.
    """

    minimum: Minimum
    n_cuts: int = 0
    frames: list[Frame] = field(default_factory=list)
    history: list[dict[str, float]] = field(default_factory=list)

    def __iter__(self) -> Any:
        """Unpack."""
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

    For each length in turn: steps of the flow, remeshing, restored volumes, cut necks, until the energy
    settles; at last Newton's method on the triangles that are there.

    Parameters
    ----------
    problem : CapillaryProblem
        Not changed. Its wires are never moved, split or collapsed.
    lengths : sequence of float
        Target edge lengths, usually falling. Near wires with shorter edges the length is graded.
    sweeps : int
        Most sweeps a length.
    split, collapse : float
        Edges longer and shorter than these times the length are split and collapsed.
    remeshing : bool
        Without it the triangles stay as they are, whatever happens to them, and no neck is cut.
    cut_necks : bool
        Cut necks that have thinned to three edges.
    volume : {"shared", "per_component"}
        After a cut, whether pieces share their volume (and pressure), or keep what they have.
    tol : float
        Residual for Newton's method at the end.
    backend : callable
        What minimises on given triangles: `minimize`, or an `EvolverBackend`.
    frames : bool
        Keep the surface after every sweep.
    callback : callable, optional
        Called with a `Frame` after every sweep; False ends the evolution.

    Returns
    -------
    Evolution

    Raises
    ------
    OptionError
        Options that do not exist.
    """
    steps = [positive_number(L, "lengths", "units of V") for L in lengths]
    if not steps:
        raise OptionError("lengths is empty: name at least one edge length")
    most = positive_count(sweeps, "sweeps")
    if volume not in ("shared", "per_component"):
        raise OptionError(f"volume must be one of shared, per_component; got {volume!r}")
    run = _Run(
        problem, backend, cut_necks and remeshing, volume == "per_component", frames, callback
    )
    reshape = (split, collapse) if remeshing else None
    for L in steps:
        run.settle(L, most, reshape)
    for _ in range(_RETURNS):
        if run.finish(steps[-1], tol) or reshape is None:
            break
        run.settle(steps[-1], most, reshape)
    return Evolution(run.minimum, run.n_cuts, run.frames, run.history)


class _Run:
    """State of one evolution."""

    def __init__(
        self,
        problem: CapillaryProblem,
        backend: Backend,
        cuts: bool,
        apart: bool,
        keep: bool,
        callback: Callable[[Frame], object] | None,
    ) -> None:
        self.now = problem.taken_apart() if apart else problem
        self.cuts, self.apart, self.keep, self.callback = cuts, apart, keep, callback
        self.backend = backend
        self.minimum = minimize(self.now, "flow", steps=1)
        self.n_cuts = 0
        self.is_cancelled = False
        self.best, self.idle = float("inf"), 0  # energy, sweeps since
        self.check: Callable[..., bool] | None = None  # of the triangles, after every step
        self.frames: list[Frame] = []
        self.history: list[dict[str, float]] = []

    def settle(self, L: float, most: int, reshape: tuple[float, float] | None) -> None:
        """Sweep until little changes."""
        self.best, self.idle = float("inf"), 0
        for _ in range(most):
            if self.is_cancelled or not len(self.now.F):
                return
            if reshape is not None:
                self.remesh(L, *reshape)
            if self.sweep(L):
                return

    def finish(self, L: float, tol: float) -> bool:
        """Run Newton's method; tells whether it found a minimum, or nothing better, near by.

        From a saddle, where the flow settles as well, it leads away.
        """
        if self.is_cancelled or not len(self.now.F):
            return True
        before = self.now.energy()
        self.minimum = self.backend(
            self.now, "newton", tol=tol, steps=_NEWTON_STEPS, callback=self.check
        )
        self.now = self.minimum.problem
        self.note(L, "newton")
        is_lower = self.now.energy() < before - _SETTLED * abs(before)
        return self.minimum.converged or not is_lower

    def remesh(self, L: float, split: float, collapse: float) -> None:
        """Remesh all but the wires, and restore the volumes before anything else."""
        now = self.now
        result = remesh(
            now.V,
            now.F,
            _graded(now, L),
            preset="fast",
            iterations=2,
            split=split,
            collapse=collapse,
            feature_angle=None,
            feature_edges=_inner_wires(now),
            fixed_vertices=np.flatnonzero(now.fixed),
            boundary="fixed",
            face_labels=now.body,
        )
        fixed = np.zeros(len(result.V), np.bool_)
        mapped = result.vertex_map
        fixed[mapped[now.fixed & (mapped >= 0)]] = True
        self.now = now.with_mesh(
            result.V,
            F=result.F,
            fixed=fixed,
            fixed_edges=mapped[now.fixed_edges],
            body=result.face_labels,
        )
        self.now = self.now.with_mesh(restore_volumes(self.now))

    def sweep(self, L: float) -> bool:
        """Let the surface flow, and cut its necks; tells whether it has settled."""
        self.minimum = self.backend(self.now, "flow", steps=_FLOW_STEPS, callback=self.check)
        self.now = self.minimum.problem
        event = self._cut(L) if self.cuts else "sweep"
        self.note(L, event)
        energy = self.now.energy()
        if event != "sweep" or not energy >= self.best - _SETTLED * abs(energy):
            self.best, self.idle = energy, 0
        else:
            self.idle += 1
        last = self.history[-1 - _PATIENCE :]
        # About to break: forces grow, and the energy falls all the time, if only a little.
        is_growing = last[-1]["residual"] > 1.02 * last[0]["residual"] and all(
            two["energy"] < one["energy"] for one, two in pairwise(last)
        )
        return self.is_cancelled or (self.idle >= _PATIENCE and not is_growing)

    def _cut(self, L: float) -> str:
        now = self.now
        found = cut(now.V, now.F, now.fixed, perimeter=2.0 * L)
        if found.n_cuts:
            added = np.arange(len(now.F), len(found.F))
            body = np.append(now.body, np.zeros(len(added), np.int64))
            self.now = now.with_mesh(found.V, F=found.F, fixed=now.fixed[found.source], body=body)
            self.n_cuts += found.n_cuts
        dropped = self._drop_crumbs(L)
        if not len(self.now.F):
            self.minimum = replace(
                self.minimum, problem=self.now, energy=self.now.energy(), area=0.0,
                volume=self.now.total_volume(), stop="nothing is left",
            )  # fmt: skip
            return "dropped"
        if (found.n_cuts or dropped) and self.apart:
            self.now = self.now.taken_apart()
        if found.n_cuts or dropped:
            self.now = self.now.with_mesh(restore_volumes(self.now))
        return "cut" if found.n_cuts else "dropped" if dropped else "sweep"

    def _drop_crumbs(self, L: float) -> bool:
        """Drop pieces that no wire holds and that enclose nothing worth a triangle."""
        now = self.now
        _, part = now.components()
        held = np.unique(part[now.fixed[now.F].any(axis=1)])
        T = now.V[now.F]
        size = np.abs(
            np.bincount(part, np.einsum("fx,fx->f", T[:, 0], np.cross(T[:, 1], T[:, 2])) / 6)
        )
        is_crumb = (size < _CRUMB * L**3) | (len(now.targets) == 0)
        is_crumb[held] = False
        if not is_crumb.any():
            return False
        kept = ~is_crumb[part]
        self.now = now.with_mesh(now.V, F=now.F[kept], body=now.body[kept])
        return True

    def note(self, L: float, event: str) -> None:
        """Record a frame."""
        count, _ = self.now.components()
        frame = Frame(
            self.now.V.copy(),
            self.now.F.copy(),
            L,
            self.now.energy(),
            self.minimum.residual,
            count,
            event,
        )
        self.history.append(
            {
                "length": L,
                "energy": frame.energy,
                "residual": frame.residual,
                "faces": len(frame.F),
                "components": count,
            }
        )
        if self.keep:
            self.frames.append(frame)
        if self.callback is not None and self.callback(frame) is False:
            self.is_cancelled = True


def _is_fit(_: int, problem: CapillaryProblem, *__: float) -> bool:
    """Tell whether the flow may go on with these triangles: necks run away in a few steps."""
    T = problem.V[problem.F]
    squared = np.sort(((T - np.roll(T, 1, axis=1)) ** 2).sum(axis=2), axis=1)
    area = areas(T)
    # Twice the area over the two longer sides is the sine of the smallest angle.
    sine = 2.0 * area / np.sqrt(np.maximum(squared[:, 1] * squared[:, 2], np.finfo(float).tiny))
    return bool(sine.min() > _THIN_FACE)


def _graded(problem: CapillaryProblem, L: float) -> float | FloatArray:
    """Target lengths: L, but those of the wires at these, so that no wire has to be split."""
    edges = problem.fixed_edges
    if not len(edges):
        return L
    size = np.linalg.norm(problem.V[edges[:, 0]] - problem.V[edges[:, 1]], axis=1)
    lengths = np.full(len(problem.V), float(L))
    lengths[edges.ravel()] = 0.0
    np.maximum.at(lengths, edges.ravel(), np.repeat(size, 2))
    return np.minimum(lengths, L) if (size <= 1.2 * L).all() else lengths


def _inner_wires(problem: CapillaryProblem) -> NDArray[np.int64] | None:
    """Wires with faces on both sides."""
    if not len(problem.fixed_edges):
        return None
    unique, count = count_edges(problem.F)
    n = len(problem.V)
    inner = unique[count > 1]
    wires = np.sort(problem.fixed_edges, axis=1)
    found = wires[np.isin(wires[:, 0] * n + wires[:, 1], inner[:, 0] * n + inner[:, 1])]
    return found if len(found) else None


def write_frames(folder: str | Path, frames: Sequence[Frame]) -> list[Path]:
    """Write a sequence of meshes, ``frame_0000.ply`` and so on, that viewers play.

    Returns
    -------
    list of Path
    """
    path = Path(folder)
    path.mkdir(parents=True, exist_ok=True)
    written = []
    for k, frame in enumerate(frames):
        written.append(path / f"frame_{k:04d}.ply")
        write_mesh(written[-1], frame.V, frame.F)
    return written
