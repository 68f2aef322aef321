"""The only place with Numba flags: the decorators that compile kernels, and what they rest on."""

from .decorators import inlined, kernel, shared, threaded
from .notice import compile_notice
from .vector_sums import add_four, add_moment, add_row

__all__ = [
    "add_four",
    "add_moment",
    "add_row",
    "compile_notice",
    "inlined",
    "kernel",
    "shared",
    "threaded",
]
