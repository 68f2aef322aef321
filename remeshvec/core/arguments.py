"""Checks of plain arguments: numbers, counts, flags, words, texts, paths, functions.

All of them raise `OptionError` in one wording: the name, what is allowed, what was given.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable
from math import inf, isfinite, nan
from numbers import Real
from typing import Any

import numpy as np

from ..errors import OptionError

__all__ = [
    "asks_to_stop",
    "choice",
    "count",
    "flag",
    "function",
    "instance",
    "items",
    "number",
    "path",
    "text",
]

_MOST_SHOWN = 80  # characters of a wrong value in a message


def number(
    value: Any,
    name: str,
    *,
    above: float | None = None,
    low: float | None = None,
    below: float | None = None,
    high: float | None = None,
    unit: str = "",
) -> float:
    """Check a finite real number and return it as a float; booleans and strings are not numbers.

    Parameters
    ----------
    value : object
        What the caller gave.
    name : str
        Name of the argument, for the message.
    above, below : float, optional
        Bounds that the number must not reach.
    low, high : float, optional
        Bounds that it may reach.
    unit : str
        For the message: "degrees", "units of V".

    Raises
    ------
    OptionError
    """
    x = _as_float(value)
    if (
        isfinite(x)
        and (above is None or x > above)
        and (low is None or x >= low)
        and (below is None or x < below)
        and (high is None or x <= high)
    ):
        return x
    raise OptionError(
        f"{name} must be {_range(above, low, below, high, unit)}; got {_in_one_line(value)}"
    )


def _as_float(value: Any) -> float:
    """Return a real number as a float; NaN for anything else, infinity for numbers beyond all floats."""
    if not isinstance(value, Real) or isinstance(value, bool | np.bool_):
        return nan
    try:
        return float(value)
    except OverflowError:
        return inf


def _in_one_line(value: Any) -> str:
    """Show a value in one line of bounded length."""
    line = " ".join(repr(value).split())
    return line if len(line) <= _MOST_SHOWN else line[: _MOST_SHOWN - 3] + "..."


def _range(
    above: float | None, low: float | None, below: float | None, high: float | None, unit: str
) -> str:
    """Say in words which numbers are allowed."""
    noun = "a number" + (f" of {unit}" if unit else "")
    bounds = [
        f"{word} {bound:g}"
        for word, bound in (
            ("above", above),
            ("at least", low),
            ("below", below),
            ("at most", high),
        )
        if bound is not None
    ]
    if bounds == ["above 0"]:
        return noun.replace("a number", "a positive number")
    return f"{noun} {' and '.join(bounds)}" if bounds else f"{noun}, finite"


def count(value: Any, name: str, *, low: int = 1, high: int | None = None) -> int:
    """Check a whole number from ``low`` to ``high``, both included, and return it as an int."""
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool | np.bool_)
    if not is_whole or value < low or (high is not None and value > high):
        bounds = f", at least {low}" if high is None else f" from {low} to {high}"
        raise OptionError(f"{name} must be a whole number{bounds}; got {_in_one_line(value)}")
    return int(value)


def flag(value: Any, name: str) -> bool:
    """Check True or False; 0, 1 and strings are neither."""
    if not isinstance(value, bool | np.bool_):
        raise OptionError(f"{name} must be True or False; got {_in_one_line(value)}")
    return bool(value)


def choice(value: Any, name: str, words: Iterable[str]) -> str:
    """Check one of several words."""
    known = tuple(words)
    if isinstance(value, str) and value in known:
        return value
    near = difflib.get_close_matches(value, known, 1) if isinstance(value, str) else []
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise OptionError(f"{name} must be one of {', '.join(known)}; got {_in_one_line(value)}{hint}")


def text(value: Any, name: str) -> str:
    """Check a string."""
    if not isinstance(value, str):
        raise OptionError(f"{name} must be a string; got {_in_one_line(value)}")
    return value


def path(value: Any, name: str) -> str:
    """Check the path of a file, and return it as a string; whether the file is there is not asked."""
    found = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(found, str):
        raise OptionError(f"{name} must be the path of a file; got {_in_one_line(value)}")
    return found


def function(value: Any, name: str) -> Any:
    """Check something that can be called."""
    if not callable(value):
        raise OptionError(f"{name} must be callable; got {_in_one_line(value)}")
    return value


def instance(value: Any, name: str, kind: type | tuple[type, ...], noun: str) -> Any:
    """Check a value by its type; ``noun`` says in the message what is allowed."""
    if not isinstance(value, kind):
        raise OptionError(f"{name} must be {noun}; got {_in_one_line(value)}")
    return value


def items(value: Any, name: str, noun: str) -> list[Any]:
    """Check a sequence that is not a string; ``noun`` says in the message what it must hold."""
    is_text = isinstance(value, str | bytes)
    if is_text or not isinstance(value, Iterable) or getattr(value, "ndim", 1) == 0:
        raise OptionError(f"{name} must be a sequence of {noun}; got {_in_one_line(value)}")
    return list(value)


def asks_to_stop(answer: object) -> bool:
    """Tell whether the answer of a callback ends the work: False, Python's or NumPy's, not None or 0."""
    return isinstance(answer, bool | np.bool_) and not answer
