"""How uneven the areas are: what tells Lloyd rounds that they have settled."""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..core.compiler import threaded
from ..core.geometry import area_vector
from ..core.vocabulary import DEAD, Blocks, Mesh
from ..mesh.blocks import per_block
from ..mesh.walk import corners_of

__all__ = ["area_spread"]


def area_spread(mesh: Mesh, blocks: Blocks, parallel: bool) -> float:
    """Compute the coefficient of variation of the areas of faces over their squared target lengths.

    It falls as the area error does, and needs no mean first: one pass.

    Parameters
    ----------
    mesh : Mesh
    blocks : Blocks
    parallel : bool

    Returns
    -------
    float
        Standard deviation over mean; 0 without faces. The same bits on any number of threads: sums are
        taken per block, then over the blocks in their order.
    """
    sums = np.zeros((len(blocks.face) - 1, 3))
    _sum_powers(parallel, mesh, blocks, sums)
    number = first = second = 0.0
    for row in sums.tolist():
        number += row[0]
        first += row[1]
        second += row[2]
    if not first > 0.0:
        return 0.0
    return sqrt(max(second * number / (first * first) - 1.0, 0.0))


@threaded(per_block)
def _sum_powers(span, mesh, blocks, sums):
    """Sum number, areas and squared areas of the faces of a block."""
    X = mesh.X
    for k in range(span[0], span[1]):
        number = first = second = 0.0
        for f in range(blocks.face[k], blocks.face[k + 1]):
            a, b, c = corners_of(mesh.origin, f)
            if a == DEAD:
                continue
            x, y, z = area_vector(X, a, b, c)
            length = X[a, 3] + X[b, 3] + X[c, 3]
            area = sqrt(x * x + y * y + z * z) / (length * length)
            number += 1.0
            first += area
            second += area * area
        sums[k, 0], sums[k, 1], sums[k, 2] = number, first, second
