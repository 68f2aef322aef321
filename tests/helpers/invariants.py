"""What must hold after a remeshing, as assertions on bare arrays: they are tried on inputs too."""

from __future__ import annotations

import numpy as np

from data.shapes.solids import Solid, bare
from helpers import zoo
from helpers.complexes import (
    curves_of,
    junctions_of,
    patch_euler_numbers,
    patches,
    renumbered,
    shape,
)
from helpers.measures import (
    NEAR,
    ON,
    along,
    boundary_edges,
    closest_on,
    diagonal,
    face_areas,
    nearest,
    surface_samples,
    to_segments,
    to_surface,
    unit_normals,
)


def assert_clean(V, F) -> None:
    """Every vertex is used, no face is flat or doubled, all coordinates are finite."""
    V, F = np.asarray(V), np.asarray(F)
    assert np.isfinite(V).all()
    assert len(np.unique(F)) == len(V) and F.min() == 0 and F.max() == len(V) - 1
    found = shape(F)
    assert found["proper"] and found["duplicate faces"] == 0
    # A face a millionth of the mean is no triangle to compute with.
    areas = face_areas(V, F)
    assert areas.min() > 1e-6 * areas.mean()


def assert_corners(V, corners, size: float) -> None:
    """Every corner is a vertex but for rounding."""
    away, _ = nearest(corners, V)
    assert away.max(initial=0) <= ON * size, f"lost corners: {np.flatnonzero(away > ON * size)}"


def assert_on_surface(V, F, V_in, F_in, size: float, tolerance: float = NEAR) -> None:
    """Samples of the first surface lie on the second."""
    away = to_surface(surface_samples(V, F), V_in, F_in)
    assert away.max() <= tolerance * size


def assert_creases(V, edges, creases, size: float, tolerance: float = ON) -> None:
    """Feature edges lie on the creases, and cover them."""
    edges = np.asarray(edges)
    assert len(edges), "no feature edge"
    segments = np.asarray(V, dtype=float)[edges]
    assert to_segments(along(segments), creases).max() <= tolerance * size
    assert to_segments(along(creases, n=60), segments).max() <= tolerance * size


def assert_upright(V, F, V_in, F_in) -> None:
    """Every face has the normal of the input where it lies (for plane facets)."""
    _, face = closest_on(np.asarray(V)[F].mean(axis=1), V_in, F_in)
    cosine = (unit_normals(V, F) * unit_normals(V_in, F_in)[face]).sum(axis=1)
    # Coordinates are good to 1e-15, heights of faces are above 1e-3: normals are good to 1e-9.
    assert cosine.min() > 1 - 1e-9


def assert_solid_kept(solid: Solid, V, F, feature_edges) -> None:
    """Corners, creases, planes, volume and topology are those of the solid."""
    V_in, F_in = bare(solid)
    size = solid.diagonal
    assert_clean(V, F)
    assert shape(F) == shape(F_in)
    assert_corners(V, solid.corners, size)
    assert_on_surface(V, F, V_in, F_in, size)
    assert_upright(V, F, V_in, F_in)
    assert abs(zoo.volume(V, F) / zoo.volume(V_in, F_in) - 1) < 1e-6
    assert_creases(V, feature_edges, solid.creases, size)


def assert_same_graph(V, found, V_in, expected, size: float) -> None:
    """Two graphs of curves are the same, junction by junction, and these have not moved."""
    assert len(found.junctions) == len(expected.junctions)
    if not len(expected.junctions):
        assert found.curves == expected.curves
        return
    away, which = nearest(np.asarray(V)[found.junctions], V_in[expected.junctions])
    assert away.max() <= ON * size
    assert len(set(which.tolist())) == len(which), "two junctions at one place"
    names = dict(zip(found.junctions.tolist(), expected.junctions[which].tolist(), strict=True))
    assert renumbered(found, names) == expected.curves


def assert_same_complex(V, F, V_in, F_in) -> None:
    """The same sheets meet in the same junction curves, and nothing is open that was closed."""
    size = diagonal(V_in)
    assert_same_graph(V, junctions_of(F), V_in, junctions_of(F_in), size)
    rims = [curves_of(boundary_edges(faces)) for faces in (F, F_in)]
    assert_same_graph(V, rims[0], V_in, rims[1], size)
    assert patches(F)[0] == patches(F_in)[0]
    assert patch_euler_numbers(F) == patch_euler_numbers(F_in)
    ours, theirs = shape(F), shape(F_in)
    for name in ("euler", "components"):
        assert ours[name] == theirs[name], name
