"""Every parameter of capillary problems, their minimisers and their files refuses what cannot work."""

import inspect
import os
from functools import cache

import numpy as np
import pytest
from helpers.bad_arguments import (
    NAN,
    NOT_ARRAYS,
    NOT_COUNTS,
    NOT_FLAGS,
    NOT_FUNCTIONS,
    NOT_INDICES,
    NOT_NUMBERS,
    NOT_PATHS,
    NOT_POSITIVE,
    NOT_TEXTS,
    NOT_WORDS,
    Entry,
    assert_complete,
    assert_listed,
    assert_refused,
    called,
    cases,
    closed,
    name_of,
    not_faces,
    not_numbers,
    not_vertices,
)

from remeshvec import evolver
from remeshvec.evolver import (
    CapillaryProblem,
    EvolverBackend,
    EvolverError,
    Frame,
    cut_necks,
    evolve,
    minimize,
    read_dump,
    write_fe,
    write_frames,
)

V, F = closed()
N, M = len(V), len(F)
RECORDS = {"Evolution", "Frame", "Minimum"}  # made by the library, to be read

NOT_PROBLEMS = [None, 3, "ball", (V, F), CapillaryProblem]
NOT_EDGES = [*NOT_ARRAYS, [0, 1], [[0, 1, 2]], [[0, -1]], [[0, N]], [[0, 0.5]], [["0", "1"]]]


@cache
def ball():
    return CapillaryProblem(V, F, volume=1.0)


def itself():
    return {"self": ball()}


def given():
    return {"problem": ball()}


@cache
def backend():
    return EvolverBackend("sh")  # a program that is there, and is no Surface Evolver


def frame():
    return Frame(V, F, 1.0, 1.0, 0.0, 1, "sweep")


PROBLEM = {"problem": NOT_PROBLEMS}
MESH = {"V": [None, *not_vertices()], "F": [None, *not_faces()]}
OTHER_V = {"V": not_numbers(N, 3)}
HOW = {
    **PROBLEM,
    "method": NOT_WORDS,
    "tol": NOT_POSITIVE,
    "steps": NOT_COUNTS,
    "callback": NOT_FUNCTIONS,
}

TABLE = {
    CapillaryProblem: Entry(
        {
            **MESH,
            "fixed": NOT_INDICES,
            "fixed_edges": NOT_EDGES,
            "tension": NOT_POSITIVE,
            "volume": NOT_NUMBERS,
            "volume_offset": [*NOT_NUMBERS, None],
            "energy_offset": [*NOT_NUMBERS, None],
            "density": [*NOT_NUMBERS, None],
            "gravity": [*not_numbers(3), None],
            "bodies": NOT_WORDS,
        },
        lambda: {"V": V, "F": F},
    ),
    CapillaryProblem.area: Entry(OTHER_V, itself),
    CapillaryProblem.energy: Entry(OTHER_V, itself),
    CapillaryProblem.total_volume: Entry(OTHER_V, itself),
    CapillaryProblem.body_volumes: Entry(OTHER_V, itself),
    CapillaryProblem.forces: Entry(OTHER_V, itself),
    CapillaryProblem.hessian: Entry(
        {
            **OTHER_V,
            "directions": [*not_numbers(N, 1, 3), None],
            "pressure": [*not_numbers(1), None],
        },
        lambda: {**itself(), "directions": V[:, None], "pressure": [1.0]},
    ),
    CapillaryProblem.with_mesh: Entry(
        {
            "V": [None, *not_vertices(), np.vstack([V, V])],
            "F": [*not_faces(), F[1:]],
            "fixed": NOT_INDICES,
            "fixed_edges": NOT_EDGES,
            "body": [*NOT_INDICES, np.zeros(M - 1, int), np.ones(M, int)],
        },
        lambda: {**itself(), "V": V},
    ),
    CapillaryProblem.components: Entry({}, itself),
    CapillaryProblem.taken_apart: Entry({}, itself),
    minimize: Entry(HOW, given),
    evolve: Entry(
        {
            **PROBLEM,
            "lengths": [
                0.3,
                None,
                "ab",
                b"ab",
                [],
                [0.3, "1"],
                [0.0],
                [-1.0],
                [True],
                [NAN],
                [[1.0]],
            ],
            "sweeps": NOT_COUNTS,
            "split": [*NOT_NUMBERS, None, 0.5, 0.1, -1.0],
            "collapse": [*NOT_NUMBERS, None, 1.5, 2.0, -1.0],
            "remeshing": NOT_FLAGS,
            "cut_necks": NOT_FLAGS,
            "volume": [*NOT_WORDS, -1],
            "tol": NOT_POSITIVE,
            "backend": ["surface-evolver", *NOT_FUNCTIONS, None, lambda *_, **__: None],
            "frames": NOT_FLAGS,
            "callback": NOT_FUNCTIONS,
        },
        lambda: {**given(), "lengths": [0.6], "sweeps": 1},
    ),
    cut_necks: Entry(
        {**MESH, "held": [*NOT_INDICES, np.zeros(N - 1, bool)], "perimeter": [*NOT_NUMBERS, -1.0]},
        lambda: {"V": V, "F": F, "held": []},
    ),
    write_frames: Entry(
        {
            "folder": [*NOT_PATHS, os.devnull],
            "frames": [None, 3, "frames", [None], [V], (V, F)],
        },
        lambda: {"folder": "run", "frames": [frame()]},
    ),
    write_fe: Entry(
        {**PROBLEM, "path": [*NOT_PATHS, "", ".", "absent/a.fe"]},
        lambda: {**given(), "path": "a.fe"},
    ),
    read_dump: Entry({"path": [*NOT_PATHS, "", ".", "absent.dmp"]}, lambda: {"path": "a.fe"}),
    EvolverBackend: Entry(
        {"executable": [*NOT_PATHS, "", "absent"], "timeout": NOT_POSITIVE},
        lambda: {"executable": "sh"},
    ),
    EvolverBackend.__call__: Entry(HOW, lambda: {"self": backend(), **given()}),
    EvolverBackend.run: Entry(
        {**PROBLEM, "script": [*NOT_TEXTS, "\u00e9"]},
        lambda: {"self": backend(), **given(), "script": "g;"},
    ),
    EvolverBackend.run_freely: Entry(
        {**PROBLEM, "script": [*NOT_TEXTS, "\u00e9"]},
        lambda: {"self": backend(), **given(), "script": "g;"},
    ),
    EvolverBackend.energy: Entry(PROBLEM, lambda: {"self": backend(), **given()}),
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty folder, but for one datafile."""
    write_fe(tmp_path / "a.fe", ball())
    monkeypatch.chdir(tmp_path)


def test_every_public_function_has_an_entry():
    for name in evolver.__all__:
        value = getattr(evolver, name)
        if name in RECORDS or (inspect.isclass(value) and issubclass(value, Exception)):
            continue
        assert_listed(TABLE, value)


@pytest.mark.parametrize("function", TABLE, ids=name_of)
def test_every_parameter_has_bad_values(function):
    assert_complete(TABLE, function)


@pytest.mark.parametrize("function", TABLE, ids=name_of)
def test_good_arguments_are_good(function):
    """Else every refusal below could be one of something else; the shell fails as a backend."""
    try:
        called(function, TABLE[function].good())
    except EvolverError:
        assert function.__qualname__.startswith("EvolverBackend.")


@pytest.mark.parametrize(("function", "name", "value"), list(cases(TABLE)))
def test_bad_arguments_are_refused(function, name, value):
    assert_refused(TABLE, function, name, value)
