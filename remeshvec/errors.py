"""Exceptions, named by meaning; every one says what is wrong, where, and what to do."""

from __future__ import annotations

__all__ = [
    "BatchError",
    "MeshFormatError",
    "MeshInputError",
    "OptionError",
    "RemeshvecError",
    "SingularSystemError",
    "WorkerError",
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


class WorkerError(RemeshvecError, RuntimeError):
    """A worker process died, took too long, or could not exchange its input or result."""


class BatchError(RemeshvecError, RuntimeError):
    """An item of a batch failed; names the item, and is raised from what went wrong with it.

    Attributes
    ----------
    index : int
        Which item, counted from 0.
    name : str
        Its path, or what it is.
    """

    def __init__(self, index: int, name: str, reason: str) -> None:
        super().__init__(
            index, name, reason
        )  # all of them: exceptions are pickled by their arguments
        self.index = index
        self.name = name
        self.reason = reason

    def __str__(self) -> str:
        return f"item {self.index} ({self.name}) failed: {self.reason}"
