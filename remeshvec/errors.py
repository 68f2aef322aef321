"""Exceptions, named by meaning; every one says what is wrong, where, and what to do."""

from __future__ import annotations

__all__ = [
    "MeshFormatError",
    "MeshInputError",
    "OptionError",
    "RemeshvecError",
    "SingularSystemError",
]


class RemeshvecError(Exception):
    """Base of every exception that remeshvec raises on purpose."""


class MeshInputError(RemeshvecError, ValueError):
    """The vertex or face array cannot be a triangle mesh (shape, dtype, NaN, index range, empty)."""


class OptionError(RemeshvecError, ValueError):
    """An option has a value that cannot work (a negative length, an unknown preset)."""


class MeshFormatError(RemeshvecError, ValueError):
    """A mesh file cannot be read or written; names the file and the reason."""


class SingularSystemError(RemeshvecError, ValueError):
    """A linear system has no single solution; names what is missing (fixed vertices, a finite entry)."""
