"""Conflict-free edge sets: which edges may change at the same time.

Two operations conflict when their footprints share a vertex (flip: the four vertices of the quad;
collapse: the closed one-rings of both ends; moving a vertex: its closed one-ring). The arrays are
cut into blocks whose number depends on the size of the mesh only, and a phase runs in stages:

* ``OWNED``: a block takes the candidates whose whole footprint lies in its own vertex range. Sets
  of different blocks cannot conflict: blocks run in parallel, each in order, in place.
* ``SHIFTED``: likewise over blocks shifted by half a block, for candidates that straddle a border.
* ``SHIFTED + i``: likewise over groups of 4^i blocks, for the few candidates where the order of the
  blocks leaps, until one group is left.

So the result is that of one fixed sequence, however many threads run it, and no edge is skipped
because it lies at a border. Independent sets by rounds [Luby 1986] cost 4 to 10 times the work and were
dropped.

A phase lists its candidates once, block by block (`Candidates`), and visits them stage after stage:
``for i in slots(candidates, blocks, stage, k)``. A stage sets a candidate that it has dealt with to
``DONE``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..core.compiler import inlined
from ..core.vocabulary import Blocks, IndexArray, IntArray, Mesh

__all__ = [
    "DONE",
    "OWNED",
    "SHIFTED",
    "Candidates",
    "face_range",
    "list_range",
    "make_blocks",
    "make_candidates",
    "owns",
    "owns_all",
    "per_block",
    "per_stage_block",
    "slots",
    "stages",
    "vertex_range",
]

OWNED = 0
SHIFTED = 1

DONE = -1

# Faces per block. Smaller blocks balance better over threads, larger ones have fewer edges across
# borders. A mesh of less than 1.5 blocks is one block and has no border.
FACES_PER_BLOCK = 12288


class Candidates(NamedTuple):
    """Candidate lists of a phase, one per block.

    Parameters
    ----------
    items : (k,) int32
        Half-edges, faces or vertices; ``DONE`` once dealt with.
    starts : (b + 1,) int64
        Slot in ``items`` where the list of each block begins; lists need not fill their slots.
    counts : (b,) int64
        Candidates of each block.
    """

    items: IndexArray
    starts: IntArray
    counts: IntArray


def make_candidates(starts: IntArray) -> Candidates:
    """Allocate empty lists, see `Candidates`; a block needs no more slots than it has elements."""
    counts = np.zeros(len(starts) - 1, np.int64)
    return Candidates(np.empty(int(starts[-1]), np.int32), starts, counts)


def make_blocks(mesh: Mesh) -> Blocks:
    """Cut faces into even ranges, and vertices into the ranges that these faces own.

    In the order that `split` and `morton` leave, vertices follow the half-edges that own them, so range
    k of the vertices belongs to range k of the faces. Edges that do not fit are left to later stages.
    """
    n_faces = mesh.origin.size // 3
    n_vertices = mesh.vertex_halfedge.size
    count = max(1, round(n_faces / FACES_PER_BLOCK))
    if count == 1:
        return Blocks(np.array([0, n_faces]), np.array([0, n_vertices]))
    face = (np.arange(count + 1, dtype=np.int64) * n_faces) // count
    vertex = np.zeros(count + 1, np.int64)
    vertex[count] = n_vertices
    for k in range(1, count):
        vertex[k] = _first_owned(mesh, 3 * int(face[k]), n_vertices)
    return Blocks(face, np.maximum.accumulate(vertex))


def _first_owned(mesh: Mesh, start: int, missing: int) -> int:
    """Return the vertex of the first half-edge from ``start`` on that owns one."""
    step = 64
    while start < mesh.origin.size:
        h = np.arange(start, min(start + step, mesh.origin.size))
        owned = np.flatnonzero(mesh.vertex_halfedge[mesh.origin[h]] == h)
        if len(owned):
            return int(mesh.origin[h[owned[0]]])
        start += step
        step *= 8
    return missing


def stages(blocks: Blocks) -> tuple[int, ...]:
    """Return the stages that a mesh of so many blocks needs; a single block owns everything."""
    last = OWNED
    while _group(last) < len(blocks.face) - 1:
        last += 1
    return tuple(range(last + 1))


def per_block(mesh: Mesh, blocks: Blocks, *_: Any) -> int:
    """Return the number of blocks: one piece of a threaded loop each."""
    return len(blocks.face) - 1


def per_stage_block(mesh: Mesh, blocks: Blocks, stage: int, *_: Any) -> int:
    """Return the number of blocks, or groups of them, in a stage: one piece of a threaded loop each."""
    count = len(blocks.face) - 1
    return count - 1 if stage == SHIFTED else -(-count // _group(stage))


def _group(stage: int) -> int:
    """Return the number of blocks in a group."""
    return 1 if stage <= SHIFTED else 1 << 2 * (stage - SHIFTED)


@inlined
def vertex_range(blocks, stage, k):
    """Return the first and the end of the vertices that block ``k`` of a stage may touch."""
    return _stage_range(blocks.vertex, stage, k)


@inlined
def face_range(blocks, stage, k):
    """Return the first and the end of the faces that block ``k`` of a stage may remove and make."""
    return _stage_range(blocks.face, stage, k)


@inlined
def _stage_range(ends, stage, k):
    if stage == SHIFTED:
        return (ends[k] + ends[k + 1]) // 2, (ends[k + 1] + ends[k + 2]) // 2
    first, end = _groups(ends.size - 1, stage, k)
    return ends[first], ends[end]


@inlined
def owns(owned, v):
    """Tell whether a vertex range (low, high) holds a vertex."""
    return owned[0] <= v < owned[1]


@inlined
def owns_all(owned, a, b, c):
    """Tell whether a vertex range holds three vertices, such as the corners of a face."""
    return min(a, b, c) >= owned[0] and max(a, b, c) < owned[1]


@inlined
def list_range(blocks, stage, k):
    """Return the first and the end of the candidate lists that block ``k`` of a stage reads."""
    if stage == SHIFTED:
        return np.int64(k), np.int64(k) + 2
    return _groups(blocks.face.size - 1, stage, k)


@inlined
def slots(candidates, blocks, stage, k):
    """Yield the slots of all candidates that block ``k`` of a stage reads, in order."""
    first, end = list_range(blocks, stage, k)
    for j in range(first, end):
        start = candidates.starts[j]
        for i in range(start, start + candidates.counts[j]):  # noqa: UP028  no `yield from` in Numba
            yield i


@inlined
def _groups(count, stage, k):
    size = np.int64(1) << (2 * max(0, stage - SHIFTED))
    return np.int64(k) * size, min((np.int64(k) + 1) * size, np.int64(count))
