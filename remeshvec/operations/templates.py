"""Templates of split faces: the children of a face with one, two or three long edges."""

from __future__ import annotations

import numpy as np

__all__ = ["CORNER", "COUNT", "GAIN", "PART", "TWIN"]

# Child triangles of a face by its mask of long edges (bit i: edge i from corner i to i + 1); with
# two long edges bit 3 chooses the diagonal. Entries 0-2 are corners, 3-5 midpoints of edges 0-2.
_CHILDREN: dict[int, list[tuple[int, int, int]]] = {
    0: [(0, 1, 2)],
    1: [(0, 3, 2), (3, 1, 2)],
    2: [(1, 4, 0), (4, 2, 0)],
    4: [(2, 5, 1), (5, 0, 1)],
    7: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
    # edges 0 and 1 long: corner 1 is cut off, the quad 0-3-4-2 is halved by 3-2 or by 0-4.
    3: [(3, 1, 4), (0, 3, 2), (3, 4, 2)],
    3 + 8: [(3, 1, 4), (0, 3, 4), (0, 4, 2)],
    # edges 1 and 2 long: corner 2 is cut off, the quad 1-4-5-0 is halved by 4-0 or by 1-5.
    6: [(4, 2, 5), (1, 4, 0), (4, 5, 0)],
    6 + 8: [(4, 2, 5), (1, 4, 5), (1, 5, 0)],
    # edges 2 and 0 long: corner 0 is cut off, the quad 2-5-3-1 is halved by 5-1 or by 2-3.
    5: [(5, 0, 3), (2, 5, 1), (5, 3, 1)],
    5 + 8: [(5, 0, 3), (2, 5, 3), (2, 3, 1)],
}


def _build_templates() -> tuple[np.ndarray, ...]:
    """Turn the list of children into tables, one row per mask.

    Returns
    -------
    count : (16,) int64
        Children.
    corner : (16, 12) int64
        Corner or midpoint at which each half-edge of the children starts; -1 for no half-edge.
    inner : (16, 12) int64
        Twin of each half-edge inside the template, -1 on its outer edges.
    part : (16, 6) int64
        Half-edge on the first and on the second half of each outer edge; an edge that is not split has a
        first half only.
    gain : (16, 6) int64
        Faces that each corner gains and each midpoint has.
    """
    count = np.zeros(16, np.int64)
    corner = np.full((16, 12), -1, np.int64)
    inner = np.full((16, 12), -1, np.int64)
    part = np.full((16, 6), -1, np.int64)
    for mask, children in _CHILDREN.items():
        count[mask] = len(children)
        flat = [v for child in children for v in child]
        ends = {}
        for i, v in enumerate(flat):
            corner[mask, i] = v
            ends[v, flat[i - i % 3 + (i + 1) % 3]] = i
        for (a, b), i in ends.items():
            inner[mask, i] = ends.get((b, a), -1)
        for edge in range(3):
            a, b, middle = edge, (edge + 1) % 3, 3 + edge
            if (a, b) in ends:
                part[mask, 2 * edge] = ends[a, b]
            else:
                part[mask, 2 * edge] = ends[a, middle]
                part[mask, 2 * edge + 1] = ends[middle, b]
    gain = np.stack([(corner == v).sum(axis=1) - (v < 3) for v in range(6)], axis=1)
    return count, corner, inner, part, gain


COUNT, CORNER, TWIN, PART, GAIN = _build_templates()
