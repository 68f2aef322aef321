"""Even ranges of elements, which threads share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .threads import available_threads

__all__ = ["even_ranges", "per_range"]


# Ranges at most: each has a row of marks for all vertices, of which it touches little.
_MOST_RANGES = 16


def even_ranges(count: int, parallel: bool) -> NDArray[np.int64]:
    """Cut ``range(count)`` into one range, or two for each thread."""
    if not parallel:
        return np.array([0, count])
    ranges = min(2 * available_threads(), _MOST_RANGES)
    return np.arange(ranges + 1, dtype=np.int64) * count // ranges


def per_range(cuts: NDArray[np.int64], *_: Any) -> int:
    """Pieces of a loop over ranges."""
    return len(cuts) - 1
