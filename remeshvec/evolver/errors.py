"""The error raised by runs of Surface Evolver."""

from __future__ import annotations

from ..errors import RemeshvecError

__all__ = ["EvolverError"]


class EvolverError(RemeshvecError, RuntimeError):
    """Surface Evolver is absent, failed, took too long or wrote no dump; the message says which."""
