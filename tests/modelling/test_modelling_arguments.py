"""Every parameter of Laplacians, solver, fairing, editing and smoothing refuses what cannot work."""

from functools import cache

import numpy as np
import pytest
from helpers.bad_arguments import (
    NAN,
    NOT_ARRAYS,
    NOT_COUNTS,
    NOT_FLAGS,
    NOT_INDICES,
    NOT_POSITIVE,
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

import remeshvec
from remeshvec import (
    Editor,
    LaplacianSolver,
    MultiresolutionEditor,
    cotangent_matrix,
    deform,
    denoise,
    fair,
    laplacian,
    smooth,
    vertex_areas,
)

V, F = closed()
N = len(V)
HANDLE, FIXED = V[:, 2] > 0.7, V[:, 2] < -0.7
RECORDS = {"EditedSurface"}  # made by the library, to be read

NOT_ORDERS = [*NOT_COUNTS, 4]
NOT_TRANSFORMS = [
    *NOT_ARRAYS, None, np.eye(3), np.eye(4)[:, :3], np.eye(4) + np.eye(4, k=-3), V, 1j * np.eye(4),
    NAN * np.eye(4), np.eye(4).astype(str), np.eye(4) > 0,
    lambda points: points[1:], lambda points: None, lambda points: "up", lambda points: NAN * points,
]  # fmt: skip
NOT_MATRICES = [
    None, 3, "a", {}, [[0], [1, 2]], V, V[0], np.eye(3, dtype=bool), 1j * np.eye(3), NAN * np.eye(3),
    np.eye(3).astype(str),
]  # fmt: skip


def mesh():
    return {"V": V, "F": F}


def parts():
    return {**mesh(), "handle": HANDLE, "fixed": FIXED}


@cache
def solver():
    return LaplacianSolver(laplacian(V, F), [0, 1])


@cache
def editor(kind):
    return kind(V, F, HANDLE, FIXED)


MESH = {"V": not_vertices(), "F": not_faces()}
AREA = {"area": NOT_WORDS}
PARTS = {
    **MESH,
    **AREA,
    "handle": [*NOT_INDICES, [], HANDLE[1:], FIXED, ~FIXED],
    "fixed": [*NOT_INDICES, FIXED[1:], HANDLE],
    "k": NOT_ORDERS,
}
STEPS = {"iterations": NOT_COUNTS}

TABLE = {
    laplacian: Entry({**MESH, **AREA, "symmetric": NOT_FLAGS}, mesh),
    cotangent_matrix: Entry(MESH, mesh),
    vertex_areas: Entry({**MESH, **AREA}, mesh),
    LaplacianSolver: Entry(
        {"A": NOT_MATRICES, "fixed": NOT_INDICES, "method": [*NOT_WORDS, "qr"]},
        lambda: {"A": laplacian(V, F), "fixed": [0]},
    ),
    LaplacianSolver.solve: Entry(
        {"b": not_numbers(N, 2), "x_fixed": not_numbers(2, 2)}, lambda: {"self": solver()}
    ),
    fair: Entry(
        {**MESH, **AREA, **STEPS, "region": [*NOT_INDICES, None, HANDLE[1:]], "k": NOT_ORDERS},
        lambda: {**mesh(), "region": HANDLE},
    ),
    smooth: Entry(
        {
            **MESH,
            **AREA,
            **STEPS,
            "step": NOT_POSITIVE,
            "keep_volume": NOT_FLAGS,
            "boundary": NOT_WORDS,
            "fixed": [*NOT_INDICES, HANDLE[1:]],
        },
        mesh,
    ),
    denoise: Entry(
        {**MESH, **STEPS, "boundary": NOT_WORDS, "fixed": [*NOT_INDICES, HANDLE[1:]]}, mesh
    ),
    Editor: Entry(PARTS, parts),
    Editor.move: Entry(
        {"transform": NOT_TRANSFORMS}, lambda: {"self": editor(Editor), "transform": np.eye(4)}
    ),
    deform: Entry(
        {**PARTS, "transform": NOT_TRANSFORMS}, lambda: {**parts(), "transform": np.eye(4)}
    ),
    MultiresolutionEditor: Entry(
        {**PARTS, "detail_size": NOT_POSITIVE, "length": NOT_POSITIVE, "remesh": NOT_FLAGS}, parts
    ),
    MultiresolutionEditor.move: Entry(
        {"transforms": [[value] for value in NOT_TRANSFORMS]},
        lambda: {"self": editor(MultiresolutionEditor), "transforms": ()},
    ),
}


def test_every_public_function_has_an_entry():
    for name in remeshvec.__all__:
        value = getattr(remeshvec, name)
        if value.__module__.startswith("remeshvec.modelling.") and name not in RECORDS:
            assert_listed(TABLE, value)


@pytest.mark.parametrize("function", TABLE, ids=name_of)
def test_every_parameter_has_bad_values(function):
    assert_complete(TABLE, function)


@pytest.mark.parametrize("function", TABLE, ids=name_of)
def test_good_arguments_are_good(function):
    """Else every refusal below could be one of something else."""
    called(function, TABLE[function].good())


@pytest.mark.parametrize(("function", "name", "value"), list(cases(TABLE)))
def test_bad_arguments_are_refused(function, name, value):
    assert_refused(TABLE, function, name, value)
