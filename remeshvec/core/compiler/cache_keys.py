"""Keys of Numba's disk cache that change with the code.

Numba's disk cache does not see edits in imported modules or in helpers. Here the name of a kernel holds a
digest of its code and of all code that it reaches, and the name is part of the key.
"""

from __future__ import annotations

import hashlib
from types import CodeType, FunctionType
from typing import Any

from .unsigned_indices import UnsignedIndices

__all__ = ["keyed"]


def keyed(function: Any, flags: Any) -> FunctionType:
    """Copy a function under a name that holds a digest of its code and of all that it calls.

    Parameters
    ----------
    function : function
        The kernel. Call this late: helpers may be defined below the kernel.
    flags : object
        Settings of the compiler, which become part of the digest by their ``repr``.
    """
    digest = hashlib.sha256(repr(flags).encode())
    compiler_pass = UnsignedIndices.run_pass
    _feed(digest, compiler_pass.__code__, compiler_pass.__globals__, set())
    _feed(digest, function.__code__, function.__globals__, set())
    copy = FunctionType(
        function.__code__,
        function.__globals__,
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )
    copy.__qualname__ = f"{function.__qualname__}_{digest.hexdigest()[:12]}"
    copy.__doc__ = function.__doc__
    copy.__module__ = function.__module__
    return copy


def _feed(digest: Any, code: CodeType, scope: dict[str, Any], seen: set[CodeType]) -> None:
    """Add code, its constants, and the globals that it uses, among them helpers with all they use."""
    if code in seen:
        return
    seen.add(code)
    digest.update(code.co_code)
    digest.update(repr(code.co_names).encode())
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            _feed(digest, constant, scope, seen)
        else:
            digest.update(repr(constant).encode())
    for name in code.co_names:
        value: Any = scope.get(name)
        function = getattr(
            value, "py_func", getattr(value, "_defn", value)
        )  # the latter: intrinsics
        if isinstance(function, FunctionType):
            _feed(digest, function.__code__, function.__globals__, seen)
        elif isinstance(value, int | float | bool | str | tuple):
            digest.update(repr(value).encode())
        elif hasattr(value, "tobytes"):
            digest.update(value.tobytes())
