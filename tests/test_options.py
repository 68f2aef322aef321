"""Options: presets, overrides, and a clear line for what cannot work."""

import dataclasses
import inspect

import numpy as np
import pytest

from remeshvec import OptionError, remesh
from remeshvec.core.threads import available_threads
from remeshvec.input.options import PRESETS, make_options
from remeshvec.pipeline.remesh import RemeshOptions


def options(preset="default", **overrides):
    return make_options(preset, overrides)


def test_fast_is_the_published_algorithm():
    fast = options("fast")
    assert fast.iterations == 5
    assert fast.split == (4 / 3,) * 5 and fast.collapse == (0.8,) * 5
    assert fast.last_relaxations == 1 and fast.flip_passes == 1
    assert fast.untangle_rounds == fast.fit_rounds == 0
    assert not fast.delaunay_ties and fast.quadric_reach == 0 and fast.stiffness == 0


def test_presets_rise_in_effort():
    fast, default, fine = (options(name) for name in ("fast", "default", "fine"))
    assert fast.iterations < default.iterations < fine.iterations
    assert default.fit_rounds == 0 < fine.fit_rounds
    assert all(o.project and o.foldover == 20 for o in (fast, default, fine))
    assert set(PRESETS) == {"fast", "default", "fine"}


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("iterations", [1, 2, 7, 30])
def test_schedules_are_stretched(preset, iterations):
    made, whole = options(preset, iterations=iterations), options(preset)
    for name in ("split", "collapse"):
        schedule, known = getattr(made, name), getattr(whole, name)
        assert len(schedule) == iterations
        assert schedule[-1] == pytest.approx(known[-1])
        if iterations > 1:
            assert schedule[0] == pytest.approx(known[0])
        assert min(known) - 1e-12 <= min(schedule) <= max(schedule) <= max(known) + 1e-12


def test_thresholds_are_numbers_or_schedules():
    assert options("fast", split=1.5, collapse=0.5).split == (1.5,) * 5
    made = options("fast", collapse=[0.4, 0.8], split=np.array([2.0, 1.5]), iterations=3)
    assert made.collapse == pytest.approx((0.4, 0.6, 0.8))
    assert made.split == pytest.approx((2.0, 1.75, 1.5))
    assert options("fast", collapse=0).collapse == (0.0,) * 5


def test_none_means_what_the_preset_says():
    names = ["iterations", "split", "collapse", "foldover", "sliver_check", "project", "fit"]
    assert options("fine", **dict.fromkeys(names)) == options("fine")


def test_overrides():
    made = options(foldover=30, sliver_check=True, project=False, untangle_angle=35.5, threads=3)
    assert made.foldover == 30 and made.foldover_cosine == pytest.approx(np.sqrt(3) / 2)
    assert made.sliver_check is True and made.project is False
    assert made.untangle_angle == 35.5 and made.threads == 3
    assert options().threads == available_threads()


def test_an_angle_asked_for_is_reached_for_by_every_preset():
    assert make_options("fast", {}).untangle_rounds == 0
    asked = make_options("fast", {"untangle_angle": 30})
    assert asked.untangle_rounds == make_options("default", {}).untangle_rounds > 0


def test_the_typed_options_are_those_of_the_call():
    parameters = inspect.signature(remesh).parameters.keys()
    assert RemeshOptions.__annotations__.keys() == parameters - {"V", "F", "L", "return_result"}


def test_fit_can_be_switched_on_and_off():
    assert options("default", fit=True).fit_rounds > 0
    assert options("fine", fit=False).fit_rounds == 0
    assert options("fine").fit_rounds > 0
    assert options("fine", project=False).fit_rounds == 0


def test_options_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        options().iterations = 3


BAD = [
    ({"iterations": 0}, "iterations must be a whole number, at least 1; got 0"),
    ({"iterations": -3}, "got -3"),
    ({"iterations": 2.0}, "got 2.0"),
    ({"iterations": True}, "got True"),
    ({"iterations": "5"}, "got '5'"),
    ({"threads": 0}, "threads must be a whole number, at least 1; got 0"),
    ({"threads": 1.5}, "threads"),
    ({"foldover": 0}, "foldover must be an angle in degrees between 0 and 90; got 0"),
    ({"foldover": 90}, "got 90"),
    ({"foldover": -20}, "got -20"),
    ({"foldover": np.nan}, "got nan"),
    ({"foldover": "20 degrees"}, "got '20 degrees'"),
    ({"untangle_angle": 100}, "untangle_angle must be"),
    ({"sliver_check": 1}, "sliver_check must be True or False; got 1"),
    ({"project": "no"}, "project must be True or False; got 'no'"),
    ({"fit": 2}, "fit must be True or False; got 2"),
    ({"split": -1.0}, "split must be a factor of the length, at least 0"),
    ({"split": np.nan}, "split must"),
    ({"split": np.inf}, "split must"),
    ({"split": "4/3"}, "split must"),
    ({"split": []}, "split must"),
    ({"collapse": [0.8, None]}, "collapse must"),
    ({"collapse": [[0.8, 0.7]]}, "collapse must"),
    ({"collapse": 1.5}, "collapse must be below split; in sweep 0 they are 1.5"),
    ({"collapse": 4 / 3, "split": 4 / 3}, "collapse must be below split"),
    ({"collapse": [0.5, 1.4], "split": 1.3, "iterations": 4}, "in sweep 3 they are 1.4 and 1.3"),
]


@pytest.mark.parametrize(("overrides", "message"), BAD)
def test_bad_options_are_named(overrides, message):
    with pytest.raises(OptionError) as error:
        options(**overrides)
    assert message in str(error.value)


@pytest.mark.parametrize("preset", ["quick", "", "DEFAULT", None, 3, ["fast"], {}])
def test_unknown_presets(preset):
    with pytest.raises(OptionError, match="preset must be one of fast, default, fine"):
        make_options(preset, {})
