"""Exceptions, named by meaning; each message says what is wrong, where, and what to do."""

from __future__ import annotations

__all__ = [
    "BatchError",
    "MeshFormatError",
    "MeshInputError",
    "OptionError",
    "RemeshWarning",
    "RemeshvecError",
    "SingularSystemError",
    "WorkerError",
]


class RemeshvecError(Exception):
    """Base of every exception that remeshvec raises on purpose."""


class RemeshWarning(UserWarning):
    """A result does not keep a bound, or a part was left as it was; the message has the numbers."""


class MeshInputError(RemeshvecError, ValueError):
    """The vertex or face array cannot be a triangle mesh (shape, dtype, NaN, index range, empty)."""


class OptionError(RemeshvecError, ValueError):
    """An option has a value that cannot work (a negative length, an unknown preset)."""


class MeshFormatError(RemeshvecError, ValueError):
    """A mesh file cannot be read or written; the message names the file and the reason."""


class SingularSystemError(RemeshvecError, ValueError):
    """A linear system has no unique solution.

    The message names what is missing (fixed vertices, a finite entry).
    """


class WorkerError(RemeshvecError, RuntimeError):
    """A worker process died, took too long, or could not exchange its input or result."""


class BatchError(RemeshvecError, RuntimeError):
    """An item of a batch failed; raised from the item's own error.

    Attributes
    ----------
    index : int
        Number of the item, counted from 0.
    name : str
        Path of the item, or a description.
    reason : str
        The item's own error in one line.
    """

    def __init__(self, index: int, name: str, reason: str) -> None:
        super().__init__(index, name, reason)  # all three: a pickle calls the class with `args`
        self.index = index
        self.name = name
        self.reason = reason

    def __str__(self) -> str:
        return f"item {self.index} ({self.name}) failed: {self.reason}"
