"""Sweeps: what was measured holds for the collapses, holes are closed, late splits are in place."""

import sys

import numpy as np
import pytest
from helpers import zoo
from helpers.structure import assert_valid, faces_of

from data.shapes import nonmanifold
from remeshvec import Adaptive, remesh
from remeshvec.core.vocabulary import DEAD
from remeshvec.operations import split
from remeshvec.operations.classify import classify_edges

sweeps = sys.modules["remeshvec.sweeps.phases"]
work = sys.modules["remeshvec.sweeps.work"]


class Spy:
    """Looks on at calls of one function of a module."""

    def __init__(self, monkeypatch, module, name, look):
        self.calls, self.function, self.look = [], getattr(module, name), look
        monkeypatch.setattr(module, name, self)

    def __call__(self, *args, **kwargs):
        self.calls.append(self.look(*args, **kwargs))
        return self.function(*args, **kwargs)


def wavy(n=24, m=12):
    V, F = zoo.upsampled(*zoo.torus(n, m), noise=0.3)
    return zoo.perturb(V, F, 0.05)


CASES = {
    "plain": (wavy, 0.9, {}),
    "fine": (wavy, 0.5, {"iterations": 5}),
    "coarse": (wavy, 2.5, {}),
    "open": (lambda: zoo.upsampled(*zoo.annulus(24, 5), noise=0.3), 0.8, {}),
    "creases": (lambda: zoo.upsampled(*zoo.genus_2(), n=2, noise=0.2), 0.9, {}),
    "seams": (lambda: nonmanifold.interfaces(nonmanifold.FOUR_CUBES, 5), 0.8, {}),
    "frozen": (wavy, 0.7, {"fixed_faces": list(range(0, 2000, 37)), "boundary": "fixed"}),
    "deviation": (wavy, 1.2, {"max_deviation": 0.02}),
    "one sweep": (wavy, 0.4, {"iterations": 1}),
    "wide": (wavy, 0.9, {"split": 2.0, "collapse": 0.2, "iterations": 6}),
}


def called(name, varies=False, adaptive=False, **more):
    make, factor, options = CASES[name]
    V, F = make()
    L = factor * zoo.mean_edge(V, F)
    if varies:
        L = L * (1 + 0.5 * np.sin(3 * V[:, 0]) * np.cos(2 * V[:, 1]))
    return remesh(V, F, Adaptive(0.1 * L) if adaptive else L, **{**options, **more})


@pytest.mark.parametrize(
    ("sizes", "per_block"), [("even", 60), ("varies", 10**6), ("adaptive", 60)]
)
@pytest.mark.parametrize("name", [name for name in CASES if name != "deviation"])
def test_collapses_are_told_the_truth(name, sizes, per_block, monkeypatch):
    """Flags that the last round of splits left are what would be measured then; the mesh is whole."""
    monkeypatch.setattr("remeshvec.mesh.blocks.FACES_PER_BLOCK", per_block)

    def look(mesh, blocks, limits, parallel, flags):
        assert_valid(mesh, slits=name == "seams")
        if flags is None:  # a copy that a guard tries
            return
        fresh = classify_edges(mesh, blocks, flags.longest, limits.shortest, False)
        assert flags.shortest == limits.shortest
        assert np.array_equal(flags.mask, fresh.mask)
        assert fresh.n_long == 0

    spy = Spy(monkeypatch, sweeps, "collapse_short_edges", look)
    called(name, varies=sizes == "varies", adaptive=sizes == "adaptive")
    assert len(spy.calls) >= CASES[name][2].get("iterations", 8)


def test_where_rounds_run_out_edges_are_measured_again(monkeypatch):
    """The flags of a mesh before its last splits would be too few."""
    monkeypatch.setattr(sweeps, "MAX_ROUNDS", 1)

    def look(mesh, blocks, limits, parallel, flags):
        fresh = classify_edges(mesh, blocks, flags.longest, limits.shortest, False)
        assert np.array_equal(flags.mask, fresh.mask)
        return fresh.n_long

    spy = Spy(monkeypatch, sweeps, "collapse_short_edges", look)
    called("fine")
    assert spy.calls[0] > 0


@pytest.mark.parametrize("name", ["coarse", "plain", "open", "creases"])
def test_holes_are_closed(name, monkeypatch):
    """Flips and moves see no more than a share of dead faces, whatever the collapses left."""
    dead = lambda mesh: float((mesh.origin[::3] == DEAD).mean())  # noqa: E731
    spy = Spy(monkeypatch, sweeps, "flip_edges", lambda mesh, *_: dead(mesh))
    closed = Spy(monkeypatch, work, "compact", lambda mesh, *_: dead(mesh))
    called(name)
    assert max(spy.calls) < sweeps._SPARSE + 0.01
    # Once where it is worth it, and at the end.
    assert len(closed.calls) <= 3
    if name == "coarse":
        assert len(closed.calls) >= 2 and closed.calls[0] > sweeps._SPARSE


def test_a_guarded_sweep_keeps_its_numbers(monkeypatch):
    """The mesh that was remembered, its trials and what is held have the same vertices."""
    seen = []
    check = sys.modules["remeshvec.sweeps.deviation"].DeviationCheck
    guard = sys.modules["remeshvec.sweeps.guard"].HoldingGuard
    for kind, name in ((check, "remember"), (check, "offenders"), (guard, "_hold")):
        method = getattr(kind, name)

        def look(self, mesh, *args, name=name, method=method):
            seen.append((name, len(mesh.X)))
            return method(self, mesh, *args)

        monkeypatch.setattr(kind, name, look)
    called("deviation")
    size = 0
    for name, n in seen:
        size = n if name == "remember" else size
        assert n == size
    assert {name for name, _ in seen} == {"remember", "offenders", "_hold"}


@pytest.mark.parametrize("name", ["plain", "open", "creases", "wide"])
def test_late_sweeps_write_nothing_anew(name, monkeypatch):
    """Their few splits find room in place."""
    anew = Spy(monkeypatch, split, "_refine", lambda *_: sweep[0])
    sweep = [0]
    result = called(name, callback=lambda n, *_: sweep.__setitem__(0, n + 1))
    late = [counts["split"] for counts in result.report.sweeps[5:]]
    if name in ("plain", "open"):
        assert sum(late) > 0
    assert [n for n in anew.calls if 5 <= n < len(result.report.sweeps)] == []


@pytest.mark.parametrize("name", CASES)
def test_what_comes_out_has_no_holes(name):
    """Room and dead elements are gone from the result, whatever the last sweep left."""
    for iterations in (1, 3):
        result = called(name, iterations=iterations)
        assert result.F.min() == 0 and result.F.max() == len(result.V) - 1
        assert zoo.unreferenced(result.V, result.F) == 0
        assert np.isfinite(result.V).all() and (result.lengths > 0).all()


@pytest.mark.parametrize("phase", ["split", "collapse", "flip", "relax"])
@pytest.mark.parametrize("name", ["plain", "coarse", "open", "seams", "deviation"])
def test_calls_may_end_after_any_phase(name, phase):
    """With holes, room and whatever the phase left."""
    for sweep in (0, 2):
        stop = lambda n, p, _, sweep=sweep: (n, p) != (sweep, phase)  # noqa: E731
        result = called(name, callback=stop)
        assert result.report.stop == "cancelled" and len(result.report.sweeps) == sweep + 1
        assert zoo.unreferenced(result.V, result.F) == 0
        assert np.isfinite(result.V).all()
        assert not zoo.duplicate_faces(result.F)


def test_dead_faces_are_not_counted():
    """`faces_of` and the mesh of a sweep agree: live ones only."""
    seen = []

    def look(mesh, *_):
        seen.append((len(faces_of(mesh)), len(mesh.source)))

    with pytest.MonkeyPatch.context() as patch:
        Spy(patch, sweeps, "relax_vertices", look)
        called("plain")
    assert any(live < size for live, size in seen)
