"""The only place with Numba flags: three decorators, and how many threads a call may use.

* ``inlined``: scalar helper, called from kernels only.
* ``kernel``: serial kernel, called from Python or from drivers.
* ``driver``: a loop over blocks written once with ``prange``; compiled as a serial and, when first
  needed, as a parallel kernel. Both give the same bits, because blocks never conflict. A driver
  that only writes to fields of a record needs these arrays as arguments of their own: Numba's
  parallel build (0.68) takes such writes for dead code and drops the loop.

No ``fastmath``: results decide topology and must not depend on how a loop was vectorised.
``error_model="numpy"`` lets a division by zero give inf or NaN; kernels never raise.
"""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import CodeType, FunctionType
from typing import Any

import numba
from numba.core import event

__all__ = ["available_threads", "compile_notice", "driver", "inlined", "kernel", "thread_scope"]

_FLAGS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
_INLINED = {**_FLAGS, "forceinline": True}


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a helper that LLVM always inlines into the kernels that call it.

    A call that stays a call counts references on every array of the records passed: it made a
    split 5 times slower.
    """
    return numba.njit(**_INLINED)(_keyed(function, ""))


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a serial kernel."""
    return numba.njit(**_FLAGS)(_keyed(function, ""))


class driver:  # lower case: a decorator, used like the two functions above
    """Compile a ``prange`` loop over blocks twice: serial, and parallel when first needed."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__
        self._serial = numba.njit(**_FLAGS)(_keyed(function, "_serial"))
        self._parallel: Any = None

    def __call__(self, parallel: bool, *args: Any) -> Any:
        """Run on one thread or on all threads of the current scope."""
        if not parallel:
            return self._serial(*args)
        if self._parallel is None:
            twin = _keyed(self._function, "_parallel")
            self._parallel = numba.njit(parallel=True, **_FLAGS)(twin)
        return self._parallel(*args)


def _keyed(function: Any, suffix: str) -> FunctionType:
    """Copy a function under a name that holds a digest of its code and of all that it calls.

    Numba's disk cache does not see edits in imported modules, nor does it tell the serial build of
    a function from the parallel one. Both are part of the name here, and the name is in the key.
    """
    digest = hashlib.sha256(repr(sorted(_INLINED.items())).encode())
    _feed(digest, function.__code__, function.__globals__)
    copy = FunctionType(
        function.__code__,
        function.__globals__,
        function.__name__ + suffix,
        function.__defaults__,
        function.__closure__,
    )
    copy.__qualname__ = f"{function.__qualname__}{suffix}_{digest.hexdigest()[:10]}"
    copy.__doc__ = function.__doc__
    copy.__module__ = function.__module__
    return copy


def _feed(digest: Any, code: CodeType, scope: dict[str, Any]) -> None:
    digest.update(code.co_code)
    digest.update(repr(code.co_names).encode())
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            _feed(digest, constant, scope)
        else:
            digest.update(repr(constant).encode())
    for name in code.co_names:
        value: Any = scope.get(name)
        if hasattr(value, "py_func"):
            digest.update(value.py_func.__qualname__.encode())
        elif isinstance(value, int | float | bool | str | tuple):
            digest.update(repr(value).encode())
        elif hasattr(value, "tobytes"):
            digest.update(value.tobytes())


# -- threads ----------------------------------------------------------------------------------

# Numba's portable thread pool aborts the process when two Python threads enter it at once, and a
# forked child has no pool. Whoever does not get the lock runs serially, with the same result.
_pool_lock = threading.Lock()
_pool_process = os.getpid()


def available_threads() -> int:
    """Count the threads that a call may use at most (Numba's limit, which follows the CPU mask)."""
    return int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]


@contextmanager
def thread_scope(threads: int) -> Iterator[bool]:
    """Reserve the thread pool for one call; yields whether parallel drivers may run."""
    wanted = min(threads, available_threads())
    may_run = wanted > 1 and os.getpid() == _pool_process and _pool_lock.acquire(blocking=False)
    if not may_run:
        yield False
        return
    before = numba.get_num_threads()
    try:
        numba.set_num_threads(wanted)
        yield True
    finally:
        numba.set_num_threads(before)
        _pool_lock.release()


# -- the line that explains a slow first call -------------------------------------------------


class _Notice(event.Listener):
    """Prints one line when Numba really compiles one of our kernels (not when it loads a cache)."""

    def __init__(self) -> None:
        self.printed = False

    def on_start(self, event: Any) -> None:
        dispatcher = (event.data or {}).get("dispatcher")
        module = getattr(getattr(dispatcher, "py_func", None), "__module__", "")
        if self.printed or not module.startswith("remeshvec"):
            return
        self.printed = True
        print(
            "remeshvec: compiling kernels for this machine (once, about 20 s; then cached)",
            file=sys.stderr,
            flush=True,
        )

    def on_end(self, event: Any) -> None:
        """Nothing to do: the line is printed at the start."""


_notice = _Notice()


@contextmanager
def compile_notice() -> Iterator[None]:
    """Say in one line what is happening if the code inside has to compile."""
    with event.install_listener("numba:compile", _notice):
        yield
