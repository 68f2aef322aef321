"""Plain-Python kernels on arrays that refuse to count from the end, and whose garbage is poison.

Kernels are compiled with unsigned indices (`core.compiler`): a negative one reads far outside of the
array. To be installed with NUMBA_DISABLE_JIT=1, before the first call.
"""

from __future__ import annotations

import importlib
import pkgutil
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

POISON = 0x5EEDBEEF  # as an index beyond the end of any array here; fits int64, wraps in int32


class Strict(np.ndarray):
    """An array that is indexed from its start only."""

    def __getitem__(self, key):
        refuse_negative(key)
        return super().__getitem__(key)

    def __setitem__(self, key, value):
        refuse_negative(key)
        super().__setitem__(key, value)


def refuse_negative(key) -> None:
    for part in key if isinstance(key, tuple) else (key,):
        bounds = (part.start, part.stop) if isinstance(part, slice) else (part,)
        for bound in bounds:
            if isinstance(bound, int | np.integer) and bound < 0:
                raise IndexError(f"negative index {bound}")


def strict(value: Any) -> Any:
    """The same arrays, strict ones, in records too."""
    if isinstance(value, np.ndarray):
        return value.view(Strict)
    if isinstance(value, tuple):
        parts = [strict(part) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value


def plain(value: Any) -> Any:
    """Undo `no_negative_index`."""
    if isinstance(value, np.ndarray):
        return value.view(np.ndarray)
    return tuple(plain(part) for part in value) if isinstance(value, tuple) else value


def poisoned(array: np.ndarray) -> np.ndarray:
    """Fill an array whose contents are anybody's guess."""
    if array.dtype.kind == "f":
        array.fill(np.nan)
    elif array.dtype.kind in "iu":
        array.fill(min(POISON, np.iinfo(array.dtype).max))
    return array


class Numpy:
    """NumPy whose new arrays are poisoned, and strict ones inside kernels."""

    def __init__(self, convert=lambda array: array):
        self.convert = convert

    def __getattr__(self, name):
        return getattr(np, name)

    def empty(self, *args, **kwargs):
        return self.convert(poisoned(np.empty(*args, **kwargs)))

    def empty_like(self, *args, **kwargs):
        return self.convert(poisoned(np.empty_like(*args, **kwargs)))

    def zeros(self, *args, **kwargs):
        return self.convert(np.zeros(*args, **kwargs))

    def ones(self, *args, **kwargs):
        return self.convert(np.ones(*args, **kwargs))

    def full(self, *args, **kwargs):
        return self.convert(np.full(*args, **kwargs))


def install() -> None:
    """Make all kernels of remeshvec strict."""
    from remeshvec.core import compiler

    modules = list(all_modules())
    for module in modules:
        for name, value in vars(module).items():
            if isinstance(value, np.ndarray):
                setattr(module, name, value.view(Strict))
        if hasattr(module, "np"):
            module.np = Numpy()
    inside = Numpy(strict)

    def run(self):
        """Stand-in for the compiled kernel."""
        scope = {**self.py_func.__globals__, "np": inside}
        function = FunctionType(self.py_func.__code__, scope, self.py_func.__name__)
        return lambda *args: plain(function(*(strict(a) for a in args)))

    compiler.kernel.compiled = property(run)


def all_modules() -> list[ModuleType]:
    import remeshvec

    names = [info.name for info in pkgutil.walk_packages(remeshvec.__path__, "remeshvec.")]
    rim = ("__main__", "viz", "cli", "pyvista_accessor")  # the last needs PyVista
    return [importlib.import_module(n) for n in names if n.rsplit(".", 1)[-1] not in rim]
