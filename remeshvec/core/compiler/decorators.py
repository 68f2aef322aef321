"""Four decorators, and the flags they give to Numba.

* ``inlined``: a helper, called from kernels only.
* ``shared``: a formula for kernels, on scalars, and for Python, on arrays.
* ``kernel``: a kernel, called from Python.
* ``threaded``: a kernel over a range of pieces, called as ``name(parallel, ...)``; threads may share
  the pieces (see `core.threads`).

No ``fastmath``: results decide topology and must not depend on how a loop was vectorised.
``error_model="numpy"`` lets a division by zero give inf or NaN; kernels never raise.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import numba
from numba.core.registry import CPUDispatcher
from numba.extending import register_jitable

from ..threads import share, uninterrupted
from .cache_keys import keyed
from .disk_cache import FORMAT, keep_on_disk
from .unsigned_indices import UnsignedIndexCompiler

__all__ = ["ThreadedKernel", "inlined", "kernel", "shared", "threaded"]

_FLAGS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "pipeline_class": UnsignedIndexCompiler,
}

# Without `_nrt` a helper counts no references. Passing records of arrays to helpers that do costs about
# a quarter of the time of a call, in atomic instructions that two threads fight for; in return such a
# helper cannot allocate. Not cached: helpers live in the caches of the kernels that use them.
_INLINED: dict[str, Any] = {
    **_FLAGS,
    "forceinline": True,
    "_nrt": False,
    "no_cpython_wrapper": True,  # see `_InlinedHelper`
}


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a helper that LLVM always inlines into the kernels that call it."""
    helper = numba.njit(**_INLINED)(function)
    if isinstance(helper, CPUDispatcher):  # not where the compiler is switched off
        helper.__class__ = _InlinedHelper
    return helper


def shared(function: Callable[..., Any]) -> Any:
    """Leave a formula unchanged for Python, and let kernels inline it as well."""
    return register_jitable(**_INLINED)(function)


class _InlinedHelper(CPUDispatcher):
    """A helper without code that Python could call: making it took a sixth of all compile time."""

    def __call__(self, *args: Any) -> Any:
        """Run the helper in a kernel of its own; for tests."""
        return self._kernel(*args)

    @cached_property
    def _kernel(self) -> Any:
        helper = self
        return numba.njit(**_FLAGS)(lambda *args: helper(*args))


class kernel:  # lower case: a decorator, used like a function
    """Compile a kernel when it is first called."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.py_func: Any = function
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__

    @cached_property
    def compiled(self) -> Any:
        """The function, compiled by Numba for the types of its arguments."""
        flags = sorted(_FLAGS.items()), sorted(_INLINED.items()), FORMAT
        compiled = numba.njit(**_FLAGS)(keyed(self.py_func, flags))
        if hasattr(compiled, "_compile_for_args"):  # not where the compiler is switched off
            keep_on_disk(compiled)
            compiled._compile_for_args = partial(uninterrupted, compiled._compile_for_args)
        return compiled

    def __call__(self, *args: Any) -> Any:
        """Call the compiled function."""
        return self.compiled(*args)


class threaded:
    """Compile a loop over pieces, which threads may share: ``f(parallel, ...)`` runs all of them.

    The kernel takes the range of pieces to run as its first argument; ``count(*args)`` returns the number
    of pieces for the other arguments. Pieces never conflict, so which thread runs which piece changes
    no bit.
    """

    def __init__(self, count: Callable[..., int]) -> None:
        self.count = count

    def __call__(self, function: Callable[..., Any]) -> ThreadedKernel:
        """Decorate a kernel."""
        return ThreadedKernel(function, self.count)


class ThreadedKernel(kernel):
    """What `threaded` makes of a function."""

    def __init__(self, function: Callable[..., Any], count: Callable[..., int]) -> None:
        super().__init__(function)
        self.count = count

    def __call__(self, parallel: bool, *args: Any) -> None:
        """Run all pieces on this thread, or on all threads of the current scope."""
        count = self.count(*args)
        if parallel and count > 1:
            share(self.compiled, count, args)
        else:
            self.compiled((0, count), *args)
