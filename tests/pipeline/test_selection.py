"""Remeshing of a part: the rest comes first, untouched, and the seam fits."""

import numpy as np
import pytest
from helpers import zoo
from helpers.complexes import curves_of, shape
from helpers.invariants import assert_clean
from helpers.measures import (
    NEAR,
    ON,
    all_edges,
    bits,
    boundary_edges,
    closest_on,
    diagonal,
    edge_lengths,
    edge_places,
    face_areas,
    face_places,
    label_borders,
    lengths_of,
    nearest,
    sorted_edges,
    to_segments,
    to_surface,
    unit_normals,
)

from data.shapes.solids import triangulated
from remeshvec import remesh


def assert_rest_untouched(result, V, F, selected):
    """Unselected faces lead, in order, to the last bit; `face_map` and `vertex_map` name them."""
    rest = np.flatnonzero(~selected)
    assert face_places(result.V, result.F[: len(rest)]) == face_places(V, F[rest])
    assert np.array_equal(result.face_map[rest], np.arange(len(rest)))
    assert (result.face_map[selected] == -1).all()
    used = np.unique(F[rest])
    where = result.vertex_map[used]
    assert (where >= 0).all() and len(np.unique(where)) == len(used)
    assert bits(result.V[where]) == bits(V[used])
    assert set(where.tolist()) <= set(result.corners.tolist())


def new_part(result, selected):
    return result.F[np.count_nonzero(~selected) :]


def inner_edges(result, selected):
    """Lengths of the edges of the new part that have no vertex on the seam."""
    F = new_part(result, selected)
    free = np.setdiff1d(F, result.F[: np.count_nonzero(~selected)])
    return edge_lengths(result.V, F[np.isin(F, free).all(axis=1)])


def middles(V, F):
    return V[F].mean(axis=1)


PARTS = {
    "half a sphere": lambda: select(*zoo.icosphere(3), lambda P: P[:, 2] > 0),
    "two caps": lambda: select(*zoo.icosphere(3), lambda P: np.abs(P[:, 2]) > 0.6),
    "all but a cap": lambda: select(*zoo.icosphere(3), lambda P: P[:, 2] < 0.6),
    "a corner of a cube": lambda: select(*triangulated("cube", "even"), lambda P: P.sum(1) < 1.2),
    "a facet of a cube": lambda: select(*triangulated("cube", "shaken"), lambda P: P[:, 2] > 0.999),
    "inside a plane": lambda: select(
        *zoo.grid(21, 17), lambda P: (np.abs(P - [10, 8, 0]) < 6).all(axis=1)
    ),
    "at a rim": lambda: select(*zoo.grid(21, 17), lambda P: P[:, 0] < 9),
    "half a tube": lambda: select(*zoo.cylinder(40, 13), lambda P: P[:, 2] > 0.9),
}


def select(V, F, condition):
    return V, F, condition(middles(V, F))


@pytest.mark.parametrize("factor", [0.45, 1.0, 1.8])
@pytest.mark.parametrize("name", PARTS)
def test_only_the_selection_changes(name, factor):
    V, F, selected = PARTS[name]()
    assert 0 < selected.sum() < len(F)
    L = factor * zoo.mean_edge(V, F)
    result = remesh(V, F, L, selection=selected)
    assert_clean(*result)
    assert_rest_untouched(result, V, F, selected)
    # The seam fits: nothing is open that was closed, and no face lies twice.
    assert shape(result.F) == shape(F)
    size = diagonal(V)
    assert to_surface(result.V, V, F).max() < NEAR * size
    if factor != 1:  # coarse edges beside a fine seam: parts are only a few edges wide
        mean = inner_edges(result, selected).mean()
        assert mean == pytest.approx(L, rel=0.2 if factor < 1 else 0.35)
    if "plane" in name or "rim" in name:
        assert zoo.area(*result) == pytest.approx(zoo.area(V, F), rel=ON)
        assert (unit_normals(*result)[:, 2] > 0.5).all()
    if "cube" in name:
        assert zoo.volume(*result) == pytest.approx(1, rel=1e-6)


def test_a_rim_outside_the_selection_stays():
    V, F, selected = PARTS["at a rim"]()
    result = remesh(V, F, 0.4, selection=selected)
    outside = boundary_edges(F)[(V[boundary_edges(F)][:, :, 0] >= 9).all(axis=1)]
    places = edge_places(result.V, boundary_edges(result.F))
    assert edge_places(V, outside) <= places
    new = boundary_edges(result.F)
    left = (result.V[new][:, :, 0] <= 9).all(axis=1)
    # Between corners 1 apart there is room for two edges or three.
    assert lengths_of(result.V, new[left]).mean() == pytest.approx(0.4, rel=0.3)


@pytest.mark.parametrize("move", [(1.0, 1e6 + 0.1), (1e-7 / 3, 0.0), (7e5, -0.3)])
def test_the_rest_is_exact_in_any_unit(move):
    V, F, selected = PARTS["half a sphere"]()
    W = V * move[0] + move[1]
    result = remesh(W, F, 0.1 * move[0], selection=selected)
    assert_rest_untouched(result, W, F, selected)
    assert shape(result.F) == shape(F)


def test_the_rest_is_exact_in_float32():
    V, F, selected = PARTS["half a tube"]()
    V = (0.37 * V + 3.3).astype(np.float32)
    result = remesh(V, F, 0.06, selection=selected)
    assert result.V.dtype == np.float32
    assert_rest_untouched(result, V, F, selected)


def test_by_number_or_mask():
    V, F, selected = PARTS["two caps"]()
    one = remesh(V, F, 0.1, selection=selected)
    for form in (np.flatnonzero(selected), np.flatnonzero(selected)[::-1].tolist()):
        two = remesh(V, F, 0.1, selection=form)
        assert np.array_equal(one.V, two.V) and np.array_equal(one.F, two.F)
        assert np.array_equal(one.face_map, two.face_map)


@pytest.mark.parametrize("form", ["mask", "numbers"])
@pytest.mark.parametrize("name", ["icosphere", "grid", "cube", "tetrahedron"])
def test_an_empty_selection_changes_nothing(name, form):
    V, F = zoo.ZOO[name].make()
    empty = np.zeros(len(F), bool) if form == "mask" else np.zeros(0, np.int64)
    result = remesh(V, F, 0.1 * diagonal(V), selection=empty)
    assert_rest_untouched(result, V, F, np.zeros(len(F), bool))
    assert len(result.F) == len(F) and len(result.V) == len(V)


def test_everything_selected_is_no_selection():
    V, F = zoo.perturb(*zoo.icosphere(2), amount=0.05)
    one, two = remesh(V, F, 0.2), remesh(V, F, 0.2, selection=np.ones(len(F), bool))
    assert len(two.F) == pytest.approx(len(one.F), rel=0.05)
    assert shape(two.F) == shape(F)
    assert (two.face_map == -1).all()


@pytest.mark.parametrize("count", [1, 2, 40])
def test_single_faces(count):
    """All their edges are seams, or nearly all; what is split lies inside."""
    V, F = zoo.icosphere(2)
    selected = np.zeros(len(F), bool)
    selected[np.random.default_rng(count).choice(len(F), count, replace=False)] = True
    for L in (0.05, 0.3, 2.0):
        result = remesh(V, F, L, selection=selected)
        assert_rest_untouched(result, V, F, selected)
        assert shape(result.F) == shape(F)


def test_a_second_selection_continues_the_first():
    """Numbers of the first result are good for the next call."""
    V, F = zoo.icosphere(3)
    first = remesh(V, F, 0.08, selection=middles(V, F)[:, 2] > 0.3)
    low = middles(first.V, first.F)[:, 2] < -0.3
    second = remesh(first.V, first.F, 0.08, selection=low)
    assert_rest_untouched(second, first.V, first.F, low)
    assert shape(second.F) == shape(F)


# --- together with everything else ---------------------------------------------------------------


@pytest.mark.parametrize("mode", ["free", "split", "fixed"])
def test_everything_at_once(mode):
    """Labels, a selection, fixed vertices and faces, a drawn line, a boundary mode, varying lengths."""
    V, F = zoo.grid(31, 21)
    V = V / 10
    P = middles(V, F)
    labels = np.where(P[:, 1] < 1, 3, 8)
    selected = P[:, 0] < 2
    L = 0.05 + 0.05 * V[:, 0]
    points = np.flatnonzero((np.abs(V - [0.7, 1.5, 0]) < 0.15).all(axis=1))
    line = np.flatnonzero((np.abs(V[:, 0] - 1.3) < 1e-9) & (V[:, 1] > 1.15))
    held = np.flatnonzero((np.abs(P - [0.5, 0.5, 0]) < 0.2).all(axis=1))
    result = remesh(
        V, F, L, selection=selected, face_labels=labels, fixed_vertices=points,
        feature_edges=np.stack([line[:-1], line[1:]], axis=1), fixed_faces=held, boundary=mode,
        feature_angle=None,
    )  # fmt: skip
    V2, F2 = result
    assert_clean(V2, F2)
    assert shape(F2) == shape(F)
    rest = np.flatnonzero(~selected)
    assert face_places(V2, F2[: len(rest)]) == face_places(V, F[rest])
    assert np.array_equal(result.face_map[rest], np.arange(len(rest)))
    assert face_places(V2, F2[result.face_map[held]]) == face_places(V, F[held])
    others = np.setdiff1d(np.flatnonzero(selected), held)
    assert (result.face_map[others] == -1).all()
    assert bits(V2[result.vertex_map[points]]) == bits(V[points])
    assert_labels_and_line(result, V, F, labels, line)
    assert_rim(result, V, F, mode)
    # Away from what is held, lengths are those asked for.
    edges = all_edges(F2[len(rest) :])
    at = V2[edges].mean(axis=1)
    free = (at[:, 0] > 0.9) & (at[:, 0] < 1.8)
    ratio = lengths_of(V2, edges[free]) / (0.05 + 0.05 * at[free, 0])
    assert ratio.mean() == pytest.approx(1, abs=0.2)


def assert_labels_and_line(result, V, F, labels, line):
    V2, F2, found = result.V, result.F, np.asarray(result.face_labels)
    assert np.array_equal(found, labels[closest_on(middles(V2, F2), V, F)[1]])
    for value in (3, 8):
        area = face_areas(V2, F2)[found == value].sum()
        assert area == pytest.approx(face_areas(V, F)[labels == value].sum(), rel=ON)
    edges = sorted_edges(result.feature_edges)
    drawn = V2[edges]
    size = diagonal(V)
    ends = V[[line[0], line[-1]]]
    assert to_segments(np.linspace(*ends, 50), drawn).max() < ON * size
    borders = label_borders(F2, found)
    assert {tuple(edge) for edge in borders.tolist()} <= {tuple(edge) for edge in edges.tolist()}
    away, _ = nearest(ends[:1], V2[result.corners])
    assert away.max() < ON * size
    assert len(curves_of(borders).curves) == 1, "the border of the labels is one line"


def assert_rim(result, V, F, mode):
    rim, given = boundary_edges(result.F), boundary_edges(F)
    assert to_segments(result.V[rim.ravel()], V[given]).max() < ON * diagonal(V)
    assert zoo.area(*result) == pytest.approx(zoo.area(V, F), rel=ON)
    if mode == "fixed":
        assert edge_places(result.V, rim) == edge_places(V, given)
    if mode == "split":
        assert bits(result.V[result.vertex_map[np.unique(given)]]) == bits(V[np.unique(given)])
