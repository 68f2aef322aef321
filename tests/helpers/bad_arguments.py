"""Values that are wrong for every parameter of a kind, and a test that tables of them are refused.

A table has an entry per function: bad values per parameter, and a function that makes good arguments.
"""

import inspect
import re
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from helpers import zoo
from remeshvec import MeshFormatError, RemeshvecError
from remeshvec.evolver import EvolverError

NAN, INF = float("nan"), float("inf")
HUGE = 10**400  # beyond all floats


class Thing:
    """Nothing that any argument could be; shown without its address, which would change test names."""

    def __repr__(self):
        return "thing"


THING = Thing()

NOT_NUMBERS = [True, np.True_, "1", NAN, INF, -INF, HUGE, 1j, [1.0], {}, THING]
NOT_POSITIVE = [*NOT_NUMBERS, 0, -1.0]
NOT_COUNTS = [True, "1", 0, -1, 1.0, 1.5, NAN, [1], {}]
NOT_FLAGS = [0, 1, "yes", [], NAN, None]
NOT_WORDS = ["", "x", 1, True, None, ["y"], {}]
NOT_TEXTS = [1, None, True, b"a", ["a"]]
NOT_PATHS = [1, None, True, b"a", ["a"], 2.5]
NOT_FUNCTIONS = [1, "print", True, [print]]
NOT_ARRAYS = [3, "a", {}, THING, [[0], [1, 2]], [None]]
NOT_INDICES = [*NOT_ARRAYS, [0.5], [-1], [10**6], ["0"], [True], [NAN], [[0], [1]]]


@cache
def closed():
    """V and F of a small sphere."""
    return zoo.icosphere(1)


def not_vertices():
    V, _ = closed()
    return [
        *NOT_ARRAYS, [], V[:, :2], V[0], V + 1j, V > 0, V.astype(str), np.full_like(V, NAN),
        np.full_like(V, INF),
    ]  # fmt: skip


def not_faces():
    _, F = closed()
    return [*NOT_ARRAYS, [], F[:, :2], F[0], F + 0.5, F - 1, F + 99, F > 0, F + 1j, F.astype(str)]


def not_numbers(*shape):
    """Arrays that do not hold finite real numbers of a shape."""
    right = np.ones(shape)
    return [
        *NOT_ARRAYS, right[:-1], right[..., None, None], right + 1j, right > 0, right.astype(str),
        NAN * right, INF * right,
    ]  # fmt: skip


class Entry(NamedTuple):
    bad: dict[str, list[Any]]
    good: Callable[[], dict[str, Any]]


def parameters(function):
    """Names that a caller may give; those of ``**options`` are not known."""
    known = inspect.signature(function).parameters.values()
    return [one.name for one in known if one.name != "self" and one.kind is not one.VAR_KEYWORD]


def public_methods(kind):
    """Functions that a caller of a class may call; properties have no arguments."""
    for name, value in vars(kind).items():
        if inspect.isfunction(value) and (name == "__call__" or not name.startswith("_")):
            yield value


def name_of(function):
    return function.__qualname__


def shown(value):
    """A short text without memory addresses, so that a test has the same name in every process."""
    text = re.sub(r" at 0x\w+", "", repr(value))
    return " ".join(text.split())[:30]


def cases(table):
    for function, entry in table.items():
        for name, values in entry.bad.items():
            for value in values:
                label = f"{name_of(function)}-{name}-{shown(value)}"
                yield pytest.param(function, name, value, id=label)


def called(function, arguments):
    """Call by name, but for what only a position can give; use up what a generator yields."""
    given = dict(arguments)
    for name, one in inspect.signature(function).parameters.items():
        if one.kind is one.VAR_POSITIONAL:
            return function(given["self"], *given[name])
    found = function(**given)
    return list(found) if inspect.isgenerator(found) else found


def assert_listed(table, value):
    """Check that a function, or a class with its public methods, has an entry."""
    assert value in table
    if inspect.isclass(value):
        assert set(public_methods(value)) <= set(table)


def assert_complete(table, function):
    """Check that every parameter of a function has bad values."""
    assert set(table[function].bad) == set(parameters(function))
    assert all(table[function].bad.values())


def assert_refused(table, function, name, value):
    """With an error of the package that names the argument."""
    with pytest.raises(RemeshvecError) as caught:
        called(function, {**table[function].good(), name: value})
    if not isinstance(
        caught.value, MeshFormatError | EvolverError
    ):  # these name files and programs
        assert re.search(rf"\b{name.rstrip('s')}s?\b", str(caught.value)), str(caught.value)
