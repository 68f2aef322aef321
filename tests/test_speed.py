"""Not slower than ``benchmarks/guard.json`` says, by a guard that sees what it should."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import guard

REASON = guard.why_not()
pytestmark = pytest.mark.skipif(REASON is not None, reason=REASON or "")

TIMES = dict.fromkeys(guard.CASES, 5.0)
PHASES = {"split": 30.0, "relax": 40.0, "flip": 29.0, "check": 1.0, "total": 100.0}
COUNTS = {name: dict(PHASES) for name in guard.CASES}
SOME = next(iter(guard.CASES))


def found(factor=1.0, time=1.0, reference=33.0, **phases):
    """As if everything took that many times what is recorded."""
    counts = {phase: factor * count for phase, count in {**PHASES, **phases}.items()}
    times = {name: time * was for name, was in TIMES.items()}
    return guard.Found(times, dict.fromkeys(COUNTS, counts), reference)


@pytest.fixture
def record(tmp_path):
    guard.write_record(guard.Found(TIMES, COUNTS, 33.0), tmp_path / "guard.json")
    return json.loads((tmp_path / "guard.json").read_text())


def test_no_slower_than_recorded():
    """If that is meant: ``python -m benchmarks.guard --write``, and say why in the commit."""
    record = guard.read_record()
    assert set(record["times"]) == set(guard.CASES)
    _, said = guard.check(record)
    assert not said, "\n".join(said)


def test_the_reference_kernel_is_what_it_was():
    origin, twin, first, X, _ = guard._torus()
    assert np.array_equal(twin[twin], np.arange(len(origin)))
    assert np.array_equal(origin[first], np.arange(len(X)))
    assert guard.reference() == 187_795


def test_more_instructions_are_seen(record):
    assert not guard.complaints(found(), record)
    assert not guard.complaints(found(0.5), record)
    assert not guard.complaints(found(1.07), record)
    said = guard.complaints(found(1.15), record)
    assert len(said) == len(guard.CASES)
    assert "15.0 % more instructions in total (115.0 million, recorded 100.0)" in said[0]


def test_a_slow_phase_is_seen(record):
    """Also where the whole is within its limit; phases that are nothing may do what they like."""
    assert not guard.complaints(found(relax=47.0), record)
    assert "more instructions in relax" in guard.complaints(found(relax=50.0), record)[0]
    assert not guard.complaints(found(check=3.0), record)
    assert not guard.complaints(found(unheard_of=50.0), record)


def test_more_time_is_seen_whatever_the_instructions_say(record):
    assert not guard.complaints(found(time=1.5), record)
    assert "70 % more time" in guard.complaints(found(time=1.7), record)[0]


def test_instructions_of_other_machine_code_are_not_compared(record, monkeypatch):
    assert not guard.complaints(found(2.0, reference=40.0), record)
    assert not guard.complaints(found()._replace(instructions=None), record)
    monkeypatch.setattr(guard, "key", lambda: "another machine")
    assert not guard.complaints(found(2.0), record)
    assert guard.complaints(found(2.0, time=1.7), record)


def test_nothing_is_measured_under_a_tracer():
    before = sys.gettrace()
    sys.settrace(lambda *_: None)
    try:
        assert guard.why_not() == "Python is being traced"
    finally:
        sys.settrace(before)


def every_other_time_twice(phase):
    """A phase that takes half as long again, and does the same."""
    calls = [0]

    def slower(mesh, *rest):
        calls[0] += 1
        if calls[0] % 2:
            phase(mesh.copy(), *rest)
        return phase(mesh, *rest)

    return slower


@pytest.mark.parametrize("phase", ["collapse", "flip", "relax"])
def test_a_phase_that_takes_half_as_long_again_is_seen(tmp_path, monkeypatch, phase):
    """Really measured, on one mesh."""
    monkeypatch.setattr(guard, "CASES", {SOME: guard.CASES[SOME]})
    before = guard.measure(2)
    if before.instructions is None:
        pytest.skip("instructions cannot be counted here")
    guard.write_record(before, tmp_path / "guard.json")
    record = guard.read_record(tmp_path / "guard.json")
    assert not [s for s in guard.complaints(guard.measure(2), record) if "instructions" in s]
    name = {"collapse": "collapse_short_edges", "flip": "flip_edges", "relax": "relax_vertices"}
    function = f"remeshvec.sweeps.phases.{name[phase]}"
    monkeypatch.setattr(function, every_other_time_twice(getattr(sweeps(), name[phase])))
    said = guard.complaints(guard.measure(2), record)
    assert any(f"more instructions in {phase}" in line for line in said)


def sweeps():
    return sys.modules["remeshvec.sweeps.phases"]
