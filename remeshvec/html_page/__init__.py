"""An HTML page that shows a result, with Plotly inside (the extra ``[html]``)."""

from .page import (
    PAGE_SUFFIXES,
    PlotlyMissingError,
    html_report,
    require_plotly,
    show_html,
    write_html,
)

__all__ = [
    "PAGE_SUFFIXES",
    "PlotlyMissingError",
    "html_report",
    "require_plotly",
    "show_html",
    "write_html",
]


def __dir__() -> list[str]:
    return list(__all__)
