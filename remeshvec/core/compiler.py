"""The only place with Numba flags: four decorators.

* ``inlined``: helper, called from kernels only.
* ``shared``: formula for kernels, on scalars, and for Python, on arrays.
* ``kernel``: kernel, called from Python.
* ``threaded``: a kernel over a range of pieces, called as ``name(parallel, ...)``; threads may share
  the pieces (`_threads`).

No ``fastmath``: results decide topology and must not depend on how a loop was vectorised.
``error_model="numpy"`` lets a division by zero give inf or NaN; kernels never raise.
"""

from __future__ import annotations

import gc
import hashlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property, partial
from types import CodeType, FunctionType
from typing import Any

import numba
from llvmlite import ir as llvm
from numba.core import cgutils, event, ir, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NopythonTypeInference
from numba.extending import intrinsic, register_jitable

from .threads import share, uninterrupted

__all__ = [
    "add_four",
    "add_row",
    "compile_notice",
    "inlined",
    "kernel",
    "shared",
    "threaded",
]


@register_pass(mutates_CFG=False, analysis_only=False)
class _UnsignedIndices(FunctionPass):
    """Type all indices into arrays as unsigned, once all types are known.

    For a signed index Numba emits code that counts a negative one from the end, at every access: a
    quarter of all instructions of our kernels. No kernel counts from the end.
    """

    _name = "remeshvec_unsigned_indices"

    def __init__(self) -> None:
        FunctionPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Change the signatures of getitem and setitem; lowering casts the indices to them."""
        for block in state.func_ir.blocks.values():
            for access in (*block.find_exprs("getitem"), *block.find_insts(ir.SetItem)):
                call = state.calltypes[access]
                if call is not None and isinstance(call.args[0], types.Array):
                    args = (call.args[0], _unsigned(call.args[1]), *call.args[2:])
                    state.calltypes.pop(access)  # a key is set once
                    state.calltypes[access] = call.replace(args=args)
        return True


def _unsigned(index: Any) -> Any:
    """Type of an index without negative values: an integer, or a tuple of some."""
    if isinstance(index, types.Integer):
        return types.uintp
    parts = getattr(index, "types", None)
    return index if parts is None else types.Tuple([_unsigned(part) for part in parts])


class _Compiler(CompilerBase):
    """Numba's compiler with `_UnsignedIndices`."""

    def define_pipelines(self) -> list[Any]:
        """Put the pass behind type inference."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_UnsignedIndices, NopythonTypeInference)
        passes.finalize()
        return [passes]


_FLAGS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "pipeline_class": _Compiler,
}

# Without `_nrt` a helper counts no references. Passing records of arrays to helpers that do costs
# about a quarter of the time of a call, in atomic instructions that two threads fight for; in return such
# a helper cannot allocate. Not cached: helpers live in the caches of the kernels that use them.
_INLINED: dict[str, Any] = {
    **_FLAGS,
    "forceinline": True,
    "_nrt": False,
    "no_cpython_wrapper": True,  # see `_Helper`
}


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a helper that LLVM always inlines into the kernels that call it."""
    helper = numba.njit(**_INLINED)(function)
    if isinstance(helper, CPUDispatcher):  # not where the compiler is switched off
        helper.__class__ = _Helper
    return helper


def shared(function: Callable[..., Any]) -> Any:
    """Leave a formula as it is for Python, and let kernels inline it as well."""
    return register_jitable(**_INLINED)(function)


class _Helper(CPUDispatcher):
    """A helper has no code that Python could call: making it took a sixth of all compile time."""

    def __call__(self, *args: Any) -> Any:
        """Run in a kernel of its own; for tests."""
        return self._kernel(*args)

    @cached_property
    def _kernel(self) -> Any:
        helper = self
        return numba.njit(**_FLAGS)(lambda *args: helper(*args))


def add_row(target: Any, i: Any, source: Any, k: Any) -> None:
    """Add the first four columns of ``source[k]`` to those of ``target[i]``; both (n, c) float64."""
    target[i, :4] += source[k, :4]


def add_four(target: Any, i: Any, j: Any, x: Any, y: Any, z: Any, w: Any) -> None:
    """Add four numbers to ``target[i, j:j + 4]``, an (n, c) array of float64."""
    target[i, j] += x
    target[i, j + 1] += y
    target[i, j + 2] += z
    target[i, j + 3] += w


if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
    # The same with vector instructions: sums into rows are what relaxation spends its time on. LLVM
    # cannot prove that two rows do not overlap, and Numba leaves out the pass that would try.
    _FOUR = llvm.VectorType(llvm.DoubleType(), 4)

    def _address(context: Any, builder: Any, kind: Any, array: Any, row: Any, column: Any) -> Any:
        struct = context.make_array(kind)(context, builder, array)
        columns = cgutils.unpack_tuple(builder, struct.shape, 2)[1]
        place = builder.add(builder.mul(row, columns), column)
        return builder.bitcast(builder.gep(struct.data, [place]), _FOUR.as_pointer())

    def _add(builder: Any, address: Any, vector: Any) -> None:
        builder.store(builder.fadd(builder.load(address, align=8), vector), address, align=8)

    @intrinsic
    def add_row(typingctx, target, i, source, k):  # type: ignore[no-untyped-def]  # noqa: D103
        def generate(context, builder, signature, args):  # type: ignore[no-untyped-def]
            zero = context.get_constant(types.intp, 0)
            i, k = (context.cast(builder, args[n], signature.args[n], types.intp) for n in (1, 3))
            row = builder.load(_address(context, builder, source, args[2], k, zero), align=8)
            _add(builder, _address(context, builder, target, args[0], i, zero), row)
            return context.get_dummy_value()

        return types.void(target, i, source, k), generate

    @intrinsic
    def add_four(typingctx, target, i, j, x, y, z, w):  # type: ignore[no-untyped-def]  # noqa: D103
        def generate(context, builder, signature, args):  # type: ignore[no-untyped-def]
            i, j = (context.cast(builder, args[n], signature.args[n], types.intp) for n in (1, 2))
            vector = llvm.Constant(_FOUR, llvm.Undefined)
            for n in range(4):
                lane = llvm.Constant(llvm.IntType(32), n)
                vector = builder.insert_element(vector, args[3 + n], lane)
            _add(builder, _address(context, builder, target, args[0], i, j), vector)
            return context.get_dummy_value()

        return types.void(target, i, j, x, y, z, w), generate


class kernel:  # lower case: a decorator, used like a function
    """Compile a kernel when it is first called."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.py_func: Any = function
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__

    @cached_property
    def compiled(self) -> Any:
        """The function, compiled by Numba for the types of its arguments."""
        compiled = numba.njit(cache=True, **_FLAGS)(_keyed(self.py_func))
        if hasattr(compiled, "_compile_for_args"):  # not where the compiler is switched off
            compiled._compile_for_args = partial(uninterrupted, compiled._compile_for_args)
        return compiled

    def __call__(self, *args: Any) -> Any:
        """Run."""
        return self.compiled(*args)


class threaded:
    """Compile a loop over pieces, which threads may share: ``f(parallel, ...)`` runs all of them.

    The kernel takes the range of pieces to run as its first argument. ``count`` tells from the others
    how many there are. Pieces never conflict, so which thread runs which of them changes no bit.
    """

    def __init__(self, count: Callable[..., int]) -> None:
        self.count = count

    def __call__(self, function: Callable[..., Any]) -> _Threaded:
        """Decorate."""
        return _Threaded(function, self.count)


class _Threaded(kernel):
    def __init__(self, function: Callable[..., Any], count: Callable[..., int]) -> None:
        super().__init__(function)
        self.count = count

    def __call__(self, parallel: bool, *args: Any) -> None:
        """Run on this thread, or on all threads of the current scope."""
        count = self.count(*args)
        if parallel and count > 1:
            share(self.compiled, count, args)
        else:
            self.compiled((0, count), *args)


def _keyed(function: Any) -> FunctionType:
    """Copy a function under a name that holds a digest of its code and of all that it calls.

    Numba's disk cache does not see edits in imported modules or in helpers. They are part of the name
    here, and the name is part of the key. To be called late: helpers may be defined below the kernel.
    """
    digest = hashlib.sha256(repr((sorted(_FLAGS.items()), sorted(_INLINED.items()))).encode())
    _feed(digest, _UnsignedIndices.run_pass.__code__, globals(), set())
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
    """Add code, constants, and the globals it uses, helpers and all that they use among them."""
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
        function = getattr(value, "py_func", value)
        if isinstance(function, FunctionType):
            _feed(digest, function.__code__, function.__globals__, seen)
        elif isinstance(value, int | float | bool | str | tuple):
            digest.update(repr(value).encode())
        elif hasattr(value, "tobytes"):
            digest.update(value.tobytes())


# -- what happens while a slow first call compiles -----------------------------------------------


class _Watch(event.Listener):
    """Watches Numba compile our kernels (not load them from its cache).

    Prints one line, where a call asked for that. Pauses the garbage collector meanwhile: a compilation
    makes millions of objects that live until it ends, and looking at them again and again takes a fifth
    of the time.
    """

    def __init__(self) -> None:
        self.requested = 0
        self.printed = False
        self.depth = 0
        self.paused = False

    def on_start(self, event: Any) -> None:
        if not _is_ours(event):
            return
        self.depth += 1
        if self.depth == 1 and gc.isenabled():
            self.paused = True
            gc.disable()
        if self.requested and not self.printed:
            self.printed = True
            print(
                "remeshvec: compiling kernels for this machine (once, about 20 s; then cached)",
                file=sys.stderr,
                flush=True,
            )

    def on_end(self, event: Any) -> None:
        if not _is_ours(event):
            return
        self.depth -= 1
        if self.depth == 0 and self.paused:
            self.paused = False
            gc.enable()


def _is_ours(event: Any) -> bool:
    """Tell whether it is one of our kernels; Numba compiles one at a time, and its helpers within."""
    dispatcher = (event.data or {}).get("dispatcher")
    module = getattr(getattr(dispatcher, "py_func", None), "__module__", None) or ""
    return module.startswith("remeshvec")


_listener = _Watch()
event.register("numba:compile", _listener)


@contextmanager
def compile_notice() -> Iterator[None]:
    """Say in one line what is happening if the code inside has to compile."""
    _listener.requested += 1
    try:
        yield
    finally:
        _listener.requested -= 1
