"""A compiler pass that types all indices into arrays as unsigned.

For a signed index Numba emits code that counts a negative one from the end of the axis, at every access:
a quarter of all instructions of our kernels. No kernel counts from the end.
"""

from __future__ import annotations

from typing import Any

from numba.core import ir, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.typed_passes import NopythonTypeInference

__all__ = ["UnsignedIndexCompiler", "UnsignedIndices"]


@register_pass(mutates_CFG=False, analysis_only=False)
class UnsignedIndices(FunctionPass):
    """Types all indices into arrays as unsigned, once all types are known."""

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
                    state.calltypes.pop(access)  # a key can be set only once
                    state.calltypes[access] = call.replace(args=args)
        return True


def _unsigned(index: Any) -> Any:
    """Return the unsigned type for an index: an integer, or a tuple that holds integers."""
    if isinstance(index, types.Integer):
        return types.uintp
    parts = getattr(index, "types", None)
    return index if parts is None else types.Tuple([_unsigned(part) for part in parts])


class UnsignedIndexCompiler(CompilerBase):
    """Numba's compiler with `UnsignedIndices`."""

    def define_pipelines(self) -> list[Any]:
        """Insert the pass after type inference."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(UnsignedIndices, NopythonTypeInference)
        passes.finalize()
        return [passes]
