"""Even ranges of elements for threads to share."""

from __future__ import annotations

from typing import Any

import numpy as np

from .threads import available_threads
from .vocabulary import IntArray

__all__ = ["even_ranges", "per_range"]


# Most ranges. Each has a row of marks for all vertices, though it touches few of them.
_MOST_RANGES = 16


def even_ranges(count: int, parallel: bool) -> IntArray:
    """Cut ``range(count)`` into one range, or, where threads share the work, into two per thread."""
    if not parallel:
        return np.array([0, count])
    ranges = min(2 * available_threads(), _MOST_RANGES)
    return np.arange(ranges + 1, dtype=np.int64) * count // ranges


def per_range(cuts: IntArray, *_: Any) -> int:
    """Return the number of ranges: one piece of a threaded loop each."""
    return len(cuts) - 1
