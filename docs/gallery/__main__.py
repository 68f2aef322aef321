"""Make the pictures of the gallery, from the root of a checkout.

``python -m docs.gallery [NAME ...] [--output FOLDER]``
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.panels import draw, read_arguments

from . import kept, lengths, plots, sweeps

PICTURES = {
    function.__name__: function
    for module in (lengths, kept, sweeps)
    for function in module.PICTURES
}
PLOTS = {function.__name__: function for function in plots.PICTURES}
NAMES = [*PICTURES, *PLOTS]
FOLDER = Path(__file__).resolve().parents[1] / "pictures" / "options"
LARGEST = 150_000  # bytes of a file


def main(argv: Sequence[str] | None = None) -> int:
    """Make the pictures asked for."""
    arguments = read_arguments(argv, "docs.gallery", __doc__, NAMES, FOLDER)
    for name in arguments.names or NAMES:
        path = arguments.output / f"{name}.png"
        if name in PLOTS:
            plots.draw_plot(path, PLOTS[name], LARGEST)
        else:
            draw(path, PICTURES[name](), LARGEST)
        print(f"wrote {path} ({path.stat().st_size / 1000:.0f} KB)", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
