"""Guards of a collapse: each says of one thing whether the mesh would be worse off.

A collapse moves the ends a and b of an edge to one place. `faces` lists the outgoing half-edges of an
end, `ring` its ring vertices, `normals` the area vectors of its faces and their lengths.
"""

from __future__ import annotations

from math import sqrt

from .._jit import inlined
from .._types import APEX, FIXED, NONE
from ..geometry import distance_squared, face_vector, mean_ratio, turn_exceeds
from ..halfedge import following, previous

__all__ = ["folds_over", "keeps_boundary", "keeps_link", "makes_sliver", "overshoots"]


@inlined
def keeps_boundary(mesh, h, a, b):
    """Guard: fixed vertices and tips stay, and no inner edge joins two parts of the boundary.

    A boundary edge may go unless its face hangs on it alone.
    """
    kind = min(mesh.kind[a], mesh.kind[b])
    if kind == FIXED or kind == APEX:
        return False
    on_a = mesh.twin[mesh.vertex_halfedge[a]] == NONE
    on_b = mesh.twin[mesh.vertex_halfedge[b]] == NONE
    if mesh.twin[h] != NONE:
        return not (on_a and on_b)
    return mesh.twin[following(h)] != NONE or mesh.twin[previous(h)] != NONE


@inlined
def keeps_link(mesh, h, ring_a, n_a, m_a, ring_b, n_b, m_b):
    """Guard: the link condition, link(a) and link(b) meet in link(ab) only.

    [Dey et al. 1999]: the common neighbours are the apexes of the edge's faces, and a tetrahedron,
    whose links share an edge too, stays.
    """
    common = 0
    for i in range(m_a):
        for j in range(m_b):
            if ring_a[i] == ring_b[j]:
                common += 1
    if mesh.twin[h] == NONE:
        return common == 1
    return common == 2 and not (n_a == 3 and m_a == 3 and n_b == 3 and m_b == 3)


@inlined
def overshoots(X, x, y, z, other, ring, m, limit):
    """Guard: an edge from the new position to the ring would be too long."""
    longest = 0.0
    for i in range(m):
        w = ring[i]
        if w != other:
            dx = X[w, 0] - x
            dy = X[w, 1] - y
            dz = X[w, 2] - z
            longest = max(longest, dx * dx + dy * dy + dz * dz)
    return longest > limit


@inlined
def folds_over(mesh, x, y, z, other, faces, n, normals, cosine):
    """Guard: a face that stays would turn its normal too far, or lose its area."""
    X = mesh.X
    for i in range(n):
        v = mesh.origin[following(faces[i])]
        w = mesh.origin[previous(faces[i])]
        if v == other or w == other:
            continue
        nx, ny, nz = face_vector(x, y, z, X[v, 0], X[v, 1], X[v, 2], X[w, 0], X[w, 1], X[w, 2])
        if normals[i, 3] == 0.0:
            if nx == 0.0 and ny == 0.0 and nz == 0.0:
                return True
        elif turn_exceeds(normals[i, 0], normals[i, 1], normals[i, 2], nx, ny, nz, cosine):
            return True
    return False


@inlined
def makes_sliver(mesh, x, y, z, a, b, faces, n_a, n_b):
    """Guard (optional): the worst triangle after would be worse than the worst before."""
    X = mesh.X
    before = 1.0
    after = 1.0
    for side in range(2):
        other = b if side == 0 else a
        for i in range(n_a if side == 0 else n_b):
            h = faces[side, i]
            u = mesh.origin[h]
            v = mesh.origin[following(h)]
            w = mesh.origin[previous(h)]
            opposite = distance_squared(X, v, w)
            before = min(before, _shape(X, X[u, 0], X[u, 1], X[u, 2], v, w, opposite))
            if v != other and w != other:
                after = min(after, _shape(X, x, y, z, v, w, opposite))
    return after < before


@inlined
def _shape(X, x, y, z, v, w, opposite):
    nx, ny, nz = face_vector(x, y, z, X[v, 0], X[v, 1], X[v, 2], X[w, 0], X[w, 1], X[w, 2])
    lv = (X[v, 0] - x) ** 2 + (X[v, 1] - y) ** 2 + (X[v, 2] - z) ** 2
    lw = (X[w, 0] - x) ** 2 + (X[w, 1] - y) ** 2 + (X[w, 2] - z) ** 2
    return mean_ratio(lv, lw, opposite, sqrt(nx * nx + ny * ny + nz * nz))
