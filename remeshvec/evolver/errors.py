"""What can go wrong with Surface Evolver."""

from __future__ import annotations

from ..errors import RemeshvecError

__all__ = ["EvolverError"]


class EvolverError(RemeshvecError, RuntimeError):
    """Surface Evolver is absent, failed, took too long or wrote nothing; says which."""
