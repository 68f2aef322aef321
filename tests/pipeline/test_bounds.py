"""Bounds that a call keeps, or says that it does not: numbers of faces, distance from the input."""

import sys
import warnings

import numpy as np
import pytest
from helpers import zoo

import remeshvec
from remeshvec import Adaptive, MeshInputError, OptionError, RemeshWarning, remesh


def needles(columns, height):
    """Flat strip of width 1, faces side by side, each as long as the strip is high."""
    x, i = np.linspace(0, 1, columns), np.arange(columns - 1)
    V = np.vstack([np.column_stack([x, 0 * x + y, 0 * x]) for y in (0, height)])
    low, high = np.column_stack([i, i + 1]), np.column_stack([i, i + 1]) + columns
    return V, np.vstack([np.c_[low, high[:, 1]], np.c_[low[:, 0], high[:, ::-1]]])


def ask(L, **options):
    return remesh(*needles(20, 1e4), L, preset="fast", **options)


L_FOR_2000 = (1e4 / 2000 / (np.sqrt(3) / 4)) ** 0.5


def test_needles_stop_at_max_faces():
    """The area needs 2,000 faces; the edges need many more."""
    try:
        result = ask(L_FOR_2000, max_faces=3000)
    except OptionError as error:
        assert "max_faces = 3,000" in str(error)
        assert "raise L or max_faces" in str(error)
    else:
        assert len(result.F) <= 3000


def test_splits_stop_on_the_way(monkeypatch):
    """Before memory is full: with the sweep, and how many faces there would be."""
    job = sys.modules["remeshvec.pipeline.job"]
    monkeypatch.setattr(job, "_ON_THE_WAY", 1)
    monkeypatch.setattr(job, "_ON_THE_WAY_LARGE", 1.0)
    with pytest.raises(OptionError, match=r"sweep 1 would split [\d,]+ faces .* max_faces = 2,500"):
        ask(L_FOR_2000, max_faces=2500)


def test_a_result_above_max_faces_is_refused():
    V, F = zoo.icosphere(2)
    with pytest.raises(OptionError, match=r"gave 320 faces, more than max_faces = 300"):
        remesh(V, F, 10.0, fixed_faces=np.arange(len(F)), max_faces=300)


@pytest.mark.parametrize("allowed", [10, 10**5, 10**7, 10**9])
def test_faces_on_the_way(allowed):
    most = sys.modules["remeshvec.pipeline.job"]._most_faces
    assert min(allowed, 357_913_941) <= most(allowed) <= 32 * allowed
    assert most(10**6) == 10**7 and most(10**8) == 125_000_000


def test_meshes_whose_half_edges_have_no_numbers_are_refused(monkeypatch):
    monkeypatch.setattr(sys.modules["remeshvec.pipeline.arrays"], "LARGEST_MESH", 19)
    with pytest.raises(MeshInputError, match=r"20 faces; at most 57 and 19 fit .* cut the mesh"):
        remesh(*zoo.icosahedron(), max_faces=19)
    monkeypatch.setattr(sys.modules["remeshvec.pipeline.arrays"], "LARGEST_MESH", 1000)
    assert len(remesh(*zoo.icosahedron(), max_faces=1000).F)


def test_splits_that_would_leave_no_numbers_are_refused(monkeypatch):
    monkeypatch.setattr(sys.modules["remeshvec.pipeline.job"], "LARGEST_MESH", 1000)
    with pytest.raises(OptionError, match="sweep 1 would split"):
        remesh(*zoo.icosphere(2), 0.05)


def measured(monkeypatch, to_input, from_input):
    found = {"to_input": to_input, "from_input": from_input}
    job = sys.modules["remeshvec.pipeline.job"]
    monkeypatch.setattr(job, "deviation_of", lambda *_: found)


def test_a_deviation_that_is_not_met_is_a_warning(monkeypatch):
    measured(monkeypatch, 0.03, 0.001)
    with pytest.warns(RemeshWarning, match=r"max_deviation = 0.02 is not met.*0.03 from") as seen:
        result = remesh(*zoo.icosphere(2), 0.3, max_deviation=0.02)
    assert seen[0].filename == __file__
    assert result.report.stop == (
        "all sweeps done; max_deviation = 0.02 is not met: the largest distance is 0.03 from the "
        "result to the input"
    )


def test_a_tolerance_that_is_exceeded_is_said(monkeypatch):
    measured(monkeypatch, 0.03, 0.05)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = remesh(*zoo.icosphere(2), Adaptive(0.02))
    assert "the tolerance of L = 0.02 is exceeded" in result.report.stop
    assert "0.03 from the result to the input and 0.05 from the input" in result.report.stop


def test_a_deviation_that_is_met_says_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = remesh(*zoo.icosphere(2), 0.3, max_deviation=0.05)
    assert result.report.stop == "all sweeps done"
    assert max(result.report.deviation.values()) <= 0.05


def test_the_warning_is_public():
    assert remeshvec.RemeshWarning is RemeshWarning and issubclass(RemeshWarning, UserWarning)
