"""Values that are made when they are first asked for."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

__all__ = ["Lazy", "LazyRecipe"]


T = TypeVar("T")


class Lazy(Generic[T]):
    """A value that is made when it is first asked for: once, and at the latest for a pickle or a copy.

    What ``make`` holds is let go of then.
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
    """The same, but a pickle or a copy takes along what it is made of, which is sooner done."""

    def __reduce__(self) -> tuple[Any, ...]:
        with self._lock:
            make = self._make
        return (_known_value, (self._value,)) if make is None else (LazyRecipe, (make,))
