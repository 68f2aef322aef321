"""What no mesh shows: when sweeps have done their work, and how faces grow as lengths shrink."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.meshes import load_arrays
from remeshvec import OptionError, remesh

from .scene import lengths

SIZE, DPI = (7.0, 2.7), 120
OURS, LOUD = "#1565c0", "#c2185b"


def draw_plot(path: Path, plot: Any, largest: int) -> None:
    """Draw a plot into a PNG file."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=SIZE, layout="constrained")
    plot(axes)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
    pyplot.close(figure)
    if path.stat().st_size > largest:
        raise SystemExit(f"{path.name}: {path.stat().st_size:,} bytes, more than {largest:,}")


def tol(axes: Any) -> None:
    """Edges that every sweep changes, and where ``tol`` ends the call."""
    V, F = load_arrays("creature")
    for choice, colour, width in ((None, OURS, 4.5), (0.1, LOUD, 1.8)):
        result = remesh(V, F, 0.06, tol=choice)
        n_edges = 1.5 * len(result.F)
        shares = [sum(sweep.values()) / n_edges for sweep in result.report.sweeps]
        label = f"tol={choice}: {len(shares)} sweeps"
        axes.semilogy(range(1, len(shares) + 1), shares, "o-", color=colour, lw=width, label=label)
    axes.axhline(0.1, color="#555555", lw=1, ls="--")
    axes.set(xlabel="sweep", ylabel="edges changed / edges")
    axes.legend()


def callback(axes: Any) -> None:
    """Plot counts as ``callback`` sees them, phase by phase."""
    V, F = load_arrays("creature")
    seen: dict[str, list[int]] = {}
    remesh(V, F, 0.06, callback=lambda sweep, phase, n: seen.setdefault(phase, []).append(n))
    for phase, colour in (("split", OURS), ("collapse", LOUD), ("flip", "#2e7d32")):
        counts = np.maximum(seen[phase], 0.5)
        axes.semilogy(range(1, len(counts) + 1), counts, "o-", color=colour, label=phase)
    axes.set(xlabel="sweep", ylabel="count")
    axes.legend()


def max_faces(axes: Any) -> None:
    """Faces against the length; beyond ``max_faces`` a call is refused before any work."""
    V, F = load_arrays("creature")
    limit, refused = 10_000, []
    for L in np.geomspace(0.15, 0.02, 9):
        try:
            result = remesh(V, F, L, preset="fast", max_faces=limit)
        except OptionError:
            refused.append(L)
        else:
            axes.loglog(L, len(result.F), "o", color=OURS)
    for L in refused:
        axes.axvline(L, color=LOUD, lw=1.5)
    axes.axhline(limit, color="#555555", lw=1, ls="--")
    mean = lengths(V, F).mean()
    axes.set(xlabel=f"L (mean edge of the input: {mean:.3f}); lines: refused", ylabel="faces")


PICTURES = (tol, callback, max_faces)
