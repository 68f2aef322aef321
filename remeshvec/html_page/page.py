"""An HTML page that shows a result, with Plotly inside (the extra ``[html]``).

`html_report` returns the page, `write_html` writes it, `show_html` shows it in a notebook or in the
browser. The page loads nothing: it contains its scripts, styles and meshes, and its security policy
forbids the use of the network. The same result gives the same page, bit for bit.

`views` and `charts` make 3D views and histograms as plain data, and ``report.js`` draws them. Meshes are
passed to Plotly as typed arrays, which all its versions accept.
"""

from __future__ import annotations

import html
import importlib
import json
import os
import sys
import tempfile
import webbrowser
from collections.abc import Iterable, Sequence
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any, cast

from ..core import arguments
from ..core.check import as_array
from ..core.version import __version__
from ..errors import OptionError, RemeshvecError
from ..files.disk import check_writable, write_file
from ..measures.quality import elements
from ..measures.record import Quality
from ..viz.pictures import UP
from .charts import build_charts
from .views import build_views

if TYPE_CHECKING:
    from ..output.report import Report
    from ..output.result import RemeshResult

__all__ = [
    "PAGE_SUFFIXES",
    "PlotlyMissingError",
    "html_report",
    "require_plotly",
    "show_html",
    "write_html",
]

PAGE_SUFFIXES = (".html", ".htm")
FRAME_HEIGHT = 900  # pixels, in a notebook


class PlotlyMissingError(RemeshvecError, ImportError):
    """Plotly is not installed."""


def html_report(result: RemeshResult, *, title: str = "", command: str = "", up: str = "y") -> str:
    """Return a page that shows a result: one HTML file that needs neither a network nor a server.

    The page has both meshes in linked 3D views, coloured by shape, smallest angle or area of the faces;
    overlaid histograms of edge lengths, angles, valences and areas; the measures; the options, sweeps
    and version. Creases and other curves that were kept are red. For meshes with more than 200,000
    faces the views show a part, and above 50,000 faces they leave edges out. The page says so.

    Parameters
    ----------
    result : RemeshResult
        Result of `remesh`. The page reads the input arrays again.
    title : str
        Heading, such as the name of the mesh.
    command : str
        Text of the call, shown among the options.
    up : {"y", "z"}
        Axis that points up in the first view.

    Returns
    -------
    str
        The page; Plotly takes about 5 MB of it.

    Raises
    ------
    PlotlyMissingError
        Plotly is not installed.
    OptionError
        An argument is invalid.
    """
    report = _report_of(result)
    up = arguments.choice(up, "up", UP)
    title, command = arguments.text(title, "title"), arguments.text(command, "command")
    plotly = require_plotly()
    qualities = (report.quality_before, report.quality_after)
    measured = (elements(*report.before), elements(*report.after))
    curves = (
        as_array(result.input_feature_edges, "input_feature_edges"),  # not tensors
        as_array(result.feature_edges, "feature_edges"),
    )
    views = build_views(measured, curves, qualities, report.target_length, up)
    charts = build_charts(measured, qualities, report.target_length)
    return Template(_part("report.html")).substitute(
        title=_text(title or "Remeshing report"),
        summary=_summary_table(report),
        tiles=_tiles(*qualities),
        faces_before=f"{qualities[0].faces:,}",
        faces_after=f"{qualities[1].faces:,}",
        notes="".join(f"<p>{_text(note)}</p>" for note in views.notes),
        measures=_table(
            [
                (label, old, new)
                for (label, old), (_, new) in zip(
                    qualities[0].rows(), qualities[1].rows(), strict=True
                )
            ],
            ("", "before", "after"),
        ),
        call=_call(report, command),
        options=_table(_options(report)),
        seconds=_table([(_words(name), f"{s:.4f}") for name, s in report.seconds.items()]),
        sweeps=_sweeps(report.sweeps),
        version=_text(__version__),
        style=_part("report.css"),
        plotly=plotly.get_plotlyjs(),
        data=_page_json({"scene": views.scene, "charts": charts}),
        script=_part("report.js"),
    )


def write_html(
    path: str | os.PathLike[str],
    result: RemeshResult,
    *,
    title: str = "",
    command: str = "",
    up: str = "y",
) -> None:
    """Write the page of `html_report`, whole or not at all.

    Parameters
    ----------
    path : str or path
        File with the suffix .html or .htm; an existing file is replaced when the new one is complete.
    result, title, command, up
        As for `html_report`.

    Raises
    ------
    PlotlyMissingError
        Plotly is not installed.
    MeshFormatError
        The file cannot be written.
    OptionError
        An argument is invalid.
    """
    check_writable(arguments.path(path, "path"), PAGE_SUFFIXES)
    page = html_report(result, title=title, command=command, up=up)
    write_file(path, page.encode())


def show_html(result: RemeshResult, *, title: str = "", up: str = "y") -> None:
    """Show the page of `html_report` below the cell of a Jupyter notebook, or in the browser.

    A saved notebook contains the page, about 5 MB. For a browser, the page is written to the folder for
    temporary files and stays there; if there is no browser, its path is printed.

    Parameters and errors are those of `html_report`.
    """
    page = html_report(result, title=title, up=up)
    if _is_in_notebook():
        display = importlib.import_module("IPython.display")
        display.display(display.HTML(_page_frame(page)))
        return
    path = Path(tempfile.mkdtemp(prefix="remeshvec-")) / "report.html"
    write_file(path, page.encode())
    if not webbrowser.open(path.as_uri()):
        print(f"there is no browser to open; the page is {path}")


def require_plotly() -> Any:
    """Import the module with Plotly's script and return it; call this before long work for a page.

    Raises
    ------
    PlotlyMissingError
        Plotly is not installed.
    """
    try:
        return importlib.import_module("plotly.offline")
    except ImportError as error:
        raise PlotlyMissingError("HTML pages need Plotly: pip install plotly") from error


def _report_of(result: Any) -> Report:
    """Return the report of a result; this folder must not import its type."""
    report = getattr(result, "report", None)
    if not hasattr(report, "quality_after"):
        raise OptionError(
            f"result must be a RemeshResult; got an object of type {type(result).__name__}"
        )
    return cast("Report", report)


def _is_in_notebook() -> bool:
    """Tell whether a Jupyter kernel runs this; IPython in a terminal cannot show HTML."""
    ipython = sys.modules.get("IPython")  # a notebook has imported it
    shell = ipython.get_ipython() if ipython else None
    return getattr(shell, "kernel", None) is not None


def _page_frame(page: str) -> str:
    """Wrap a page in a frame that separates its styles and names from those of the notebook."""
    return (
        f'<div><iframe srcdoc="{html.escape(page)}" sandbox="allow-scripts allow-downloads" '
        f'style="width:100%;height:{FRAME_HEIGHT}px;border:0"></iframe></div>'
    )


def _part(name: str) -> str:
    return (files("remeshvec.html_page") / name).read_text("utf-8")


def _text(value: object) -> str:
    """Escape for HTML; replace lone surrogates, which file names may hold and UTF-8 cannot."""
    return html.escape(str(value).encode("utf-8", "replace").decode())


def _page_json(value: Any) -> str:
    """Return JSON that is safe in a script element: it holds no angle brackets."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e")


def _table(rows: Iterable[Sequence[object]], heading: Sequence[str] = ()) -> str:
    """Return an HTML table; the first column names the rows."""
    lines = ["<table>"]
    if heading:
        cells = "".join(f'<th scope="col">{_text(name)}</th>' for name in heading)
        lines.append(f"<thead><tr>{cells}</tr></thead>")
    for first, *others in rows:
        cells = "".join(f"<td>{_text(other)}</td>" for other in others)
        lines.append(f'<tr><th scope="row">{_text(first)}</th>{cells}</tr>')
    return "\n".join([*lines, "</table>"])


def _summary_table(report: Report) -> str:
    total = report.seconds.get("total", 0.0)
    return _text(
        f"Target length L = {report.target_length:.4g}, preset {report.preset}, "
        f"{len(report.sweeps)} sweeps in {total:.2f} s."
    )


def _tiles(before: Quality, after: Quality) -> str:
    """Return tiles with the most important figures, before and after."""
    chosen = (
        "faces",
        "edges in 4/5 to 4/3 L",
        "smallest angle",
        "smallest angle, mean",
        "valence 6 (inner)",
        "area error, faces",
    )
    old, new = dict(before.rows()), dict(after.rows())
    tile = (
        '<div class="tile"><span>{}</span><b><i class="before">{}</i> → '
        '<i class="after">{}</i></b></div>'
    )
    return "\n".join(
        tile.format(*(_text(_degrees(text)) for text in (name, old[name], new[name])))
        for name in chosen
    )


def _degrees(text: str) -> str:
    return text.replace(" deg", "°").replace(" %", " %")


def _call(report: Report, command: str) -> str:
    """Return a table of the call and of the notes in the report."""
    rows = [("call", command)] if command else []
    rows += [("sweeps ended", report.stop)]
    rows += [(f"input: {_words(name)}", f"{n:,}") for name, n in report.dirt.items()]
    rows += [(f"features: {_words(name)}", f"{n:,}") for name, n in report.features.items() if n]
    rows += [(f"deviation {_words(way)}", f"{d:.4g}") for way, d in report.deviation.items()]
    rows += [(f"clearance: {_words(name)}", f"{x:,.4g}") for name, x in report.clearance.items()]
    rows += [("remeshvec", __version__)]
    return _table(rows)


def _options(report: Report) -> list[tuple[str, str]]:
    return [(_words(name), _shown_value(value)) for name, value in vars(report.options).items()]


def _shown_value(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(_shown_value(entry) for entry in value)
    if value is None or isinstance(value, bool):
        return {None: "–", True: "yes", False: "no"}[value]
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _sweeps(sweeps: list[dict[str, int]]) -> str:
    if not sweeps:
        return _table([])
    names = list(sweeps[0])
    rows = [
        (k + 1, *(f"{sweep.get(name, 0):,}" for name in names)) for k, sweep in enumerate(sweeps)
    ]
    return _table(rows, ("sweep", *map(_words, names)))


def _words(name: str) -> str:
    return name.replace("_", " ")
