"""Values that are computed on first use."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

__all__ = ["Lazy", "LazyRecipe"]


T = TypeVar("T")


class Lazy(Generic[T]):
    """A value that ``make`` computes on first use, once; pickling or copying counts as use.

    ``make`` is dropped afterwards, and with it all that it holds.
    """

    def __init__(self, make: Callable[[], T]) -> None:
        self._make: Callable[[], T] | None = make
        self._lock = threading.Lock()

    def __call__(self) -> T:
        """Return the value."""
        with self._lock:
            if self._make is not None:
                self._value = self._make()
                self._make = None
        return self._value

    def __reduce__(self) -> tuple[Any, ...]:
        return _known_value, (self(),)


def _known_value(value: T) -> Lazy[T]:
    return Lazy(lambda: value)


class LazyRecipe(Lazy[T]):
    """Like `Lazy`, but pickles the recipe instead of the value: faster."""

    def __reduce__(self) -> tuple[Any, ...]:
        with self._lock:
            make = self._make
        return (_known_value, (self._value,)) if make is None else (LazyRecipe, (make,))
