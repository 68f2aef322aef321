"""The histograms of the HTML page, counted here so that the page holds only the bars."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..core.vocabulary import EQUILATERAL_AREA, FloatArray
from ..measures.quality import Elements
from ..measures.record import Quality

__all__ = ["build_charts"]


BARS = 50
MOST_VALENCE = 12  # larger valences are counted as this one


def build_charts(
    elements: tuple[Elements, Elements], qualities: tuple[Quality, Quality], length: float
) -> list[dict[str, Any]]:
    """Count edge lengths, angles, valences and areas, before and after, into the same bars.

    Parameters
    ----------
    elements : (Elements, Elements)
        Edges and faces of the meshes before and after.
    qualities : (Quality, Quality)
        Measures of the same meshes; they hold the valences.
    length : float
        Target length L, the unit of lengths; the unit of areas is an equilateral triangle with edges L.

    Returns
    -------
    list of dict
        JSON-ready: centres and width of the bars, counts and percentages before and after, the ideal
        value, and labels.
    """
    unit_area = EQUILATERAL_AREA * length**2
    return [
        _lengths_like(
            "Edge lengths", "edge length / L", elements, lambda one: one.edge_lengths / length
        ),
        _angles(elements),
        _valences(qualities),
        _lengths_like(
            "Areas",
            "face area / area of an equilateral face with edges L",
            elements,
            lambda one: one.areas / unit_area,
        ),
    ]


def _lengths_like(
    name: str,
    axis: str,
    elements: tuple[Elements, Elements],
    measure: Callable[[Elements], FloatArray],
) -> dict[str, Any]:
    """Count values without an upper bound; the last bar may hold the largest half percent."""
    values = [measure(one) for one in elements]
    top = float(np.clip(max(np.percentile(v, 99.5) if len(v) else 0 for v in values), 1.9, 3.9))
    top = np.ceil(10 * top + 1) / 10
    edges = np.linspace(0, top, BARS + 1)
    return _chart(name, axis, edges, values, ideal=1.0)


def _angles(elements: tuple[Elements, Elements]) -> dict[str, Any]:
    values = [one.angles.ravel() for one in elements]
    return _chart("Angles", "angle, degrees", np.arange(0, 181, 3.0), values, ideal=60.0)


def _valences(qualities: tuple[Quality, Quality]) -> dict[str, Any]:
    values = [
        np.repeat(np.array(list(counts), dtype=float), np.array(list(counts.values()), dtype=int))
        for counts in (one.valence_histogram for one in qualities)
    ]
    top = int(min(max(v.max(initial=8) for v in values), MOST_VALENCE))
    chart = _chart(
        "Valences", "edges at an inner vertex", np.arange(2.5, top + 1), values, ideal=6.0
    )
    return {**chart, "whole": True}


def _chart(
    name: str, axis: str, edges: FloatArray, values: list[FloatArray], ideal: float
) -> dict[str, Any]:
    counts = [np.histogram(np.clip(v, edges[0], edges[-1]), edges)[0] for v in values]
    above = [int(np.count_nonzero(v > edges[-1])) for v in values]
    return {
        "name": name,
        "axis": axis + (" (last bar: and more)" if any(above) else ""),
        "ideal": ideal,
        "width": float(edges[1] - edges[0]),
        "centres": [round(float(x), 6) for x in (edges[1:] + edges[:-1]) / 2],
        "counts": [one.tolist() for one in counts],
        "percent": [np.round(100 * one / max(one.sum(), 1), 4).tolist() for one in counts],
    }
