"""Sums into rows of four numbers, with vector instructions.

Relaxation and Lloyd rounds spend their time on these sums. LLVM cannot prove that two rows do not
overlap, and Numba leaves out the pass that would try, so the instructions are emitted here.
"""

from __future__ import annotations

from typing import Any

import numba
from llvmlite import ir as llvm
from numba.core import cgutils, types
from numba.extending import intrinsic

__all__ = ["add_four", "add_moment", "add_row"]


def add_row(target: Any, i: Any, source: Any, k: Any) -> None:
    """Add the first four columns of ``source[k]`` to those of ``target[i]``; both (n, c) float64."""
    target[i, :4] += source[k, :4]


def add_four(target: Any, i: Any, j: Any, x: Any, y: Any, z: Any, w: Any) -> None:
    """Add four numbers to ``target[i, j:j + 4]``, an (n, c) array of float64."""
    target[i, j] += x
    target[i, j + 1] += y
    target[i, j + 2] += z
    target[i, j + 3] += w


def add_moment(target: Any, i: Any, X: Any, abc: Any, p: Any, q: Any, s: Any) -> None:
    """Add ``p (X[b] - X[a]) + q (X[c] - X[a])`` and, in the last column, ``s`` to ``target[i]``.

    Both arrays are (n, 4) float64; the last column of ``X`` is not read.
    """
    a, b, c = abc
    for j in range(3):
        target[i, j] += p * (X[b, j] - X[a, j]) + q * (X[c, j] - X[a, j])
    target[i, 3] += s


if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
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

    def _broadcast(builder: Any, value: Any) -> Any:
        vector = llvm.Constant(_FOUR, llvm.Undefined)
        for n in range(4):
            vector = builder.insert_element(vector, value, llvm.Constant(llvm.IntType(32), n))
        return vector

    @intrinsic
    def add_moment(typingctx, target, i, X, abc, p, q, s):  # type: ignore[no-untyped-def]  # noqa: D103
        def generate(context, builder, signature, args):  # type: ignore[no-untyped-def]
            zero = context.get_constant(types.intp, 0)
            kinds = [signature.args[1], *signature.args[3].types]
            rows = [args[1], *cgutils.unpack_tuple(builder, args[3], 3)]
            i, *corners = (
                context.cast(builder, row, kind, types.intp)
                for row, kind in zip(rows, kinds, strict=True)
            )
            a, b, c = (
                builder.load(_address(context, builder, X, args[2], row, zero), align=8)
                for row in corners
            )
            p, q = _broadcast(builder, args[4]), _broadcast(builder, args[5])
            moment = builder.fadd(
                builder.fmul(p, builder.fsub(b, a)), builder.fmul(q, builder.fsub(c, a))
            )
            moment = builder.insert_element(moment, args[6], llvm.Constant(llvm.IntType(32), 3))
            _add(builder, _address(context, builder, target, args[0], i, zero), moment)
            return context.get_dummy_value()

        return types.void(target, i, X, abc, p, q, s), generate
