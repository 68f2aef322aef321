"""Topology and measures of small meshes, slow and obvious: the tests' own, independent answers."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

Edge = tuple[int, int]


def proper(F) -> list[tuple[int, int, int]]:
    """Return the faces that do not repeat a vertex, as tuples."""
    return [tuple(f) for f in np.asarray(F).tolist() if len(set(f)) == 3]


def edge_faces(F) -> dict[Edge, list[int]]:
    """Map each undirected edge to the faces (numbers among `proper`) that use it."""
    uses = defaultdict(list)
    for i, (a, b, c) in enumerate(proper(F)):
        for p, q in ((a, b), (b, c), (c, a)):
            uses[min(p, q), max(p, q)].append(i)
    return dict(uses)


def euler_number(F) -> int:
    """Count the used vertices - edges + faces."""
    return len({v for f in proper(F) for v in f}) - len(edge_faces(F)) + len(proper(F))


def boundary_loops(F) -> list[list[Edge]]:
    """Return the boundary edges, grouped by walking from edge to edge around their ends."""
    faces, uses = proper(F), edge_faces(F)
    open_edges = [edge for edge, users in uses.items() if len(users) == 1]
    loops, seen = [], set()
    for first in open_edges:
        if first in seen:
            continue
        loop = [first]
        for end in first:
            loop += walk_boundary(faces, uses, first, end)
        seen.update(loop)
        loops.append(list(dict.fromkeys(loop)))
    return loops


def walk_boundary(faces, uses, first: Edge, end: int) -> list[Edge]:
    """Follow the boundary from one edge over its end, until it closes or meets a branch."""
    path, edge = [], first
    while True:
        face = uses[edge][0]
        while True:  # turn around `end` to the next edge that has not two faces
            other = next(v for v in faces[face] if v not in edge)
            edge = (min(end, other), max(end, other))
            if len(uses[edge]) != 2:
                break
            face = sum(uses[edge]) - face
        if len(uses[edge]) > 2 or edge == first:
            return path
        path.append(edge)
        end = sum(edge) - end


def components(F) -> int:
    """Count the groups of faces that hang together along edges."""
    uses = edge_faces(F)
    beside = defaultdict(set)
    for users in uses.values():
        for i in users:
            beside[i].update(users)
    return groups(beside)


def groups(beside: dict) -> int:
    """Count the connected components of a graph given as neighbour sets."""
    todo, count = set(beside), 0
    while todo:
        stack, count = [todo.pop()], count + 1
        while stack:
            found = beside[stack.pop()] & todo
            todo -= found
            stack += found
    return count


def is_edge_manifold(F) -> bool:
    """Whether no edge has more than two faces."""
    return all(len(users) <= 2 for users in edge_faces(F).values())


def is_vertex_manifold(F) -> bool:
    """Whether the faces at every vertex form one fan."""
    return not pinched_vertices(F) and is_edge_manifold(F)


def pinched_vertices(F) -> list[int]:
    """Return the vertices whose faces form more than one group across two-faced edges."""
    fans = defaultdict(lambda: defaultdict(set))
    for i, f in enumerate(proper(F)):
        for v in f:
            fans[v][i].add(i)
    for edge, users in edge_faces(F).items():
        for v in edge:
            for i in users if len(users) == 2 else ():
                fans[v][i].update(users)
    return [v for v, beside in fans.items() if groups(beside) > 1]


def is_oriented(F) -> bool:
    """Whether no two faces run an edge the same way."""
    directed = [(f[c], f[(c + 1) % 3]) for f in proper(F) for c in range(3)]
    return len(set(directed)) == len(directed)


def is_closed(F) -> bool:
    """Whether every edge has two faces or more."""
    return all(len(users) > 1 for users in edge_faces(F).values())


def duplicate_faces(F) -> int:
    """Count the faces that have the same three vertices as an earlier one."""
    return len(proper(F)) - len({frozenset(f) for f in proper(F)})


def degenerate_faces(V, F, tolerance: float = 1e-14) -> int:
    """Count the faces that repeat a vertex, or have no area (relative to the longest edge)."""
    count = 0
    for f in np.asarray(F).tolist():
        a, b, c = np.asarray(V, dtype=float)[f]
        longest = max(np.linalg.norm(b - a), np.linalg.norm(c - b), np.linalg.norm(a - c))
        flat = np.linalg.norm(np.cross(b - a, c - a)) <= tolerance * longest**2
        count += len(set(f)) < 3 or bool(flat)
    return count


def unreferenced(V, F) -> int:
    """Count the vertices that no proper face uses."""
    return len(V) - len({v for f in proper(F) for v in f})


def area(V, F) -> float:
    """Return the sum of the triangle areas."""
    a, b, c = np.moveaxis(np.asarray(V, dtype=float)[np.asarray(F)], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def volume(V, F) -> float:
    """Return the enclosed signed volume (closed surfaces; about the centre, against rounding)."""
    V = np.asarray(V, dtype=float)
    a, b, c = np.moveaxis((V - V.mean(axis=0))[np.asarray(F)], 1, 0)
    return float((a * np.cross(b, c)).sum() / 6)
