"""Tips of horns and cones, which no crease marks."""

from __future__ import annotations

import numpy as np

from ._jit import kernel
from ._types import INNER, IndexArray, Mesh
from .geometry import corner_angles

__all__ = ["apexes"]

# An inner vertex with a larger angle defect is the tip of a horn or a cone. At 90 degrees, 4 in a
# thousand vertices of a badly triangulated scan are held; at 120, 2.
APEX_DEFECT = 120.0


def apexes(mesh: Mesh) -> IndexArray:
    """Find inner vertices with an angle defect above 120 degrees, no two closer than their target length.

    Of two that are closer the larger defect wins, of equals the smaller index. Without them, tips
    thinner than that lose about as much of their length.

    Returns
    -------
    (k,) int32
        Vertices.
    """
    defect = np.full(len(mesh.X), 2.0 * np.pi)
    _subtract_angles(mesh.X, mesh.origin, defect)
    found = np.flatnonzero((defect > np.radians(APEX_DEFECT)) & (mesh.kind == INNER))
    found = found[np.argsort(-defect[found], kind="stable")]
    kept = np.empty(len(found), np.int32)
    return kept[: _keep_apart(mesh.X, found, kept)]


@kernel
def _subtract_angles(X, origin, defect):
    for f in range(origin.size // 3):
        a, b, c = origin[3 * f], origin[3 * f + 1], origin[3 * f + 2]
        angle_a, angle_b, angle_c = corner_angles(X, a, b, c)
        defect[a] -= angle_a
        defect[b] -= angle_b
        defect[c] -= angle_c


@kernel
def _keep_apart(X, found, kept):
    count = 0
    for v in found:
        is_free = True
        for i in range(count):
            u = kept[i]
            d = (X[u, 0] - X[v, 0]) ** 2 + (X[u, 1] - X[v, 1]) ** 2 + (X[u, 2] - X[v, 2]) ** 2
            if d < X[v, 3] * X[v, 3]:
                is_free = False
                break
        if is_free:
            kept[count] = v
            count += 1
    return count
