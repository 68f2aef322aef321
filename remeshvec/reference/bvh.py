"""Bounding-volume tree over the reference surface, and its closest point with a hint.

The faces come in Morton order, so the tree needs no construction: leaves are runs of faces, and every
level groups four boxes of the one below. A query walks over the surface from the face found last time
until no neighbour is closer. The walk mostly ends at the closest face and never on another sheet. It is
far cheaper than a search of the whole tree, which takes some tenths of a microsecond even from there.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..core.compiler import inlined, kernel, threaded
from ..core.geometry import closest_on_triangle, face_vector, point
from ..core.vocabulary import NONE, FloatArray, IndexArray, Tree
from ..mesh.walk import next_halfedge, previous_halfedge

__all__ = [
    "ARITY",
    "LEAF",
    "NO_NORMAL",
    "STACK",
    "WALK_TRUST",
    "Surface",
    "build_tree",
    "closest_face",
    "closest_faces",
    "closest_points",
    "corner",
    "face_distance",
    "point_on_face",
    "search_face",
    "walk_to",
    "walk_to_face",
]

LEAF = 4  # faces in a leaf
ARITY = 4  # boxes in a node
_WALK = 64  # steps of a walk
_FAN = 32  # faces around a corner that one step looks at
_POINTS = 256  # points that follow each other in one query

# A walk that ends this close to the point, as a share of the target length, is trusted: the rest of the
# patch is not searched.
WALK_TRUST = 0.05

# For `search_face`: every face may be found.
NO_NORMAL = (0.0, 0.0, 0.0)

STACK = 64  # boxes waiting: 3 per level; 16 levels hold 4e9 leaves


class Surface:
    """A surface whose patches and tree are built on first use.

    Sweeps that do not project need neither.

    Parameters
    ----------
    X : (n, 3) or (n, 4) float64
    origin : (3 m,) int32
        Corners of the faces, which come in Morton order.
    twin : (3 m,) int32
        Opposite half-edges, ``NONE`` where a patch ends.
    parallel : bool
        Whether the parallel kernels may run; can be changed before the tree is first used.
    """

    def __init__(self, X: FloatArray, origin: IndexArray, twin: IndexArray, parallel: bool) -> None:
        self.X = X
        self.origin = origin
        self.twin = twin
        self.parallel = parallel

    def __getstate__(self) -> dict[str, object]:
        """Leave the tree out of pickles: it is larger than everything else and quickly built."""
        return {name: value for name, value in vars(self).items() if name != "tree"}

    @cached_property
    def tree(self) -> Tree:
        """The tree; coordinates must not have changed."""
        F = self.origin.reshape(-1, 3)
        patch = np.full(len(F), NONE, np.int32)
        _fill_patches(self.twin, patch)
        return build_tree(self.X, F, self.twin, patch, self.parallel)


@kernel
def _fill_patches(twin, patch):
    """Set the patch of every face: connected faces get the same number."""
    stack = np.empty(patch.size, np.int32)
    count = 0
    for seed in range(patch.size):
        if patch[seed] != NONE:
            continue
        patch[seed] = count
        stack[0] = seed
        size = 1
        while size > 0:
            size -= 1
            f = np.int64(stack[size])
            for h in range(3 * f, 3 * f + 3):
                t = twin[h]
                if t != NONE and patch[t // 3] == NONE:
                    patch[t // 3] = count
                    stack[size] = t // 3
                    size += 1
        count += 1


def build_tree(
    X: FloatArray, F: IndexArray, twin: IndexArray, patch: IndexArray, parallel: bool
) -> Tree:
    """Build the tree over faces in Morton order.

    Parameters
    ----------
    X : (n, 3) or (n, 4) float64
    F : (m, 3) int32
    twin : (3 m,) int32
        Opposite half-edges, ``NONE`` where no walk goes on.
    patch : (m,) int32
        Patch of every face: what walks can reach.
    """
    counts = [-(-len(F) // LEAF)]
    while counts[-1] > 1:
        counts.append(-(-counts[-1] // ARITY))
    level = np.zeros(len(counts) + 1, np.int64)
    level[1:] = np.cumsum(counts)
    corners = np.empty((len(F), 9))
    boxes = np.empty((int(level[-1]), 6))
    _fill_leaves(parallel, X, F, corners, boxes)
    for i in range(1, len(counts)):
        _fill_level(boxes, level[i - 1], level[i], level[i + 1])
    return Tree(corners, twin, patch, boxes, level)


@threaded(lambda X, F, *_: -(-len(F) // LEAF))
def _fill_leaves(span, X, F, corners, boxes):
    for leaf in range(span[0], span[1]):
        for i in range(3):
            boxes[leaf, i] = np.inf
            boxes[leaf, 3 + i] = -np.inf
        for f in range(LEAF * leaf, min(LEAF * leaf + LEAF, F.shape[0])):
            for c in range(3):
                for i in range(3):
                    x = X[F[f, c], i]
                    corners[f, 3 * c + i] = x
                    boxes[leaf, i] = min(boxes[leaf, i], x)
                    boxes[leaf, 3 + i] = max(boxes[leaf, 3 + i], x)


def _fill_level(boxes: FloatArray, below: int, start: int, end: int) -> None:
    """Boxes of one level as unions of the level below."""
    groups = np.arange(below, start, ARITY)
    boxes[start:end, :3] = np.minimum.reduceat(boxes[:start, :3], groups, axis=0)
    boxes[start:end, 3:] = np.maximum.reduceat(boxes[:start, 3:], groups, axis=0)


@inlined
def _box_distance(boxes, i, p):
    """Squared distance from a point to a box."""
    x, y, z = p
    dx = max(boxes[i, 0] - x, 0.0, x - boxes[i, 3])
    dy = max(boxes[i, 1] - y, 0.0, y - boxes[i, 4])
    dz = max(boxes[i, 2] - z, 0.0, z - boxes[i, 5])
    return dx * dx + dy * dy + dz * dz


@inlined
def corner(corners, f, c):
    """Return the coordinates of corner ``c`` of a face as a tuple."""
    return corners[f, 3 * c], corners[f, 3 * c + 1], corners[f, 3 * c + 2]


@inlined
def face_distance(corners, f, p):
    """Weights of corners 1 and 2 at the point of a face closest to p; squared distance."""
    a, b, c = corner(corners, f, 0), corner(corners, f, 1), corner(corners, f, 2)
    return closest_on_triangle(p, a, b, c)


@inlined
def point_on_face(corners, f, s, t):
    """Point of a face from the weights of its corners 1 and 2."""
    x, y, z = corners[f, 0], corners[f, 1], corners[f, 2]
    return (
        x + s * (corners[f, 3] - x) + t * (corners[f, 6] - x),
        y + s * (corners[f, 4] - y) + t * (corners[f, 7] - y),
        z + s * (corners[f, 5] - z) + t * (corners[f, 8] - z),
    )


@inlined
def walk_to_face(tree, p, start):
    """Go to the closest neighbour until none is closer.

    Neighbours are the faces around the edge or corner that holds the closest point. Returns what
    `closest_face` does, for the part of the surface that the walk sees.
    """
    best = start
    s, t, distance = face_distance(tree.corners, start, p)
    for _ in range(_WALK):
        face = best
        on_edge_0 = t == 0.0
        on_edge_1 = s + t > 1.0 - 1e-12
        on_edge_2 = s == 0.0
        if not (on_edge_0 or on_edge_1 or on_edge_2):
            break
        # Edge i runs from corner i; a corner lies on the edge that starts there and on the one before.
        edge = 0 if on_edge_0 else (1 if on_edge_1 else 2)
        at_corner = (on_edge_0 and (on_edge_1 or on_edge_2)) or (on_edge_1 and on_edge_2)
        if at_corner:
            edge = 1 if on_edge_0 and on_edge_1 else (2 if on_edge_1 else 0)
        h = 3 * face + edge
        for _ in range(_FAN):
            h = np.int64(tree.twin[h])
            if h == NONE:
                break
            fs, ft, fd = face_distance(tree.corners, h // 3, p)
            if fd < distance:
                best, s, t, distance = h // 3, fs, ft, fd
            if not at_corner:
                break
            h = next_halfedge(h)
            if h // 3 == face:
                break
        if at_corner:
            # The other way round, for a corner on the boundary.
            h = np.int64(tree.twin[previous_halfedge(3 * face + edge)])
            if h != NONE and h // 3 != face:
                fs, ft, fd = face_distance(tree.corners, h // 3, p)
                if fd < distance:
                    best, s, t, distance = h // 3, fs, ft, fd
        if best == face:
            break
    return best, s, t, distance


@inlined
def closest_face(tree, p, hint, trust, stack):
    """Face of the hint's patch closest to a point, with weights of its corners 1 and 2.

    The squared distance comes last. Ties go to the face where the walk from the hint ends. If that face
    is within a squared distance of ``trust``, it is taken without a search: 0 gives the exact answer,
    inf the walk alone. ``stack`` is (2, STACK) int64 scratch: boxes waiting and their levels.
    """
    face, s, t, distance = walk_to_face(tree, p, hint)
    if distance <= trust:
        return face, s, t, distance
    return search_face(tree, p, face, NO_NORMAL, stack)


@inlined
def search_face(tree, p, face, normal, stack):
    """Search the whole patch of a face for the face closest to a point, starting with that face.

    With a normal, faces that look the other way do not count, unless the search started there. So a
    point does not jump to the other side of a thin sheet.
    """
    best = face
    s, t, distance = face_distance(tree.corners, face, p)
    seen = best
    patch = tree.patch[seen]
    top = tree.level.size - 2
    stack[0, 0] = 0
    stack[1, 0] = top
    size = 1
    while size > 0:
        size -= 1
        i = stack[0, size]
        d = stack[1, size]
        if d == 0:
            for f in range(LEAF * i, min(LEAF * i + LEAF, tree.corners.shape[0])):
                if f != seen and tree.patch[f] == patch:
                    fs, ft, fd = face_distance(tree.corners, f, p)
                    if fd < distance and not looks_away(tree.corners, f, normal):
                        best, s, t, distance = f, fs, ft, fd
            continue
        start = tree.level[d - 1]
        end = min(start + ARITY * i + ARITY, tree.level[d])
        for j in range(start + ARITY * i, end):
            if _box_distance(tree.boxes, j, p) < distance:
                stack[0, size] = j - start
                stack[1, size] = d - 1
                size += 1
    return best, s, t, distance


@inlined
def has_agreeing_face(tree, p, normal, reach_squared, stack):
    """Tell whether a face of any patch that looks the same way is within reach of a point."""
    top = tree.level.size - 2
    stack[0, 0] = 0
    stack[1, 0] = top
    size = 1
    while size > 0:
        size -= 1
        i = stack[0, size]
        d = stack[1, size]
        if d == 0:
            for f in range(LEAF * i, min(LEAF * i + LEAF, tree.corners.shape[0])):
                if not looks_away(tree.corners, f, normal):
                    _, _, distance = face_distance(tree.corners, f, p)
                    if distance <= reach_squared:
                        return True
            continue
        start = tree.level[d - 1]
        end = min(start + ARITY * i + ARITY, tree.level[d])
        for j in range(start + ARITY * i, end):
            if _box_distance(tree.boxes, j, p) <= reach_squared:
                stack[0, size] = j - start
                stack[1, size] = d - 1
                size += 1
    return False


@inlined
def looks_away(corners, f, normal):
    """Tell whether a face looks against a normal."""
    a, b, c = corner(corners, f, 0), corner(corners, f, 1), corner(corners, f, 2)
    x, y, z = face_vector(a, b, c)
    return x * normal[0] + y * normal[1] + z * normal[2] < 0.0


def closest_faces(
    tree: Tree, points: FloatArray, hint: IndexArray, trust: float, parallel: bool
) -> tuple[IndexArray, FloatArray]:
    """Find the closest face of many points.

    Parameters
    ----------
    tree : Tree
    points : (k, 3) float64
        Fastest if neighbouring points follow each other.
    hint : (k,) int32
        Face to start at, and the only patch to search; ``NONE`` starts where the previous point ended.
    trust : float
        A face within this distance is good enough; 0 for the closest.
    parallel : bool

    Returns
    -------
    face : (k,) int32
    distance : (k,) float64
    """
    face, _, distance = _look_up(tree, points, hint, trust, parallel)
    return face, np.sqrt(distance)


def closest_points(
    tree: Tree, points: FloatArray, hint: IndexArray, trust: float, parallel: bool
) -> tuple[IndexArray, FloatArray]:
    """Find the closest face of many points, and where on it; see `closest_faces`.

    Returns
    -------
    face : (k,) int32
    barycentric : (k, 3) float64
    """
    face, weights, _ = _look_up(tree, points, hint, trust, parallel)
    return face, np.column_stack([1.0 - weights.sum(axis=1), weights])


def walk_to(
    tree: Tree, points: FloatArray, start: NDArray[np.integer]
) -> tuple[IndexArray, FloatArray, FloatArray]:
    """Walk from a face as close to each point as possible without crossing a curve.

    Returns
    -------
    face : (k,) int32
    barycentric : (k, 3) float64
    distance : (k,) float64
        Squared.
    """
    face, weights, distance = _look_up(tree, points, start.astype(np.int32), np.inf, False)
    return face, np.column_stack([1.0 - weights.sum(axis=1), weights]), distance


def _look_up(
    tree: Tree, points: FloatArray, hint: IndexArray, trust: float, parallel: bool
) -> tuple[IndexArray, FloatArray, FloatArray]:
    face, distance = np.empty(len(points), np.int32), np.empty(len(points))
    weights = np.empty((len(points), 2))
    _closest_faces(parallel, tree, points, hint, trust * trust, face, weights, distance)
    return face, weights, distance


@threaded(lambda tree, points, *_: -(-len(points) // _POINTS))
def _closest_faces(span, tree, points, hint, trust, face, weights, distance):
    for k in range(span[0], span[1]):
        stack = np.empty((2, STACK), np.int64)
        last = np.int64(0)
        for i in range(_POINTS * k, min(_POINTS * k + _POINTS, points.shape[0])):
            start = last if hint[i] == NONE else np.int64(hint[i])
            last, weights[i, 0], weights[i, 1], distance[i] = closest_face(
                tree, point(points, i), start, trust, stack
            )
            face[i] = last
