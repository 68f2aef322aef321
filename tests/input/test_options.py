"""Options: presets, overrides, and a clear line for what cannot work."""

import dataclasses
import inspect
import re
from typing import get_args, get_type_hints

import numpy as np
import pytest

from remeshvec import OptionError, remesh
from remeshvec.cli.arguments import batch_parser, large_parser, parser
from remeshvec.core.threads import available_threads
from remeshvec.input.options import RemeshKeywords, RemeshOptions
from remeshvec.input.recipe import PRESETS, make_recipe


def options(preset="default", **overrides):
    return make_recipe(RemeshOptions(preset=preset, **overrides))


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
    assert set(PRESETS) == {"fast", "default", "even", "fine"}


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
    assert options("fast").untangle_rounds == 0
    asked = options("fast", untangle_angle=30)
    assert asked.untangle_rounds == options("default").untangle_rounds > 0


def test_keywords_flags_and_documentation_are_those_of_the_record():
    """The record says which options there are, with types and defaults; nothing else says otherwise."""
    record = {field.name: field for field in dataclasses.fields(RemeshOptions)}
    assert get_type_hints(RemeshKeywords) == get_type_hints(RemeshOptions)
    assert list(RemeshKeywords.__annotations__) == list(record)
    parameters = inspect.signature(remesh).parameters
    assert list(parameters) == ["V", "F", "L", "return_result", *record]
    for name, field in record.items():
        assert parameters[name].default == field.default
        assert str(parameters[name].annotation) == field.type
    documented = re.findall(r"^    (\w+(?:, \w+)*) : ", remesh.__doc__, re.MULTILINE)
    assert ", ".join(documented).startswith(", ".join(parameters))


# Options that name elements of one mesh come from files; functions have no flag.
FILES = {"feature_edges", "fixed_vertices", "fixed_faces", "face_labels", "selection"}
NO_FLAG = {"callback", "max_faces", "preserve", "untangle_angle"}
IN_PARTS = {"n_faces", "n_vertices", "max_deviation", "clearance"}  # have no meaning there


@pytest.mark.parametrize(
    ("flags", "absent"),
    [(parser, NO_FLAG), (batch_parser, NO_FLAG | FILES), (large_parser, NO_FLAG | IN_PARTS)],
)
def test_every_option_has_a_flag(flags, absent):
    names = {action.dest.removeprefix("no_"): action for action in flags()._actions}
    record = {field.name: field for field in dataclasses.fields(RemeshOptions)}
    assert record.keys() - names.keys() == absent
    for name in record.keys() & names.keys():
        assert names[name].default in (record[name].default, None, False)
        if names[name].choices:
            assert set(names[name].choices) == set(get_args(get_type_hints(RemeshOptions)[name]))


def test_unknown_keywords_are_named():
    with pytest.raises(TypeError, match=r"remesh\(\) got .*'iteration'; did you mean 'iterations'"):
        remesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], iteration=3)


def test_fit_can_be_switched_on_and_off():
    assert options("default", fit=True).fit_rounds > 0
    assert options("fine", fit=False).fit_rounds == 0
    assert options("fine").fit_rounds > 0
    assert options("fine", project=False).fit_rounds == 0


def test_options_are_frozen():
    for record in (options(), RemeshOptions()):
        with pytest.raises(dataclasses.FrozenInstanceError):
            record.iterations = 3


BAD = [
    ({"iterations": 0}, "iterations must be a whole number, at least 1; got 0"),
    ({"iterations": -3}, "got -3"),
    ({"iterations": 2.0}, "got 2.0"),
    ({"iterations": True}, "got True"),
    ({"iterations": "5"}, "got '5'"),
    ({"threads": 0}, "threads must be a whole number, at least 1; got 0"),
    ({"threads": 1.5}, "threads"),
    ({"foldover": 0}, "foldover must be a number of degrees above 0 and below 90; got 0"),
    ({"foldover": 90}, "got 90"),
    ({"foldover": -20}, "got -20"),
    ({"foldover": np.nan}, "got nan"),
    ({"foldover": "20 degrees"}, "got '20 degrees'"),
    ({"foldover": "1"}, "got '1'"),
    ({"untangle_angle": 100}, "untangle_angle must be"),
    ({"untangle_angle": True}, "got True"),
    ({"tol": "1"}, "got '1'"),
    ({"split": "1"}, "split must"),
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
    with pytest.raises(OptionError, match="preset must be one of fast, default, even, fine"):
        options(preset)
