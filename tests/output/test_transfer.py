"""Data of the input on the result: exact where it can be, each corner on its own side, and back."""

import copy
import pickle

import numpy as np
import pytest
from helpers import zoo

from data.shapes import textured
from remeshvec import OptionError, remesh
from remeshvec.output.transfer import interpolate

RNG = np.random.default_rng(5)
LINEAR = RNG.normal(size=(3, 4))


def signed_areas(uv):
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def edges_mean(V, F):
    return np.linalg.norm(V[F] - V[np.roll(F, 1, axis=1)], axis=2).mean()


# --- vertices, faces, the matrix -------------------------------------------------------------


@pytest.mark.parametrize("preset", ["default", "fast", "fine"])
@pytest.mark.parametrize("name", ["grid", "annulus", "planar_delaunay", "cube", "l_prism"])
def test_linear_functions_stay_linear_on_flat_parts(name, preset):
    V, F = zoo.ZOO[name].make()
    result = remesh(V, F, 0.6 * edges_mean(V, F), preset=preset)
    assert np.allclose(result.transfer(V @ LINEAR), result.V @ LINEAR, rtol=0, atol=1e-12)
    corners = result.transfer((V @ LINEAR)[F], on="corners")
    assert np.allclose(corners, (result.V @ LINEAR)[result.F], rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", zoo.TIDY)
def test_positions_carry_over_where_vertices_lie_on_the_input(name):
    V, F = zoo.ZOO[name].make()
    result = remesh(V, F, 0.8 * edges_mean(V, F))
    assert np.allclose(result.transfer(V), result.V, rtol=0, atol=1e-12)
    assert np.allclose(result.transfer(V[F], on="corners"), result.V[result.F], rtol=0, atol=1e-12)


@pytest.mark.parametrize("on", ["vertices", "faces", "corners"])
@pytest.mark.parametrize("name", ["torus", "three_half_discs", "inconsistent_winding", "bowtie"])
def test_the_matrix_does_what_transfer_does(name, on):
    V, F = zoo.ZOO[name].make()
    result = remesh(V, F, 0.4 * edges_mean(V, F))
    sizes = {"vertices": (len(V),), "faces": (len(F),), "corners": (3 * len(F),)}
    x = RNG.normal(size=(*sizes[on], 2))
    P = result.matrix(on)
    assert P.shape == (len(result.transfer(x, on=on)), len(x))
    assert np.allclose(P @ x, result.transfer(x, on=on), rtol=0, atol=1e-13)
    assert np.allclose(P.sum(axis=1), 1.0, rtol=0, atol=1e-13)
    assert P.data.min() >= -1e-12


@pytest.mark.parametrize("dtype", ["f4", "f8", "c16", "u1", "i2", "i8", "?", "U3"])
def test_types_and_shapes_come_back(dtype):
    V, F = zoo.grid()
    result = remesh(V, F, 0.5)
    values = (RNG.random((len(V), 2, 3)) * 100).astype(dtype)
    out = result.transfer(values)
    assert out.dtype == values.dtype and out.shape == (len(result.V), 2, 3)
    if values.dtype.kind in "iubU":
        assert np.isin(out, values).all()
    assert result.transfer(values[:, 0, 0]).shape == (len(result.V),)
    assert result.transfer(values[0, 0, 0].repeat(len(F)), on="faces").shape == (len(result.F),)


def test_whole_numbers_are_rounded_when_they_are_colours():
    V, F = zoo.grid()
    result = remesh(V, F, 0.37)
    colours = np.rint(255 * (V - V.min(0)) / max(np.ptp(V), 1)).astype(np.uint8)
    smooth = result.transfer(colours.astype(float))
    assert np.array_equal(result.transfer(colours, method="linear"), np.rint(smooth))
    nearest = result.transfer(colours)
    assert (nearest != np.rint(smooth)).any()
    at = result.report.before[1][result.birth_face]
    best = at[np.arange(len(at)), result.birth_barycentric.argmax(axis=1)]
    assert np.array_equal(nearest, colours[best])


def test_a_corner_without_weight_does_not_count():
    values = np.array([1.0, np.nan, 3.0])
    weights = np.array([[0.5, 0.0, 0.5], [0.0, 1.0, 0.0]])
    out = interpolate(values, np.array([[0, 1, 2], [0, 1, 2]]), weights, "auto")
    assert out[0] == 2.0 and np.isnan(out[1])
    wide = interpolate(np.array([250, 255, 255], np.uint8), np.array([[0, 1, 2]]),
                       np.array([[-0.5, 0.75, 0.75]]), "linear")  # fmt: skip
    assert wide.tolist() == [255]


def test_faces_take_the_value_below_their_middle():
    V, F = zoo.planar_delaunay()
    result = remesh(V, F, 0.05)
    middle = result.V[result.F].mean(axis=1)
    a, b, c = V[F[result.face_birth]].transpose(1, 0, 2)
    for p, q in ((a, b), (b, c), (c, a)):
        cross = np.cross(q - p, middle - p)[:, 2]
        assert (cross > -1e-12).all()


def test_labels_have_straight_borders():
    V, F = five_by_five()
    labels = (V[F].mean(axis=1)[:, 0] > V[:, 0].mean()).astype(int)
    straight = remesh(V, F, 0.07, preserve=labels)
    out = straight.transfer(labels, on="faces")
    middle = straight.V[straight.F].mean(axis=1)
    border = V[F[labels == 1], 0].min()
    assert np.array_equal(out == 1, middle[:, 0] > border)
    assert (straight.V[straight.F[out == 1], 0] >= border - 1e-12).all()
    assert (straight.V[straight.F[out == 0], 0] <= border + 1e-12).all()


# --- corners and seams -----------------------------------------------------------------------


@pytest.mark.parametrize("split", [False, True])
@pytest.mark.parametrize("factor", [0.4, 1.0, 2.0])
@pytest.mark.parametrize("shape", [textured.cube, textured.cylinder, textured.torus])
def test_no_face_mixes_charts(shape, factor, split):
    """Every face keeps its turn in the texture, none is long there, and the charts stay covered."""
    V, F, uv = shape()
    A, B = textured.split_at_seams(V, F, uv)[:2] if split else (V, F)
    L = factor * edges_mean(V, F)
    for options in ({}, {"preset": "fast", "project": False}, {"preset": "fine"}):
        result = remesh(A, B, L, preserve=uv, **options)
        out = result.transfer(uv, on="corners")
        area, known = signed_areas(out), signed_areas(uv)
        assert (np.sign(area) == np.sign(known[result.face_birth])).all()
        assert np.isclose(abs(area).sum(), abs(known).sum(), rtol=1e-9)
        stretch = np.ptp(uv, axis=1).max() / edges_mean(V, F)
        assert np.ptp(out, axis=1).max() < 3.0 * max(L, edges_mean(V, F)) * stretch


@pytest.mark.parametrize("name", [n for n in zoo.ZOO if n not in ("triangle", "repeated_index")])
@pytest.mark.parametrize(
    "options",
    [{}, {"preset": "fast", "project": False}, {"boundary": "fixed"}, {"fixed_faces": [0, 3]}],
    ids=["default", "drifting", "fixed", "held"],
)
def test_charts_stay_apart_on_every_shape(name, options):
    """Charts of all shapes, with sheets, holes and held faces: corners are on the side of their face."""
    V, F = zoo.ZOO[name].make()
    middle = V[F].mean(axis=1)
    seeds = middle[np.random.default_rng(1).choice(len(F), min(5, len(F)), replace=False)]
    chart = ((middle[:, None] - seeds) ** 2).sum(axis=2).argmin(axis=1)
    options = {
        k: np.minimum(v, len(F) - 1) if k == "fixed_faces" else v for k, v in options.items()
    }
    values = np.repeat(chart[:, None], 3, axis=1).astype(float)
    for factor in (0.5, 1.5):
        result = remesh(V, F, factor * edges_mean(V, F), preserve=values, **options)
        out = result.transfer(values, on="corners")
        assert np.allclose(out, out.round(), atol=1e-9) and np.ptp(out.round(), axis=1).max() == 0
        assert np.array_equal(out[:, 0].round().astype(int), result.transfer(chart, on="faces"))


def test_sheets_that_meet_keep_their_data():
    V, F = zoo.three_half_discs()
    middle = V[F].mean(axis=1)
    sheet = np.rint(np.arctan2(middle[:, 2], middle[:, 1]) / (2 * np.pi / 3)).astype(int)
    values = np.repeat(sheet[:, None], 3, axis=1)
    assert len(np.unique(sheet)) == 3
    for factor in (0.2, 0.4, 1.0):
        result = remesh(V, F, factor * edges_mean(V, F), feature_angle=None)
        out = result.transfer(values, on="corners")
        assert np.array_equal(out.min(axis=1), out.max(axis=1))
        assert np.array_equal(out[:, 0], result.transfer(sheet, on="faces"))


def test_cuts_that_leave_a_vertex_close_together():
    """One chart around a vertex with three curved cuts, 12 degrees apart: directions alone mislead."""
    V, F, values, sector = textured.star()
    for L in (0.08, 0.15, 0.25):
        result = remesh(V, F, L, preserve=values, feature_angle=None)
        out = result.transfer(values, on="corners")
        at_centre = np.linalg.norm(result.V[result.F], axis=2) < 1e-9
        faces = np.flatnonzero(at_centre.any(axis=1))
        assert len(faces) >= 3
        middle = result.V[result.F[faces]].mean(axis=1)
        assert np.allclose(out[at_centre], sector(middle), atol=1e-9)


def test_held_faces_keep_the_data_of_their_corners():
    """Even such as jump everywhere: every corner finds its own."""
    V, F = zoo.icosphere(3)
    values = np.random.default_rng(2).normal(size=(len(F), 3, 2))
    held = np.flatnonzero(V[F].mean(axis=1)[:, 2] > 0.2)
    result = remesh(V, F, 0.2, fixed_faces=held)
    now = result.face_map[held]
    out = result.transfer(values, on="corners")
    for k in range(3):
        turned = np.roll(out[now], k, axis=1)
        same = (result.V[np.roll(result.F[now], k, axis=1)] == V[F[held]]).all(axis=(1, 2))
        assert np.allclose(turned[same], values[held[same]], atol=1e-12)
        assert same.any() or k
    assert np.array_equal(result.face_birth[now], held)


@pytest.mark.parametrize("seed", [0, 1, 3, 7])
def test_rough_surfaces_keep_their_sides(seed):
    V, F, uv = textured.torus()
    V = V + np.random.default_rng(seed).normal(size=V.shape) * 0.105
    for factor in (0.4, 0.9):
        result = remesh(V, F, factor * 0.3, preserve=uv)
        out = result.transfer(uv, on="corners")
        assert np.ptp(out, axis=1).max() < 0.25
        assert np.isclose(signed_areas(out).sum(), 1.0)


def test_a_seam_may_end_inside():
    V, F, values = textured.slit()
    result = remesh(V, F, 0.05, preserve=values)
    out = result.transfer(values, on="corners")
    on_cut = np.isclose(result.V[result.F][..., 1], 0.5, atol=1e-12)
    x = result.V[result.F][..., 0]
    inside = on_cut & (x > 0.34) & (x < 0.66)
    above = result.V[result.F].mean(axis=1)[:, 1] > 0.5
    jump = out[..., 1] - result.V[result.F][..., 1]
    assert inside.any() and np.allclose(jump[inside & above[:, None]], 0.01)
    assert np.allclose(jump[inside & ~above[:, None]], 0.0)
    assert np.allclose(out[..., 0], x)


def test_without_preserve_data_are_still_found_on_their_side_of_creases():
    V, F, uv = textured.cube()
    result = remesh(V, F, 0.3)  # the creases are the seams
    out = result.transfer(uv, on="corners")
    assert (np.sign(signed_areas(out)) == np.sign(signed_areas(uv)[result.face_birth])).all()


def test_texture_comes_back_within_a_texel():
    """Rasterise both in texture space with the position on the surface as the colour, and compare."""
    for shape, L, angle in ((textured.cube, 0.25, "auto"), (textured.cylinder, 0.2, None)):
        V, F, uv = shape()
        result = remesh(V, F, L, preserve=uv, feature_angle=angle)
        before = rasterise(uv, V[F])
        after = rasterise(result.transfer(uv, on="corners"), result.V[result.F])
        both = np.isfinite(before[..., 0]) & np.isfinite(after[..., 0])
        only_one = np.isfinite(before[..., 0]) ^ np.isfinite(after[..., 0])
        assert only_one.mean() < 0.01 and both.mean() > 0.5
        texel = np.linalg.norm(V[F][:, 1] - V[F][:, 0], axis=1).max() / (
            SIZE * np.linalg.norm(uv[:, 1] - uv[:, 0], axis=1).min()
        )
        assert np.linalg.norm(before - after, axis=2)[both].max() < texel


SIZE = 256


def rasterise(uv, colour):
    """Image (SIZE, SIZE, 3) of a colour at the corners of faces; NaN where there is no face."""
    image = np.full((SIZE, SIZE, 3), np.nan)
    for t, c in zip(uv * SIZE, colour, strict=True):
        low, high = np.floor(t.min(0)).astype(int), np.ceil(t.max(0)).astype(int) + 1
        i, j = np.meshgrid(*(np.arange(a, min(b, SIZE)) for a, b in zip(low, high, strict=True)))
        p = np.stack([i.ravel() + 0.5, j.ravel() + 0.5], axis=1)
        M = np.column_stack([t[1] - t[0], t[2] - t[0]])
        if abs(np.linalg.det(M)) < 1e-12:
            continue
        st = (p - t[0]) @ np.linalg.inv(M).T
        w = np.column_stack([1 - st.sum(axis=1), st])
        hit = (w >= -1e-9).all(axis=1)
        image[j.ravel()[hit], i.ravel()[hit]] = w[hit] @ c
    return image


def test_preserve_takes_several_arrays_and_near_equals():
    V, F, uv = textured.cylinder()
    noisy = uv + RNG.normal(size=uv.shape) * 1e-8  # as single precision computes them
    labels = (V[F].mean(axis=1)[:, 2] > 1.5).astype(int)
    plain = remesh(V, F, 0.4, preserve=uv, feature_angle=None)
    assert np.array_equal(plain.V, remesh(V, F, 0.4, preserve=noisy, feature_angle=None).V)
    both = remesh(V, F, 0.4, preserve=[uv, labels], feature_angle=None)
    assert len(both.feature_edges) > len(plain.feature_edges)
    as_complex = remesh(V, F, 0.4, preserve=uv @ [1, 1j], feature_angle=None)
    assert np.array_equal(as_complex.V, plain.V)
    named = remesh(V, F, 0.4, preserve=[uv, np.array(["low", "high"])[labels]], feature_angle=None)
    assert np.array_equal(both.V, named.V)
    bool_labels = remesh(V, F, 0.4, preserve=(uv, labels == 1), feature_angle=None)
    assert np.array_equal(both.V, bool_labels.V)


# --- back, and errors ------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*zoo.TIDY, "three_half_discs", "unreferenced_vertices"])
def test_the_way_back(name):
    V, F = zoo.upsampled(*zoo.ZOO[name].make()) if name in zoo.TIDY else zoo.ZOO[name].make()
    L = 0.5 * edges_mean(V, F)
    result = remesh(V, F, L, preset="fast")
    used = np.unique(F)
    back = result.transfer_back(result.V)
    assert back.shape == V.shape
    import igl

    _, _, closest = igl.point_mesh_squared_distance(V[used], result.V, result.F.astype(np.int64))
    ours = np.linalg.norm(back[used] - V[used], axis=1)
    assert np.allclose(ours, np.linalg.norm(closest - V[used], axis=1), atol=0.3 * L)
    B = result.back_matrix()
    assert np.allclose((B @ result.V)[used], back[used], atol=1e-12)
    sums = np.asarray(B.sum(axis=1)).ravel()
    assert np.allclose(sums[used], 1.0)
    unused = np.setdiff1d(np.arange(len(V)), used)
    assert (sums[unused] == 0).all() and np.isnan(back[unused]).all()
    assert (result.image_face[unused] == -1).all()
    faces = result.transfer_back(np.arange(len(result.F)), on="faces")
    assert np.array_equal(faces[used], result.image_face[used])


def test_there_and_back_again():
    V, F = zoo.upsampled(*zoo.torus())
    result = remesh(V, F, 0.5 * edges_mean(V, F))
    smooth = np.sin(V[:, 0]) + V[:, 2] ** 2
    assert abs(result.transfer_back(result.transfer(smooth)) - smooth).max() < 0.025


def test_copies_and_pickles_know_all_of_it():
    V, F, uv = textured.torus()
    result = remesh(V, F, 0.4, preserve=uv)
    others = [copy.deepcopy(result), pickle.loads(pickle.dumps(result))]
    x = RNG.normal(size=len(F))
    for other in others:
        assert np.array_equal(other.transfer(x, on="faces"), result.transfer(x, on="faces"))
        assert np.array_equal(other.transfer(uv, on="corners"), result.transfer(uv, on="corners"))
        assert np.array_equal(other.image_barycentric, result.image_barycentric)
    again = pickle.loads(pickle.dumps(result))
    assert np.array_equal(again.transfer(uv, on="corners"), result.transfer(uv, on="corners"))


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_threads_change_nothing(threads):
    V, F = zoo.icosphere(6)
    result = remesh(V, F, preset="fast", iterations=1, threads=threads)
    one = remesh(V, F, preset="fast", iterations=1, threads=1)
    assert len(result.F) > 50_000
    assert np.array_equal(result.face_birth, one.face_birth)
    assert np.array_equal(result.image_barycentric, one.image_barycentric)
    assert np.array_equal(result.corner_birth_face, one.corner_birth_face)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: r.transfer(np.zeros(3)), r"vertices must have shape \(\d+, \.\.\.\)"),
        (lambda r: r.transfer(np.zeros((5, 3)), on="corners"), "corners must have shape"),
        (lambda r: r.transfer(np.zeros(3), on="edges"), "vertices, faces, corners; got 'edges'"),
        (lambda r: r.transfer(r.transfer_back(r.V), method="cubic"), "method must be one of"),
        (lambda r: r.transfer(np.array(["a"] * 25), method="linear"), "cannot be added up"),
        (lambda r: r.matrix("edges"), "on must be one of"),
        (
            lambda r: r.transfer_back(r.V, on="corners"),
            "on must be one of vertices, faces; got 'corners'",
        ),
        (lambda r: r.transfer_back(np.zeros(2)), "vertices must have shape"),
    ],
)
def test_wrong_calls_are_named(call, message):
    result = remesh(*five_by_five(), 0.2)
    with pytest.raises(OptionError, match=message):
        call(result)


def five_by_five():
    p, F, _ = textured.grid(4, 4, False, False)
    return np.column_stack([p, np.zeros(len(p))]), F


@pytest.mark.parametrize(
    ("preserve", "message"),
    [
        (np.zeros(5), r"preserve must hold one entry a corner, shape \(32, 3, \.\.\.\)"),
        ([np.zeros(32), np.zeros((32, 2))], r"preserve\[1\] must hold"),
        (np.full((32, 3), np.nan), "NaN"),
        ("uv", "preserve"),
    ],
)
def test_wrong_data_to_preserve_are_named(preserve, message):
    with pytest.raises(OptionError, match=message):
        remesh(*five_by_five(), 0.2, preserve=preserve)


@pytest.mark.parametrize(
    ("name", "seeds"), [("planar_delaunay", [0, 6, 20, 32]), ("thin_sheet", [11])]
)
def test_births_are_found_where_walks_get_stuck(name, seeds):
    """Vertices that were put back, because faces would have folded, lie where a walk may not end."""
    V, F = zoo.ZOO[name].make()
    for seed in seeds:
        A, B = zoo.upsampled(V, F, noise=0.1, seed=seed)
        result = remesh(A, B, 1.5 * edges_mean(A, B))
        import igl

        points = np.ascontiguousarray(result.V)
        on_input = igl.point_mesh_squared_distance(points, A, B)[0] < 1e-24
        off = np.linalg.norm(result.transfer(A) - result.V, axis=1)
        assert on_input.mean() > 0.98
        assert off[on_input].max() < 1e-9
