"""Slides: vertices move along the polyline of their curve, to where their edges suit, sheets alike."""

import numpy as np
import pytest
from helpers import naive, zoo
from helpers.structure import (
    assert_on_reference,
    assert_valid,
    blocks_of,
    built,
    copied,
    curve_edges,
    curve_neighbours,
    cut_open,
    featured,
    next_of,
    one_block,
    packed,
)

from data.shapes import nonmanifold
from remeshvec.core.vocabulary import CURVE, FIXED, HELD, INNER, NON_MANIFOLD, NONE, PINNED
from remeshvec.operations import slide
from remeshvec.operations.project import project_curves
from remeshvec.operations.relax import relax_vertices
from remeshvec.operations.slide import slide_vertices
from remeshvec.operations.split import split_long_edges

SHARE = slide.SLIDE_SHARE  # of the way to where the edges suit
SHAPES = ["annulus", "cylinder", "closed_cylinder", "cube", "l_prism", "genus_2", "grid"]


def curved(name, factor=0.8, seed=0, lengths=None):
    """Mesh with features, split, its curve vertices moved along their curves; and its reference."""
    V, F = zoo.upsampled(*zoo.ZOO[name].make(), n=1, noise=0.0)
    mesh = built(V, F, ordered=True)
    reference = featured(mesh, factor * zoo.mean_edge(V, F), feature_angle=40.0).reference
    for _ in range(2):
        mesh, _ = split_long_edges(mesh, one_block(mesh), 1.2, False)
    mesh = packed(mesh)
    shaken(mesh, reference, 0.25 * mesh.X[0, 3], seed)
    if lengths is not None:
        mesh.X[:, 3] = lengths(mesh.X)
    return mesh, reference


def shaken(mesh, reference, amount, seed=0):
    """Move vertices of curves at random, alike where they lie in the same place, and project them."""
    free = np.flatnonzero(mesh.kind == CURVE)
    _, place = np.unique(mesh.X[free, :3], axis=0, return_inverse=True)
    noise = np.random.default_rng(seed).uniform(-amount, amount, size=(len(free), 3))
    mesh.X[free, :3] += noise[place.reshape(-1)]
    project_curves(mesh, one_block(mesh), reference, False)


class Polyline:
    """One curve of the reference in order: its edges, its corners' places and their arc lengths."""

    def __init__(self, reference, names, start):
        X, beside = reference.X[:, :3], curve_neighbours(reference)
        self.points, self.edges, self.closed = [], [], True
        v, h = int(reference.origin[start]), start
        for first in names:  # begin at an end if there is one
            for side, end in enumerate((first, next_of(int(first)))):
                if beside[side, first] == NONE:
                    v, h, self.closed = int(reference.origin[end]), int(first), False
        at = tuple(X[v])
        while h != NONE and h not in self.edges:
            self.points.append(at)
            self.edges.append(h)
            ends = [tuple(X[reference.origin[g]]) for g in (h, next_of(h))]
            side = 1 if ends[0] == at else 0
            at, h = ends[side], int(beside[side, h])
        self.points = np.array([*self.points, at])
        self.arcs = np.r_[0, np.cumsum(np.linalg.norm(np.diff(self.points, axis=0), axis=1))]
        self.total = self.arcs[-1]

    def arc(self, edge, p):
        k = self.edges.index(edge)
        a, b = self.points[k : k + 2]
        s = (p - a) @ (b - a) / ((b - a) @ (b - a))
        return self.arcs[k] + s * (self.arcs[k + 1] - self.arcs[k])

    def point(self, arc):
        arc = arc % self.total if self.closed else np.clip(arc, 0, self.total)
        return np.array([np.interp(arc, self.arcs, x) for x in self.points.T])


def polylines(mesh, reference):
    """Polyline of every name."""
    names = np.unique(mesh.curve[mesh.curve >= 0] & (NON_MANIFOLD - 1))
    found = {}
    beside = curve_neighbours(reference)
    todo = set(np.flatnonzero(reference.curve_row).tolist()) | set(names.tolist())
    while todo:
        group, stack = set(), [min(todo)]
        while stack:
            h = stack.pop()
            if h in group:
                continue
            group.add(h)
            stack += [int(g) for g in beside[:, h] if g != NONE]
        todo -= group
        line = Polyline(reference, sorted(group), min(group))
        assert set(line.edges) == group
        found.update(dict.fromkeys(group, line))
    return found


def slid(mesh, reference):
    """What one slide is to do: all at once, towards where distances along the curve suit the lengths."""
    lines, beside = polylines(mesh, reference), {}
    for edge in curve_edges(mesh):
        for v in edge:
            beside.setdefault(v, []).extend(edge - {v})
    on_curve = [v for v in beside if mesh.kind[v] in (CURVE, PINNED)]
    arcs = {v: lines[mesh.birth[v]].arc(mesh.birth[v], mesh.X[v, :3]) for v in on_curve}
    result = mesh.X[:, :3].copy()
    for v in on_curve:
        if mesh.kind[v] != CURVE:
            continue
        line, t = lines[mesh.birth[v]], arcs[v]
        u, w = beside[v]
        if line.closed:
            ahead = {x: (arcs[x] - t) % line.total for x in (u, w)}
            front = min(ahead, key=ahead.get)
            back = u + w - front
            distances = ahead[front], line.total - ahead[back]
        else:
            ends = {x: arcs[x] for x in (u, w) if mesh.kind[x] != FIXED}
            if not ends:
                result[v] = line.point(t + SHARE * (line.total / 2 - t))
                continue
            if len(ends) == 2:
                front, back = (u, w) if arcs[u] > arcs[w] else (w, u)
                distances = arcs[front] - t, t - arcs[back]
            else:
                (moving,) = ends
                corner = u + w - moving
                front, back = (moving, corner) if arcs[moving] > t else (corner, moving)
                distances = (
                    (arcs[moving] - t, t) if front == moving else (line.total - t, t - arcs[moving])
                )
        suits = [mesh.X[v, 3] + mesh.X[x, 3] for x in (front, back)]
        step = suits[1] / sum(suits) * sum(distances) - distances[1]
        result[v] = line.point(t + SHARE * step)
    return result


# --- one step ------------------------------------------------------------------------------------


@pytest.mark.parametrize("per_block", [20, 100_000])
@pytest.mark.parametrize("name", SHAPES)
def test_one_step_along_the_polyline(name, per_block, monkeypatch):
    lengths = lambda X: 1 + 0.2 * np.sin(5 * X[:, 0]) + 0.1 * X[:, 1]  # noqa: E731
    mesh, reference = curved(name, lengths=lengths)
    expected = slid(mesh, reference)
    before = copied(mesh)
    slide_vertices(mesh, blocks_of(mesh, per_block, monkeypatch), reference, False)
    assert mesh.X[:, :3] == pytest.approx(expected, rel=1e-9, abs=1e-11)
    assert np.linalg.norm(mesh.X - before.X, axis=1).max() > 0.01 * zoo.mean_edge(
        before.X[:, :3], before.origin.reshape(-1, 3)
    )
    assert np.array_equal(mesh.X[:, 3], before.X[:, 3])
    assert np.array_equal(mesh.birth[mesh.kind != CURVE], before.birth[mesh.kind != CURVE])
    assert_on_reference(mesh, reference)
    assert_valid(mesh)


@pytest.mark.parametrize("kind", [INNER, HELD, PINNED, FIXED])
def test_others_stay(kind):
    mesh, reference = curved("closed_cylinder")
    still = np.flatnonzero(mesh.kind == CURVE)[::3]
    mesh.kind[still] = kind
    before = mesh.X.copy()
    slide_vertices(mesh, one_block(mesh), reference, False)
    moved = (before != mesh.X).any(axis=1)
    assert moved.any() and (mesh.kind[moved] == CURVE).all()
    assert np.array_equal(mesh.X[still], before[still])


def test_pinned_neighbours_count_where_they_lie():
    mesh, reference = curved("annulus")
    mesh.kind[np.flatnonzero(mesh.kind == CURVE)[::3]] = PINNED
    expected = slid(mesh, reference)
    slide_vertices(mesh, one_block(mesh), reference, False)
    assert mesh.X[:, :3] == pytest.approx(expected, rel=1e-9, abs=1e-11)


def test_vertices_off_their_curve_are_taken_back_to_it():
    mesh, reference = curved("l_prism")
    on_curve = mesh.kind == CURVE
    expected = slid(mesh, reference)
    mesh.X[on_curve, 2] += 1e-13
    slide_vertices(mesh, one_block(mesh), reference, False)
    assert mesh.X[:, :3] == pytest.approx(expected, rel=1e-9, abs=1e-10)


def test_without_curves_nothing_moves():
    mesh = built(*zoo.torus())
    reference = featured(mesh, 1.0).reference
    before = mesh.X.copy()
    slide_vertices(mesh, one_block(mesh), reference, False)
    assert np.array_equal(mesh.X, before)


def test_a_vertex_of_a_curve_with_no_edges_there_stays():
    """As where its edges were frozen away: no neighbours, no step."""
    mesh, reference = curved("annulus")
    v = int(np.flatnonzero(mesh.kind == INNER)[0])
    mesh.kind[v], mesh.birth[v] = CURVE, mesh.curve[mesh.curve >= 0][0]
    project_curves(mesh, one_block(mesh), reference, False)
    before = mesh.X[v].copy()
    slide_vertices(mesh, one_block(mesh), reference, False)
    assert np.array_equal(mesh.X[v], before)


# --- sheets alike --------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", ["annulus", "grid", "cube"])
def test_the_same_bits_whichever_neighbour_comes_first(name, seed):
    """Faces start at other corners, and run the other way around."""
    mesh, reference = curved(name, seed=seed, lengths=lambda X: 1 + 0.1 * X[:, 0])
    other = mirrored(mesh)
    first = {v: first_neighbour(mesh, v) for v in np.flatnonzero(mesh.kind == CURVE)}
    turned = sum(first[v] != first_neighbour(other, v) for v in first)
    assert turned > 0, "the neighbours never swapped"
    for one in (mesh, other):
        slide_vertices(one, one_block(one), reference, False)
    assert np.array_equal(mesh.X, other.X) and np.array_equal(mesh.birth, other.birth)


def mirrored(mesh):
    """The same surface seen from the other side: vertices and curves are the same."""
    F = mesh.origin.reshape(-1, 3)[:, ::-1]
    other = built(mesh.X[:, :3], F)
    curves = curve_edges(mesh)
    for h in range(len(other.origin)):
        edge = frozenset((int(other.origin[h]), int(other.origin[next_of(h)])))
        other.curve[h] = curves.get(edge, NONE)
    other.kind[:], other.birth[:], other.X[:] = mesh.kind, mesh.birth, mesh.X
    return other


def first_neighbour(mesh, v):
    """Where the first edge of a curve leads that a walk around a vertex meets."""
    h = int(mesh.vertex_halfedge[v])
    while mesh.curve[h] == NONE:
        h = int(mesh.twin[h - h % 3 + (h + 2) % 3])
    return int(mesh.origin[next_of(h)])


@pytest.mark.parametrize("name", nonmanifold.COMPLEXES)
def test_sheets_stay_together(name):
    """Seams are in the same places after any number of steps, bit for bit."""
    known = nonmanifold.COMPLEXES[name]
    mesh, source = cut_open(*known.make())
    reference = featured(
        mesh, 0.15 * known.size, vertex_source=source, feature_angle=40.0
    ).reference
    shaken(mesh, reference, 0.05 * known.size)
    copies = places(mesh)
    before = mesh.X[mesh.kind == CURVE].copy()
    for _ in range(4):
        slide_vertices(mesh, one_block(mesh), reference, False)
        relax_vertices(mesh, one_block(mesh), 0.0, False)
        assert places(mesh) == copies
    assert len(before) and not np.allclose(mesh.X[mesh.kind == CURVE], before, atol=1e-4)
    assert_on_reference(mesh, reference)


def places(mesh):
    """Which ends of seams lie in the same place, as sets of vertices."""
    h = np.flatnonzero(mesh.curve >= NON_MANIFOLD)
    ends = np.unique(mesh.origin[np.concatenate([h, [next_of(g) for g in h.tolist()]])])
    at = {}
    for v in ends.tolist():
        at.setdefault(mesh.X[v, :3].tobytes(), set()).add(v)
    return {frozenset(group) for group in at.values()}


# --- many steps ----------------------------------------------------------------------------------


def settled(mesh, reference, steps=600):
    for _ in range(steps):
        slide_vertices(mesh, one_block(mesh), reference, False)
    return mesh.X[:, :3]


def test_edges_settle_at_their_lengths_between_corners():
    """Straight boundary: edges in the ratio of the mean lengths at their ends."""
    V, F = zoo.grid(9, 3)
    mesh = built(V, F)
    reference = featured(mesh, 1.0).reference
    mesh.X[:, 3] = 1 + V[:, 0]
    bottom = np.flatnonzero(V[:, 1] == 0)
    assert (mesh.kind[bottom[1:-1]] == CURVE).all() and (mesh.kind[bottom[[0, -1]]] == FIXED).all()
    X = settled(mesh, reference)
    wanted = mesh.X[bottom[1:], 3] + mesh.X[bottom[:-1], 3]
    assert np.diff(X[bottom, 0]) / 8 == pytest.approx(wanted / wanted.sum(), rel=1e-6)
    assert not X[bottom, 1].any()


@pytest.mark.parametrize("n", [3, 4, 7])
def test_few_vertices_share_a_small_hole_evenly(n):
    """Chords would pull them to one side: between two vertices of three, the third goes along a line."""
    fine = zoo.turn(60)
    V = np.column_stack([np.cos(fine), np.sin(fine), 0 * fine])
    inside = built(np.vstack([V, [[0, 0, 0]]]), zoo.fan(np.arange(60), 60))
    reference = featured(inside, 0.3).reference
    assert not (inside.kind == FIXED).any()
    at = np.sort(np.random.default_rng(n).choice(60, n, replace=False))
    mesh = built(np.vstack([V[at], [[0, 0, 0]]]), zoo.fan(np.arange(n), n))
    names = inside.curve[inside.twin == NONE]
    of = {int(inside.origin[h]): int(h) for h in names}
    mesh.birth[:n] = [of[int(v)] for v in at]
    mesh.curve[mesh.curve != NONE] = names[0]
    X = settled(mesh, reference)
    turns = np.diff(np.unwrap(np.arctan2(X[:n, 1], X[:n, 0])))
    assert turns == pytest.approx(2 * np.pi / n, abs=0.06)  # arcs of a polygon of 60
    radius = np.linalg.norm(X[:n], axis=1)
    assert radius.max() <= 1 + 1e-12 and radius.min() > np.cos(np.pi / 60) - 1e-12


def test_one_vertex_between_two_corners_goes_to_the_middle():
    V = np.array([[0, 0, 0], [0.2, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0]], float)
    mesh = built(V, [[0, 1, 4], [1, 3, 4], [1, 2, 3]])
    reference = featured(mesh, 0.5).reference
    assert mesh.kind.tolist() == [FIXED, CURVE, FIXED, FIXED, FIXED]
    assert settled(mesh, reference)[1] == pytest.approx([1.5, 0, 0])


def test_places_do_not_matter():
    """The same curve turned and moved: the same steps."""
    mesh, reference = curved("annulus")
    V = zoo.rotate(mesh.X[:, :3])
    slide_vertices(mesh, one_block(mesh), reference, False)
    other, far = curved("annulus")
    turned = far._replace(X=np.column_stack([zoo.rotate(far.X[:, :3]), far.X[:, 3]]))
    other.X[:, :3] = V
    slide_vertices(other, one_block(other), turned, False)
    assert other.X[:, :3] == pytest.approx(zoo.rotate(mesh.X[:, :3]), abs=1e-12)
    assert naive.boundary_edges(other.origin.reshape(-1, 3))
